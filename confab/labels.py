"""What people call things: sentences about facts, conditions and steps in the ontology's labels, not in names and IDs.

A behaviour's label is a sentence about its roles ("move object to location"), so the individuals are put in for the roles that
it mentions ("move cup 1 to location 7"); what it doesn't mention stands in brackets behind it. A fact is said by the label of its
situation type's property ("cup 1 is at location 7"). What has no label keeps its name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from confab.planner.plan import Step
from confab.reasoner.graph.knowledge import KnowledgeGraph, text
from confab.reasoner.names import Names
from confab.reasoner.sentences import denied, said
from confab.reasoner.symbols import FALSE, TRUE, Behavior, Condition, Domain, Fact, Problem, Symbol

LABELS = """SELECT ?of ?label (LANG(?label) AS ?language) WHERE {{
  VALUES ?of {{ {those} }} ?of rdfs:label ?label }} ORDER BY ?of ?language ?label"""
PROPERTIES = "SELECT ?situation ?property WHERE { ?situation :valueProperty ?property } ORDER BY ?situation ?property"
AT_ONCE = 400
"""So many labels are asked for in one query."""


@dataclass(frozen=True)
class Labels:
    """Names and what people call them; `verbs` are the labels of situation types' properties."""

    words: Mapping[str, str]
    verbs: Mapping[str, str]
    domain: Domain

    def name(self, name: str) -> str:
        """Return what people call something."""
        return self.words.get(name, name.lstrip("?"))

    def fact(self, fact: Fact) -> str:
        """Return a fact as a sentence."""
        situation, (about, *rest) = fact.symbol.situation, fact.symbol.arguments or ("",)
        kind = self.domain.situations.get(situation)
        boolean = kind is not None and kind.boolean
        if kind is not None and kind.quantity is not None and kind.quantity.unit and fact.value:
            fact = Fact(fact.symbol, f"{fact.value} {kind.quantity.unit}")
        if situation not in self.verbs and situation in self.words and about and not boolean:
            of = " ".join(map(self.name, (about, *rest)))
            return f"{self.words[situation]} of {of} is {self.name(fact.value)}"
        named = self.words.get(situation, "")
        of_itself = f"is {named.removeprefix('being ')}" if boolean and named.startswith("being ") else situation
        verb = self.verbs.get(situation, of_itself)
        value = [] if boolean and fact.value in (TRUE, FALSE) else [fact.value]
        verb = _chosen(verb, self.name(fact.value)) if not rest and value else verb
        if verb.endswith(f" {self.name(fact.value)}"):
            value = []
        words = [*([self.name(about)] if about else []), verb, *map(self.name, (*rest, *value))]
        return denied(_joined(words)) if boolean and fact.value == FALSE else _joined(words)

    def about(self, symbol: Symbol) -> str:
        """Return the beginning of a sentence that a value of a symbol ends: "cup 1 is at"."""
        names = [self.name(name) for name in symbol.arguments]
        verb = self.verbs.get(symbol.situation)
        if verb is None or not names:
            return " · ".join([*names, self.name(symbol.situation)])
        return _joined([names[0], verb, *names[1:]])

    def condition(self, condition: Condition) -> str:
        """Return a condition as a sentence."""
        return said(condition, lambda what: self.fact(what) if isinstance(what, Fact) else self.name(what))

    def step(self, step: Step) -> str:
        """Return what a step does as a sentence."""
        behavior = self.domain.behaviors[step.behavior]
        terms = dict(zip((p.name for p in behavior.parameters), step.arguments, strict=True))
        terms |= {f"?{name.lstrip('?')}": value for name, value in step.bindings.items()}
        return self.behavior(behavior, terms)

    def behavior(self, behavior: Behavior, terms: Mapping[str, str]) -> str:
        """Return what a behaviour does, with individuals for some of its roles, as a sentence."""
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
            label = label.replace(mark, name)
        rest = dict.fromkeys(self.name(terms[role]) for role in roles if role in terms and role not in mentioned)
        return f"{label} ({', '.join(rest)})" if rest else label


PLACING = {"at", "in", "on", "under", "to"}
WAYS = {*PLACING, "from", "into", "onto", "with", "by", "off", "over", "behind", "beside"}
"""Words that stand before what a role is filled with, where the role itself is called so."""


def _mention(role: str, label: str, terms: Iterable[str]) -> re.Pattern[str] | None:
    """Return what in a label stands for a role, or None; of a role called "onto" it is what stands behind that word."""
    name = role.lstrip("?")
    if name.lower() in WAYS:
        others = "|".join(re.escape(term.lstrip("?")) for term in terms)
        pattern = re.compile(rf"\b({re.escape(name)} )(?:the |an? )?(?!(?:{others})\b)\w+\b", re.IGNORECASE)
    else:
        pattern = re.compile(rf"\b()(?:the |an? )?{re.escape(name)}\b", re.IGNORECASE)
    return pattern if pattern.search(label) else None


def _chosen(verb: str, value: str) -> str:
    """Return a property's label that names the values with the one that there is.

    >>> _chosen("is tied up or loose", "loose"), _chosen("is clean or dirty", "clean"), _chosen("is at", "cup 1")
    ('is loose', 'is clean', 'is at')
    """
    first, _, alternatives = verb.partition(" ")
    return f"{first} {value}" if value in alternatives.split(" or ") and " or " in alternatives else verb


def _joined(parts: Sequence[str]) -> str:
    """Return parts of a sentence as one, without a word said twice or two prepositions in a row.

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


def labels_of(knowledge: KnowledgeGraph, names: Names, problem: Problem) -> Labels:
    """Return the labels of a problem's behaviours, situation types, classes and individuals.

    Parameters
    ----------
    knowledge : KnowledgeGraph
    names : Names
        Lead to the IRIs.
    problem : Problem
    """
    domain = problem.domain
    spoken = {*domain.behaviors, *domain.situations, *problem.classes, *problem.relations}
    spoken |= problem.individuals
    behaviors = domain.behaviors.values()
    spoken |= {term for b in behaviors for effect in b.effects for term in (*effect.arguments, effect.value)}
    properties = {names.short(text(row[0])): text(row[1]) for row in knowledge.select(PROPERTIES)}
    iris = {names.iri(name): name for name in spoken if name in names}
    found = _read(knowledge, sorted({*iris, *properties.values()}))
    words = {name: found[iri] for iri, name in iris.items() if iri in found}
    verbs = {situation: found[iri] for situation, iri in properties.items() if iri in found}
    return Labels(words, verbs, domain)


def _read(knowledge: KnowledgeGraph, iris: Sequence[str]) -> dict[str, str]:
    """Return the labels of some IRIs; English ones before those of no language, these before others."""
    found: dict[str, tuple[int, str]] = {}
    for start in range(0, len(iris), AT_ONCE):
        those = " ".join(f"<{iri}>" for iri in iris[start : start + AT_ONCE])
        for row in knowledge.select(LABELS.format(those=those)):
            iri, label, language = (text(term) for term in row)
            rank = 0 if language.startswith("en") else 1 if not language else 2
            if iri not in found or rank < found[iri][0]:
                found[iri] = rank, label
    return {iri: label for iri, (_, label) in found.items()}
