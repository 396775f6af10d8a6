"""Execution of users' queries in a separate process, so that their costs and failures don't affect this process.

A query may have more rows than fit into memory, and a deeply nested query crashes the SPARQL parser. The planner's own queries are
executed in this process.
"""

from __future__ import annotations

import math
import pickle
import re
import resource
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from subprocess import PIPE, Popen
from threading import Event, Lock, Timer
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeAlias

import pyoxigraph as ox

from confab.reasoner.graph.knowledge import BASE, DERIVED, GRAPHS, KnowledgeError, KnowledgeGraph, Row, text
from confab.reasoner.limits import LimitError, check, current
from confab.reasoner.names import nearest
from confab.reasoner.vocabulary import CORE
from confab.reasoner.workers import MOST_SECONDS, end, in_force, kill, start

if TYPE_CHECKING:
    from typing_extensions import Buffer

UNION = tuple(BASE + name for name in (*GRAPHS, DERIVED))
PROCESS = Path(__file__).with_name("query_server.py")
SECONDS, ROWS, MEGABYTES = 60.0, 100_000, 2_000
TEXTS = re.compile(
    r'"""(?:[^\\]|\\.)*?"""|\'\'\'(?:[^\\]|\\.)*?\'\'\'|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|<[^<>"{}|^`\\\s]*>|#[^\n]*',
    re.DOTALL,
)
"""Pattern of the parts of a query in which words aren't keywords or names: literals, IRIs and comments."""
WORDS = re.compile(
    rf"(?P<text>{TEXTS.pattern})|(?<![\w.:-])(?P<prefix>[A-Za-z][\w-]*)?:(?P<name>[A-Za-z_][\w-]*)?", re.DOTALL
)
"""Pattern of a literal, an IRI, a comment or a prefixed name."""
UPDATE = re.compile(
    r"^\s*(PREFIX\s[^\n]*>\s*)*(INSERT|DELETE|WITH|LOAD|CLEAR|CREATE|DROP|COPY|MOVE|ADD)\b", re.IGNORECASE
)
"""Pattern for the beginning of a SPARQL update."""
DECLARED = re.compile(r"\bPREFIX\s+([\w-]*):", re.IGNORECASE)
LISTS = re.compile(r"expected one of .{80,}", re.DOTALL)
"""Pattern of the list of expected tokens in an error message of the parser."""
NAMESPACES = re.compile(r"\bPREFIX\s+([\w-]*):\s*<([^<>]*)>", re.IGNORECASE)
PLACE = re.compile(r"error at (\d+):(\d+): ")
FROM = re.compile(
    rf"(?P<text>{TEXTS.pattern})|(?<![\w?$:.-])FROM(?![\w:-])(?:\s|#[^\n]*\n)*(?P<named>NAMED(?:\s|#[^\n]*\n)*)?"
    r"(?:<(?P<iri>[^<>]*)>|(?P<prefix>[\w.-]*):(?P<name>[\w.-]*))",
    re.DOTALL | re.IGNORECASE,
)
"""Pattern of a literal, an IRI, a comment or a ``FROM`` clause."""
STANDARDS = ("http://www.w3.org/", "http://purl.org/dc/")
"""Beginnings of the namespaces of standard vocabularies, whose names any query may use."""
SERVICE = re.compile(r"(?<![\w?$:-])SERVICE(?![\w:-])", re.IGNORECASE)

Dataset: TypeAlias = "tuple[Sequence[str], Sequence[str] | None]"
"""The graphs whose union is the default graph, and the graphs that ``GRAPH`` can match (None: all graphs)."""
QueryAnswer: TypeAlias = "tuple[str, list[str], Any]"
"""The kind of result (``rows``, ``triples`` or ``truth``), the column names, and the content."""


@dataclass(frozen=True)
class QueryLimits:
    """Limits of a query: seconds, rows, and megabytes of memory.

    With `service`, ``SERVICE`` clauses are permitted, which query other endpoints.
    """

    seconds: float = SECONDS
    rows: int = ROWS
    megabytes: int = MEGABYTES
    service: bool = False


def ask(graph: KnowledgeGraph, query: str, limits: QueryLimits | None = None) -> QueryAnswer:
    """Return the result of a query on the union of a knowledge graph's graphs.

    Raises
    ------
    KnowledgeError
        The query isn't SPARQL 1.1, is nested too deeply, or queries another endpoint without permission.
    LimitError
        The query exceeds the limits of time, memory or rows.
    """
    limits = limits or QueryLimits()
    if graph.remote:
        return _checked(graph, query, limits, _remotely(graph, allowed(query, limits), limits))
    with QueryWorker(graph, limits) as worker:
        return worker.ask(query)


class _TimedOutput(BytesIO):
    """A byte stream that raises `LimitError` at the deadline, so that a store stops writing."""

    def write(self, content: Buffer, /) -> int:
        """Store the next bytes, or raise `LimitError` after the deadline."""
        check("sending the scene to the query process")
        return super().write(content)


def _dumped(graph: KnowledgeGraph) -> bytes:
    written = _TimedOutput()
    graph.store.dump(written, format=ox.RdfFormat.N_QUADS)
    return written.getvalue()


class QueryWorker:
    """A process that executes queries on a copy of a graph.

    At the first query, the process starts and copies the graph. The process ends with the ``with`` block or with its parent
    process. An interrupted query, or a query that exceeds its limits, doesn't end the process.

    Parameters
    ----------
    graph : KnowledgeGraph
    limits : QueryLimits
        Limits of each query.
    nice : int
        Niceness (low scheduling priority) of the process.
    """

    def __init__(self, graph: KnowledgeGraph, limits: QueryLimits, nice: int = 0) -> None:
        self.graph, self.limits, self.nice = graph, limits, nice
        self._bytes = in_force(resource.RLIMIT_AS, limits.megabytes * 1_000_000)
        self._cpu_seconds = in_force(resource.RLIMIT_CPU, int(min(limits.seconds, MOST_SECONDS)) + 3) - 1
        self._process: Popen[bytes] | None = None
        self._sending = Lock()

    def __enter__(self) -> QueryWorker:
        """Return the worker itself."""
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        """End the process."""
        self.close()

    def close(self) -> None:
        """End the process and its running query; do nothing if the process hasn't started."""
        if self._process is not None:
            end(self._process)
            self._process = None

    def start(self) -> None:
        """Start the process unless it is running, and wait until the process has read the graph."""
        if self._process is None:
            self.ask("ASK {}")

    def interrupt(self) -> None:
        """Stop the query for which another thread is waiting.

        The call of `ask` in the other thread then raises `LimitError`. A process that is still starting isn't interrupted.
        """
        if self._sending.acquire(blocking=False):
            self._send(None)
            self._sending.release()

    def ask(self, query: str, dataset: Dataset | None = None) -> QueryAnswer:
        """Return the result of a query on a dataset: by default the dataset of its ``FROM`` clauses, or the union of all graphs.

        Raise the errors of the function `ask`, and `KnowledgeError` for a graph that doesn't exist.
        """
        self.graph.round_trips += 1
        dataset = _existing(self.graph, dataset or clauses(self.graph, query) or (UNION, None))
        found = self._answer(core_names(self.graph, allowed(query, self.limits)), dataset)
        if found[0] == "error":
            found = self._answer(query, dataset)  # the original query, for correct positions in messages
        return _checked(self.graph, query, self.limits, found)

    def _answer(self, query: str, dataset: Dataset) -> QueryAnswer:
        late, starting, deadline, begin = Event(), self._process is None, current(), perf_counter()

        def interrupt() -> None:
            late.set()
            if starting and deadline.left == 0:  # the process is still reading the graph
                kill(process)
            self.interrupt()

        with self._sending:
            if self._process is None:
                command = [sys.executable, str(PROCESS)]
                self._process = start(command, math.inf, stdin=PIPE, stdout=PIPE, stderr=PIPE)  # each query has a limit
                self._send(self._setup())
            self._send((query, *dataset))
        left, process = deadline.left, self._process
        assert process.stdout is not None
        own = self.limits.seconds - (perf_counter() - begin)
        timer = Timer(own if left is None else min(left, own), interrupt)
        timer.start()
        try:
            found = pickle.load(process.stdout)
        except (EOFError, pickle.UnpicklingError):
            self._process = None
            kill(process)
            said = process.communicate()[1].decode("utf-8", "replace")
            if deadline.left == 0:
                deadline.check("answering a query")
            raise self._why(process.returncode, said, late.is_set()) from None
        finally:
            timer.cancel()
        if found[0] == "ended":
            if late.is_set() and deadline.left == 0:
                deadline.check("answering a query")
            raise self._why(found[1], found[2], late.is_set())
        answer: QueryAnswer = found
        return answer

    def _setup(self) -> dict[str, object]:
        return {
            "prefixes": self.graph.spoken,
            "quads": _dumped(self.graph),
            "seconds": self._cpu_seconds,
            "memory": self._bytes,
            "rows": self.limits.rows,
            "service": self.limits.service,
            "nice": self.nice,
        }

    def _send(self, message: object) -> None:
        if self._process is not None and self._process.stdin is not None:
            content = pickle.dumps(message)
            with suppress(OSError):  # the process has ended; reading its answer raises the error
                self._process.stdin.write(len(content).to_bytes(8, "big") + content)
                self._process.stdin.flush()

    def _why(self, status: int, said: str, late: bool) -> Exception:
        """Return the error for a query that ended without a result."""
        if late or status == -signal.SIGXCPU:
            seconds = self.limits.seconds if late else self._cpu_seconds
            return LimitError(f"gave up after {seconds:g} s at the query; ask for less, or give more time")
        if status == -signal.SIGKILL:
            return LimitError("the query was interrupted")
        if "memory" in said.lower():
            megabytes = self._bytes // 1_000_000
            return LimitError(f"gave up: the query needs more than {megabytes:,} MB of memory; ask for less")
        if status < 0:
            return KnowledgeError(f"the query brings the SPARQL engine down (signal {-status}); nest it less deeply")
        return RuntimeError(f"the process that answers queries failed: {said}")


def allowed(query: str, limits: QueryLimits) -> str:
    """Return a query unchanged; raise `KnowledgeError` if the query contains a ``SERVICE`` clause that the limits don't permit."""
    if not limits.service and SERVICE.search(TEXTS.sub(" ", query)):
        raise KnowledgeError(
            "the query asks another endpoint (SERVICE), which may learn from it; allow that with --service"
        )
    return query


def clauses(graph: KnowledgeGraph, query: str) -> Dataset | None:
    """Return the dataset that the ``FROM`` clauses of a query describe; return None if there are no such clauses."""
    known = {**graph.spoken, **dict(NAMESPACES.findall(query))}
    found = [match for match in FROM.finditer(query) if match["text"] is None]
    names = [
        match["iri"] if match["iri"] is not None else known.get(match["prefix"], match["prefix"] + ":") + match["name"]
        for match in found
    ]
    if not found:
        return None
    named = [name for name, match in zip(names, found, strict=True) if match["named"]]
    return [name for name, match in zip(names, found, strict=True) if not match["named"]], named


def _existing(graph: KnowledgeGraph, dataset: Dataset) -> Dataset:
    """Return a dataset unchanged; raise `KnowledgeError` if one of its graphs doesn't exist."""
    known = {*UNION, *(name.value for name in graph.store.named_graphs() if isinstance(name, ox.NamedNode))}
    for name in (*dataset[0], *(dataset[1] or ())):
        if name not in known:
            hint = "there are " + ", ".join(sorted(known))
            raise KnowledgeError(f"no graph is named <{name}>{nearest(name, known, hint)}")
    return dataset


def _checked(graph: KnowledgeGraph, query: str, limits: QueryLimits, found: QueryAnswer) -> QueryAnswer:
    """Return the result of a query; raise the exception for an error that the process reports."""
    if found[0] == "too many":
        raise LimitError(
            f"gave up: more than {limits.rows:,} rows, or very long ones; add a LIMIT to the query, or allow more (--rows)"
        )
    if found[0] == "error":
        raise KnowledgeError(f"the query is not SPARQL 1.1: {_explained(graph, query, found[2])}")
    return found


def _explained(graph: KnowledgeGraph, query: str, error: str) -> str:
    """Return the error message of a query in one line, with the text at the faulty position or with an unknown prefix."""
    if UPDATE.search(query):
        return "it is an update, and a scene is only read; wanted SELECT, ASK, CONSTRUCT or DESCRIBE"
    error = " ".join(LISTS.sub("unexpected", error).split())
    known = {*graph.spoken, *DECLARED.findall(query)}
    if unknown := next(iter(unknown_prefixes(graph, query)), None):
        hint = "known are " + ", ".join(f"{prefix}:" for prefix in sorted(known))
        return f"{error}; no prefix '{unknown}:' is known{nearest(unknown, known, hint)}"
    if place := PLACE.search(error):
        line, column = int(place[1]), int(place[2])
        lines = query.split("\n")
        rest = lines[line - 1][column - 1 :].strip() if line <= len(lines) else ""
        return f"{error}; there stands '{rest[:20]}'" if rest else f"{error}; there the query ends"
    return error


def unknown_prefixes(graph: KnowledgeGraph, query: str) -> list[str]:
    """Return the prefixes in a query that neither the query nor the scene declares."""
    known = {*graph.spoken, *DECLARED.findall(query), "_"}
    used = [m["prefix"] for m in WORDS.finditer(query) if m["text"] is None and m["prefix"] is not None]
    return [prefix for prefix in used if prefix not in known]


def core_names(graph: KnowledgeGraph, query: str) -> str:
    """Return a query in which ``:Behavior`` denotes the core's class, unless the scene's own namespace ``:`` has this name."""
    own = graph.spoken.get("", CORE)
    if own == CORE or "" in DECLARED.findall(query):
        return query

    def put(match: re.Match[str]) -> str:
        name = match["name"]
        if match["text"] is not None or match["prefix"] is not None or name is None:
            return match[0]
        core_alone = _speaks_of(graph, CORE + name) and not _speaks_of(graph, own + name)
        return f"<{CORE}{name}>" if core_alone else match[0]

    return WORDS.sub(put, query)


def unheard_of(graph: KnowledgeGraph, query: str) -> list[str]:
    """Return the unknown names in a query, each with a correction if there is one.

    A name is unknown if the graph describes its namespace but lacks the name. Names of standard vocabularies are left out.
    """
    known = {**graph.spoken, **dict(NAMESPACES.findall(query))}
    spaces = {space for space in known.values() if not space.startswith(STANDARDS)}
    found = dict[str, str]()
    for match in WORDS.finditer(core_names(graph, NAMESPACES.sub("", query))):
        space, name = known.get(match["prefix"] or "", ""), match["name"]
        if match[0].startswith("<"):
            space, name = re.findall(r"<(.*[#/])?([^#/]*)>", match[0])[0]
        if not name or space not in spaces or match[0] in found or _speaks_of(graph, space + name):
            continue
        if names := _names_in(graph, space):
            other = next((p for p, other in sorted(known.items()) if _speaks_of(graph, other + name)), None)
            words = nearest(name, names) if other is None else f"; did you mean {other}:{name}?"
            found[match[0]] = f" ({words[2:]})" if words else ""
    return [name + words for name, words in found.items()]


def _names_in(graph: KnowledgeGraph, space: str) -> list[str]:
    """Return the names of a namespace that the graph describes."""
    query = f'SELECT DISTINCT ?s WHERE {{ ?s a ?kind FILTER(STRSTARTS(STR(?s), "{space}")) }}'
    return [text(term)[len(space) :] for (term,) in graph.select(query)]


def _speaks_of(graph: KnowledgeGraph, iri: str) -> bool:
    try:
        node = ox.NamedNode(iri)
    except ValueError:
        return False
    places = (node, None, None), (None, node, None), (None, None, node)
    return any(next(graph.store.quads_for_pattern(*place), None) for place in places)


def standing_alone(graph: KnowledgeGraph, query: str) -> str:
    """Return an internal query preceded by PREFIX declarations, for endpoints that don't know the prefixes."""
    used = {m["prefix"] or "" for m in WORDS.finditer(query) if m["text"] is None and "?" not in m[0]}
    lines = [f"PREFIX {prefix}: <{graph.prefixes[prefix]}>" for prefix in sorted(used) if prefix in graph.prefixes]
    return "\n".join([*lines, query])


def _remotely(graph: KnowledgeGraph, query: str, limits: QueryLimits) -> QueryAnswer:
    assert graph.remote is not None
    graph.round_trips += 1
    answer = graph.remote.query(query, graph.prefixes, {}, noted=False)
    if isinstance(answer, ox.QueryBoolean):
        return "truth", [], bool(answer)
    rows: list[Row] = []
    for row in answer:
        rows.append(tuple(row))
        if len(rows) > limits.rows:
            return "too many", [], []
    if isinstance(answer, ox.QueryTriples):
        return "triples", [], rows
    return "rows", [variable.value for variable in answer.variables], rows
