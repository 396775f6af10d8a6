"""Pictures of the world without a screen or graphics card.

PyBullet's software renderer draws the robot, furniture and solid objects. The renderer has no translucency, and is slow with
hundreds of small spheres. Therefore ray casting against PyBullet's depth image draws drops (spheres) and vessels (surfaces of
revolution), in a fifth of the time. Lengths are in metres. Images are arrays (height, width, 3) of uint8.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from confab.reasoner.embodiment.values import Embodiment, Shape
from confab.sim.arms import read_arm
from confab.sim.assembly import read_robot
from confab.sim.bodies import outline, wall
from confab.sim.collision import fixed_spheres, read_mover
from confab.sim.engine import Engine
from confab.sim.linkage import with_open_mechanisms
from confab.sim.urdf import Array, Spheres
from confab.sim.urdf import rotation as rotated

NEAR, FAR = 0.1, 8.0
SUN = np.array([0.45, 0.35, 0.82])
"""Direction to the light."""

FIELD = 40.0
"""Vertical field of view in degrees."""

DOWN = 0.383
"""Tangent of the angle by which a camera looks down."""

MARGIN = 22
"""Width in pixels of the picture's empty border."""

TALL, LEGS = 0.30, 0.12
"""Distances in metres above and below a place; a picture shows the range between these heights."""

EDGE = 14.0
"""Minimum difference in brightness, on a scale up to 255, between neighbouring pixels on an edge."""

SKY, GROUND = np.array([236.0, 241.0, 247.0]), np.array([196.0, 205.0, 216.0])
"""Colours of the backdrop at the top and at the bottom."""


@dataclass(frozen=True)
class Camera:
    """A camera: eye and target in metres, vertical field of view in degrees, size in pixels."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field: float = 40.0
    width: int = 960
    height: int = 544

    @cached_property
    def axes(self) -> Array:
        """Right, up and forward directions as rows."""
        forward = np.array(self.target) - np.array(self.eye)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    @cached_property
    def focal(self) -> float:
        """Focal length in pixels."""
        return self.height / 2 / float(np.tan(np.radians(self.field) / 2))

    @cached_property
    def rays(self) -> Array:
        """Directions (height, width, 3) of the pixels' rays, with length 1 along the forward axis."""
        x = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal
        y = (self.height / 2 - np.arange(self.height) - 0.5) / self.focal
        right, up, forward = self.axes
        rays: Array = forward + x[None, :, None] * right + y[:, None, None] * up
        return rays

    @cached_property
    def backdrop(self) -> Array:
        """Image (height, width, 3) of the gradient from sky to ground."""
        part = np.linspace(0, 1, self.height)[:, None, None] ** 1.3
        whole = np.broadcast_to(SKY * (1 - part) + GROUND * part, (self.height, self.width, 3))
        return np.ascontiguousarray(whole, dtype=np.float32)

    def pixel(self, point: Array) -> tuple[float, float]:
        """Return the column and row of a point."""
        x, y, z = self.axes @ (point - np.array(self.eye))
        return float(self.width / 2 + self.focal * x / z), float(self.height / 2 - self.focal * y / z)

    def window(self, center: Array, radius: float) -> tuple[slice, slice] | None:
        """Return the rows and columns that a sphere can cover, or None if the sphere lies outside the picture."""
        x, y, z = self.axes @ (center - np.array(self.eye))
        if z < NEAR:
            return None
        reach = self.focal * radius / max(z - radius, NEAR) + 1
        column, row = self.width / 2 + self.focal * x / z, self.height / 2 - self.focal * y / z
        rows = slice(max(0, int(row - reach)), min(self.height, int(row + reach) + 2))
        columns = slice(max(0, int(column - reach)), min(self.width, int(column + reach) + 2))
        return (rows, columns) if rows.start < rows.stop and columns.start < columns.stop else None


def view_of(
    embodiment: Embodiment, width: int = 960, height: int = 544, below: int = 0, around: float = 0.0, down: float = DOWN
) -> Camera:
    """Return the nearest camera, on the side opposite the robots, that shows robots and furniture completely.

    Parameters
    ----------
    embodiment : Embodiment
    width, height : int
        Pixels.
    below : int
        Pixels at the bottom that are reserved for a caption.
    around : float
        Angle in radians, counterclockwise from above, by which the camera is turned about the tables.
    down : float
        Tangent of the angle by which the camera looks down.
    """
    places, _ = with_open_mechanisms(embodiment)
    middle = np.array([place.position for place in places.values()]).mean(0)
    robots = [robot.position for robot in embodiment.robots]
    base = np.mean(robots, axis=0) if robots else middle - [0.5, 0.0, 0.0]
    away = middle - base
    away[2] = 0.0
    away /= max(float(np.linalg.norm(away)), 1e-9)
    away = rotated(0.0, 0.0, around) @ away
    side = np.array([-away[1], away[0], 0.0])
    forward = -0.96 * away + 0.48 * side - 1.07 * down * np.array([0.0, 0.0, 1.0])
    look = Camera((0.0, 0.0, 0.0), _three(forward), FIELD, width, height)
    x, y, z = look.axes @ _seen(embodiment).T
    wide = (width / 2 - MARGIN) / look.focal
    up, low = (height / 2 - MARGIN) / look.focal, (height / 2 - MARGIN - below) / look.focal
    # A point is in the picture if |x - eye| <= wide (z - eye), and likewise for y. Find the nearest eye that sees all points.
    depth = min(
        float((x + wide * z).min() - (x - wide * z).max()) / (2 * wide),
        float((y + low * z).min() - (y - up * z).max()) / (up + low),
    )
    eye_x = ((x + wide * z).min() + (x - wide * z).max()) / 2
    eye_y = ((y + low * z).min() - low * depth + (y - up * z).max() + up * depth) / 2
    eye = np.array([eye_x, eye_y, depth]) @ look.axes
    return Camera(_three(eye), _three(eye + look.axes[2]), FIELD, width, height)


def _seen(embodiment: Embodiment) -> Array:
    """Return points (n, 3) that a picture has to show: corners of furniture, points above places, and robots at rest."""
    places, around = with_open_mechanisms(embodiment)
    points: list[Array] = []
    for solid in around:
        corners = np.array([(dx, dy, dz) for dx in (-1, 1) for dy in (-1, 1) for dz in (-1, 1)]) * np.array(solid.half)
        points.append(corners @ solid.rotation.T + solid.center)
    for fixture in embodiment.fixtures:
        half = np.array(fixture.size) / 2
        corners = np.array([(dx, dy, dz) for dx in (-1, 1) for dy in (-1, 1) for dz in (-1, 1)]) * half
        points.append(corners @ rotated(0.0, 0.0, fixture.yaw).T + np.array(fixture.position))
    for place in places.values():
        x, y, z = place.position
        points.append(np.array([(x, y, z), (x, y, z + TALL)]))
    for robot in embodiment.robots:
        model = read_robot(robot)
        arms = [read_arm(model, hand.arm, hand.tip, hand.turned, hand.home) for hand in robot.hands]
        covers = [fixed_spheres(model, arms)]
        for hand, arm in zip(robot.hands, arms, strict=True):
            mover = read_mover(model, arm, dict.fromkeys(hand.fingers, hand.opening))
            covers.append(Spheres(mover.at(np.array([hand.home]))[0], mover.spheres.radii))
        for cover in covers:
            for shift in (-1.0, 1.0):
                points.append(cover.centers + shift * cover.radii[:, None] * np.array([0.0, 0.0, 1.0]))
    seen = np.concatenate(points)
    low = min((place.position[2] for place in places.values()), default=0.0) - LEGS
    return np.maximum(seen, [-np.inf, -np.inf, low])


def _three(point: Array) -> tuple[float, float, float]:
    return (float(point[0]), float(point[1]), float(point[2]))


def hide_vessels(world: Engine) -> None:
    """Hide vessels from PyBullet's renderer, since `picture` draws the vessels."""
    for thing in world.bodies.values():
        if thing.shape.kind == "vessel":
            pybullet.changeVisualShape(thing.body, -1, rgbaColor=[1, 1, 1, 0], physicsClientId=world.client)


def picture(world: Engine, camera: Camera) -> Array:
    """Return the camera's image (height, width, 3)."""
    image, depth = _opaque(world, camera)
    _cast_shadows(world, image, depth, camera)
    vessels = [(world.truth(name), thing.shape) for name, thing in world.bodies.items() if thing.shape.kind == "vessel"]
    for (rotation, base), shape in vessels:
        if shape.color[3] >= 1:
            _draw_opaque(image, depth, camera, rotation, base, shape)
    for center, radius, color in _drops(world):
        _draw_sphere(image, depth, camera, center, radius, color)
    glasses = [vessel for vessel in vessels if vessel[1].color[3] < 1]
    eye = np.array(camera.eye)
    for (rotation, base), shape in sorted(glasses, key=lambda v: -float(np.linalg.norm(v[0][1] - eye))):
        _draw_glass(image, depth, camera, rotation, base, shape)
    shown: Array = np.clip(image, 0, 255).astype(np.uint8)
    return shown


def _cast_shadows(world: Engine, image: Array, depth: Array, camera: Camera) -> None:
    """Darken table tops in the shadows of arms and bodies; a higher body casts a softer shadow."""
    casters = list(_casters(world))
    for fixture in world.embodiment.fixtures:
        top = fixture.position[2] + fixture.size[2] / 2
        distance, x, y = _plane(camera, top)
        on = np.flatnonzero(np.abs(depth - distance) <= 0.01)
        dark = np.ones(depth.shape, dtype=np.float32)
        for center, radius in casters:
            height = center[2] - top
            if not 0 <= height <= 0.35:
                continue
            spot = center - SUN * height / SUN[2]
            soft = 0.006 + 0.12 * height
            window = camera.window(spot, radius + soft)
            if window is not None:
                away = np.hypot(x[window] - np.float32(spot[0]), y[window] - np.float32(spot[1]))
                lit = np.clip((away - np.float32(radius - soft)) / np.float32(2 * soft), 0.0, 1.0)
                lit = 1 - np.float32(0.34 * min(1.0, radius / soft)) * (1 - lit * lit * (3 - 2 * lit))
                np.minimum(dark[window], lit, out=dark[window])
        on = on[dark.reshape(-1)[on] < 1.0]
        image.reshape(-1, 3)[on] *= dark.reshape(-1)[on, None]


@lru_cache(maxsize=8)
def _plane(camera: Camera, height: float) -> tuple[Array, Array, Array]:
    """Return, for each pixel, where its ray meets the horizontal plane at `height`: the distance along the ray, x and y."""
    with np.errstate(divide="ignore"):
        distance = (height - camera.eye[2]) / camera.rays[..., 2]
    distance = np.where(np.isfinite(distance) & (distance > 0), distance, 1e6)
    x, y = (camera.eye[axis] + distance * camera.rays[..., axis] for axis in (0, 1))
    return distance.astype(np.float32), x.astype(np.float32), y.astype(np.float32)


def _casters(world: Engine) -> Iterator[tuple[Array, float]]:
    """Yield the spheres (centre, radius) that cast shadows: the spheres of the arms, and a column of spheres for each body."""
    for hand in world.hands.values():
        mover = hand.mover()
        yield from zip(mover.at(hand.measured()[None])[0], mover.spheres.radii.tolist(), strict=True)
    for name, thing in world.bodies.items():
        rotation, base = world.truth(name)
        heights, radii = outline(thing.shape)
        for height in np.arange(0.0, float(heights[-1]), 0.012):
            yield base + rotation[:, 2] * height, float(np.interp(height, heights, radii)) * 0.9


def _opaque(world: Engine, camera: Camera) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return PyBullet's picture in front of a backdrop, and the depth of each pixel along the forward axis."""
    _, _, colors, buffer, _ = pybullet.getCameraImage(
        camera.width,
        camera.height,
        pybullet.computeViewMatrix(camera.eye, camera.target, [0, 0, 1]),
        pybullet.computeProjectionMatrixFOV(camera.field, camera.width / camera.height, NEAR, FAR),
        lightDirection=(SUN * 3).tolist(),
        lightColor=[1, 1, 1],
        lightDistance=4,
        shadow=0,
        lightAmbientCoeff=0.62,
        lightDiffuseCoeff=0.42,
        lightSpecularCoeff=0.12,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=world.client,
    )
    colors = np.asarray(colors, dtype=np.uint8).reshape(camera.height, camera.width, 4)
    buffer = np.asarray(buffer, dtype=np.float32).reshape(camera.height, camera.width)
    depth = np.float32(FAR * NEAR) / (np.float32(FAR) - np.float32(FAR - NEAR) * buffer)
    image, something = camera.backdrop.copy(), np.flatnonzero(buffer <= 0.9999)
    image.reshape(-1, 3)[something] = colors.reshape(-1, 4)[something, :3]
    _soften(image)
    return image, depth


def _soften(image: NDArray[Any]) -> None:
    """Blend pixels on edges with their neighbours, since PyBullet's renderer draws edges as stairs."""
    height, width = image.shape[:2]
    green = image[..., 1]
    across, down = np.abs(np.diff(green, axis=1)) > EDGE, np.abs(np.diff(green, axis=0)) > EDGE
    edge = np.zeros(green.shape, dtype=bool)
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    edge[[0, -1]] = edge[:, [0, -1]] = False
    at, pixels = np.flatnonzero(edge), image.reshape(height * width, 3)
    around = pixels[at - 1] + pixels[at + 1] + pixels[at - width] + pixels[at + width]
    corners = pixels[at - width - 1] + pixels[at - width + 1] + pixels[at + width - 1] + pixels[at + width + 1]
    pixels[at] = pixels[at] / 4 + around / 8 + corners / 16


def _drops(world: Engine) -> Iterator[tuple[Array, float, Array]]:
    """Yield centre, radius and colour of the beverage's beads."""
    get = pybullet.getBasePositionAndOrientation
    for bead in world.beads:
        filling = world.embodiment.fillings[bead.filling]
        yield (
            np.array(get(bead.body, physicsClientId=world.client)[0]),
            filling.radius,
            np.array(filling.color[:3]) * 255,
        )


def _draw_sphere(image: Array, depth: Array, camera: Camera, center: Array, radius: float, color: Array) -> None:
    """Draw the pixels of a shaded sphere that no nearer object covers."""
    window = camera.window(center, radius)
    if window is None:
        return
    rays = camera.rays[window]
    offset = np.array(camera.eye) - center
    a, b = np.einsum("ijk,ijk->ij", rays, rays), rays @ offset
    root = b * b - a * (offset @ offset - radius * radius)
    distance = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    seen = (root > 0) & (distance < depth[window])
    normal = (offset + distance[..., None] * rays) / radius
    light = np.clip(normal @ SUN, 0.0, 1.0)
    shade = (0.5 + 0.5 * light)[..., None] * color + 18 * (light**30)[..., None]
    image[window][seen] = shade[seen]
    depth[window][seen] = distance[seen]


def _look(
    camera: Camera, rotation: Array, base: Array, shape: Shape
) -> tuple[tuple[slice, slice], Array, Array, Array, Array] | None:
    """Return a vessel's window in the picture (or None), rays and eye in the vessel's frame, and the vessel's outer profile."""
    heights, radii = np.array(shape.profile).T
    radii = radii + wall(shape)
    reach = float(np.hypot(heights[-1] / 2, radii.max()))
    window = camera.window(base + rotation[:, 2] * heights[-1] / 2, reach)
    if window is None:
        return None
    return window, camera.rays[window] @ rotation, (np.array(camera.eye) - base) @ rotation, heights, radii


def _draw_opaque(image: Array, depth: Array, camera: Camera, rotation: Array, base: Array, shape: Shape) -> None:
    """Draw the pixels of an opaque vessel's wall and inner bottom that no nearer object covers."""
    look = _look(camera, rotation, base, shape)
    if look is None:
        return
    window, rays, origin, heights, radii = look
    distance, _ = _walls(origin, rays, heights, radii)
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = (heights[0] - origin[2]) / rays[..., 2]
        inside = np.hypot(*(origin[axis] + floor * rays[..., axis] for axis in (0, 1))) <= radii[0]
    on_floor = inside & (floor > 0) & (floor < distance)
    distance = np.where(on_floor, floor, distance)
    seen = np.isfinite(distance) & (distance < depth[window])
    point = origin + np.where(seen, distance, 0.0)[..., None] * rays
    normal = np.where(on_floor[..., None], np.array([0.0, 0.0, 1.0]), _normals(point, heights, radii))
    within = np.einsum("ijk,ijk->ij", normal, rays) > 0
    lit = np.clip(np.where(within[..., None], -normal, normal) @ (SUN @ rotation), 0.0, 1.0)
    shade = (0.62 + 0.42 * lit) * np.where(within | on_floor, 0.7, 1.0)
    color = np.clip(shade[..., None] * np.array(shape.color[:3]) * 255, 0, 255)
    image[window][seen] = color[seen]
    depth[window][seen] = distance[seen]


def _draw_glass(image: Array, depth: Array, camera: Camera, rotation: Array, base: Array, shape: Shape) -> None:
    """Blend the far and the near wall of a translucent vessel over the picture; perpendicular views are more transparent."""
    look = _look(camera, rotation, base, shape)
    if look is None:
        return
    window, rays, origin, heights, radii = look
    near, far = _walls(origin, rays, heights, radii)
    tint, opacity = np.array(shape.color[:3]) * 255, shape.color[3]
    toward = SUN @ rotation
    for distance in (far, near):
        seen = np.isfinite(distance) & (distance < depth[window])
        point = origin + np.where(seen, distance, 0.0)[..., None] * rays
        normal = _normals(point, heights, radii)
        facing = np.abs(np.einsum("ijk,ijk->ij", normal, rays)) / np.linalg.norm(rays, axis=-1)
        rim = np.abs(point[..., 2] - heights[-1]) < 0.003
        alpha = opacity * 0.55 * (0.35 + 1.5 * (1 - facing) ** 2) + 0.35 * rim
        glint = np.clip(normal @ toward, 0.0, 1.0) ** 40
        part = (np.clip(alpha + 0.6 * glint, 0, 0.9) * seen)[..., None]
        color = tint * (0.75 + 0.25 * np.clip(normal @ toward, 0, 1))[..., None] + 160 * (glint + 0.3 * rim)[..., None]
        image[window] = image[window] * (1 - part) + np.clip(color, 0, 255) * part


def _walls(origin: Array, rays: Array, heights: Array, radii: Array) -> tuple[Array, Array]:
    """Return the distances at which rays first enter and last leave a surface of revolution; infinity for rays that miss it."""
    near, far = np.full(rays.shape[:2], np.inf), np.full(rays.shape[:2], -np.inf)
    for (h0, r0), (h1, r1) in pairwise(zip(heights, radii, strict=True)):
        slope = (r1 - r0) / (h1 - h0)
        reach = r0 + slope * (origin[2] - h0)
        a = rays[..., 0] ** 2 + rays[..., 1] ** 2 - (slope * rays[..., 2]) ** 2
        b = rays[..., 0] * origin[0] + rays[..., 1] * origin[1] - slope * rays[..., 2] * reach
        root = b * b - a * (origin[0] ** 2 + origin[1] ** 2 - reach * reach)
        safe = np.where(np.abs(a) < 1e-12, 1e-12, a)
        for sign in (-1.0, 1.0):
            distance = (-b + sign * np.sqrt(np.maximum(root, 0.0))) / safe
            z = origin[2] + distance * rays[..., 2]
            hit = (root > 0) & (z >= h0) & (z <= h1) & (reach + slope * distance * rays[..., 2] > 0)
            near = np.where(hit & (distance < near), distance, near)
            far = np.where(hit & (distance > far), distance, far)
    return near, np.where(np.isfinite(far), far, np.inf)


def _normals(point: Array, heights: Array, radii: Array) -> Array:
    """Return unit normals of a surface of revolution at points on the surface."""
    segment = np.clip(np.searchsorted(heights, point[..., 2]) - 1, 0, len(heights) - 2)
    slope = (np.diff(radii) / np.diff(heights))[segment]
    out = point[..., :2] / np.maximum(np.linalg.norm(point[..., :2], axis=-1, keepdims=True), 1e-9)
    normal = np.concatenate([out, -slope[..., None]], -1)
    unit: Array = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return unit
