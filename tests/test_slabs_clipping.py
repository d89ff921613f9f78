"""Faces cut along a grid: each piece in one cell, the surface and its closedness kept, the same from every side."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from test_twins_topology import isosurface
from tomomesh.io.meshes.cells import weld
from tomomesh.io.meshes.pieces.octree import along_curve
from tomomesh.measure.topology import topology
from tomomesh.model.mesh import TriMesh
from tomomesh.slabs.patches.clipping import CellGrid, cut_along


class TestCutting:
    @law(60)
    @given(seed=seeds, share=st.floats(0.05, 0.6), eighths=st.integers(3, 72), off=st.sampled_from([0.0, 0.0, 2**-52]))
    def test_keeps_a_surface_closed_and_its_volume(self, seed: int, share: float, eighths: int, off: float) -> None:
        mesh = isosurface(seed, share)
        # planes through vertices, which lie at whole and at broken numbers, or next to them by the last bit
        grid = CellGrid(np.floor(mesh.vertices.min(axis=0)) - 0.5, eighths / 8 * (1 + off))
        corners = cut_along(mesh.corners, grid)
        low = grid.origin + grid.cells(corners) * grid.side
        assert (corners >= low[:, None] - 1e-9).all()
        assert (corners <= low[:, None] + grid.side + 1e-9).all()
        places, numbers = weld(corners.reshape(-1, 3))
        faces = numbers.reshape(-1, 3)
        found = TriMesh(places, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
        np.testing.assert_allclose(found.face_volumes.sum(), mesh.face_volumes.sum(), rtol=1e-9)
        np.testing.assert_allclose(found.face_areas.sum(), mesh.face_areas.sum(), rtol=1e-9)
        after, before = topology(found), topology(mesh)
        assert after.boundary_edges == after.misoriented_edges == 0
        # what is thinner than the last bit falls together
        assert off or (after.components, after.euler_number) == (before.components, before.euler_number)

    @law(60)
    @given(seed=seeds, side=st.floats(0.2, 3))
    def test_cuts_an_edge_in_the_same_places_in_all_faces(self, seed: int, side: float) -> None:
        rng = np.random.default_rng(seed)
        one, other, a, b = rng.normal(size=(4, 3)) * 3
        grid = CellGrid(rng.normal(size=3) - 9, side)
        on_edge = [
            {tuple(place) for place in cut_along(np.array([face]), grid).reshape(-1, 3).tolist()}
            for face in ([one, other, a], [other, one, b])
        ]
        shared = np.array(sorted(on_edge[0] & on_edge[1]))
        crossed = sum(
            int(np.ceil((max(p, q) - o) / side) - np.floor((min(p, q) - o) / side) - 1)
            for p, q, o in zip(one, other, grid.origin, strict=True)
        )
        assert len(shared) == crossed + 2

    def test_leaves_faces_in_a_cell_as_they_are(self) -> None:
        corners = np.random.default_rng(0).random((20, 3, 3))
        np.testing.assert_array_equal(
            np.sort(cut_along(corners, CellGrid(np.zeros(3), 1.0)), axis=0), np.sort(corners, axis=0)
        )


def test_a_curve_lets_x_turn_fastest() -> None:
    cells = [(x, y, z) for z in range(2) for y in range(2) for x in range(2)]
    assert along_curve(reversed(cells)) == cells
    assert along_curve([(2, 0, 0), (1, 1, 1), (0, 0, 3)]) == [(1, 1, 1), (2, 0, 0), (0, 0, 3)]
