"""Rings on their pixels, what lies between the slices, and the surface of both: laws and whole runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import example, given
from scipy import ndimage

from conftest import law, seeds, size
from test_several_contours import blot, blots, trained
from tomomesh import Volume, reconstruct
from tomomesh.isosurface.crossings import Levels
from tomomesh.measure.polygon import distance
from tomomesh.segmentation.contours.between import filled_between
from tomomesh.segmentation.contours.inputs import OFF
from tomomesh.segmentation.contours.insides import NEAR, RingFrame, insides_of
from tomomesh.segmentation.contours.train import train_contours
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]


def study(mask: Mask, spacing: tuple[float, float, float] = (1.0, 1.0, 4.0)) -> Volume:
    return Volume.from_stored(mask.astype(np.uint8), np.diag([*spacing, 1.0]))


def rings_and_wrong(plane: Mask) -> tuple[list[Floats], Mask]:
    """Return the curves of the rings on a slice, and which pixels around them are not where the window has them."""
    mask, found = plane[None], trained([plane], "loops")
    insides = insides_of(found, mask, RingFrame.of(found, (1.0, 1.0)))
    rows, columns = insides.depths.shape[1:]
    framed = np.pad(plane, 8)
    x, y = insides.low[:2] + 8
    return [*insides.curves[0].values()], (insides.depths[0] > 0) != framed[y : y + rows, x : x + columns]


def loops(mask: Mask, spacing: tuple[float, float, float] = (1.0, 1.0, 4.0), **asked: Any) -> Surface:
    found = reconstruct(study(mask, spacing), select=(1,), contours="loops", **asked)
    assert found.report["quality"]["self_intersections"] == 0
    return found


class TestLoops:
    """Rings at their place below a pixel, and how many neurons they have."""

    @law(15)
    @given(blots())
    @example(blot(428208255, 1.0, 0.751))
    @example(blot(1749941021, 1.214, 0.672))
    @example(blot(2412201382, 1.0, 0.81))
    def test_pixels_near_a_ring_are_inside_where_the_window_is(self, plane: Mask) -> None:
        """The examples have the most of those farther away, 12 of 378: bays of two pixels, which a ring passes by."""
        if not plane.any():
            return
        curves, wrong = rings_and_wrong(plane)
        places = np.argwhere(wrong)[:, ::-1].astype(float)
        away = np.min([distance(curve, places) for curve in curves], axis=0)
        assert (away >= NEAR - 1e-4).all()

    def test_few_pixels_are_farther_away_and_elsewhere(self) -> None:
        """Measured: .7 of a thousand pixels of 600 blots as wide as two pixels or a little more."""
        planes = [blot(seed, 1.0 + seed % 10 / 10, 0.3) for seed in range(size(40, 10))]
        wrong = sum(rings_and_wrong(plane)[1].sum() for plane in planes)
        assert wrong < 0.002 * sum(map(np.count_nonzero, planes))

    @pytest.mark.parametrize("radius", [4.3, 11.0, 30.2])
    def test_gray_levels_tell_the_place_between_pixels(self, radius: float) -> None:
        away = np.hypot(*(np.indices((80, 80)) - 39.6))
        gray = np.clip(20 * (radius - away) + 50, 0, 100)[None].astype(np.float32)
        found = train_contours(gray > 50, NetworkSettings(contours="loops"), levels=Levels(gray, 50.0, np.inf))
        (ring,) = found.contours
        off = np.hypot(*(ring.codebook - 39.6).T) - radius
        assert np.abs(off).max() < 0.1
        assert abs(off.mean()) < 0.03

    def test_neurons_follow_length_and_curvature(self) -> None:
        away = np.hypot(*(np.indices((200, 200)) - 99.4))
        counts = []
        for radius in (20.0, 80.0):
            gray = (radius - away)[None].astype(np.float32)
            found = train_contours(gray > 0, NetworkSettings(contours="loops"), levels=Levels(gray, 0.0, np.inf))
            counts.append(len(found.contours[0]))
        # a circle turns by 2 pi: 2 pi sqrt(r / (8 OFF)) neurons
        wanted = [2 * np.pi * np.sqrt(radius / (8 * OFF)) for radius in (20.0, 80.0)]
        np.testing.assert_allclose(counts, wanted, rtol=0.15)

    @pytest.mark.parametrize(("count", "side", "each"), [(3, 10, 20), (16, 10, 16), (25, 2, 8)])
    def test_a_slice_has_no_more_than_4096_by_default(self, count: int, side: int, each: int) -> None:
        """Squares of ten pixels want 20 neurons each, and 256 of them share; the least stays."""
        rows, columns = np.indices([count * (side + 2)] * 2)
        found = trained([(rows % (side + 2) < side) & (columns % (side + 2) < side)], "loops")
        assert {len(one) for one in found.contours} == {each}
        assert len(found) == count**2


class TestBetween:
    """What lies between two slices."""

    @law(8)
    @given(seeds)
    def test_slices_keep_their_pixels_and_nothing_floats_between(self, seed: int) -> None:
        noise = np.random.default_rng(seed).normal(size=(5, 36, 40))
        mask = ndimage.gaussian_filter(noise, (0.7, 2.0, 2.0)) > 0.05
        if (mask.any(axis=(1, 2))).sum() < 2:
            return
        found = train_contours(mask, NetworkSettings(contours="loops"))
        filled = filled_between(found, mask, study(mask)).voxels > 0
        insides = insides_of(found, mask, RingFrame.of(found, (1.0, 1.0)))
        own = filled[3:-3:4] if len(filled) > 7 else filled[3:4]
        np.testing.assert_array_equal(own, insides.depths > 0)
        pieces, count = ndimage.label(filled, np.ones((3, 3, 3)))
        assert set(np.unique(pieces[3:-3:4])) | {0} == set(range(count + 1))

    def test_threads_change_no_byte(self) -> None:
        mask = ndimage.gaussian_filter(np.random.default_rng(5).normal(size=(6, 40, 44)), (1, 3, 3)) > 0
        one, two = (loops(mask, threads=threads).mesh for threads in (1, 2))
        assert one.vertices.tobytes() == two.vertices.tobytes()
        assert one.faces.tobytes() == two.faces.tobytes()

    def test_a_sheet_that_slants_by_more_than_its_thickness_is_one(self) -> None:
        k, y, x = np.indices((10, 90, 90))
        away = np.hypot(y - 44.5, x - 44.5) - (8 + 3.5 * k)
        sheet = (away >= 0) & (away < 2)
        found = loops(sheet)
        quality = found.report["quality"]
        assert (quality["components"], quality["genus"]) == (1, 1)
        mean = 2 * np.pi * (9 + 3.5 * k[:, 0, 0]).mean()
        assert quality["volume_mm3"] == pytest.approx(10 * 4 * 2 * mean, rel=0.05)
        _, torn = ndimage.label(sheet, np.ones((3, 3, 3)))
        assert torn == 10

    def test_two_legs_join_as_a_y_without_crossings(self) -> None:
        k, y, x = np.indices((12, 60, 90))
        aside = np.maximum(24 - 3 * k, 0)
        legs = np.minimum(np.hypot(y - 29.5, x - 44.5 - aside), np.hypot(y - 29.5, x - 44.5 + aside)) < 9
        quality = loops(legs).report["quality"]
        assert (quality["components"], quality["genus"]) == (1, 0)
        assert quality["volume_mm3"] == pytest.approx(4 * legs.sum(), rel=0.02)

    @pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, 0.75])
    def test_the_ends_of_a_ball_are_neither_cut_nor_swollen(self, shift: float) -> None:
        k, y, x = np.indices((16, 60, 60))
        away = np.sqrt((4 * (k - 7 - shift)) ** 2 + (y - 29.4) ** 2 + (x - 29.7) ** 2)
        found = loops(away < 22)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 * (away < 22).sum(), rel=0.02)
        off = np.sqrt(((found.mesh.vertices - [29.7, 29.4, 4 * (7 + shift)]) ** 2).sum(axis=1)) - 22
        assert np.abs(off).mean() < 0.45

    def test_a_plate_one_slice_thick_is_as_thick_as_a_slice(self) -> None:
        mask = np.zeros((5, 50, 50), bool)
        mask[2, 10:40, 10:40] = True
        mask[4, 20:30, 20:30] = True
        quality = loops(mask).report["quality"]
        assert quality["components"] == 2
        assert quality["volume_mm3"] == pytest.approx(4 * mask.sum(), rel=0.06)

    @pytest.mark.parametrize("share", [0.6, 0.75, 1.0])
    def test_the_gray_level_of_a_step_tells_how_high_it_is(self, share: float) -> None:
        away = np.hypot(*(np.indices((60, 60)) - 29.3))
        wide, narrow = (np.clip(radius - away, 0, 1) for radius in (22.5, 7.5))
        gray = np.stack([wide, wide, np.maximum(share * wide, narrow), narrow, narrow]).astype(np.float32)
        found = reconstruct(Volume.from_stored(gray, np.diag([1.0, 1.0, 4.0, 1.0])), lower=0.5, contours="loops")
        far = np.hypot(*(found.mesh.vertices[:, :2] - 29.3).T)
        step = found.mesh.vertices[(far > 13) & (far < 17) & (found.mesh.vertices[:, 2] > 4), 2]
        # linear between the levels of the two slices
        assert step.mean() == pytest.approx(4 * (2 + (share - 0.5) / share), abs=0.3)

    def test_a_prism_encloses_its_areas_times_the_slices(self) -> None:
        away = np.hypot(*(np.indices((60, 60)) - 29.3))
        found = loops(np.stack([away < 20] * 6))
        rings = found.report["quality"]["rings_volume_mm3"]
        assert rings == pytest.approx(6 * 4 * np.pi * 400, rel=0.01)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(rings, rel=0.02)
