"""Adapter from an asynchronous world to a synchronous one: the coroutines run on an event loop in a separate thread."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from threading import Thread
from typing import Any, Protocol, TypeVar

from confab.planner.acting.world import Verdict
from confab.planner.plan import Step
from confab.reasoner.symbols import State

T = TypeVar("T")


class AsyncWorld(Protocol):
    """A `World` (`confab.planner.acting.world`) whose functions are coroutines."""

    async def observe(self) -> State:
        """Return the facts that are perceived now."""

    async def execute(self, step: Step) -> Verdict:
        """Execute a primitive and return when it has ended, failed, or was stopped."""

    async def stop(self) -> None:
        """Stop the running primitive."""

    @property
    def seconds(self) -> float:
        """The world's clock."""


class Synchronous:
    """A `World` that awaits the coroutines of an `AsyncWorld`.

    The event loop runs all the time, so tasks of the world (a subscription, a heartbeat) continue between the calls.
    Use a `Synchronous` world as a context manager, or call `close` in the end: both ways stop the running primitive and
    end the event loop.
    """

    def __init__(self, world: AsyncWorld) -> None:
        self.world = world
        self.loop = asyncio.new_event_loop()
        self.thread = Thread(target=self.loop.run_forever, daemon=True, name=f"{type(world).__name__} of confab")
        self.thread.start()

    def observe(self) -> State:
        """Return the facts that are perceived now."""
        return self._await(self.world.observe())

    def execute(self, step: Step) -> Verdict:
        """Execute a primitive."""
        return self._await(self.world.execute(step))

    def stop(self) -> None:
        """Begin to stop the running primitive, and return at once."""
        asyncio.run_coroutine_threadsafe(self.world.stop(), self.loop)

    @property
    def seconds(self) -> float:
        """The world's clock."""
        return self.world.seconds

    def close(self) -> None:
        """Stop the running primitive, cancel all tasks of the world, and end the event loop."""
        self._await(self._end())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join()
        self.loop.close()

    def __enter__(self) -> Synchronous:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _await(self, coroutine: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result()

    async def _end(self) -> None:
        await self.world.stop()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
