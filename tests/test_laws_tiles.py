"""A part of a cloud or a study, with what the whole tells it, comes out as it does in the whole: to the last bit."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, law, seeds
from tomomesh.errors import ResourceError
from tomomesh.pointcloud.samples import Samples, settle_points
from tomomesh.pointcloud.search import Index
from tomomesh.segmentation.networks.training import regions, train_study
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

HALO = 40
"""Sampling distances around a part that suffice: see the notes of `settle_points`."""
PER_POINT = ("positions", "normals", "spacing", "noise", "width")


def ribbon(length: int, noise: float, rng: np.random.Generator, width: int = 10) -> Floats:
    """A wavy ribbon along x with about one point a unit of area, and some points that belong to nothing."""
    count = width * length
    x, y = rng.uniform(0, length, count), rng.uniform(0, width, count)
    flat = np.stack([x, y, 3 * np.sin(x / 9)], axis=1) + rng.normal(0, noise, (count, 3))
    return np.concatenate([flat, rng.uniform([0, 0, -20], [length, width, 20], (count // 100, 3))])


def inside(found: Samples, low: float, high: float) -> list[NDArray[np.generic]]:
    """What is known of the samples between two places along x."""
    kept = (found.positions[:, 0] >= low) & (found.positions[:, 0] < high)
    return [getattr(found, name)[kept] for name in PER_POINT]


SLOW = pytest.mark.skipif(not COMPILED, reason="thousands of points settle, minutes without the compiler")


@SLOW
@law(12)
@given(seeds, st.sampled_from([0.0, 0.05, 0.3, 0.9]))
def test_a_part_of_a_cloud_settles_as_in_the_whole(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    cloud = ribbon(260, noise, rng)
    whole = settle_points(cloud)
    halo = HALO * max(float(np.median(whole.spacing)), whole.whole.values["sampling distance"])
    low = float(rng.uniform(0, 240))
    near = cloud[(cloud[:, 0] >= low - halo) & (cloud[:, 0] < low + 20 + halo)]
    assert len(near) < 0.8 * len(cloud)
    part = settle_points(rng.permutation(near), whole=whole.whole)
    expected = inside(whole, low, low + 20)
    assert len(expected[0]) > 50
    assert all(np.array_equal(a, b) for a, b in zip(inside(part, low, low + 20), expected, strict=True))
    assert part.bend == whole.bend


@SLOW
@law(4)
@given(seeds)
def test_so_does_a_part_of_a_slab_whose_points_are_merged(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cloud = ribbon(300, 3.5, rng, width=24)
    whole = settle_points(cloud)
    assert len(whole.positions) < 0.5 * len(cloud)
    reach = HALO * float(np.median(whole.spacing))
    part = settle_points(cloud[cloud[:, 0] < 60 + reach], whole=whole.whole)
    assert len(part.positions) < len(whole.positions)
    assert all(np.array_equal(a, b) for a, b in zip(inside(part, 0, 60), inside(whole, 0, 60), strict=True))


@SLOW
def test_a_part_that_is_told_nothing_does_not() -> None:
    cloud = ribbon(260, 0.05, np.random.default_rng(0))
    whole, alone = settle_points(cloud), settle_points(cloud[cloud[:, 0] > 100])
    assert not np.array_equal(inside(alone, 160, 200)[0], inside(whole, 160, 200)[0])


@law(20)
@given(seeds, st.floats(0.3, 4.0))
def test_a_part_has_the_cubes_of_the_whole(seed: int, edge: float) -> None:
    rng = np.random.default_rng(seed)
    cloud = rng.uniform(-30, 30, (400, 3))
    whole = Index.of(cloud, edge)
    chosen = np.flatnonzero(cloud[:, 1] > rng.uniform(-20, 20))
    part = Index.of(cloud[chosen], edge, whole.frame[:3])
    assert np.array_equal(part.frame, whole.frame)
    assert np.array_equal(chosen[part.order], whole.order[np.isin(whole.order, chosen)])
    cube = np.floor((cloud - whole.frame[:3]) / edge)
    for begin, end in pairwise(part.groups):
        assert len(np.unique(cube[chosen[part.order[begin:end]]], axis=0)) == 1


def test_a_part_far_from_where_the_cubes_begin_is_refused_as_the_whole_is() -> None:
    far = np.array([[0.0, 0.0, 0.0], [1e9, 0.0, 0.0]])
    with pytest.raises(ResourceError) as whole:
        Index.of(far, 1.0)
    with pytest.raises(ResourceError) as part:
        Index.of(far[1:], 1.0, far[0])
    assert str(part.value) == str(whole.value)


@law(8)
@given(seeds, st.sampled_from(["ring", "chain", "grid"]), st.integers(0, 5), st.integers(1, 6))
def test_slices_of_a_study_are_trained_and_labeled_as_in_the_whole(
    seed: int, network: str, first: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    j, i = np.indices((24, 24)) - 12
    mask = np.array([np.hypot(j, i * rng.uniform(0.8, 1.2)) < rng.uniform(6, 11) for _ in range(7)])
    settings = NetworkSettings(network=network, neurons=16, signal="region", epochs=4)
    whole = train_study(mask, settings, seed=seed)
    part = train_study(mask[first : first + count], settings, seed=seed, first=first)
    rows = slice(first, first + count)
    assert np.array_equal(part.slices + first, whole.slices[rows])
    assert np.array_equal(part.codebooks, whole.codebooks[rows])
    assert np.array_equal(part.bridged, whole.bridged[rows])
    assert np.array_equal(regions(mask[rows], part), regions(mask, whole)[rows])
