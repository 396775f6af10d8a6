"""A plan as a reactive behaviour tree; if a disturbance undoes a step, the tree repeats the step.

The facts that the tree must establish are those of causal links between two primitives, or from a primitive to the goal
(`confab.planner.causal_links`). Each required primitive has a mark, which states that the primitive is done.

An attempt begins with the latest position of the plan at which the facts of all links across this position hold (the kernels of
Fikes, Hart and Nilsson, 1972); the primitives before it are marked. A primitive is also marked when it has been executed. In each
tick, from the last primitive to the first, the mark is taken from each primitive with a link of which neither the fact holds nor
the later primitive is marked. Therefore a primitive is repeated if and only if a later primitive, or the goal, requires its
effects. If a tick fails, because no step restores what a later step requires, the next attempt begins.

Steps are ticked in the order of the plan, and after each primitive the tree is ticked again. Each step is a fallback: the step is
done; or what later steps and the goal require of it holds already, and its primitives are marked; or it is executed. Sibling steps
are parallel if they have different workers and their primitives neither require nor disturb one another. The steps below an
abstract step are a subtree.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import networkx

from confab.planner.acting.schedule import PartialOrder, partial_order, worker_of
from confab.planner.causal_links import FactChange, Need, NeedKind, Purpose, purposes
from confab.planner.plan import Plan, Step
from confab.planner.timed.pieces import workers_of
from confab.planner.validation import BehaviorReader, LoggedState, followed, unmet_goals
from confab.reasoner.amounts import meets
from confab.reasoner.limits import check
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Condition, Fact, State, Symbol, ValueCondition


@dataclass(frozen=True)
class Element:
    """A node of a behaviour tree, of a kind that both BehaviorTree.CPP and py_trees support.

    In each tick, Sequence ticks its children one after another until one fails, Fallback until one succeeds, and Parallel ticks all
    children. A SubTree has a name and one child. Check compares a variable with a number, and Set gives a number to a variable. The
    leaves are Condition and Action, with the fact, the condition or the primitive in `leaf`. `confab.trees` adds the kinds Once and
    Again, and the names, the ports and the keys of leaves.
    """

    kind: str
    name: str = ""
    children: tuple[Element, ...] = ()
    ports: Mapping[str, str] = field(default_factory=dict, hash=False)
    key: str = ""
    leaf: Leaf | None = None


Path: TypeAlias = "tuple[int, ...]"
Leaf: TypeAlias = "Fact | Condition | Step"
POSITION = "position"
"""The variable with the number of primitives that are done when an attempt begins."""


def sequence(*children: Element) -> Element:
    """Return a node that ticks its children until one of them fails."""
    return Element("Sequence", children=children)


def fallback(*children: Element) -> Element:
    """Return a node that ticks its children until one of them succeeds."""
    return Element("Fallback", children=children)


def compared(variable: str, comparison: str, number: int) -> Element:
    """Return the condition that a variable of the tree is at least a number (>=), or less than the number (<)."""
    return Element("Check", variable, ports={"comparison": comparison, "number": str(number)})


def assigned(variable: str, number: int) -> Element:
    """Return a node that gives a number to a variable of the tree, and succeeds."""
    return Element("Set", variable, ports={"number": str(number)})


def holds(facts: Iterable[Fact], conditions: Iterable[Condition] = ()) -> Element:
    """Return the node that succeeds if some facts and some ground conditions hold."""
    leaves = [Element("Condition", leaf=one) for one in (*facts, *conditions)]
    return leaves[0] if len(leaves) == 1 else sequence(*leaves)


def done(path: Path) -> Element:
    """Return the condition that the primitive at a path is marked as done."""
    return compared("done_" + "_".join(map(str, path)), ">=", 1)


def mark(path: Path, number: int) -> Element:
    """Return the node that marks the primitive at a path as done (1), or takes the mark away (0)."""
    return assigned(done(path).name, number)


def behavior_tree(problem: Problem, plan: Plan) -> tuple[Element, Element]:
    """Return two trees of a valid plan: one finds the position at which an attempt begins, the other is ticked until it succeeds.

    The plan begins in the problem's initial state. The trees ignore the soft goals that the plan leaves unmet.
    """
    problem = problem.only(unmet_goals(problem, plan))
    tree = _TreeBuilder(problem, plan)
    goal = holds((*(Fact(symbol, value) for symbol, value in sorted(problem.goal.items())), *tree.at_rest()))
    marking = Element("SubTree", "undone steps", (sequence(*tree.unmarking()),))
    attempt = fallback(goal, sequence(marking, *tree.in_order(plan.steps), goal))
    return Element("SubTree", "position", (sequence(*tree.positioning()),)), Element("SubTree", "plan", (attempt,))


class _TreeBuilder:
    """Creates the nodes for a plan's steps."""

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self.problem = problem
        primitives = plan.primitives
        self.purposes: Mapping[Path, Purpose] = purposes(problem, Plan(primitives))
        self.position = {step.path: number for number, step in enumerate(primitives)}
        self.changed: dict[Symbol, dict[int, str]] = {}
        for path, number in self.position.items():
            for change in self.purposes[path].gives:
                self.changed.setdefault(change.fact.symbol, {})[number] = change.fact.value
        self.needs: dict[Path, list[Need]] = {}
        for step in reversed(primitives):  # a primitive required only by superfluous steps is superfluous
            needs = [need for need in self.purposes[step.path].needs if not need.by or self.needs.get(need.by)]
            self.needs[step.path] = [need for need in needs if self.lasts(step.path, need)] or needs
        self.regained = set(self.already_satisfied())
        self.order: PartialOrder = partial_order(problem, primitives)
        self.workers = workers_of(problem)

    # --------------------------------------------------------------------------------------------------- steps

    def at_rest(self) -> list[Fact]:
        """Return the rest values of all symbols that the plan changes and that have rest values."""
        changed = {change.fact.symbol for purpose in self.purposes.values() for change in purpose.gives}
        rests = ((symbol, self.problem.domain.situations[symbol.situation].rest) for symbol in sorted(changed))
        return [Fact(symbol, rest) for symbol, rest in rests if rest is not None and not self.problem.releases(symbol)]

    def positioning(self) -> Iterator[Element]:
        """Yield the nodes that find the latest position at which all links across it are satisfied, and set the marks.

        The links are tested from the last consumer to the first. Therefore each link has to be tested only once.
        """
        end = len(self.position)
        links = [(self.position.get(need.by, end), path, need) for path in self.position for need in self.needs[path]]
        yield assigned(POSITION, end)
        for consumer, path, need in sorted(links, key=lambda link: link[:2], reverse=True):
            producer = self.position[path]
            later = [compared(POSITION, ">=", consumer + 1)] if need.by else []
            before = compared(POSITION, "<", producer + 1)
            yield fallback(before, *later, self.facts(path, need), assigned(POSITION, producer))
        for path, number in self.position.items():
            if self.needs[path]:
                yield mark(path, 0)
                yield fallback(compared(POSITION, "<", number + 1), mark(path, 1))

    def unmarking(self) -> Iterator[Element]:
        """Yield the nodes that take the marks from primitives with unsatisfied links, the last primitive first."""
        needed = [path for path in self.position if self.needs[path]]
        return (fallback(self.kept([path]), mark(path, 0)) for path in reversed(needed))

    def in_order(self, steps: Iterable[Step]) -> Iterator[Element]:
        """Yield the nodes of sibling steps; consecutive steps that are independent are parallel."""
        groups: list[list[Step]] = []
        for step in steps:
            check("building the behaviour tree")
            if not self.needed(step):
                continue
            if groups and all(self.independent(step, other) for other in groups[-1]):
                groups[-1].append(step)
            else:
                groups.append([step])
        for nodes in (tuple(map(self.node, group)) for group in groups):
            yield nodes[0] if len(nodes) == 1 else Element("Parallel", children=nodes)

    def needed(self, step: Step) -> list[Path]:
        """Return the paths of the primitives of a step that are required."""
        return [below.path for below in Plan((step,)).primitives if self.needs[below.path]]

    def node(self, step: Step) -> Element:
        """Return the fallback node of a step."""
        paths = self.needed(step)
        early = sequence(self.kept(paths), *(mark(path, 1) for path in paths))
        name = f"{step} at {'.'.join(map(str, step.path))}"
        below = Element("SubTree", name, (sequence(*self.in_order(step.steps)),))
        return fallback(sequence(*map(done, paths)), early, below if step.steps else Element("Action", leaf=step))

    def independent(self, one: Step, other: Step) -> bool:
        """Return whether no primitive of one step waits for a primitive of the other, and their workers differ."""
        ours, theirs = Plan((one,)).primitives, Plan((other,)).primitives
        busy = {worker_of(step, self.workers) for step in ours} & {worker_of(step, self.workers) for step in theirs}
        if busy or not self.workers:
            return False
        pairs = [(self.position[a.path], self.position[b.path]) for a, b in product(ours, theirs)]
        return not any(networkx.has_path(self.order, *sorted(pair)) for pair in pairs)

    # ------------------------------------------------------------------------------------------------ purposes of the steps

    def kept(self, paths: Collection[Path]) -> Element:
        """Return the condition that all causal links from some primitives to other primitives and to the goal are satisfied."""
        links = [(path, need) for path in paths for need in self.needs[path] if need.by not in paths]
        nodes = list(dict.fromkeys(self.link(path, need) for path, need in links))
        return nodes[0] if len(nodes) == 1 else sequence(*nodes)

    def link(self, path: Path, need: Need) -> Element:
        """Return the condition that a causal link is satisfied: the later step is done, or the link's facts or conditions hold."""
        facts = self.facts(path, need)
        return fallback(done(need.by), facts) if need.by else facts

    def facts(self, path: Path, need: Need) -> Element:
        """Return the condition that the facts of a causal link, or the conditions of the later step, hold.

        If a step between the two steps changes a symbol again, the symbol may have any value except the one from before the link.
        Conditions that hold before the earlier step aren't enough, since the plan violates them in the meantime.
        """
        between = range(self.position[path] + 1, self.position.get(need.by, len(self.position)))
        facts, conditions = list[Fact](), list[Condition]()
        for change in need.gives:
            symbol = change.fact.symbol
            if any(number in between for number in self.changed[symbol]) and not self.is_amount(symbol):
                conditions.append(ValueCondition(symbol.situation, symbol.arguments, change.before, negated=True))
            else:
                facts.append(self.wanted(change, need.kind))
        held = holds(facts, conditions)
        amounts = any(self.is_amount(change.fact.symbol) for change in need.gives)
        if need.conditions and not amounts and (path, need) not in self.regained:
            return fallback(held, holds((), need.conditions))
        return held

    def already_satisfied(self) -> Iterator[tuple[Path, Need]]:
        """Yield each causal link whose conditions hold before the earlier step, with the path of this step."""
        facts = LoggedState(self.problem, self.problem.initial)
        for path in self.position:
            for need in self.needs[path]:
                if need.conditions and facts.rules.satisfied(need.conditions, {}, {}, facts) is not None:
                    yield path, need
            for change in self.purposes[path].gives:
                facts.put(change.fact.symbol.situation, change.fact.symbol.arguments, change.fact.value)

    def lasts(self, path: Path, need: Need) -> bool:
        """Return whether all amounts of a causal link hold from the earlier step to the later one.

        Otherwise a step between them changes an amount, and has a causal link to each of the two steps.
        """
        end = self.position.get(need.by, len(self.position))
        return all(
            meets(value, self.wanted(change, need.kind).value)
            for change in need.gives
            if self.is_amount(change.fact.symbol)
            for number, value in self.changed[change.fact.symbol].items()
            if self.position[path] <= number < end
        )

    def is_amount(self, symbol: Symbol) -> bool:
        """Return whether the values of a symbol are numbers."""
        return self.problem.domain.situations[symbol.situation].quantity is not None

    def wanted(self, change: FactChange, kind: NeedKind) -> Fact:
        """Return the fact that a change makes true; the fact of an amount is that it is at least, or at most, the planned value."""
        symbol, value = change.fact.symbol, change.fact.value
        if kind is NeedKind.GOAL and symbol in self.problem.goal:
            return Fact(symbol, self.problem.goal[symbol])
        if not self.is_amount(symbol):
            return change.fact
        return Fact(symbol, f">={value}" if Fraction(value) > Fraction(change.before) else f"<={value}")


# ------------------------------------------------------------------------------------------------------------- evaluation


class Situation:
    """Evaluates the leaves of a tree in a state."""

    def __init__(self, problem: Problem, state: State) -> None:
        self.problem, self.state = problem, state
        self.rules = BehaviorReader(problem)
        self.facts = LoggedState(problem, state, self.rules)

    def asks(self, leaf: Leaf) -> bool:
        """Return whether a fact or condition holds, or a primitive is applicable; the value of an amount may be a comparison."""
        if isinstance(leaf, Step):
            return followed(self.problem, [leaf], self.state) is not None
        if isinstance(leaf, Fact):
            value = self.facts.value(leaf.symbol.situation, leaf.symbol.arguments)
            return value is not None and meets(value, leaf.value)
        return self.rules.satisfied((leaf,), {}, {}, self.facts) is not None
