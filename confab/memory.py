"""The memory at the front desk: load it, learn into it, save it, look at it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from confab.table import Table
from planner.learning import LearningError
from planner.learning import learn as learn_plan
from planner.plan import Plan
from reasoner.graph import KnowledgeError
from reasoner.links import Links
from reasoner.memory import load_links, memory_names, save_links
from reasoner.names import Names

if TYPE_CHECKING:
    from confab.scene import Scene


@dataclass
class Memory:
    """The paper's confabulation memory: links p(situated object instance | quantified behaviour).

    Attributes
    ----------
    links : Links
    names : Names
        Leads from the links' short names to IRIs.
    scene : str
        IRI of the scene that the memory file imports.
    """

    links: Links
    names: Names
    scene: str

    @classmethod
    def of(cls, scene: Scene) -> Memory:
        """Return an empty memory for a scene."""
        return cls(Links(), scene.names, scene.iri)

    @classmethod
    def load(cls, path: str | Path, scene: Scene | None = None) -> Memory:
        """Read a memory file; with a scene, its terms go by the scene's short names.

        Raises
        ------
        KnowledgeError
            The file is missing or no memory.
        """
        iri, names = (scene.iri, scene.names) if scene is not None else memory_names(Path(path))
        return cls(load_links(Path(path), names), names, iri)

    def learn(self, scene: Scene, plan: Plan) -> None:
        """Reinforce every behaviour of a plan that was carried out from the scene's initial situation (eq. 2).

        Raises
        ------
        KnowledgeError
            The plan can't be done in that situation; nothing is learned then.
        """
        try:
            self.links = learn_plan(scene.problem, plan, self.links)
        except LearningError as error:
            raise KnowledgeError(str(error)) from error

    def save(self, path: str | Path) -> Path:
        """Write the memory as Turtle, whole or not at all, and return where."""
        save_links(Path(path), self.links, self.names, self.scene)
        return Path(path)

    def table(self, most: int | None = None) -> Table:
        """Return the links, the most probable first."""
        rows = [
            (f"{behavior} {' '.join(arguments)}", str(symbol), value, f"{p:.3f}")
            for (behavior, arguments), symbols in self.links.tables.items()
            for symbol, values in symbols.items()
            for value, p in values.items()
        ]
        rows.sort(key=lambda row: (-float(row[3]), row))
        return Table(("behaviour", "symbol", "value", "p(value | behaviour)"), tuple(rows[:most]))

    def __repr__(self) -> str:
        """Return how much was learned."""
        return f"Memory({len(self.links)} links of {len(self.links.tables)} behaviours in {self.scene})"

    def _repr_html_(self) -> str:
        return f"<p>{self!r}</p>" + self.table(20)._repr_html_()
