"""A plan as a reactive behaviour tree; if a disturbance undoes a step, the tree repeats the step.

Each step becomes a fallback with two children: the first child tests whether the effects of the step already hold, and the
second child tests the conditions of the step and executes the step. The facts that the tree must establish are those of causal
links between two primitives, or from a primitive to the goal (`confab.planner.causal_links`). A link is satisfied if the fact
holds, or if the later primitive has been executed. Therefore a primitive is repeated if and only if a later primitive still
requires its effects. At the beginning of each tick, the completed primitives are marked, from the last to the first. After each
primitive the tree is ticked again. Steps are ticked in the order of the plan; sibling steps are parallel if they have different
workers and their primitives neither require nor disturb one another. The steps below an abstract step are a subtree.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import networkx

from confab.planner.acting.schedule import PartialOrder, partial_order, worker_of, workers_of
from confab.planner.causal_links import FactChange, Need, NeedKind, Purpose, purposes
from confab.planner.plan import Plan, Step
from confab.planner.validation import BehaviorReader, LoggedState, followed
from confab.reasoner.amounts import meets
from confab.reasoner.limits import check
from confab.reasoner.symbols import Condition, Fact, Problem, State, Symbol


@dataclass(frozen=True)
class Holds:
    """A condition leaf that succeeds if some facts, or some ground conditions, hold."""

    facts: tuple[Fact, ...] = ()
    conditions: tuple[Condition, ...] = ()


@dataclass(frozen=True)
class Do:
    """An action leaf: if its preconditions hold, a primitive is executed, and then the tree is ticked again."""

    step: Step


@dataclass(frozen=True)
class Marked:
    """A condition leaf that succeeds if the step at a path was marked as done in this tick."""

    path: Path


@dataclass(frozen=True)
class Mark:
    """A node that marks the step at a path as done, or not done, after its child succeeds or fails; the node itself succeeds."""

    path: Path
    child: TreeNode


@dataclass(frozen=True)
class All:
    """A sequence node: the children are ticked one after another, until one child fails."""

    children: tuple[TreeNode, ...]


@dataclass(frozen=True)
class First:
    """A fallback node: the children are ticked one after another, until one child succeeds."""

    children: tuple[TreeNode, ...]


@dataclass(frozen=True)
class Together:
    """A parallel node: the children are ticked at the same time and must all succeed."""

    children: tuple[TreeNode, ...]


@dataclass(frozen=True)
class Subtree:
    """A named subtree: the whole tree, the nodes that mark completed steps, or the sub-steps of a step."""

    name: str
    child: TreeNode


Path: TypeAlias = "tuple[int, ...]"
TreeNode: TypeAlias = "Holds | Do | Marked | Mark | All | First | Together | Subtree"


def behavior_tree(problem: Problem, plan: Plan) -> Subtree:
    """Return the behaviour tree of a valid plan, which begins in the problem's initial state."""
    tree = _TreeBuilder(problem, plan)
    goal = Holds((*(Fact(symbol, value) for symbol, value in sorted(problem.goal.items())), *tree.at_rest()))
    marking = Subtree("completed steps", All(tree.marks()))
    return Subtree("plan", First((goal, All((marking, *tree.in_order(plan.steps), goal)))))


def children(node: TreeNode) -> tuple[TreeNode, ...]:
    """Return the children of a node."""
    if isinstance(node, All | First | Together):
        return node.children
    return (node.child,) if isinstance(node, Subtree | Mark) else ()


class _TreeBuilder:
    """Creates the nodes for a plan's steps."""

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self.problem = problem
        primitives = plan.primitives
        self.purposes: Mapping[Path, Purpose] = purposes(problem, Plan(primitives))
        asked_above = _abstract_links(self.purposes, purposes(problem, plan), plan)
        self.needs: dict[Path, list[Need]] = {}
        for step in reversed(primitives):  # a primitive required only by superfluous steps is superfluous
            needs = dict.fromkeys(self.purposes[step.path].needs)
            for change, consumers in asked_above.get(step.path, ()):
                needs |= {
                    Need(NeedKind.LATER, (change,), by): None for by in [b for b in consumers if self.needs.get(b)][:1]
                }
            self.needs[step.path] = [need for need in needs if not need.by or self.needs.get(need.by)]
        self.position = {step.path: number for number, step in enumerate(primitives)}
        self.order: PartialOrder = partial_order(problem, primitives)
        self.workers = workers_of(problem)

    # --------------------------------------------------------------------------------------------------- steps

    def at_rest(self) -> list[Fact]:
        """Return the rest values of all symbols that the plan changes and that have rest values."""
        changed = {change.fact.symbol for purpose in self.purposes.values() for change in purpose.gives}
        rests = ((symbol, self.problem.domain.situations[symbol.situation].rest) for symbol in sorted(changed))
        return [Fact(symbol, rest) for symbol, rest in rests if rest is not None and symbol not in self.problem.goal]

    def marks(self) -> tuple[TreeNode, ...]:
        """Return the nodes that mark the required primitives as done, the last primitive first."""
        needed = [path for path in self.position if self.needs[path]]
        return tuple(Mark(path, self.kept(path)) for path in reversed(needed))

    def in_order(self, steps: Iterable[Step]) -> tuple[TreeNode, ...]:
        """Return the nodes of sibling steps; consecutive steps that are independent are parallel."""
        groups: list[list[Step]] = []
        for step in steps:
            check("building the behaviour tree")
            if not self.needed(step):
                continue
            if groups and all(self.independent(step, other) for other in groups[-1]):
                groups[-1].append(step)
            else:
                groups.append([step])
        return tuple(
            self.node(group[0]) if len(group) == 1 else Together(tuple(map(self.node, group))) for group in groups
        )

    def needed(self, step: Step) -> list[Step]:
        """Return the primitives of a step that are required."""
        return [below for below in Plan((step,)).primitives if self.needs[below.path]]

    def node(self, step: Step) -> TreeNode:
        """Return the fallback node of a step."""
        if not step.steps:
            return First((self.kept(step.path), Do(step)))
        guard = All(tuple(self.kept(below.path) for below in self.needed(step)))
        name = f"{step} at {'.'.join(map(str, step.path))}"
        return First((guard, Subtree(name, All(self.in_order(step.steps)))))

    def independent(self, one: Step, other: Step) -> bool:
        """Return whether no primitive of one step waits for a primitive of the other, and their workers differ."""
        ours, theirs = Plan((one,)).primitives, Plan((other,)).primitives
        busy = {worker_of(step, self.workers) for step in ours} & {worker_of(step, self.workers) for step in theirs}
        if busy or not self.workers:
            return False
        pairs = [(self.position[a.path], self.position[b.path]) for a, b in product(ours, theirs)]
        return not any(networkx.has_path(self.order, *sorted(pair)) for pair in pairs)

    # ------------------------------------------------------------------------------------------------ purposes of the steps

    def kept(self, path: Path) -> TreeNode:
        """Return the condition that all causal links from a primitive are satisfied."""
        links = tuple(dict.fromkeys(map(self.link, self.needs[path])))
        return links[0] if len(links) == 1 else All(links)

    def link(self, need: Need) -> TreeNode:
        """Return the condition that a causal link is satisfied: the later step is done, or the link's facts or conditions hold."""
        kept: list[TreeNode] = [Marked(need.by)] if need.by else []
        kept.append(Holds(tuple(self.wanted(change, need.kind) for change in need.gives)))
        if need.conditions and not any(self.is_amount(change.fact.symbol) for change in need.gives):
            kept.append(Holds(conditions=need.conditions))
        return kept[0] if len(kept) == 1 else First(tuple(kept))

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


def _abstract_links(
    below: Mapping[Path, Purpose], whole: Mapping[Path, Purpose], plan: Plan
) -> dict[Path, list[tuple[FactChange, list[Path]]]]:
    """Return the causal links between abstract steps: each link has a fact, and the primitives at which the link may end.

    A link between abstract steps begins with the primitive that makes its fact true. The link ends with the first
    primitive of the later step that changes the fact, otherwise with the last required primitive of the later step.
    """
    under = {step.path: [primitive.path for primitive in Plan((step,)).primitives] for step in plan.walk()}
    found: dict[Path, list[tuple[FactChange, list[Path]]]] = {}
    for path, purpose in whole.items():
        for need in purpose.needs if under[path] != [path] else ():
            for change in need.gives if need.kind is NeedKind.LATER else ():
                writers = [one for one in under[path] if _changes(below[one], change.fact.symbol)]
                consumers = [one for one in under[need.by] if _changes(below[one], change.fact.symbol)]
                if writers:
                    found.setdefault(writers[-1], []).append((change, [*consumers[:1], *reversed(under[need.by])]))
    return found


def _changes(purpose: Purpose, symbol: Symbol) -> bool:
    return any(change.fact.symbol == symbol for change in purpose.gives)


# ------------------------------------------------------------------------------------------------------------- evaluation


class Situation:
    """Evaluates the leaves of a tree in a state."""

    def __init__(self, problem: Problem, state: State) -> None:
        self.problem, self.state = problem, state
        self.rules = BehaviorReader(problem)
        self.facts = LoggedState(problem, state, self.rules)

    def holds(self, leaf: Holds) -> bool:
        """Return whether all facts or conditions of a leaf hold."""
        if leaf.conditions:
            return self.rules.satisfied(leaf.conditions, {}, {}, self.facts) is not None
        return all(self.is_so(fact) for fact in leaf.facts)

    def is_so(self, fact: Fact) -> bool:
        """Return whether a fact holds; the wanted value of an amount may be a comparison."""
        value = self.facts.value(fact.symbol.situation, fact.symbol.arguments)
        return value is not None and meets(value, fact.value)

    def can(self, step: Step) -> bool:
        """Return whether the preconditions of a primitive hold."""
        return followed(self.problem, [step], self.state) is not None
