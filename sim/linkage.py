"""Geometry of mechanisms: the positions of links, features and solids for given joint values.

A mechanism is described by a URDF file, or by a URDF text that is generated from its parts. Lengths are in metres, angles in
radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from confab.reasoner.embodiment.values import Embodiment, Feature, Link, Mechanism, Part, Place
from confab.sim.arms import turn
from confab.sim.collision import Solid
from confab.sim.urdf import Array, UrdfModel, read_model, rotation

LONGEST, SLIM = 0.15, 0.7
"""Maximum length in metres of the drawn post behind a handle, and ratio of the post's width to the width of the handle's bar."""

HERE = np.zeros(3)

BASE = "base"
"""The fixed link of a generated URDF."""


def urdf_name(mechanism: Mechanism, link: str) -> str:
    """Return a link's name in the URDF; a mechanism's own name denotes its base."""
    if link == mechanism.name:
        return BASE
    found = next(one for one in mechanism.links if one.name == link)
    return found.urdf_link or found.name


def moved(mechanism: Mechanism, model: UrdfModel, name: str, values: Mapping[str, float]) -> tuple[Array, Array]:
    """Return a link's rotation and shift relative to the zero posture, with joints at `values` (by link, 0 by default)."""
    turned, shift = np.eye(3), np.zeros(3)
    by_urdf = {urdf_name(mechanism, link.name): values.get(link.name, 0.0) for link in mechanism.links}
    for joint in model.chain(urdf_name(mechanism, name)):
        value = by_urdf.get(joint.child, 0.0)
        if joint.kind == "prismatic":
            shift = shift + turned @ joint.axis * value
        elif joint.kind in ("revolute", "continuous"):
            local = turn(joint.axis, np.array(value))
            shift = shift + turned @ (joint.origin - local @ joint.origin)
            turned = turned @ local
    return turned, shift


def solids(mechanism: Mechanism, model: UrdfModel, values: Mapping[str, float], aside: Array = HERE) -> Iterator[Solid]:
    """Yield the solids of a mechanism with its joints at `values`, shifted by `aside` (3,) metres."""
    owners = {urdf_name(mechanism, link.name): link.name for link in mechanism.links}
    for link, primitives in model.primitives.items():
        owner = owners.get(link, mechanism.name)
        turned, shift = moved(mechanism, model, owner, values)
        for part in primitives:
            center = turned @ part.center + shift + aside
            yield Solid(owner, part.kind, part.half, center, turned @ part.rotation, part.name)


def open_values(mechanism: Mechanism) -> dict[str, float]:
    """Return the joint values, by link, of a mechanism with all links open."""
    return {link.name: link.wide for link in mechanism.links}


def with_open_mechanisms(embodiment: Embodiment) -> tuple[dict[str, Place], list[Solid]]:
    """Return places in the world's frame and the solids of mechanisms, both with all joints open.

    Places on movable bodies are left out, since they have no fixed position.
    """
    places = {name: place for name, place in embodiment.places.items() if not place.carrier}
    around: list[Solid] = []
    for mechanism in embodiment.mechanisms:
        model, values = read_mechanism(mechanism), open_values(mechanism)
        around += solids(mechanism, model, values)
        for name in (mechanism.name, *(link.name for link in mechanism.links)):
            turned, shift = moved(mechanism, model, name, values)
            zero, origin = model.frames[urdf_name(mechanism, name)]
            for place in embodiment.places.values():
                if place.carrier == name:
                    x, y, z = turned @ (zero @ np.array(place.position) + origin) + shift
                    places[place.name] = Place(place.name, (float(x), float(y), float(z)))
    return {name: places[name] for name in embodiment.places if name in places}, around


def feature_frame(frame: tuple[Array, Array], feature: Feature) -> tuple[Array, Array]:
    """Return the frame of a feature in the world, given the frame of the feature's link."""
    turned, origin = frame
    return turned @ rotation(*feature.turned), origin + turned @ np.array(feature.position)


def read_mechanism(mechanism: Mechanism) -> UrdfModel:
    """Return a mechanism's model at the zero posture, placed in the world."""
    text = Path(mechanism.urdf).read_text(encoding="utf-8") if mechanism.urdf else written(mechanism)
    return read_model(text, mechanism.urdf or mechanism.name, mechanism.position, mechanism.yaw, False)


def written(mechanism: Mechanism) -> str:
    """Return a mechanism as URDF text with the short lines that PyBullet's parser requires."""
    lines = [f'<robot name="{mechanism.name}">', *_link(BASE, mechanism.parts, 0.0)]
    for link in mechanism.links:
        lines += _link(link.name, link.parts, link.mass, [*posts(link)])
        lines += [
            f'<joint name="{link.name}" type="{link.kind}">',
            f'<parent link="{link.parent or BASE}"/>',
            f'<child link="{link.name}"/>',
            _origin(link.position, link.turned),
            f'<axis xyz="{_spaced(link.axis)}"/>',
            f'<limit lower="{link.lower}" upper="{link.upper}" effort="1000" velocity="10"/>',
            f'<dynamics damping="{link.damping}"/>',
            "</joint>",
        ]
    return "\n".join([*lines, "</robot>", ""])


def posts(link: Link) -> Iterator[Part]:
    """Yield posts that join the bars of handles to the solids behind the bars; only pictures show the posts."""
    for feature in link.features.values():
        ahead = rotation(*feature.turned)[:, 0]
        turned = (0.0, float(np.arccos(np.clip(ahead[2], -1.0, 1.0))), float(np.arctan2(ahead[1], ahead[0])))
        for bar in link.parts:
            if bar.kind != "cylinder" or bar.name not in feature.parts:
                continue
            behind = [_solid(part) for part in link.parts if part is not bar and part.kind in ("box", "cylinder")]
            for side in (-1.0, 1.0):
                end = np.array(bar.position) + side * (bar.size[2] / 2 - bar.size[0]) * rotation(*bar.turned)[:, 2]
                way = np.arange(0.0, LONGEST, 0.001)
                gaps = [solid.distance(end + way[:, None] * ahead) for solid in behind]
                inside = np.flatnonzero(np.min([np.full(len(way), np.inf), *gaps], axis=0) <= 0)
                length = way[inside[0]] if len(inside) else 0.0
                if length > bar.size[0] / 2:
                    middle = end + length / 2 * ahead
                    size = (bar.size[0] * SLIM, bar.size[0] * SLIM, float(length))
                    yield Part(f"{bar.name}.post", "cylinder", size, (*middle.tolist(),), turned, bar.color)


def _solid(part: Part) -> Solid:
    """Return a box or cylinder in the frame of its link."""
    return Solid(
        part.name, part.kind, np.array(part.size) / 2, np.array(part.position), rotation(*part.turned), part.name
    )


def _link(name: str, parts: Sequence[Part], mass: float, pictured: Sequence[Part] = ()) -> list[str]:
    """Return a link as lines of URDF, with the inertia of the box around its parts; `pictured` parts are only visible."""
    center, extent = np.zeros(3), np.full(3, 0.1)
    if parts:
        low = np.min([np.array(p.position) - np.array(p.size) / 2 for p in parts], axis=0)
        high = np.max([np.array(p.position) + np.array(p.size) / 2 for p in parts], axis=0)
        center, extent = (low + high) / 2, high - low
    if not mass:
        center = np.zeros(3)  # PyBullet takes the frame of a fixed base for its centre of mass
    squares = extent**2
    ixx, iyy, izz = (max(mass, 1e-3) / 12 * (squares.sum() - square) for square in squares)
    lines = [
        f'<link name="{name}">',
        "<inertial>",
        _origin(tuple(center.tolist()), (0.0, 0.0, 0.0)),
        f'<mass value="{mass}"/>',
        f'<inertia ixx="{ixx:.6g}" iyy="{iyy:.6g}" izz="{izz:.6g}" ixy="0" ixz="0" iyz="0"/>',
        "</inertial>",
    ]
    for part in (*parts, *pictured):
        where, form = _origin(part.position, part.turned), f"<geometry>{_form(part)}</geometry>"
        color = f'<material name="{part.name}"><color rgba="{_spaced(part.color)}"/></material>'
        lines += [f'<visual name="{part.name}">', where, form, color, "</visual>"]
        if part not in pictured:
            lines += [f'<collision name="{part.name}">', where, form, "</collision>"]
    return [*lines, "</link>"]


def _form(part: Part) -> str:
    if part.kind == "cylinder":
        return f'<cylinder radius="{part.size[0] / 2}" length="{part.size[2]}"/>'
    if part.kind == "sphere":
        return f'<sphere radius="{part.size[0] / 2}"/>'
    if part.kind == "mesh":
        return f'<mesh filename="{part.file}"/>'
    return f'<box size="{_spaced(part.size)}"/>'


def _origin(position: Sequence[float], turned: Sequence[float]) -> str:
    return f'<origin xyz="{_spaced(position)}" rpy="{_spaced(turned)}"/>'


def _spaced(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:.6g}" for number in numbers)
