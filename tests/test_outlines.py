"""The mesh's outline on the slices: exact sections, judged by trimesh, and the pages that show them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import cuberille_of, law, solids
from tomomesh.measure.section import section
from tomomesh.model.mesh import TriMesh
from tomomesh.show.drawing.style import rgb
from tomomesh.show.outline import OUTLINE, draw_outlines

if TYPE_CHECKING:
    from numpy.typing import NDArray


def sphere(radius: float = 10.0) -> TriMesh:
    made = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return TriMesh(np.asarray(made.vertices), np.asarray(made.faces, np.int64))


class TestSection:
    @law(40)
    @given(solids(), st.integers(-3, 9))
    def test_lines_are_closed_even_through_corners(self, solid: NDArray[np.bool_], height: int) -> None:
        mesh = cuberille_of(solid).triangulated()
        ends = section(mesh, float(height)).reshape(-1, 2)
        _, counts = np.unique(np.round(ends, 9), axis=0, return_counts=True)
        assert (counts % 2 == 0).all()

    @pytest.mark.parametrize("height", [-7.3, 0.0123, 4.9])
    def test_trimesh_cuts_the_same_lines(self, height: float) -> None:
        mesh = sphere()
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        theirs = trimesh.intersections.mesh_plane(judge, [0, 0, 1], [0, 0, height])[..., :2]
        ours = section(mesh, height)
        assert ours.shape == theirs.shape
        assert np.allclose(_sorted(ours), _sorted(theirs), atol=1e-9)

    def test_a_plane_beside_the_mesh_cuts_nothing(self) -> None:
        assert section(sphere(), 10.5).shape == (0, 2, 2)


def _sorted(segments: NDArray[np.float64]) -> NDArray[np.float64]:
    middles = np.round(segments.mean(axis=1), 9)
    return np.asarray(middles[np.lexsort(middles.T)])


class TestPages:
    def test_every_slice_that_is_cut_is_shown(self) -> None:
        mesh = sphere(20.0).moved(sphere(20.0).vertices + np.array([25.0, 25.0, 22.0]))
        images = np.random.default_rng(0).integers(0, 255, (60, 50, 50)).astype(np.uint8)
        pages = list(draw_outlines(images, mesh))
        shown = [ax for page in pages for ax in page.panels]
        assert len(pages) == 2
        assert len(shown) == 41
        assert all((ax.pixels == rgb(OUTLINE)).all(axis=2).any() for ax in shown)

    def test_a_mesh_between_two_slices_has_no_page(self) -> None:
        mesh = sphere(0.2).moved(sphere(0.2).vertices + np.array([5.0, 5.0, 2.5]))
        assert list(draw_outlines(np.zeros((9, 9, 9), np.uint8), mesh)) == []
