"""Parser of PDDL texts, which checks all declarations and formulas.

The supported subset contains types, constants, predicates, functions, actions with conditional and quantified effects, durative
actions, derived predicates, action costs, timed initial literals, goal preferences, and the constraints ``always``, ``sometime``,
``sometime-before`` and ``at-most-once``. Other constructs are rejected by an error that names the construct. Every error states
file, line and column.

The parser of unified-planning isn't used, because that parser reports an undefined type as a ``KeyError`` without a message,
states no position for half of the errors, and takes 0.2 to 0.5 s for problems that this parser reads in 2 ms.

McDermott et al., "PDDL: the planning domain definition language", 1998; Fox and Long, "PDDL2.1", JAIR 20 (2003).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from confab.reasoner.limits import checked
from confab.reasoner.pddl.declarations import CHANGES, COMPARISONS, Action, Axiom, Pddl, Typed, either
from confab.reasoner.pddl.durative import Durative, NotTimedError, duration_in, timed, whole
from confab.reasoner.pddl.forms import distinct
from confab.reasoner.pddl.metric import Metric
from confab.reasoner.pddl.words import MOST_BYTES, Form, PddlError, PddlWord, form_of, is_number

SECTIONS = {
    ":process": "processes",
    ":event": "events",
    ":task": "HDDL tasks",
    ":method": "HDDL methods",
    ":htn": "HDDL task networks",
}

EARLIER = {"sometime": 2, "sometime-before": 3, "at-most-once": 2}
"""The constraints that concern several states of a plan, each with the number of items in its PDDL expression."""


def parse_files(domain: Path, problem: Path) -> Pddl:
    """Parse the files of a domain and a problem.

    Raises
    ------
    PddlError
        A file can't be read, is larger than 32 MB, or isn't PDDL of the supported subset.
    """
    texts = []
    for path in (domain, problem):
        try:
            if path.stat().st_size > MOST_BYTES:
                raise PddlError(f"{path}: {path.stat().st_size >> 20} MB, more than the {MOST_BYTES >> 20} MB allowed")
            texts.append(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise PddlError(f"{path}: can't be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise PddlError(f"{path}: no text in UTF-8 (byte {error.start})") from error
    return parse(texts[0], texts[1], str(domain), str(problem))


def parse(domain: str, problem: str, domain_file: str = "domain", problem_file: str = "problem") -> Pddl:
    """Parse the texts of a domain and a problem; the file names are used in error messages.

    >>> pddl = parse("(define (domain d) (:predicates (p ?x)) (:action a :parameters (?x) :effect (p ?x)))",
    ...              "(define (problem e) (:domain d) (:objects o) (:init) (:goal (p o)))")
    >>> list(pddl.actions), pddl.objects
    (['a'], {'o': 'object'})
    """
    found = Pddl()
    _Reader(domain_file, found).domain(form_of(domain, domain_file))
    _Reader(problem_file, found, {axiom.predicate for axiom in found.axioms}).problem(form_of(problem, problem_file))
    return found


@dataclass
class _Reader:
    file: str
    pddl: Pddl
    derived: set[str] = field(default_factory=set)  # names of derived predicates

    def fail(self, at: PddlWord | Form, message: str) -> PddlError:
        return PddlError(f"{self.file}:{at.line}:{at.column}: {message}")

    def word(self, item: PddlWord | Form, what: str) -> PddlWord:
        if not isinstance(item, PddlWord):
            raise self.fail(item, f"wanted {what}, got a list")
        return item

    def define(self, form: Form, kind: str) -> Iterator[Form]:
        """Store the name that ``(define (kind name) section …)`` defines, and yield the sections."""
        if form.head != "define" or len(form.items) < 2 or not isinstance(form.items[1], Form):
            raise self.fail(form, f"wanted (define ({kind} …) …)")
        title = form.items[1]
        if title.head != kind or len(title.items) != 2:
            raise self.fail(title, f"wanted ({kind} NAME), got ({title.head or '…'} …)")
        setattr(self.pddl, kind, self.word(title.items[1], "a name").text)
        for section in form.items[2:]:
            if not isinstance(section, Form) or not section.head.startswith(":"):
                raise self.fail(section, "wanted a section such as (:init …)")
            if section.head in SECTIONS:
                raise self.fail(section, f"{SECTIONS[section.head]} are not supported ({section.head})")
            yield section

    def domain(self, form: Form) -> None:
        actions, axioms, constraints = [], [], []
        for section in self.define(form, "domain"):
            rest = section.items[1:]
            if section.head == ":types":
                self.types(rest)
            elif section.head == ":constants":
                self.objects(rest)
            elif section.head == ":predicates":
                self.pddl.predicates |= dict(self.signatures(rest, "predicate"))
            elif section.head == ":functions":
                self.functions(rest)
            elif section.head in (":action", ":durative-action"):
                actions.append(section)
            elif section.head == ":derived":
                axioms.append(section)
            elif section.head == ":constraints":
                constraints.append(section)
            elif section.head != ":requirements":  # unused declarations are harmless
                raise self.fail(section, f"unknown section {section.head} in a domain")
        self.derived = {
            axiom.items[1].head for axiom in axioms if len(axiom.items) > 1 and isinstance(axiom.items[1], Form)
        }
        for action in actions:
            self.action(action)
        for axiom in axioms:
            self.axiom(axiom)
        for section in constraints:
            self.constraints(section.items[1:])

    def problem(self, form: Form) -> None:
        sections = {}
        for section in self.define(form, "problem"):
            if section.head in sections:
                raise self.fail(section, f"a second {section.head}")
            sections[section.head] = section
            if section.head == ":objects":
                self.objects(section.items[1:])
            elif section.head not in (
                ":requirements",
                ":domain",
                ":init",
                ":goal",
                ":length",
                ":constraints",
                ":metric",
            ):
                raise self.fail(section, f"unknown section {section.head} in a problem")
        for wanted in (":init", ":goal"):
            if wanted not in sections:
                raise self.fail(form, f"the problem has no ({wanted} …)")
        for item in checked(sections[":init"].items[1:], f"reading {self.file}"):
            self.fact(item)
        if ":constraints" in sections:
            self.constraints(sections[":constraints"].items[1:])
        goal = sections[":goal"]
        if len(goal.items) != 2 or not isinstance(goal.items[1], Form):
            raise self.fail(goal, "wanted one condition as the goal")
        self.goal(goal.items[1])
        if self.pddl.sometime:
            hard = [self.pddl.goal] if self.pddl.goal is not None else []
            self.pddl.goal = _formed(goal, "and", *hard, *self.pddl.sometime)
        if ":metric" in sections:
            self.metric(sections[":metric"])

    def goal(self, form: Form) -> None:
        """Read the goal; a conjunct ``(preference NAME CONDITION)`` is a soft goal."""
        parts = [*form.items[1:]] if form.head == "and" else [form]
        hard: list[PddlWord | Form] = []
        for part in parts:
            if not isinstance(part, Form) or part.head != "preference":
                hard.append(part)
                continue
            if len(part.items) != 3 or not isinstance(part.items[2], Form):
                raise self.fail(part, "wanted (preference NAME CONDITION)")
            name = self.word(part.items[1], "a name").text
            if name in self.pddl.preferences:
                raise self.fail(part, f"a second preference {name}")
            self.condition(part.items[2], {})
            self.pddl.preferences[name] = distinct(part.items[2], ())
        if self.pddl.preferences:
            form = Form((PddlWord("and", form.line, form.column), *hard), form.line, form.column)
        if form.items:
            self.condition(form, {})
            self.pddl.goal = distinct(form, ())

    def metric(self, form: Form) -> None:
        words = form.items[1:]
        wanted = words[1] if len(words) == 2 and self.word(words[0], "minimize").text == "minimize" else None
        if isinstance(wanted, PddlWord):  # (:metric minimize total-cost), a function without brackets
            wanted = Form((wanted,), wanted.line, wanted.column)
        if wanted is None:
            raise self.fail(form, "the only metric supported is (:metric minimize …)")
        self.number(wanted, {}, {"total-cost": (), "total-time": (), **self.pddl.functions})
        self.pddl.metric = Metric(self.pddl, self.fail).weights(wanted)

    def typed(self, items: Sequence[PddlWord | Form], declaring: bool = False) -> list[Typed]:
        """Return the names with their types in a list such as ``a b - t c``; a name without a type is an ``object``."""
        found: list[Typed] = []
        waiting: list[PddlWord] = []
        position = 0
        while position < len(items):
            word = self.word(items[position], "a name")
            if word.text == "-":
                if position + 1 == len(items):
                    raise self.fail(word, "wanted a type behind '-'")
                kind = self.kind(items[position + 1], declaring)
                found += [Typed(name.text, kind, name) for name in waiting]
                waiting, position = [], position + 2
                continue
            waiting.append(word)
            position += 1
        return [*found, *(Typed(name.text, "object", name) for name in waiting)]

    def kind(self, item: PddlWord | Form, declaring: bool) -> str:
        """Return the name of a type. For ``(either a b)``, declare a common supertype of `a` and `b`, and return its name."""
        if isinstance(item, Form):
            words = [self.word(one, "a type") for one in item.items[1:]]
            if item.head != "either" or not words:
                raise self.fail(item, "wanted a type or (either TYPE …)")
            kinds = [self.kind(word, declaring) for word in words]
            name = either(kinds)
            if name not in (*self.pddl.types, *kinds):
                self.pddl.types[name] = ("object",)
                for kind in set(kinds):
                    self.pddl.types[kind] = (*self.pddl.types.get(kind, ()), name)
            return name
        if item.text not in self.pddl.types and not declaring:
            known = ", ".join(sorted(self.pddl.types))
            raise self.fail(item, f"undefined type '{item.text}' (known: {known})")
        return item.text

    def types(self, items: Sequence[PddlWord | Form]) -> None:
        """Parse type declarations. A type that is declared twice, or with ``either``, has several supertypes."""
        declared = self.typed(items, declaring=True)
        for one in declared:
            if one.name != "object":
                higher = one.type.split()[1:] if one.type.startswith("either ") else [one.type]
                self.pddl.types[one.name] = tuple(dict.fromkeys((*self.pddl.types.get(one.name, ()), *higher)))
        for kind in [kind for above in self.pddl.types.values() for kind in above]:
            self.pddl.types.setdefault(kind, ("object",))
        for one in declared:
            if any(one.name in self.pddl.above(kind) for kind in self.pddl.types[one.name]) and one.name != "object":
                raise self.fail(one.place, f"type '{one.name}' is above itself")

    def objects(self, items: Sequence[PddlWord | Form]) -> None:
        """Parse object declarations.

        If an object is declared with a type and with its subtype, the object has the subtype. An object of type ``(either a b)``
        belongs to `a` and to `b`.
        """
        for one in self.typed(items):
            if one.type.startswith("either "):
                kinds = tuple(one.type.split()[1:])
                one = replace(one, type=f"all {' '.join(kinds)}")
                self.pddl.types.setdefault(one.type, kinds)
            known = self.pddl.objects.get(one.name, one.type)
            if one.type not in self.pddl.above(known) and known not in self.pddl.above(one.type):
                raise self.fail(one.place, f"'{one.name}' is declared as {known} and as {one.type}")
            self.pddl.objects[one.name] = known if one.type in self.pddl.above(known) else one.type

    def signatures(self, items: Sequence[PddlWord | Form], what: str) -> Iterator[tuple[str, tuple[Typed, ...]]]:
        for item in items:
            if not isinstance(item, Form) or not item.head:
                raise self.fail(item, f"wanted a {what} such as (at ?x)")
            yield item.head, tuple(self.typed(item.items[1:]))

    def functions(self, items: Sequence[PddlWord | Form]) -> None:
        position = 0
        while position < len(items):
            item = items[position]
            if isinstance(item, PddlWord) and item.text == "-":
                kind = items[position + 1] if position + 1 < len(items) else item
                if not isinstance(kind, PddlWord) or kind.text != "number":
                    raise self.fail(kind, "object fluents are not supported; a function is a number")
                position += 2
                continue
            self.pddl.functions |= dict(self.signatures([item], "function"))
            position += 1

    def action(self, form: Form) -> None:
        if len(form.items) < 2:
            raise self.fail(form, "wanted (:action NAME …)")
        name = self.word(form.items[1], "the action's name")
        if name.text in self.pddl.actions:
            raise self.fail(name, f"a second action '{name.text}'")
        durative = form.head == ":durative-action"
        known = (":parameters", *((":duration", ":condition") if durative else (":precondition",)), ":effect")
        parts: dict[str, Form] = {}
        rest = form.items[2:]
        for key, value in zip(rest[::2], rest[1::2], strict=False):
            word = self.word(key, "a keyword such as :effect")
            if word.text not in known:
                raise self.fail(word, f"unknown part {word.text} of an action")
            if not isinstance(value, Form):
                raise self.fail(value, f"wanted a list behind {word.text}")
            parts[word.text] = value
        if len(rest) % 2:
            raise self.fail(rest[-1], "wanted a keyword and a list")
        parameters = tuple(self.typed(parts[":parameters"].items if ":parameters" in parts else ()))
        variables = self.scope(parameters, {})
        if durative:
            self.durative(form, name, parameters, variables, parts)
            return
        precondition, effect = parts.get(":precondition"), parts.get(":effect")
        if precondition and precondition.items:
            self.condition(precondition, variables)
        if effect and effect.items:
            self.effect(effect, variables)
        given = distinct(precondition, variables) if precondition and precondition.items else None
        made = distinct(effect, variables) if effect else None
        self.pddl.actions[name.text] = Action(name.text, parameters, given, made, name)

    def durative(
        self,
        form: Form,
        name: PddlWord,
        parameters: tuple[Typed, ...],
        variables: Mapping[str, str],
        parts: Mapping[str, Form],
    ) -> None:
        """Parse a durative action, and check each of its conditions and effects separately."""
        if ":duration" not in parts:
            raise self.fail(form, f"durative action '{name.text}' has no :duration")
        try:
            duration = duration_in(parts[":duration"])
            found = Durative(
                duration,
                tuple(timed(parts.get(":condition"), "condition", duration)),
                tuple(timed(parts.get(":effect"), "effect", duration)),
            )
        except NotTimedError as error:
            raise self.fail(error.at, str(error)) from error
        self.number(duration, variables)
        for _, one in found.conditions:
            self.condition(one, variables)
        for _, one in found.effects:
            self.effect(one, variables)
        conditions = tuple((span, distinct(one, variables)) for span, one in found.conditions)
        effects = tuple((span, distinct(one, variables)) for span, one in found.effects)
        found = replace(found, conditions=conditions, effects=effects)
        asked, made = whole(found, form)
        self.pddl.actions[name.text] = Action(name.text, parameters, asked, made, name, found)

    def axiom(self, form: Form) -> None:
        """Parse ``(:derived (name ?x …) condition)``; a variable without a type has the type in the predicate's declaration."""
        if len(form.items) != 3 or not isinstance(head := form.items[1], Form) or not isinstance(form.items[2], Form):
            raise self.fail(form, "wanted (:derived (PREDICATE ?x …) CONDITION)")
        if head.head not in self.pddl.predicates:
            known = ", ".join(sorted(self.pddl.predicates)) or "none"
            raise self.fail(head, f"undefined predicate '{head.head}' (known: {known})")
        declared, given = self.pddl.predicates[head.head], self.typed(head.items[1:])
        if len(given) != len(declared):
            raise self.fail(head, f"predicate '{head.head}' takes {len(declared)} arguments, got {len(given)}")
        typed = (
            (one, other.type if one.type == "object" else one.type) for one, other in zip(given, declared, strict=True)
        )
        parameters = tuple(Typed(one.name, kind, one.place) for one, kind in typed)
        variables = self.scope(parameters, {})
        if form.items[2].items:
            self.condition(form.items[2], variables)
        self.pddl.axioms.append(Axiom(head.head, parameters, distinct(form.items[2], variables)))

    def constraints(self, parts: Sequence[PddlWord | Form], each: Sequence[Form] = ()) -> None:
        """Parse constraints on all states of a plan, also inside ``and`` and ``forall``.

        A constraint becomes a derived predicate that is true if the constraint is violated, and that must never be true. For
        constraints about earlier states, additional predicates remember whether other derived predicates have been true. A
        constraint ``sometime`` becomes a goal.
        """
        for part in parts:
            head = part.head if isinstance(part, Form) else ""
            if isinstance(part, Form) and head == "and":
                self.constraints(part.items[1:], each)
            elif isinstance(part, Form) and head == "forall" and len(part.items) == 3:
                self.constraints(part.items[2:], (*each, part))
            elif isinstance(part, Form) and head == "always" and len(part.items) == 2:
                condition = part.items[1]
                for outer in reversed(each):
                    condition = replace(outer, items=(*outer.items[:2], condition))
                word = replace(self.word(part.items[0], "always"), text="not")
                violated = replace(part, items=(word, condition))
                self.condition(violated, {})
                self.pddl.forbidden.append(self.derive("violated", (), violated).head)
            elif isinstance(part, Form) and len(part.items) == EARLIER.get(head):
                self.earlier(part, each)
            else:
                known = ", ".join(sorted({"always", *EARLIER}))
                raise self.fail(part, f"'{head or '…'}' is not supported in (:constraints …); wanted one of {known}")

    def earlier(self, part: Form, each: Sequence[Form]) -> None:
        """Add the predicates for ``sometime``, ``sometime-before`` or ``at-most-once`` inside the quantifiers `each`."""
        lists = [outer.items[1] for outer in each if self.quantified(outer, {})]
        typed = tuple(one for words in lists if isinstance(words, Form) for one in self.typed(words.items))
        variables = self.scope(typed, {})
        for one in part.items[1:]:
            self.condition(one, variables)
        condition = part.items[1]
        # as in PDDL, the second condition holds in an earlier state than the first one
        if part.head == "sometime-before":
            first = self.derive("first", typed, _formed(part, "and", part.items[2], _formed(part, "not", condition)))
            allowed = self.remember("allowed", first, typed)
            violated = _formed(part, "and", condition, _formed(part, "not", allowed))
        else:
            holds = self.derive("holds", typed, _formed(part, "and", condition))
            held = self.remember("held", holds, typed)
            if part.head == "sometime":
                for outer in reversed(each):
                    held = replace(outer, items=(*outer.items[:2], held))
                self.pddl.sometime.append(held)
                return
            over = self.derive("over", typed, _formed(part, "and", held, _formed(part, "not", holds)))
            violated = _formed(part, "and", holds, self.remember("ended", over, typed))
        self.pddl.forbidden.append(self.derive("violated", typed, violated).head)

    def derive(self, name: str, typed: tuple[Typed, ...], condition: Form) -> Form:
        """Add a derived predicate for a condition, with a new name; return the atom of the predicate."""
        atom = self.declare(name, typed)
        self.pddl.axioms.append(Axiom(atom.head, typed, distinct(condition, {one.name for one in typed})))
        return atom

    def remember(self, name: str, source: Form, typed: tuple[Typed, ...]) -> Form:
        """Add a predicate that becomes true when a given atom becomes true, and stays true; return the atom of the predicate."""
        atom = self.declare(name, typed)
        self.pddl.remembers[atom.head] = source.head
        return atom

    def declare(self, name: str, typed: tuple[Typed, ...]) -> Form:
        """Declare a predicate with a new name, and return its atom."""
        number = 1
        while f"{name}-{number}" in self.pddl.predicates:
            number += 1
        self.pddl.predicates[f"{name}-{number}"] = typed
        return Form((PddlWord(f"{name}-{number}", 0, 0), *(PddlWord(one.name, 0, 0) for one in typed)), 0, 0)

    def stated(self, form: Form, where: str) -> None:
        """Raise an error if the predicate of an effect or an initial fact is a derived predicate."""
        if form.head in self.derived:
            raise self.fail(
                form, f"'{form.head}' is derived, so it can't be {where}; change what its (:derived …) reads"
            )

    def scope(self, typed: Sequence[Typed], outer: Mapping[str, str]) -> dict[str, str]:
        own: dict[str, str] = {}
        for one in typed:
            if not one.name.startswith("?") or one.name == "?":
                raise self.fail(one.place, f"wanted a variable such as ?x, got '{one.name}'")
            if one.name in own:
                raise self.fail(one.place, f"a second variable {one.name}")
            own[one.name] = one.type
        return {**outer, **own}

    # ---------------------------------------------------------------------------------------------- formulas

    def condition(self, form: PddlWord | Form, variables: Mapping[str, str]) -> None:
        if not isinstance(form, Form):
            raise self.fail(form, f"wanted a condition, got '{form.text}'")
        head, rest = form.head, form.items[1:]
        if head in ("and", "or"):
            for item in rest:
                self.condition(item, variables)
        elif head in ("not", "imply"):
            if len(rest) != (1 if head == "not" else 2):
                raise self.fail(form, f"({head} …) takes {1 if head == 'not' else 2} conditions, got {len(rest)}")
            for item in rest:
                self.condition(item, variables)
        elif head in ("exists", "forall"):
            self.condition(self.quantified(form, variables)[1], self.quantified(form, variables)[0])
        elif head == "=":
            if len(rest) != 2:
                raise self.fail(form, f"(= …) takes 2 terms, got {len(rest)}")
            for item in rest:
                if any(isinstance(one, Form) or is_number(one) for one in rest):
                    self.number(item, variables)
                else:
                    self.term(item, variables)
        elif head in COMPARISONS:
            if len(rest) != 2:
                raise self.fail(form, f"({head} …) takes 2 numbers, got {len(rest)}")
            for item in rest:
                self.number(item, variables)
        elif head == "preference":
            raise self.fail(form, "preferences are supported as conjuncts of the goal only")
        else:
            self.atom(form, variables)

    def quantified(self, form: Form, variables: Mapping[str, str]) -> tuple[dict[str, str], PddlWord | Form]:
        if len(form.items) != 3 or not isinstance(form.items[1], Form):
            raise self.fail(form, f"wanted ({form.head} (?x …) …)")
        return self.scope(self.typed(form.items[1].items), variables), form.items[2]

    def effect(self, form: PddlWord | Form, variables: Mapping[str, str]) -> None:
        if not isinstance(form, Form):
            raise self.fail(form, f"wanted an effect, got '{form.text}'")
        head, rest = form.head, form.items[1:]
        if head == "and":
            for item in rest:
                self.effect(item, variables)
        elif head == "not":
            if len(rest) != 1 or not isinstance(rest[0], Form):
                raise self.fail(form, "(not …) takes one predicate in an effect")
            self.stated(rest[0], "an effect")
            self.atom(rest[0], variables)
        elif head == "when":
            if len(rest) != 2:
                raise self.fail(form, f"(when …) takes a condition and an effect, got {len(rest)}")
            self.condition(rest[0], variables)
            self.effect(rest[1], variables)
        elif head == "forall":
            inner, body = self.quantified(form, variables)
            self.effect(body, inner)
        elif head in CHANGES:
            if len(rest) != 2 or not isinstance(rest[0], Form):
                raise self.fail(form, f"wanted ({head} (function …) NUMBER)")
            self.atom(rest[0], variables, self.pddl.functions, "function")
            self.number(rest[1], variables)
        else:
            self.stated(form, "an effect")
            self.atom(form, variables)

    def number(
        self,
        item: PddlWord | Form,
        variables: Mapping[str, str],
        functions: Mapping[str, tuple[Typed, ...]] | None = None,
    ) -> None:
        """Check a number, a function term or an arithmetic expression."""
        functions = self.pddl.functions if functions is None else functions
        if isinstance(item, PddlWord):
            self.constant(item)
        elif item.head in ("+", "-", "*", "/"):
            many = item.head in "+*"
            if len(item.items) < 3 - (item.head == "-") or (len(item.items) > 3 and not many):
                raise self.fail(item, f"({item.head} …) takes 2 numbers, got {len(item.items) - 1}")
            for one in item.items[1:]:
                self.number(one, variables, functions)
        elif item.head == "is-violated" and len(item.items) == 2:
            name = self.word(item.items[1], "the name of a preference")
            if name.text not in self.pddl.preferences:
                raise self.fail(name, f"undefined preference '{name.text}'")
        else:
            self.atom(item, variables, functions, "function")

    def constant(self, word: PddlWord | Form) -> Fraction:
        text = self.word(word, "a number").text
        if not is_number(word):
            raise self.fail(word, f"wanted a number, got '{text}'")
        return Fraction(text)

    def atom(
        self,
        form: Form,
        variables: Mapping[str, str],
        known: Mapping[str, tuple[Typed, ...]] | None = None,
        what: str = "predicate",
    ) -> tuple[str, ...]:
        """Check an atom ``(name term …)`` against the declaration of its predicate or function, and return the atom's words."""
        known = self.pddl.predicates if known is None else known
        if not form.head:
            raise self.fail(form, f"wanted a {what}, got a list")
        if form.head not in known:
            raise self.fail(form, f"undefined {what} '{form.head}' (known: {', '.join(sorted(known)) or 'none'})")
        wanted, got = known[form.head], form.items[1:]
        if len(wanted) != len(got):
            raise self.fail(form, f"{what} '{form.head}' takes {len(wanted)} arguments, got {len(got)}")
        for item, declared in zip(got, wanted, strict=True):
            kind, text = self.term(item, variables), self.word(item, "a term").text
            fits = declared.type in self.pddl.above(kind)
            if text in variables:  # a variable may denote an object of the type
                fits = fits or kind in self.pddl.above(declared.type) or self.meet(kind, declared)
            if not fits:
                dash = declared.type in self.pddl.objects and kind == "object"
                hint = f"; is there no '-' before '{declared.type}' in (:objects …)?" if dash else ""
                raise self.fail(
                    item, f"'{text}' is of type {kind}; {what} '{form.head}' takes a {declared.type} there{hint}"
                )
        return (form.head, *(self.word(item, "a term").text for item in got))

    def meet(self, kind: str, declared: Typed) -> bool:
        """Return whether some declared type is a subtype of both given types."""
        return any({kind, declared.type} <= set(self.pddl.above(lower)) for lower in self.pddl.types)

    def term(self, item: PddlWord | Form, variables: Mapping[str, str]) -> str:
        """Return the type of a variable or object, which must be declared."""
        word = self.word(item, "a variable or an object")
        if word.text.startswith("?"):
            if word.text not in variables:
                raise self.fail(
                    word, f"undefined variable {word.text} (known: {', '.join(sorted(variables)) or 'none'})"
                )
            return variables[word.text]
        if word.text not in self.pddl.objects:
            raise self.fail(word, f"undefined object '{word.text}'")
        return self.pddl.objects[word.text]

    def fact(self, item: PddlWord | Form) -> None:
        """Parse one element of ``:init``: an atom, a negated atom, the value of a function or a timed initial literal."""
        if not isinstance(item, Form):
            raise self.fail(item, f"wanted a fact, got '{item.text}'")
        if item.head == "at" and len(item.items) == 3 and is_number(item.items[1]) and isinstance(item.items[2], Form):
            self.timed_fact(item)
            return
        if item.head == "=":
            names = [word.text for word in item.items[1:] if isinstance(word, PddlWord)]
            if len(names) == 2 and names[0] == names[1] in self.pddl.objects:
                return  # the equality (= a a) always holds
            if len(item.items) != 3 or not isinstance(item.items[1], Form):
                raise self.fail(item, "wanted (= (function …) NUMBER)")
            words = self.atom(item.items[1], {}, self.pddl.functions, "function")
            self.pddl.numbers[words] = self.constant(item.items[2])
        elif item.head == "not":
            if len(item.items) != 2 or not isinstance(item.items[1], Form):
                raise self.fail(item, "wanted (not (predicate …))")
            self.atom(item.items[1], {})  # atoms that aren't listed are false
        else:
            self.stated(item, "stated")
            self.pddl.initial.append(self.atom(item, {}))

    def timed_fact(self, item: Form) -> None:
        """Parse a timed initial literal of PDDL 2.2, an atom that becomes true or false at a given time."""
        seconds, literal = self.constant(item.items[1]), item.items[2]
        true = not (isinstance(literal, Form) and literal.head == "not")
        inner = literal if true else literal.items[1] if isinstance(literal, Form) and len(literal.items) == 2 else None
        if seconds < 0 or not isinstance(inner, Form) or inner.head not in self.pddl.predicates:
            raise self.fail(item, "wanted (at TIME (predicate …)) or (at TIME (not (predicate …))), the time from 0 on")
        self.stated(inner, "stated")
        self.pddl.timed.append((seconds, self.atom(inner, {}), true))


def _formed(at: Form, head: str, *items: PddlWord | Form) -> Form:
    """Return a form (a list of PDDL) with a given first word, at the position of another form."""
    return Form((PddlWord(head, at.line, at.column), *items), at.line, at.column)
