"""The class `Scene`, which adds planning, verification and execution to the class in `confab.known`."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import IOBase
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import IO, TYPE_CHECKING, overload

from confab import ontology, planning
from confab.accepting import AnyPlan, Facts, check_seconds, plan_of, several
from confab.known import Known
from confab.planner.plan import Plan
from confab.planner.solve import DEFAULT_MODE, Mode
from confab.planning import Result
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.graph.knowledge import load as load_graph
from confab.reasoner.limits import within
from confab.reasoner.memory.links import Links
from confab.reasoner.names import right_arguments, right_names
from confab.reasoner.symbols import FALSE, Fact
from confab.reasoner.vocabulary import CORE, INDIVIDUAL, OWL
from confab.table import Table
from confab.timing import has_times

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


@right_names("a scene", "confab.load(SCENE)")
class Scene(Known):
    """A scene: an ontology file with all its imports.

    Attributes
    ----------
    knowledge : KnowledgeGraph
        The store with the triples of the scene.
    seconds : mapping of stage to seconds
        The durations of the stages of loading.
    """

    plan = planning.plan
    """Plan in this scene, with the parameters of `confab.planning.plan`."""

    @overload
    def picture(self, path: None = None, behavior: str | None = None, classes: bool = False) -> Image: ...

    @overload
    def picture(self, path: str | Path, behavior: str | None = None, classes: bool = False) -> Path: ...

    def picture(
        self, path: str | Path | None = None, behavior: str | None = None, classes: bool = False
    ) -> Path | Image:
        """Draw the table with its places, a behaviour, or the classes. The picture goes into a file, or is returned for a notebook.

        Returns
        -------
        Path or PIL.Image.Image
            The path of the picture's file if a path is given, otherwise the picture itself.

        Raises
        ------
        KnowledgeError
            The format isn't supported, the behaviour is unknown, or the scene has no geometry.
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
        """Return the page of the scene as a widget for a notebook. On the page, users change facts, goals and interventions.

        Raises
        ------
        KnowledgeError
            anywidget isn't installed. The extra `notebook` installs anywidget.
        """
        from confab.page.widget import board

        self.settle()
        shown: anywidget.AnyWidget = board(self)
        return shown

    def verify(
        self, plan: AnyPlan | None = None, rollouts: int = 1, seed: int = 0, **options: Unpack[physics.VerifyKeywords]
    ) -> Report:
        """Verify a plan, or the plan of a result, in PyBullet (`confab.physics.verify`).

        Without the argument `plan`, a new plan is made and verified. The goals are those of this scene; a result of this scene has
        its own goals.
        """
        from confab.physics import verify

        self.settle()
        plan = self.plan() if plan is None else plan
        if isinstance(plan, Result) and plan.scene is self:
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
        **options: Unpack[execution.ExecuteKeywords],
    ) -> Execution:
        """Execute the task in a closed loop of action and observation (`confab.execution.execute`).

        The first plan is `plan`: a plan, a result, or the name of a plan file. The facts and the goals are those of this scene; a
        result of this scene has its own facts and goals. Each of the `goals` replaces the goal for the same symbol. The soft goals
        that the plan meets are pursued as long as they cost less than their weights, and the hard goals can be reached. During
        the execution, new plans are made with `memory`. `Memory.live` learns from the returned execution. With `watch`, a notebook
        or a terminal shows the execution. The function `observer` is called with each event. After `time_limit` seconds the
        execution gives up.

        Examples
        --------
        >>> run = load("beverage-serving").execute(interventions="after=28 cup2 LOCATION location8")
        >>> run.reached, [change.kind for change in run.episode.replans]
        (True, ['repair'])
        """
        from confab.execution import carry_out

        if plan is None and (self.problem.weights or has_times(self.problem)):
            # the plan determines the soft goals to reach, and the schedule
            chosen = self.plan(several(goals), memory, mode, time_limit)
            plan = chosen if chosen.solved else None
        return carry_out(
            self, plan, interventions, world, goals, memory, mode, seed, observer, watch, time_limit, **options
        )

    @contextmanager
    def serve(self, port: int = 0, limits: QueryLimits | None = None) -> Iterator[str]:
        """Serve the scene as a read-only SPARQL 1.1 endpoint on loopback until the end of the block; yield the endpoint's URL.

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
        """Return the plan in a JSON file of `Result.save` or ``confab plan --json``.

        Raises
        ------
        KnowledgeError
            The file contains no plan, or a step mentions terms that this scene doesn't have.
        """
        return plan_of(path, self.problem)

    def read_result(self, plan: AnyPlan, goals: Facts = ()) -> Result:
        """Return a result with a given plan, which may be the name of a plan file.

        The result can explain, verify and execute the plan.

        Each of the `goals` replaces the scene's goal for the same symbol, as in `plan`.

        Raises
        ------
        KnowledgeError
            There is no plan in the file, or the plan isn't valid in this scene.

        Examples
        --------
        >>> scene = load("beverage-serving")
        >>> plan = scene.plan().plan
        >>> scene.read_result(plan).why(0)
        L1#0  move cup 1 to location 7
          gives   cup 1 is at location 7 (before: location 2)
          because the goal requires that cup 1 is at location 7
        """
        return planning.result_of(self, plan_of(plan, self.problem), goals)

    def read_episode(self, path: str | Path) -> Execution:
        """Return the execution in a JSON file of `Execution.save` or ``confab execute --json``.

        Raises
        ------
        KnowledgeError
            The file contains no episode of this scene, or mentions terms that the scene doesn't have.
        """
        from confab.saved import read_episode

        return read_episode(self, Path(path))

    def read_report(self, verdicts: str | Path, plan: AnyPlan) -> Report:
        """Return the verification of a plan in a JSON file of ``confab verify --json`` or ``confab run``.

        Raises
        ------
        KnowledgeError
            The file contains no verdicts, or verdicts on another plan.
        """
        from confab.saved import read_report

        return read_report(self, Path(verdicts), plan_of(plan, self.problem))

    def to_pddl(self, level: int | None = None) -> tuple[str, str]:
        """Return the texts of a PDDL domain and a PDDL problem for a level, by default the lowest.

        Raises
        ------
        KnowledgeError
            The scene doesn't have the level, or the level has parts that PDDL can't express.
        """
        from confab.pddl_commands import exported

        found = exported(self.problem, level)
        return found.domain, found.problem

    def to_unified_planning(self, level: int | None = None) -> unified_planning.model.Problem:
        """Return a level, by default the lowest, as a problem of unified-planning. The extra `pddl` installs unified-planning.

        Raises
        ------
        KnowledgeError
            unified-planning isn't installed, or can't read the problem, for example because of derived predicates.
        """
        from confab.engines import unified

        return unified(*self.to_pddl(level))

    def export(self, folder: str | Path, level: int | None = None) -> tuple[Path, Path]:
        """Write a level, by default the lowest, as ``domain.pddl`` and ``problem.pddl`` into a folder, and return the paths.

        Raises
        ------
        KnowledgeError
            The scene doesn't have the level, or the folder can't be written.
        """
        from confab.pddl_commands import export_pddl

        return export_pddl(self.problem, level, Path(folder))

    def explain(self, goals: Facts = (), *, goal: Facts = (), **options: Unpack[plan_options.PlanKeywords]) -> Account:
        """Plan with the parameters of `plan`. Return why each step is in the plan, or why there is no plan.

        Raises
        ------
        confab.reasoner.limits.OutOfTimeError
            The time limit for planning and explaining has passed before the explanation is complete.
        """
        limit = options.get("time_limit")
        check_seconds("time_limit", limit)
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
def load(
    source: str | Path | IO[str] | IO[bytes] | rdflib.Graph | Scene | Sequence[str | Path], *, scene: str | None = None
) -> Scene:
    """Load a scene from a shipped name, RDF files or text, an rdflib graph, or the URL of a SPARQL 1.1 endpoint.

    Parameters
    ----------
    source : str, Path, file object, rdflib.Graph, Scene, or sequence of str or Path
        The source of the scene. A text of more than one line is RDF, not a name. If several files are given, the scene is
        the first file that no other file imports. A graph is copied, and may import shipped ontologies. If the scene has a
        robot's body, and its reach facts are missing or outdated, the reach facts are computed and written to
        ``SCENE.reach.ttl`` beside the scene.
    scene : str, optional
        IRI of the scene at an endpoint with several scenes.

    Raises
    ------
    KnowledgeError
        The scene doesn't exist, its syntax is invalid, or the endpoint is down, is too slow, or isn't a SPARQL endpoint. A file
        with missing imports or without an ontology declaration can be loaded and queried; planning in such a scene raises an
        error that names the missing parts.

    Examples
    --------
    >>> load("beverage-serving").query("SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")[0]
    ('bottle1', 'location4')
    """
    from confab.reaching import with_current_reach

    return with_current_reach(read(source, scene=scene), logging.getLogger(__name__).info)


def read(
    source: str | Path | IO[str] | IO[bytes] | rdflib.Graph | Scene | Sequence[str | Path], *, scene: str | None = None
) -> Scene:
    """Load a scene as `load` does, but without computing its reach facts."""
    begin = perf_counter()
    if isinstance(source, str) and source.startswith(("http://", "https://")):
        from confab.reasoner.graph.stores import connect

        return Scene(connect(source, scene), {"load": perf_counter() - begin})
    if isinstance(source, Scene):
        return source
    if isinstance(source, str) and "\n" in source:
        return load_text(source.encode())
    if isinstance(source, IOBase):
        name = getattr(source, "name", None)  # the file's folder may have the imported files
        if isinstance(name, str):
            return read(Path(name))
        content = source.read()
        return load_text(content.encode() if isinstance(content, str) else content)
    return _inferred(_read(source), begin)


def _inferred(graph: KnowledgeGraph, begin: float) -> Scene:
    """Return the scene of a graph that is loaded since the time `begin`, with the inferences; a failure is a fault of the graph."""
    try:
        infer(graph)
    except KnowledgeError as error:
        graph.faults.append(str(error))
    return Scene(graph, {"load": perf_counter() - begin})


def _read(source: object) -> KnowledgeGraph:
    """Return the knowledge graph with the content of files or of an rdflib graph."""
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
    """Load a scene from text in RDF/XML, JSON-LD, Turtle or TriG, recognised by its first characters.

    The text may import shipped ontologies.

    Raises
    ------
    KnowledgeError
        The syntax is invalid.
    """
    from tempfile import TemporaryDirectory

    begin = perf_counter()
    with TemporaryDirectory() as folder:
        file = Path(folder, "stdin.trig")  # Turtle is also TriG
        file.write_bytes(content)

        def said(fault: object) -> str:
            return str(fault).replace(f"{folder}/", "")

        try:
            graph = load_graph(file, tolerant=True, alone=True)
        except KnowledgeError as error:
            raise KnowledgeError(said(error)) from error
        graph.faults[:] = map(said, graph.faults)
    graph.files.pop(graph.scene, None)
    return _inferred(graph, begin)


def _local(address: str | PathLike[str]) -> str | Path:
    """Return the path of a URL ``file:///…``; return any other text unchanged."""
    if not isinstance(address, str) or not address.startswith("file:"):
        return address if isinstance(address, str) else Path(address)
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    return Path(url2pathname(urlsplit(address).path))


@right_arguments
def scenes() -> list[str]:
    """Return the names of the shipped scenes, which `load` accepts.

    Examples
    --------
    >>> "beverage-serving" in scenes()
    True
    """
    return list(ontology.scenes())


def described() -> Table:
    """Return a table of the shipped scenes.

    The columns are: name, levels, number of individuals in the file, whether plans can be verified in physics, and title.
    """
    import pyoxigraph as ox

    files, read, rows = ontology.shipped(), dict[Path, list[tuple[str, str]]](), []
    for name, file in ontology.scenes().items():
        waiting, whole = [file], dict[Path, list[tuple[str, str]]]()
        while waiting:
            one = waiting.pop()
            if one not in read:
                quads = ox.parse(path=str(one), format=ox.RdfFormat.TURTLE)
                read[one] = [(quad.predicate.value, getattr(quad.object, "value", "")) for quad in quads]
            whole[one] = read[one]
            imported = {files.get(value) for predicate, value in read[one] if predicate == f"{OWL}imports"}
            waiting += [each for each in imported if each is not None and each not in whole]
        levels = {value for pairs in whole.values() for predicate, value in pairs if predicate == f"{CORE}level"}
        said, individuals = dict(reversed(read[file])), sum(value == INDIVIDUAL for _, value in read[file])
        physics = "symbols only" if said.get(f"{CORE}symbolicOnly") == "true" else "physics"
        rows.append((name, str(len(levels)), str(individuals), physics, said.get("http://purl.org/dc/terms/title", "")))
    return Table(("scene", "levels", "individuals", "verified by", "title"), tuple(rows))
