"""Inputs of a few points, voxels or neurons: a sound surface, or one line that says what to try; never a fault."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh import TomomeshError, Volume, phantom, reconstruct, reconstruct_points, segment
from tomomesh.errors import EmptyError, GeometryError, InternalCheckError
from tomomesh.measure.intersections import CrossingFaces
from tomomesh.measure.topology import check_promise
from tomomesh.model.mesh import TriMesh
from tomomesh.ways.contours import boundary_of_rings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

LINE = np.arange(50.0)[:, None]
NETWORKS = ("chain", "ring", "grid", "hexagonal", "cylinder", "torus", "sphere", "none")


def ball(size: int, radius: float) -> Volume:
    away = np.sqrt(((np.indices((size,) * 3) - (size - 1) / 2) ** 2).sum(axis=0))
    return Volume.from_stored(200 * (away < radius).astype(np.uint8), np.eye(4))


class TestSheets:
    @pytest.mark.parametrize("step", [(1, 0, 0), (1, 2, 3), (0.1, 0.1, 0.7)])
    def test_of_a_line_are_refused(self, step: tuple[float, ...]) -> None:
        with pytest.raises(GeometryError, match="they lie on a line"):
            reconstruct_points(LINE * step, open=True)

    @pytest.mark.parametrize("count", [1, 12])
    def test_of_one_place_are_refused(self, count: int) -> None:
        with pytest.raises(GeometryError, match="they lie at one place"):
            reconstruct_points(np.full((count, 3), 2.5), open=True)

    @pytest.mark.parametrize("count", [3, 4, 8, 15])
    def test_of_too_few_points_to_measure_are_refused(self, count: int) -> None:
        flat = np.random.default_rng(count).normal(size=(count, 3)) * [1, 1, 0]
        with pytest.raises(GeometryError, match="nothing of the surface would be measured"):
            reconstruct_points(flat, open=True)

    def test_of_a_small_grid_are_measured(self) -> None:
        grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), [0.0]), -1).reshape(-1, 3)
        surface = reconstruct_points(grid, open=True)
        assert surface.filled is not None
        assert not surface.filled.any()
        # the square between the outermost points, and that of what all points own
        assert 16 < float(surface.mesh.face_areas.sum()) < 25

    def test_of_a_ring_alone_are_sheets_or_refused(self) -> None:
        turn = np.arange(48) * (2 * np.pi / 48)
        with pytest.raises((GeometryError, EmptyError)):
            reconstruct_points(np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]), open=True)


class TestSpace:
    @pytest.mark.parametrize("neurons", [20, 40, 58])
    def test_a_torus_that_meets_nothing_is_refused(self, neurons: int) -> None:
        head = phantom((27, 128, 128), (1.875, 1.875, 5.4))
        with pytest.raises(GeometryError, match=r"no vertex of the mesh lies near a sample.*more --neurons"):
            reconstruct(head.volume, lower=150.0, network="torus", neurons=neurons)

    @pytest.mark.parametrize("neurons", [3, 12, 20, 24, 42, 92])
    def test_a_sphere_of_few_neurons_is_sound(self, neurons: int) -> None:
        made = reconstruct(ball(24, 9.0), lower=100.0, network="sphere", neurons=neurons)
        check_promise(made.mesh)
        assert float(made.mesh.face_volumes.sum()) == pytest.approx(4 / 3 * np.pi * 9**3, rel=0.1)

    @pytest.mark.parametrize(("shape", "network"), [((9, 1, 9), "torus"), ((1, 9, 9), "torus"), ((2, 2, 2), "sphere")])
    def test_one_that_has_fallen_flat_is_refused(self, shape: tuple[int, ...], network: str) -> None:
        full = Volume.from_stored(np.full(shape, 200, np.uint8), np.eye(4))
        with pytest.raises(GeometryError, match=r"fallen flat|does not follow"):
            reconstruct(full, lower=0.0, network=network, neurons=3)


def test_contours_thinner_than_a_pixel_enclose_nothing() -> None:
    plate = np.zeros((4, 20, 30), np.uint8)
    plate[:, 10, 5:25] = 200
    study = Volume.from_stored(plate, np.eye(4))
    assert reconstruct(study, lower=100.0, contours="loops").report["quality"]["components"] == 1
    found = segment(study, lower=100.0, contours="loops")
    thin = tuple(replace(one, codebook=10.5 + 0.02 * (one.codebook - 10.5)) for one in found.source.contours)
    shrunk = replace(found, source=replace(found.source, kind="components", contours=thin))
    with pytest.raises(EmptyError, match="the contours enclose no pixel"):
        boundary_of_rings(shrunk)


class TestClouds:
    def test_far_from_the_origin_need_digits(self) -> None:
        far = np.array([[1e30, -1e30, 2e30]])
        with pytest.raises(GeometryError, match="too far from the origin"):
            reconstruct_points(far)
        check_promise(reconstruct_points(far, local_origin=True).mesh)

    def test_crossings_of_no_faces_are_none(self) -> None:
        assert CrossingFaces(1)(TriMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))).shape == (0,)


def refused(made: Callable[[], Surface]) -> Surface | None:
    """Return what is made, or None where that is refused in one line; a failed check of its own is no refusal."""
    try:
        return made()
    except InternalCheckError:
        raise
    except TomomeshError:
        return None


@st.composite
def clouds(draw: st.DrawFn) -> Floats:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = rng.normal(size=(draw(st.integers(1, 40)), 3))
    kind = draw(st.sampled_from(["any", "line", "plane", "repeated", "apart", "lattice", "far"]))
    if kind == "line":
        return points[:, :1] * rng.normal(size=3)
    if kind == "plane":
        return np.asarray(points[:, :2] @ rng.normal(size=(2, 3)))
    if kind == "repeated":
        return points[rng.integers(0, len(points), len(points)) // 3]
    if kind == "apart":
        return points + 1000 * rng.integers(0, 2, (len(points), 1))
    return np.rint(2 * points) if kind == "lattice" else points + 1e9 if kind == "far" else points


@law(40)
@given(clouds(), st.booleans(), st.booleans())
def test_any_cloud_gives_a_sound_surface_or_one_line(points: Floats, sheet: bool, leaks: bool) -> None:
    surface = refused(lambda: reconstruct_points(points, open=sheet, allow_leaks=leaks))
    if surface is not None:
        check_promise(surface.mesh, cavities=surface.cavities, open_=sheet)
        assert surface.filled is None or not sheet or not surface.filled.all()


@law(40)
@given(
    st.sampled_from([(1, 1, 1), (1, 9, 9), (2, 9, 9), (9, 1, 9), (9, 9, 1), (2, 2, 2), (6, 12, 12)]),
    st.sampled_from([0.1, 0.5, 1.0]), st.sampled_from(NETWORKS), st.integers(3, 30), st.integers(0, 99),
)  # fmt: skip
def test_any_study_gives_a_sound_surface_or_one_line(
    shape: tuple[int, ...], share: float, network: str, neurons: int, seed: int
) -> None:
    kept = np.random.default_rng(seed).random(shape) < share
    study = Volume.from_stored(200 * kept.astype(np.uint8), np.eye(4))
    made = refused(lambda: reconstruct(study, lower=100.0, network=network, neurons=neurons))
    if made is not None:
        check_promise(made.mesh, cavities=made.cavities)
