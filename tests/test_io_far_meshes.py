"""Meshes far from 0: what is written is as good in the 32 bits that most clients keep, or it is not written."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from test_clients import of_lib3mf, of_vtk, of_vtk_points
from test_io_mesh_formats import lopsided
from tomomesh.errors import OutputError
from tomomesh.io import write_mesh, write_points
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

NARROW = (".stl", ".glb", ".gii", ".3mf")
"""Formats that hold 32 bits, or whose readers do."""


def far_off(far: float, seed: int = 0) -> TriMesh:
    """Return a mesh about 6 in size, turned, 2 to the power of `far` away."""
    mesh = lopsided()
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))[:3, :3]
    return mesh.moved(mesh.vertices @ turn + 1.01 * 2**far)


def normals(vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.float64]:
    a, b, c = (vertices.astype(np.float64)[faces[:, n]] for n in range(3))
    across = np.cross(b - a, c - a)
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


@law(60)
@given(far=st.floats(0, 30), seed=seeds)
def test_no_face_turns_by_a_quarter_of_a_right_angle(far: float, seed: int) -> None:
    """Near 0 it is always written, far away never: rounding moves a coordinate by up to 2 ** far / 2 ** 24."""
    mesh = far_off(far, seed)
    with TemporaryDirectory() as folder:
        try:
            write_mesh(mesh, Path(folder, "m.stl"))
        except OutputError:
            assert far > 17
            return
        found = trimesh.load(Path(folder, "m.stl"), process=False)
    assert far < 21
    turned = (normals(mesh.vertices, mesh.faces) * normals(found.vertices, found.faces)).sum(axis=1)
    assert turned.min() > np.cos(np.pi / 8)


@pytest.mark.parametrize("suffix", NARROW)
def test_a_mesh_that_would_be_rough_is_refused_though_no_two_vertices_fall_together(
    tmp_path: Path, suffix: str
) -> None:
    mesh = far_off(21)
    assert len(np.unique(mesh.vertices.astype(np.float32), axis=0)) == len(mesh.vertices)
    write_mesh(far_off(17), tmp_path / f"m{suffix}", frame="RAS")
    with pytest.raises(OutputError, match=r"apart and in place.*--local-origin"):
        write_mesh(mesh, tmp_path / f"far{suffix}", frame="RAS")
    assert [path.name for path in tmp_path.iterdir()] == [f"m{suffix}"]


@pytest.mark.parametrize(("far", "dtype"), [(17, np.float32), (21, np.float64)])
def test_32_bits_that_were_asked_for_stay_64_there(tmp_path: Path, far: float, dtype: type) -> None:
    mesh = far_off(far)
    write_mesh(mesh, tmp_path / "m.vtp", precision=32)
    np.testing.assert_array_equal(of_vtk(tmp_path / "m.vtp")[0], mesh.vertices.astype(dtype))
    write_points(PointSet.from_positions(mesh.vertices), tmp_path / "p.vtp", precision=32)
    np.testing.assert_array_equal(of_vtk_points(tmp_path / "p.vtp"), mesh.vertices.astype(dtype))


def test_lib3mf_opens_none_beyond_its_largest_coordinate(tmp_path: Path) -> None:
    mesh = TriMesh(1e6 * np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    write_mesh(mesh, tmp_path / "m.3mf", unit="m")
    np.testing.assert_array_equal(of_lib3mf(tmp_path / "m.3mf")[0], 1e9 * np.eye(4, 3, -1))
    with pytest.raises(OutputError, match="so far from 0"):
        write_mesh(mesh.moved(1.001 * mesh.vertices), tmp_path / "m.3mf", unit="m")
