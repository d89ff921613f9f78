"""At rest means one thing: no vertex of any mesh is as fast, or as strongly accelerated, as the tolerance says."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, size, sphere, torus
from tomomesh.dynamics import moving_least_squares as mls
from tomomesh.dynamics.iterate import iterate
from tomomesh.dynamics.low_pass import OneRing
from tomomesh.isosurface.voxels import boundary, voxel_surface
from tomomesh.kernels.dynamics.springs import advance
from tomomesh.model.trace import Motion, Trace
from tomomesh.model.volume import Grid, Volume
from tomomesh.pipeline import reconstruct_points
from tomomesh.pointcloud.samples import settle_points
from tomomesh.progress import silent
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

TOLERANCE = 1e-3
NEVER = 1e-300
"""A tolerance that nothing reaches."""


def noisy_torus(seed: int, count: int = 20_000, noise: float = 0.1) -> Floats:
    """Throw points at a torus of radii 3 and 1, and noise upon them: handles and thin parts are made up of it."""
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0, 2 * np.pi, (2, count))
    ring = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    return np.asarray(ring + rng.normal(0, noise, (count, 3)))


NOISY = {"surface": size(20_000, 500), "nearest": size(20_000, 900)}
"""Points that are thrown; of fewer the outside leaks in where the nearest attracts."""


@cache
def smooth(solid: str) -> Surface:
    """Return the mesh of a sphere or a torus without noise."""
    return reconstruct_points(sphere(size(3000, 900)) if solid == "sphere" else torus(size(3000, 1500)))


def edge_of(surface: Surface) -> float:
    return float(min(surface.report["cubes"]["cell_mm"]))


def trace_of(surface: Surface) -> Trace:
    assert surface.trace is not None
    return surface.trace


def assert_honest(trace: Trace, tolerance: float = TOLERANCE) -> None:
    """A mesh is called at rest only where the last speed and acceleration say so."""
    assert not trace.converged or max(trace.speed[-1], trace.acceleration[-1]) < tolerance


def ball_of(count: int, *, mask: bool) -> Volume:
    """Sample a ball, or the mask of one."""
    z, y, x = np.mgrid[-count : count + 1, -count : count + 1, -count : count + 1] + 0.3
    height = 0.8 * count - np.sqrt(x**2 + y**2 + z**2)
    affine = np.eye(4)
    levels = np.where(height > 0, 1.0, -1.0) if mask else height
    return Volume(levels, affine, Grid((0, 1, 2), (False, False, False), affine))


class TestClouds:
    @pytest.mark.parametrize("attraction", ["surface", "nearest"])
    @pytest.mark.parametrize("seed", range(size(4, 1)))
    def test_come_to_rest_however_noisy(self, seed: int, attraction: str) -> None:
        made = reconstruct_points(noisy_torus(seed, NOISY[attraction]), attraction=attraction)
        assert made.report["fit"]["converged"]
        assert_honest(trace_of(made))

    @pytest.mark.parametrize("solid", ["sphere", "torus"])
    def test_come_to_rest_in_the_paper_s_twenty_to_thirty_steps(self, solid: str) -> None:
        made = smooth(solid)
        assert made.report["fit"]["converged"]
        assert len(trace_of(made).speed) <= 30

    @pytest.mark.parametrize("attraction", ["surface", "nearest"])
    def test_one_more_step_from_rest_moves_nothing(self, attraction: str) -> None:
        points = noisy_torus(7, min(NOISY[attraction], 5000))
        made = reconstruct_points(points, attraction=attraction, tolerance=TOLERANCE, remesh=False)
        count = len(trace_of(made).speed)
        same, more = (
            reconstruct_points(points, attraction=attraction, tolerance=NEVER, max_steps=count + n, remesh=False)
            for n in (0, 1)
        )
        assert trace_of(made).converged
        assert not trace_of(same).converged
        assert made.mesh.vertices.tobytes() == same.mesh.vertices.tobytes()
        moved = np.linalg.norm(more.mesh.vertices - same.mesh.vertices, axis=1)
        assert moved.max() < TOLERANCE * edge_of(made)

    @law(12)
    @given(seed=st.integers(0, 50), most=st.integers(1, 40), tolerance=st.floats(1e-4, 0.3))
    def test_are_never_called_at_rest_while_they_move(self, seed: int, most: int, tolerance: float) -> None:
        points = noisy_torus(seed, size(2500, 500), 0.06)
        made = reconstruct_points(points, max_steps=most, tolerance=tolerance)
        assert_honest(trace_of(made), tolerance)
        assert made.report["fit"]["converged"] == trace_of(made).converged
        assert len(trace_of(made).speed) == most or trace_of(made).converged

    def test_are_not_at_rest_before_the_last_projection(self) -> None:
        """Whatever the tolerance: the projections would still be sought anew."""
        made = reconstruct_points(noisy_torus(1, size(2500, 500)), tolerance=1e6)
        assert len(trace_of(made).speed) == 21


class TestProjections:
    """The numbers of the moving least-squares fit, by what they do."""

    def test_springs_that_hold_let_the_mesh_slow_down(self) -> None:
        """Without them it would creep: four times as fast at the twentieth step."""
        assert trace_of(smooth("torus")).speed[19] < 0.004

    def test_a_third_of_the_springs_holds_until_the_last_projection(self, monkeypatch: pytest.MonkeyPatch) -> None:
        shares: list[float] = []

        def told(*given: Any) -> None:
            shares.append(float(given[7][3]))
            advance(*given)

        monkeypatch.setattr(mls, "advance", told)
        made = reconstruct_points(sphere(300), max_steps=22)
        assert len(made.mesh.vertices) < mls.BLOCK
        assert shares == [pytest.approx(1 / 3)] * 20 + [1.0] * (len(shares) - 20)
        assert len(shares) > 20

    def test_springs_even_the_mesh_out_all_the_same(self, monkeypatch: pytest.MonkeyPatch) -> None:
        points = torus(size(3000, 900))
        even = spread(reconstruct_points(points, remesh=False))
        monkeypatch.setattr(mls, "RESTORING", 1.0)
        assert even < 0.98 * spread(reconstruct_points(points, remesh=False))

    def test_little_is_left_to_do_after_the_last(self) -> None:
        """Vertices that have moved some way are projected anew before: each of the next jumps is short."""
        assert trace_of(smooth("torus")).acceleration[20] < 0.015

    def test_the_last_are_exact(self) -> None:
        """Projected once more where they came to rest, the vertices of a smooth surface lie on it already."""
        state, projector, edge = rested_over(torus(size(3000, 900)))
        projector.renew(state.places, 0.0, state.projections, state.anchors, through=projector.exact)
        assert np.quantile(np.abs(state.projections[:, 0]), 0.99) < TOLERANCE * edge

    def test_a_sphere_keeps_its_volume(self) -> None:
        """Chords lie inside of the surface, and corners rise for it: not half as much, nor twice, nor the other way."""
        volume = smooth("sphere").mesh.face_volumes.sum()
        assert volume == pytest.approx(4 / 3 * np.pi * 10**3, rel=1.5 / size(3000, 900))


def spread(surface: Surface) -> float:
    """Return the standard deviation of the edges over their mean."""
    ends = surface.mesh.vertices[surface.mesh.edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return float(lengths.std() / lengths.mean())


def rested_over(points: Floats) -> tuple[Any, Any, float]:
    """Return the state in which a mesh rests on a cloud, its projector, and the edge of the cubes."""
    made = reconstruct_points(points, max_steps=0)
    origin = points.min(axis=0)
    samples, start = settle_points(points - origin), made.smoothed.vertices - origin
    ring = OneRing.of_quads(made.cuberille.quads.astype(np.int32), len(start))
    projector = mls._Projector.under(start, ring, samples, 1)
    steps = mls._ProjectionSteps(start, ring, projector, edge_of(made), FitSettings(), 1)
    state, trace = iterate(steps, 200, silent)
    assert trace.converged
    return state, projector, edge_of(made)


class TestNets:
    @pytest.mark.parametrize("mask", [False, True])
    @pytest.mark.parametrize("most", [1, 4, 200])
    def test_are_at_rest_where_no_vertex_moves(self, most: int, mask: bool) -> None:
        volume = ball_of(9, mask=mask)
        found = boundary(volume, volume.voxels > 0, lower=0.0)
        made = voxel_surface(found, FitSettings(max_steps=most)).net_fit
        count = len(made.trace.speed)
        assert_honest(made.trace)
        assert made.trace.converged == (max(made.trace.speed[-1], made.trace.acceleration[-1]) < TOLERANCE)
        same, more = (voxel_surface(found, FitSettings(max_steps=count + n, tolerance=NEVER)).net_fit for n in (0, 1))
        assert same.positions.tobytes() == made.positions.tobytes()
        moved = np.linalg.norm(more.positions - same.positions, axis=1).max()
        assert moved < TOLERANCE or not made.trace.converged
        assert moved == pytest.approx(more.trace.speed[-1]) or mask

    def test_of_masks_rest_too(self) -> None:
        volume = ball_of(9, mask=True)
        found = boundary(volume, volume.voxels > 0, lower=0.0)
        made = voxel_surface(found, FitSettings()).net_fit
        assert made.trace.converged
        assert made.trace.speed[-1] < FitSettings().tolerance


class Falling:
    """A mesh that is half as fast at each step."""

    def init(self) -> float:
        return 1.0

    def step(self, state: float, count: int) -> tuple[float, Motion]:
        return state / 2, Motion(speed=2.0**-count, acceleration=2.0 ** -(count + 1), kinetic=0.0)

    def rested(self, motion: Motion, count: int) -> bool:
        return motion.rests(0.1)


class TestLoop:
    @law(30)
    @given(most=st.integers(0, 20))
    def test_ends_at_rest_or_with_the_last_step(self, most: int) -> None:
        told: list[tuple[str, int, int]] = []
        state, trace = iterate(Falling(), most, lambda *said: told.append(said))
        steps = min(most, 5)
        assert state == 2.0**-steps
        np.testing.assert_array_equal(trace.speed, 2.0 ** -np.arange(steps))
        assert trace.converged == (most >= 5)
        assert [done for _, done, _ in told] == [*range(1, steps + 1), max(steps, 1)]
        assert told[-1][1] == told[-1][2]

    @pytest.mark.parametrize(("speed", "acceleration", "rests"), [(0.9, 0.9, True), (1.0, 0, False), (0, 1.0, False)])
    def test_rest_needs_both_speed_and_acceleration(self, speed: float, acceleration: float, rests: bool) -> None:
        assert Motion(speed, acceleration, 0.0).rests(1.0) == rests
