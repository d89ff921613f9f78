"""Thick slices: what is in their voxels moves to where the neighbors have theirs, and none of it is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from tomomesh.isosurface import averages
from tomomesh.isosurface.crossings import Levels
from tomomesh.isosurface.thick_slices import Columns, Thinned, parts_of, thinned
from tomomesh.isosurface.voxels import boundary, voxel_surface
from tomomesh.kernels.isosurface.columns import ALONG, BESIDE, distances_in_slices, move_within_columns
from tomomesh.measure.topology import check_promise
from tomomesh.model.volume import Volume
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh

    Floats = NDArray[np.float64]

AROUND = np.ones((3, 3, 3), bool)
THICKEST = {axis: np.diag([*(4.0 if n == axis else 1.0 for n in range(3)), 1.0]) for axis in range(3)}


def dense(found: Thinned) -> NDArray[np.float32]:
    """Return all thin voxels."""
    assert isinstance(found.levels.voxels, Columns)
    return found.levels.voxels[tuple(np.indices(found.levels.voxels.shape, np.int32))]


def thin(levels: NDArray[Any], lower: float = 0.5, axis: int = 2, threads: int = 0) -> Thinned:
    found = thinned(Levels(levels, lower, np.inf), levels > lower, THICKEST[axis], threads)
    assert found is not None
    return found


@st.composite
def studies(draw: st.DrawFn) -> NDArray[np.float64]:
    """Draw smooth levels in 0 to 1, some over a half."""
    shape = draw(st.tuples(st.integers(1, 5), st.integers(2, 9), st.integers(2, 9)))
    noise = np.random.default_rng(draw(seeds)).normal(size=shape)
    smooth = ndimage.gaussian_filter(noise, draw(st.sampled_from([0.6, 1.0, 2.0])))
    found = (smooth - smooth.min()) / max(float(np.ptp(smooth)), 1e-9)
    return np.asarray(np.round(found, 2), np.float64)


def slabs(inside: NDArray[np.bool_], thick: int) -> NDArray[np.float64]:
    """Average every so many slices of a thin mask."""
    return np.asarray(inside[: len(inside) // thick * thick].reshape(-1, thick, *inside.shape[1:]).mean(axis=1))


def surface(levels: NDArray[Any], *, divide: bool, thick: int = 4) -> TriMesh:
    affine = np.diag([1.0, 1.0, thick, 1.0])
    volume = Volume.from_stored(levels, affine)
    found = boundary(volume, volume.voxels > 0.5, lower=0.5, divide=divide)
    mesh = voxel_surface(found, FitSettings()).mesh
    check_promise(mesh, cavities=found.cavities)
    return mesh


def ball(radius: float, thick: int, size: int = 60) -> tuple[NDArray[np.bool_], Floats]:
    """Return a ball on thin voxels, and its middle (x, y, z) where the middle of the first slab is at 0."""
    z, y, x = np.indices((size, size, size)) - 0.5 * (size - 1) + np.array([0.3, -0.2, 0.1])[:, None, None, None]
    middle = 0.5 * (size - 1) - np.array([0.1, -0.2, 0.3 + 0.5 * (thick - 1)])
    return x**2 + y**2 + z**2 < radius**2, middle


class TestLaws:
    @law(40)
    @given(levels=studies())
    def test_every_voxel_keeps_its_average_and_its_range(self, levels: Floats) -> None:
        found = thin(levels)
        if found.of_mask:
            return
        parts = dense(found).reshape(len(levels), 4, *levels.shape[1:])
        assert np.allclose(parts.mean(axis=1), levels, atol=1e-5)
        low, high = (f(levels, 3, mode="nearest") for f in (ndimage.minimum_filter, ndimage.maximum_filter))
        assert (parts >= low[:, None] - 1e-6).all()
        assert (parts <= high[:, None] + 1e-6).all()

    @law(40)
    @given(levels=studies())
    def test_a_voxel_that_is_kept_keeps_a_part_and_one_far_from_the_border_all(self, levels: Floats) -> None:
        mask = levels > 0.5
        for given_ in (levels, mask.astype(np.float64)):
            kept = thin(given_).mask.reshape(len(mask), 4, *mask.shape[1:])
            assert (kept.any(axis=1) | ~mask).all()
            assert np.asarray(kept.all(axis=1))[np.asarray(ndimage.binary_erosion(mask, AROUND, border_value=1))].all()
            assert not np.asarray(kept.any(axis=1))[~np.asarray(ndimage.binary_dilation(mask, AROUND))].any()

    @law(40)
    @given(levels=studies(), axis=st.sampled_from([0, 1]))
    def test_the_axis_and_the_threads_change_nothing(self, levels: Floats, axis: int) -> None:
        found = thin(levels, threads=1)
        turned = thin(np.moveaxis(levels, 0, 2 - axis).copy(), axis=axis, threads=3)
        assert (np.moveaxis(dense(turned), 2 - axis, 0) == dense(found)).all()
        assert (np.moveaxis(turned.mask, 2 - axis, 0) == found.mask).all()

    @law(40)
    @given(levels=studies())
    def test_a_mirrored_study_gives_a_mirrored_result(self, levels: Floats) -> None:
        found, mirrored = (dense(thin(given_)) for given_ in (levels, levels[::-1].copy()))
        assert np.allclose(mirrored[::-1], found, atol=1e-4)

    @law(30)
    @given(levels=studies())
    def test_what_was_left_out_stays_out(self, levels: Floats) -> None:
        window = levels > 0.5
        kept = window & (np.arange(levels.shape[2]) < levels.shape[2] // 2)
        if not kept.any():
            return
        found = thinned(Levels(levels, 0.5, np.inf), kept, THICKEST[2])
        assert found is not None
        left = found.mask.reshape(len(kept), 4, *kept.shape[1:]).any(axis=1)
        assert not (left & window & ~kept).any() or found.of_mask

    @pytest.mark.parametrize("widths", [(1, 1, 1), (1, 1, 1.4), (1.4, 1, 1)])
    def test_slices_that_are_not_thick_are_not_divided(self, widths: tuple[float, float, float]) -> None:
        levels = np.zeros((3, 3, 3))
        levels[1, 1, 1] = 1
        assert thinned(Levels(levels, 0.5, np.inf), levels > 0.5, np.diag([*widths, 1.0])) is None

    @pytest.mark.parametrize(
        ("widths", "found"), [((1, 1, 1.5), (2, 2)), ((1, 4, 1), (1, 4)), ((0.5, 0.5, 9), (2, 16))]
    )
    def test_parts_are_nearly_cubes(self, widths: tuple[float, float, float], found: tuple[int, int]) -> None:
        assert parts_of(np.diag([*widths, 1.0])) == found

    def test_levels_that_are_not_known_are_not_divided(self) -> None:
        levels = np.zeros((4, 6, 6))
        levels[1:3, 2:4, 2:4], levels[0, 0, 0] = 1.0, np.nan
        found = thinned(Levels(levels, 0.5, np.inf), levels > 0.5, THICKEST[2])
        assert found is not None
        assert found.mask.any()


class TestTwins:
    @law(30)
    @given(levels=studies(), sharpness=st.sampled_from([0.0, 1.0, 3.0]))
    def test_a_round_is_what_it_says(self, levels: Floats, sharpness: float) -> None:
        whole = levels.astype(np.float32)
        columns = np.ascontiguousarray(np.argwhere(whole >= 0), np.int32)
        index = np.arange(len(columns), dtype=np.int32).reshape(whole.shape)
        rng = np.random.default_rng(len(columns))
        parts = rng.random((len(columns), 3), np.float32)
        low, high = np.zeros(len(columns), np.float32), np.ones(len(columns), np.float32)
        moved = np.empty_like(parts)
        move_within_columns(whole, index, columns, low, high, parts, sharpness, moved, 0, len(columns))
        around = parts.reshape(*whole.shape, 3).transpose(0, 3, 1, 2)
        ends = [np.repeat(around[s].mean(axis=0)[None], 3, axis=0) * 0 + around[s] for s in (0, -1)]
        fine = np.concatenate([ends[0], *around, ends[1]])
        for axis, weights in ((1, BESIDE), (2, BESIDE), (0, ALONG)):
            fine = ndimage.correlate1d(fine.astype(np.float64), np.array(weights), axis=axis, mode="nearest")
        goal = fine[3:-3].reshape(len(whole), 3, *whole.shape[1:]).transpose(0, 2, 3, 1).reshape(-1, 3)
        goal = whole.reshape(-1, 1) + sharpness * (goal - goal.mean(axis=1, keepdims=True))
        shift = np.median(moved - goal, axis=1)  # of three parts, the middle one is cut off least
        free = (moved > 1e-6) & (moved < 1 - 1e-6)
        shift = np.where(
            free.any(axis=1), np.where(free, moved - goal, 0).sum(axis=1) / np.maximum(free.sum(axis=1), 1), shift
        )
        held = free.any(axis=1)
        assert np.allclose(moved[held], np.clip(goal + shift[:, None], 0, 1)[held], atol=1e-4)
        assert np.allclose(moved.mean(axis=1), whole.ravel(), atol=1e-5)

    @law(30)
    @given(levels=studies(), reach=st.integers(1, 6))
    def test_distances_in_slices_are_those_of_pixels_less_a_half(self, levels: Floats, reach: int) -> None:
        mask = levels > 0.5
        found = np.empty(mask.shape, np.float32)
        distances_in_slices(mask, reach, found, 0, len(mask))
        for one, slice_ in zip(found, mask, strict=True):
            for side, sign in ((slice_, 1), (~slice_, -1)):
                away = ndimage.distance_transform_edt(side) if not side.all() else np.full(side.shape, 99.0)
                expected = np.minimum(away, reach) - 0.5
                assert np.allclose((sign * one)[side], expected[side], atol=1e-5)

    @law(30)
    @given(levels=studies(), around=st.integers(0, 5))
    def test_averages_of_a_mask_are_found_in_its_box_alone(self, levels: Floats, around: int) -> None:
        mask = np.pad(levels > 0.5, around)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(averages, "MARGIN", max(mask.shape))
            everywhere = averages.averages_of(mask, 1)
        assert (averages.averages_of(mask, 2) == everywhere).all()


class TestNearer:
    @pytest.mark.parametrize("radius", [11.0, 17.3])
    @pytest.mark.parametrize(("kind", "thick"), [("levels", 4), ("mask", 3), ("mask", 5)])
    def test_a_ball_of_slabs_is_nearer_than_without(self, radius: float, kind: str, thick: int) -> None:
        inside, middle = ball(radius, thick)
        levels = slabs(inside, thick)
        levels = levels if kind == "levels" else (levels > 0.5).astype(np.uint8)
        off, volumes = [], []
        for divide in (False, True):
            mesh = surface(levels, divide=divide, thick=thick)
            off.append(np.abs(np.linalg.norm(mesh.corners.mean(axis=1) - middle, axis=1) - radius).mean())
            volumes.append(float(mesh.face_volumes.sum()) / (4 / 3 * np.pi * radius**3))
        assert off[1] < {"levels": 0.7, "mask": 1.05 if thick == 3 else 0.75}[kind] * off[0]
        assert volumes[1] == pytest.approx(1, abs=0.02 if kind == "levels" else 0.04)

    @pytest.mark.parametrize("slope", [0.3, 1.0, 3.0])
    def test_a_slanted_plane_lies_where_it_was(self, slope: float) -> None:
        z, _, x = np.indices((48, 8, 40))
        inside = (z - 23.7 < slope * (x - 20.2)) if slope < 3 else (x - 20.2 > (z - 23.7) / slope)
        mesh = surface(slabs(inside, 4), divide=True)
        place = mesh.corners.mean(axis=1)
        middle = (np.abs(place[:, 0] - 20) < 8) & (np.abs(place[:, 2] - 22) < 8) & (np.abs(place[:, 1] - 3.5) < 2)
        off = np.abs(place[:, 2] + 1.5 - 23.7 - slope * (place[:, 0] - 20.2)) / np.hypot(1, slope)
        assert middle.sum() > 20
        assert off[middle].mean() < 0.25

    def test_a_sheet_that_moves_by_more_than_its_width_stays_one(self) -> None:
        k, _, x = np.indices((11, 24, 70))
        sheet = (np.abs(x - 6 * k) < 2.1) & (k > 0) & (k < 10)
        torn, whole = (surface(sheet.astype(np.uint8), divide=divide) for divide in (False, True))
        assert ndimage.label(sheet)[1] == 9
        assert [len(np.unique(_pieces(mesh))) for mesh in (torn, whole)] == [9, 1]


def _pieces(mesh: TriMesh) -> NDArray[np.int32]:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = mesh.half_edges
    count = len(mesh.vertices)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
