"""The page as a widget (anywidget) in a notebook. The Python process plans, and answers the queries of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from confab.known import Known
from confab.page.markup import asset, script
from confab.page.schema import PageData
from confab.page.sheet import Sheet, turned_from
from confab.planning import Result
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import LimitError

if TYPE_CHECKING:
    import anywidget

MISSING = "the board needs anywidget, which isn't installed; pip install anywidget, and restart the kernel"


def board(scene: Known) -> anywidget.AnyWidget:
    """Return the page of a scene as a widget for a notebook. The property `result` of the widget is the current result of planning.

    Raises
    ------
    KnowledgeError
        anywidget isn't installed.
    """
    try:
        import anywidget
        import traitlets
    except ImportError as error:
        raise KnowledgeError(MISSING) from error

    class Board(anywidget.AnyWidget):
        """The widget, whose properties (content, changes, queries, results) are synchronised with the page."""

        _esm = script()
        _css = asset("page.css")
        data: Any = traitlets.Dict().tag(sync=True)
        turned: Any = traitlets.Dict().tag(sync=True)
        asked: Any = traitlets.Dict().tag(sync=True)
        rows: Any = traitlets.Dict().tag(sync=True)

        def __init__(self, sheet: Sheet) -> None:
            self.sheet = sheet
            super().__init__(data={**sheet.scene_data, **sheet.answer({})})
            self.observe(self._turn, "turned")
            self.observe(self._ask, "asked")

        def _turn(self, change: dict[str, Any]) -> None:
            answer: PageData = self._answer(change["new"])
            self.data = {**self.data, "problem": "", **answer}

        def _answer(self, turned: object) -> PageData:
            try:
                return self.sheet.answer(turned_from(turned))
            except KnowledgeError as error:
                return {"problem": str(error)}

        def _ask(self, change: dict[str, Any]) -> None:
            asked = change["new"]
            try:
                table = self.sheet.scene.query(str(asked.get("query", "")))
                rows = [[cell or "" for cell in row] for row in table]
                self.rows = {"of": asked.get("of"), "columns": list(table.columns), "rows": rows}
            except (KnowledgeError, LimitError) as error:
                self.rows = {"of": asked.get("of"), "problem": str(error)}

        @property
        def result(self) -> Result:
            """The result of planning with the present facts and goals of the page."""
            return self.sheet.plan(turned_from(self.turned))

    return Board(Sheet(scene))
