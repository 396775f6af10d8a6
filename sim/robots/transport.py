"""The connection to an external robot: its actions, and its world model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeAlias

WorldModel: TypeAlias = "Mapping[str, Mapping[str, Any]]"
"""A robot's world model: the fields of each entity, with a text, number, truth value, list of texts, or None."""


class RobotError(Exception):
    """A robot can't be reached, or its response is invalid; the message states the reason."""


class Transport(Protocol):
    """The connection to a robot. The functions `call` and `cancel` may run in different threads; all others run in one thread."""

    def call(self, action: str, arguments: Mapping[str, str]) -> tuple[str, str]:
        """Execute an action, and return its status and a message after its end; raise `RobotError` if there is no answer."""

    def cancel(self) -> None:
        """End the running action, so that `call` returns; raise `RobotError` if that is impossible."""

    def model(self) -> WorldModel:
        """Return the present world model; raise `RobotError` if the world model is unavailable."""
