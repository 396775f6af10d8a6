"""Exports of a plan: a networkx graph, Graphviz text and HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING

from confab.planner.finding import Path, StepPosition

if TYPE_CHECKING:
    import networkx


def digraph(nodes: Sequence[StepPosition]) -> networkx.DiGraph[Path]:
    """Return a plan as a directed graph, as `confab.planner.plan.Plan.to_networkx` describes it."""
    import networkx

    graph: networkx.DiGraph[Path] = networkx.DiGraph()
    for node in nodes:
        graph.add_node(node.path, label=node.texts[-1], level=node.level, id=node.id)
    for one, other, kind in edges(nodes):
        graph.add_edge(one, other, kind=kind)
    return graph


def edges(nodes: Sequence[StepPosition]) -> Iterator[tuple[Path, Path, str]]:
    """Yield the edges of a plan's graph: from a step to a sub-step (``refines``), and to the next step (``then``)."""
    paths = {node.path for node in nodes}
    for *above, place in sorted(paths):
        path = (*above, place)
        if above:
            yield (*above,), path, "refines"
        if (following := (*above, place + 1)) in paths:
            yield path, following, "then"


def dot(nodes: Sequence[StepPosition]) -> str:
    """Return a plan as Graphviz text: sub-steps are drawn below a step, and dashed arrows lead to the next step."""
    lines = ["digraph plan {", "  node [shape=box, style=rounded];"]
    lines += [f"  {_named(node.path)} [label={_quoted(node.texts[-1])}];" for node in nodes]
    style = {"refines": "", "then": " [style=dashed, constraint=false]"}
    lines += [f"  {_named(one)} -> {_named(other)}{style[kind]};" for one, other, kind in edges(nodes)]
    return "\n".join([*lines, "}"]) + "\n"


def _named(path: Path) -> str:
    return _quoted(".".join(map(str, path)))


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def html(headline: str, nodes: Sequence[StepPosition]) -> str:
    """Return a plan as HTML with a collapsible tree of steps."""
    above = {node.path[:-1] for node in nodes}
    parts, depth = [f"<div>{escape(headline)}"], 1
    for node in nodes:
        parts.append("</details>" * (depth - len(node.path)))
        depth = len(node.path)
        own = escape(node.texts[-1])
        if node.path in above:
            parts.append(f"<details style='margin-left: 1.2em'><summary>{own}</summary>")
        else:
            parts.append(f"<div style='margin-left: 1.2em'>{own}</div>")
    return "".join([*parts, "</details>" * (depth - 1), "</div>"])
