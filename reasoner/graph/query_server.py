"""Main program of the process that executes queries for `confab.reasoner.graph.query_process`.

The process imports no other module of this project, stores a graph, and forks a process for each query. The forked process limits
its own memory, time and number of open files; because of the last limit, it can't open connections. It ends after its answer. The
next message, or the end of the parent process, stops the forked process.
"""

from __future__ import annotations

import os
import pickle
import resource
import select
import signal
import sys
from collections.abc import Sequence
from typing import Any

import pyoxigraph as ox


def main() -> None:
    """Answer each query by ``(kind, columns, rows)`` as returned by `answer`, or by ``("ended", status, output)``."""
    setup = received()
    os.nice(setup["nice"])
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_AS, setup["memory"])
    store = ox.Store()
    store.bulk_extend(ox.parse(setup["quads"], format=ox.RdfFormat.N_QUADS))
    while True:
        question = received()
        if question is not None:  # None requests a stop, but the last query has already ended
            sys.stdout.buffer.write(forked(store, question, setup))
            sys.stdout.buffer.flush()


def received() -> Any:
    """Return the next message; exit if the parent process has ended."""
    size = int.from_bytes(read(8), "big")
    return pickle.loads(read(size))


def read(size: int) -> bytes:
    """Return exactly `size` bytes from standard input, without buffering, so that `select` detects the next message."""
    found = bytearray()
    while len(found) < size:
        part = os.read(0, min(size - len(found), 1 << 20))
        if not part:
            sys.exit()
        found += part
    return bytes(found)


def forked(store: ox.Store, question: tuple[Any, ...], setup: dict[str, Any]) -> bytes:
    """Return the pickled answer of a forked process, or the exit status of a process that ended without an answer."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(ours)
            for number in (0, 1, 2):
                os.dup2(theirs, number)
            limit(resource.RLIMIT_CPU, setup["seconds"], 1)  # the signal at the lower limit tells the cause
            if not setup["service"]:
                limit(resource.RLIMIT_NOFILE, 3)  # no files besides standard streams
            query, default, named = question
            said = pickle.dumps(answer(store, query, default, named, setup))
            if len(said) > setup["memory"] // 10:  # the reader needs several times as much memory
                said = pickle.dumps(("too many", (), ()))
            while said:
                said = said[os.write(theirs, said[: 1 << 20]) :]
            status = 0
        except BaseException as error:
            os.write(2, f"{type(error).__name__}: {error}".encode())
        finally:
            os._exit(status)
    os.close(theirs)
    found, part = bytearray(), b"some"
    while part:
        if 0 in select.select([ours, 0], [], [])[0]:
            os.kill(child, signal.SIGKILL)
            break
        part = os.read(ours, 1 << 20)
        found += part
    os.close(ours)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if part:  # the query was interrupted, possibly after its answer
        return pickle.dumps(("ended", -signal.SIGKILL, ""))
    return bytes(found) if status == 0 else pickle.dumps(("ended", status, found.decode("utf-8", "replace")))


def limit(what: int, value: int, more: int = 0) -> None:
    """Set a resource limit of this process permanently; `more` is the distance to the hard limit."""
    resource.setrlimit(what, (value, value + more))


def answer(
    store: ox.Store, query: str, default: Sequence[str], named: Sequence[str] | None, setup: dict[str, Any]
) -> tuple[str, object, object]:
    """Return the result of a query: its kind, the column names and the content.

    The kind is ``rows``, ``triples``, ``truth``, ``too many`` or ``error``. The default graph is the union of the graphs `default`;
    ``GRAPH`` matches the graphs `named` (None: all graphs).
    """
    try:
        found = store.query(
            query,
            prefixes=setup["prefixes"],
            default_graph=[ox.NamedNode(name) for name in default],
            named_graphs=None if named is None else [ox.NamedNode(name) for name in named],
        )
        if isinstance(found, ox.QueryBoolean):
            return "truth", (), bool(found)
        columns = [variable.value for variable in getattr(found, "variables", ())]
        rows: list[tuple[object, ...]] = []
        for row in found:
            rows.append(tuple(row))
            if len(rows) > setup["rows"]:
                return "too many", (), ()
        return "triples" if isinstance(found, ox.QueryTriples) else "rows", columns, rows
    except (SyntaxError, OSError, RuntimeError) as error:
        return "error", (), str(error)


if __name__ == "__main__":
    main()
