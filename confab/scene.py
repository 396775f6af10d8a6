"""A scene at the front desk: query it, plan in it, see what came of it."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, overload

import pyoxigraph as ox

import ontology
from confab.accepting import AnyPlan, Facts, number, plan_of, several, sparql_of
from confab.interchange import outcome_json
from confab.table import Table
from planner.plan import Limits, Outcome, Plan, Status, paused_collection, renumbered
from planner.solve import MODES, Request, solve
from planner.validation import validate
from reasoner.graph.inference import infer
from reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from reasoner.graph.knowledge import load as load_graph
from reasoner.limits import Deadline
from reasoner.memory.links import Links
from reasoner.names import Names, nearest
from reasoner.reading.problem import Reading, parse_fact, read, with_goals
from reasoner.reading.relevance import recognise
from reasoner.symbols import FALSE, TRUE, Fact, Problem

if TYPE_CHECKING:
    import networkx
    import rdflib
    from rich.tree import Tree

    from confab.execution import Execution
    from confab.labels import Labels
    from confab.memory import Memory
    from confab.physics import Report
    from confab.why import Account, Because, WhyNot
    from planner.acting.episode import World
    from planner.acting.executive import Moment
    from planner.causal_links import Purpose
    from reasoner.embodiment.values import Embodiment
    from reasoner.graph.apart import QueryLimits
    from reasoner.graph.mirror import Mirror

log = logging.getLogger(__name__)
DEFAULT_MODE = "guarded"
NO_ENGINE = "none"
"""In place of an engine's name: no engine at all."""
OPTIMAL_SECONDS = 10.0
"""Where the search for the best plan stops if no time limit is given."""


@dataclass
class Scene:
    """A scene of the ontology, loaded with all that it imports.

    Attributes
    ----------
    knowledge : KnowledgeGraph
        The store behind it.
    seconds : mapping of stage to seconds
        What loading took.
    """

    knowledge: KnowledgeGraph
    seconds: dict[str, float] = field(default_factory=dict)
    _edited: bool = field(default=False, init=False, repr=False, compare=False)
    _told: bool = field(default=False, init=False, repr=False, compare=False)

    @cached_property
    def reading(self) -> Reading:
        """The whole scene as the planner takes it, and the table that leads from its names back to IRIs.

        `plan` does without it: it reads what the task can need.
        """
        self._settle()
        self.knowledge.require_whole()
        return read(self.knowledge)

    @property
    def iri(self) -> str:
        """The IRI of the scene's ontology."""
        return self.knowledge.scene

    @property
    def problem(self) -> Problem:
        """What is there, what can be done, what holds and what is wanted."""
        return self.reading.problem

    @cached_property
    def names(self) -> Names:
        """Short names and the IRIs behind them; where the scene can't be read, of all that its files speak of."""
        try:
            return self.reading.names
        except KnowledgeError:
            quads = self.knowledge.store
            return Names(term.value for q in quads for term in q.triple if isinstance(term, ox.NamedNode))

    @property
    def objects(self) -> dict[str, str]:
        """The objects by name, each with its most specific class.

        Examples
        --------
        >>> list(load("beverage-serving").objects.items())[:3]
        [('bottle1', 'Bottle'), ('bottle2', 'Bottle'), ('cup1', 'Cup')]
        """
        self._settle()
        problem = self.problem
        spoken_of = {symbol.arguments[0]: "" for symbol in problem.initial if symbol.arguments}
        names = dict.fromkeys((*problem.classes.get("Object", ()), *sorted(spoken_of)))
        kinds = {name: [kind for kind, members in problem.classes.items() if name in members] for name in names}
        above = {name: {sup for kind in of for sup in problem.parents.get(kind, ())} for name, of in kinds.items()}
        own = {name: " ".join(k for k in of if k not in above[name] and "|" not in k) for name, of in kinds.items()}
        return dict(sorted(own.items(), key=lambda pair: pair[1]))

    @property
    def facts(self) -> list[str]:
        """What holds in the beginning, each as `with_fact` takes it.

        Examples
        --------
        >>> load("beverage-serving").facts[:2]
        ['bottle1 BEVERAGE beverage1', 'bottle1 LOCATION location4']
        """
        self._settle()
        return sorted(str(Fact(symbol, value)) for symbol, value in self.problem.initial.items())

    @property
    def goals(self) -> list[str]:
        """What is wanted, each as `with_goal` and `plan` take it.

        Examples
        --------
        >>> load("beverage-serving").goals[:2]
        ['bottle1 LOCATION location4', 'bottle2 LOCATION location3']
        """
        self._settle()
        return sorted(str(Fact(symbol, value)) for symbol, value in self.problem.goal.items())

    def with_fact(self, *facts: str) -> Scene:
        """Return a scene in which some facts hold, each in place of what was stated of its symbol; this one stays as it is.

        Raises
        ------
        KnowledgeError
            A word names nothing of its kind, or the store is a remote one.

        Examples
        --------
        >>> load("beverage-serving").with_fact("cup1 LOCATION location7").plan().plan.length
        {1: 3, 2: 8, 3: 26}
        """
        from reasoner.reading.restating import with_facts

        return self._restated(with_facts, facts)

    def with_goal(self, *goals: str) -> Scene:
        """Return a scene in which some facts are wanted, each in place of the goal of its symbol; this one stays as it is.

        Raises
        ------
        KnowledgeError
            As `with_fact`.

        Examples
        --------
        >>> load("beverage-serving").with_goal("cup2 LOCATION location8").plan().plan.length
        {1: 5, 2: 12, 3: 38}
        """
        from reasoner.reading.restating import with_goals

        return self._restated(with_goals, goals)

    def _restated(
        self, change: Callable[[KnowledgeGraph, Reading, list[Fact]], KnowledgeGraph], facts: Iterable[str]
    ) -> Scene:
        self._settle()
        copy = change(self.knowledge, self.reading, [Fact(*parse_fact(self.problem, fact)) for fact in facts])
        infer(copy)
        return Scene(copy, dict(self.seconds))

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

        self._settle()
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

        self._settle()
        return board(self)

    @cached_property
    def graph(self) -> rdflib.Graph:
        """The scene's triples as an rdflib graph; what is added to it or removed from it counts in `query` and `plan` at once."""
        from reasoner.graph.rdflib_graph import rdflib_graph

        self._settle()
        return rdflib_graph(self.knowledge, self._forget)

    @cached_property
    def embodiment(self) -> Embodiment:
        """What the ontology says about bodies: robot, furniture, shapes, skills and perceivers.

        Raises
        ------
        KnowledgeError
            The scene is symbolic only.
        EmbodimentError
            Something that physics needs isn't said; the message names it.
        """
        from reasoner.embodiment.reading import read_embodiment

        self.knowledge.require_whole()
        if self.knowledge.select("SELECT ?why WHERE { ?ontology :symbolicOnly ?why }"):
            raise KnowledgeError(
                f"{self.iri} is symbolic only: it states reach without geometry, so physics can't verify it"
            )
        return read_embodiment(self.knowledge.store, self.names.short, self.knowledge.folders)

    def verify(self, plan: AnyPlan, rollouts: int = 1, seed: int = 0, **options: Any) -> Report:
        """Carry out the primitives of a plan, or of what has one in it, in PyBullet: see `confab.physics.verify`."""
        from confab.physics import verify

        self._settle()
        if isinstance(plan, Result):
            options = {"goal": plan.problem.goal, **options}
        return verify(self, plan_of(plan, self.problem), rollouts, seed, **options)

    @cached_property
    def _mirror(self) -> Mirror:
        from reasoner.graph.mirror import Mirror

        return Mirror(self.knowledge)

    @property
    def owl(self) -> Any:
        """The scene as an owlready2 world; what is added through it is seen by `query` and `plan`."""
        return self._mirror.world

    def _forget(self) -> None:
        """Forget what was read before an edit."""
        for name in ("reading", "names", "embodiment"):
            self.__dict__.pop(name, None)
        self._edited = True

    def _settle(self) -> None:
        """Take over what was edited through `owl`, and conclude anew what follows from what was edited anywhere."""
        if "_mirror" in self.__dict__ and self._mirror.pull():
            self.__dict__.pop("graph", None)
            self._forget()
        if self._edited:
            self._edited = False
            infer(self.knowledge)

    def query(self, sparql: str, limits: QueryLimits | None = None) -> Table:
        """Return what a SPARQL 1.1 query answers, as a table: the rows of SELECT, the truth of ASK, the triples of CONSTRUCT.

        The query is given as text, as a ``.rq`` file, or by the name of a ready one (``ontology/questions``).

        Prefixes are those of the scene's file, then of what it imports. ``:name`` is the core's where the scene's own namespace has
        no such name. It is answered in a process of its own: see `reasoner.graph.apart`.

        Raises
        ------
        KnowledgeError
            The query isn't SPARQL; the message has line and column. Or it asks another endpoint without leave.
        LimitError
            It takes more time, rows or memory than the limits allow.

        Examples
        --------
        >>> scene = load("beverage-serving")
        >>> scene.query("SELECT ?where WHERE { :cup1 k:location ?where }")[0]
        ('location2',)
        >>> bool(scene.query("ASK { :cup1 k:location t:location7 }"))
        False
        """
        from reasoner.graph.apart import ask, unheard_of

        sparql = sparql_of(sparql)
        kind, columns, found = ask(self._asked(sparql), sparql, limits)
        if kind == "truth":
            return Table(("answer",), ((str(found).lower(),),), truth=found)
        if not found and not self.knowledge.remote and (unheard := unheard_of(self.knowledge, sparql)):
            log.warning("confab: the scene doesn't speak of %s; is the prefix the right one?", ", ".join(unheard))
        columns = ["subject", "predicate", "object"] if kind == "triples" else columns
        rows = tuple(tuple(self._cell(term) for term in row) for row in found)
        return Table(tuple(columns), rows, tuple(map(tuple, found)))

    def with_episodes(self, *files: str | Path) -> Scene:
        """Return the scene with saved episodes in it, so that `query` can ask about all of them.

        Raises
        ------
        KnowledgeError
            A file holds no episode, or two hold one of the same name.
        """
        from reasoner.memory.episodes import read_episodes

        read_episodes(self.knowledge, map(Path, files))
        return self

    def _asked(self, sparql: str) -> KnowledgeGraph:
        """Return the graph as a query shall see it; what is missing in it is told once."""
        from reasoner.reading.affordance import SITUATION, write_situation

        self._settle()
        if SITUATION in sparql:
            write_situation(self.knowledge, self.reading)
        for fault in () if self._told else self.knowledge.faults:
            log.warning("confab: %s; it can be asked all the same, but not planned in", fault)
        self._told = True
        return self.knowledge

    @overload
    def construct(self, sparql: str, path: None = None, limits: QueryLimits | None = None) -> rdflib.Graph: ...

    @overload
    def construct(self, sparql: str, path: str | Path, limits: QueryLimits | None = None) -> int: ...

    def construct(
        self, sparql: str, path: str | Path | None = None, limits: QueryLimits | None = None
    ) -> rdflib.Graph | int:
        """Return the triples that a CONSTRUCT query gives; or write them into a file that imports this scene, and return how many.

        Raises
        ------
        KnowledgeError, LimitError
            As `query`; the query gives no triples but rows.
        """
        sparql = sparql_of(sparql)
        if path is not None:
            from reasoner.graph.construct import write_construct

            return write_construct(self._asked(sparql), sparql, Path(path), limits)
        import rdflib

        return rdflib.Graph().parse(data=self.query(sparql, limits).turtle(self.knowledge.spoken), format="turtle")

    def applicable_query(self, behavior: str) -> str:
        """Return the SPARQL query for where a behaviour can be done; `query` answers it on the initial situation."""
        from reasoner.graph.apart import standing_alone
        from reasoner.reading.affordance import applicable_query
        from reasoner.reading.quantification import behavior_named

        query = applicable_query(self.knowledge, self.reading, behavior_named(self.reading, behavior))
        return standing_alone(self.knowledge, query)

    def quantifying_query(self, behavior: str) -> str:
        """Return the SPARQL query that quantifies a behaviour: a row for each way to put individuals in for its parameters."""
        from reasoner.graph.apart import standing_alone
        from reasoner.reading.quantification import behavior_named, query_for

        return standing_alone(self.knowledge, query_for(self.reading, behavior_named(self.reading, behavior)))

    def affordances(self, of: str | None = None) -> Table:
        """Return what objects afford in the initial situation: object, behaviour, arguments, situation, effect.

        Raises
        ------
        KnowledgeError
            There is no object of that name; ``all`` and None stand for every object.
        """
        from reasoner.reading.affordance import affordances

        known = {name for members in self.problem.classes.values() for name in members}
        if of not in (None, "all", *known):
            raise KnowledgeError(f"unknown object '{of}'{nearest(str(of), known)}")
        found = affordances(self.knowledge, self.reading)
        return Table(
            ("object", "behavior", "arguments", "situation", "effect"),
            tuple(
                (a.object, a.behavior, " ".join(a.arguments), _sentence(a.situation), _sentence(a.effect))
                for a in found
                if of in (None, "all", a.object)
            ),
        )

    def _cell(self, term: Any) -> str | None:
        if term is None:
            return None
        value = str(getattr(term, "value", term))
        return self.names.short(value) if type(term).__name__ == "NamedNode" else value

    def plan(
        self,
        goals: Facts = (),
        memory: Memory | Links | str | Path | None = None,
        mode: str = DEFAULT_MODE,
        time_limit: float | Deadline | None = None,
        optimal: bool = False,
        observed: str | Path | None = None,
        engine: str | None = None,
        level: int | None = None,
        leave_levels: bool = True,
    ) -> Result:
        """Plan in this scene.

        Parameters
        ----------
        goals : str or iterable of str
            Each like ``cup2 LOCATION location8``; replaces the goal of that symbol.
        memory : Memory, its file or endpoint, or Links alone in paper mode; optional
            What was learned before; none if left out.
        mode : str
            ``paper``: A* with eq. (5) on each level, over everything that SPARQL quantifies in the scene. ``guarded``,
            ``leading`` and ``strict``: the fast planner over what the task can need, and how far experience may lead
            it; behaviours are then numbered among the individuals that were recognised. ``optimal``: as `optimal` says.
        time_limit : float or Deadline, optional
            Seconds after which the call gives up, or when; `OPTIMAL_SECONDS` if `optimal` is asked for and nothing is said.
        optimal : bool
            Improve the plan until it is proved optimal or a limit comes, and tell the bound; without memory.
        observed : str or Path, optional
            File of observed facts, which replace the scene's.
        engine : str, optional
            A planner that unified-planning knows plans instead, e.g. ``fast-downward``. If left out, any installed one is tried
            where ours gives up at a limit other than that of time; with ``none`` none is.
        level : int, optional
            The level that the engine plans; the lowest if left out.
        leave_levels : bool
            Whether steps of a lower level may stand where a level has no plan that can be refined; the outcome says where, and
            what they break that only the level above asks.

        Raises
        ------
        KnowledgeError
            A goal names what the scene doesn't have, the mode is unknown, or options exclude each other.
        LimitError
            The time was over before the search began; if it is over later, the outcome says so.
        """
        if level is not None and engine in (None, NO_ENGINE):
            raise KnowledgeError("a level is chosen for an engine; name one, e.g. --engine fast-downward")
        if engine not in (None, NO_ENGINE) and (mode == "paper" or optimal):
            raise KnowledgeError("an engine plans by itself; leave out --optimal and the paper's mode")
        if engine not in (None, NO_ENGINE) and not leave_levels:
            raise KnowledgeError(
                "an engine plans one level alone, so it may leave the others; leave out --levels strict"
            )
        if optimal and mode not in (DEFAULT_MODE, "optimal"):
            raise KnowledgeError(f"--optimal means --mode optimal, and not --mode {mode}; leave one out")
        optimal = optimal or mode == "optimal"
        if optimal and (memory is not None or not leave_levels):
            what = (
                "uses no memory"
                if memory is not None
                else "compares plans of the lowest level, so it may leave the others"
            )
            raise KnowledgeError(f"the optimal search {what}; leave one option out")
        if not isinstance(time_limit, Deadline):
            number("time_limit", time_limit, "seconds as a number, e.g. 5")
        self._settle()
        if mode not in MODES:
            raise KnowledgeError(f"unknown mode '{mode}'; wanted one of {', '.join(MODES)}")
        if optimal and time_limit is None:
            time_limit = OPTIMAL_SECONDS
        self.knowledge.require_whole()
        deadline = time_limit if isinstance(time_limit, Deadline) else Deadline.after(time_limit)
        with self.knowledge.until(deadline), paused_collection():
            how = "optimal" if optimal else mode
            return self._plan(
                several(goals), self._memory(memory), how, deadline, observed, engine, level, leave_levels
            )

    def _memory(self, given: Memory | Links | str | Path | None) -> Memory | Links | None:
        """Return a memory; one in a file or at an endpoint is read."""
        if not isinstance(given, str | Path):
            return given
        from confab.memory import Memory

        return Memory.load(given, self)

    def _plan(
        self,
        goals: list[str],
        memory: Memory | Links | None,
        mode: str,
        deadline: Deadline,
        observed: str | Path | None,
        engine: str | None,
        level: int | None,
        leave_levels: bool,
    ) -> Result:
        begin, asked = perf_counter(), self.knowledge.round_trips
        links = memory if isinstance(memory, Links) or memory is None else memory.links
        advisor = None if memory is None or isinstance(memory, Links) else memory.advisor
        grounds = None
        if mode == "paper":
            from reasoner.reading.quantification import quantify

            seen = self._seen(self.reading, observed)
            grounds = {level: quantify(self.knowledge, seen, level) for level in seen.problem.domain.levels}
        else:
            seen = self._seen(self.reading, observed) if observed else recognise(self.knowledge, goals)
        self.knowledge.confirm()
        problem = with_goals(seen, goals) if observed or mode == "paper" else seen.problem
        quantified = perf_counter() - begin
        self._check_goal(problem)

        def search(problem: Problem) -> Outcome:
            deadline.check("reading the problem")
            if engine not in (None, NO_ENGINE):
                from confab.engines import plan_by_engine

                return plan_by_engine(problem, engine, level, deadline.left)
            limits = Limits(seconds=deadline.left)
            outcome = solve(Request(problem, mode, limits, advisor, links, grounds, leave_levels))
            if outcome.status is not Status.GAVE_UP or engine == NO_ENGINE or deadline.left == 0 or not leave_levels:
                return outcome
            return self._by_any_engine(problem, deadline) or outcome

        outcome = search(problem)
        if outcome.status is Status.UNSOLVABLE and mode != "paper" and not observed:
            # A "no" is worth a look at the whole world, whatever task recognition left out of it.
            if "reading" not in self.__dict__:
                self.reading = read(self.knowledge, seen.schema)
                self.knowledge.confirm()
            whole = replace(self.problem, goal=problem.goal)
            if whole != problem:
                problem, outcome = whole, search(whole)
        queries = self.knowledge.round_trips - asked
        return Result(self, problem, outcome, {**self.seconds, "quantify": quantified}, queries)

    def _by_any_engine(self, problem: Problem, deadline: Deadline) -> Outcome | None:
        """Return the plan of whichever engine is installed, or None: none is, or none takes such a problem, or none solves it."""
        from confab.engines import plan_by_engine

        with suppress(KnowledgeError):
            outcome = plan_by_engine(problem, None, None, deadline.left)
            return outcome if outcome.status is Status.SOLVED else None
        return None

    def _check_goal(self, problem: Problem) -> None:
        """Raise `KnowledgeError` if there is no goal, or one that wants what is no value of its situation type."""
        if not problem.goal:
            raise KnowledgeError(f"{self.iri} has no task with goals; plan in a scene that has one, or give a goal")
        allowed = {
            name: {*problem.classes.get(s.range, ()), TRUE, FALSE} for name, s in problem.domain.situations.items()
        }
        for symbol, value in problem.goal.items():
            if value not in allowed[symbol.situation]:
                values = allowed[symbol.situation] - {TRUE, FALSE}
                raise KnowledgeError(
                    f"the goal of {symbol} is {value}, which is no value of it{nearest(value, values)}"
                )

    def _seen(self, reading: Reading, observed: str | Path | None) -> Reading:
        from reasoner.reading.observed import load_observed

        return reading if observed is None else load_observed(Path(observed), reading)

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
        **options: Any,
    ) -> Execution:
        """Carry the task out in a closed loop: see `confab.execution.execute`.

        `plan` is what to begin with: a plan, a result, or the name of a file that ``confab plan --json`` wrote. Plans from
        scratch are made with `memory`; `Memory.live` learns from what came of it. `watch` shows what happens while it
        happens, in a notebook or a terminal; `tell` is a display of one's own.

        Examples
        --------
        >>> run = load("beverage-serving").execute(interventions="after=28 cup2 LOCATION location8")
        >>> run.reached, [change.kind for change in run.episode.replans]
        (True, ['repair'])
        """
        from confab.execution import execute, planner_of
        from confab.live import spectator

        self._settle()
        problem = plan.problem if isinstance(plan, Result) else with_goals(self.reading, several(goals))
        begun = None if plan is None else plan_of(plan, problem)
        memory = self._memory(memory)
        planner = planner_of(mode, memory if isinstance(memory, Links) or memory is None else memory.links)
        if planner is None and memory is not None and not isinstance(memory, Links):
            from planner.experience.portfolio import planner_with

            planner = planner_with(memory.advisor, mode)
        number("seed", seed, "an integer")
        texts = several(interventions)
        with spectator(watch, tell) as heard:
            return execute(self, problem, begun, texts, world, planner, seed, heard, **options)

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
        """Plan, and return why each step is there; or, where there is no plan, why. Takes what `plan` takes."""
        return self.plan(goals, **options).explain()

    def __repr__(self) -> str:
        """Return what the scene is, in one line."""
        problem = self.problem
        return f"Scene({self.iri}: {len(problem.initial)} situated objects, {len(problem.goal)} goals)"

    def _repr_html_(self) -> str:
        from confab.report.notebook import of_scene

        return of_scene(self)


@dataclass
class Result:
    """What came of planning: the outcome, and the scene in which it holds.

    `problem` has the individuals that the task can need; `queries` is how many the store was asked.
    """

    scene: Scene
    problem: Problem
    outcome: Outcome
    seconds: dict[str, float]
    queries: int = 0

    @property
    def plan(self) -> Plan:
        """The plan; raises `KnowledgeError` with the reason if there is none."""
        if self.outcome.plan is None:
            reason = self.outcome.reason.text if self.outcome.reason else ""
            raise KnowledgeError(f"there is no plan ({self.outcome.status.value}): {reason}")
        return self.outcome.plan

    def in_order(self, *ids: int) -> Plan:
        """Return the plan with its steps of the first level in another order, as somebody may have shown it.

        Raises
        ------
        KnowledgeError
            These aren't the IDs of the steps of the first level, each once; or the plan can't be done in that order.

        Examples
        --------
        >>> [step.id for step in load("beverage-serving").plan().in_order(22, 34, 28, 39).steps]
        [22, 34, 28, 39]
        """
        waiting = list(self.plan.steps)
        there = [step.id for step in waiting]
        if sorted(there) != sorted(ids):
            raise KnowledgeError(
                f"wanted {', '.join(map(str, there))} in another order; got {', '.join(map(str, ids)) or 'nothing'}"
            )
        steps = [waiting.pop(next(i for i, step in enumerate(waiting) if step.id == wanted)) for wanted in ids]
        plan = Plan(renumbered(steps))
        if faults := validate(self.problem, plan):
            raise KnowledgeError(f"the plan can't be done in that order: {faults[0].text}")
        return plan

    def verify(self, rollouts: int = 1, seed: int = 0, **options: Any) -> Report:
        """Carry out the plan in PyBullet: see `confab.physics.verify`."""
        return self.scene.verify(self.plan, rollouts, seed, goal=self.problem.goal, **options)

    def execute(self, interventions: Facts = (), **options: Any) -> Execution:
        """Carry the task out in a closed loop, beginning with this plan: see `Scene.execute`."""
        return self.scene.execute(self, interventions, **options)

    @cached_property
    def labels(self) -> Labels:
        """What people call the behaviours, situation types and individuals of the problem."""
        from confab.labels import labels_of

        return labels_of(self.scene.knowledge, self.scene.names, self.problem)

    @cached_property
    def purposes(self) -> dict[tuple[int, ...], Purpose]:
        """The causal links of each step, by its path (`planner.causal_links`)."""
        from planner.causal_links import purposes

        return purposes(self.problem, self.plan)

    def why(self, step: int | str | tuple[int, ...]) -> Because:
        """Return why a step is in the plan: what it gives, and what needs that.

        Parameters
        ----------
        step : int, str or path
            Which step of the first level, counted from 0; ``L3#12``, the step 12 of level 3; its path, ``0.1.2``; or its words.

        Examples
        --------
        >>> load("beverage-serving").plan().why("pick cup 1")
        L2#0  pick cup 1 with left hand
          gives   left hand holds cup 1 (before: nothing)
          gives   cup 1 is in a hand (before: location 2)
          because “place cup 1 in left hand to location 7” (L2#1) asks that left hand holds cup 1
        """
        from confab.why import because, find_step

        found = find_step(self.plan, step, self.labels)
        return because(self.plan, found, self.purposes[found.path], self.labels)

    def why_not(self, asked: str, instead: int | str | None = None, seconds: float | None = None) -> WhyNot:
        """Return why something else isn't done: what it lacks, or what plan follows from it and what that costs more.

        Parameters
        ----------
        asked : str
            ``cup2 LOCATION location8``, also with ``by left_hand``; or ``B2_PICK right_hand cup1``, ``B2_PICK hand=right_hand``.
        instead : int or str, optional
            In the place of which step; if left out, of the most similar one where it can be done.
        seconds : float, optional
            Limit of each planning call.
        """
        from confab.why import find_step, why_not

        number("seconds", seconds, "seconds as a number, e.g. 5")
        labels = self.labels

        def ask(problem: Problem) -> Outcome:
            return solve(Request(problem, DEFAULT_MODE, Limits(seconds=seconds)))

        def replan(goals: Sequence[str]) -> tuple[Problem, Outcome, Labels]:
            other = self.scene.plan(goals, time_limit=seconds)
            return other.problem, other.outcome, other.labels

        place = None if instead is None else find_step(self.plan, instead, labels)
        return why_not(asked, self.problem, self.plan, labels, ask, replan, place)

    def explain(self) -> Account:
        """Return why each step of the plan is there; or, where there is no plan, why."""
        from confab.show import summary
        from confab.why import Account, account

        headline = summary(self.outcome)
        return account(self.plan, self.purposes, self.labels, headline) if self.solved else Account(headline)

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return self.outcome.status is Status.SOLVED

    def json(self) -> dict[str, Any]:
        """Return the result as JSON data (docs/command-line.md)."""
        return {**outcome_json(self.scene.iri, self.outcome, self.seconds), "queries": self.queries}

    def graph(self) -> networkx.DiGraph[tuple[int, ...]]:
        """Return the plan as a directed graph: a node per step (by path), edges to sub-steps and to what follows."""
        import networkx

        graph: networkx.DiGraph[tuple[int, ...]] = networkx.DiGraph()
        for step in self.plan.walk():
            graph.add_node(step.path, label=str(step), level=step.level, id=step.id)
            graph.add_edges_from(((step.path, below.path) for below in step.steps), kind="refines")
            graph.add_edges_from(((a.path, b.path) for a, b in pairwise(step.steps)), kind="then")
        graph.add_edges_from(((a.path, b.path) for a, b in pairwise(self.plan.steps)), kind="then")
        return graph

    def save(self, path: str | Path) -> Path:
        """Write the result as JSON and return where."""
        from reasoner.files import write_whole

        write_whole(Path(path), json.dumps(self.json(), indent=1, ensure_ascii=False) + "\n")
        return Path(path)

    def __rich__(self) -> Tree | str:
        """Return a tree for rich."""
        from confab.show import plan_tree, summary

        return plan_tree(self.plan, summary(self.outcome)) if self.solved else summary(self.outcome)

    def __repr__(self) -> str:
        """Return the summary and the steps of the most abstract level."""
        from confab.show import summary

        steps = self.outcome.plan.steps if self.outcome.plan else ()
        return "\n".join([summary(self.outcome), *(f"  {step}" for step in steps)])

    def report(self, path: str | Path) -> Path:
        """Write the plan, with its reasons, as one HTML page, and return where."""
        from confab.report.page import report_html, write_report

        return write_report(path, report_html(self.scene, self))

    def _repr_html_(self) -> str:
        from confab.report.notebook import of_result

        return of_result(self)


def _sentence(facts: Iterable[Fact]) -> str:
    return "; ".join(map(str, facts))


def load(source: str | Path, scene: str | None = None, deadline: Deadline | None = None) -> Scene:
    """Load a scene: a shipped name, a file of RDF, or the URL of a SPARQL 1.1 endpoint.

    Parameters
    ----------
    source : str or Path
    scene : str, optional
        IRI of the scene in an endpoint that holds several.
    deadline : Deadline, optional
        When loading ends, done or not.

    Raises
    ------
    KnowledgeError
        No such scene; broken syntax; an endpoint that is down, or slow, or none. A file whose imports can't be found, or that
        declares no ontology, can be asked; planning in it says what is missing.
    LimitError
        The deadline came first.

    Examples
    --------
    >>> load("beverage-serving").query("SELECT ?o ?l WHERE { ?o k:location ?l } ORDER BY ?o")[0]
    ('bottle1', 'location4')
    """
    begin = perf_counter()
    if str(source).startswith(("http://", "https://")):
        from reasoner.graph.stores import connect

        return Scene(connect(str(source), scene), {"load": perf_counter() - begin})
    graph = load_graph(source, deadline=deadline, tolerant=True)
    with graph.until(deadline or Deadline()):
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
