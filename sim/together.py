"""Concurrent execution of skills by several hands in one world.

A skill requests simulation steps from the world. Every skill runs in its own thread and waits for each step. When all
running skills wait, the world makes one step for all skills. Only one thread runs at any time, and the threads run in a
fixed order, so that equal calls give equal results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from threading import Semaphore, Thread

import numpy as np
import pybullet

from confab.planner.acting.schedule import WorkerSlot, partial_order, ready, urgency_of, worker_of
from confab.planner.acting.world import INTERRUPTED
from confab.planner.plan import Step
from confab.planner.timed.pieces import workers_of
from confab.reasoner.problem import Problem
from confab.sim.engine import Engine
from confab.sim.verdict import SkillError, Verdict
from confab.sim.world import PhysicsWorld

ROOM = 0.25
"""Minimum distance in metres between the places at which two hands work at the same time."""

FLOWING = {"tilt", "stand_upright"}
"""Skills that count spilled beads.

Two skills that count spilled beads never run at once, since each of them would also count the beads of the other.
"""

LOOKING = 6
"""Number of simulation steps between checks for contact between the arms."""


@dataclass(frozen=True)
class Performance:
    """The result of concurrent execution: time slots and verdicts of the primitives, and seconds in which the arms touched."""

    slots: tuple[WorkerSlot, ...]
    verdicts: tuple[Verdict, ...]
    touching: float

    @property
    def ok(self) -> bool:
        """Whether all primitives succeeded and the arms never touched each other."""
        return all(verdict.ok for verdict in self.verdicts) and self.touching == 0


class _RunningPrimitive:
    """A primitive that runs in a separate thread."""

    def __init__(self, world: PhysicsWorld, step: Step, position: int, worker: str) -> None:
        self.step, self.position, self.worker, self.begin = step, position, worker, world.seconds
        self.moved_by_others: set[str] = set()
        self.interrupted = False
        self.verdict: Verdict | None = None
        self.error: BaseException | None = None
        self.go, self.paused = Semaphore(0), Semaphore(0)
        self.thread = Thread(target=self._work, args=(world,), daemon=True)
        self.thread.start()

    def _work(self, world: PhysicsWorld) -> None:
        self.go.acquire()
        try:
            self.verdict = world.execute(self.step)
        except BaseException as error:
            self.error = error
        self.paused.release()

    def advance(self) -> None:
        """Let the thread run until it requests a simulation step or ends."""
        self.go.release()
        self.paused.acquire()
        if self.error is not None:
            raise self.error

    def wait(self) -> None:
        """Wait for a simulation step of the world; the job's thread calls this method."""
        self.paused.release()
        self.go.acquire()
        if self.interrupted:
            self.interrupted = False
            raise SkillError(INTERRUPTED, self.step.arguments, "an intervention changed an object of it")


def perform_together(
    world: PhysicsWorld,
    problem: Problem,
    primitives: Sequence[Step],
    room: float = ROOM,
    may_begin: Callable[[Set[tuple[int, ...]]], bool] = lambda done: True,
    changed: Callable[[], Set[str]] = frozenset,
) -> Performance:
    """Execute primitives with all hands at once; each starts when its predecessors are done and no other hand works too near.

    Primitives during which the arms touch each other fail, and no further primitive begins.

    Parameters
    ----------
    world : PhysicsWorld
    problem : Problem
        The problem, whose initial state is the state of the world.
    primitives : sequence of Step
    room : float
        Minimum distance in metres between the places at which two hands work at the same time.
    may_begin : callable
        Function of the paths of the finished primitives that returns whether further primitives may begin.
    changed : callable
        Function that returns the individuals that an intervention has changed since the last call. Running primitives of these
        individuals are interrupted.
    """
    order, workers = partial_order(problem, primitives), workers_of(problem)
    urgency = urgency_of(order)
    where = [_workplace(world, step) for step in primitives]
    index = {id(step): i for i, step in enumerate(primitives)}

    def flowing(step: Step) -> bool:
        return world.embodiment.skills[step.behavior].skill in FLOWING

    def apart(one: Step, other: Step) -> bool:
        if flowing(one) and flowing(other):
            return False
        here, there = where[index[id(one)]](), where[index[id(other)]]()
        return here is None or there is None or float(np.linalg.norm(here - there)) >= room

    step_once, jobs, current = world.run, list[_RunningPrimitive](), list[_RunningPrimitive]()

    def wait_for(steps: int) -> None:
        for _ in range(steps):
            current[-1].wait()

    done: dict[int, tuple[WorkerSlot, Verdict]] = {}
    touching, touched = 0, set[int]()
    world.run = wait_for  # type: ignore[method-assign]
    try:
        while len(done) < len(primitives):
            if not touched and all(verdict.ok for _, verdict in done.values()):
                running = [job.position for job in jobs]
                new = ready(order, primitives, workers, [*done, *running], running, urgency, apart)
                if new and may_begin({slot.step.path for slot, _ in done.values()}):
                    jobs += [_RunningPrimitive(world, primitives[i], i, worker_of(primitives[i], workers)) for i in new]
            if not jobs:
                break
            for job in list(jobs):
                for other in jobs:
                    if other is not job:
                        job.moved_by_others |= _moved_bodies(world, other.step)
                world.moved_by_others = job.moved_by_others
                current.append(job)
                job.advance()
                current.pop()
                if job.verdict is not None:
                    slot = WorkerSlot(job.step, job.position, job.worker, job.begin, world.seconds)
                    touch = job.position in touched and job.verdict.ok
                    done[job.position] = slot, _touching(job) if touch else job.verdict
                    jobs.remove(job)
            step_once(1)
            moved = changed()
            for job in jobs:
                job.moved_by_others |= moved
                job.interrupted = job.interrupted or not moved.isdisjoint(_concerned(world, job.step))
            if world.steps % LOOKING == 0 and arms_touch(world):
                touching += LOOKING
                touched |= {job.position for job in jobs}
    finally:
        world.run, world.moved_by_others = step_once, set()  # type: ignore[method-assign]
    ordered = sorted(done.values(), key=lambda pair: (pair[0].begin, pair[0].position))
    return Performance(
        tuple(slot for slot, _ in ordered), tuple(verdict for _, verdict in ordered), touching / world.rate
    )


def _touching(job: _RunningPrimitive) -> Verdict:
    """Return the verdict on a primitive that has succeeded although the arms have touched each other."""
    return Verdict(False, "arms touch", job.step.arguments, message=f"the arms touch each other during {job.step}")


def arms_touch(world: Engine) -> bool:
    """Return whether two hands of the world, including their arms, touch each other."""
    owner: dict[tuple[int, int], str] = {}
    for name, hand in world.hands.items():
        owner |= {(hand.body, link): name for link in (*hand.joints, *hand.fingers, hand.tip)}
    for body in {hand.body for hand in world.hands.values()}:
        for contact in pybullet.getContactPoints(body, physicsClientId=world.client):
            one, other = owner.get((contact[1], contact[3])), owner.get((contact[2], contact[4]))
            if one is not None and other is not None and one != other:
                return True
    return False


def _concerned(world: PhysicsWorld, step: Step) -> set[str]:
    """Return the individuals of a primitive: its arguments, and the bodies that its hands hold."""
    named = {*step.arguments, *step.bindings.values()}
    return named | {held for hand in named & world.hands.keys() if (held := world.held(hand)) is not None}


def _moved_bodies(world: PhysicsWorld, step: Step) -> set[str]:
    """Return the bodies that a primitive may move: the bodies among its arguments, and the bodies that its hands hold."""
    return _concerned(world, step) & world.bodies.keys()


def _workplace(
    world: PhysicsWorld, step: Step
) -> Callable[[], np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None]:
    """Return a function that returns where a primitive works: the horizontal position (2,) of its last body, place or hand."""
    named = (*step.arguments, *step.bindings.values())
    hand = next((name for name in named if name in world.hands), None)

    def now() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
        places = [world.place(n)[:2] for n in named if n in world.embodiment.places]
        held = world.held(hand) if hand is not None else None
        bodies = [world.truth(n)[1][:2] for n in named if n in world.bodies and n != held]
        if bodies or places:
            return (bodies or places)[-1]
        return world.hands[hand].frame()[1][:2] if hand is not None else None

    return now
