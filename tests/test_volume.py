"""Volumes: every stored order of axes becomes the same canonical one, and finds its way back."""

from __future__ import annotations

from contextlib import nullcontext
from itertools import permutations, product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.errors import GeometryError
from tomomesh.io.volumes.affine import check_affine, check_spacing
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

ORDERS = [(order, signs) for order in permutations(range(3)) for signs in product((1, -1), repeat=3)]
SPACING = np.array([0.5, 0.7, 2.0])


def affine_of(order: tuple[int, ...], signs: tuple[int, ...], tilt: float = 0.0) -> NDArray[np.float64]:
    """Map index n (fastest first) to patient axis ``order[n]``; tilt turns all of it about (1, 1, 1)."""
    directions = np.zeros((3, 3))
    directions[list(order), range(3)] = signs
    affine = np.eye(4)
    affine[:3, :3] = turn(tilt) @ directions * SPACING
    affine[:3, 3] = [-3.0, 11.0, 40.0]
    return affine


def turn(angle: float) -> NDArray[np.float64]:
    """Rotate about (1, 1, 1) (Rodrigues)."""
    cross = np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]]) / np.sqrt(3)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def numbered(shape: tuple[int, ...] = (4, 5, 6)) -> NDArray[np.int64]:
    return np.arange(np.prod(shape)).reshape(shape)


def places(voxels: NDArray[np.int64], affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the millimeters of voxel number n in row n."""
    index = np.argwhere(np.ones(voxels.shape[:3], bool))
    found = np.empty((len(index), 3))
    found[voxels.ravel()] = index[:, ::-1] @ affine[:3, :3].T + affine[:3, 3]
    return found


@pytest.mark.parametrize(("order", "signs"), ORDERS)
@pytest.mark.parametrize("tilt", [0.0, 0.3])
class TestEveryOrderOfAxes:
    def test_runs_to_left_posterior_superior(self, order: tuple[int, ...], signs: tuple[int, ...], tilt: float) -> None:
        volume = Volume.from_stored(numbered(), affine_of(order, signs, tilt))
        assert (np.diag(volume.affine)[:3] > 0).all()
        assert (np.abs(volume.affine[:3, :3]).argmax(axis=0) == range(3)).all()

    def test_leaves_every_voxel_where_it_was(self, order: tuple[int, ...], signs: tuple[int, ...], tilt: float) -> None:
        stored, affine = numbered(), affine_of(order, signs, tilt)
        volume = Volume.from_stored(stored, affine)
        np.testing.assert_allclose(places(volume.voxels, volume.affine), places(stored, affine), rtol=0, atol=1e-12)

    def test_is_restored(self, order: tuple[int, ...], signs: tuple[int, ...], tilt: float) -> None:
        stored = numbered()
        volume = Volume.from_stored(stored, affine_of(order, signs, tilt))
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), stored)

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_is_restored_along_every_axis(
        self, order: tuple[int, ...], signs: tuple[int, ...], tilt: float, axis: int
    ) -> None:
        stored, affine = numbered(), affine_of(order, signs, tilt)
        volume = Volume.from_stored(stored, affine)
        stack = volume.along(axis)
        np.testing.assert_array_equal(stack.grid.restore(stack.voxels), stored)
        np.testing.assert_allclose(places(stack.voxels, stack.affine), places(stored, affine), rtol=0, atol=1e-12)
        assert stack.shape[0] == volume.shape[2 - axis]
        assert np.abs(stack.affine[:3, 2]).argmax() == axis

    def test_knows_its_spacing(self, order: tuple[int, ...], signs: tuple[int, ...], tilt: float) -> None:
        volume = Volume.from_stored(numbered(), affine_of(order, signs, tilt))
        np.testing.assert_allclose(volume.spacing_mm, SPACING[np.argsort(order)], rtol=1e-12)
        assert volume.thickest_axis() == order[2]
        assert volume.stored_axis == order[2]


class TestVolume:
    def test_takes_no_copy(self) -> None:
        stored = numbered()
        assert np.shares_memory(Volume.from_stored(stored, affine_of((2, 0, 1), (1, -1, 1))).voxels, stored)

    def test_keeps_the_layers_of_a_color_last(self) -> None:
        color = np.stack([numbered(), -numbered()], axis=-1)
        volume = Volume.from_stored(color, affine_of((2, 0, 1), (1, -1, 1))).along(0)
        assert volume.layers == 2
        assert Volume.from_stored(numbered(), np.eye(4)).layers == 1
        np.testing.assert_array_equal(volume.voxels[..., 0], -volume.voxels[..., 1])

    def test_is_axial_where_spacings_are_equal(self) -> None:
        assert Volume.from_stored(numbered(), np.diag([1.0, 1.0005, 1.0, 1.0])).thickest_axis() == 2

    @pytest.mark.parametrize("axis", range(3))
    @pytest.mark.parametrize(("rows", "cut_across"), [(16, False), (17, True)])
    def test_is_not_cut_across_the_width_of_a_slab(self, axis: int, rows: int, cut_across: bool) -> None:
        """Of two slices whose rows and columns are more than eight times as many, wherever the wide spacing is."""
        shape = [2 if n == axis else rows + 5 * (n == (axis + 1) % 3) for n in range(3)]
        wide = (axis + 1) % 3
        affine = np.diag([*(3.0 if n == wide else 1.0 for n in range(3)), 1.0])
        assert Volume.from_stored(np.zeros(shape[::-1]), affine).thickest_axis() == (axis if cut_across else wide)

    @law(100)
    @given(seed=seeds, angle=st.floats(-3, 3), shift=st.floats(-1e3, 1e3))
    def test_index_to_mm_to_index_is_the_identity(self, seed: int, angle: float, shift: float) -> None:
        rng = np.random.default_rng(seed)
        affine = np.eye(4)
        affine[:3, :3] = turn(angle) * rng.uniform(0.1, 5, 3)
        affine[:3, 3] = shift
        volume = Volume.from_stored(numbered(), affine)
        indices = rng.uniform(-10, 500, (20, 3))
        positions = volume.to_mm(indices)
        by_hand = [[row[:3] @ index + row[3] for row in volume.affine[:3]] for index in indices]
        np.testing.assert_allclose(positions, by_hand, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(volume.to_indices(positions), indices, rtol=0, atol=1e-9)


class TestFlatFrames:
    """Axes are refused where they are shorter than a millionth, or span less than a thousandth of their box."""

    @pytest.mark.parametrize("axis", range(3))
    @pytest.mark.parametrize(("length", "refused"), [(0.99e-6, True), (1.01e-6, False), (1e-9, True), (0.0, True)])
    def test_by_the_shortest_axis(self, axis: int, length: float, refused: bool) -> None:
        affine = affine_of((2, 0, 1), (1, -1, 1))
        affine[:3, axis] *= length / SPACING[axis]
        spacing, asked = np.where(np.arange(3) == axis, length, SPACING).tolist(), "--spacing x y z"
        with pytest.raises(GeometryError) if refused else nullcontext():
            check_affine(affine, file="a.nii", hint=asked)
        with pytest.raises(GeometryError) if refused else nullcontext():
            check_spacing(spacing, "xyz", file="a.nii", hint=asked)

    @pytest.mark.parametrize(("share", "refused"), [(0.99e-3, True), (1.01e-3, False)])
    def test_by_their_volume(self, share: float, refused: bool) -> None:
        affine = np.eye(4)
        affine[:3, 2] = 5 * np.sqrt(1 - share**2), 0, 5 * share
        with pytest.raises(GeometryError) if refused else nullcontext():
            check_affine(affine, file="a.nii", hint="--spacing x y z")
