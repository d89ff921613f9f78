"""The whole way from points: the same for any order, repetition and place of the points, and always sound."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size, sphere, torus
from tomomesh.errors import EmptyError, GeometryError, TomomeshError
from tomomesh.measure.topology import topology
from tomomesh.model.volume import Volume
from tomomesh.pipeline import reconstruct, reconstruct_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

COUNT = size(1200, 600)
ATTRACTIONS = ["nearest", "surface"]


@cache
def made_of(shape: Any, attraction: str = "surface") -> Surface:
    """Return the surface of a shape's points, made once for the laws that compare others with it."""
    return reconstruct_points(shape(COUNT), attraction=attraction)


def bytes_of(surface: Surface) -> tuple[bytes, bytes]:
    return surface.mesh.vertices.tobytes(), surface.mesh.faces.tobytes()


def dyadic(points: Floats) -> Floats:
    """Round so that moving by whole numbers up to 2^30 loses nothing."""
    return np.round(points * 2**16) / 2**16


@cache
def here(attraction: str) -> Surface:
    """Return the surface of a torus about the origin."""
    return reconstruct_points(dyadic(torus(COUNT)), attraction=attraction, remesh=False)


def hollow_head() -> Volume:
    """Return a few slices of a thick-walled ball."""
    z, y, x = np.mgrid[-14:15, -14:15, -14:15]
    gray = 100.0 * (np.abs(np.sqrt(x**2 + y**2 + z**2) - 11) < 1.6)
    return Volume.from_stored(gray, np.diag([1.0, 1.0, 1.0, 1.0]))


class TestOrder:
    @law(12)
    @given(seed=seeds, shape=st.sampled_from([sphere, torus]), attraction=st.sampled_from(ATTRACTIONS))
    def test_changes_no_byte(self, seed: int, shape: Any, attraction: str) -> None:
        shuffled = np.random.default_rng(seed).permutation(shape(COUNT))
        other = reconstruct_points(shuffled, attraction=attraction)
        assert bytes_of(made_of(shape, attraction)) == bytes_of(other)

    @law(8)
    @given(seed=seeds)
    def test_nor_do_repetitions(self, seed: int) -> None:
        points = sphere(COUNT)
        rng = np.random.default_rng(seed)
        again = rng.permutation(np.concatenate([points, points[rng.integers(COUNT, size=COUNT // 2)]]))
        assert bytes_of(made_of(sphere)) == bytes_of(reconstruct_points(again))

    @pytest.mark.parametrize("attraction", ATTRACTIONS)
    def test_nor_do_threads(self, attraction: str, monkeypatch: pytest.MonkeyPatch) -> None:
        for block, size_of_it in (
            ("dynamics.mass_spring.BLOCK", 101),
            ("dynamics.moving_least_squares.BLOCK", 97),
            ("dynamics.low_pass.BLOCK", 89),
            ("cuberille.bitmasks.SHARE", 3),
        ):
            monkeypatch.setattr(f"tomomesh.{block}", size_of_it)
        one, two = (reconstruct_points(sphere(COUNT), threads=n, attraction=attraction) for n in (1, 2))
        assert bytes_of(one) == bytes_of(two)

    def test_nor_do_equal_points_on_a_lattice_with_many_ties(self) -> None:
        points = np.unique(np.round(sphere(COUNT, 8.0)), axis=0)
        shuffled = np.random.default_rng(0).permutation(points)
        one, two = (reconstruct_points(p, cell_mm=(1.5,)) for p in (points, shuffled))
        assert bytes_of(one) == bytes_of(two)

    def test_nor_does_a_second_run(self) -> None:
        assert bytes_of(made_of(torus)) == bytes_of(reconstruct_points(torus(COUNT)))

    @pytest.mark.parametrize("training", ["online", "batch"])
    def test_nor_do_threads_on_the_way_from_a_study(self, training: str) -> None:
        kind: dict[str, Any] = {"training": training, "neurons": 24, "iterations": size(5000, 500)}
        one, two = (reconstruct(hollow_head(), threads=n, signal="region", **kind) for n in (1, 2))
        assert bytes_of(one) == bytes_of(two)


class TestPlace:
    @pytest.mark.parametrize("attraction", ATTRACTIONS)
    @pytest.mark.parametrize("far", [-1e9, 1e9, 1e6][: size(3, 1)])
    def test_far_away_costs_no_precision_beyond_that_of_the_numbers(self, far: float, attraction: str) -> None:
        near = here(attraction)
        there = reconstruct_points(dyadic(torus(COUNT)) + far, attraction=attraction, remesh=False)
        assert near.mesh.faces.tobytes() == there.mesh.faces.tobytes()
        assert near.cuberille.quads.tobytes() == there.cuberille.quads.tobytes()
        off = there.mesh.vertices - far - near.mesh.vertices
        assert np.abs(off).max() <= 4 * np.spacing(abs(far))

    @pytest.mark.parametrize("scale", [2.0**-20, 2.0**20][: size(2, 1)])
    def test_the_unit_of_the_points_does_not_matter(self, scale: float) -> None:
        near, there = made_of(torus), reconstruct_points(torus(COUNT) * scale)
        assert near.mesh.faces.tobytes() == there.mesh.faces.tobytes()
        np.testing.assert_allclose(there.mesh.vertices, near.mesh.vertices * scale, rtol=1e-12)


class TestSound:
    @law(10)
    @given(seed=seeds, noise=st.sampled_from([0.0, 0.05, 0.3]), factor=st.floats(1.0, 2.0))
    def test_whatever_the_noise(self, seed: int, noise: float, factor: float) -> None:
        points = sphere(COUNT) + noise * np.random.default_rng(seed).normal(size=(COUNT, 3))
        surface = reconstruct_points(points, cell_factor=factor)
        assert topology(surface.mesh).sound
        assert len(np.unique(surface.mesh.vertices, axis=0)) == len(surface.mesh.vertices)

    @pytest.mark.parametrize(
        "changes", [{"low_pass": 0}, {"stiffness": 0.0}, {"max_steps": 0}, {"springs": "triangles"}]
    )
    def test_whatever_the_settings(self, changes: dict[str, Any]) -> None:
        surface = reconstruct_points(torus(COUNT), **changes)
        assert topology(surface.mesh).sound
        assert topology(surface.mesh).genus == 1

    @pytest.mark.parametrize("attraction", ATTRACTIONS)
    def test_a_surface_in_a_cavity_is_taken_where_asked(self, attraction: str) -> None:
        """It looks inward, and so encloses a negative volume: that is no fault."""
        points = np.concatenate([sphere(2 * COUNT, 14.0), sphere(COUNT // 2, 5.0)])
        outer, both = (reconstruct_points(points, surface=kind, attraction=attraction) for kind in ("outer", "all"))
        assert outer.report["surface"]["taken"] == 1
        assert (both.report["surface"]["taken"], both.report["surface"]["cavities"]) == (2, 1)
        assert topology(both.mesh).inward_components == 1
        assert topology(both.mesh).components == 2
        assert topology(both.mesh).boundary_edges == topology(both.mesh).nonmanifold_edges == 0

    def test_two_objects_give_two_components(self) -> None:
        one = sphere(COUNT // 2, 6.0)
        pair = np.concatenate([one, one + np.array([30, 0, 0])])
        assert topology(reconstruct_points(pair).mesh).components == 2

    def test_a_leak_is_refused_unless_allowed(self) -> None:
        x, y = np.mgrid[:20, :20] * 1.0
        sheet = np.column_stack([x.ravel(), y.ravel(), 0.01 * x.ravel() ** 2])
        with pytest.raises(GeometryError, match="leaks") as refused:
            reconstruct_points(sheet)
        assert refused.value.exit_code == 5
        surface = reconstruct_points(sheet, allow_leaks=True)
        assert topology(surface.mesh).sound
        assert any("leaks" in warning for warning in surface.report["warnings"])


class TestRefuses:
    def test_no_points(self) -> None:
        with pytest.raises(EmptyError):
            reconstruct_points(np.empty((0, 3)))

    @pytest.mark.parametrize(
        "points",
        [
            np.full((5, 3), np.nan),
            np.concatenate([sphere(50), [[np.inf, 0, 0]]]),
            np.zeros((5, 2)),
            np.zeros(7),
        ],
    )
    def test_what_are_no_points_in_space(self, points: Floats) -> None:
        with pytest.raises(TomomeshError):
            reconstruct_points(points)
