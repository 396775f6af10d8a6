"""A scene at the front desk: what is known of it, and what is done in it; each verb is a few lines that lead to its module."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from confab import ontology, planning
from confab.accepting import AnyPlan, Facts, number, plan_of
from confab.known import Known
from confab.planner.plan import Plan
from confab.planner.solve import DEFAULT_MODE
from confab.planning import Result
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.graph.knowledge import load as load_graph
from confab.reasoner.limits import Deadline, within
from confab.reasoner.memory.links import Links
from confab.reasoner.symbols import FALSE, Fact

if TYPE_CHECKING:
    from confab.execution import Execution
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planner.acting.episode import World
    from confab.planner.acting.executive import Moment
    from confab.reasoner.graph.apart import QueryLimits
    from confab.why import Account


class Scene(Known):
    """A scene of the ontology, loaded with all that it imports.

    Attributes
    ----------
    knowledge : KnowledgeGraph
        The store behind it.
    seconds : mapping of stage to seconds
        What loading took.
    """

    plan = planning.plan

    def picture(self, path: str | Path | None = None, behavior: str | None = None, classes: bool = False) -> Any:
        """Draw the table with its places, a behaviour, or the classes: into a file, or as an image that a notebook shows.

        Returns
        -------
        Path or PIL.Image.Image
            The file's path if one was given.

        Raises
        ------
        KnowledgeError
            As `confab.picturing.draw`.
        """
        from confab.picturing import draw

        self.settle()
        if path is not None:
            return draw(self, Path(path), behavior, classes)
        from tempfile import TemporaryDirectory

        from PIL import Image

        with (
            TemporaryDirectory() as folder,
            Image.open(draw(self, Path(folder, "scene.png"), behavior, classes)) as image,
        ):
            return image.copy()

    def board(self) -> Any:
        """Return a board for a notebook, on which one turns facts, goals and interventions by hand and sees the plan change.

        Raises
        ------
        KnowledgeError
            anywidget isn't installed (the extra `notebook` brings it), or the scene is too large to be turned by hand.
        """
        from confab.board import board

        self.settle()
        return board(self)

    def verify(self, plan: AnyPlan, rollouts: int = 1, seed: int = 0, **options: Any) -> Report:
        """Carry out the primitives of a plan, or of what has one in it, in PyBullet: see `confab.physics.verify`."""
        from confab.physics import verify

        self.settle()
        if isinstance(plan, Result):
            options = {"goal": plan.problem.goal, **options}
        return verify(self, plan_of(plan, self.problem), rollouts, seed, **options)

    def execute(
        self,
        plan: AnyPlan | None = None,
        interventions: Facts = (),
        world: str | World = "symbolic",
        goals: Facts = (),
        memory: Memory | Links | str | Path | None = None,
        mode: str = DEFAULT_MODE,
        seed: int = 0,
        tell: Callable[[Moment], None] | None = None,
        watch: bool = False,
        time_limit: float | None = None,
        **options: Any,
    ) -> Execution:
        """Carry the task out in a closed loop: see `confab.execution.execute`.

        `plan` is what to begin with: a plan, a result, or the name of a file that ``confab plan --json`` wrote. Plans from
        scratch are made with `memory`; `Memory.live` learns from what came of it. `watch` shows what happens while it
        happens, in a notebook or a terminal; `tell` is a display of one's own. After `time_limit` seconds the episode gives up.

        Examples
        --------
        >>> run = load("beverage-serving").execute(interventions="after=28 cup2 LOCATION location8")
        >>> run.reached, [change.kind for change in run.episode.replans]
        (True, ['repair'])
        """
        from confab.execution import carry_out

        return carry_out(
            self, plan, interventions, world, goals, memory, mode, seed, tell, watch, time_limit, **options
        )

    @contextmanager
    def serve(self, port: int = 0, limits: QueryLimits | None = None) -> Iterator[str]:
        """Serve this scene as a read-only SPARQL 1.1 endpoint on loopback until the end of the block, whose URL is given.

        Raises
        ------
        KnowledgeError
            The port is taken, or the scene is at an endpoint already.

        Examples
        --------
        >>> with load("beverage-serving").serve() as url:
        ...     load(url).plan().plan.length
        {1: 4, 2: 10, 3: 32}
        """
        from confab.serving import serving

        with serving(self, port, limits) as server:
            yield f"{server.url}sparql"

    def export(self, folder: str | Path, level: int | None = None) -> tuple[Path, Path]:
        """Write one level, the lowest if none is given, as ``domain.pddl`` and ``problem.pddl`` in a folder, and return where.

        Raises
        ------
        KnowledgeError
            There is no such level, or the folder can't be written.
        """
        from confab.pddl_commands import export_pddl

        return export_pddl(self.problem, level, Path(folder))

    def explain(self, goals: Facts = (), **options: Any) -> Account:
        """Plan, and return why each step is there; or, where there is no plan, why. Takes what `plan` takes.

        Raises
        ------
        confab.reasoner.limits.OutOfTimeError
            The time limit, which holds for both, is over before it is known why.
        """
        limit = options.get("time_limit")
        if not isinstance(limit, Deadline):
            number("time_limit", limit, "seconds as a number, e.g. 5")
        with within(limit) as deadline:
            return self.plan(goals, **options | ({} if limit is None else {"time_limit": deadline})).explain()

    def _repr_html_(self) -> str:
        from confab.labels import labels_of
        from confab.report.course import of_plan
        from confab.report.maps import ground_of, place_map
        from confab.report.markup import styled, tag
        from confab.report.page import embodiment_of
        from confab.report.pieces import table

        problem = self.problem
        labels = labels_of(self.knowledge, self.names, problem)
        ground = ground_of(problem, embodiment_of(self))
        rows = [
            [labels.fact(Fact(symbol, value)), labels.name(problem.initial.get(symbol, FALSE))]
            for symbol, value in sorted(problem.goal.items())
        ]
        return styled(
            tag("p", repr(self)),
            place_map(ground, of_plan(problem, Plan(())), labels) if ground is not None else None,
            table(["wanted", "now"], rows) if rows else None,
        )


def load(source: str | Path, scene: str | None = None) -> Scene:
    """Load a scene: a shipped name, a file of RDF, or the URL of a SPARQL 1.1 endpoint.

    Parameters
    ----------
    source : str or Path
    scene : str, optional
        IRI of the scene in an endpoint that holds several.

    Raises
    ------
    KnowledgeError
        No such scene; broken syntax; an endpoint that is down, or slow, or none. A file whose imports can't be found, or that
        declares no ontology, can be asked; planning in it says what is missing.

    Examples
    --------
    >>> load("beverage-serving").query("SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")[0]
    ('bottle1', 'location4')
    """
    begin = perf_counter()
    if str(source).startswith(("http://", "https://")):
        from confab.reasoner.graph.stores import connect

        return Scene(connect(str(source), scene), {"load": perf_counter() - begin})
    graph = load_graph(source, tolerant=True)
    try:
        infer(graph)
    except KnowledgeError as error:
        graph.faults.append(str(error))
    return Scene(graph, {"load": perf_counter() - begin})


def scenes() -> list[str]:
    """Return the names of the shipped scenes, which `load` takes.

    Examples
    --------
    >>> "beverage-serving" in scenes()
    True
    """
    return list(ontology.scenes())
