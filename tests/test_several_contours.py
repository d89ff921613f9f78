"""Several contours in a slice: their outlines, shares and tracks."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree

from conftest import law, seeds
from tomomesh.errors import EmptyError, UsageError
from tomomesh.isosurface.crossings import Levels
from tomomesh.measure.contour import measure_contour
from tomomesh.model.contours import BIRTH, BRANCH, DEATH, HOLE, MERGE, OUTER, WALL_INNER, WALL_OUTER
from tomomesh.segmentation.contours.curved import finely
from tomomesh.segmentation.contours.inputs import slices_with_several
from tomomesh.segmentation.contours.loops import trace
from tomomesh.segmentation.contours.one import train_slice
from tomomesh.segmentation.contours.shown import Shown
from tomomesh.segmentation.contours.train import train_contours
from tomomesh.segmentation.networks.training import regions
from tomomesh.settings import NetworkSettings, Settings
from tomomesh.som.passes import Look

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tomomesh.model.contours import Contours

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

ROWS, COLUMNS = np.mgrid[:96, :96]


def disk(x: float, y: float, radius: float, inner: float = 0.0) -> Mask:
    """Return the pixels of a disk, or of a ring."""
    away = np.hypot(COLUMNS - x, ROWS - y)
    return np.asarray((away <= radius) & (away >= inner))


def trained(planes: Sequence[Mask], kind: str, *, threads: int = 1, **options: object) -> Contours:
    return train_contours(np.stack(planes), NetworkSettings(contours=kind, **options), threads=threads)  # type: ignore[arg-type]


def blot(seed: int, wide: float, above: float) -> Mask:
    """Return a slice of smooth blots with holes: the width of the smoothing, and the threshold, deviations."""
    smooth = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(40, 44)), wide)
    return np.asarray(smooth > above * smooth.std())


@st.composite
def blots(draw: st.DrawFn) -> Mask:
    """Draw a slice of smooth blots with holes."""
    return blot(draw(seeds), draw(st.floats(1.0, 4.0)), draw(st.floats(-0.5, 1.0)))


class TestTrace:
    """Outlines are exact."""

    @law(40)
    @given(st.integers(0, 2**24 - 1))
    def test_areas_add_up_to_the_pixels(self, bits: int) -> None:
        plane = np.array([bits >> n & 1 for n in range(24)], bool).reshape(4, 6)
        loops = trace(plane)
        assert sum(loop.area for loop in loops) == plane.sum()
        _, touching = ndimage.label(plane, np.ones((3, 3)))
        _, outside = ndimage.label(np.pad(~plane, 1, constant_values=True))
        assert sum(loop.area > 0 for loop in loops) == touching
        assert sum(loop.area < 0 for loop in loops) == outside - 1

    @law(20)
    @given(blots())
    def test_outlines_filled_by_turns_are_the_window(self, plane: Mask) -> None:
        covered = np.zeros(plane.shape, int)
        for loop in trace(plane):
            patch = loop.filled()
            (x, y), (rows, columns) = patch.low, patch.pixels.shape
            covered[y : y + rows, x : x + columns] += np.where(patch.pixels, np.sign(loop.area), 0)
            assert patch.area == abs(loop.area)
        np.testing.assert_array_equal(covered, plane)

    def test_a_middle_lies_between_a_pixel_inside_and_one_outside(self) -> None:
        plane = disk(40, 50, 20, 8)
        for loop in trace(plane):
            ends = np.floor(loop.middles).astype(int), np.ceil(loop.middles).astype(int)
            one, other = (plane[end[:, 1], end[:, 0]] for end in ends)
            assert (one != other).all()

    def test_nothing_has_no_outline(self) -> None:
        assert trace(np.zeros((4, 5), bool)) == []


class TestKinds:
    """Which rings a slice gets."""

    def test_loops_enclose_the_pixels(self) -> None:
        plane = disk(48, 48, 40, 25) | disk(48, 48, 12)
        found = trained([plane], "loops", neurons=240)
        assert [one.side for one in found.contours] == [OUTER, HOLE, OUTER]
        areas = [measure_contour(one.codebook).area for one in found.contours]
        assert areas[0] - areas[1] + areas[2] == pytest.approx(plane.sum(), rel=0.01)
        for one, radius in zip(found.contours, (40, 25, 12), strict=True):
            assert abs(np.hypot(*(one.codebook - 48).T).mean() - radius) < 0.3

    @law(10)
    @given(blots())
    def test_areas_of_loops_are_the_pixels(self, plane: Mask) -> None:
        loops = trace(plane)
        if not loops:
            return
        found = trained([plane], "loops", neurons=400)
        assert len(found) == len(loops)
        sign = [-1 if one.side == HOLE else 1 for one in found.contours]
        area = sum(s * measure_contour(one.codebook).area for s, one in zip(sign, found.contours, strict=True))
        length = sum(map(len, loops))
        assert abs(area - plane.sum()) < 0.12 * length

    def test_components_share_the_neurons_by_length(self) -> None:
        planes = [disk(30, 30, 20) | disk(75, 75, 10) | disk(75, 20, 2)]
        found = trained(planes, "components", neurons=90)
        assert [len(one) for one in found.contours] == [60, 30]
        assert found.dropped == 1
        for one, center, radius in zip(found.contours, (30, 75), (20, 10), strict=True):
            away = np.hypot(*(one.codebook - center).T)
            assert abs(away.mean() - radius) < 0.35
            assert away.std() < 0.4

    def test_a_component_has_twelve_neurons_at_least(self) -> None:
        found = trained([disk(40, 48, 38) | disk(88, 88, 5)], "components", neurons=30)
        assert min(map(len, found.contours)) == 12

    def test_solids_show_their_outline_and_walls_their_pixels(self) -> None:
        planes = [disk(30, 48, 20) | disk(72, 48, 20, 16)] * 3
        solid, wall = trained(planes, "components", neurons=120).on(1)
        assert (solid.outlined, wall.outlined) == (True, False)
        assert np.hypot(*(wall.codebook - [72, 48]).T).mean() == pytest.approx(18, abs=0.15)

    def test_the_sides_of_a_massive_wall_are_its_borders(self) -> None:
        found = trained([disk(48, 48, 40, 32)], "walls", neurons=160)
        assert [one.side for one in found.contours] == [WALL_OUTER, WALL_INNER]
        for one, radius in zip(found.contours, (40, 32), strict=True):
            assert np.abs(np.hypot(*(one.codebook - 48).T) - radius).mean() < 0.3

    def test_the_sides_of_two_tables_are_their_middles(self) -> None:
        found = trained([disk(48, 48, 40, 38) | disk(48, 48, 32, 30)], "walls", neurons=80)
        for one, radius in zip(found.contours, (39, 31), strict=True):
            assert np.abs(np.hypot(*(one.codebook - 48).T) - radius).mean() < 0.13

    def test_a_solid_has_one_side(self) -> None:
        assert [one.side for one in trained([disk(48, 48, 30)], "walls").contours] == [WALL_OUTER]

    def test_two_bones_have_two_sides_each(self) -> None:
        plane = disk(26, 48, 20, 14) | disk(72, 48, 20, 14)
        found = trained([plane], "walls", neurons=160)
        assert [one.side for one in found.contours] == [WALL_OUTER, WALL_INNER] * 2

    def test_specks_alone_are_refused(self) -> None:
        for kind in ("components", "walls"):
            with pytest.raises(EmptyError, match="no contour is long enough"):
                trained([disk(48, 48, 1)], kind)
        assert [len(one) for one in trained([disk(48, 48, 1) | disk(9, 9, 0)], "loops").contours] == [4, 12]
        with pytest.raises(EmptyError, match="no contour"):
            trained([disk(48, 48, -1)], "loops")

    def test_several_contours_are_rings(self) -> None:
        with pytest.raises(UsageError, match="several contours are rings"):
            Settings().replace(contours="loops", network="chain")

    def test_side_by_side_is_told_from_one_in_another(self) -> None:
        beside, within = disk(24, 48, 20) | disk(72, 48, 20), disk(48, 48, 44, 40) | disk(48, 48, 20)
        assert slices_with_several(np.stack([beside, within, beside, disk(48, 48, 30) | disk(90, 90, 2)])) == 2

    def test_regions_name_the_nearest_neuron(self) -> None:
        mask = np.stack([disk(26, 48, 20) | disk(72, 48, 20)] * 2)
        found = trained(list(mask), "components", neurons=60)
        labels = regions(mask, found)
        neurons = np.concatenate([one.codebook for one in found.on(1)])
        places = np.argwhere(mask[1])[:, ::-1]
        np.testing.assert_array_equal(labels[1][mask[1]], cKDTree(neurons).query(places)[1] + 1)
        assert not labels[~mask].any()


class TestLaws:
    """Threads, place and direction change nothing."""

    @pytest.mark.parametrize("kind", ["components", "walls", "loops"])
    def test_threads_change_no_byte(self, kind: str) -> None:
        planes = [disk(30 + k, 40, 20, 12) | disk(75, 75 - k, 12) for k in range(4)]
        one, two = (trained(planes, kind, threads=threads) for threads in (1, 2))
        assert [c.codebook.tobytes() for c in one.contours] == [c.codebook.tobytes() for c in two.contours]
        assert one.events == two.events

    @pytest.mark.parametrize("kind", ["components", "walls", "loops"])
    @pytest.mark.parametrize("turn", ["rot90", "fliplr", "flipud", "T"])
    def test_a_turned_slice_gives_the_turned_rings(self, kind: str, turn: str) -> None:
        plane = disk(40, 44, 34, 26) & ~disk(76, 44, 3)
        plane |= disk(85, 85, 8)
        last = len(plane) - 1
        back: Callable[[Floats], Floats] = {
            "rot90": lambda p: np.column_stack([last - p[:, 1], p[:, 0]]),
            "fliplr": lambda p: np.column_stack([last - p[:, 0], p[:, 1]]),
            "flipud": lambda p: np.column_stack([p[:, 0], last - p[:, 1]]),
            "T": lambda p: p[:, ::-1],
        }[turn]
        turned = plane.T if turn == "T" else getattr(np, turn)(plane)
        straight = trained([plane], kind, neurons=200)
        found = trained([np.ascontiguousarray(turned)], kind, neurons=200)
        assert sorted(map(len, found.contours)) == sorted(map(len, straight.contours))
        curve = np.concatenate([finely(one.codebook).reshape(-1, 2) for one in straight.contours])
        again = back(np.concatenate([one.codebook for one in found.contours]))
        apart = cKDTree(curve).query(again)[0]
        assert np.max(apart) < 0.6
        assert np.mean(apart) < 0.1

    @pytest.mark.parametrize("kind", ["components", "loops"])
    def test_pixels_twice_as_wide_change_nothing_but_the_unit(self, kind: str) -> None:
        mask = np.stack([disk(30, 40, 20, 12) | disk(75, 75, 12)])
        settings = NetworkSettings(contours=kind)
        one, two = (train_contours(mask, settings, pixel_mm=(s, s)) for s in (1.0, 2.0))
        for a, b in zip(one.contours, two.contours, strict=True):
            np.testing.assert_allclose(a.codebook, b.codebook, atol=1e-6)


class TestTracks:
    """Births, deaths, branches and merges."""

    def test_legs_merge(self) -> None:
        planes = [disk(48 - d, 48, 14) | disk(48 + d, 48, 14) for d in (30, 26, 22, 18)] + [
            disk(40, 48, 14) | disk(56, 48, 14),
            disk(48, 48, 20),
        ]
        found = trained(planes, "components")
        assert [len(found.on(k)) for k in range(6)] == [2, 2, 2, 2, 1, 1]
        assert found.tracks == 2
        kinds = [(event.kind, event.slice) for event in found.events]
        assert kinds == [(BIRTH, 0), (BIRTH, 0), (MERGE, 3), (DEATH, 5)]
        merged = next(event for event in found.events if event.kind == MERGE)
        assert merged.other == found.on(5)[0].track != merged.track

    def test_a_trunk_branches(self) -> None:
        planes = [disk(48, 48, 20), disk(40, 48, 14) | disk(56, 48, 14), disk(28, 48, 14) | disk(68, 48, 14)]
        found = trained(planes, "components")
        assert [event.kind for event in found.events] == [BIRTH, BRANCH, DEATH, DEATH]
        assert found.count(BRANCH) == 1

    def test_what_appears_and_ends_is_born_and_dies(self) -> None:
        planes = [disk(24, 24, 15), disk(24, 24, 15) | disk(70, 70, 15), disk(70, 70, 15)]
        found = trained(planes, "loops")
        assert [(e.kind, e.slice, e.track) for e in found.events] == [
            (BIRTH, 0, 0), (BIRTH, 1, 1), (DEATH, 1, 0), (DEATH, 2, 1),
        ]  # fmt: skip

    def test_a_hole_does_not_go_on_as_a_solid(self) -> None:
        found = trained([disk(48, 48, 40, 15), disk(48, 48, 14)], "loops")
        assert found.tracks == 3

    @pytest.mark.parametrize("kind", ["components", "walls", "loops"])
    def test_neurons_stay_on_their_meridian(self, kind: str) -> None:
        planes = [disk(48 + 2 * k, 48 - k, 30 - k, 20 - k) for k in range(5)]
        found = trained(planes, kind, neurons=80)
        for track in range(found.tracks):
            row = [one for one in found.contours if one.track == track]
            for one, other in pairwise(row):
                turn = [np.angle(complex(*(c.codebook[0] - c.codebook.mean(axis=0)))) for c in (one, other)]
                assert abs(np.angle(np.exp(1j * (turn[1] - turn[0])))) < 0.25


@law(12)
@given(
    st.lists(blots(), min_size=2, max_size=3), st.sampled_from(["components", "walls", "loops"]),
    st.sampled_from([{}, {"training": "online", "iterations": 400}, {"neurons": 60}, {"way": "paper"}]), seeds,
)  # fmt: skip
def test_a_slice_is_trained_again_to_the_last_bit(
    planes: list[Mask], kind: str, options: dict[str, Any], seed: int
) -> None:
    mask, settings = np.stack(planes), NetworkSettings(contours=kind, **options)
    levels = Levels(mask.astype(np.float64) + 0.1 * (ROWS[: mask.shape[1], : mask.shape[2]] % 4), 0.5, np.inf)
    try:
        study = train_contours(mask, settings, levels=levels, pixel_mm=(0.7, 1.3), seed=seed, threads=2)
    except EmptyError:
        return
    shown = Shown.of(mask, levels, settings, (0.7, 1.3), seed, 1)
    for k in study.slices.tolist():
        seen: list[list[Floats]] = [[] for _ in study.on(k)]
        looks = [Look(lambda codebook, *_, kept=one: kept.append(codebook), 3) for one in seen]
        for again, one, course in zip(train_slice(study, shown, k, looks), study.on(k), seen, strict=True):
            assert repr(again) == repr(one)
            assert again.codebook.tobytes() == one.codebook.tobytes()
            assert {len(step) for step in course} == {len(one)}
