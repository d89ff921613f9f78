"""A mesh in pieces is counted as the whole is, wherever it is cut, and no fault hides in a seam."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from cut_meshes import cut, cuts
from test_twins_topology import ball, beside, isosurface, ring
from tomomesh.errors import InternalCheckError
from tomomesh.measure.topology import check_promise, distinct_positions, face_components, topology
from tomomesh.model.mesh import TriMesh
from tomomesh.slabs.patches.patch import patches_of
from tomomesh.slabs.patches.promise import check_patches
from tomomesh.slabs.patches.seams import whole_of

if TYPE_CHECKING:
    from collections.abc import Callable


class TestTopology:
    @law(200)
    @given(seed=seeds, n=st.integers(3, 40), m=st.integers(1, 25), at=cuts, centers=st.integers(0, 3))
    def test_of_any_faces_in_any_pieces_is_the_whole_s(
        self, seed: int, n: int, m: int, at: list[int], centers: int
    ) -> None:
        rng = np.random.default_rng(seed)
        mesh = TriMesh(rng.normal(size=(n, 3)), np.array([rng.choice(n, 3, replace=False) for _ in range(m)], np.int64))
        pieces = cut(mesh, [one % n for one in at], min(centers, n), min(centers, m), seed)
        found = whole_of(patches_of(pieces))
        assert found.topology == topology(pieces.joined())
        assert found.table.faces.tolist() == np.bincount(face_components(pieces.joined())).tolist()

    @law(60)
    @given(seed=seeds, share=st.floats(0.05, 0.6), at=cuts, left=st.sampled_from([0.7, 0.98, 1.0]))
    def test_of_a_surface_with_holes_is_the_whole_s(self, seed: int, share: float, at: list[int], left: float) -> None:
        mesh = isosurface(seed, share)
        kept = np.random.default_rng(seed).random(len(mesh.faces)) < left
        pieces = cut(TriMesh(mesh.vertices, mesh.faces[kept]), at)
        found = whole_of(patches_of(pieces))
        assert found.topology == topology(pieces.joined())
        assert found.table.faces.sum() == kept.sum()
        assert (np.diff(found.table.lowest) > 0).all()

    def test_of_one_piece_has_no_seam(self) -> None:
        found = whole_of(patches_of(cut(ring(), [])))
        assert found.topology == topology(ring())
        assert not found.seams.links.faces.size

    def test_a_lining_may_face_inward(self) -> None:
        inner = ball().moved(ball().vertices / 2)
        mesh = beside(ball(), TriMesh(inner.vertices, inner.faces[:, ::-1]))
        for cavities in (0, 1):
            pieces = patches_of(cut(mesh, [20, 50, 70]))
            assert whole_of(pieces, cavities=cavities).topology == topology(mesh, cavities=cavities)


class TestPositions:
    @law(100)
    @given(seed=seeds, n=st.integers(1, 60), at=cuts, values=st.integers(1, 6), single=st.booleans())
    def test_that_are_equal_are_counted_once(self, seed: int, n: int, at: list[int], values: int, single: bool) -> None:
        rng = np.random.default_rng(seed)
        places = rng.integers(values, size=(n, 3)) * rng.choice([-1.0, 1.0, 1 + 2**-40], (n, 3))
        mesh = TriMesh(places, np.empty((0, 3), np.int64))
        kind = np.float32 if single else np.float64
        pieces = cut(mesh, [one % n for one in at])
        found = patches_of(pieces, tuple(rng.normal(size=3))).distinct(kind)
        assert found == distinct_positions(mesh, kind)


def dropped(mesh: TriMesh, face: int) -> TriMesh:
    return TriMesh(mesh.vertices, np.delete(mesh.faces, face, axis=0))


def flipped(mesh: TriMesh, face: int) -> TriMesh:
    faces = mesh.faces.copy()
    faces[face] = faces[face][::-1]
    return TriMesh(mesh.vertices, faces)


def doubled(mesh: TriMesh, face: int) -> TriMesh:
    return TriMesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[[face]]]))


def torn(mesh: TriMesh, face: int) -> TriMesh:
    """Give a face's first corner a vertex of its own at the same place."""
    faces = mesh.faces.copy()
    vertex, faces[face, 0] = faces[face, 0], len(mesh.vertices)
    return TriMesh(np.concatenate([mesh.vertices, mesh.vertices[[vertex]]]), faces)


def pinched(mesh: TriMesh, face: int) -> TriMesh:
    """Let two vertices that lie far apart be one."""
    one = mesh.faces[face, 0]
    far = np.argmax(((mesh.vertices - mesh.vertices[one]) ** 2).sum(axis=1))
    return TriMesh(mesh.vertices, np.where(mesh.faces == far, one, mesh.faces))


def laid_over(mesh: TriMesh, face: int) -> TriMesh:
    """Let two vertices that lie far apart be at one place."""
    one = mesh.faces[face, 0]
    far = np.argmax(((mesh.vertices - mesh.vertices[one]) ** 2).sum(axis=1))
    vertices = mesh.vertices.copy()
    vertices[far] = vertices[one]
    return mesh.moved(vertices)


def nowhere(mesh: TriMesh, face: int) -> TriMesh:
    vertices = mesh.vertices.copy()
    vertices[mesh.faces[face, 0], 1] = np.nan
    return mesh.moved(vertices)


class TestPromise:
    @law(40)
    @given(seed=seeds, at=cuts)
    def test_is_kept_by_a_surface_in_any_pieces(self, seed: int, at: list[int]) -> None:
        mesh = ring()
        pieces = cut(mesh, [one % len(mesh.vertices) for one in at], seed=seed)
        assert check_patches(patches_of(pieces)).topology == topology(mesh)

    @pytest.mark.parametrize("broken", [dropped, flipped, doubled, torn, pinched, laid_over, nowhere])
    @law(size(15, 5))
    @given(face=st.integers(0, 60), at=st.integers(1, 60))
    def test_that_is_broken_in_a_seam_is_told_as_in_memory(
        self, broken: Callable[[TriMesh, int], TriMesh], face: int, at: int
    ) -> None:
        mesh = broken(ring(), face)
        # the cut passes through the face
        pieces = cut(mesh, [at, int(ring().faces[face].max())])
        with pytest.raises(InternalCheckError) as wanted:
            check_promise(pieces.joined())
        with pytest.raises(InternalCheckError) as found:
            check_patches(patches_of(pieces))
        assert str(found.value) == str(wanted.value)

    def test_lets_a_sheet_have_borders(self) -> None:
        pieces = patches_of(cut(dropped(ring(), 7), [30, 60]))
        assert check_patches(pieces, open_=True).topology.boundary_loops == 1
