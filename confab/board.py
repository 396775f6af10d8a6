"""A board to turn a scene by hand in a notebook: facts, goals and interventions on one side, the plan and its reasons on the other.

`Sheet` is what can be turned and what comes of it, as values; `board` puts it on the page with anywidget (`board.js`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from confab.accepting import check_goal, possible
from confab.known import Known
from confab.labels import Labels, labels_of
from confab.planner.plan import Limits
from confab.planner.solve import DEFAULT_MODE, Request, solve
from confab.planning import Result
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.names import nearest
from confab.reasoner.possible import refuse_impossible
from confab.reasoner.symbols import FALSE, TRUE, Problem, Symbol

if TYPE_CHECKING:
    from confab.execution import Execution

MOST_SYMBOLS = 80
"""So many situated objects have room on a board."""
SECONDS = 10.0
"""After which planning for the board gives up."""
MISSING = (
    "the board needs anywidget, which isn't installed; pip install 'confab-planner[notebook]', and restart the kernel"
)


@dataclass(frozen=True)
class Sheet:
    """What of a scene can be turned, and what comes of it.

    Examples
    --------
    >>> import confab
    >>> sheet = Sheet.of(confab.load("beverage-serving"))
    >>> sheet.answer({"facts": {"cup1 LOCATION": "location7"}})["headline"].split(",")[0]
    'solved: 3 / 8 / 26 steps per level'
    """

    scene: Known
    problem: Problem
    labels: Labels

    @classmethod
    def of(cls, scene: Known) -> Sheet:
        """Return the sheet of a scene.

        Raises
        ------
        KnowledgeError
            The scene has more in it than has room.
        """
        problem = scene.problem
        if len(problem.initial) > MOST_SYMBOLS:
            raise KnowledgeError(
                f"{scene.iri} has {len(problem.initial)} situated objects; a board has room for {MOST_SYMBOLS} "
                "(with_fact and with_goal change larger scenes)"
            )
        return cls(scene, problem, labels_of(scene.knowledge, scene.names, problem))

    @property
    def symbols(self) -> dict[str, Symbol]:
        """What has a value, by its words without the value: ``cup1 LOCATION``."""
        goal = self.problem.goal  # what is wanted stands above the rest
        those = sorted({*self.problem.initial, *goal}, key=lambda s: (s not in goal, s.arguments, s.situation))
        return {
            " ".join((s.arguments[0] if s.arguments else "", s.situation, *s.arguments[1:])).strip(): s for s in those
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return what can be turned, as the page takes it: of each symbol its words, its values, what is so and what is wanted."""
        return [
            {
                "key": key,
                "label": self.labels.about(symbol),
                "values": [[value, self.labels.name(value)] for value in self._values(symbol)],
                "is": self.problem.initial.get(symbol, FALSE),
                "wanted": self.problem.goal.get(symbol),
            }
            for key, symbol in self.symbols.items()
        ]

    def _values(self, symbol: Symbol) -> list[str]:
        situation = self.problem.domain.situations[symbol.situation]
        values = [TRUE, FALSE] if situation.boolean else list(self.problem.classes.get(situation.range, ()))
        there = (self.problem.initial.get(symbol), self.problem.goal.get(symbol), situation.rest)
        return [*values, *dict.fromkeys(v for v in there if v is not None and v not in values)]

    def turned(self, by: Mapping[str, Any]) -> Problem:
        """Return the problem with other facts and goals, each by its symbol; a goal that is None isn't wanted.

        Raises
        ------
        KnowledgeError
            There is no such symbol, a goal wants what is no value of it, or the facts can't hold together.
        """
        symbols = self.symbols
        for key in (*by.get("facts", {}), *by.get("goals", {})):
            if key not in symbols:
                raise KnowledgeError(f"there is no {key}{nearest(key, symbols)}")
        initial, goal = dict(self.problem.initial), dict(self.problem.goal)
        for key, value in by.get("facts", {}).items():
            initial[symbols[key]] = value
        for key, value in by.get("goals", {}).items():
            goal.pop(symbols[key], None)
            if value is not None:
                goal[symbols[key]] = value
        with possible():
            refuse_impossible(self.problem, self.problem.initial, initial)
        turned = replace(self.problem, initial=initial, goal=goal)
        if goal:
            check_goal(self.scene.iri, turned)
        return turned

    def plan(self, by: Mapping[str, Any]) -> Result:
        """Return what planning gives in what somebody has turned."""
        problem = self.turned(by)
        return Result(self.scene, problem, solve(Request(problem, DEFAULT_MODE, Limits(seconds=SECONDS))), {})

    def act(self, by: Mapping[str, Any], result: Result) -> Execution | None:
        """Return how it goes while people interfere, or None if nobody does."""
        from confab.execution import execute

        if not by.get("interventions") or not result.solved:
            return None
        texts = [self.intervention(each) for each in by["interventions"]]
        return execute(self.scene, result.problem, result.plan, texts)

    @staticmethod
    def intervention(turned: Mapping[str, Any]) -> str:
        """Return an intervention as people write it: after which step, of which symbol, which value, and what it is about.

        Examples
        --------
        >>> Sheet.intervention({"after": 28, "key": "cup2 LOCATION", "value": "location8", "what": "goal"})
        'after=28 goal cup2 LOCATION location8'
        """
        goal = "goal " if turned["what"] == "goal" else ""
        return f"after={turned['after']} {goal}{turned['key']} {turned['value']}"

    def answer(self, by: Mapping[str, Any], before: tuple[str, ...] | None = None) -> dict[str, Any]:
        """Return what the page shows: how it ended in a line, the plan with its reasons, its steps, and what changed in them.

        `before` are the steps of the answer before.
        """
        try:
            result = self.plan(by)
            execution = self.act(by, result)
        except KnowledgeError as error:
            return {"headline": str(error), "html": "", "steps": [], "said": list(before or ()), "new": [], "gone": []}
        shown = result if execution is None else execution
        plan = result.outcome.plan
        steps = [(step.id, self.labels.step(step)) for step in (plan.steps if plan else ())]
        done = execution.plan.steps if execution is not None else plan.steps if plan else ()
        said = tuple(self.labels.step(step) for step in done)
        new, gone = (
            (Counter(said) - Counter(before), Counter(before) - Counter(said)) if before is not None else ({}, {})
        )
        headline = repr(shown).splitlines()[0]
        return {
            "headline": headline,
            "html": shown._repr_html_(),
            "steps": steps,
            "said": list(said),
            "new": list(new),
            "gone": list(gone),
        }


def board(scene: Known) -> Any:
    """Return the board of a scene, which a notebook shows; its `result` is what was planned last.

    Raises
    ------
    KnowledgeError
        anywidget isn't installed, or the scene is too large.
    """
    try:
        import anywidget
        import traitlets
    except ImportError as error:
        raise KnowledgeError(MISSING) from error

    class Board(anywidget.AnyWidget):
        """What the page shows and what was turned on it; `turned` is written by the page, all else by Python."""

        _esm = Path(__file__).with_name("board.js")
        _css = Path(__file__).with_name("board.css")
        rows: Any = traitlets.List().tag(sync=True)
        answer: Any = traitlets.Dict().tag(sync=True)
        turned: Any = traitlets.Dict().tag(sync=True)

        def __init__(self, sheet: Sheet) -> None:
            super().__init__(rows=sheet.rows(), answer=sheet.answer({}))
            self.sheet = sheet
            self.observe(self._turn, "turned")

        def _turn(self, change: Mapping[str, Any]) -> None:
            self.answer = self.sheet.answer(change["new"], tuple(self.answer["said"]))

        @property
        def result(self) -> Result:
            """What planning gives as the board stands."""
            return self.sheet.plan(self.turned)

    return Board(Sheet.of(scene))
