"""The world in which the executive acts: a simulation, a set of symbols, or a robot (docs/connecting.md).

A world has three functions and a clock. The executive calls `observe` and `execute` from one thread, never at the same time.
Another thread may call `stop` while `execute` runs, and the executive calls `stop` after an exception in `execute`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Timer
from typing import TYPE_CHECKING, Protocol, cast, runtime_checkable

from confab.planner.acting.discovery import Discovery
from confab.planner.plan import Step
from confab.reasoner.limits import current
from confab.reasoner.possible import ImpossibleStateError
from confab.reasoner.symbols import Fact, State, Symbol

if TYPE_CHECKING:
    from confab.planner.acting.episode import Intervention
    from confab.planner.acting.schedule import WorkerSlot
    from confab.planner.timed.dispatch import Dispatch

logger = logging.getLogger(__name__)

INTERRUPTED = "interrupted"
"""Code in the verdict on a stopped primitive; a stop isn't a failure, so the executive learns nothing from it."""

WITHOUT_EFFECT = "without effect"
"""Code in the verdict on a primitive that was reported as done, although none of its effects is observed."""


class WorldError(Exception):
    """The world itself failed: a call raised an exception, or returned something other than an observation or a verdict."""


class Verdict(Protocol):
    """The world's report on a primitive; the next observation decides whether the primitive's effects hold."""

    @property
    def ok(self) -> bool:
        """Whether the primitive ended successfully."""

    @property
    def code(self) -> str | None:
        """The kind of failure, or None if the primitive succeeded; the kind of a stopped primitive is `INTERRUPTED`."""

    @property
    def objects(self) -> tuple[str, ...]:
        """The objects that were involved in the failure."""

    @property
    def message(self) -> str:
        """The description of the failure as a sentence."""


@dataclass(frozen=True)
class WorldReport:
    """A verdict as an immutable value. `facts` are the facts under which motion planning refuted the primitive."""

    ok: bool
    code: str | None = None
    objects: tuple[str, ...] = ()
    message: str = ""
    facts: tuple[Fact, ...] = ()


class World(Protocol):
    """The world in which the executive acts."""

    def observe(self) -> State:
        """Return the facts that are perceived now; symbols that aren't perceptible are left out."""

    def execute(self, step: Step) -> Verdict:
        """Execute a primitive and return when it has ended, failed, or was stopped."""

    def stop(self) -> None:
        """Stop the running primitive, so that `execute` returns `INTERRUPTED`; return at once, and never raise an exception."""

    @property
    def seconds(self) -> float:
        """The time on the world's clock; the clock never runs backwards."""


class Disturbable(World, Protocol):
    """A simulated world in which interventions can take place."""

    def disturb(self, intervention: Intervention) -> None:
        """Make an intervention take place now."""

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Record interventions with their times on the world's clock."""


class Concurrent(World, Protocol):
    """A world in which several actors execute primitives at once."""

    def execute_together(
        self, dispatch: Dispatch, may_begin: Callable[[Set[int]], bool]
    ) -> Sequence[tuple[WorkerSlot, Verdict]]:
        """Execute the primitives of a dispatch, and return the primitives that ended, in the order of their begins.

        No primitive begins after a failure, nor while `may_begin` returns false for the numbers of the finished primitives. The
        clock of the dispatch begins with 0; the slots have times on the world's clock.
        """


@runtime_checkable
class Discoverer(Protocol):
    """A world that discovers individuals that the scene doesn't contain."""

    def discoveries(self) -> Sequence[Discovery]:
        """Return the discoveries since the last call; observations may then name the discovered individuals."""

    def free_spots(self) -> Sequence[Discovery]:
        """Return free spots for putting objects down; the executive asks once, when the places of the scene don't suffice."""

    def why_unplaced(self, individual: str) -> str:
        """Return why an object has no perceived place, for example ``lies 4 cm from shelf``; empty if unknown."""


@dataclass(frozen=True)
class Guarded:
    """A wrapper of a world: each exception or malformed result becomes a `WorldError` that names the call.

    A primitive that is still running at the current deadline (`confab.reasoner.limits`) is stopped.
    """

    world: World

    def observe(self) -> State:
        """Return the facts that are perceived now."""
        with _asking("observe()"):
            seen = self.world.observe()
        if not isinstance(seen, Mapping):
            raise WorldError(f"the world's observe() returned {seen!r:.60}; wanted a mapping of Symbol to value")
        for symbol, value in seen.items():
            if not isinstance(symbol, Symbol) or not isinstance(value, str):
                raise WorldError(
                    f"the world's observe() returned {symbol!r:.60}: {value!r:.60}; wanted a mapping of Symbol to value, a text"
                )
        return seen

    def execute(self, step: Step) -> Verdict:
        """Execute a primitive; at the deadline, stop the primitive."""
        left = current().left
        timer = None if left is None else Timer(left, self.stop)
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            with _asking(f"execute({step})"):
                said = self.world.execute(step)
        finally:
            if timer is not None:
                timer.cancel()
        lacking = [name for name in ("ok", "code", "objects", "message") if not hasattr(said, name)]
        if lacking:
            raise WorldError(
                f"the world's execute({step}) returned {said!r:.60} without {', '.join(lacking)}; wanted a verdict"
            )
        return said

    def execute_together(
        self, dispatch: Dispatch, may_begin: Callable[[Set[int]], bool]
    ) -> Sequence[tuple[WorkerSlot, Verdict]]:
        """Execute primitives with several actors at once, as `Concurrent.execute_together`."""
        with _asking("execute_together()"):
            return cast("Concurrent", self.world).execute_together(dispatch, may_begin)

    def stop(self) -> None:
        """Stop the running primitive; ignore an error raised by the world's `stop`."""
        with suppress(WorldError), _asking("stop()"):
            self.world.stop()

    def disturb(self, intervention: Intervention) -> None:
        """Make an intervention take place now."""
        with _asking(f"disturb({intervention.text or intervention.change.value})"):
            self._disturbable().disturb(intervention)

    def announce(self, interventions: tuple[Intervention, ...]) -> None:
        """Record interventions with their times on the world's clock."""
        if interventions:
            with _asking("announce()"):
                self._disturbable().announce(interventions)

    def discoveries(self) -> tuple[Discovery, ...]:
        """Return the discoveries since the last call; the list is empty if the world isn't a `Discoverer`."""
        if not isinstance(self.world, Discoverer):
            return ()
        with _asking("discoveries()"):
            return tuple(self.world.discoveries())

    def free_spots(self) -> tuple[Discovery, ...]:
        """Return free spots for putting an object down."""
        if not isinstance(self.world, Discoverer):
            return ()
        with _asking("free_spots()"):
            return tuple(self.world.free_spots())

    def why_unplaced(self, individual: str) -> str:
        """Return the reason why an object has no perceived place, or an empty text if the world doesn't know the reason."""
        if not isinstance(self.world, Discoverer):
            return ""
        with _asking(f"why_unplaced({individual})"):
            return str(self.world.why_unplaced(individual))

    def _disturbable(self) -> Disturbable:
        world = self.world
        if not (hasattr(world, "disturb") and hasattr(world, "announce")):
            raise WorldError(
                f"{type(world).__name__} has no disturb and announce: interventions can take place in simulated worlds only"
            )
        return world  # type: ignore[return-value]  # checked above

    @property
    def seconds(self) -> float:
        """The world's clock."""
        with _asking("seconds"):
            return float(self.world.seconds)

    @property
    def measured(self) -> bool:
        """Whether the world's clock is measured; true unless the world has an attribute `measured` that is false."""
        return bool(getattr(self.world, "measured", True))


@contextmanager
def _asking(call: str) -> Iterator[None]:
    """Turn an exception of the world into a `WorldError`, and log the traceback at level DEBUG."""
    try:
        yield
    except (ImpossibleStateError, WorldError):  # an impossible state is an error of the caller, not of the world
        raise
    except Exception as error:
        logger.debug("the world failed", exc_info=True)
        raise WorldError(f"the world's {call} raised {type(error).__name__}: {error}") from error
