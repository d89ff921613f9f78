"""The shell of cubes: that of a whole grid, filled, without bare contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import composed, contacts, law, seeds, size, solids
from shells import RADIUS, Twin, mesh_of, sphere_with_hole
from tomomesh.cuberille import bitmasks as module
from tomomesh.cuberille.closing import Shell, close_shell
from tomomesh.cuberille.faces import exposed_faces
from tomomesh.measure.topology import topology

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.bitmasks import Bitmask

    Cells = NDArray[np.int64]
    Solid = NDArray[np.bool_]

steps_of = st.integers(0, size(3, 1))


def grid_of(shell: Shell, bitmask: Bitmask, low: NDArray[np.int64], shape: tuple[int, ...]) -> Solid:
    """Return a set of cubes as a grid (x, y, z) that begins at a lowest cell, whatever it holds elsewhere."""
    cells = shell.blocks.cells(bitmask) - low
    cells = cells[((cells >= 0) & (cells < shape)).all(axis=1)]
    grid = np.zeros(shape, bool)
    grid[tuple(cells.T)] = True
    return grid


def dense(shell: Shell, bitmask: Bitmask, solid: Solid, pad: int) -> Solid:
    """Return a set of cubes as a grid over a padded solid."""
    return grid_of(shell, bitmask, np.full(3, -pad), tuple(n + 2 * pad for n in solid.shape))


class TestShell:
    @law(80)
    @given(solid=solids(9), steps=steps_of)
    def test_is_that_of_a_whole_grid(self, solid: Solid, steps: int) -> None:
        shell, twin = close_shell(np.argwhere(solid), steps), Twin(solid, steps)
        for name in ("occupied", "solid", "witnesses"):
            found = dense(shell, getattr(shell, name), solid, twin.pad)
            np.testing.assert_array_equal(found, getattr(twin, name), name)
        within = np.argwhere(twin.within) - twin.pad
        assert sorted(map(tuple, shell.within.tolist())) == sorted(map(tuple, within.tolist()))

    @pytest.mark.parametrize("missing", [0.0, 0.4, 0.7])
    def test_of_a_riddled_hollow_ball_in_another_is_that_of_a_whole_grid(self, missing: float) -> None:
        cells = np.concatenate([sphere_with_hole(0), sphere_with_hole(0, RADIUS // 2)])
        cells = cells[np.random.default_rng(1).random(len(cells)) >= missing] + RADIUS + 2
        solid = np.zeros(cells.max(axis=0) + 1, bool)
        solid[tuple(cells.T)] = True
        for steps in range(size(4, 2)):
            shell, twin = close_shell(cells, steps), Twin(solid, steps)
            for name in ("solid", "witnesses"):
                found = dense(shell, getattr(shell, name), solid, twin.pad)
                np.testing.assert_array_equal(found, getattr(twin, name), f"{name}, closed by {steps}")

    @law(60)
    @given(solid=solids(), steps=steps_of)
    def test_keeps_its_cubes_and_stays_in_its_dilation(self, solid: Solid, steps: int) -> None:
        shell = close_shell(np.argwhere(solid), steps)
        cells = shell.blocks.cells(shell.solid)
        assert not (shell.occupied & ~shell.solid).any()
        assert (cells >= np.argwhere(solid).min(axis=0) - steps).all()
        assert (cells <= np.argwhere(solid).max(axis=0) + steps).all()

    @law(30)
    @given(seed=seeds, missing=st.floats(0.1, 0.6), steps=st.integers(1, size(3, 1)))
    def test_keeps_what_its_dilation_encloses(self, seed: int, missing: float, steps: int) -> None:
        """Taking back the dilation from outside must not open what it has closed, or the surface has two sides."""
        cells = sphere_with_hole(0, min(RADIUS, 10))
        cells = cells[np.random.default_rng(seed).random(len(cells)) > missing]
        cells = cells - cells.min(axis=0)
        solid = np.zeros(cells.max(axis=0) + 1, bool)
        solid[tuple(cells.T)] = True
        shell, twin = close_shell(cells, steps), Twin(solid, steps)
        assert not (twin.enclosed & ~dense(shell, shell.solid, solid, twin.pad)).any()

    @law(40)
    @given(
        solid=solids(), axes=st.permutations(range(3)), flips=st.tuples(*[st.booleans()] * 3), steps=st.integers(0, 2)
    )
    def test_of_a_mirrored_or_turned_set_is_mirrored_or_turned(
        self, solid: Solid, axes: list[int], flips: tuple[bool, bool, bool], steps: int
    ) -> None:
        def turned(grid: Solid) -> Solid:
            return np.transpose(grid[tuple(slice(None, None, -1 if flip else 1) for flip in flips)], axes)

        one, other = close_shell(np.argwhere(solid), steps), close_shell(np.argwhere(turned(solid)), steps)
        for name in ("solid", "witnesses"):
            here = dense(one, getattr(one, name), solid, steps)
            there = dense(other, getattr(other, name), turned(solid), steps)
            np.testing.assert_array_equal(turned(here), there)

    @law(40)
    @given(solid=solids(), place=st.tuples(*[st.integers(-60, 60)] * 3), steps=st.integers(0, 2))
    def test_is_the_same_wherever_the_blocks_end(self, solid: Solid, place: tuple[int, int, int], steps: int) -> None:
        one, other = (close_shell(np.argwhere(solid) + low, steps) for low in ((0, 0, 0), place))
        shape = tuple(n + 2 * steps for n in solid.shape)
        here = grid_of(one, one.solid, np.zeros(3, int) - steps, shape)
        np.testing.assert_array_equal(here, grid_of(other, other.solid, np.array(place) - steps, shape))

    @law(20)
    @given(seed=seeds)
    def test_knows_no_order_and_no_threads(self, seed: int) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, "SHARE", 5)
            cells = sphere_with_hole(2, min(RADIUS, 9))
            one = close_shell(cells, 1, threads=1)
            two = close_shell(np.random.default_rng(seed).permutation(cells), 1, threads=2)
        assert one.solid.tobytes() == two.solid.tobytes()
        assert one.witnesses.tobytes() == two.witnesses.tobytes()
        assert exposed_faces(one).quads.tobytes() == exposed_faces(two).quads.tobytes()


class TestComposition:
    @law(100)
    @given(solid=solids(7))
    def test_leaves_no_bare_contact_and_adds_nothing_without_one(self, solid: Solid) -> None:
        shell = close_shell(np.argwhere(solid), 0)
        found = dense(shell, shell.solid, solid, 1)
        filled = ndimage.binary_fill_holes(np.pad(solid, 1))
        assert not contacts(found).any()
        assert (shell.added == 0) == (not contacts(filled).any())
        assert found[filled].all()

    @pytest.mark.parametrize("offset", [(1, 1, 0), (1, -1, 0), (0, 1, 1), (-1, 0, 1), (1, 1, 1), (-1, 1, -1)])
    @pytest.mark.parametrize("place", [0, 7])
    def test_joins_two_cubes_that_touch(self, offset: tuple[int, int, int], place: int) -> None:
        shell = close_shell(place + np.array([(0, 0, 0), offset]), 0)
        assert shell.blocks.count(shell.solid).sum() == 2 ** np.count_nonzero(offset)
        assert shell.added == 2 ** np.count_nonzero(offset) - 2

    @law(60)
    @given(solid=solids(7))
    def test_gives_surfaces_that_are_sound(self, solid: Solid) -> None:
        shell = close_shell(np.argwhere(solid), 0)
        found = exposed_faces(shell)
        assert topology(mesh_of(found)).sound
        assert found.count == ndimage.label(dense(shell, shell.solid, solid, 1))[1]
        assert found.volumes.sum() == shell.blocks.count(shell.solid).sum()
        assert (found.volumes > 0).all()


def test_the_twin_of_composition_leaves_nothing_bare() -> None:
    for seed in range(20):
        solid = np.random.default_rng(seed).random((5, 5, 5)) < 0.3
        assert not contacts(composed(solid)).any()
