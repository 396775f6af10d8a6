"""Bodies of the world: their shape, mass and appearance.

`KINDS` maps each kind of shape to the function that creates the body in PyBullet, and to the cylinder that represents
the body in motion planning. A vessel is a solid of revolution. The collision shape of a vessel is a bottom cylinder and
a ring of flat boxes for each segment of the profile. The visual shape of a vessel is a smooth mesh. The origin of a
body's frame is the middle of the body's bottom face, with z up. Units are metres and kilograms.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import ArrayLike

from confab.reasoner.embodiment.values import Shape
from confab.sim.urdf import Array

with suppress(ImportError):  # shapes can be measured without PyBullet
    import pybullet

UP = np.array([0.0, 0.0, 1.0])

PLANKS = 12
"""Number of flat boxes in each ring of a vessel's wall."""

STEP = 0.001
"""A segment of the outline of a solid of revolution gets no collision cylinder if its height in metres is at most this number."""

SIDES = 40
"""Number of corners of the polygon that stands for a circle in a visual mesh."""


@dataclass(frozen=True)
class ShapeKind:
    """A kind of shape, with a function that creates a body, and functions for radius and height of the cylinder around a shape."""

    make: Callable[[int, Shape, Array, Array], int]
    outer: Callable[[Shape], float]
    height: Callable[[Shape], float]


def wall(shape: Shape) -> float:
    """Return the thickness of a vessel's wall in metres."""
    return float(shape.numbers.get("wall", 0.004))


def vessel_height(shape: Shape) -> float:
    """Return the height of a vessel's rim above its base."""
    return shape.profile[-1][0]


def vessel_radius(shape: Shape) -> float:
    """Return the largest outer radius of a vessel."""
    return max(radius for _, radius in shape.profile) + wall(shape)


def inner_radius(shape: Shape, height: Array) -> Array:
    """Return a vessel's inner radius at heights above its base."""
    return np.interp(height, [h for h, _ in shape.profile], [r for _, r in shape.profile])


def make_vessel(client: int, shape: Shape, position: Array, orientation: Array) -> int:
    """Make a vessel from a generated URDF, since PyBullet's compound shapes are limited to 16 parts.

    PyBullet's parser requires short lines.
    """
    planks = [PLANK.format(**plank) for plank in _planks(shape)]
    base = shape.profile[0][1] + wall(shape)
    inertia = shape.mass * (base**2 / 2 + vessel_height(shape) ** 2 / 12)
    mesh = _revolved(shape)
    text = VESSEL.format(
        height=center_height(shape),
        mass=shape.mass,
        inertia=inertia,
        mesh=file_name(mesh, "obj"),
        color=" ".join(str(part) for part in shape.color),
        radius=base,
        bottom=wall(shape),
        middle=wall(shape) / 2,
        planks="\n".join(planks),
    )
    body = load_written(text, position, orientation, mesh, useMaximalCoordinates=True, physicsClientId=client)
    return _with_friction(client, shape, body)


def load_written(text: str, position: ArrayLike, orientation: ArrayLike, mesh: str = "", **options: Any) -> int:
    """Load a URDF given as text, with an optional OBJ mesh that the URDF refers to by `file_name`; return the body.

    The temporary files are deleted after loading. Equal texts get equal file names, since PyBullet never frees its cache of
    files: a new name costs 50 KB.
    """
    with _LOADING:
        folder = Path(tempfile.gettempdir()) / _folder(os.getpid())
        folder.mkdir(mode=0o700)
        try:
            if mesh:
                (folder / file_name(mesh, "obj")).write_text(mesh, encoding="utf-8")
            urdf = folder / file_name(text, "urdf")
            urdf.write_text(text, encoding="utf-8")
            return int(
                pybullet.loadURDF(str(urdf), np.asarray(position).tolist(), np.asarray(orientation).tolist(), **options)
            )
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def file_name(text: str, kind: str) -> str:
    """Return the name of the temporary file for a text: a hash of the text, with the suffix `kind`."""
    return f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.{kind}"


@cache
def _folder(process: int) -> str:
    """Return the unguessable name of a process's folder for temporary files."""
    return f"confab-bodies-{process}-{uuid4().hex}"


_LOADING = Lock()


VESSEL = """<robot name="vessel"><link name="vessel">
<inertial><origin xyz="0 0 {height}"/><mass value="{mass}"/>
<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="{mesh}"/></geometry>
<material name="wall"><color rgba="{color}"/></material></visual>
<collision><origin xyz="0 0 {middle}"/>
<geometry><cylinder radius="{radius}" length="{bottom}"/></geometry></collision>
{planks}
</link></robot>
"""

PLANK = """<collision>
<origin xyz="{x:.6f} {y:.6f} {z:.6f}" rpy="0 {lean:.6f} {angle:.6f}"/>
<geometry><box size="{thick:.6f} {width:.6f} {length:.6f}"/></geometry></collision>"""


def _planks(shape: Shape) -> Iterator[dict[str, float]]:
    """Yield the measures of the boxes of a vessel's wall, one ring for each segment of the profile."""
    thickness = wall(shape)
    for (low, r_low), (high, r_high) in pairwise(shape.profile):
        radius = (r_low + r_high) / 2 + thickness / 2
        for i in range(PLANKS):
            angle = 2 * math.pi * i / PLANKS
            yield {
                "x": radius * math.cos(angle),
                "y": radius * math.sin(angle),
                "z": (low + high) / 2,
                "lean": math.atan2(r_high - r_low, high - low),
                "angle": angle,
                "thick": thickness,
                "width": 2 * (max(r_low, r_high) + thickness) * math.tan(math.pi / PLANKS),
                "length": math.hypot(high - low, r_high - r_low),
            }


def _revolved(shape: Shape) -> str:
    """Return the visual mesh of a vessel as OBJ text: outside, rim, inside and bottom."""
    thickness = wall(shape)
    inner = [(h, r) for h, r in reversed(shape.profile)][:-1]
    bottom = [(thickness, shape.profile[0][1]), (thickness, 0.0)]
    outline = [(0.0, 0.0), *[(h, r + thickness) for h, r in shape.profile], *inner, *bottom]
    lines, count = ["usemtl wall"], 0
    for (h0, r0), (h1, r1) in pairwise(outline):
        size = max(math.hypot(h1 - h0, r1 - r0), 1e-9)
        out, up = (h1 - h0) / size, (r0 - r1) / size
        for i in range(SIDES):
            cos, sin = math.cos(2 * math.pi * i / SIDES), math.sin(2 * math.pi * i / SIDES)
            lines += [f"v {r * cos:.5f} {r * sin:.5f} {h:.5f}" for h, r in ((h0, r0), (h1, r1))]
            lines += [f"vn {out * cos:.4f} {out * sin:.4f} {up:.4f}"] * 2
        for i in range(SIDES):
            a, b = count + 2 * i + 1, count + 2 * ((i + 1) % SIDES) + 1
            lines += [f"f {a}//{a} {b}//{b} {a + 1}//{a + 1}", f"f {a + 1}//{a + 1} {b}//{b} {b + 1}//{b + 1}"]
        count += 2 * SIDES
    return "\n".join(lines) + "\n"


def make_turned(client: int, shape: Shape, position: Array, orientation: Array) -> int:
    """Make a solid of revolution, such as a lid with a knob, from one cylinder per segment of its outline."""
    lines = []
    for (low, below), (high, above) in pairwise(shape.profile):
        if high - low <= STEP:
            continue
        where = f'<origin xyz="0 0 {(low + high) / 2:.6f}"/>'
        form = f'<geometry><cylinder radius="{(below + above) / 2:.6f}" length="{high - low:.6f}"/></geometry>'
        color = f'<material name="turned"><color rgba="{" ".join(str(part) for part in shape.color)}"/></material>'
        lines += ["<visual>", where, form, color, "</visual>", "<collision>", where, form, "</collision>"]
    radius, height = max(r for _, r in shape.profile), shape.profile[-1][0]
    inertia = shape.mass * (radius**2 / 4 + height**2 / 12)
    text = TURNED.format(center=center_height(shape), mass=shape.mass, inertia=inertia, solids="\n".join(lines))
    body = load_written(text, position, orientation, useMaximalCoordinates=True, physicsClientId=client)
    return _with_friction(client, shape, body)


TURNED = """<robot name="turned"><link name="turned">
<inertial><origin xyz="0 0 {center}"/><mass value="{mass}"/>
<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
{solids}
</link></robot>
"""


def make_cylinder(client: int, shape: Shape, position: Array, orientation: Array) -> int:
    """Make a solid cylinder of `radius` and `height`."""
    radius, height = shape.numbers["radius"], shape.numbers["height"]
    frame = {"physicsClientId": client}
    collision = pybullet.createCollisionShape(
        pybullet.GEOM_CYLINDER, radius=radius, height=height, collisionFramePosition=[0, 0, height / 2], **frame
    )
    visual = pybullet.createVisualShape(
        pybullet.GEOM_CYLINDER,
        radius=radius,
        length=height,
        visualFramePosition=[0, 0, height / 2],
        rgbaColor=shape.color,
        **frame,
    )
    return _body(client, shape, collision, visual, position, orientation)


def make_box(client: int, shape: Shape, position: Array, orientation: Array) -> int:
    """Make a solid box of `width` (x), `depth` (y) and `height`."""
    half = [shape.numbers["width"] / 2, shape.numbers["depth"] / 2, shape.numbers["height"] / 2]
    frame = {"physicsClientId": client, "halfExtents": half}
    collision = pybullet.createCollisionShape(pybullet.GEOM_BOX, collisionFramePosition=[0, 0, half[2]], **frame)
    visual = pybullet.createVisualShape(
        pybullet.GEOM_BOX, visualFramePosition=[0, 0, half[2]], rgbaColor=shape.color, **frame
    )
    return _body(client, shape, collision, visual, position, orientation)


def center_height(shape: Shape) -> float:
    """Return the height of the centre of mass above the base."""
    return KINDS[shape.kind].height(shape) * 0.42


def _body(client: int, shape: Shape, collision: int, visual: int, position: Array, orientation: Array) -> int:
    """Create a body with friction in PyBullet's maximal coordinates, which are three times as fast as a multibody."""
    body = pybullet.createMultiBody(
        baseMass=shape.mass,
        baseCollisionShapeIndex=collision,
        baseVisualShapeIndex=visual,
        basePosition=list(position),
        baseOrientation=list(orientation),
        baseInertialFramePosition=[0, 0, center_height(shape)],
        useMaximalCoordinates=True,
        physicsClientId=client,
    )
    return _with_friction(client, shape, body)


def _with_friction(client: int, shape: Shape, body: int) -> int:
    """Set a body's friction, and return the body."""
    pybullet.changeDynamics(
        body, -1, lateralFriction=shape.friction, spinningFriction=0.01, rollingFriction=0.001, physicsClientId=client
    )
    return int(body)


KINDS: Mapping[str, ShapeKind] = {
    "vessel": ShapeKind(make_vessel, vessel_radius, vessel_height),
    "turned": ShapeKind(make_turned, lambda s: max(radius for _, radius in s.profile), lambda s: s.profile[-1][0]),
    "cylinder": ShapeKind(make_cylinder, lambda s: s.numbers["radius"], lambda s: s.numbers["height"]),
    "box": ShapeKind(
        make_box, lambda s: math.hypot(s.numbers["width"], s.numbers["depth"]) / 2, lambda s: s.numbers["height"]
    ),
}


def outer_radius(shape: Shape) -> float:
    """Return the radius of the upright cylinder around the shape."""
    return KINDS[shape.kind].outer(shape)


def half_width(shape: Shape, height: float, turned: Array) -> Array:
    """Return half of a shape's width (n,) between fingers at `height`, for hands at angles `turned` (n,) from its x axis."""
    if shape.kind == "box":
        width, depth = (shape.numbers[name] / 2 for name in ("width", "depth"))
        return np.asarray(width * np.abs(np.sin(turned)) + depth * np.abs(np.cos(turned)))
    return np.full(np.shape(turned), float(np.interp(height, *outline(shape))))


def height_of(shape: Shape) -> float:
    """Return the height of the shape above its base."""
    return KINDS[shape.kind].height(shape)


def pieces(shape: Shape, hollow: bool = False) -> Iterator[tuple[str, tuple[float, float, float], Array, Array]]:
    """Yield the solids that represent a shape in motion planning: kind, half extents, middle (3,) and rotation (3, 3).

    A vessel is a solid cylinder. With `hollow`, for a vessel into which objects are put, it is a bottom and a wall.
    """
    if shape.kind == "box":
        width, depth, height = (shape.numbers[name] / 2 for name in ("width", "depth", "height"))
        yield "box", (width, depth, height), height * UP, np.eye(3)
        return
    if hollow and shape.kind == "vessel":
        half, base = wall(shape) / 2, shape.profile[0][1] + wall(shape)
        yield "cylinder", (base, base, half), half * UP, np.eye(3)
        for plank in _planks(shape):
            turned = pybullet.getMatrixFromQuaternion(
                pybullet.getQuaternionFromEuler([0, plank["lean"], plank["angle"]])
            )
            size = plank["thick"] / 2, plank["width"] / 2, plank["length"] / 2
            yield "box", size, np.array([plank["x"], plank["y"], plank["z"]]), np.array(turned).reshape(3, 3)
        return
    ends = (
        pairwise(shape.profile) if shape.kind == "turned" else [((0.0, 0.0), (height_of(shape), outer_radius(shape)))]
    )
    for (low, below), (high, above) in ends:
        if high - low > STEP:
            radius = max(below, above)
            yield "cylinder", (radius, radius, (high - low) / 2), (low + high) / 2 * UP, np.eye(3)


def outline(shape: Shape) -> tuple[Array, Array]:
    """Return heights and outer radii of the outline of an upright shape."""
    if shape.profile:
        heights, radii = np.array(shape.profile).T
        return heights, radii + (wall(shape) if shape.kind == "vessel" else 0.0)
    return np.array([0.0, height_of(shape)]), np.full(2, outer_radius(shape))


def packed(shape: Shape, count: int, radius: float) -> Array:
    """Return positions (count, 3) of beads of `radius` in a vessel's frame: layers of rings from the bottom up.

    Raises
    ------
    ValueError
        The vessel has no room for `count` beads. The message gives the number of beads that fit.
    """
    spots: list[tuple[float, float, float]] = []
    height, pitch, layer = wall(shape) + radius * 1.05, radius * 2.06, 0
    while height < vessel_height(shape):
        room = float(inner_radius(shape, np.array(height))) - radius * 1.1
        rings = [room - i * pitch for i in range(int(room / pitch) + 1)] if room > 0 else []
        for ring in rings:
            number = max(1, int(math.pi / math.asin(min(1.0, pitch / 2 / max(ring, pitch / 2)))))
            number = 1 if ring < pitch / 2 else number
            for i in range(number):
                angle = 2 * math.pi * (i / number) + 0.4 * layer
                spots.append((ring * math.cos(angle), ring * math.sin(angle), height))
        height, layer = height + pitch, layer + 1
    if count > len(spots):
        raise ValueError(f"{count} beads of radius {radius} m don't fit: there is room for {len(spots)}")
    return np.array(spots[:count]).reshape(-1, 3)
