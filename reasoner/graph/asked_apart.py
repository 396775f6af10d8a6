"""The other end of `reasoner.graph.apart`: a process that answers queries. It needs nothing of this project.

It reads from stdin what is asked of which triples, then one query after the other, and writes to stdout what each gives. Before it
answers it gives up what it doesn't need: more memory than it is allowed, and new files, which connections to elsewhere are, too.
"""

from __future__ import annotations

import pickle
import resource
import sys
from typing import Any

import pyoxigraph as ox


def main() -> None:
    """Answer each query: ``(kind, columns, rows)``, kind being ``rows``, ``triples``, ``truth``, ``too many`` or ``error``."""
    asked = pickle.load(sys.stdin.buffer)
    for limit, value in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_AS, asked["memory"])):
        resource.setrlimit(limit, (value, value))
    store = ox.Store()
    store.bulk_extend(ox.parse(asked["quads"], format=ox.RdfFormat.N_QUADS))
    if not asked["service"]:
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))  # stdin, stdout, stderr: there is no further one to be had
    while True:
        try:
            query, graphs = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        said = pickle.dumps(answer(store, query, graphs, asked))
        if len(said) > asked["memory"] // 10:  # it takes several times as much where it is read
            said = pickle.dumps(("too many", (), ()))
        sys.stdout.buffer.write(said)
        sys.stdout.buffer.flush()


def answer(store: ox.Store, query: str, graphs: list[str], asked: dict[str, Any]) -> tuple[str, object, object]:
    """Return what one query gives, on the union of some graphs."""
    try:
        union = [ox.NamedNode(name) for name in graphs]
        found = store.query(query, prefixes=asked["prefixes"], default_graph=union)  # type: ignore[arg-type]
        if isinstance(found, ox.QueryBoolean):
            return "truth", (), bool(found)
        columns = [variable.value for variable in getattr(found, "variables", ())]
        rows: list[tuple[object, ...]] = []
        for row in found:
            rows.append(tuple(row))
            if len(rows) > asked["rows"]:
                return "too many", (), ()
        return "triples" if isinstance(found, ox.QueryTriples) else "rows", columns, rows
    except (SyntaxError, OSError, RuntimeError) as error:
        return "error", (), str(error)


if __name__ == "__main__":
    main()
