"""The parts of a URDF file that kinematics and collision checks need, placed in the world at the zero posture.

Lengths are in metres, angles in radians. PyBullet loads the same file and reads visual geometry and inertia.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from confab.reasoner.embodiment.facts import pybullet_data
from confab.sim.meshes import bounds, covered_mesh

Array = NDArray[np.float64]
MOST_LINKS, MOST_SPHERES = 500, 10_000
"""Maximum length of a chain of links, and maximum number of spheres that cover one shape; larger models are rejected."""
FARTHEST = 1e6
"""Maximum absolute value of a number; the squares of much larger numbers would overflow."""
MOVABLE = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Joint:
    """A joint at the zero posture: parent and child link, a point on the axis, and the direction of the axis in the world."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    lower: float
    upper: float
    velocity: float


@dataclass(frozen=True)
class Spheres:
    """Spheres that cover a link's collision shapes: world centres (n, 3) at the zero posture, radii (n,)."""

    centers: Array
    radii: Array


@dataclass(frozen=True)
class LinkShape:
    """A box (half extents) or cylinder (radius, radius, half height) of a link, in the world at the zero posture."""

    name: str
    kind: str
    half: Array
    center: Array
    rotation: Array


@dataclass(frozen=True)
class UrdfModel:
    """A robot or mechanism at the zero posture: joints by name, and the frame, spheres and solids of each link by name."""

    joints: Mapping[str, Joint]
    frames: Mapping[str, tuple[Array, Array]]
    spheres: Mapping[str, Spheres]
    parents: Mapping[str, Joint]
    primitives: Mapping[str, tuple[LinkShape, ...]]

    @cached_property
    def chains(self) -> Mapping[str, tuple[Joint, ...]]:
        """The joints, including fixed joints, from the base to each link that has spheres."""
        return {link: self.chain(link) for link in self.spheres}

    def chain(self, link: str) -> tuple[Joint, ...]:
        """Return the joints from the base to a link."""
        joints: list[Joint] = []
        while link in self.parents:
            joints.append(self.parents[link])
            link = self.parents[link].parent
        return tuple(reversed(joints))


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix of URDF's fixed-axis roll, pitch and yaw."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def read_urdf(path: str, position: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> UrdfModel:
    """Read a robot whose base stands at `position` (metres), turned by `yaw` (radians).

    Raises
    ------
    ValueError
        The file isn't a URDF robot. The message names the file and the reason.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as problem:
        raise ValueError(f"cannot read the URDF {path}: {problem}") from problem
    return read_model(text, path, position, yaw)


def read_model(
    text: str, path: str, position: tuple[float, float, float], yaw: float, covered: bool = True
) -> UrdfModel:
    """Read a robot or mechanism from the text of a URDF file at `path`; errors are those of `read_urdf`.

    With `covered`, the model has spheres that cover its links, which motion planning needs for an arm.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as problem:
        raise ValueError(f"cannot read the URDF {path}: {problem}") from problem
    elements = {_end(joint, "child"): joint for joint in root.iter("joint") if joint.find("child") is not None}
    links = {link.get("name", ""): link for link in root.iter("link")}
    frames: dict[str, tuple[Array, Array]] = {}
    parents: dict[str, Joint] = {}

    def place(link: str, below: tuple[str, ...] = ()) -> tuple[Array, Array]:
        """Return a link's frame; compute the frames of its ancestors first."""
        if link in below or len(below) > MOST_LINKS:
            raise ValueError(f"link '{link}' hangs on itself, or on more than {MOST_LINKS} other links")
        if link not in frames:
            element = elements.get(link)
            if element is None:
                frames[link] = (rotation(0.0, 0.0, yaw), np.array(position, dtype=float))
            else:
                parent = _end(element, "parent")
                turn, origin = place(parent, (*below, link))
                local, shift = _origin(element)
                frames[link] = (turn @ local, origin + turn @ shift)
                parents[link] = _joint(element, parent, link, *frames[link])
        return frames[link]

    try:
        for link in links:
            place(link)
        folder = Path(path).parent
        spheres = {name: _cover(link, *frames[name], folder) for name, link in links.items()} if covered else {}
        primitives = {name: tuple(_primitives(link, *frames[name], folder)) for name, link in links.items()}
    except ValueError as problem:
        raise ValueError(f"the robot's URDF {path} can't be used: {problem}") from problem
    return UrdfModel({joint.name: joint for joint in parents.values()}, frames, spheres, parents, primitives)


def _end(joint: ET.Element, which: str) -> str:
    """Return the name of the link at one end of a joint."""
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def _numbers(text: str | None, default: str = "0 0 0") -> Array:
    numbers = np.array([float(word) for word in (text or default).split()])
    if len(numbers) != 3 or not (np.abs(numbers) <= FARTHEST).all():  # also rejects nan
        raise ValueError(f"'{text}' where three numbers of at most {FARTHEST:,.0f} belong")
    return numbers


def _number(element: ET.Element | None, name: str, default: float) -> float:
    number = float(default if element is None else element.get(name, default))
    if not math.isfinite(number):
        raise ValueError(f"'{name}' is {number} where a number belongs")
    return number


def _origin(element: ET.Element) -> tuple[Array, Array]:
    origin = element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    return rotation(*_numbers(origin.get("rpy"))), _numbers(origin.get("xyz"))


def _joint(element: ET.Element, parent: str, child: str, turn: Array, origin: Array) -> Joint:
    axis, limit = element.find("axis"), element.find("limit")
    direction = _numbers(None if axis is None else axis.get("xyz"), "1 0 0")
    endless, length = element.get("type") == "continuous", float(np.linalg.norm(direction))
    if not length and element.get("type") not in MOVABLE:  # a fixed joint's axis has no meaning
        direction, length = np.array([1.0, 0.0, 0.0]), 1.0
    if not length:
        raise ValueError(f"joint '{element.get('name')}' has an axis without direction")
    return Joint(
        element.get("name", ""),
        element.get("type", "fixed"),
        parent,
        child,
        origin,
        turn @ (direction / length),
        -math.pi if endless else _number(limit, "lower", 0.0),
        math.pi if endless else _number(limit, "upper", 0.0),
        _number(limit, "velocity", 1.0),
    )


def _cover(link: ET.Element, turn: Array, origin: Array, folder: Path) -> Spheres:
    """Return spheres that cover a link's collision shapes."""
    centers, radii = [np.zeros((0, 3))], [np.zeros(0)]
    for collision in link.iter("collision"):
        local, shift = _origin(collision)
        geometry = collision.find("geometry")
        if geometry is None or not len(geometry):
            continue
        if geometry[0].tag == "mesh":
            points, wide = covered_mesh(*_mesh(geometry[0], folder))
        else:
            points, radius = _primitive(geometry[0])
            wide = np.full(len(points), radius)
        if len(points) > MOST_SPHERES:
            raise ValueError(
                f"link '{link.get('name')}' takes more than {MOST_SPHERES} spheres to cover; give thicker shapes"
            )
        centers.append(origin + (points @ local.T + shift) @ turn.T)
        radii.append(wide)
    return Spheres(np.concatenate(centers), np.concatenate(radii))


def _primitives(link: ET.Element, turn: Array, origin: Array, folder: Path) -> Iterator[LinkShape]:
    """Yield a link's collision shapes as boxes and cylinders: the cylinder around a sphere, and the box around a mesh."""
    for collision in link.iter("collision"):
        local, shift = _origin(collision)
        geometry = collision.find("geometry")
        if geometry is None or not len(geometry):
            continue
        shape, kind = geometry[0], "cylinder"
        if shape.tag == "box":
            half, kind = _numbers(shape.get("size")) / 2, "box"
        elif shape.tag == "mesh":
            low, high = bounds(*_mesh(shape, folder))
            half, kind, shift = (high - low) / 2, "box", shift + local @ (low + high) / 2
        else:
            radius = float(shape.get("radius", 0.0))
            length = float(shape.get("length", 0.0)) + (0.0 if shape.tag == "cylinder" else 2 * radius)
            half = np.array([radius, radius, length / 2])
        yield LinkShape(collision.get("name", ""), kind, half, origin + turn @ shift, turn @ local)


def _mesh(shape: ET.Element, folder: Path) -> tuple[Path, tuple[float, float, float]]:
    """Return the path of a mesh's file and the scale of the mesh."""
    x, y, z = _numbers(shape.get("scale"), "1 1 1")
    return mesh_file(shape.get("filename", ""), folder), (float(x), float(y), float(z))


def mesh_file(name: str, folder: Path) -> Path:
    """Return the path of a mesh that a URDF names; the mesh is in `folder`, in the parent folder, or in PyBullet's data."""
    name = name.removeprefix("package://")
    places = [place for place in (folder, folder.parent, pybullet_data()) if place and (place / name).is_file()]
    if not name or not places:
        raise ValueError(
            f"the mesh '{name}' is neither beside the URDF, nor in the folder above, nor among PyBullet's data"
        )
    return places[0] / name


def _primitive(shape: ET.Element) -> tuple[Array, float]:
    """Return the centres, in the shape's frame, and the radius of spheres that cover a shape."""
    if shape.tag == "sphere":
        return np.zeros((1, 3)), _number(shape, "radius", 0.0)
    if shape.tag in ("cylinder", "capsule"):
        radius, length = _number(shape, "radius", 0.0), _number(shape, "length", 0.0)
        half = length / 2 if shape.tag == "capsule" else max(length / 2 - radius / 2, 0.0)
        return np.array([[0.0, 0.0, z] for z in _spread(half, radius)]), radius
    if shape.tag == "box":
        size = _numbers(shape.get("size")) / 2
        radius = float(np.sort(size)[1])
        axes = [_spread(max(half - radius * 0.8, 0.0), radius) for half in size]
        return np.array([[x, y, z] for x in axes[0] for y in axes[1] for z in axes[2]]), radius
    raise ValueError(f"collision shape '{shape.tag}' is unknown; wanted box, cylinder, capsule, sphere or mesh")


def _spread(half: float, radius: float) -> Array:
    """Return evenly spaced positions from -`half` to `half`, at most `radius` apart."""
    if half <= 0:
        return np.zeros(1)
    if radius * MOST_SPHERES <= 2 * half:
        raise ValueError(f"a shape {2 * half:g} m long and {radius:g} m thick; give a thicker one")
    return np.linspace(-half, half, 1 + math.ceil(2 * half / radius))
