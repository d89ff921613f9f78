"""What is measured of a mesh in pieces is what is measured of the whole, to the last bit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cut_meshes import cut, cuts
from test_twins_topology import ball, beside, isosurface, ring
from tomomesh import TriMesh, assess
from tomomesh.measure.shape import folded, unfolded
from tomomesh.slabs.keep import OnDisk
from tomomesh.slabs.patches.order import DIGIT, digits_after, percentiles
from tomomesh.slabs.patches.patch import patches_of
from tomomesh.slabs.patches.report import assess_patches

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


def wanted(mesh: TriMesh, cavities: int = 0) -> dict[str, Any]:
    """Return what is told of a whole mesh, without what only a whole one tells."""
    found = assess(mesh, cavities=cavities)
    rows = [{name: value for name, value in row.items() if name != "median_edge_mm"} for row in found["per_component"]]
    return found | {"per_component": rows}


class TestSums:
    @law(100)
    @given(seed=seeds, n=st.integers(0, 60), spread=st.integers(0, 40), parts=st.integers(1, 4))
    def test_know_no_order_and_no_parts(self, seed: int, n: int, spread: int, parts: int) -> None:
        rng = np.random.default_rng(seed)
        values = rng.normal(size=n) * 2.0 ** -rng.integers(0, spread + 1, n)
        bound, groups = (
            float(np.abs(values).max(initial=0)) * rng.uniform(1, 9),
            rng.integers(3, size=n, dtype=np.int32),
        )
        once = folded(values, bound, n, groups, 3)
        order = rng.permutation(n)
        some = np.array_split(order, parts)
        np.testing.assert_array_equal(sum(folded(values[one], bound, n, groups[one], 3) for one in some), once)

    @law(60)
    @given(seed=seeds, n=st.integers(1, 200))
    def test_are_exact_to_the_last_bit_or_so(self, seed: int, n: int) -> None:
        import math

        values = np.random.default_rng(seed).normal(size=n)
        found = unfolded(folded(values, 8.0, 2**31))[0]
        assert found == pytest.approx(math.fsum(values), rel=1e-15, abs=1e-15)


class TestPercentiles:
    @law(100)
    @given(
        values=st.lists(st.floats(0, 1e6) | st.sampled_from([0.0, 1.0, 1.0 + 2**-52, 5e-324]), min_size=1, max_size=40),
        at=st.integers(0, 40),
    )
    def test_are_numpy_s(self, values: list[float], at: int) -> None:
        numbers, parts = np.array(values), [0, 1, 5, 37.5, 50, 95, 100]

        def counts(digits: NDArray[np.int64], shift: int) -> NDArray[np.int64]:
            return digits_after(numbers[:at], digits, shift) + digits_after(numbers[at:], digits, shift)

        np.testing.assert_array_equal(percentiles(counts, len(numbers), parts), np.percentile(numbers, parts))

    def test_count_each_number_once_a_digit(self) -> None:
        numbers = np.random.default_rng(0).random(500)
        assert digits_after(numbers, np.array([0]), 64 - DIGIT).sum() == 500


class TestReport:
    @law(40)
    @given(
        seed=seeds, share=st.floats(0.05, 0.6), at=cuts, left=st.sampled_from([0.9, 1.0]), turned=st.integers(0, 1),
        moved=st.sampled_from([0.0, 0.8]),
    )  # fmt: skip
    def test_is_the_whole_s(
        self, seed: int, share: float, at: list[int], left: float, turned: int, moved: float
    ) -> None:
        mesh, rng = isosurface(seed, share), np.random.default_rng(seed)
        faces = mesh.faces[rng.random(len(mesh.faces)) < left]
        mesh = TriMesh(
            mesh.vertices + rng.normal(scale=moved, size=mesh.vertices.shape), np.roll(faces, turned, axis=1)
        )
        pieces = cut(mesh, at, 5, 9)
        assert assess_patches(patches_of(pieces)) == wanted(pieces.joined())

    def test_is_the_whole_s_where_little_is_in_memory(self, tmp_path: Path) -> None:
        mesh = ring()
        for _ in range(2):
            mesh = finer(mesh)
        inner = TriMesh(ball().vertices / 9 + [4, 0, 0], ball().faces[:, ::-1])
        mesh = beside(mesh, inner)
        pieces = cut(mesh, [900, 901, 2000], slabs=OnDisk(tmp_path))
        assert assess_patches(patches_of(pieces), cavities=1) == wanted(pieces.joined(), cavities=1)
        assert not list(tmp_path.iterdir())

    @law(25)
    @given(seed=seeds, at=cuts, count=st.integers(1, 4), more=st.integers(0, 2))
    def test_finds_the_place_in_each_cavity_that_memory_finds(
        self, seed: int, at: list[int], count: int, more: int
    ) -> None:
        """But of pieces that face inward around nothing, which are no cavities."""
        rng, mesh = np.random.default_rng(seed), TriMesh(20 * ball().vertices, ball().faces)
        for n in range(count + more):
            place = np.array([4.0 * n, 0.0, 0.0 if n < count else 99.0])
            mesh = beside(mesh, TriMesh(ball().vertices * rng.uniform(0.2, 1) + place, ball().faces[:, ::-1]))
        pieces = cut(mesh, at, seed=seed)
        found = assess_patches(patches_of(pieces), cavities=count)
        assert len(found["cavity_places_mm"]) == count
        assert found == wanted(pieces.joined(), count)

    @pytest.mark.parametrize("along", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.3, -0.5, 0.1)])
    def test_finds_crossings_between_pieces_that_share_nothing(self, along: tuple[float, ...]) -> None:
        mesh = beside(ring(), ring().moved(ring().vertices + np.array([1.5, 0.2, 0.3])))
        pieces = cut(mesh, [len(ring().vertices), 20])
        found = assess_patches(patches_of(pieces, along))
        assert found["self_intersections"] > 10
        assert found == wanted(pieces.joined())


def finer(mesh: TriMesh) -> TriMesh:
    """Divide each face in four."""
    edges = mesh.edges
    middle = {tuple(edge): len(mesh.vertices) + n for n, edge in enumerate(edges.tolist())}
    faces = []
    for a, b, c in mesh.faces.tolist():
        x, y, z = (middle[min(p, q), max(p, q)] for p, q in ((a, b), (b, c), (c, a)))
        faces += [[a, x, z], [x, b, y], [z, y, c], [x, y, z]]
    places = np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)])
    return TriMesh(places, np.array(faces))
