"""The knowledge in a scene: its objects, behaviours, facts and goals, SPARQL queries, and edits."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, cast, overload

import pyoxigraph as ox

from confab.accepting import Facts, Stated, named_for, several, sparql_of
from confab.reasoner.graph.inference import infer
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph, text
from confab.reasoner.kinds import SAVED, stamped
from confab.reasoner.limits import checked, within
from confab.reasoner.names import GUESSING, Named, Names, RightNames, local_name, nearest, right_names
from confab.reasoner.problem import Problem
from confab.reasoner.reading.goals import parse_fact, some_of
from confab.reasoner.reading.problem import Reading, read, read_names
from confab.reasoner.symbols import TRUE, Behavior, Fact
from confab.table import Table

if TYPE_CHECKING:
    import rdflib
    from owlready2 import World

    from confab.reasoner.embodiment.values import Embodiment
    from confab.reasoner.graph.mirror import Mirror
    from confab.reasoner.graph.query_process import QueryLimits
    from confab.reasoner.reading.rows import OntologySchema

GUESSING.append("confab.guessing")
log = logging.getLogger(__name__)
S = TypeVar("S", bound="Known")
TITLE = """SELECT ?title {{ {{ <{0}> <http://purl.org/dc/terms/title> ?title . BIND(0 AS ?rank) }}
  UNION {{ <{0}> rdfs:label ?title . BIND(1 AS ?rank) }} }}
  ORDER BY ?rank DESC(LANGMATCHES(LANG(?title), "en")) ?title LIMIT 1"""


@right_names("a scene", "confab.load(SCENE)")
@dataclass
class Known(metaclass=RightNames):
    """A scene that can be read, queried and edited. The subclass `confab.scene.Scene` adds planning and acting.

    Attributes
    ----------
    knowledge : KnowledgeGraph
        The store with the triples of the scene.
    seconds : mapping of stage to seconds
        The durations of the stages of loading.
    """

    knowledge: KnowledgeGraph

    def __post_init__(self) -> None:
        """Raise `TypeError` if the argument isn't a knowledge graph but, for instance, the name of a scene."""
        if not isinstance(self.knowledge, KnowledgeGraph):
            raise TypeError(
                f"a scene is made of a knowledge graph; got {self.knowledge!r}: use confab.load({self.knowledge!r})"
            )

    seconds: dict[str, float] = field(default_factory=dict)

    _edited: bool = field(default=False, init=False, repr=False, compare=False)

    _told: bool = field(default=False, init=False, repr=False, compare=False)

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling and copying.

        The state has no cached values; the copy reads these values from the graph again.
        """
        self.settle()
        return {"knowledge": self.knowledge, "seconds": self.seconds, "_edited": False, "_told": self._told}

    def __getitem__(self, name: object) -> NoReturn:
        """Raise a `TypeError` whose message names the properties to use.

        Python also calls this method for an iteration over the scene, and for the operator ``in``.
        """
        raise TypeError("a scene has no items; use objects, facts, goals or behaviors")

    @cached_property
    def reading(self) -> Reading:
        """The whole scene as a problem, with its schema, names and IRIs.

        The method `plan` normally reads only the individuals that the task can need.
        """
        self.settle()
        self.knowledge.require_whole()
        return read(self.knowledge)

    def read_whole(self, schema: OntologySchema) -> Problem:
        """Return the property `problem`; `schema` is the schema of the scene, which isn't read again."""
        if "reading" not in self.__dict__:
            self.reading = read(self.knowledge, schema)
            self.knowledge.confirm()
        return self.problem

    @property
    def iri(self) -> str:
        """The IRI of the scene's ontology."""
        return self.knowledge.scene

    @property
    def title(self) -> str:
        """The title of the scene: ``dcterms:title`` or ``rdfs:label`` of its ontology, otherwise the last part of its IRI.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").title
        'Beverage serving'
        """
        rows = self.knowledge.select(TITLE.format(self.iri))
        return text(rows[0][0]) if rows else local_name(self.iri)

    @property
    def problem(self) -> Problem:
        """The planning problem of the whole scene: objects, behaviours, facts and goals."""
        return self.reading.problem

    @cached_property
    def names(self) -> Names:
        """The table of short names and IRIs.

        If the scene can't be read as a problem, the table has all terms in the scene's files.
        """
        try:
            if "reading" in self.__dict__:
                return self.reading.names
            self.settle()
            self.knowledge.require_whole()
            return read_names(self.knowledge)
        except KnowledgeError:
            quads = self.knowledge.store
            return Names(term.value for q in quads for term in q.triple if isinstance(term, ox.NamedNode))

    @property
    def objects(self) -> dict[str, str]:
        """The objects by name, each with its most specific class.

        Examples
        --------
        >>> import confab
        >>> list(confab.load("beverage-serving").objects.items())[:3]
        [('bottle1', 'Bottle'), ('bottle2', 'Bottle'), ('cup1', 'Cup')]
        """
        self.settle()
        problem = self.problem
        spoken_of = {symbol.arguments[0]: "" for symbol in problem.initial if symbol.arguments}
        names = dict.fromkeys((*problem.classes.get("Object", ()), *sorted(spoken_of)))
        kinds = {name: [kind for kind, members in problem.classes.items() if name in members] for name in names}
        above = {name: {sup for kind in of for sup in problem.parents.get(kind, ())} for name, of in kinds.items()}
        own = {name: " ".join(k for k in of if k not in above[name] and "|" not in k) for name, of in kinds.items()}
        found = sorted(own.items(), key=lambda pair: pair[1])
        return Named("object", found, "those of a class are in problem.classes")

    @property
    def behaviors(self) -> dict[str, Behavior]:
        """The behaviours by name, in the order of their declaration, with parameters, conditions and effects.

        Examples
        --------
        >>> import confab
        >>> [*confab.load("beverage-serving").behaviors][:2]
        ['B1_MOVE', 'B1_POUR']
        """
        self.settle()
        return Named("behaviour", self.problem.domain.behaviors)

    @property
    def facts(self) -> Stated:
        """The initial facts as texts, in the notation of `with_fact`: stated facts, default values, and derived amounts.

        A boolean that isn't stated and has no default is false. The true booleans that rules define are in `derived_facts`.

        Examples
        --------
        >>> import confab
        >>> facts = confab.load("beverage-serving").facts
        >>> facts[:2], facts["cup1 LOCATION"]
        (['bottle1 BEVERAGE beverage1', 'bottle1 LOCATION location4'], 'location2')
        """
        self.settle()
        return Stated(sorted(str(Fact(symbol, value)) for symbol, value in self.problem.initial.items()))

    @property
    def derived_facts(self) -> Stated:
        """The facts that definitions and rules make true in the initial state, as texts.

        Examples
        --------
        >>> import confab
        >>> confab.load("packing-small").derived_facts[:2]
        ['casket INSIDE chest true', 'casket INSIDE hall true']
        """
        from confab.following import defined_in, following

        self.settle()
        found = following(self.problem, defined_in(self.reading))
        return Stated(sorted(str(Fact(symbol, TRUE)) for symbol in found))

    @property
    def goals(self) -> Stated:
        """The goals as texts, in the notation of `with_goal` and `plan`.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").goals[:2]
        ['bottle1 LOCATION location4', 'bottle2 LOCATION location3']
        """
        self.settle()
        return Stated(sorted(str(Fact(symbol, value)) for symbol, value in self.problem.goal.items()))

    def with_fact(self: S, *facts: Facts) -> S:
        """Return a copy of the scene with some facts replaced. A fact is given as one text, or as a tuple of its words.

        Raises
        ------
        KnowledgeError
            A term of a fact is unknown, or the scene is at a SPARQL endpoint.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").with_fact("cup1 LOCATION location7").plan().plan.length
        {1: 3, 2: 8, 3: 26}
        """
        from confab.reasoner.reading.restating import with_facts

        return self._restated("--fact", with_facts, facts)

    def with_goal(self: S, *goals: Facts) -> S:
        """Return a copy of the scene with some goals replaced. A goal is given as one text, or as a tuple of its words.

        Raises
        ------
        KnowledgeError
            A term of a goal is unknown, or the scene is at a SPARQL endpoint.

        Examples
        --------
        >>> import confab
        >>> confab.load("beverage-serving").with_goal("cup2 LOCATION location8").plan().plan.length
        {1: 5, 2: 12, 3: 38}
        """
        from confab.reasoner.reading.restating import with_goals

        return self._restated("--goal", with_goals, goals)

    def without_goal(self: S, *goals: Facts) -> S:
        """Return a copy of the scene without some of its goals; without an argument, or with ``all``, without any goal.

        A goal is given by its first words: ``cup1`` stands for all goals of cup1, ``cup1 LOCATION`` for one goal.

        Raises
        ------
        KnowledgeError
            The scene has no such goal, or is at a SPARQL endpoint.

        Examples
        --------
        >>> import confab
        >>> scene = confab.load("beverage-serving")
        >>> scene.without_goal("cup1").goals[2:]
        ['cup2 BEVERAGE beverage2', 'cup2 LOCATION location5']
        >>> scene.without_goal().plan("cup2 LOCATION location8").plan.length
        {1: 2, 2: 4, 3: 12}
        """
        from confab.reasoner.reading.restating import without_goals

        goal_facts = {str(fact): fact for fact in (Fact(*one) for one in self.problem.goal.items())}
        found = dict[str, Fact]()
        for given in [each for one in goals for each in several([one] if isinstance(one, tuple) else one)] or ["all"]:
            meant = [goal for goal in goal_facts if given == "all" or f"{goal} ".startswith(f"{given} ")]
            if not meant and given != "all":
                known = f"the goals are: {'; '.join(goal_facts)}" if goal_facts else "it has no goals"
                raise KnowledgeError(f"the scene has no goal '{given}'{nearest(given, goal_facts, known)}")
            found |= {goal: goal_facts[goal] for goal in meant}
        return self._copied("--without-goal", without_goals, [*found.values()])

    def _restated(
        self: S,
        option: str,
        change: Callable[[KnowledgeGraph, Reading, list[Fact]], KnowledgeGraph],
        facts: Sequence[Facts],
    ) -> S:
        self.settle()
        single = all(isinstance(fact, str) for fact in facts)
        texts = several(cast("Facts", facts)) if single else [text for fact in facts for text in several(fact)]
        return self._copied(option, change, [Fact(*parse_fact(self.problem, text)) for text in texts])

    def _copied(
        self: S, option: str, change: Callable[[KnowledgeGraph, Reading, list[Fact]], KnowledgeGraph], facts: list[Fact]
    ) -> S:
        copy = change(self.knowledge, self.reading, facts)
        copy.changes = (*copy.changes, *(f"{option}={fact}" for fact in facts))
        infer(copy)
        return type(self)(copy, dict(self.seconds))

    def save(self, path: str | Path) -> Path:
        """Write the scene with all ontologies that it imports into one Turtle file, which `load` accepts, and return the path.

        The file has the stated facts, also those of `with_fact` and of changes in `graph`, without inferred facts.

        Raises
        ------
        KnowledgeError
            The name doesn't end in ``.ttl``, or the scene is at a SPARQL endpoint.
        OSError
            The file can't be written, or contains anything but an unchanged saved scene.

        Examples
        --------
        >>> import confab
        >>> from tempfile import TemporaryDirectory
        >>> scene = confab.load("beverage-serving").with_fact("cup1 LOCATION location7")
        >>> with TemporaryDirectory() as folder:
        ...     confab.load(scene.save(f"{folder}/changed.ttl")).plan().plan.length
        {1: 3, 2: 8, 3: 26}
        """
        from confab.reasoner.files import write_whole

        path = named_for(SAVED, path)
        self.settle()
        write_whole(path, stamped(SAVED, [self.knowledge.turtle()]))
        return path

    @cached_property
    def graph(self) -> rdflib.Graph:
        """The scene's triples as an rdflib graph. Changes of the graph take effect in `query` and `plan`."""
        from confab.reasoner.graph.rdflib_graph import rdflib_graph

        self.settle()
        return rdflib_graph(self.knowledge, self._forget)

    @cached_property
    def embodiment(self) -> Embodiment:
        """The embodiment of the scene: robots, furniture, shapes, skills and perceivers.

        Raises
        ------
        KnowledgeError
            The scene states that it has no geometry.
        EmbodimentError
            A statement that physics needs is missing. The message names the statement.
        """
        from confab.reasoner.embodiment.reading import read_embodiment

        self.knowledge.require_whole()
        if self.knowledge.select("SELECT ?why WHERE { ?ontology :symbolicOnly ?why }"):
            raise KnowledgeError(
                f"{self.iri} is symbolic only: it states reach without geometry, so physics can't verify it"
            )
        return read_embodiment(self.knowledge.store, self.names.short, self.knowledge.folders)

    @cached_property
    def _mirror(self) -> Mirror:
        from confab.reasoner.graph.mirror import Mirror

        return Mirror(self.knowledge)

    @property
    def owl(self) -> World:
        """The scene as an owlready2 world. Changes of the owlready2 world take effect in `query` and `plan`."""
        return self._mirror.world

    def _forget(self) -> None:
        """Discard the values that were read before an edit."""
        for name in ("reading", "names", "embodiment"):
            self.__dict__.pop(name, None)
        self._edited = True

    def settle(self) -> None:
        """Transfer edits of the owlready2 world into the graph, and repeat the inference after any edit."""
        if "_mirror" in self.__dict__ and self._mirror.pull():
            self.__dict__.pop("graph", None)
            self._forget()
        if self._edited:
            self._edited = False
            infer(self.knowledge)

    def query(self, sparql: str | Path, limits: QueryLimits | None = None) -> Table:
        """Return the result of a SPARQL 1.1 query (SELECT, ASK or CONSTRUCT) as a table.

        The query is given as text, as a ``.rq`` file, or by the name of a shipped query (``ontology/questions``). The graph has
        stated and inferred facts. Default values aren't in the graph, but only in the property `facts`.

        A query can use the prefixes of the scene's file and of its imports. If two files declare a prefix, the scene's file has
        precedence. ``:name`` denotes a term of the core ontology if the scene's namespace has no such name. If the answer is
        false, empty or 0, a warning names the terms of the query that the graph doesn't have. The query runs in a separate
        process (`confab.reasoner.graph.query_process`).

        Raises
        ------
        KnowledgeError
            The query isn't valid SPARQL (the message states line and column), or it queries another endpoint without
            permission.
        LimitError
            The query exceeds a limit of time, rows or memory.

        Examples
        --------
        >>> import confab
        >>> scene = confab.load("beverage-serving")
        >>> scene.query("SELECT ?where WHERE { :cup1 k:location ?where }")[0]
        ('location2',)
        >>> bool(scene.query("ASK { :cup1 k:location t:location7 }"))
        False
        """
        with within(limits.seconds if limits is not None else None):
            from confab.reasoner.graph.query_process import ask, unheard_of

            sparql = sparql_of(sparql, self.knowledge)
            kind, columns, found = ask(self._asked(sparql, limits), sparql, limits)
            nothing = not found if kind == "truth" else all(_is_zero(term) for row in found for term in row)
            if nothing and not self.knowledge.remote and (unheard := unheard_of(self.knowledge, sparql)):
                log.warning("confab: the scene has no term %s", ", ".join(unheard))
        if kind == "truth":
            return Table(("answer",), ((str(found).lower(),),), truth=found)
        columns = ["subject", "predicate", "object"] if kind == "triples" else columns
        rows = tuple(tuple(self._cell(term) for term in row) for row in found)
        return Table(tuple(columns), rows, tuple(map(tuple, found)))

    def with_episodes(self: S, *files: str | Path) -> S:
        """Return a copy of the scene with saved episodes, for queries.

        Raises
        ------
        KnowledgeError
            A file contains no episode, two files contain episodes of the same name, or the scene is at a SPARQL endpoint.
        """
        if not files:
            return self
        from confab.reasoner.memory.episodes import read_episodes
        from confab.reasoner.reading.restating import copied

        self.settle()
        copy = copied(self.knowledge)
        read_episodes(copy, map(Path, files))
        return type(self)(copy, dict(self.seconds))

    def _asked(self, sparql: str, limits: QueryLimits | None) -> KnowledgeGraph:
        """Return the graph for a query, with the derived facts that the query names; warn once if imports are missing."""
        from confab.following import write_following
        from confab.reasoner.graph.query_process import QueryLimits
        from confab.reasoner.reading.applicable import SITUATION, write_situation

        self.settle()
        if SITUATION in sparql:
            write_situation(self.knowledge, self.reading)
        if not self.knowledge.remote:
            # A scene without a valid planning problem can be queried.
            with suppress(KnowledgeError), within((limits or QueryLimits()).seconds):
                write_following(self.knowledge, lambda: self.reading, sparql)
        for fault in () if self._told else self.knowledge.faults:
            log.warning("confab: %s; the scene can be queried, but not planned in", fault)
        self._told = True
        return self.knowledge

    @overload
    def construct(self, sparql: str, path: None = None, limits: QueryLimits | None = None) -> rdflib.Graph: ...

    @overload
    def construct(self, sparql: str, path: str | Path, limits: QueryLimits | None = None) -> int: ...

    def construct(
        self, sparql: str, path: str | Path | None = None, limits: QueryLimits | None = None
    ) -> rdflib.Graph | int:
        """Return the triples of a CONSTRUCT query.

        If a path is given, write the triples into a file that imports this scene, and return the number of triples.

        Raises
        ------
        KnowledgeError, LimitError
            The query fails as described in `query`, or isn't a CONSTRUCT query.
        """
        sparql = sparql_of(sparql, self.knowledge)
        if path is not None:
            from confab.reasoner.graph.construct import write_construct

            return write_construct(self._asked(sparql, limits), sparql, Path(path), limits)
        import rdflib

        return rdflib.Graph().parse(data=self.query(sparql, limits).turtle(self.knowledge.spoken), format="turtle")

    def applicable_query(self, behavior: str) -> str:
        """Return the SPARQL query for the arguments with which a behaviour is applicable.

        The method `query` answers the returned query for the initial state.
        """
        from confab.reasoner.graph.query_process import standing_alone
        from confab.reasoner.reading.applicable import applicable_query
        from confab.reasoner.reading.quantification import behavior_named

        query = applicable_query(self.knowledge, self.reading, behavior_named(self.reading, behavior))
        return standing_alone(self.knowledge, query)

    def update_of(self, behavior: str) -> str:
        """Return a behaviour as a SPARQL update, a notation that ontologies may contain (docs/authoring.md).

        Raises
        ------
        KnowledgeError
            The behaviour doesn't exist, or has parts that an update can't express.
        """
        from confab.reasoner.reading.quantification import behavior_named
        from confab.reasoner.updates.converting import update_of

        name = behavior_named(self.reading, behavior).name
        try:
            return update_of(self.knowledge, self.reading.schema, self.names.iri(name))
        except ValueError as error:
            raise KnowledgeError(f"{name} can't be shown as an update: {error}") from error

    def quantifying_query(self, behavior: str) -> str:
        """Return the SPARQL query that quantifies a behaviour, with a row for each assignment of individuals to its parameters."""
        from confab.reasoner.graph.query_process import standing_alone
        from confab.reasoner.reading.quantification import behavior_named, query_for

        return standing_alone(self.knowledge, query_for(self.reading, behavior_named(self.reading, behavior)))

    def affordances(self, of: str | None = None) -> Table:
        """Return a table of the behaviours that an object affords in the initial state; ``all`` or None stands for all objects.

        Raises
        ------
        KnowledgeError
            The object doesn't exist.
        """
        from confab.planner.affordances import affordances

        known = self.problem.individuals
        if of not in (None, "all", *known):
            raise KnowledgeError(
                f"unknown object '{of}'{nearest(str(of), known, f'known: {some_of([*self.objects])}')}"
            )
        found = affordances(self.problem, of=None if of == "all" else of)
        return Table(
            ("object", "behavior", "arguments", "situation", "effect"),
            tuple(
                (a.object, a.behavior, " ".join(a.arguments), _sentence(a.situation), _sentence(a.effect))
                for a in checked(found, "listing affordances")
            ),
        )

    def _cell(self, term: Any) -> str | None:
        if term is None:
            return None
        value = str(getattr(term, "value", term))
        return self.names.short(value) if type(term).__name__ == "NamedNode" else value

    def __repr__(self) -> str:
        """Return a description of the scene in one line."""
        problem = self.problem
        counts = f"{len(self.objects)} objects, {len(problem.initial)} facts, {len(problem.goal)} goals"
        return f"Scene({self.iri}: {counts})"


def _is_zero(term: Any) -> bool:
    return term is None or getattr(term, "value", "") == "0"


def _sentence(facts: Iterable[Fact]) -> str:
    return "; ".join(map(str, facts))
