"""Concurrent execution: the necessary partial order of a plan's primitives, and a schedule that respects this order.

Most of the order of a sequential plan is arbitrary. A primitive must wait for an earlier primitive only if an exchange
of both primitives would make one primitive inapplicable or change its effects. The test executes the behaviours, so the
test covers all kinds of conditions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import networkx

from confab.planner.plan import Step
from confab.planner.validation import followed
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import State, Symbol

PartialOrder: TypeAlias = "networkx.DiGraph[int]"
Compatible = Callable[[Step, Step], bool]
"""Function of two primitives that returns whether both can be executed at the same time in the available room."""


@dataclass(frozen=True)
class WorkerSlot:
    """A primitive in a schedule: its worker, its beginning and its end in seconds."""

    step: Step
    position: int
    worker: str
    begin: float
    end: float


def partial_order(
    problem: Problem, primitives: Sequence[Step], observed: Mapping[int, State] = MappingProxyType({})
) -> PartialOrder:
    """Return the necessary order of primitives, which begin in the initial state, as a transitively reduced graph.

    The nodes are the primitives' positions in the sequence. `observed` has the states before primitives, by position, as far as
    they are known; other causes than the primitives may have changed them. The other states follow from the primitives.

    Raises
    ------
    ValueError
        A primitive isn't applicable in the state that the earlier primitives lead to.
    """
    states: list[State] = []
    writes: list[dict[Symbol, tuple[str | None, str]]] = []
    state = problem.initial
    for position, step in enumerate(primitives):
        before = observed.get(position, state)
        after = followed(problem, [step], before)
        if after is None:
            raise ValueError(f"{step} isn't applicable in the state before it")
        writes.append({s: (before.get(s), v) for s, v in after.items() if before.get(s) != v})
        states.append(before)
        state = after
    order: PartialOrder = networkx.DiGraph()
    for j, step in enumerate(primitives):
        order.add_node(j, label=str(step))
        for i in range(j - 1, -1, -1):
            if not networkx.has_path(order, i, j) and _needs(problem, primitives, states, writes, i, j):
                order.add_edge(i, j)
    reduced: PartialOrder = networkx.transitive_reduction(order)
    reduced.add_nodes_from(order.nodes(data=True))
    return reduced


def ready(
    order: PartialOrder,
    primitives: Sequence[Step],
    workers: Iterable[str],
    begun: Iterable[int],
    running: Sequence[int],
    urgency: Mapping[int, float],
    apart: Compatible,
) -> list[int]:
    """Return the primitives that can begin now and together, the most urgent first."""
    started, chosen = set(begun), list(running)
    busy = {worker_of(primitives[i], workers) for i in running}
    found = []
    open_ = [
        i for i in order if i not in started and all(p in started and p not in chosen for p in order.predecessors(i))
    ]
    for i in sorted(open_, key=lambda i: (-urgency[i], i)):
        worker = worker_of(primitives[i], workers)
        if worker not in busy and all(apart(primitives[i], primitives[other]) for other in chosen):
            found.append(i)
            chosen.append(i)
            busy.add(worker)
    return found


def urgency_of(order: PartialOrder) -> dict[int, float]:
    """Return for each primitive the number of primitives in the longest chain that begins with this primitive."""
    found: dict[int, float] = {}
    for i in reversed(list(networkx.topological_sort(order))):
        found[i] = 1.0 + max((found[j] for j in order.successors(i)), default=0.0)
    return found


def worker_of(step: Step, workers: Iterable[str]) -> str:
    """Return the worker of a step: the first argument that is a worker; an empty string if no argument is a worker."""
    known = workers if isinstance(workers, frozenset) else frozenset(workers)
    return next((argument for argument in step.arguments if argument in known), "")


def _needs(
    problem: Problem,
    primitives: Sequence[Step],
    states: Sequence[State],
    writes: Sequence[Mapping[Symbol, tuple[str | None, str]]],
    i: int,
    j: int,
) -> bool:
    """Return whether primitive `j` must wait for the earlier primitive `i`.

    A symbol that other primitives change between `i` and `j` gets its value from before `i` in a separate test, because `j` may
    need any one of these changes. A symbol that something else changes meanwhile doesn't count. If `j` came first, `i` would have
    to leave the changes of `j` as they are.
    """
    if writes[i].keys() & writes[j].keys():
        return True
    later = {symbol for k in range(i + 1, j) for symbol in writes[k]}
    tests = [{s: old for s, (old, new) in writes[i].items() if s not in later and states[j].get(s) == new}]
    tests += [{s: old} for s, (old, _) in writes[i].items() if s in later and old != states[j].get(s)]
    for test in tests:
        without = {s: v for s, v in {**states[j], **test}.items() if v is not None}
        if not _same(problem, primitives[j], without, writes[j]):
            return True
    before = {**states[i], **{s: new for s, (_, new) in writes[j].items()}}
    return not _same(problem, primitives[i], before, {**writes[i], **writes[j]})


def _same(problem: Problem, step: Step, state: State, writes: Mapping[Symbol, tuple[str | None, str]]) -> bool:
    """Return whether a primitive is applicable in a state and has the same effects as in the plan."""
    after = followed(problem, [step], state)
    return after is not None and all(after.get(s) == new for s, (_, new) in writes.items())
