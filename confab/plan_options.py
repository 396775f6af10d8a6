"""The options of a planning call, with their validation; Python, the command line and agents share these options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from confab.accepting import check_seconds
from confab.planner.solve import DEFAULT_MODE, MODES, Mode
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import Deadline
from confab.timing import MINIMISE, Minimise

if TYPE_CHECKING:
    from confab.memory import Memory
    from confab.reasoner.memory.links import Links

NO_ENGINE = "none"
"""The value of the option `engine` that excludes external planners."""
OPTIMAL_SECONDS = 10.0
"""Default time limit of the search for an optimal plan in seconds."""


class PlanKeywords(TypedDict, total=False):
    """The fields of `PlanOptions` as keywords."""

    memory: Memory | Links | str | Path | None
    mode: Mode
    time_limit: float | Deadline | None
    optimal: bool
    observed: str | Path | None
    engine: str | None
    level: int | None
    leave_levels: bool
    minimise: Minimise | None


@dataclass(frozen=True)
class PlanOptions:
    """Options of a planning call; `confab.planning.plan` describes these options.

    Raises
    ------
    KnowledgeError
        The mode is unknown, the time limit isn't a number, or options exclude each other.
    """

    memory: Memory | Links | str | Path | None = None
    mode: Mode = DEFAULT_MODE
    time_limit: float | Deadline | None = None
    optimal: bool = False
    observed: str | Path | None = None
    engine: str | None = None
    level: int | None = None
    leave_levels: bool = True
    minimise: Minimise | None = None

    def __post_init__(self) -> None:
        """Raise `KnowledgeError` if an option is invalid or options exclude each other."""
        if self.minimise not in (None, *MINIMISE):
            raise KnowledgeError(f"minimise='{self.minimise}'; wanted one of {', '.join(MINIMISE)}")
        if self.level is not None and not self.by_engine:
            raise KnowledgeError(
                "a level is chosen for an engine; name one, e.g. engine='fast-downward' "
                "(plan.at_level(LEVEL) has the steps of a level)"
            )
        if self.by_engine and self.strategy in ("paper", "optimal"):
            raise KnowledgeError(
                "an engine plans by itself; leave out optimal=True and the modes 'optimal' and 'paper'"
            )
        if self.by_engine and not self.leave_levels:
            raise KnowledgeError(
                "an engine plans one level alone, so it may leave the others; leave out leave_levels=False"
            )
        if self.asks_for_least and self.mode not in (DEFAULT_MODE, "optimal"):
            raise KnowledgeError(f"optimal=True means mode='optimal', and not mode='{self.mode}'; leave one out")
        if self.strategy == "optimal" and self.memory is not None:
            raise KnowledgeError("the optimal search uses no memory; leave one option out")
        if self.strategy == "optimal" and not self.leave_levels:
            what = "compares plans of the lowest level, so it may leave the others"
            raise KnowledgeError(f"the optimal search {what}; leave one option out")
        check_seconds("time_limit", self.time_limit)
        if self.mode not in MODES:
            raise KnowledgeError(f"unknown mode '{self.mode}'; wanted one of {', '.join(MODES)}")

    @property
    def by_engine(self) -> bool:
        """Whether the caller has named an engine."""
        return self.engine not in (None, NO_ENGINE)

    @property
    def asks_for_least(self) -> bool:
        """Whether an option besides `mode` requires the optimal search."""
        return self.optimal or self.minimise in ("cost", "steps")

    @property
    def strategy(self) -> str:
        """The mode of planning according to all options."""
        return "optimal" if self.asks_for_least else self.mode

    @property
    def limit(self) -> float | Deadline | None:
        """The time limit of the call. Only the optimal search has a default limit, which is `OPTIMAL_SECONDS`."""
        return OPTIMAL_SECONDS if self.time_limit is None and self.strategy == "optimal" else self.time_limit
