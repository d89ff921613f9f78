"""The tracked surface: the faces of a whole-grid scan, closed, and with the exact invariants of a cuberille."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import cubes_of, keys_in, law, solids
from tomomesh.measure.topology import topology
from tomomesh.model.cubes import cells_of, keys_of
from tomomesh.surface.composition import well_composed
from tomomesh.surface.cuberille import track
from tomomesh.surface.neighbors import DIRECTIONS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.mesh import QuadMesh

    Face = tuple[tuple[int, ...], tuple[int, ...]]

FACES, WHOLE = ndimage.generate_binary_structure(3, 1), ndimage.generate_binary_structure(3, 3)


def composed(solid: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return a well-composed set, and the same as a grid (x, y, z) padded by one."""
    keys = well_composed(keys_in(solid))
    cells = cells_of(keys)
    cells = cells - cells.min(axis=0) + 1
    padded = np.zeros(cells.max(axis=0) + 2, bool)
    padded[tuple(cells.T)] = True
    return keys, padded


def euler_number(solid: NDArray[np.bool_]) -> int:
    """Count vertices - edges + squares - cubes of a padded solid whose cubes are joined where they touch.

    A vertex, edge or square belongs to the solid where any of the cubes around it does.
    """
    count = 0
    for wide in np.ndindex(2, 2, 2):
        around = np.lib.stride_tricks.sliding_window_view(solid, [1 + w for w in wide]).any(axis=(3, 4, 5))
        count += (-1) ** (3 - sum(wide)) * int(around.sum())
    return count


def faces_of(mesh: QuadMesh) -> list[Face]:
    """Return each face as its middle, doubled, and its outward normal."""
    a, b, c, d = (mesh.vertices[mesh.quads[:, n]] for n in range(4))
    middle, normal = np.rint(a + c).astype(int), np.rint(np.cross(b - a, d - a)).astype(int)
    np.testing.assert_array_equal(a + c, b + d)
    return [(tuple(m), tuple(n)) for m, n in zip(middle.tolist(), normal.tolist(), strict=True)]


def scanned(keys: NDArray[np.int64]) -> list[Face]:
    """Find the same by looking at every cube and every direction."""
    present = {tuple(cell) for cell in cells_of(keys).tolist()}
    return [
        (tuple(int(n) for n in 2 * np.array(cell) + 1 + np.array(out)), out)
        for cell in present
        for out in DIRECTIONS
        if tuple(np.add(cell, out).tolist()) not in present
    ]


class TestAllSurfaces:
    @law(100)
    @given(solid=solids())
    def test_have_the_faces_of_a_whole_grid_scan(self, solid: NDArray[np.bool_]) -> None:
        keys, _ = composed(solid)
        tracked = track(cubes_of(keys), surface="all")
        assert sorted(faces_of(tracked.mesh)) == sorted(scanned(keys))
        assert tracked.taken.all()

    @law(100)
    @given(solid=solids())
    def test_every_edge_has_two_faces_of_opposite_direction(self, solid: NDArray[np.bool_]) -> None:
        mesh = track(cubes_of(composed(solid)[0]), surface="all").mesh
        ends = mesh.quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2)
        directed = {tuple(edge) for edge in ends.tolist()}
        assert len(directed) == len(ends)
        assert all((b, a) in directed for a, b in directed)
        assert len(mesh.edges) == 2 * len(mesh.quads)

    @law(100)
    @given(solid=solids())
    def test_enclose_their_cubes_exactly(self, solid: NDArray[np.bool_]) -> None:
        keys, _ = composed(solid)
        tracked = track(cubes_of(keys), surface="all")
        assert tracked.volumes.sum() == len(keys)
        corners = np.rint(tracked.mesh.vertices[tracked.mesh.quads]).astype(np.int64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        assert (corners[:, 0] * normal).sum() == 3 * len(keys)

    @law(100)
    @given(solid=solids())
    def test_are_as_many_as_components_of_cubes_and_of_background_less_one(self, solid: NDArray[np.bool_]) -> None:
        keys, padded = composed(solid)
        tracked = track(cubes_of(keys), surface="all")
        objects, backgrounds = ndimage.label(padded, WHOLE)[1], ndimage.label(~padded, FACES)[1]
        assert tracked.surfaces == objects + backgrounds - 1
        assert ndimage.label(padded, FACES)[1] == objects
        assert (tracked.volumes > 0).sum() == objects
        assert topology(tracked.mesh.triangulated()).components == tracked.surfaces

    @law(100)
    @given(solid=solids())
    def test_have_twice_the_euler_number_of_their_cubes(self, solid: NDArray[np.bool_]) -> None:
        keys, padded = composed(solid)
        mesh = track(cubes_of(keys), surface="all").mesh
        chi = len(mesh.vertices) - len(mesh.edges) + len(mesh.quads)
        assert chi == 2 * euler_number(padded)
        assert topology(mesh.triangulated()).euler_number == chi

    @law(100)
    @given(solid=solids())
    def test_have_three_to_seven_edges_at_a_vertex(self, solid: NDArray[np.bool_]) -> None:
        mesh = track(cubes_of(composed(solid)[0]), surface="all").mesh
        valence = np.bincount(mesh.edges.ravel(), minlength=len(mesh.vertices))
        assert 3 <= valence.min() <= valence.max() <= 7

    @law(100)
    @given(solid=solids())
    def test_are_manifold_after_triangulation(self, solid: NDArray[np.bool_]) -> None:
        mesh = track(cubes_of(composed(solid)[0])).mesh.triangulated()
        assert topology(mesh).sound
        assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)

    @law(50)
    @given(solid=solids(), cell=st.tuples(*[st.floats(0.1, 9)] * 3), origin=st.floats(-1e3, 1e3))
    def test_lie_on_the_corners_of_their_cubes(
        self, solid: NDArray[np.bool_], cell: tuple[float, float, float], origin: float
    ) -> None:
        keys, _ = composed(solid)
        mesh = track(cubes_of(keys, cell, origin), surface="all").mesh
        corner = (mesh.vertices - origin) / cell
        np.testing.assert_allclose(corner, np.rint(corner), rtol=0, atol=1e-8)
        behind = cells_of(keys)[mesh.cubes]
        middle = corner[mesh.quads].mean(axis=1)
        np.testing.assert_allclose(np.abs(middle - behind - 0.5).sum(axis=1), 0.5, atol=1e-8)
        near = np.abs(corner - cells_of(keys)[mesh.vertex_cubes] - 0.5)
        np.testing.assert_allclose(near, 0.5, atol=1e-8)


def ball(center: tuple[int, int, int], radius: float, hollow: float = 0.0) -> NDArray[np.int64]:
    """Return the cells of a ball, or of a hollow ball."""
    cells = np.argwhere(np.ones([2 * int(radius) + 3] * 3, bool)) - int(radius) - 1
    far = np.linalg.norm(cells, axis=1)
    return np.asarray(cells[(far <= radius) & (far >= hollow)] + center)


def taken(*parts: NDArray[np.int64], surface: str = "outer") -> tuple[list[int], list[bool]]:
    """Return the volumes of the surfaces of some parts, rising, and which were taken."""
    tracked = track(cubes_of(well_composed(np.unique(keys_of(np.concatenate(parts))))), surface=surface)
    order = np.argsort(tracked.volumes)
    assert tracked.mesh.quads.size > 0
    return tracked.volumes[order].tolist(), tracked.taken[order].tolist()


class TestOuterSurfaces:
    def test_leave_out_cavities(self) -> None:
        volumes, outer = taken(ball((20, 20, 20), 9, 6))
        assert volumes[0] < 0 < volumes[1]
        assert outer == [False, True]

    @pytest.mark.parametrize("center", [(20, 20, 20), (22, 20, 20), (18, 21, 19)])
    def test_leave_out_a_ball_in_a_cavity(self, center: tuple[int, int, int]) -> None:
        _, outer = taken(ball((20, 20, 20), 12, 10), ball(center, 3))
        assert outer == [False, False, True]

    def test_leave_out_a_hollow_ball_in_a_cavity_and_a_ball_in_that(self) -> None:
        _, outer = taken(ball((20, 20, 20), 15, 13), ball((20, 20, 20), 10, 8), ball((20, 20, 20), 4))
        assert outer == [False, False, False, False, True]

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_take_two_separate_balls(self, axis: int) -> None:
        center = np.array([20, 20, 20])
        center[axis] += 14
        volumes, outer = taken(ball((20, 20, 20), 5), ball(tuple(center), 6))
        assert outer == [True, True]
        assert volumes[1] > volumes[0]

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_take_two_hollow_balls_and_what_is_between_but_not_what_is_inside(self, axis: int) -> None:
        centers = np.full((3, 3), 20)
        centers[:, axis] += [0, 14, 28]
        left, middle, right = (tuple(c) for c in centers.tolist())
        _, outer = taken(ball(left, 8, 6), ball(left, 3), ball(middle, 4), ball(right, 8, 6))
        assert outer == [False, False, False, True, True, True]

    def test_take_a_ball_in_the_hole_of_a_ring(self) -> None:
        cells = np.argwhere(np.ones((31, 31, 7), bool)) - [15, 15, 3]
        ring = cells[np.hypot(np.hypot(cells[:, 0], cells[:, 1]) - 11, cells[:, 2]) <= 3] + 20
        _, outer = taken(ring, ball((20, 20, 20), 3))
        assert outer == [True, True]

    def test_take_all_where_asked(self) -> None:
        assert taken(ball((20, 20, 20), 9, 6), surface="all")[1] == [True, True]

    @law(80)
    @given(solid=solids(8))
    def test_are_those_that_the_outside_touches(self, solid: NDArray[np.bool_]) -> None:
        keys, padded = composed(solid)
        outside = ndimage.label(~padded, FACES)[0] == 1
        objects, count = ndimage.label(padded, FACES)
        touched = np.unique(objects[ndimage.binary_dilation(outside, FACES) & padded])
        tracked = track(cubes_of(keys))
        assert tracked.taken.sum() == len(touched)
        filled = [ndimage.binary_fill_holes(objects == n, FACES) for n in touched]
        assert tracked.volumes[tracked.taken].sum() == sum(int(one.sum()) for one in filled) <= padded.size
        assert count == (tracked.volumes > 0).sum()
