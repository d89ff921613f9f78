"""The shell of cubes: closed by the fewest cubes that keep the outside out, and never two-walled unnoticed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import cubes_of, keys_in, law, seeds, size, solids
from tomomesh.measure.topology import topology
from tomomesh.model.cubes import cells_of, keys_of
from tomomesh.surface.closing import NEAR, SOLID, WIDEST, Shell, close_shell
from tomomesh.surface.composition import well_composed
from tomomesh.surface.cuberille import track

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS = size(14, 9)
EVERYWHERE = np.ones((3, 3, 3), bool)


def sphere_with_hole(width: float, radius: int = RADIUS) -> NDArray[np.int64]:
    """Return the keys of a shell of cubes, one or two thick, with a round hole in its top `width` cubes wide."""
    cells = np.argwhere(np.ones([2 * radius + 5] * 3, bool)) - radius - 2
    shell = np.abs(np.linalg.norm(cells, axis=1) - radius) <= 0.9
    hole = (np.hypot(cells[:, 0], cells[:, 1]) < width / 2) & (cells[:, 2] > 0)
    return np.sort(keys_of(cells[shell & ~hole] + 60))


def enclosed(shell: Shell) -> int:
    """Return the largest volume of the tracked surfaces, cubes."""
    return int(track(cubes_of(well_composed(shell.keys))).volumes.max())


class TestHole:
    @pytest.mark.parametrize("width", [4, 6])
    def test_leaks_where_the_closing_is_too_small(self, width: int) -> None:
        keys = sphere_with_hole(width)
        shell = close_shell(keys, width // 2 - 1)
        assert not shell.holds
        assert shell.two_sided < 0.2
        assert enclosed(shell) < 0.5 * enclosed(close_shell(sphere_with_hole(0), 0))

    @pytest.mark.parametrize("width", [4, 6])
    def test_is_closed_where_the_closing_is_large_enough(self, width: int) -> None:
        shell = close_shell(sphere_with_hole(width), width // 2)
        assert shell.holds
        assert shell.two_sided > 0.9
        assert enclosed(shell) == pytest.approx(enclosed(close_shell(sphere_with_hole(0), 0)), rel=0.03)

    @pytest.mark.parametrize("width", [0, 2, 4, 6])
    def test_is_closed_by_the_fewest_cubes_that_do(self, width: int) -> None:
        found = close_shell(sphere_with_hole(width))
        assert found.holds
        assert found.closing == next(n for n in range(WIDEST) if close_shell(sphere_with_hole(width), n).holds)
        assert abs(found.closing - width / 2) <= 1
        mesh = track(cubes_of(well_composed(found.keys))).mesh.triangulated()
        assert topology(mesh).sound
        assert (topology(mesh).components, topology(mesh).genus) == (1, 0)

    def test_of_a_closed_shell_changes_nothing(self) -> None:
        keys = sphere_with_hole(0)
        shell = close_shell(keys)
        assert shell.closing == 0
        assert shell.keys.tobytes() == keys.tobytes()

    @pytest.mark.parametrize("steps", [1, 3])
    def test_adds_nothing_outside_but_at_the_hole(self, steps: int) -> None:
        keys = sphere_with_hole(2 * steps)
        added = cells_of(np.setdiff1d(close_shell(keys, steps).keys, keys)) - 60
        near = np.hypot(added[:, 0], added[:, 1]) < steps + 2
        outer = np.linalg.norm(added, axis=1) > RADIUS + 0.9
        assert (near & (added[:, 2] > 0))[outer].all()


class TestTwoWalls:
    @pytest.mark.parametrize("thick", [1, 2])
    def test_a_sheet_never_holds(self, thick: int) -> None:
        keys = np.sort(keys_of(np.argwhere(np.ones((25, 25, thick), bool)) + 50))
        shell = close_shell(keys)
        assert not shell.holds
        assert shell.two_sided == 0.0
        assert shell.keys.tobytes() == keys.tobytes()
        assert not any(close_shell(keys, steps).holds for steps in range(WIDEST + 1))

    def test_a_tube_without_ends_never_holds_while_its_ends_are_open(self) -> None:
        cells = np.argwhere(np.ones((31, 31, 31), bool)) - 15
        tube = cells[np.abs(np.hypot(cells[:, 0], cells[:, 1]) - 12) < 0.8]
        assert not close_shell(np.sort(keys_of(tube + 60)), 5).holds

    def test_a_solid_holds(self) -> None:
        block = np.sort(keys_of(np.argwhere(np.ones((9, 9, 9), bool)) + 60))
        shell = close_shell(block)
        assert (shell.holds, shell.closing) == (True, 0)

    def test_the_worst_of_two_components_counts_and_debris_does_not(self) -> None:
        whole, apart = sphere_with_hole(0), 10 * RADIUS
        sheet = keys_of(np.argwhere(np.ones((15, 15, 1), bool)) + 60 + apart)
        crumb = keys_of(np.array([[60, 60, 60 + apart]]))
        assert not close_shell(np.union1d(whole, sheet)).holds
        assert close_shell(np.union1d(whole, crumb)).holds


class TestAnySet:
    @law(60)
    @given(seed=seeds, missing=st.floats(0.1, 0.6), steps=st.integers(1, 3))
    def test_what_its_dilation_encloses_stays_enclosed(self, seed: int, missing: float, steps: int) -> None:
        """Taking back the dilation from outside must not open what it has closed, or the surface has two walls."""
        keys = sphere_with_hole(0)
        keys = keys[np.random.default_rng(seed).random(len(keys)) > missing]
        cells = cells_of(keys) - cells_of(keys).min(axis=0) + steps + 1
        occupied = np.zeros(cells.max(axis=0) + steps + 2, bool)
        occupied[tuple(cells.T)] = True
        dilated = ndimage.binary_dilation(occupied, EVERYWHERE, iterations=steps)
        enclosed_space = ~dilated & (ndimage.label(~dilated)[0] != 1)
        closed = np.zeros_like(occupied)
        closed[tuple((cells_of(close_shell(keys, steps).keys) - cells_of(keys).min(axis=0) + steps + 1).T)] = True
        assert not (enclosed_space & (ndimage.label(~closed)[0] == 1)).any()

    @law(60)
    @given(solid=solids(), steps=st.integers(0, 3))
    def test_keeps_its_cubes_and_stays_in_its_dilation(self, solid: NDArray[np.bool_], steps: int) -> None:
        keys = keys_in(solid)
        shell = close_shell(keys, steps)
        assert np.isin(keys, shell.keys).all()
        assert (np.diff(shell.keys) > 0).all()
        low, high = cells_of(keys).min(axis=0), cells_of(keys).max(axis=0)
        added = cells_of(shell.keys)
        assert (added >= low - steps).all()
        assert (added <= high + steps).all()
        assert 0 <= shell.two_sided <= 1

    @law(60)
    @given(solid=solids(8))
    def test_counts_cubes_near_enclosed_space_and_takes_solids_in_full(self, solid: NDArray[np.bool_]) -> None:
        """Tell the share of two-sided cubes of each piece by a whole-grid flood, without closing."""
        padded = np.pad(solid, 2)
        enclosed_space = ~padded & (ndimage.label(~padded)[0] != 1)
        deep = ndimage.binary_erosion(padded, EVERYWHERE)
        mask = padded | enclosed_space
        near = ndimage.binary_dilation(enclosed_space, EVERYWHERE, iterations=NEAR, mask=mask) & padded
        pieces, count = ndimage.label(padded, EVERYWHERE)
        shares = [max(near[pieces == n].mean(), deep[pieces == n].mean() >= SOLID) for n in range(1, count + 1)]
        sizes = np.bincount(pieces.ravel())[1:]
        least = min(0.01 * sizes.sum(), sizes.max())
        heard = [share for share, cubes in zip(shares, sizes, strict=True) if cubes >= least]
        assert close_shell(keys_in(solid), 0).two_sided == pytest.approx(min(heard))

    @law(40)
    @given(solid=solids(), flips=st.tuples(*[st.booleans()] * 3), steps=st.integers(0, 2))
    def test_mirrored_cubes_give_a_mirrored_shell(
        self, solid: NDArray[np.bool_], flips: tuple[bool, bool, bool], steps: int
    ) -> None:
        mirror = tuple(slice(None, None, -1 if flip else 1) for flip in flips)
        one, other = close_shell(keys_in(solid), steps), close_shell(keys_in(solid[mirror]), steps)
        last = np.array(solid.shape) - 1
        turned = np.where(flips, last - cells_of(one.keys), cells_of(one.keys))
        assert one.two_sided == other.two_sided
        np.testing.assert_array_equal(np.sort(keys_of(turned)), other.keys)
