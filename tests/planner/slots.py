"""A schedule of primitives that begins each primitive as early as `confab.planner.acting.schedule.ready` allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from confab.planner.acting.schedule import WorkerSlot, partial_order, ready, urgency_of, worker_of
from confab.planner.plan import Step
from confab.planner.timed.pieces import workers_of
from confab.reasoner.problem import Problem


def schedule(
    problem: Problem,
    primitives: Sequence[Step],
    seconds_of: Mapping[int, float] | None = None,
    apart: Callable[[Step, Step], bool] = lambda one, other: True,
) -> list[WorkerSlot]:
    """Return the slots in the order of their begins; a primitive takes one second by default."""
    seconds = seconds_of or dict.fromkeys(range(len(primitives)), 1.0)
    order, workers = partial_order(problem, primitives), workers_of(problem)
    urgency = urgency_of(order)
    slots, running, now = dict[int, WorkerSlot](), list[WorkerSlot](), 0.0
    while len(slots) < len(primitives):
        for i in ready(order, primitives, workers, slots.keys(), [s.position for s in running], urgency, apart):
            slots[i] = WorkerSlot(primitives[i], i, worker_of(primitives[i], workers), now, now + seconds[i])
            running.append(slots[i])
        now = min(slot.end for slot in running)
        running = [slot for slot in running if slot.end > now]
    return sorted(slots.values(), key=lambda slot: (slot.begin, slot.position))
