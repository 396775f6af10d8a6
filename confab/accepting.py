"""Conversion of arguments with several forms, for example a plan, an object with a plan, or the name of a plan file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, Protocol, SupportsIndex, TypeAlias, overload

from confab import ontology
from confab.interchange import read_plan
from confab.planner.plan import Plan
from confab.reasoner import kinds
from confab.reasoner.files import STDOUT
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.limits import Deadline
from confab.reasoner.names import nearest
from confab.reasoner.possible import ImpossibleStateError
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE


class HasPlan(Protocol):
    """An object with a plan, such as a result, an execution or a report."""

    @property
    def plan(self) -> Plan:
        """The plan."""


AnyPlan: TypeAlias = "Plan | HasPlan | str | Path"
"""A plan, an object with a plan, or the path of a file that ``confab plan --json`` wrote."""
Facts: TypeAlias = "str | Iterable[str | tuple[str, ...]] | Mapping[str, str] | Mapping[tuple[str, str], str] | None"
"""One or several facts: a text like ``cup2 LOCATION location8``, several texts, a tuple of the words of a fact, or a mapping of
symbols to values.
"""


MOST_NOISE = 0.05
"""Maximum standard deviation of the noise of a measurement, in metres."""


class Stated(list[str]):
    """An immutable list of facts as texts. An index like ``facts["cup1 LOCATION"]`` selects the value of a symbol."""

    @overload
    def __getitem__(self, index: SupportsIndex | str) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    @overload
    def __getitem__(self, index: tuple[str, ...]) -> str: ...

    def __getitem__(self, index: SupportsIndex | str | slice | tuple[str, ...]) -> str | list[str]:
        """Return the fact at an index, the facts of a slice, or the value of a symbol."""
        if isinstance(index, tuple):
            index = " ".join(index)
        if not isinstance(index, str):
            return super().__getitem__(index)
        values = self._values()
        if index not in values:
            about = [symbol for symbol in values if index in symbol.split()]
            known = f"wanted an object and its situation type: {', '.join(about or [*values][:3])}"
            raise KeyError(f"no fact at '{index}'{nearest(index, about or values, known)}")
        return values[index]

    def _values(self) -> dict[str, str]:
        return dict(fact.rsplit(" ", 1) for fact in self)

    def keys(self) -> list[str]:
        """Return the symbols of the facts, so that ``dict(scene.facts)`` is a dictionary of their values."""
        return [*self._values()]

    def __call__(self) -> Stated:
        """Return the list itself, so that ``scene.facts()`` is the same as ``scene.facts``."""
        return self

    def __reduce__(self) -> tuple[type[Stated], tuple[list[str]]]:
        """Return the form in which the object is copied and pickled."""
        return type(self), ([*self],)

    if not TYPE_CHECKING:

        def _edited(self, *_: object) -> NoReturn:
            raise TypeError(
                "this list is a copy; scene.with_fact(FACT) and scene.with_goal(FACT) return a changed scene"
            )

        append = extend = insert = remove = pop = clear = __setitem__ = __delitem__ = __iadd__ = _edited


def plan_of(given: AnyPlan, problem: Problem) -> Plan:
    """Return the plan that an argument contains; a plan file is read with the names of `problem`.

    Raises
    ------
    KnowledgeError
        The argument contains no plan.
    """
    if isinstance(given, Plan):
        return given
    if isinstance(given, str | Path):
        return read_plan(Path(given), problem)
    found = getattr(given, "plan", None)
    if not isinstance(found, Plan):
        raise KnowledgeError(
            f"wanted a plan, an object with a plan (a result, an execution) or a file's name; got {type(given).__name__}"
        )
    return found


def check_goal(scene: str, problem: Problem) -> None:
    """Raise `KnowledgeError` if a problem has no behaviour, has no goal, or has a goal whose value isn't in its situation type."""
    if not problem.domain.behaviors:
        raise KnowledgeError(f"{scene} has no behaviours, so that no plan is possible; import a domain with behaviours")
    if not problem.goal:
        raise KnowledgeError(f"{scene} has no task with goals; plan in a scene that has one, or give a goal")
    allowed = {name: {*problem.classes.get(s.range, ()), TRUE, FALSE} for name, s in problem.domain.situations.items()}
    for symbol, value in problem.goal.items():
        counted = problem.domain.situations[symbol.situation].quantity is not None
        if not counted and value not in allowed[symbol.situation]:
            values = allowed[symbol.situation] - {TRUE, FALSE}
            raise KnowledgeError(
                f"the goal of {symbol} is {value}, which is no value of this symbol{nearest(value, values)}"
            )


@contextmanager
def possible() -> Iterator[None]:
    """Turn an `ImpossibleStateError` of the code inside the ``with`` statement into a `KnowledgeError`."""
    try:
        yield
    except ImpossibleStateError as error:
        raise KnowledgeError(str(error)) from error


def several(given: Facts) -> list[str]:
    """Return facts as a list of texts.

    The argument `given` is a text, several texts, a tuple of the words of a fact, or a mapping of symbols to values.

    Raises
    ------
    KnowledgeError
        The argument isn't text, or contains an invalid value.

    Examples
    --------
    >>> several("cup2 LOCATION = location8"), several(("cup2", "LOCATION", "location8"))
    (['cup2 LOCATION location8'], ['cup2 LOCATION location8'])
    >>> several(None), several([("cup2", "LOCATION", "location8")]), several({("cup2", "LOCATION"): "location8"})
    ([], ['cup2 LOCATION location8'], ['cup2 LOCATION location8'])
    >>> several({"cup2 LOCATION": "location8"}), several(["cup2 LOCATION location8", "cup1 LOCATION location7"])
    (['cup2 LOCATION location8'], ['cup2 LOCATION location8', 'cup1 LOCATION location7'])
    """
    if given is None:
        return []
    if isinstance(given, Mapping):
        symbols = [(symbol,) if isinstance(symbol, str) else symbol for symbol in given]
        for symbol in symbols:
            if not isinstance(symbol, tuple):
                wanted = "'cup2 LOCATION' as a key, or texts like 'cup2 LOCATION location8' and 'after=28 cup2 LOCATION location8'"
                raise KnowledgeError(f"got the key {symbol!r}; wanted {wanted}")
        given = [(*symbol, value) for symbol, value in zip(symbols, given.values(), strict=True)]
    parts = [given] if isinstance(given, str) or not isinstance(given, Iterable) else list(given)
    texts = [" ".join(map(str, part)) if isinstance(part, tuple | list) else part for part in parts]
    for text in texts:
        if not isinstance(text, str):
            raise KnowledgeError(f"wanted a text like 'cup2 LOCATION location8', or several; got {text!r}")
    if len(texts) > 2 and not any(" " in text for text in texts):
        texts = [" ".join(texts)]
    return [text.replace(" = ", " ") for text in texts]


def number(name: str, given: object, wanted: str = "a number") -> None:
    """Raise `KnowledgeError` unless the argument of a parameter is a number or None.

    Examples
    --------
    >>> number("time_limit", 2.5)
    >>> number("time_limit", "5", "seconds as a number")
    Traceback (most recent call last):
    confab.reasoner.graph.knowledge.KnowledgeError: time_limit='5' is no number; wanted seconds as a number
    """
    if given is not None and (isinstance(given, bool) or not isinstance(given, Real) or given != given):
        raise KnowledgeError(f"{name}={given!r} is no number; wanted {wanted}")


def check_noise(noise: float) -> None:
    """Raise `KnowledgeError` unless the noise of a measurement is a number from 0 to `MOST_NOISE`.

    Examples
    --------
    >>> check_noise(-1)
    Traceback (most recent call last):
    confab.reasoner.graph.knowledge.KnowledgeError: noise=-1; wanted metres from 0 to 0.05
    """
    number("noise", noise, "metres, e.g. 0.002")
    if not 0 <= noise <= MOST_NOISE:
        raise KnowledgeError(f"noise={noise:g}; wanted metres from 0 to {MOST_NOISE}")


def shipped_queries(graph: KnowledgeGraph | None = None, episodes: bool = True) -> dict[str, str]:
    """Return the shipped queries by name.

    If `graph` is given, queries with prefixes that the graph lacks are left out; without `episodes`, queries about episodes are
    left out.
    """
    from confab.reasoner.graph.query_process import unknown_prefixes

    files = sorted((ontology.ROOT / "questions").glob("**/*.rq" if episodes else "*.rq"))
    texts = {file.stem: file.read_text(encoding="utf-8") for file in files}
    return {name: text for name, text in texts.items() if graph is None or not unknown_prefixes(graph, text)}


def check_seconds(name: str, given: object) -> None:
    """Raise `KnowledgeError` unless a time limit is a positive number of seconds, a `Deadline` or None.

    Examples
    --------
    >>> check_seconds("time_limit", -1)
    Traceback (most recent call last):
    confab.reasoner.graph.knowledge.KnowledgeError: time_limit=-1; wanted more than 0 seconds
    """
    if isinstance(given, Deadline):
        return
    number(name, given, "seconds as a number, e.g. 5")
    if isinstance(given, Real) and not float(given) > 0:
        raise KnowledgeError(f"{name}={given}; wanted more than 0 seconds")


TURTLE, JSON = ("Turtle", ".ttl"), ("JSON", ".json")
ENDINGS: Mapping[str, tuple[str, ...]] = {
    kinds.PLAN: JSON,
    kinds.VERDICTS: JSON,
    kinds.EPISODE: ("Turtle or JSON", ".ttl", ".json"),
    kinds.MEMORY: ("Turtle", ".ttl", ""),
    kinds.REPORT: ("HTML", ".html", ".htm"),
    kinds.FILM: ("a film", ".mp4", ".gif"),
    **dict.fromkeys((kinds.GENERATED, kinds.SAVED, kinds.IMPORTED, kinds.CONVERTED), TURTLE),
}
"""The form in which content of a kind is written, and the endings of file names for this form."""


def named_for(kind: str, given: str | Path) -> Path:
    """Return the path of a file to write; devices may have any name.

    Raises
    ------
    KnowledgeError
        The ending of the name stands for another form than the form of content of this kind.

    Examples
    --------
    >>> named_for("a plan", "plan.pdf")
    Traceback (most recent call last):
    confab.reasoner.graph.knowledge.KnowledgeError: plan.pdf: this is written as JSON; wanted a name that ends in .json
    """
    path, (form, *endings) = Path(given), ENDINGS.get(kind, ("",))
    special = path == STDOUT or (path.exists() and not path.is_file())
    if endings and not special and path.suffix.lower() not in endings:
        wanted = " or ".join(filter(None, endings))
        raise KnowledgeError(f"{path}: this is written as {form}; wanted a name that ends in {wanted}")
    return path


def sparql_of(given: str | Path, graph: KnowledgeGraph | None = None) -> str:
    """Return the text of a SPARQL query that is given as a text, as a file, or by the name of a shipped query.

    Raises
    ------
    KnowledgeError
        The file or the shipped query doesn't exist, or the graph lacks the vocabulary of the shipped query.

    Examples
    --------
    >>> sparql_of("where-is-everything").splitlines()[-1]
    'SELECT ?object ?place WHERE { ?object k:location ?place } ORDER BY ?object'
    """
    if isinstance(given, Path):
        given = str(given)
    if not isinstance(given, str):
        raise KnowledgeError(f"wanted SPARQL as text, a .rq file or the name of a shipped query; got {given!r}")
    if not given.strip():
        raise KnowledgeError("the query is empty; wanted SPARQL text, a .rq file or the name of a shipped query")
    try:
        given = given.encode("utf-8", "surrogateescape").decode("utf-8")
    except UnicodeError as error:
        raise KnowledgeError(f"the query isn't in UTF-8: {error}") from error
    if any(sign in given for sign in "{}?\n"):
        return given
    path = Path(given)
    if path.is_dir():
        raise KnowledgeError(f"{given}: is a folder; wanted SPARQL text or a .rq file")
    if path.is_file():
        return path.read_text(encoding="utf-8", errors="replace")
    if path.suffix or "/" in given:
        raise KnowledgeError(f"{given}: no such file; wanted SPARQL text or a .rq file")
    ready = shipped_queries(graph)
    if given in ready:
        return ready[given]
    if given in shipped_queries():
        text = f"the shipped query '{given}' uses a vocabulary that this scene doesn't import"
        raise KnowledgeError(f"{text}; shipped queries for this scene: {', '.join(ready)}")
    if given.replace("-", "").isalpha() or "-".join(given.split()) in ready:
        raise KnowledgeError(f"no shipped query '{given}'{nearest(given, ready)} (shipped: {', '.join(ready)})")
    return given
