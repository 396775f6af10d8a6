"""Reading of mechanisms (furniture with moving links) from the graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from confab.reasoner.embodiment.facts import BodyFacts, EmbodimentError
from confab.reasoner.embodiment.values import Feature, Link, Mechanism, Part

KINDS = {"box": ("size_x", "size_y", "size_z"), "cylinder": ("radius", "radius", "height"), "sphere": ("radius",) * 3}
"""The attributes that state the size of a solid, for each kind of solid. If the attribute is a radius, the size is twice the
radius.
"""

JOINTS = ("revolute", "prismatic", "fixed")


def mechanisms(facts: BodyFacts, names: Callable[[str], str], folders: Sequence[Path]) -> tuple[Mechanism, ...]:
    """Return the mechanisms of a scene, each with its links."""
    _check_parents(facts)
    return tuple(_mechanism(facts, node, names, folders) for node in facts.members("Mechanism"))


def _mechanism(facts: BodyFacts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> Mechanism:
    return Mechanism(
        names(node),
        facts.position(node),
        facts.number(node, "yaw", 0.0),
        _parts(facts, node, names, folders),
        tuple(_link(facts, one, node, names, folders) for one in _links(facts, node)),
        facts.number(node, "friction", 0.8),
        facts.file(node, "urdf", folders) if facts.text(node, "urdf", "") else "",
    )


def _check_parents(facts: BodyFacts) -> None:
    """Raise `EmbodimentError` unless each link is part of exactly one mechanism and not part of itself."""
    mechanisms = {*facts.members("Mechanism")}
    for node in facts.ordered(node for node, links in facts.links.items() if "part_of" in links):
        above = [node]
        while above[-1] not in mechanisms:
            parents = facts.linked(above[-1], "part_of")
            if len(parents) != 1 or parents[0] in above:
                raise EmbodimentError(_no_mechanism(above, parents), node)
            above.append(parents[0])


def _no_mechanism(above: Sequence[str], parents: Sequence[str]) -> str:
    """Return the message for a link whose chain of parents `above` doesn't end at a mechanism."""
    if not parents:
        why = f"{above[-1]} is neither an e:Mechanism nor part of an e:Mechanism"
    elif len(parents) > 1:
        why = f"{above[-1]} has {len(parents)} values of e:partOf: {', '.join(parents)}"
    else:
        why = f"e:partOf leads back to {parents[0]}" if len(above) > 1 else "e:partOf leads to the link itself"
    return f"{above[0]} isn't part of a mechanism: {why}; state one e:partOf that leads to a mechanism or to a link of a mechanism"


def _links(facts: BodyFacts, mechanism: str) -> list[str]:
    """Return the links of a mechanism in an order in which parents precede children."""
    ordered: list[str] = []
    waiting = [mechanism]
    while waiting:
        parent = waiting.pop(0)
        children = facts.ordered(node for node in facts.links if parent in facts.linked(node, "part_of"))
        ordered += children
        waiting += children
    return ordered


def _link(facts: BodyFacts, node: str, mechanism: str, names: Callable[[str], str], folders: Sequence[Path]) -> Link:
    kind, parent = facts.text(node, "joint", "fixed"), facts.linked(node, "part_of")[0]
    if kind not in JOINTS:
        raise EmbodimentError(f"{node} has e:joint '{kind}'; wanted one of {', '.join(JOINTS)}", node)
    axis = facts.numbers(node, "axis", "0 0 1")
    if len(axis) != 3 or not any(axis):
        raise EmbodimentError(f"{node} has e:axis {axis}; wanted the three coordinates of a direction", node)
    upper = facts.number(node, "upper", 0.0)
    return Link(
        names(node),
        kind,
        _parts(facts, node, names, folders),
        {feature.name: feature for feature in (_feature(facts, one, names) for one in facts.linked(node, "feature"))},
        "" if parent == mechanism else names(parent),
        facts.position(node, "0"),
        facts.turned(node),
        (axis[0], axis[1], axis[2]),
        facts.number(node, "lower", 0.0),
        upper,
        facts.number(node, "mass", 1.0),
        facts.number(node, "opened", 0.8 * upper),
        facts.number(node, "shut", 0.05 * upper),
        facts.number(node, "joint_friction", 0.5),
        facts.number(node, "damping", 0.1),
        facts.number(node, "spring", 0.0),
        facts.text(node, "latches", "false") == "true",
        facts.text(node, "urdf_link", ""),
        tuple(names(part) for part in facts.linked(node, "touches_part")),
    )


def _parts(facts: BodyFacts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> tuple[Part, ...]:
    return tuple(_part(facts, one, names, folders) for one in facts.ordered(facts.linked(node, "part")))


def _part(facts: BodyFacts, node: str, names: Callable[[str], str], folders: Sequence[Path]) -> Part:
    kind = facts.text(node, "kind")
    if kind not in KINDS and kind != "mesh":
        raise EmbodimentError(f"{node} has e:kind '{kind}'; wanted one of {', '.join([*KINDS, 'mesh'])}", node)
    x, y, z = (facts.number(node, name) * (2 if name == "radius" else 1) for name in KINDS.get(kind, KINDS["box"]))
    file = facts.file(node, "mesh", folders) if kind == "mesh" else ""
    place = facts.position(node, "0")
    return Part(names(node), kind, (x, y, z), place, facts.turned(node), facts.color(node), file)


def _feature(facts: BodyFacts, node: str, names: Callable[[str], str]) -> Feature:
    """Return the feature of a node. The name of the feature is the part of its IRI after the last dot."""
    return Feature(
        names(node).rsplit(".", 1)[-1],
        facts.position(node, "0"),
        facts.turned(node),
        facts.number(node, "lower", 0.0),
        facts.number(node, "upper", 0.0),
        tuple(names(part) for part in facts.linked(node, "touches_part")),
    )
