"""The faces of a set of cubes: those of a whole-grid scan, closed, with the exact invariants of a cuberille."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import composed, cuberille_of, faces_in, law, size
from tomomesh.cuberille.neighbors import DIRECTIONS, FACE_COLUMNS, OFFSETS
from tomomesh.cuberille.partition import partition
from tomomesh.measure.topology import topology
from tomomesh.model.cubes import cells_of, keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.faces import Faces

    Solid = NDArray[np.bool_]
    Face = tuple[tuple[int, ...], tuple[int, ...]]

FACES, WHOLE = ndimage.generate_binary_structure(3, 1), ndimage.generate_binary_structure(3, 3)
numbers = st.integers(0, size(400, 12))


@cache
def made(number: int) -> tuple[Solid, Faces]:
    """Return a well-composed grid (x, y, z) with a margin, from sparse to crowded, and its faces."""
    rng = np.random.default_rng(number)
    shape = rng.integers(1, size(13, 7), 3)
    solid = rng.random(shape) < [0.08, 0.2, 0.5, 0.8, 0.95][number % 5]
    solid[tuple(rng.integers(shape))] = True
    solid = np.pad(composed(solid), 1)
    return solid, faces_in(solid)


def euler_number(solid: Solid) -> int:
    """Count vertices - edges + squares - cubes of a padded solid whose cubes are joined where they touch.

    A vertex, edge or square belongs to the solid where any of the cubes around it does.
    """
    count = 0
    for wide in np.ndindex(2, 2, 2):
        around = np.lib.stride_tricks.sliding_window_view(solid, [1 + w for w in wide]).any(axis=(3, 4, 5))
        count += (-1) ** (3 - sum(wide)) * int(around.sum())
    return count


def faces_of(found: Faces) -> list[Face]:
    """Return each face as the cube behind it and its outward normal."""
    a, b, c, d = (found.corners[found.quads[:, n]] for n in range(4))
    np.testing.assert_array_equal(a + c, b + d)
    normal = np.cross(b - a, d - a)
    np.testing.assert_array_equal(a + c, 2 * found.cells + 1 + normal)
    return [(tuple(cell), tuple(n)) for cell, n in zip(found.cells.tolist(), normal.tolist(), strict=True)]


def scanned(solid: Solid) -> list[Face]:
    """Find the same by looking at every cube and every direction."""
    present = {tuple(cell) for cell in np.argwhere(solid).tolist()}
    return [(cell, out) for cell in present for out in DIRECTIONS if tuple(np.add(cell, out).tolist()) not in present]


class TestFaces:
    @law(100)
    @given(number=numbers)
    def test_have_the_faces_of_a_whole_grid_scan(self, number: int) -> None:
        solid, found = made(number)
        assert sorted(faces_of(found)) == sorted(scanned(solid))

    @law(100)
    @given(number=numbers)
    def test_every_edge_has_two_faces_of_opposite_direction(self, number: int) -> None:
        mesh = cuberille_of(made(number)[0])
        ends = mesh.quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2)
        directed = {tuple(edge) for edge in ends.tolist()}
        assert len(directed) == len(ends)
        assert all((b, a) in directed for a, b in directed)
        assert len(mesh.edges) == 2 * len(mesh.quads)

    @law(100)
    @given(number=numbers)
    def test_enclose_their_cubes_exactly(self, number: int) -> None:
        solid, found = made(number)
        assert found.volumes.sum() == solid.sum()
        corners = found.corners[found.quads]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        assert (corners[:, 0] * normal).sum() == 3 * solid.sum()

    @law(100)
    @given(number=numbers)
    def test_are_as_many_as_components_of_cubes_and_of_background_less_one(self, number: int) -> None:
        solid, found = made(number)
        objects, backgrounds = ndimage.label(solid, WHOLE)[1], ndimage.label(~solid, FACES)[1]
        assert found.count == objects + backgrounds - 1
        assert ndimage.label(solid, FACES)[1] == objects
        assert (found.volumes > 0).sum() == objects
        assert topology(cuberille_of(solid).triangulated()).components == found.count

    @law(100)
    @given(number=numbers)
    def test_enclose_each_object_once_its_cavities_are_filled(self, number: int) -> None:
        solid, found = made(number)
        labels, count = ndimage.label(solid, FACES)
        filled = [int(ndimage.binary_fill_holes(labels == n + 1, FACES).sum()) for n in range(count)]
        assert sorted(found.volumes[found.volumes > 0].tolist()) == sorted(filled)

    @law(100)
    @given(number=numbers)
    def test_have_twice_the_euler_number_of_their_cubes(self, number: int) -> None:
        solid, found = made(number)
        mesh = cuberille_of(solid)
        chi = len(found.corners) - len(mesh.edges) + len(found.quads)
        assert chi == 2 * euler_number(solid)
        assert topology(mesh.triangulated()).euler_number == chi

    @law(100)
    @given(number=numbers)
    def test_have_three_to_seven_edges_at_a_vertex(self, number: int) -> None:
        mesh = cuberille_of(made(number)[0])
        valence = np.bincount(mesh.edges.ravel(), minlength=len(mesh.vertices))
        assert 3 <= valence.min() <= valence.max() <= 7

    @law(100)
    @given(number=numbers)
    def test_are_manifold_after_triangulation(self, number: int) -> None:
        solid, found = made(number)
        proof = topology(cuberille_of(solid).triangulated())
        assert proof.boundary_edges == proof.nonmanifold_edges == proof.nonmanifold_vertices == 0
        assert proof.misoriented_edges == 0
        assert proof.inward_components == (found.volumes < 0).sum()
        assert len(np.unique(found.corners, axis=0)) == len(found.corners)

    @law(60)
    @given(number=numbers)
    def test_can_be_kept_in_part(self, number: int) -> None:
        _, found = made(number)
        taken = np.arange(found.count) % 2 == 0
        kept = found.only(taken)
        assert kept.count == taken.sum()
        np.testing.assert_array_equal(kept.volumes, found.volumes[taken])
        np.testing.assert_array_equal(kept.sizes, found.sizes[taken])
        faces = zip(faces_of(found), taken[found.face_labels].tolist(), strict=True)
        assert faces_of(kept) == [face for face, keep in faces if keep]

    @law(60)
    @given(number=numbers)
    def test_that_are_turned_enclose_as_much_from_the_other_side(self, number: int) -> None:
        _, found = made(number)
        np.testing.assert_array_equal(found.turned().volumes, -found.volumes)
        both = found.joined(found.turned())
        np.testing.assert_array_equal(both.volumes, np.append(found.volumes, -found.volumes))
        np.testing.assert_array_equal(both.inward, np.repeat([False, True], found.count))

    def test_of_two_cubes_that_share_an_edge_alone_are_no_manifold(self) -> None:
        """The smallest case: why the cubes must be well composed."""
        solid = np.zeros((2, 2, 1), bool)
        solid[0, 0], solid[1, 1] = True, True
        assert topology(cuberille_of(solid).triangulated()).nonmanifold_edges == 1
        assert topology(cuberille_of(composed(solid)).triangulated()).sound

    def test_the_largest_can_be_kept_alone(self) -> None:
        solid = np.zeros((20, 9, 9), bool)
        solid[:4], solid[9:] = True, True
        found = faces_in(solid)
        assert found.worth_keeping().all()
        np.testing.assert_array_equal(found.volumes[found.worth_keeping(largest=True)], [11 * 81])


class TestOverAPartition:
    @law(40)
    @given(number=numbers, cell=st.tuples(*[st.floats(0.1, 9)] * 3), origin=st.floats(-1e3, 1e3))
    def test_lie_on_the_corners_of_cubes_that_it_then_holds(
        self, number: int, cell: tuple[float, float, float], origin: float
    ) -> None:
        solid = made(number)[0][1:, 1:, 1:]
        grid = partition(origin + (np.argwhere(solid) + 0.5) * np.array(cell), np.array(cell))
        found = faces_in(np.pad(solid, ((0, 2), (0, 0), (0, 0)), mode="edge"))
        cubes, mesh, origins = found.over(grid)
        np.testing.assert_array_equal(cubes.keys, np.union1d(grid.keys, keys_of(found.cells)))
        np.testing.assert_array_equal(cubes.keys[cubes.occupied], grid.keys)
        corner = (mesh.vertices - grid.origin) / grid.cell_mm
        np.testing.assert_allclose(corner, found.corners, rtol=0, atol=1e-8)
        near = np.abs(corner - cells_of(cubes.keys)[origins] - 0.5)
        np.testing.assert_allclose(near, 0.5, atol=1e-8)
        first = np.empty(len(corner), np.int64)
        for n in reversed(range(len(found.quads))):
            first[found.quads[n]] = n
        np.testing.assert_array_equal(cells_of(cubes.keys)[origins], found.cells[first])


def test_faces_look_where_the_columns_of_the_neighbor_tables_say() -> None:
    assert [OFFSETS[column] for column in FACE_COLUMNS] == list(DIRECTIONS)
