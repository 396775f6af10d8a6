"""Rules, orders and methods as triples that people can edit, in the vocabulary of conditions and behaviours.

A `:LearnedRule` has a goal (`:forGoal`), conditions (`:asksFor`), and a behaviour with arguments (`:does`); its
roles are parameters of its own. A `:LearnedMethod` has the refined behaviour (`:refines`) and steps with an index; a
`:LearnedOrder` has the situation types `:first` and `:then`. ``:enabled false`` switches an item off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import TypeAlias
from urllib.parse import quote, unquote

import pyoxigraph as ox

from confab.reasoner.memory.experience import GoalKind, Method, OpenRole, Order, Rule, Said
from confab.reasoner.names import Names
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AnyOf,
    ClassCondition,
    Comparison,
    Condition,
    EqualityCondition,
    RelationCondition,
    ValueCondition,
    Witness,
)
from confab.reasoner.vocabulary import ARGUMENTS, CORE, MEMORY, RDF

Node: TypeAlias = "Mapping[str, Sequence[str]]"
"""The values of a node by property, without the core's namespace."""
Words: TypeAlias = "Callable[[Said], str]"
MOST_INSIDE = 50
"""Maximum depth of nested conditions; more means that a condition contains itself."""


def label(one: Said) -> str:
    """Return a short description of a learned item."""
    match one:
        case Rule(goal, _, does):
            wanted = " ".join((*goal.arguments[:1], goal.situation, *goal.arguments[1:], goal.value))
            return f"for {wanted}: {' '.join((does[0], *does[1]))}".replace("?", "")
        case Order(first, then, shared):
            return f"{first} before {then}" + (" of the same" if shared else "")
        case Method(behavior, _, steps, _):
            return f"{behavior} by {', '.join(name for name, _ in steps)}"
        case GoalKind(situation, classes):
            return f"{situation} of {', '.join(classes)}"
    raise TypeError(one)


class RuleWriter:
    """Writes learned items as Turtle. Short names are expanded to IRIs; a name without an IRI gets one of the memory."""

    def __init__(self, names: Names, words: Words = label) -> None:
        self.names, self.words = names, words

    def term(self, name: str) -> str:
        """Return the Turtle term of an individual, class, behaviour or situation type."""
        if name in self.names:
            return str(ox.NamedNode(self.names.iri(name)))
        return f":{name}" if name in (TRUE, FALSE) else str(ox.NamedNode(MEMORY + quote(name, safe="")))

    def said(self, one: Said, enabled: bool = True) -> str:
        """Return the triples of a learned item and its parts."""
        me = f"m:{one.name}"
        match one:
            case Rule():
                kind, lines = "LearnedRule", self.rule(one, me)
            case Order(first, then, shared):
                pairs = "".join(f' ; :shares "{i} {j}"' for i, j in shared)
                kind, lines = "LearnedOrder", [f":first {self.term(first)} ; :then {self.term(then)}{pairs}"]
            case Method():
                kind, lines = "LearnedMethod", self.method(one, me)
            case GoalKind(situation, classes):
                roles = "".join(f" ; :{a} {self.term(c)}" for a, c in zip(ARGUMENTS, classes, strict=False))
                kind, lines = "GoalKind", [f":situationType {self.term(situation)}{roles}"]
        off = "" if enabled else " ; :enabled false"
        head = f"{me} a owl:NamedIndividual, :{kind} ; rdfs:label {ox.Literal(self.words(one))}{off} ; {lines[0]} .\n"
        return head + "".join(f"{line} .\n" for line in lines[1:])

    def rule(self, rule: Rule, me: str) -> list[str]:
        """Return a rule's properties as the first text, and the triples of its parts."""
        parts: list[str] = []
        terms = {role: f"{me}.{quote(role[1:], safe='')}" for role, _ in rule.kinds}
        goal = self.condition(rule.goal, terms, me, parts)
        asks = [self.condition(c, terms, me, parts) for c in rule.asks]
        said = [f":forGoal {goal} ; {self.step(rule.does, terms)}"]
        said += [f":asksFor {', '.join(asks)}"] if asks else []
        said += [f":role {', '.join(terms.values())}"] if terms else []
        roles = [
            f"{terms[role]} a owl:NamedIndividual, :Parameter ; :index {i} ; :termType {self.term(kind)}"
            for i, (role, kind) in enumerate(rule.kinds)
        ]
        return [" ; ".join(said), *roles, *parts]

    def step(self, does: tuple[str, Sequence[str]], terms: Mapping[str, str]) -> str:
        """Return the properties of a behaviour with its arguments."""
        put = [terms.get(term) or self.term(term) for term in does[1]]
        return " ; ".join([f":does {self.term(does[0])}", *(f":{a} {t}" for a, t in zip(ARGUMENTS, put, strict=False))])

    def method(self, method: Method, me: str) -> list[str]:
        """Return a method's properties as the first text, and the triples of its parts."""
        roles = [f"{me}.role{i}" for i in range(method.roles + len(method.open))]
        steps = [f"{me}.step{i}" for i in range(len(method.steps))]
        lines = [f":refines {self.term(method.behavior)} ; :roles {method.roles} ; :step {', '.join(steps)}"]
        for i, role in enumerate(method.open, start=method.roles):
            said = f"{roles[i]} a owl:NamedIndividual, :Parameter ; :index {i} ; :termType {self.term(role.kind)}"
            if role.source is not None:
                of = "".join(f" ; :{a} {roles[j]}" for a, j in zip(ARGUMENTS, role.source[1], strict=False))
                said += f" ; :isValueOf {self.term(role.source[0])}{of}"
            lines.append(said + (f" ; :becomesValueOf {self.term(role.becomes)}" if role.becomes is not None else ""))
        lines += [
            f"{role} a owl:NamedIndividual, :Parameter ; :index {i}" for i, role in enumerate(roles[: method.roles])
        ]
        for i, (name, places) in enumerate(method.steps):
            terms = [roles[place] for place in places]
            does = self.step((name, terms), dict(zip(terms, terms, strict=True)))
            lines.append(f"{steps[i]} a owl:NamedIndividual, :LearnedStep ; :index {i} ; {does}")
        if method.open:
            lines[0] += f" ; :role {', '.join(roles[method.roles :])}"
        return lines

    def condition(self, one: Condition, terms: dict[str, str], me: str, parts: list[str]) -> str:
        """Append the triples of a condition and its nested conditions to `parts`; return its name."""
        name = f"{me}.c{len(parts)}"
        place = len(parts)
        parts.append("")
        no = " ; :negated true" if one.negated else ""

        def put(term: str) -> str:
            return terms.get(term) or self.term(term)

        def arguments(given: Sequence[str]) -> str:
            return "".join(f" ; :{a} {put(t)}" for a, t in zip(ARGUMENTS, given, strict=False))

        match one:
            case ValueCondition(situation, given, value):
                said = (
                    f":ValueCondition ; :situationType {self.term(situation)}{arguments(given)} ; :value {put(value)}"
                )
            case RelationCondition(relation, given):
                last = f" ; :value {put(given[-1])}" if len(given) > 1 else ""
                said = f":RelationCondition ; :relation {self.term(relation)}{arguments(given[:-1] if last else given)}{last}"
            case ClassCondition(term, kind):
                said = f":ClassCondition ; :about {put(term)} ; :ofClass {self.term(kind)}"
            case EqualityCondition(left, right):
                said = f":EqualityCondition ; :about {put(left)} ; :value {put(right)}"
            case Witness(variable, kind, conditions):
                inner = {**terms, variable: f"{name}.{quote(variable[1:], safe='')}"}
                parts.append(f"{inner[variable]} a owl:NamedIndividual, :Variable ; :termType {self.term(kind)}")
                those = [self.condition(c, inner, me, parts) for c in conditions]
                said = f":Witness ; :witness {inner[variable]}" + (f" ; :condition {', '.join(those)}" if those else "")
            case AnyOf(alternatives):
                groups = []
                for number, group in enumerate(alternatives):
                    those = [self.condition(c, terms, me, parts) for c in group]
                    groups.append(f"{name}.or{number}")
                    of = f" ; :condition {', '.join(those)}" if those else ""
                    parts.append(f"{groups[-1]} a owl:NamedIndividual, :AllOf{of}")
                said = f":AnyOf ; :alternative {', '.join(groups)}"
            case Comparison():
                raise TypeError(f"{one} can't be a condition of a rule: rules don't compare amounts")
        parts[place] = f"{name} a owl:NamedIndividual, {said}{no}"
        return name


class RuleReader:
    """Reads learned items from the triples of a file."""

    def __init__(self, nodes: Mapping[str, Node], names: Names | None) -> None:
        self.nodes, self.names = nodes, names

    def short(self, iri: str) -> str:
        """Return the short name of a term."""
        if iri.startswith(MEMORY):
            return unquote(iri.removeprefix(MEMORY))
        if self.names is not None:
            return self.names.short(iri)
        return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]

    def said(self, iri: str) -> Said | None:
        """Return the learned item of a node, or None if the node is none; raise `ValueError` if a part is missing."""
        node = self.nodes[iri]
        kinds = [kind.removeprefix(CORE) for kind in node.get(RDF + "type", ())]
        if "LearnedRule" in kinds:
            return self.rule(iri, node)
        if "LearnedOrder" in kinds:
            pairs = [text.split() for text in node.get("shares", ())]
            shared = sorted((int(i), int(j)) for i, j in pairs)
            return Order(self.short(self.one(iri, "first")), self.short(self.one(iri, "then")), tuple(shared))
        if "LearnedMethod" in kinds:
            return self.method(iri, node)
        if "GoalKind" in kinds:
            return GoalKind(self.short(self.one(iri, "situationType")), tuple(map(self.short, self.arguments(iri))))
        return None

    def one(self, iri: str, name: str) -> str:
        """Return the only value of a property; raise `ValueError` if there is none or more than one."""
        found = self.nodes.get(iri, {}).get(name, ())
        if len(found) != 1:
            raise ValueError(f"<{iri}>: wanted one :{name}, found {len(found)}")
        return found[0]

    def arguments(self, iri: str) -> list[str]:
        """Return the arguments of a node in order."""
        return [value for name in ARGUMENTS for value in self.nodes[iri].get(name, ())[:1]]

    def rule(self, iri: str, node: Node) -> Rule:
        """Return the rule of a node."""
        roles = sorted(node.get("role", ()), key=lambda role: (int(self.one(role, "index")), role))
        terms = {role: "?" + unquote(role.removeprefix(iri + ".")) for role in roles}
        if len(set(terms.values())) < len(roles) or any("." in name for name in terms.values()):
            terms = {role: f"?role{i}" for i, role in enumerate(roles)}
        goal = self.condition(self.one(iri, "forGoal"), terms)
        if not isinstance(goal, ValueCondition):
            raise ValueError(f"<{iri}>: its :forGoal is no :ValueCondition")
        asks = tuple(sorted((self.condition(c, terms) for c in node.get("asksFor", ())), key=repr))
        does = self.short(self.one(iri, "does")), tuple(self.term(a, terms) for a in self.arguments(iri))
        kinds = tuple((terms[role], self.short(self.one(role, "termType"))) for role in roles)
        return Rule(goal, asks, does, kinds)

    def method(self, iri: str, node: Node) -> Method:
        """Return the method of a node."""
        own = int(self.one(iri, "roles"))
        opened = sorted(node.get("role", ()), key=lambda role: int(self.one(role, "index")))
        steps = []
        for step in sorted(node.get("step", ()), key=lambda step: int(self.one(step, "index"))):
            places = tuple(int(self.one(role, "index")) for role in self.arguments(step))
            steps.append((self.short(self.one(step, "does")), places))
        roles = []
        for role in opened:
            source = becomes = None
            if "isValueOf" in self.nodes[role]:
                places = tuple(int(self.one(other, "index")) for other in self.arguments(role))
                source = self.short(self.one(role, "isValueOf")), places
            if "becomesValueOf" in self.nodes[role]:
                becomes = self.short(self.one(role, "becomesValueOf"))
            roles.append(OpenRole(self.short(self.one(role, "termType")), source, becomes))
        named = [*(places for _, places in steps), *(role.source[1] for role in roles if role.source)]
        for place in chain.from_iterable(named):
            if not 0 <= place < own + len(roles):
                raise ValueError(f"<{iri}>: names role {place} of {own + len(roles)}, counted from 0")
        return Method(self.short(self.one(iri, "refines")), own, tuple(steps), tuple(roles))

    def term(self, iri: str, terms: Mapping[str, str]) -> str:
        """Return the role of a term, else its short name."""
        return terms.get(iri) or self.short(iri)

    def condition(self, iri: str, terms: Mapping[str, str], depth: int = 0) -> Condition:
        """Return the condition of a node, with its nested conditions."""
        if depth > MOST_INSIDE:
            raise ValueError(f"<{iri}>: the condition contains itself")
        node = self.nodes.get(iri, {})
        kinds = {kind.removeprefix(CORE) for kind in node.get(RDF + "type", ())}
        negated = "true" in node.get("negated", ())
        given = tuple(self.term(a, terms) for a in self.arguments(iri)) if node else ()
        if "ValueCondition" in kinds:
            return ValueCondition(
                self.short(self.one(iri, "situationType")), given, self.term(self.one(iri, "value"), terms), negated
            )
        if "RelationCondition" in kinds:
            last = tuple(self.term(value, terms) for value in node.get("value", ()))
            return RelationCondition(self.short(self.one(iri, "relation")), (*given, *last), negated)
        if "ClassCondition" in kinds:
            return ClassCondition(given[0], self.short(self.one(iri, "ofClass")), negated)
        if "EqualityCondition" in kinds:
            return EqualityCondition(given[0], self.term(self.one(iri, "value"), terms), negated)
        if "Witness" in kinds:
            sought = self.one(iri, "witness")
            variable = "?" + unquote(sought.removeprefix(iri + ".")).rsplit(".", 1)[-1]
            inner = {**terms, sought: variable}
            those = (self.condition(c, inner, depth + 1) for c in node.get("condition", ()))
            return Witness(variable, self.short(self.one(sought, "termType")), tuple(sorted(those, key=repr)), negated)
        if "AnyOf" in kinds:
            groups = (
                tuple(
                    sorted((self.condition(c, terms, depth + 1) for c in self.nodes[g].get("condition", ())), key=repr)
                )
                for g in node.get("alternative", ())
            )
            return AnyOf(tuple(sorted(groups, key=repr)), negated)
        raise ValueError(f"<{iri}>: a condition of no known kind")
