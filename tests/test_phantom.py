"""The built-in head: its truth is exact, its window symmetric, its bytes repeatable."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import UsageError
from tomomesh.head_phantom import NASAL_OPENING, Head, Phantom, phantom
from tomomesh.measure.topology import topology


@pytest.fixture(scope="module", params=["mr", "ct"])
def made(request: pytest.FixtureRequest) -> Phantom:
    return phantom(contrast=request.param)


def head_of(made: Phantom) -> Head:
    return Head.fitted(made.volume.shape, made.volume.spacing_mm)


def window_mm(made: Phantom) -> np.ndarray:
    """Millimeters of the window's voxels away from the nose's opening, (n, 3)."""
    voxels = made.volume.voxels
    k, j, i = np.nonzero((voxels > made.lower) & (voxels <= made.upper))
    positions = made.volume.to_mm(np.stack([i, j, k], axis=1).astype(float))
    return positions[head_of(made).ellipsoid(NASAL_OPENING, *positions.T) > 2]


class TestTruth:
    def test_is_the_exact_middle(self, made: Phantom) -> None:
        assert np.abs(head_of(made).skull(*made.truth.vertices.T)).max() < 1e-9

    def test_spans_the_outer_slices(self, made: Phantom) -> None:
        ends = made.volume.to_mm(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, made.volume.shape[0] - 1]]))[:, 2]
        heights = made.truth.vertices[:, 2]
        np.testing.assert_allclose([heights.min(), heights.max()], ends, atol=1e-9)

    def test_is_met_by_every_slice(self, made: Phantom) -> None:
        voxels = made.volume.voxels
        assert ((voxels > made.lower) & (voxels <= made.upper)).sum(axis=(1, 2)).min() > 1000

    def test_looks_outward(self, made: Phantom) -> None:
        centers = made.truth.corners.mean(axis=1)
        step = 0.5 * made.truth.face_vectors / (2 * made.truth.face_areas[:, None])
        rise = head_of(made).skull(*(centers + step).T) - head_of(made).skull(*centers.T)
        np.testing.assert_allclose(rise, 0.5, atol=0.02)

    def test_is_one_tube_open_at_both_ends(self, made: Phantom) -> None:
        mesh = made.truth
        keys, count = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_counts=True)
        rim = keys[count == 1]
        assert set(count) == {1, 2}
        assert len(mesh.vertices) - len(mesh.edges) + len(mesh.faces) == 0
        assert set(np.round(mesh.vertices[rim.ravel(), 2], 6)) == set(
            np.round([mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()], 6)
        )

    def test_with_its_caps_is_a_solid_of_one_piece(self, made: Phantom) -> None:
        solid = made.closed_truth
        assert topology(solid).sound
        assert topology(solid).genus == 0
        np.testing.assert_array_equal(solid.vertices[:-2], made.truth.vertices)
        rings = made.truth.vertices.reshape(144, -1, 3)
        x, y = rings[..., 0], rings[..., 1]
        areas = 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
        assert solid.face_volumes.sum() == pytest.approx(np.trapezoid(areas, rings[:, 0, 2]), rel=1e-3)

    def test_is_smooth_across_the_equator(self) -> None:
        head = Head()
        around = head.skull(np.full(2, 60.0), np.full(2, 30.0), np.array([-1e-4, 1e-4]))
        assert abs(np.diff(around)[0]) < 1e-6


class TestDistance:
    def test_is_exact_for_a_ball(self) -> None:
        points = np.random.default_rng(0).normal(size=(100, 3)) * 10
        away = Head().ellipsoid(((0.0, 0.0, 0.0), (7.0, 7.0, 7.0)), *points.T)
        np.testing.assert_allclose(away, np.sqrt((points**2).sum(axis=1)) - 7, atol=1e-9)

    def test_of_the_skull_is_of_second_order(self) -> None:
        head = Head()
        mesh = head.middle(64, 32)
        faults = []
        for offset in (2.0, 1.0, 0.5):
            moved = mesh.vertices[64:-64] + offset * mesh.vertex_normals[64:-64]
            faults.append(np.abs(head.skull(*moved.T) - head.skull(*mesh.vertices[64:-64].T) - offset).mean())
        assert all(coarse > 1.8 * fine for coarse, fine in pairwise(faults))


class TestWindow:
    def test_middle_lies_on_the_truth(self, made: Phantom) -> None:
        away = head_of(made).skull(*window_mm(made).T)
        assert abs(away.mean()) < 0.1

    def test_is_the_band_and_nothing_else(self, made: Phantom) -> None:
        away = head_of(made).skull(*window_mm(made).T)
        half = head_of(made).half_width_mm
        assert np.abs(away).max() < half + made.volume.spacing_mm[0] / 2
        assert abs(away.max() + away.min()) < 0.1

    def test_leaves_out_the_nose_opening(self, made: Phantom) -> None:
        front = made.volume.voxels[4, : made.volume.shape[1] // 2, made.volume.shape[2] // 2]
        assert (front <= made.lower).all()


class TestMaking:
    @law(40)
    @given(
        shape=st.tuples(st.integers(2, 9), st.integers(16, 48), st.integers(16, 48)),
        across=st.floats(0.05, 20),
        oblong=st.floats(0.5, 2),
        between=st.floats(0.05, 20),
        contrast=st.sampled_from(["mr", "ct"]),
    )
    def test_fits_any_field_of_view(
        self, shape: tuple[int, int, int], across: float, oblong: float, between: float, contrast: str
    ) -> None:
        spacing_mm = (across, oblong * across, between)
        made = phantom(shape, spacing_mm, contrast=contrast)
        voxels = made.volume.voxels
        assert voxels.shape == shape
        np.testing.assert_allclose(made.volume.spacing_mm, spacing_mm)
        assert ((voxels > made.lower) & (voxels <= made.upper)).any(axis=(1, 2)).all()
        corners = made.volume.to_mm(np.array([[0.0, 0.0, 0.0], [shape[2] - 1.0, shape[1] - 1.0, shape[0] - 1.0]]))
        assert (np.abs(made.truth.vertices[:, :2]) < np.abs(corners[0, :2]) + np.array(spacing_mm[:2])).all()
        assert np.abs(head_of(made).skull(*made.truth.vertices.T)).max() < 1e-9 * max(spacing_mm)

    def test_repeats_its_bytes(self) -> None:
        first, second = (phantom((8, 64, 48), (1.1, 0.7, 3.3), seed=3) for _ in range(2))
        assert first.volume.voxels.tobytes() == second.volume.voxels.tobytes()
        assert first.truth.vertices.tobytes() == second.truth.vertices.tobytes()

    def test_draws_other_noise_from_another_seed(self) -> None:
        first, second = (phantom((8, 64, 48), seed=seed).volume.voxels for seed in (0, 1))
        assert (first != second).mean() > 0.5

    def test_has_the_asked_noise(self) -> None:
        clean, noisy = (phantom((4, 64, 64), contrast="ct", noise=n).volume.voxels for n in (0, 40))
        inside = clean == 40
        assert inside.sum() > 100
        assert abs(noisy[inside].std() - 40) < 4

    def test_types_and_units(self) -> None:
        mr, ct = (phantom((2, 16, 16), contrast=contrast).volume for contrast in ("mr", "ct"))
        assert (mr.voxels.dtype.name, mr.unit) == ("uint8", "stored")
        assert (ct.voxels.dtype.name, ct.unit) == ("int16", "HU")

    @pytest.mark.parametrize(
        "wrong",
        [
            {"shape": (1, 64, 64)},
            {"shape": (64, 64)},
            {"spacing_mm": (1.0, 0.0, 1.0)},
            {"spacing_mm": (1.0, float("nan"), 1.0)},
            {"contrast": "pet"},
            {"noise": -1.0},
        ],
    )
    def test_refuses_what_it_cannot_make(self, wrong: dict[str, object]) -> None:
        with pytest.raises(UsageError, match="Expected"):
            phantom(**wrong)  # type: ignore[arg-type]
