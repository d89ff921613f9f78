"""The faces between a window and its outside, beside a loop over its voxels and all distances."""

from __future__ import annotations

from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from conftest import law, seeds
from tomomesh.isosurface.sides import WindowSides


@law(30)
@given(seed=seeds, shape=st.tuples(*[st.integers(1, 6)] * 3))
def test_they_are_those_of_every_voxel_but_where_two_meet(seed: int, shape: tuple[int, int, int]) -> None:
    mask = np.random.default_rng(seed).random(shape) < 0.5
    expected = set()
    for k, j, i in np.argwhere(mask):
        for axis, side in product(range(3), (-1, 1)):
            there = np.array([k, j, i])
            there[axis] += side
            if not (0 <= there[axis] < shape[axis] and mask[tuple(there)]):
                place = np.array([k, j, i], float)
                place[axis] += side / 2
                expected.add(tuple(place[::-1]))
    sides = WindowSides.of(mask)
    found = [tuple(place) for place in sides.some()]
    assert len(found) == len(set(found)) == len(expected) == len(sides)
    assert set(found) == expected
    assert [tuple(place) for place in sides.some(3)] == found[::3]


@law(60)
@given(seed=seeds, shape=st.tuples(*[st.integers(1, 24)] * 3), share=st.sampled_from([0.0, 0.002, 0.5]))
def test_the_nearest_face_is_the_nearest_of_all(seed: int, shape: tuple[int, int, int], share: float) -> None:
    """Among the voxels and far from them: most are near, as a sparse mask's are not."""
    rng = np.random.default_rng(seed)
    mask = rng.random(shape) < share
    places = rng.uniform(-1.5, 2.5, (40, 3)) * shape[::-1]
    sides = WindowSides.of(mask)
    expected = cdist(places, sides.some()).min(axis=1, initial=np.inf)
    np.testing.assert_allclose(sides.distances(places), expected, rtol=1e-12)
