"""Spheres that cover the surface of a mesh, for collision checks.

PyBullet replaces the mesh of a moving link by its convex hull. The spheres cover the surface of the mesh itself.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SPACING = 0.008
"""Maximum distance in metres between neighbouring points of a surface."""
SLACK, LEAST, MOST = 0.2, 0.004, 0.02
"""Maximum protrusion of spheres as a share of the mesh's thickness, and the bounds of this protrusion in metres."""
MOST_POINTS, CANDIDATES, SHARES = 1_500, 150, (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Maximum number of points to cover, maximum number of candidate centres per shell (a scaled copy of the mesh), and the scales of
the shells."""
MOST_PIECES, FARTHEST = 400_000, 1_000.0
"""Maximum number of surface points of a mesh, and maximum distance in metres of its points from the link's origin."""
DIRECTIONS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]


def triangles(file: Path, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Array:
    """Return the triangles (n, 3, 3), in metres, of a mesh in an OBJ or STL file, given the `scale` of the file's unit.

    Raises
    ------
    ValueError
        The file is missing or has another format, or the mesh has no triangles or lies too far from its origin.
    """
    try:
        data = file.read_bytes()
    except OSError as problem:
        raise ValueError(f"cannot read the mesh {file}: {problem.strerror}") from problem
    reader = {".obj": _obj, ".stl": _stl}.get(file.suffix.lower())
    if reader is None:
        raise ValueError(f"the mesh {file} is neither OBJ nor STL; convert it, or cover the link with primitives")
    try:
        found = reader(data)
    except (ValueError, IndexError, OverflowError) as problem:
        raise ValueError(f"the mesh {file} can't be read: {problem}") from problem
    if not len(found) or not np.isfinite(found).all():
        raise ValueError(f"the mesh {file} has no triangles, or vertices that aren't finite")
    with np.errstate(over="ignore", invalid="ignore"):
        scaled: Array = found * np.array(scale)
    if not np.abs(scaled).max() <= FARTHEST:
        raise ValueError(f"the mesh {file} lies more than {FARTHEST:.0f} m away; give its scale in metres")
    return scaled


def _obj(data: bytes) -> Array:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.partition("/")[0]) for word in words[1:]]
            corners = [corner - 1 if corner > 0 else corner + len(vertices) for corner in corners]
            faces += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    found: Array = np.array(vertices, dtype=float).reshape(-1, 3)[np.array(faces, dtype=int).reshape(-1, 3)]
    return found


def _stl(data: bytes) -> Array:
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        rows = np.frombuffer(data, offset=84, dtype=[("corners", "<f4", (4, 3)), ("more", "<u2")], count=count)
        return np.asarray(rows["corners"][:, 1:], dtype=float)
    words = [
        line.split()[1:] for line in data.decode("utf-8", "replace").splitlines() if line.split()[:1] == ["vertex"]
    ]
    return np.array(words, dtype=float).reshape(-1, 3, 3)


def surface(corners: Array) -> Array:
    """Return points (n, 3) on triangles (m, 3, 3); neighbouring points are at most about `SPACING` metres apart."""
    found = [corners.reshape(-1, 3)]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(1)
    parts = np.ceil(edges / SPACING)
    if not (parts**2).sum() <= MOST_PIECES:
        raise ValueError(f"a mesh takes more than {MOST_PIECES} points; give its scale in metres")
    parts = parts.astype(int)
    for count in sorted(set(parts.tolist()) - {0, 1}):
        u, v = (part.ravel() / count for part in np.mgrid[0 : count + 1, 0 : count + 1])
        inside = u + v <= 1 + 1e-9
        weights = np.stack([1 - u - v, u, v], -1)[inside]
        found.append((weights @ corners[parts == count]).reshape(-1, 3))
    return np.concatenate(found)


@lru_cache(maxsize=256)
def covered_mesh(file: Path, scale: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return the spheres of `cover` for a mesh file; results are cached."""
    return cover(triangles(file, scale))


def bounds(file: Path, scale: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return the lower and the upper corner of the axis-aligned box around a mesh."""
    corners = triangles(file, scale).reshape(-1, 3)
    return corners.min(0), corners.max(0)


def cover(corners: Array) -> tuple[Array, Array]:
    """Return centres (n, 3) and radii (n,) of spheres that cover triangles (m, 3, 3) and protrude little.

    The radius of a candidate sphere is its distance from the surface, or from the convex hull if the hull is nearer, plus the
    allowed protrusion. The allowed protrusion is the share `SLACK` of the mesh's thickness, between `LEAST` and `MOST` metres.
    The algorithm chooses the candidate that covers most uncovered points, until all points are covered.
    """
    points = _thinned(surface(corners), MOST_POINTS)
    low, high = points.min(0), points.max(0)
    slack = float(np.clip(SLACK * (high - low).min(), LEAST, MOST))
    candidates = np.concatenate(
        [_thinned((low + high) / 2 * (1 - share) + share * points, CANDIDATES) for share in SHARES]
    )
    distances = np.linalg.norm(candidates[:, None] - points, axis=-1)
    # a hollow of the mesh lies inside the hull
    to_hull = ((points @ DIRECTIONS.T).max(0) - candidates @ DIRECTIONS.T).min(1)
    radii = np.minimum(distances.min(1), to_hull) + slack
    covers = distances <= radii[:, None]
    missing, chosen = np.ones(len(points), dtype=bool), []
    while missing.any():
        counts = covers[:, missing].sum(1)
        best = int(np.argmax(counts))
        if not counts[best]:  # only points between the candidates on the surface are left
            left = points[missing][:1]
            candidates, radii = np.concatenate([candidates, left]), np.append(radii, slack)
            covers = np.concatenate([covers, np.linalg.norm(left - points, axis=-1)[None] <= slack])
            best = len(candidates) - 1
        chosen.append(best)
        missing &= ~covers[best]
    return candidates[chosen], radii[chosen]


def _thinned(points: Array, most: int) -> Array:
    return points[:: 1 + len(points) // most]
