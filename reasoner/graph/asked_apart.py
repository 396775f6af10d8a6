"""The other end of `reasoner.graph.apart`: a process that answers one query and ends. It needs nothing of this project.

It reads from stdin what is asked of which triples, and writes what was answered to stdout. Before it answers it gives up what it
doesn't need: more memory than it is allowed, and new files, which connections to elsewhere are, too.
"""

from __future__ import annotations

import pickle
import resource
import sys

import pyoxigraph as ox


def main() -> None:
    """Answer: ``(kind, columns, rows)``, kind being ``rows``, ``triples``, ``truth``, ``too many`` or ``error``."""
    asked = pickle.load(sys.stdin.buffer)
    for limit, value in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_AS, asked["memory"])):
        resource.setrlimit(limit, (value, value))
    store = ox.Store()
    store.bulk_extend(ox.parse(asked["quads"], format=ox.RdfFormat.N_QUADS))
    graphs: list[ox.NamedNode | ox.BlankNode | ox.DefaultGraph] = [ox.NamedNode(name) for name in asked["graphs"]]
    if not asked["service"]:
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))  # stdin, stdout, stderr: there is no further one to be had
    try:
        found = store.query(asked["query"], prefixes=asked["prefixes"], default_graph=graphs)
        if isinstance(found, ox.QueryBoolean):
            answer: tuple[str, object, object] = ("truth", (), bool(found))
        else:
            columns = [variable.value for variable in getattr(found, "variables", ())]
            rows: list[tuple[object, ...]] = []
            for row in found:
                rows.append(tuple(row))
                if len(rows) > asked["rows"]:
                    break
            kind = "triples" if isinstance(found, ox.QueryTriples) else "rows"
            answer = ("too many", (), ()) if len(rows) > asked["rows"] else (kind, columns, rows)
    except (SyntaxError, OSError, RuntimeError) as error:
        answer = ("error", (), str(error))
    said = pickle.dumps(answer)
    if len(said) > asked["memory"] // 10:  # it takes several times as much where it is read
        said = pickle.dumps(("too many", (), ()))
    sys.stdout.buffer.write(said)


if __name__ == "__main__":
    main()
