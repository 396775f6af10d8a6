"""Export of one level of a scene to PDDL. The export uses STRIPS where possible, because many planners support little more.

A class becomes a type, or a unary predicate if the class overlaps another class. Every individual becomes an object,
including individuals that are only values. A situation type becomes a predicate of its arguments and, unless the type
is boolean, its value. `confab.reasoner.pddl.lowering` describes the translation of behaviours.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import NamedTuple

from confab.reasoner.amounts import written
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import checked
from confab.reasoner.names import local_name
from confab.reasoner.pddl.durative_actions import DurativeAction, TimedExport, literal_text
from confab.reasoner.pddl.formulas import (
    TRUE,
    Assignment,
    Atom,
    Compare,
    Exists,
    Not,
    Or,
    PddlTerm,
    Same,
    both,
    calls,
    change_text,
    conjuncts,
    either,
    formula_text,
    inside,
    number_text,
    terms,
    terms_of,
    typed,
)
from confab.reasoner.pddl.lowering import ActionScope, LoweredAction, Lowering
from confab.reasoner.pddl.vocabulary import PddlNames
from confab.reasoner.problem import Problem
from confab.reasoner.timing import only_during

EXPORTING = "exporting the facts"
LINE = "\n    "


@dataclass(frozen=True)
class Exported:
    """An exported PDDL domain and problem, with the mapping from PDDL names to the names of the scene.

    `actions` maps the name of an action to its behaviour, and to the positions of the behaviour's parameters in the action's list
    of parameters. `objects` maps the name of an object to its individual.
    """

    domain: str
    problem: str
    actions: Mapping[str, tuple[str, tuple[int, ...]]]
    objects: Mapping[str, str]


def to_pddl(problem: Problem, level: int | None = None, workers: Collection[str] | None = None) -> Exported:
    """Return one level of a problem as a PDDL domain and a PDDL problem.

    Parameters
    ----------
    problem : Problem
    level : int, optional
        The level whose behaviours become actions; by default the lowest level.
    workers : collection of individuals, optional
        The individuals that are actors if no behaviour names its actors. If they are given, behaviours of the lowest level become
        durative actions (`confab.reasoner.pddl.durative_actions`); without them, the export has no times.

    Raises
    ------
    KnowledgeError
        An export without times: a behaviour gives a symbol a value only during its execution, and the goal or another behaviour may
        require this value. An export with times: an external event depends on the state. Any export: an amount has an initial value
        without a finite decimal notation.
    """
    if workers is None and (names := sorted(only_during(problem))):
        raise KnowledgeError(
            f"{names[0]} gives a value only while it lasts, which classical PDDL can't say; such scenes are planned here only"
        )
    level = problem.domain.levels[-1] if level is None else level
    return _Export(replace(problem, goal=problem.goal_on(level)), level, workers).exported()


class PlanLine(NamedTuple):
    """A step of a plan: its begin and its duration in seconds, which are None in a plan without times."""

    behavior: str
    arguments: tuple[str, ...]
    begin: Fraction | None
    duration: Fraction | None


NUMBER = r"(?:\d+\.?\d*|\.\d+)"
STEP = re.compile(
    rf"(?:(?P<begin>{NUMBER}) ?: ?)?\(?(?P<words>[^()\[\]:]*)\)? ?(?:\[ ?(?:d: ?)?(?P<duration>{NUMBER})[^\]]*\]?)?"
)
"""A line of a plan in the competition format, with single spaces; the comment may begin within ``[D:4; C:1]``."""


def plan_of(exported: Exported, text: str) -> list[PlanLine]:
    """Return the steps of a plan in the competition format, one per line, with comments after ``;``.

    A step is ``(action object …)``, or ``begin: (action object …) [duration]`` in a plan with times.

    Raises
    ------
    ValueError
        A line doesn't name an action and objects of the exported domain; the message states the line.
    """
    steps = []
    for number, line in enumerate(text.splitlines(), start=1):
        said = " ".join(line.split(";")[0].lower().split())
        found = STEP.fullmatch(said)
        words = (said if found is None else found["words"]).split()
        if not words:
            continue
        if words[0] not in exported.actions:
            raise ValueError(f"line {number}: no action '{words[0]}' in the exported domain")
        behavior, places = exported.actions[words[0]]
        unknown = [word for word in words[1:] if word not in exported.objects]
        if unknown or (places and max(places) >= len(words) - 1):
            raise ValueError(
                f"line {number}: {'no object ' + unknown[0] if unknown else 'too few objects'}: {line.strip()}"
            )
        begin, duration = (
            None if found is None or found[one] is None else Fraction(found[one]) for one in ("begin", "duration")
        )
        steps.append(PlanLine(behavior, tuple(exported.objects[words[1 + place]] for place in places), begin, duration))
    return steps


class _Export:
    """Intermediate results of the export of one level of a problem."""

    def __init__(self, problem: Problem, level: int, workers: Collection[str] | None = None) -> None:
        self.problem, self.words = problem, PddlNames(problem)
        behaviors = problem.domain.at_level(level)
        self.timed = None if workers is None else TimedExport(problem, behaviors, self.words, workers)
        self.lowering = Lowering(problem, behaviors, self.words) if self.timed is None else self.timed.lowering
        made: Iterable[LoweredAction | DurativeAction]
        if self.timed is None:
            made = (action for action in map(self.lowering.action, self.lowering.cases) if action is not None)
        else:
            made = self.timed.actions()
        self.actions = {
            self.words.name("action", f"{number} {action.behavior.name}", action.behavior.name): action
            for number, action in enumerate(made)
        }
        self.derived = list(self.lowering.derived()) if self.lowering.recursive else []
        hard = [(symbol, value) for symbol, value in problem.goal.items() if symbol not in problem.weights]
        wanted = [self.lowering.goal(symbol, value) for symbol, value in hard]
        self.preferences = [
            (self.words.name("preference", str(symbol), "_".join((*symbol.arguments, symbol.situation))), weight, soft)
            for symbol, weight in problem.weights.items()
            for soft in [self.lowering.goal(symbol, problem.goal[symbol])]
        ]
        demanded = problem.only(problem.weights)
        for symbol, rest in demanded.at_rest(level).items():
            if symbol in demanded.goal:
                continue
            soft = [goal for goal in problem.weights if problem.concerns(goal, symbol)]
            if soft:  # unless one of these soft goals is met, the symbol has to be at rest
                ways = [(symbol, rest), *((goal, problem.goal[goal]) for goal in soft)]
                wanted.append(either(self.lowering.goal(*way) for way in ways))
        self.goal = both([*wanted, *self.lowering.within_bounds(ActionScope({}))])
        self.literals = [] if self.timed is None else sorted(self.timed.literals())
        timed = () if self.timed is None else self.timed.facts()
        self.facts = [*checked(chain(timed, self.lowering.kept.facts(), self.words.facts()), EXPORTING)]
        self.formulas = [*(action.needs for action in self.actions.values()), *(holds for _, _, holds in self.derived)]
        self.changes = [change for action in self.actions.values() for change in action.changes]
        costly = any(action.cost != 1 for action in self.actions.values()) or bool(self.preferences)
        self.costs = costly and self.timed is None

    def exported(self) -> Exported:
        """Return the texts of the domain and the problem, with the mapping of PDDL names to the scene's names."""
        named = self.words.name("domain", local_name(self.problem.scene))
        constants = {term.name for term in self.named_in_domain() if not term.variable}
        found = [one for fact in self.facts for one in (fact.terms if isinstance(fact, Atom) else fact[0].terms)]
        goals = (self.goal, *(soft for _, _, soft in self.preferences))
        found += [term for goal in goals for term in terms(goal) if not term.variable]
        stated = {term.name for term in found} | constants
        individuals = dict.fromkeys(one for members in self.problem.classes.values() for one in members)
        individuals |= dict.fromkeys(one for kind, one in self.words.names if kind == "object")
        every = {self.words.name("object", one): one for one in individuals}
        every = {name: one for name, one in every.items() if name in stated or one in self.words.lowest}
        return Exported(
            domain=self.domain_text(named, [one for name, one in every.items() if name in constants]),
            problem=self.problem_text(named, [one for name, one in every.items() if name not in constants]),
            actions={name: (action.behavior.name, action.places) for name, action in self.actions.items()},
            objects=every,
        )

    def named_in_domain(self) -> Iterator[PddlTerm]:
        """Yield all terms in the exported actions and derived predicates."""
        for formula in self.formulas:
            yield from terms(formula)
        for change in self.changes:
            yield from terms_of(change)
        for action in self.actions.values():
            yield from (term for call in calls(action.cost) for term in call.terms)

    def requirements(self) -> str:
        """Return the requirement flags of the domain, separated by spaces."""
        goals = (self.goal, *(soft for _, _, soft in self.preferences))
        parts = [part for formula in (*self.formulas, *goals) for part in inside(formula)]
        parts += [part for change in self.changes for part in inside(change.when)]
        numeric = any(isinstance(part, Compare) for part in parts)
        numeric |= any(isinstance(change.what, Assignment) for change in self.changes)
        wanted = {
            ":negative-preconditions": any(isinstance(part, Not) for part in parts),
            ":disjunctive-preconditions": any(isinstance(part, Or) for part in parts),
            ":existential-preconditions": any(isinstance(part, Exists) for part in parts),
            ":conditional-effects": any(change.when != TRUE or change.variables for change in self.changes),
            ":equality": any(isinstance(part, Same) for part in parts),
            ":derived-predicates": bool(self.derived),
            ":action-costs": self.costs,
            ":preferences": bool(self.preferences),
            ":numeric-fluents": numeric,
            ":durative-actions": self.timed is not None,
            ":timed-initial-literals": bool(self.literals),
        }
        return " ".join([":strips", ":typing", *(key for key, needed in wanted.items() if needed)])

    def domain_text(self, name: str, constants: Sequence[str]) -> str:
        """Return the text of the PDDL domain."""
        types = [f"{kind} - {above}" for kind, above in self.words.above.items()]
        predicates = [self.declaration(*one) for one in sorted(self.words.predicates.items())]
        functions = [f"{self.declaration(*one)} - number" for one in sorted(self.words.functions.items())]
        functions += ["(total-cost) - number"] * self.costs
        sections = [(":types", types), (":constants", list(map(self.words.declared, constants)))]
        sections += [(":predicates", predicates), (":functions", functions)]
        head = "".join(f"  ({key}{LINE}{LINE.join(lines)})\n" for key, lines in sections if lines)
        rules = [
            f"  (:derived ({' '.join([head.predicate, typed(its)]).strip()})\n    {formula_text(holds)})"
            for head, its, holds in self.derived
        ]
        body = "\n".join([*rules, *(self.action_text(name, action) for name, action in self.actions.items())])
        return f"(define (domain {name})\n  (:requirements {self.requirements()})\n{head}{body})\n"

    def declaration(self, name: str, kinds: Sequence[Collection[str]]) -> str:
        """Return the declaration of a predicate or function with the types of its arguments."""
        return f"({' '.join([name, *(f'?x{i} - {self.words.common(types)}' for i, types in enumerate(kinds))])})"

    def action_text(self, name: str, action: LoweredAction | DurativeAction) -> str:
        """Return the PDDL text of an action."""
        if isinstance(action, DurativeAction):
            return action.text(name)
        made = {(change.what, change.when, change.variables) for change in action.changes}
        changes = [
            change
            for change in dict.fromkeys(action.changes)
            if not (isinstance(change.what, Not) and (change.what.inner, change.when, change.variables) in made)
        ]
        changes.sort(key=lambda change: not isinstance(change.what, Not))
        lines = list(map(change_text, changes))
        lines += [f"(increase (total-cost) {number_text(action.cost)})"] * self.costs
        inner = "\n      "
        return (
            f"  (:action {name}\n    :parameters ({typed(action.parameters)})\n"
            f"    :precondition (and{inner}{inner.join(map(formula_text, conjuncts(action.needs)))})\n"
            f"    :effect (and{inner}{inner.join(lines)}))"
        )

    def problem_text(self, domain: str, objects: Sequence[str]) -> str:
        """Return the text of the PDDL problem."""
        facts = ["(= (total-cost) 0)"] * self.costs
        for fact in checked(dict.fromkeys(self.facts), EXPORTING):
            if isinstance(fact, Atom):
                facts.append(formula_text(fact))
                continue
            what, number = number_text(fact[0]), written(fact[1])
            if "/" in number:
                raise KnowledgeError(f"{what} is {number} initially, which no decimal number of PDDL states exactly")
            facts.append(f"(= {what} {number})")
        facts += [literal_text(at, text) for at, text in self.literals]
        unmet = "".join(f" (* {number_text(weight)} (is-violated {name}))" for name, weight, _ in self.preferences)
        total = "(total-cost)" if self.timed is None else "(total-time)"
        cost = f"(+ {total}{unmet})" if unmet else total
        metric = f"  (:metric minimize {cost})\n" if self.costs or self.timed is not None else ""
        name = self.words.name("problem", local_name(self.problem.scene))
        soft = [f"(preference {name} {formula_text(one)})" for name, _, one in self.preferences]
        goals = LINE.join([*map(formula_text, conjuncts(self.goal)), *soft])
        return (
            f"(define (problem {name})\n  (:domain {domain})\n"
            f"  (:objects{LINE}{LINE.join(map(self.words.declared, objects))})\n"
            f"  (:init{LINE}{LINE.join(facts)})\n"
            f"  (:goal (and{LINE}{goals}))\n{metric})\n"
        )
