"""Arrays of users, of any type and order of memory: what is found does not depend on how they lie."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh import PointSet, Settings, TriMesh, Volume, assess, fill_mesh, reconstruct_points, write_mesh
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.tree import Tree
from tomomesh.model.icosphere import icosphere
from tomomesh.printing.part import make_part

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

Lay = Callable[["NDArray[Any]"], Any]


def every_other(array: NDArray[Any]) -> NDArray[Any]:
    """Return the same numbers as rows and columns between others."""
    wide = np.full([2 * size for size in array.shape], 7, array.dtype)
    wide[::2, 1::2] = array
    return wide[::2, 1::2]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    array = array.copy()
    array.flags.writeable = False
    return array


LAID: dict[str, Lay] = {
    "columns": np.asfortranarray,
    "view": every_other,
    "backwards": lambda array: array[::-1, ::-1].copy()[::-1, ::-1],
    "read-only": frozen,
    "big-endian": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "32 bits": lambda array: array.astype({"f": np.float32, "i": np.int32}[array.dtype.kind]),
    "list": lambda array: array.tolist(),
}
laid = pytest.mark.parametrize("lay", LAID.values(), ids=LAID)


def ball() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return a sphere whose coordinates have 32 bits, so that all types hold them."""
    vertices, faces = icosphere(3)
    return (10 * vertices).astype(np.float32).astype(np.float64), faces


class TestMeshes:
    @laid
    def test_measure_the_same(self, lay: Lay) -> None:
        vertices, faces = ball()
        points = 9.5 * icosphere(2)[0]
        wanted = assess(TriMesh(vertices, faces), points=points)
        assert wanted["closed"]
        for v, f in ((lay(vertices), faces), (vertices, lay(faces)), (lay(vertices), lay(faces))):
            assert assess(TriMesh(v, f), points=points) == wanted

    @laid
    @pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".off", ".vtp", ".glb", ".gii", ".3mf"])
    def test_are_written_the_same(self, lay: Lay, suffix: str, tmp_path: Path) -> None:
        vertices, faces = ball()
        write_mesh(TriMesh(vertices, faces), tmp_path / f"a{suffix}")
        write_mesh(TriMesh(lay(vertices), lay(faces)), tmp_path / f"b{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()

    @laid
    def test_are_filled_and_printed_the_same(self, lay: Lay) -> None:
        vertices, faces = ball()
        grid = Volume.from_stored(np.zeros((8, 8, 8)), np.diag([2.0, 2.0, 2.0, 1.0]))
        mesh, other = TriMesh(vertices, faces), TriMesh(lay(vertices), lay(faces))
        assert fill_mesh(mesh, grid).any()
        assert np.array_equal(fill_mesh(mesh, grid), fill_mesh(other, grid))
        assert make_part(mesh, Settings()).report == make_part(other, Settings()).report

    def test_keep_arrays_that_are_as_they_should_be(self) -> None:
        vertices, faces = ball()
        mesh = TriMesh(vertices, faces)
        assert mesh.vertices is vertices
        assert mesh.faces is faces


class TestTrees:
    @pytest.mark.parametrize("count", [1, 2, 7, 40])
    @pytest.mark.parametrize("lay", [LAID[name] for name in ("columns", "view", "32 bits")])
    def test_find_the_same_faces(self, lay: Lay, count: int) -> None:
        vertices, faces = ball()
        points = np.random.default_rng(0).normal(size=(30, 3)).astype(np.float32).astype(np.float64)
        wanted = Tree.over(vertices, faces[:count].astype(np.int32)).nearest(points)
        tree = Tree.over(lay(vertices), lay(faces[:count].astype(np.int64)))
        for found in (tree.nearest(lay(points)), tree.moved(lay(vertices)).nearest(points)):
            assert [array.tolist() for array in found] == [array.tolist() for array in wanted]


class TestPoints:
    @laid
    def test_give_the_same_surface(self, lay: Lay) -> None:
        points = ball()[0]
        wanted, mesh = reconstruct_points(points).mesh, TriMesh(*ball())
        assert np.array_equal(reconstruct_points(lay(points)).mesh.vertices, wanted.vertices)
        assert np.array_equal(reconstruct_points(PointSet.from_positions(lay(points))).mesh.vertices, wanted.vertices)
        assert np.array_equal(distance_to_surface(np.asarray(lay(points)), mesh), distance_to_surface(points, mesh))


@pytest.mark.parametrize("frequency", [1, 2, 3])
def test_faces_of_a_sphere_lie_row_by_row(frequency: int) -> None:
    vertices, faces = icosphere(frequency)
    assert vertices.flags.c_contiguous
    assert faces.flags.c_contiguous
    assert faces.shape == (20 * frequency**2, 3)
