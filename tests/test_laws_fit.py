"""The dynamic mesh: forces in balance, rest at the sparse solution, no step beyond a cube's edge."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import diags_array
from scipy.sparse.linalg import spsolve

from conftest import composed, cuberille_of, law, seeds, size, solids, sphere
from tomomesh.cuberille.leak_test import CLOSINGS, close_leaks
from tomomesh.cuberille.partition import partition
from tomomesh.dynamics.low_pass import adjacency, low_pass
from tomomesh.dynamics.mass_spring import Fit, _NearestState, _NearestSteps, fit
from tomomesh.errors import UsageError
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from tomomesh.model.cubes import CubeGrid
    from tomomesh.model.mesh import QuadMesh

    Floats = NDArray[np.float64]

LIMITS = ["clamp", "shorten"]


def shell_of(
    points: Floats, cell_mm: float | tuple[float, ...], closings: Iterable[int] = CLOSINGS
) -> tuple[CubeGrid, QuadMesh, NDArray[np.int64]]:
    """Return the cubes of a cloud, their surface, and the cube that each of its vertices came from."""
    grid = partition(points, np.broadcast_to(cell_mm, 3).astype(np.float64))
    return close_leaks(grid.cells, closings).faces.over(grid)


def rested(points: Floats, cell_mm: float, settings: FitSettings, *, threads: int = 1) -> tuple[QuadMesh, Fit]:
    """Fit the smoothed surface of a cloud to it."""
    cubes, mesh, origins = shell_of(points, cell_mm)
    start = low_pass(mesh.vertices, mesh.edges, 3)
    return mesh, fit(start, mesh.edges, origins, points, cubes, settings, threads=threads)


def ball(count: int = size(1500, 300)) -> tuple[Floats, float]:
    """Return points of a sphere and a cell about their distance."""
    return sphere(count), float(np.sqrt(4 * np.pi / count) * 10) * 1.3


@st.composite
def meshes(draw: st.DrawFn) -> tuple[QuadMesh, CubeGrid, Floats]:
    """Draw a small closed surface whose vertices were moved, and the partition of those."""
    quads = cuberille_of(composed(draw(solids(3))))
    rng = np.random.default_rng(draw(seeds))
    places = quads.vertices + rng.uniform(-0.3, 0.3, quads.vertices.shape)
    return quads, partition(places, np.ones(3)), places


def cubes_under(points: Floats, grid: CubeGrid) -> NDArray[np.int64]:
    """Return the cube that holds each point."""
    found = np.empty(len(points), np.int64)
    found[grid.order] = np.repeat(np.arange(len(grid.keys)), np.diff(grid.start))
    return found


class TestLowPass:
    @law(80)
    @given(made=meshes(), passes=st.integers(0, 20), seed=seeds)
    def test_stays_in_the_convex_hull(self, made: tuple[QuadMesh, CubeGrid, Floats], passes: int, seed: int) -> None:
        quads, _, places = made
        directions = np.random.default_rng(seed).normal(size=(3, 40))
        reach = (places @ directions).max(axis=0)
        assert (low_pass(places, quads.edges, passes) @ directions <= reach + 1e-12).all()

    @law(40)
    @given(made=meshes(), passes=st.integers(0, 20), place=st.floats(-1e9, 1e9))
    def test_keeps_a_constant(self, made: tuple[QuadMesh, CubeGrid, Floats], passes: int, place: float) -> None:
        still = np.full_like(made[2], place)
        np.testing.assert_array_equal(low_pass(still, made[0].edges, passes), still)

    @law(40)
    @given(made=meshes(), passes=st.integers(1, 5))
    def test_takes_half_of_its_own_place_and_half_of_its_neighbors_mean(
        self, made: tuple[QuadMesh, CubeGrid, Floats], passes: int
    ) -> None:
        quads, _, places = made
        beside: list[list[int]] = [[] for _ in places]
        for a, b in quads.edges.tolist():
            beside[a].append(b)
            beside[b].append(a)
        wanted = places
        for _ in range(passes):
            wanted = np.array([0.5 * p + 0.5 * wanted[n].mean(axis=0) for p, n in zip(wanted, beside, strict=True)])
        np.testing.assert_allclose(low_pass(places, quads.edges, passes), wanted, rtol=0, atol=1e-12)


class TestForces:
    @law(60)
    @given(made=meshes(), stiffness=st.floats(0.01, 3))
    def test_of_the_springs_add_up_to_nothing(self, made: tuple[QuadMesh, CubeGrid, Floats], stiffness: float) -> None:
        """From rest, two steps h move a vertex by h^2 a; with points at the vertices only springs pull."""
        quads, grid, places = made
        step = 0.05
        settings = FitSettings(stiffness=stiffness, step=step, max_steps=2, tolerance=1e-12)
        moved = fit(places, quads.edges, cubes_under(places, grid), places, grid, settings)
        degree = np.bincount(quads.edges.ravel(), minlength=len(places))[:, None]
        mass = 1 + stiffness / degree.mean() * degree
        force = mass * (moved.vertices - places) / step**2
        np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-9 * len(places))
        assert moved.trace.clamped.sum() == 0

    @law(40)
    @given(made=meshes(), limit=st.sampled_from(LIMITS))
    def test_are_none_at_rest(self, made: tuple[QuadMesh, CubeGrid, Floats], limit: str) -> None:
        quads, grid, places = made
        settings = FitSettings(stiffness=0.0, limit=limit)
        still = fit(places, quads.edges, cubes_under(places, grid), places, grid, settings)
        np.testing.assert_allclose(still.vertices, places, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(still.nearest, np.arange(len(places)))
        assert still.trace.converged
        assert still.trace.kinetic[-1] == 0.0

    @pytest.mark.parametrize("stiffness", [0.0, 0.5])
    def test_without_points_in_reach_are_those_of_the_springs(self, stiffness: float) -> None:
        """A wide closing adds cubes with no point around; such a vertex has no k_d, and with no springs stays."""
        points, cell = ball()
        points = points[points[:, 2] < 7]
        cubes, mesh, origins = shell_of(points, cell, closings=[6])
        settings = FitSettings(stiffness=stiffness)
        found = fit(mesh.vertices, mesh.edges, origins, points, cubes, settings)
        free = found.nearest < 0
        assert free.any()
        assert np.isfinite(found.vertices).all()
        if stiffness == 0:
            np.testing.assert_allclose(found.vertices[free], mesh.vertices[free], rtol=0, atol=1e-12)


class TestRest:
    @pytest.mark.parametrize("stiffness", [0.0, 0.5, 1.0])
    @pytest.mark.parametrize("limit", LIMITS)
    def test_is_the_sparse_solution(self, stiffness: float, limit: str) -> None:
        """The forces vanish where (k L + k_d) x = k_d x_d (METHOD: the limit is known)."""
        points, cell = ball()
        mesh, rest = rested(points, cell, FitSettings(stiffness=stiffness, limit=limit))
        assert rest.trace.converged
        degree = np.bincount(mesh.edges.ravel()).astype(float)
        k = stiffness / degree.mean()
        drawn = (rest.nearest >= 0) * 1.0
        laplacian = diags_array(degree) - adjacency(mesh.edges, len(degree))
        system = (k * laplacian + diags_array(drawn)).tocsc()
        wanted = spsolve(system, drawn[:, None] * points[rest.nearest])
        assert np.linalg.norm(rest.vertices - wanted, axis=1).max() < 0.01 * cell

    def test_lies_on_the_points_without_springs(self) -> None:
        points, cell = ball()
        _, rest = rested(points, cell, FitSettings(stiffness=0.0, tolerance=1e-9, max_steps=500))
        np.testing.assert_allclose(rest.vertices, points[rest.nearest], atol=1e-6)

    @pytest.mark.parametrize("limit", LIMITS)
    def test_is_the_same_for_any_number_of_threads(self, limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.dynamics.mass_spring.BLOCK", 97)
        points, cell = ball()
        one, two = (rested(points, cell, FitSettings(limit=limit), threads=n)[1] for n in (1, 2))
        assert one.vertices.tobytes() == two.vertices.tobytes()
        assert one.nearest.tobytes() == two.nearest.tobytes()

    def test_comes_within_the_paper_s_twenty_to_thirty_steps(self) -> None:
        points, cell = ball()
        _, rest = rested(points, cell, FitSettings())
        assert len(rest.trace.speed) <= 30

    def test_is_not_claimed_where_there_were_too_few_steps(self) -> None:
        points, cell = ball()
        _, rest = rested(points, cell, FitSettings(max_steps=3))
        assert not rest.trace.converged
        assert len(rest.trace.speed) == 3

    @pytest.mark.parametrize("max_steps", [0, 1])
    def test_needs_a_step_to_move(self, max_steps: int) -> None:
        points, cell = ball()
        mesh, rest = rested(points, cell, FitSettings(max_steps=max_steps))
        start = low_pass(mesh.vertices, mesh.edges, 3)
        np.testing.assert_allclose(rest.vertices, start, rtol=0, atol=1e-12)


class TestEnergy:
    @pytest.mark.parametrize("step", [0.05, 0.2, 0.8])
    def test_falls_once_the_kinetic_energy_has_peaked(self, step: float) -> None:
        """From rest the kinetic energy must rise first; explicit Euler adds to the sum while it does."""
        points, cell = ball()
        _, rest = rested(points, cell, FitSettings(step=step))
        kinetic, total = rest.trace.kinetic, rest.trace.kinetic + rest.trace.potential
        assert kinetic[0] == 0 < kinetic.max()
        assert (np.diff(total[kinetic.argmax() :]) <= 1e-9 * total[0]).all()

    @pytest.mark.parametrize("damping", [0.25, 0.7, 1.0, 1.25, 3.0])
    @pytest.mark.parametrize("step", [0.2, 0.8, 1.0])
    def test_never_explodes_within_the_settings_limits(self, damping: float, step: float) -> None:
        """Such a pair is either refused or stable: explicit Euler needs step < damping and step < 1 / damping."""
        points, cell = ball(300)
        try:
            settings = FitSettings(damping=damping, step=step)
        except UsageError:
            assert step > min(damping, 1 / damping)
            return
        _, rest = rested(points, cell, settings)
        assert rest.trace.distance_mm[-1] < rest.trace.distance_mm[0]


class TestLimit:
    @pytest.mark.parametrize("limit", LIMITS)
    @pytest.mark.parametrize("stiffness", [0.0, 0.5])
    def test_no_vertex_moves_more_than_a_cube_s_edge_in_a_step(self, limit: str, stiffness: float) -> None:
        """Steps are told apart by runs that end one step later each."""
        points, cell = ball(size(400, 100))
        cubes, mesh, origins = shell_of(points, cell)
        far = mesh.vertices * 3.0
        settings = FitSettings(stiffness=stiffness, limit=limit, step=1.0)
        before, clamped = far, 0
        for steps in range(1, 9):
            now = fit(far, mesh.edges, origins, points, cubes, replace(settings, max_steps=steps))
            assert np.linalg.norm(now.vertices - before, axis=1).max() <= cell * (1 + 1e-9)
            before, clamped = now.vertices, int(now.trace.clamped.sum())
        assert clamped > 0

    def test_uses_the_shortest_edge(self) -> None:
        points, _ = ball(size(1500, 500))
        cubes, mesh, origins = shell_of(points, (1.5, 2.5, 3.0))
        assert cubes.cells.max() > 2
        far = mesh.vertices * 3.0
        settings = FitSettings(step=1.0, max_steps=2)
        moved = fit(far, mesh.edges, origins, points, cubes, settings).vertices - far
        assert np.linalg.norm(moved, axis=1).max() == pytest.approx(1.5)


class TestCorrespondence:
    """The paper's: at every step, search in the cube that holds the point last assigned, and in its 26 neighbors."""

    @law(20)
    @given(length=st.integers(8, 40), stiffness=st.floats(20, 200), springs=st.integers(1, 4), seed=seeds)
    def test_goes_with_a_vertex_over_many_cubes(self, length: int, stiffness: float, springs: int, seed: int) -> None:
        """Stiff springs of no length draw the ends of a chain together, along points that lie everywhere."""
        rng = np.random.default_rng(seed)
        along = np.arange(0, length, 0.25)
        points = np.column_stack([along, rng.uniform(-0.05, 0.05, (2, len(along))).T])
        start = np.column_stack([np.linspace(0, length - 1, springs + 1), np.zeros((springs + 1, 2))])
        edges = np.column_stack([np.arange(springs), np.arange(springs) + 1])
        grid = partition(points, np.ones(3))
        cubes = cubes_under(points, grid)[nearest_of(start, points)]
        found = fit(start, edges, cubes, points, grid, FitSettings(stiffness=stiffness, max_steps=3000))
        apart = np.linalg.norm(points[found.nearest] - found.vertices, axis=1)
        wanted = np.linalg.norm(points[nearest_of(found.vertices, points)] - found.vertices, axis=1)
        assert (apart < wanted + 0.35).all(), "the nearest point, or the next, where a vertex has left the nearest"
        assert np.abs(found.vertices - start)[:, 0].max() > 3

    def test_sees_no_farther_than_the_26_cubes_around(self) -> None:
        """A point that is nearer but two cubes away has no say."""
        points = np.array([[0.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
        grid = partition(points, np.ones(3))
        start = np.array([[2.1, 0.5, 0.5]])
        found = fit(start, NO_SPRINGS, cubes_under(points, grid)[:1], points, grid, FitSettings())
        assert found.nearest.tolist() == [0]
        np.testing.assert_allclose(found.vertices, points[:1], atol=0.01)


NO_SPRINGS = np.empty((0, 2), np.int64)


def nearest_of(places: Floats, points: Floats) -> NDArray[np.int64]:
    """Return the nearest of all points."""
    return np.asarray(((places[:, None] - points) ** 2).sum(axis=2).argmin(axis=1))


class TestReturns:
    """Half way between two points at 0 and 2, one step h carries a vertex from 1 - q to 1 + q and the next one back.

    That is so for q = h^2 / (4 - 4 h + h^2) and the velocities +-2 q / h; there explicit Euler swings for ever.
    """

    @law(20)
    @given(step=st.floats(0.3, 0.9))
    def test_let_a_vertex_swing_for_ever_between_two_points(self, step: float) -> None:
        speeds, places = swinging(FitSettings(step=step, allow_returns=True))
        q = step**2 / (2 - step) ** 2
        np.testing.assert_allclose(np.abs(places - 1), q, atol=1e-9)
        np.testing.assert_allclose(speeds, 2 * q / step, rtol=1e-9)

    @law(20)
    @given(step=st.floats(0.3, 0.9))
    def test_are_not_allowed_by_default(self, step: float) -> None:
        speeds, places = swinging(FitSettings(step=step))
        assert speeds[-1] < 1e-3
        assert min(abs(places[-1]), abs(places[-1] - 2)) < 1e-2

    @pytest.mark.parametrize("seed", [637, 1330, 1415, 2543])
    def test_keep_a_mesh_from_its_rest(self, seed: int) -> None:
        """Three vertices on springs among six points, from rest: 4 of 3,000 such swing."""
        rng = np.random.default_rng(seed)
        points, start = rng.uniform(-2, 2, (6, 3)), rng.uniform(-2, 2, (3, 3))
        grid = partition(points, np.full(3, 4.0))
        cubes = cubes_under(points, grid)[nearest_of(start, points)]
        edges = np.array([[0, 1], [1, 2], [0, 2]])
        still, swings = (
            fit(start, edges, cubes, points, grid, FitSettings(allow_returns=allowed)) for allowed in (False, True)
        )
        assert still.trace.converged
        assert not swings.trace.converged


def swinging(settings: FitSettings) -> tuple[Floats, Floats]:
    """Start a vertex half way between two points with the velocity of a swing; return its speeds and places."""
    points = np.array([[0.0, 0, 0], [2.0, 0, 0]])
    grid = partition(points, np.full(3, 4.0))
    h = settings.step
    q = h**2 / (2 - h) ** 2
    place, none = np.array([[1 - q, 0, 0]]), np.full(1, -1, np.int32)
    steps = _NearestSteps(place, points - grid.origin, NO_SPRINGS, np.zeros(1, np.int32), grid, settings, 1)
    velocity = np.array([[2 * q / h, 0, 0]])
    state = _NearestState(place - grid.origin, velocity, none, none, np.zeros(1, np.int32))
    speeds, places = list[float](), list[float]()
    for count in range(400):
        state, _ = steps.step(state, count)
        speeds.append(float(np.linalg.norm(state.velocity)))
        places.append(float((state.position + grid.origin)[0, 0]))
    return np.array(speeds), np.array(places)
