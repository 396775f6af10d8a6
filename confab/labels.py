"""Sentences about facts, conditions and steps, in the labels of the ontology.

The label of a behaviour is a sentence about its roles ("move object to location"). Individuals replace the roles that the label
mentions ("move cup 1 to location 7"); the other individuals follow in brackets. A fact uses the label of the value property of its
situation type ("cup 1 is at location 7"). A term without a label keeps its name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from confab.planner.plan import Step
from confab.reasoner.derivation import conditions_of_goal
from confab.reasoner.graph.knowledge import KnowledgeGraph, text
from confab.reasoner.names import Names, brief, known_as
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.sentences import denied, said
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Condition, Fact, Symbol

LABELS = """SELECT ?of ?label (LANG(?label) AS ?language) WHERE {{
  VALUES ?of {{ {those} }} ?of rdfs:label ?label }} ORDER BY ?of ?language ?label"""
PROPERTIES = "SELECT ?situation ?property WHERE { ?situation :valueProperty ?property } ORDER BY ?situation ?property"
WORD = r"[\w-]+(?:\.\w+)*"
NAMED = re.compile(
    rf"<(?P<symbol>{WORD}(?:, {WORD})+)> is (?P<value>{WORD})"
    rf"|(?P<of>\w+) of (?P<about>{WORD}(?:, {WORD})*): "
    rf"|(?P<words>{WORD}(?: {WORD})*)"
)
"""Pattern that finds symbols with a value, symbols before a colon, and words that may contain facts."""
AT_ONCE = 400
"""Maximum number of terms in one query for labels."""


@known_as("a set of labels")
@brief
@dataclass(frozen=True)
class Labels:
    """Labels of terms by name (`words`), and labels of value properties by situation type (`verbs`)."""

    words: Mapping[str, str]
    verbs: Mapping[str, str]
    domain: Domain

    def name(self, name: str) -> str:
        """Return the label of a term; a term without a label keeps its name."""
        return self.words.get(name, name.lstrip("?"))

    def verb(self, situation: str) -> str:
        """Return the label of a value property, or the label of a situation type that begins with *is*; otherwise an empty text."""
        label = self.words.get(situation, "")
        return self.verbs.get(situation, label if label.startswith("is ") else "")

    def fact(self, fact: Fact) -> str:
        """Return a fact as a sentence."""
        situation, (about, *rest) = fact.symbol.situation, fact.symbol.arguments or ("",)
        if goal := conditions_of_goal(self.domain, fact.symbol):
            wanted = self.words.get(situation) or " and ".join(map(self.condition, goal))
            return denied(wanted) if fact.value == FALSE else wanted
        kind = self.domain.situations.get(situation)
        boolean = kind is not None and kind.boolean
        unit = kind.quantity.unit if kind is not None and kind.quantity is not None else ""
        if unit and fact.value:
            fact = Fact(fact.symbol, f"{fact.value} {unit}")
        if not self.verb(situation) and situation in self.words and about and not boolean:
            of = " ".join(map(self.name, (about, *rest)))
            return f"{self.words[situation]} of {of} is {self.name(fact.value)}"
        named = self.words.get(situation, "")
        of_itself = f"is {named.removeprefix('being ') or situation}" if boolean and not rest else situation
        verb = (self.verb(situation) or of_itself).removesuffix(f" {unit}" if unit else "")
        value = [] if boolean and fact.value in (TRUE, FALSE) else [fact.value]
        verb = _chosen(verb, self.name(fact.value)) if not rest and value else verb
        if verb.endswith(f" {self.name(fact.value)}"):
            value = []
        subject = [self.placed(about)] if about else []
        words = [*subject, verb, *map(self.name, (*rest, *value))]
        return denied(_joined(words)) if boolean and fact.value == FALSE else _joined(words)

    def sentence(self, text: str) -> str:
        """Return a text with its facts replaced by sentences, and its names of individuals replaced by labels.

        >>> import confab
        >>> scene = confab.load("beverage-serving")
        >>> labels_of(scene.knowledge, scene.names, scene.problem).sentence("since cup1 LOCATION location7, in left_hand")
        'since cup 1 is at location 7, in left hand'
        """
        return NAMED.sub(self._replaced, text)

    def _replaced(self, found: re.Match[str]) -> str:
        """Return the sentence or label that replaces a match of the pattern `NAMED`."""
        situations = self.domain.situations
        *arguments, situation = (found["symbol"] or f"{found['about']}, {found['of']}").split(", ")
        if found["words"] is None:
            if situation not in situations:
                return found[0]
            symbol = Symbol(situation, tuple(arguments))
            return f"{self.about(symbol)}: " if found["value"] is None else self.fact(Fact(symbol, found["value"]))
        words, said = found["words"].split(" "), list[str]()
        while words:
            kind = situations.get(words[1]) if len(words) > 1 else None
            length = 1 if kind is None else 2 + len(kind.arguments)
            if words[0] in situations and words[1:] and words[1] in self.words:
                said.append(f"“{self.fact(Fact(Symbol(words[0], ('',)), words[1]))}”")
                words = words[2:]
                continue
            these, words = words[:length], words[length:]
            if kind is not None and len(these) == length:
                said.append(self.fact(Fact(Symbol(kind.name, (these[0], *these[2:-1])), these[-1])))
            else:
                said += [word if word in self.domain.behaviors else self.words.get(word, word) for word in these]
        return " ".join(said)

    def placed(self, name: str) -> str:
        """Return the label of an individual as a noun phrase: the label "in the box" becomes "the place in the box"."""
        label = self.name(name)
        first, *more = label.split(" ")
        return f"the place {label}" if first in PLACING and more and more[-1] not in WAYS | {"of"} else label

    def about(self, symbol: Symbol) -> str:
        """Return the beginning of a sentence about a symbol, without the symbol's value, such as "cup 1 is at"."""
        names = [self.name(name) for name in symbol.arguments]
        verb = self.verb(symbol.situation)
        if not verb or not names:
            return " · ".join([*names, self.name(symbol.situation)])
        return _joined([names[0], verb, *names[1:]])

    def condition(self, condition: Condition) -> str:
        """Return a condition as a sentence."""
        return said(condition, lambda what: self.fact(what) if isinstance(what, Fact) else self.placed(what))

    def step(self, step: Step) -> str:
        """Return a step as a sentence, or the different sentences of steps that are refined together."""
        return "; ".join(
            dict.fromkeys(self.grounded(one.behavior, one.arguments, one.bindings) for one in step.together)
        )

    def grounded(self, name: str, arguments: Sequence[str], bindings: Mapping[str, str] | None = None) -> str:
        """Return a behaviour with its arguments as a sentence; arguments that are variables aren't mentioned."""
        behavior = self.domain.behaviors[name]
        terms = dict(zip((p.name for p in behavior.parameters), arguments, strict=True))
        terms |= {f"?{name.lstrip('?')}": value for name, value in (bindings or {}).items()}
        return self.behavior(behavior, {term: value for term, value in terms.items() if not value.startswith("?")})

    def behavior(self, behavior: Behavior, terms: Mapping[str, str]) -> str:
        """Return a behaviour as a sentence, in which `terms` (for example individuals) replace some of its roles."""
        label = self.words.get(behavior.name)
        if label is None:
            return " ".join((behavior.name, *(self.name(terms.get(p.name, p.name)) for p in behavior.parameters)))
        changed = {term for effect in behavior.effects for term in (*effect.arguments, effect.value)}
        roles = [p.name for p in behavior.parameters]
        roles += [v.name for v in behavior.variables if v.name in changed]
        mentioned = {role: pattern for role in terms if (pattern := _mention(role, label, terms)) is not None}
        marks = {f"\0{number}\0": self.name(terms[role]) for number, role in enumerate(mentioned)}
        for mark, pattern in zip(marks, mentioned.values(), strict=True):
            label = pattern.sub(rf"\g<1>{mark}", label, count=1)
        for mark, name in marks.items():
            if name.split(" ")[0] in PLACING:  # "put letter in the box" instead of "put letter to in the box"
                label = re.sub(rf"\b(?:{'|'.join(PLACING)}) {mark}", mark, label)
            label = label.replace(mark, name)
        rest = dict.fromkeys(self.name(terms[role]) for role in roles if role in terms and role not in mentioned)
        return f"{label} ({', '.join(rest)})" if rest else label


PLACING = {"at", "in", "on", "under", "to"}
WAYS = {*PLACING, "from", "into", "onto", "with", "by", "off", "over", "behind", "beside"}
"""Prepositions that may name roles: in "move onto block", the role `onto` is the block."""


def _mention(role: str, label: str, terms: Iterable[str]) -> re.Pattern[str] | None:
    """Return a pattern of the words for a role in a label, or None.

    The words after "onto" in a label denote the role named "onto".
    """
    name = role.lstrip("?")
    if name.lower() in WAYS:
        others = "|".join(re.escape(term.lstrip("?")) for term in terms)
        pattern = re.compile(rf"\b({re.escape(name)} )(?:the |an? )?(?!(?:{others})\b)\w+\b", re.IGNORECASE)
    else:
        pattern = re.compile(rf"\b()(?:the |an? )?{re.escape(name)}\b", re.IGNORECASE)
    return pattern if pattern.search(label) else None


def _chosen(verb: str, value: str) -> str:
    """Return the label of a property. If the label lists the possible values, only the given value is kept.

    >>> _chosen("is tied up or loose", "loose"), _chosen("is clean or dirty", "clean"), _chosen("is at", "cup 1")
    ('is loose', 'is clean', 'is at')
    """
    first, _, alternatives = verb.partition(" ")
    return f"{first} {value}" if value in alternatives.split(" or ") and " or " in alternatives else verb


def _joined(parts: Sequence[str]) -> str:
    """Join the parts of a sentence without repeated words and without two successive prepositions.

    >>> _joined(["left hand", "hand is at", "cup 1"]), _joined(["cup 1", "is at", "in a hand"])
    ('left hand is at cup 1', 'cup 1 is in a hand')
    """
    words: list[str] = []
    for part in parts:
        for number, word in enumerate(part.split()):
            if words and number == 0 and word == words[-1]:
                continue
            if words and number == 0 and {word, words[-1]} <= PLACING:
                words.pop()
            words.append(word)
    return " ".join(words)


def labels_of(knowledge: KnowledgeGraph, names: Names, problem: Problem, others: Iterable[str] = ()) -> Labels:
    """Return the labels of a problem's behaviours, situation types, classes and individuals.

    Parameters
    ----------
    knowledge : KnowledgeGraph
    names : Names
        A mapping between the names and their IRIs.
    problem : Problem
    others : iterable of str
        Further names whose labels are wanted, for instance of furniture, which isn't in the problem.
    """
    domain = problem.domain
    spoken = {*domain.behaviors, *domain.situations, *problem.classes, *problem.relations}
    spoken |= {*problem.individuals, *others}
    behaviors = domain.behaviors.values()
    spoken |= {term for b in behaviors for effect in b.effects for term in (*effect.arguments, effect.value)}
    properties = {names.short(text(row[0])): text(row[1]) for row in knowledge.select(PROPERTIES)}
    iris = {names.iri(name): name for name in spoken if name in names}
    found = _read(knowledge, sorted({*iris, *properties.values()}))
    words = {name: found[iri] for iri, name in iris.items() if iri in found}
    verbs = {situation: found[iri] for situation, iri in properties.items() if iri in found}
    return Labels(words, verbs, domain)


def _read(knowledge: KnowledgeGraph, iris: Sequence[str]) -> dict[str, str]:
    """Return the labels of IRIs: in English if possible, otherwise without a language, otherwise in another language."""
    found: dict[str, tuple[int, str]] = {}
    for start in range(0, len(iris), AT_ONCE):
        those = " ".join(f"<{iri}>" for iri in iris[start : start + AT_ONCE])
        for row in knowledge.select(LABELS.format(those=those)):
            iri, label, language = (text(term) for term in row)
            rank = 0 if language.startswith("en") else 1 if not language else 2
            if iri not in found or rank < found[iri][0]:
                found[iri] = rank, label
    return {iri: label for iri, (_, label) in found.items()}
