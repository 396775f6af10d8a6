"""Spheres that protrude little cover a mesh; a file that isn't a mesh is reported."""

from pathlib import Path

import numpy as np
import pytest

from confab.reasoner.embodiment.facts import pybullet_data
from confab.sim.meshes import MOST, bounds, cover, surface, triangles

FOLDER = pybullet_data()


@pytest.mark.parametrize(
    "name",
    [
        "franka_panda/meshes/collision/hand.obj",
        "franka_panda/meshes/collision/link5.obj",
        "kuka_iiwa/meshes/link_4.stl",
    ],
)
def test_spheres_cover_every_point_of_a_mesh_and_protrude_little(name: str) -> None:
    assert FOLDER is not None
    corners = triangles(FOLDER / name)
    centers, radii = cover(corners)
    points = surface(corners)
    gaps = np.linalg.norm(points[:, None] - centers, axis=-1) - radii
    assert gaps.min(1).max() < 0.01  # between the points that the algorithm considers
    low, high = bounds(FOLDER / name, (1.0, 1.0, 1.0))
    assert ((centers - radii[:, None]).min(0) > low - MOST - 1e-9).all()
    assert ((centers + radii[:, None]).max(0) < high + MOST + 1e-9).all()
    assert len(radii) < 80


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.obj", "v 0 0 0\n", "has no triangles"),
        ("a.obj", "v 0 0 x\nf 1 1 1\n", "can't be read"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "can't be read"),
        ("a.obj", f"v 0 0 0\nf 1 1 {10**30}\n", "can't be read"),
        ("a.obj", "v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nf 1 2 3\n", "more than 1000 m away"),
        ("a.stl", "solid\n", "has no triangles"),
        ("a.dae", "<x/>", "neither OBJ nor STL; convert it"),
    ],
)
def test_an_invalid_mesh_file_is_refused_with_the_reason(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        triangles(tmp_path / name)


@pytest.mark.parametrize("wide", [100.0, 1e20, 1e200])
def test_a_huge_triangle_is_refused_before_it_is_divided(wide: float) -> None:
    with pytest.raises(ValueError, match="takes more than"), np.errstate(over="ignore"):
        surface(np.array([[(0, 0, 0), (wide, 0, 0), (0, wide, 0)]], dtype=float))


def test_an_excessive_scale_of_a_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    for scale in (1e9, 1e308, float("nan")):
        with pytest.raises(ValueError, match="give its scale in metres"):
            bounds(tmp_path / "a.obj", (scale, scale, scale))
