"""The tracker of Gordon and Udupa finds the faces of the scan, from a seed face, entering each as often as it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import composed, faces_in, law, seeds, size
from tomomesh.cuberille.bitmasks import Blocks
from tomomesh.cuberille.leak_test import close_leaks
from tomomesh.kernels.cuberille.bitmasks import compose
from tomomesh.kernels.cuberille.faces import scan_faces
from tomomesh.kernels.cuberille.tracker import next_face, track_faces, track_surface
from tomomesh.model.cubes import cells_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.bitmasks import Bitmask
    from tomomesh.cuberille.faces import Faces

    Solid = NDArray[np.bool_]
    Face = tuple[tuple[int, ...], tuple[int, ...]]

NORMALS = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)])
SETS = size(100, 6)
"""Random sets in a grid, 6 cubes wide each and 2 apart: 40 grids have 4,000 of them."""


def filled(solid: Solid) -> Solid:
    """Return `composed` of a grid with a margin, by the kernel, which takes a tenth of the time."""
    cells = np.argwhere(solid)
    blocks = Blocks.around(cells, 2)
    bitmask = blocks.bitmask_of(cells)
    while True:
        more = bitmask.copy()
        if not compose(bitmask, blocks.table, blocks.grown(bitmask) & ~bitmask, more, 0, len(blocks)):
            break
        bitmask = more
    grid = np.zeros_like(solid)
    grid[tuple(blocks.cells(bitmask).T)] = True
    return grid


def many(seed: int) -> Solid:
    """Return a well-composed grid of many random sets apart, from sparse to crowded, some with cavities."""
    rng = np.random.default_rng(seed)
    sets = [rng.random((6, 6, 6)) < rng.choice([0.05, 0.2, 0.5, 0.8, 0.95]) for _ in range(SETS)]
    return filled(np.concatenate([np.pad(one, 1) for one in sets]))


def crowded(seed: int) -> Solid:
    """Return one well-composed random set with a margin, often riddled."""
    rng = np.random.default_rng(seed)
    solid = rng.random(rng.integers(1, size(16, 7), 3)) < rng.choice([0.1, 0.3, 0.6, 0.9])
    solid[tuple(rng.integers(solid.shape))] = True
    return np.pad(composed(solid), 1)


def tracked(solid: Solid) -> tuple[Blocks, Bitmask, NDArray[np.uint64], Bitmask]:
    """Return a set in its blocks, and empty results."""
    cells = np.argwhere(solid)
    blocks = Blocks.around(cells, 1)
    bitmask = blocks.bitmask_of(cells)
    return blocks, bitmask, np.zeros((6, *bitmask.shape), np.uint64), blocks.empty()


def listed(blocks: Blocks, exposed: NDArray[np.uint64]) -> set[Face]:
    """Return faces as the cube behind each and its outward normal."""
    return {
        (tuple(cell), tuple(normal))
        for normal, bitmask in zip(NORMALS.tolist(), exposed, strict=True)
        for cell in blocks.cells(bitmask).tolist()
    }


def number_of(blocks: Blocks, cell: NDArray[np.int64]) -> int:
    """Return the kernel's number of a cube."""
    block = np.flatnonzero((cells_of(blocks.keys) == cell // 8).all(axis=1))[0]
    x, y, z = (cell % 8).tolist()
    return 512 * int(block) + 64 * int(z) + 8 * int(y) + int(x)


def walked(solid: Solid, seed: Face) -> set[Face]:
    """Walk over all four sides of each face, from the definition: up, on, or down at every side."""
    present = {tuple(cell) for cell in np.argwhere(solid).tolist()}
    found, waiting = {seed}, [seed]
    while waiting:
        cell, normal = (np.array(part) for part in waiting.pop())
        for t in NORMALS[NORMALS @ normal == 0]:
            up, on = tuple((cell + normal + t).tolist()), tuple((cell + t).tolist())
            turned = (up, tuple((-t).tolist())) if up in present else (tuple(cell.tolist()), tuple(t.tolist()))
            there = (on, tuple(normal.tolist())) if up not in present and on in present else turned
            if there not in found:
                found.add(there)
                waiting.append(there)
    return found


def assert_same(one: Faces, other: Faces) -> None:
    for name in ("corners", "quads", "cells", "occupied", "witness", "labels", "inward"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert one.count == other.count


class TestFaces:
    @law(40)
    @given(seed=seeds)
    def test_are_those_of_the_scan_byte_for_byte_on_thousands_of_sets(self, seed: int) -> None:
        solid = many(seed)
        assert_same(faces_in(solid), faces_in(solid, tracking="faces"))

    @law(150)
    @given(seed=seeds)
    def test_of_a_riddled_set_are_those_of_the_scan(self, seed: int) -> None:
        solid = crowded(seed)
        assert_same(faces_in(solid), faces_in(solid, tracking="faces"))

    @law(60)
    @given(seed=seeds, place=st.tuples(*[st.integers(-20, 20)] * 3))
    def test_are_bit_for_bit_those_of_the_scan_wherever_the_blocks_end(
        self, seed: int, place: tuple[int, int, int]
    ) -> None:
        cells = np.argwhere(crowded(seed)) + place
        blocks = Blocks.around(cells, 1)
        solid, shape = blocks.bitmask_of(cells), (6, len(blocks) + blocks.spaces, 8)
        found = [(np.zeros(shape, np.uint64), blocks.empty()) for _ in range(2)]
        scan_faces(solid, blocks.table, *found[0])
        track_faces(solid, blocks.table, *found[1])
        assert found[0][0].tobytes() == found[1][0].tobytes()
        assert found[0][1].tobytes() == found[1][1].tobytes()

    def test_of_more_faces_than_the_stack_begins_with_are_all_found(self) -> None:
        solid = np.pad(np.ones((size(40, 12), size(40, 12), 3), bool), 1)
        assert_same(faces_in(solid), faces_in(solid, tracking="faces"))

    @pytest.mark.parametrize("cavities", [False, True])
    def test_of_a_closed_shell_are_those_of_the_scan(self, cavities: bool) -> None:
        wide = size(13, 7)
        cells = np.argwhere(np.ones([2 * wide + 1] * 3, bool)) - wide
        far = np.linalg.norm(cells, axis=1)
        cells = cells[(np.abs(far - wide + 1) < 0.9) | (np.abs(far - wide / 3) < 0.9)]
        one, other = (close_leaks(cells, [0], cavities=cavities, tracking=way).faces for way in ("scan", "faces"))
        assert one.count == 1 + cavities
        assert_same(one, other)


class TestSurface:
    @law(40)
    @given(seed=seeds, number=seeds)
    def test_from_a_seed_is_what_a_walk_over_all_four_sides_reaches(self, seed: int, number: int) -> None:
        """And nothing else: faces that no seed reaches are not visited."""
        solid = crowded(seed)
        toward_y = sorted(
            (tuple(cell), (0, step, 0))
            for step in (-1, 1)
            for cell in np.argwhere(solid & ~np.roll(solid, -step, axis=1)).tolist()
        )
        face = toward_y[number % len(toward_y)]
        blocks, bitmask, exposed, corners = tracked(solid)
        start = 8 * number_of(blocks, np.array(face[0])) + (2 if face[1][1] < 0 else 3)
        track_surface(bitmask, blocks.table, start, exposed, corners)
        wanted = walked(solid, face)
        assert listed(blocks, exposed) == wanted
        ends = {
            tuple((np.array(cell) + (np.array(n) > 0) + step).tolist())
            for cell, n in wanted
            for step in np.argwhere(np.ones((2, 2, 2), bool))
            if not (step * n).any()
        }
        assert {tuple(cell) for cell in blocks.cells(corners).tolist()} == ends

    @law(60)
    @given(seed=seeds)
    def test_enters_faces_toward_x_or_z_once_and_toward_y_twice(self, seed: int) -> None:
        blocks, bitmask, exposed, corners = tracked(crowded(seed))
        entered = track_faces(bitmask, blocks.table, exposed, corners)
        toward = np.bitwise_count(exposed).sum(axis=(1, 2))
        assert entered == toward.sum() + toward[2] + toward[3]


class TestCycles:
    @law(40)
    @given(seed=seeds, around=st.sampled_from([0, 2]))
    def test_give_every_face_one_successor_and_one_predecessor(self, seed: int, around: int) -> None:
        blocks, bitmask, exposed, corners = tracked(crowded(seed))
        scan_faces(bitmask, blocks.table, exposed, corners)
        faces = [
            8 * number_of(blocks, cell) + direction
            for direction in range(6)
            if direction // 2 != around
            for cell in blocks.cells(exposed[direction])
        ]
        assert sorted(next_face(bitmask, blocks.table, face, around) for face in faces) == sorted(faces)
