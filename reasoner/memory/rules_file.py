"""Translation of rules, orders and methods to triples and back, in the vocabulary of conditions and behaviours.

A `:LearnedRule` has a goal (`:forGoal`), conditions (`:asksFor`), and a behaviour with arguments (`:does`); the roles of the rule
are its parameters. A `:LearnedMethod` has the refined behaviour (`:refines`) and steps with an index. A `:LearnedOrder` has the
situation types `:first` and `:then`. ``:enabled false`` disables an item.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from typing import TypeAlias, TypeVar
from urllib.parse import quote, unquote

import pyoxigraph as ox

from confab.reasoner.condition_nodes import NodeReader, NodeValues, NodeWriter
from confab.reasoner.memory.experience import GoalKind, LearnedItem, LearnedOrder, LearnedRule, Method, OpenRole
from confab.reasoner.names import Names
from confab.reasoner.symbols import FALSE, TRUE, Condition, ValueCondition
from confab.reasoner.vocabulary import ARGUMENTS, CORE, MEMORY, RDF

Words: TypeAlias = "Callable[[LearnedItem], str]"
T = TypeVar("T")


def label(one: LearnedItem) -> str:
    """Return a short description of a learned item."""
    match one:
        case LearnedRule(goal, _, does):
            wanted = " ".join((*goal.arguments[:1], goal.situation, *goal.arguments[1:], goal.value))
            return f"for {wanted}: {' '.join((does[0], *does[1]))}".replace("?", "")
        case LearnedOrder(first, then, shared):
            return f"{first} before {then}" + (" of the same" if shared else "")
        case Method(behavior, _, steps, _):
            return f"{behavior} by {', '.join(name for name, _ in steps)}"
        case GoalKind(situation, classes):
            return f"{situation} of {', '.join(classes)}"
    raise TypeError(one)


class RuleWriter:
    """Writer of learned items as Turtle. Names that the scene doesn't contain become IRIs in the memory's namespace."""

    def __init__(self, names: Names, words: Words = label) -> None:
        self.names, self.words = names, words

    def term(self, name: str) -> str:
        """Return the Turtle notation of an individual, class, behaviour or situation type."""
        if name in self.names:
            return str(ox.NamedNode(self.names.iri(name)))
        return f":{name}" if name in (TRUE, FALSE) else str(ox.NamedNode(MEMORY + quote(name, safe="")))

    def said(self, one: LearnedItem, enabled: bool = True) -> str:
        """Return the Turtle statements of a learned item and its parts."""
        me = f"m:{one.name}"
        match one:
            case LearnedRule():
                kind, lines = "LearnedRule", self.rule(one, me)
            case LearnedOrder(first, then, shared):
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

    def rule(self, rule: LearnedRule, me: str) -> list[str]:
        """Return texts: first the properties of a rule, then the statements of the rule's parts."""
        terms = {role: f"{me}.{quote(role[1:], safe='')}" for role, _ in rule.kinds}
        nodes = _RuleNodes(me, self.term, terms)
        goal, *asks = map(nodes.condition, (rule.goal, *rule.asks))
        said = [f":forGoal {goal} ; {self.step(rule.does, terms)}"]
        said += [f":asksFor {', '.join(asks)}"] if asks else []
        said += [f":role {', '.join(terms.values())}"] if terms else []
        roles = [
            f"{terms[role]} a owl:NamedIndividual, :Parameter ; :index {i} ; :termType {self.term(kind)}"
            for i, (role, kind) in enumerate(rule.kinds)
        ]
        return [" ; ".join(said), *roles, *nodes.nodes]

    def step(self, does: tuple[str, Sequence[str]], terms: Mapping[str, str]) -> str:
        """Return the properties that state a behaviour with its arguments."""
        put = [terms.get(term) or self.term(term) for term in does[1]]
        return " ; ".join([f":does {self.term(does[0])}", *(f":{a} {t}" for a, t in zip(ARGUMENTS, put, strict=False))])

    def method(self, method: Method, me: str) -> list[str]:
        """Return texts: first the properties of a method, then the statements of the method's parts."""
        roles = [f"{me}.role{i}" for i in range(method.roles + len(method.open))]
        steps = [f"{me}.step{i}" for i in range(len(method.steps))]
        lines = [f":refines {self.term(method.behavior)} ; :roles {method.roles} ; :step {', '.join(steps)}"]
        for i, role in enumerate(method.open, start=method.roles):
            said = f"{roles[i]} a owl:NamedIndividual, :Parameter ; :index {i} ; :termType {self.term(role.kind)}"
            if role.source is not None:
                of = "".join(f" ; :{a} {roles[j]}" for a, j in zip(ARGUMENTS, role.source[1], strict=False))
                said += f" ; :isValueOf {self.term(role.source[0])}{of}"
            lines.append(said + (f" ; :becomesValueOf {self.term(role.becomes)}" if role.becomes is not None else ""))
        lines += [f"{role} a owl:NamedIndividual ; :index {i}" for i, role in enumerate(roles[: method.roles])]
        for i, (name, places) in enumerate(method.steps):
            terms = [roles[place] for place in places]
            does = self.step((name, terms), dict(zip(terms, terms, strict=True)))
            lines.append(f"{steps[i]} a owl:NamedIndividual, :LearnedStep ; :index {i} ; {does}")
        if method.open:
            lines[0] += f" ; :role {', '.join(roles[method.roles :])}"
        return lines


class _RuleNodes(NodeWriter):
    """Writer of a rule's conditions; the name of a condition consists of the rule's name and a number."""

    def __init__(self, me: str, spelled: Callable[[str], str], terms: Mapping[str, str]) -> None:
        def variable(name: str, node: str, position: int) -> str:
            return f"{node}.{quote(name[1:], safe='')}"

        super().__init__(":", spelled, lambda kind, position: f"{me}.c{position}", variable, terms)

    def groups(self, alternatives: Sequence[Sequence[Condition]], node: str) -> list[str]:
        """Write each alternative of a disjunction as a conjunction, and return the nodes of the conjunctions."""
        found = [f"{node}.or{number}" for number in range(len(alternatives))]
        for name, group in zip(found, alternatives, strict=True):
            inner = [*map(self.condition, group)]
            self.nodes.append(self.statement(name, "AllOf", {"condition": inner}))
        return found


class RuleReader(NodeReader):
    """Reader of learned items from the triples of a file; core properties in `nodes` have no namespace."""

    def __init__(self, nodes: Mapping[str, NodeValues], names: Names | None) -> None:
        self.nodes, self.names = nodes, names
        self.roles: Mapping[str, str] = {}  # the names of a rule's roles, by their IRIs
        self.inside, self.count = [], [0]

    def values(self, iri: str, name: str) -> Sequence[str]:
        """Return the values of a node's property."""
        return self.nodes.get(iri, {}).get(name, ())

    def term(self, iri: str) -> str:
        """Return the name of a role or of a witness variable, or the short name of another term."""
        if iri in self.roles:
            return self.roles[iri]
        return "?" + unquote(iri).rsplit(".", 1)[-1] if self.is_a(iri, "Variable") else self.short(iri)

    def in_order(self, parts: Iterable[T]) -> tuple[T, ...]:
        """Return the parts of a condition, sorted so that the order doesn't depend on IRIs."""
        return tuple(sorted(parts, key=repr))

    def short(self, iri: str) -> str:
        """Return the short name of a term."""
        if iri.startswith(MEMORY):
            return unquote(iri.removeprefix(MEMORY))
        if self.names is not None:
            return self.names.short(iri)
        return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]

    def said(self, iri: str) -> LearnedItem | None:
        """Return the learned item of a node, or None for another node; raise `ValueError` if a part is missing."""
        node = self.nodes[iri]
        kinds = [kind.removeprefix(CORE) for kind in node.get(RDF + "type", ())]
        if "LearnedRule" in kinds:
            return self.rule(iri, node)
        if "LearnedOrder" in kinds:
            pairs = [text.split() for text in node.get("shares", ())]
            shared = sorted((int(i), int(j)) for i, j in pairs)
            return LearnedOrder(self.short(self.one(iri, "first")), self.short(self.one(iri, "then")), tuple(shared))
        if "LearnedMethod" in kinds:
            return self.method(iri, node)
        if "GoalKind" in kinds:
            return GoalKind(self.short(self.one(iri, "situationType")), self.arguments(iri))
        return None

    def rule(self, iri: str, node: NodeValues) -> LearnedRule:
        """Return the rule of a node."""
        roles = sorted(node.get("role", ()), key=lambda role: (int(self.one(role, "index")), role))
        terms = {role: "?" + unquote(role.removeprefix(iri + ".")) for role in roles}
        if len(set(terms.values())) < len(roles) or any("." in name for name in terms.values()):
            terms = {role: f"?role{i}" for i, role in enumerate(roles)}
        self.roles = terms
        goal = self.condition(self.one(iri, "forGoal"))
        if not isinstance(goal, ValueCondition):
            raise ValueError(f"<{iri}>: its :forGoal is no :ValueCondition")
        asks = self.in_order(map(self.condition, node.get("asksFor", ())))
        does = self.short(self.one(iri, "does")), self.arguments(iri)
        kinds = tuple((terms[role], self.short(self.one(role, "termType"))) for role in roles)
        return LearnedRule(goal, asks, does, kinds)

    def arguments_of(self, iri: str) -> list[str]:
        """Return the IRIs of a node's arguments, in order."""
        return [value for name in ARGUMENTS for value in self.values(iri, name)[:1]]

    def method(self, iri: str, node: NodeValues) -> Method:
        """Return the method of a node."""
        own = int(self.one(iri, "roles"))
        opened = sorted(node.get("role", ()), key=lambda role: int(self.one(role, "index")))
        steps = []
        for step in sorted(node.get("step", ()), key=lambda step: int(self.one(step, "index"))):
            places = tuple(int(self.one(role, "index")) for role in self.arguments_of(step))
            steps.append((self.short(self.one(step, "does")), places))
        roles = []
        for role in opened:
            source = becomes = None
            if "isValueOf" in self.nodes[role]:
                places = tuple(int(self.one(other, "index")) for other in self.arguments_of(role))
                source = self.short(self.one(role, "isValueOf")), places
            if "becomesValueOf" in self.nodes[role]:
                becomes = self.short(self.one(role, "becomesValueOf"))
            roles.append(OpenRole(self.short(self.one(role, "termType")), source, becomes))
        named = [*(places for _, places in steps), *(role.source[1] for role in roles if role.source)]
        for place in chain.from_iterable(named):
            if not 0 <= place < own + len(roles):
                raise ValueError(f"<{iri}>: names role {place} of {own + len(roles)}, counted from 0")
        return Method(self.short(self.one(iri, "refines")), own, tuple(steps), tuple(roles))
