"""Queries that people write, answered in a process of their own: what they cost, and how they end, can't harm this one.

A query can ask for more rows than there are atoms, and one that is nested deeply enough brings the SPARQL parser down. The queries
of the planner itself are asked of the store directly.
"""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyoxigraph as ox

from reasoner.graph.knowledge import BASE, GRAPHS, KnowledgeError, KnowledgeGraph, Row
from reasoner.limits import LimitError

PROCESS = Path(__file__).with_name("asked_apart.py")
SECONDS, ROWS, MEGABYTES = 60.0, 100_000, 2_000
TEXTS = re.compile(
    r'"""(?:[^\\]|\\.)*?"""|\'\'\'(?:[^\\]|\\.)*?\'\'\'|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|<[^<>"{}|^`\\\s]*>|#[^\n]*',
    re.DOTALL,
)
"""What may hold any word: texts, IRIs and comments."""
SERVICE = re.compile(r"(?<![\w?$:-])SERVICE(?![\w:-])", re.IGNORECASE)


@dataclass(frozen=True)
class QueryLimits:
    """What a query may take; with `service` it may ask other endpoints as well."""

    seconds: float = SECONDS
    rows: int = ROWS
    megabytes: int = MEGABYTES
    service: bool = False


def ask(graph: KnowledgeGraph, query: str, limits: QueryLimits | None = None) -> tuple[str, list[str], list[Row]]:
    """Return what a query answers on the union of the graphs: ``rows`` or ``triples``, the columns, and which.

    Raises
    ------
    KnowledgeError
        It isn't SPARQL 1.1, asks another endpoint without leave, is nested too deeply, or gives neither rows nor triples.
    LimitError
        It takes more time or memory, or gives more rows, than the limits allow.
    """
    limits = limits or QueryLimits()
    if not limits.service and SERVICE.search(TEXTS.sub(" ", query)):
        raise KnowledgeError(
            "the query asks another endpoint (SERVICE), which may learn from it; allow that with --service"
        )
    kind, columns, found = _remotely(graph, query, limits) if graph.remote else _apart(graph, query, limits)
    if kind == "too many":
        raise LimitError(
            f"gave up: more than {limits.rows:,} rows, or very long ones; add a LIMIT to the query, or allow more (--rows)"
        )
    if kind == "error":
        raise KnowledgeError(f"the query is not SPARQL 1.1: {found}")
    return kind, columns, found


def _remotely(graph: KnowledgeGraph, query: str, limits: QueryLimits) -> tuple[str, list[str], Any]:
    answer = graph.query(query)
    if isinstance(answer, ox.QueryBoolean):
        return "truth", [], []
    rows: list[Row] = []
    for row in answer:
        rows.append(tuple(row))
        if len(rows) > limits.rows:
            return "too many", [], []
    if isinstance(answer, ox.QueryTriples):
        return "triples", [], rows
    return "rows", [variable.value for variable in answer.variables], rows


def _apart(graph: KnowledgeGraph, query: str, limits: QueryLimits) -> tuple[str, list[str], Any]:
    graph.round_trips += 1
    asked = {
        "query": query,
        "prefixes": graph.prefixes,
        "graphs": [BASE + name for name in GRAPHS],
        "quads": graph.store.dump(format=ox.RdfFormat.N_QUADS),
        "memory": limits.megabytes * 1_000_000,
        "rows": limits.rows,
        "service": limits.service,
    }
    try:
        done = subprocess.run(
            [sys.executable, str(PROCESS)], input=pickle.dumps(asked), capture_output=True, timeout=limits.seconds
        )
    except subprocess.TimeoutExpired:
        raise LimitError(
            f"gave up after {limits.seconds:g} s at the query; ask for less, or give more time (--time-limit)"
        ) from None
    if done.returncode == 0:
        answer: tuple[str, list[str], Any] = pickle.loads(done.stdout)
        return answer
    said = done.stderr.decode("utf-8", "replace")
    if "memory" in said.lower():
        raise LimitError(f"gave up: the query needs more than {limits.megabytes:,} MB of memory; ask for less")
    if done.returncode < 0:
        raise KnowledgeError(
            f"the query brings the SPARQL engine down (signal {-done.returncode}); nest it less deeply"
        )
    raise RuntimeError(f"the process that answers queries failed: {said}")
