"""Retries during an episode: their limits, and the attempts so far."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from confab.planner.plan import Limits


@dataclass(frozen=True)
class RetryPolicy:
    """Limits of an episode: attempts per primitive, total failures, begun primitives per planned primitive, and planning limits.

    `rounds` is the maximum number of times that failed steps are retried after all alternatives are exhausted, because the
    situation may have changed, or a hand may grasp differently. `rounds` also limits how often the agenda is checked in an
    unchanged situation. `planning` limits each planning call, but its seconds don't limit the first plan, which is made before
    anything moves. The whole episode ends by the current deadline (`confab.reasoner.limits.within`).
    """

    attempts: int = 2
    failures: int = 16
    rounds: int = 3
    primitives: int = 20
    planning: Limits = Limits(seconds=20.0)  # noqa: RUF009 - frozen


DEFAULT = RetryPolicy()


@dataclass
class Retries:
    """The attempts of an episode so far.

    `attempts` counts the failures of each primitive since all facts were last trusted. `rounds` counts the rounds of attempts,
    including the first. `pondered` counts the checks of the agenda in each situation. `room_wanted` states whether the world was
    asked for free spots. `most` is the maximum number of primitives of the episode.
    """

    policy: RetryPolicy
    attempts: Counter[tuple[str, tuple[str, ...]]] = field(default_factory=Counter)
    rounds: int = 1
    pondered: Counter[object] = field(default_factory=Counter)
    room_wanted: bool = False
    most: int = 0

    def another_round(self) -> bool:
        """Begin another round if another round is allowed; return whether the round was allowed."""
        if self.rounds >= self.policy.rounds:
            return False
        self.rounds += 1
        self.attempts.clear()
        return True
