"""A scene: knowledge (`confab.known`) with planning and acting; each method leads to its module in a few lines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, overload

from confab import ontology, planning
from confab.accepting import AnyPlan, Facts, number, plan_of, several
from confab.known import Known
from confab.planner.plan import Plan
from confab.planner.solve import DEFAULT_MODE, Mode
from confab.planning import Result
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.graph.knowledge import load as load_graph
from confab.reasoner.limits import Deadline, within
from confab.reasoner.memory.links import Links
from confab.reasoner.names import right_arguments, right_names
from confab.reasoner.symbols import FALSE, Fact

if TYPE_CHECKING:
    from typing import Unpack

    import anywidget
    import rdflib
    import unified_planning.model
    from PIL.Image import Image

    from confab import execution, physics, plan_options
    from confab.execution import Execution
    from confab.memory import Memory
    from confab.physics import Report
    from confab.planner.acting.episode import Event
    from confab.planner.acting.world import World
    from confab.reasoner.graph.query_process import QueryLimits
    from confab.why import Account


@right_names("a scene", "confab.hints", "SCENE")
class Scene(Known):
    """A scene of the ontology with all its imports.

    Attributes
    ----------
    knowledge : KnowledgeGraph
        The store with its triples.
    seconds : mapping of stage to seconds
        Statistics of loading.
    """

    plan = planning.plan
    """Return the result of planning in this scene. Takes the parameters of `confab.planning.plan` but the first."""

    @overload
    def picture(self, path: None = None, behavior: str | None = None, classes: bool = False) -> Image: ...

    @overload
    def picture(self, path: str | Path, behavior: str | None = None, classes: bool = False) -> Path: ...

    def picture(
        self, path: str | Path | None = None, behavior: str | None = None, classes: bool = False
    ) -> Path | Image:
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

        from PIL.Image import open as read

        with TemporaryDirectory() as folder, read(draw(self, Path(folder, "scene.png"), behavior, classes)) as image:
            return image.copy()

    def board(self) -> anywidget.AnyWidget:
        """Return the page for a notebook: map, timeline, plan, queries; facts, goals and interventions can be changed on it.

        Raises
        ------
        KnowledgeError
            anywidget isn't installed (the extra `notebook` brings it).
        """
        from confab.page.widget import board

        self.settle()
        shown: anywidget.AnyWidget = board(self)
        return shown

    def verify(
        self, plan: AnyPlan | None = None, rollouts: int = 1, seed: int = 0, **options: Unpack[physics.Options]
    ) -> Report:
        """Execute the primitives of a plan, or of an object with a plan, in PyBullet: see `confab.physics.verify`.

        Without a plan, the scene is planned in first.
        """
        from confab.physics import verify

        self.settle()
        plan = self.plan() if plan is None else plan
        if isinstance(plan, Result):
            options.setdefault("goal", plan.problem.goal)
        return verify(self, plan_of(plan, self.problem), rollouts, seed, **options)

    def execute(
        self,
        plan: AnyPlan | None = None,
        interventions: Facts = (),
        world: str | World = "symbolic",
        goals: Facts = (),
        memory: Memory | Links | str | Path | None = None,
        mode: Mode = DEFAULT_MODE,
        seed: int = 0,
        observer: Callable[[Event], None] | None = None,
        watch: bool = False,
        time_limit: float | None = None,
        **options: Unpack[execution.Options],
    ) -> Execution:
        """Execute the task in a closed loop: see `confab.execution.execute`.

        It begins with `plan`: a plan, a result, or the name of a file that ``confab plan --json`` wrote. New plans are made
        with `memory`; `Memory.live` learns from the outcome. `watch` shows the execution in a notebook or a terminal;
        `observer` is a custom observer of events. After `time_limit` seconds the episode gives up.

        Examples
        --------
        >>> run = load("beverage-serving").execute(interventions="after=28 cup2 LOCATION location8")
        >>> run.reached, [change.kind for change in run.episode.replans]
        (True, ['repair'])
        """
        from confab.execution import carry_out

        if plan is None and self.problem.weights:  # the plan decides which soft goals are left unmet
            chosen = self.plan(several(goals), memory, mode, time_limit)
            plan = chosen if chosen.solved else None
        return carry_out(
            self, plan, interventions, world, goals, memory, mode, seed, observer, watch, time_limit, **options
        )

    @contextmanager
    def serve(self, port: int = 0, limits: QueryLimits | None = None) -> Iterator[str]:
        """Serve this scene as a read-only SPARQL 1.1 endpoint on loopback until the end of the block; yield its URL.

        Raises
        ------
        KnowledgeError
            The port is in use, or the scene is already at an endpoint.

        Examples
        --------
        >>> with load("beverage-serving").serve() as url:
        ...     load(url).plan().plan.length
        {1: 4, 2: 10, 3: 32}
        """
        from confab.serving import serving

        with serving(self, port, limits) as server:
            yield f"{server.url}sparql"

    def read_plan(self, path: str | Path) -> Plan:
        """Return the plan in a file that `Result.save` or ``confab plan --json`` wrote, read for this scene.

        Raises
        ------
        KnowledgeError
            The file contains no plan, or a step mentions terms that this scene doesn't have.
        """
        return plan_of(path, self.problem)

    def read_episode(self, path: str | Path) -> Execution:
        """Return the execution in a JSON file that `Execution.save` or ``confab execute --json`` wrote.

        Raises
        ------
        KnowledgeError
            As `confab.saved.read_episode`.
        """
        from confab.saved import read_episode

        return read_episode(self, Path(path))

    def read_report(self, verdicts: str | Path, plan: AnyPlan) -> Report:
        """Return the verification of a plan in a JSON file that ``confab verify --json`` or ``confab run`` wrote.

        Raises
        ------
        KnowledgeError
            As `confab.saved.read_report`.
        """
        from confab.saved import read_report

        return read_report(self, Path(verdicts), plan_of(plan, self.problem))

    def to_pddl(self, level: int | None = None) -> tuple[str, str]:
        """Return one level, the lowest if none is given, as the texts of a PDDL domain and problem; `export` writes them.

        Raises
        ------
        KnowledgeError
            There is no such level, or it has parts that PDDL can't express.
        """
        from confab.pddl_commands import exported

        found = exported(self.problem, level)
        return found.domain, found.problem

    def to_unified_planning(self, level: int | None = None) -> unified_planning.model.Problem:
        """Return one level, the lowest if none is given, as a problem of unified-planning (the extra `pddl` brings it).

        Raises
        ------
        KnowledgeError
            unified-planning isn't installed, or can't read the problem: it doesn't support derived predicates.
        """
        from confab.engines import unified

        return unified(*self.to_pddl(level))

    def export(self, folder: str | Path, level: int | None = None) -> tuple[Path, Path]:
        """Write one level, the lowest if none is given, as ``domain.pddl`` and ``problem.pddl`` in a folder, and return the paths.

        Raises
        ------
        KnowledgeError
            There is no such level, or the folder can't be written.
        """
        from confab.pddl_commands import export_pddl

        return export_pddl(self.problem, level, Path(folder))

    def explain(self, goals: Facts = (), *, goal: Facts = (), **options: Unpack[plan_options.Options]) -> Account:
        """Plan, and return why each step is there; without a plan, why there is none. Takes the parameters of `plan`.

        Raises
        ------
        confab.reasoner.limits.OutOfTimeError
            The time limit for both is over before the reason is found.
        """
        limit = options.get("time_limit")
        if not isinstance(limit, Deadline):
            number("time_limit", limit, "seconds as a number, e.g. 5")
        with within(limit) as deadline:
            if limit is not None:
                options["time_limit"] = deadline
            return self.plan(goals, goal=goal, **options).explain()

    def _repr_html_(self) -> str:
        from confab.labels import labels_of
        from confab.page.markup import styled, tag
        from confab.page.pieces import table

        problem = self.problem
        labels = labels_of(self.knowledge, self.names, problem)
        rows = [
            [labels.fact(Fact(symbol, value)), labels.name(problem.initial.get(symbol, FALSE))]
            for symbol, value in sorted(problem.goal.items())
        ]
        return styled(tag("p", repr(self)), table(["wanted", "now"], rows) if rows else None)


@right_arguments
def load(source: str | Path | rdflib.Graph | Scene | Sequence[str | Path], scene: str | None = None) -> Scene:
    """Load a scene: a shipped name, a file of RDF or several, a graph of rdflib, or the URL of a SPARQL 1.1 endpoint.

    Parameters
    ----------
    source : str, Path, rdflib.Graph, Scene, or sequence of str or Path
        Of several files, the scene is the first that no other imports. A scene is returned unchanged. A graph is copied, and
        may import shipped ontologies.
    scene : str, optional
        IRI of the scene in an endpoint that holds several.

    Raises
    ------
    KnowledgeError
        There is no such scene, its syntax is invalid, or the endpoint is down, slow, or no endpoint. A file whose imports can't
        be found, or that declares no ontology, can be queried; planning in it reports the missing parts.

    Examples
    --------
    >>> load("beverage-serving").query("SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")[0]
    ('bottle1', 'location4')
    """
    begin = perf_counter()
    if isinstance(source, str) and source.startswith(("http://", "https://")):
        from confab.reasoner.graph.stores import connect

        return Scene(connect(source, scene), {"load": perf_counter() - begin})
    if isinstance(source, Scene):
        return source
    graph = _read(source)
    try:
        infer(graph)
    except KnowledgeError as error:
        graph.faults.append(str(error))
    return Scene(graph, {"load": perf_counter() - begin})


def _read(source: object) -> KnowledgeGraph:
    """Return the content of files, or of an rdflib graph."""
    if isinstance(source, str | PathLike):
        return load_graph(_local(source), tolerant=True)
    if isinstance(source, Sequence) and all(isinstance(one, str | PathLike) for one in source):
        return load_graph([_local(one) for one in source], tolerant=True)
    if not hasattr(source, "serialize"):
        wanted = "the name of a shipped scene, a file or several, a graph of rdflib, or the URL of an endpoint"
        raise KnowledgeError(f"got {type(source).__name__}; wanted {wanted}")
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        file = Path(folder, "scene.ttl")
        source.serialize(file, format="turtle", encoding="utf-8")
        graph = load_graph(file, tolerant=True)
    graph.files.pop(graph.scene, None)
    return graph


def load_text(content: bytes) -> Scene:
    """Load a scene from its text: RDF/XML, JSON-LD or Turtle, recognised by its first characters. It may import shipped ontologies.

    Raises
    ------
    KnowledgeError
        Broken syntax.
    """
    from tempfile import TemporaryDirectory

    head = content.lstrip()[:200].lower()
    xml = head.startswith((b"<?xml", b"<rdf:rdf", b"<!doctype"))
    suffix = ".owl" if xml else ".jsonld" if head.startswith((b"{", b"[{")) else ".ttl"
    begin = perf_counter()
    with TemporaryDirectory() as folder:
        file = Path(folder, f"stdin{suffix}")
        file.write_bytes(content)
        try:
            graph = load_graph(file, tolerant=True)
        except KnowledgeError as error:
            raise KnowledgeError(str(error).replace(f"{folder}/", "")) from error
        graph.faults[:] = [fault.replace(f"{folder}/", "") for fault in graph.faults]
    graph.files.pop(graph.scene, None)
    try:
        infer(graph)
    except KnowledgeError as error:
        graph.faults.append(str(error))
    return Scene(graph, {"load": perf_counter() - begin})


def _local(address: str | PathLike[str]) -> str | Path:
    """Return the path of an address ``file:///…``; return any other text unchanged."""
    if not isinstance(address, str) or not address.startswith("file:"):
        return address if isinstance(address, str) else Path(address)
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    return Path(url2pathname(urlsplit(address).path))


def scenes() -> list[str]:
    """Return the names of the shipped scenes, which `load` takes.

    Examples
    --------
    >>> "beverage-serving" in scenes()
    True
    """
    return list(ontology.scenes())
