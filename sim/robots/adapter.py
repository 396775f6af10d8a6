"""The world of an external robot; an interface describes calls and readings, and a transport performs them.

Rule 1: the world observes only facts that the robot's world model shows. Facts about individuals outside the scene are
ignored. Rule 2: an action that exceeds its time limit, or that is stopped, is cancelled. The result of a cancelled
action is ignored. Rule 3: a robot that doesn't confirm a cancellation is busy, and gets no further calls until the
action has ended. Rule 4: if an exception such as Ctrl-C ends the wait for an action, `stop` itself cancels the action.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from fractions import Fraction
from threading import Condition, Thread
from time import monotonic
from typing import Any, TypeVar

from confab.planner.acting.world import INTERRUPTED, WorldReport
from confab.planner.plan import Step
from confab.reasoner.amounts import written
from confab.reasoner.embodiment.interfaces import Interface, InterfaceCall, ReadField
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Fact, State, Symbol
from confab.sim.robots.transport import RobotError, Transport, WorldModel

GRACE = 5.0
"""Maximum time in seconds in which a robot must end a cancelled action."""

SENT = 2.0
"""Maximum time in seconds to send a cancellation after an exception."""

NOT_STOPPED = "not stopped"
"""The code of a primitive whose action was stopped but continues."""

LOOKS = 3
"""Number of requests for the world model before the robot counts as out of reach."""

T = TypeVar("T")


class InterfaceWorld:
    """A `World` (`confab.planner.acting.world`) made of an interface and a transport.

    Parameters
    ----------
    interface : Interface
    transport : Transport
    problem : Problem
        The problem with the perceived symbols and the known individuals.
    """

    def __init__(self, interface: Interface, transport: Transport, problem: Problem) -> None:
        self.interface, self.transport, self.problem = interface, transport, problem
        self.begun = monotonic()
        self.changed = Condition()
        self.running: object | None = None
        self.stopping = self.waiting = False
        names = {individual for members in problem.classes.values() for individual in members}
        self.robot_name = {name: interface.robot_names.get(name, name.rpartition(":")[2]) for name in sorted(names)}
        self.own_name = {theirs: ours for ours, theirs in self.robot_name.items()}

    @property
    def seconds(self) -> float:
        """Seconds since the world was connected."""
        return monotonic() - self.begun

    # --------------------------------------------------------------------------------------------------- perception

    def observe(self) -> State:
        """Return the facts that the world model shows.

        Raises
        ------
        RobotError
            The world model isn't available or is invalid.
        """
        model = self._model()
        return {symbol: value for reading in self.interface.readings for symbol, value in self._read(reading, model)}

    def _model(self) -> WorldModel:
        for attempt in range(LOOKS):
            try:
                model = self.transport.model()
                break
            except RobotError:
                if attempt == LOOKS - 1:
                    raise
        if not isinstance(model, Mapping) or not all(isinstance(fields, Mapping) for fields in model.values()):
            raise RobotError(f"the world model of {self.interface.name} is {model!r:.60}; wanted fields by entity")
        return model

    def _read(self, reading: ReadField, model: WorldModel) -> Iterator[tuple[Symbol, str]]:
        """Yield the symbols of a situation type with the values that the world model shows."""
        kind = self.problem.domain.situations.get(reading.situation)
        if kind is None:
            return
        for own in self.problem.classes.get(kind.arguments[0], ()):
            fields = model.get(self.robot_name[own])
            if fields is None or reading.field not in fields:
                continue
            shown = fields[reading.field]
            if kind.boolean and len(kind.arguments) == 2:
                listed = shown if isinstance(shown, list | tuple) else [shown]
                second = {*self.problem.classes.get(kind.arguments[1], ())}
                for other in filter(None, (self._own(one) for one in listed)):
                    if other in second:
                        yield Symbol(kind.name, (own, other)), TRUE
            elif kind.boolean:
                if isinstance(shown, bool):
                    yield Symbol(kind.name, (own,)), TRUE if shown else FALSE
            elif kind.quantity is not None:
                if (amount := _amount(shown, reading.step)) is not None:
                    yield Symbol(kind.name, (own,)), amount
            else:
                value = reading.absent if shown is None else self._own(shown)
                if value is not None and value in self.problem.classes.get(kind.range, ()):
                    yield Symbol(kind.name, (own,)), value

    def _own(self, theirs: Any) -> str | None:
        return self.own_name.get(theirs) if isinstance(theirs, str) else None

    # --------------------------------------------------------------------------------------------------- action

    def execute(self, step: Step) -> WorldReport:
        """Execute a primitive: call its action, and wait until the answer, the time limit, or `stop`."""
        call = self.interface.calls.get(step.behavior)
        if call is None:
            return WorldReport(False, "no action", (), f"{self.interface.name} has no action for {step.behavior}")
        if not self._idle():
            return WorldReport(False, "busy", step.arguments, "the robot still executes an action that was cancelled")
        arguments = {
            name: self.robot_name.get(step.arguments[given], step.arguments[given]) if isinstance(given, int) else given
            for name, given in call.arguments.items()
        }
        answers: list[tuple[str, str] | Exception] = []
        self._begin(lambda: self.transport.call(call.action, arguments), answers)
        ended = self._wait(lambda: bool(answers), call.seconds)
        if not ended:
            return self._cancelled(step, call)
        answer = answers[0]
        if isinstance(answer, Exception):
            return WorldReport(False, "no answer", step.arguments, str(answer))
        return self._meaning(step, call, *answer)

    def stop(self) -> None:
        """Stop the running action. `stop` itself cancels the action if no call of `execute` waits for the action."""
        with self.changed:
            self.stopping = self.running is not None
            abandoned = self.stopping and not self.waiting
            self.changed.notify_all()
        if abandoned:
            self._begin_cancelling().join(SENT)

    def _begin(self, work: Callable[[], T], results: list[T | Exception]) -> None:
        """Run a function in a separate thread, and record its result or its exception."""
        token = object()

        def run() -> None:
            try:
                result: T | Exception = work()
            except Exception as error:
                result = error
            with self.changed:
                results.append(result)
                if self.running is token:
                    self.running = None
                self.changed.notify_all()

        with self.changed:
            self.running, self.stopping = token, False
        Thread(target=run, daemon=True, name=f"action of {self.interface.name}").start()

    def _wait(self, over: Callable[[], bool], seconds: float) -> bool:
        """Wait until `over` returns true, `seconds` have passed, or the world is stopped; return the result of `over`."""
        with self.changed:
            self.waiting = True
            try:
                self.changed.wait_for(lambda: over() or self.stopping, seconds)
            finally:
                self.waiting = False
            return over()

    def _idle(self) -> bool:
        """Wait for the running action to end, at most `GRACE` seconds; return whether it has ended."""
        with self.changed:
            return self.changed.wait_for(lambda: self.running is None, GRACE)

    def _cancelled(self, step: Step, call: InterfaceCall) -> WorldReport:
        """Cancel the running action, and return a report with the reason."""
        stopped = self.stopping
        self._begin_cancelling()
        said = (
            ""
            if self._idle()
            else f"{call.action} didn't end within {GRACE:g} s of being cancelled; the robot may still move"
        )
        if stopped:
            return WorldReport(False, NOT_STOPPED if said else INTERRUPTED, step.arguments, said or "it was stopped")
        late = f"{call.action} took longer than {call.seconds:g} s"
        return WorldReport(False, "timed out", step.arguments, "; ".join(filter(None, (late, said))))

    def _begin_cancelling(self) -> Thread:
        """Start a thread that requests the robot to end its action and ignores errors; return the thread."""

        def run() -> None:
            with suppress(Exception):
                self.transport.cancel()

        cancelling = Thread(target=run, daemon=True, name=f"cancelling of {self.interface.name}")
        cancelling.start()
        return cancelling

    def _meaning(self, step: Step, call: InterfaceCall, status: str, message: str) -> WorldReport:
        meaning = self.interface.meanings.get(status)
        if meaning is None:
            known = ", ".join(self.interface.meanings)
            text = f"{call.action} was answered with the status '{status}', which {self.interface.name} doesn't have ({known})"
            return WorldReport(False, "unknown answer", step.arguments, text)
        if meaning.success:
            return WorldReport(True)
        facts: tuple[Fact, ...] = ()
        if meaning.refuted_while:
            facts = tuple(
                Fact(symbol, value)
                for symbol, value in self.observe().items()
                if symbol.situation in meaning.refuted_while and symbol.arguments[0] in step.arguments
            )
        return WorldReport(False, meaning.code, step.arguments, message or f"{call.action}: {status}", facts)


def _amount(shown: Any, step: str | None) -> str | None:
    """Return the text of a number as an amount, rounded down to a multiple of `step`, or None if the number isn't finite."""
    if isinstance(shown, bool) or not isinstance(shown, int | float) or not math.isfinite(shown):
        return None
    exact = Fraction(str(shown))
    if step is not None and (grain := Fraction(step)) > 0:
        exact = (exact / grain).__floor__() * grain
    return written(exact)
