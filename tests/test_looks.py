"""Whoever looks on at a training changes nothing about it, and misses nothing of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh import phantom
from tomomesh.errors import EmptyError
from tomomesh.model.lattice import lattice
from tomomesh.segmentation.networks.one import OneSlice
from tomomesh.segmentation.networks.slices import Slices
from tomomesh.segmentation.networks.training import train_study
from tomomesh.settings import NetworkSettings
from tomomesh.som.fit import fit, start_positions
from tomomesh.som.passes import Look, at_times

if TYPE_CHECKING:
    from numpy.typing import NDArray

HEAD = phantom((10, 48, 48), (5.0, 5.0, 14.0))
MASK = np.asarray((HEAD.volume.voxels > HEAD.lower) & (HEAD.volume.voxels <= HEAD.upper))
KINDS = st.builds(
    NetworkSettings,
    training=st.sampled_from(["online", "batch"]),
    start=st.sampled_from(["ellipse", "axes", "random"]),
    neighborhood=st.sampled_from(["auto", "bubble", "gaussian", "lateral"]),
    epochs=st.integers(1, 12),
    iterations=st.integers(1, 900),
    trim=st.sampled_from([0.0, 1.5, 2.5]),
    least_move=st.sampled_from([0.0, 1e-3, 0.1]),
)
TIMES = st.integers(0, 40)


class Seen:
    """What was told, and who is told it."""

    def __init__(self, times: int = 0) -> None:
        self.rows: list[tuple[NDArray[np.float64], int, float, float]] = []
        self.look = Look(lambda *told: self.rows.append(told), times)

    def __getitem__(self, n: int) -> list[Any]:
        return [row[n] for row in self.rows]


@law(60)
@given(KINDS, TIMES, st.integers(0, 5), st.sampled_from(["ring", "chain", "grid"]))
def test_looking_on_changes_no_bit(settings: NetworkSettings, times: int, seed: int, name: str) -> None:
    inputs, graph = np.random.default_rng(seed).normal(size=(150, 2)), lattice(name, 12)
    seen = Seen(times)
    looked_at = fit(inputs, graph, settings, np.random.default_rng(seed), look=seen.look)
    alone = fit(inputs, graph, settings, np.random.default_rng(seed))
    assert np.array_equal(looked_at.codebook, alone.codebook)
    assert np.array_equal(looked_at.kept, alone.kept)
    assert np.array_equal(seen[0][-1], alone.codebook)
    assert np.array_equal(seen[0][0], start_positions(inputs, graph, settings.start, np.random.default_rng(seed)))
    assert seen[1] == list(range(len(looked_at.history) + 1))
    assert seen[2][1:] == looked_at.history.radius.tolist()
    assert seen[3][1:] == looked_at.history.alpha.tolist()


@law(60)
@given(st.integers(1, 20_000), st.integers(1, 200))
def test_times_end_with_the_last_presentation_and_lie_ever_farther_apart(presentations: int, times: int) -> None:
    stops = at_times(presentations, times).tolist()
    assert stops[-1] == presentations
    assert len(stops) <= times
    assert all(0 < one < other for one, other in pairwise(stops))
    assert all(two - one <= three - two + 1 for one, two, three in zip(stops, stops[1:], stops[2:], strict=False))


@pytest.mark.parametrize("epochs", [1, 30])
def test_a_callback_is_told_of_epochs_from_0_and_of_no_start(epochs: int) -> None:
    told: list[int] = []
    inputs = np.random.default_rng(0).normal(size=(99, 2))
    settings = NetworkSettings(epochs=epochs, trim=0.0)
    fit(inputs, lattice("ring", 9), settings, np.random.default_rng(0), callback=lambda _, epoch: told.append(epoch))
    assert told == list(range(epochs))


def test_a_training_is_stopped_by_who_looks_on() -> None:
    def told(codebook: Any, done: int, radius: float, alpha: float) -> None:
        if done == 3:
            raise InterruptedError

    inputs = np.random.default_rng(0).normal(size=(99, 2))
    with pytest.raises(InterruptedError):
        fit(inputs, lattice("ring", 9), NetworkSettings(), np.random.default_rng(0), look=Look(told))


@pytest.mark.parametrize(
    "settings",
    [
        NetworkSettings(),
        NetworkSettings(neurons=40, signal="boundary"),
        NetworkSettings(neurons=30, training="online", start="random", iterations=3000, even=False, trim=0.0),
        NetworkSettings(neurons=20, start="neighbor"),
        NetworkSettings(neurons=36, network="grid"),
        NetworkSettings(neurons=30, network="chain", least_move=0.5),
    ],
    ids=["auto", "outline", "paper", "neighbor", "grid", "chain"],
)
@pytest.mark.parametrize("k", [1, 6])
def test_one_slice_is_trained_as_in_the_whole(settings: NetworkSettings, k: int) -> None:
    settings = replace(settings, network="ring") if settings.network == "auto" else settings
    whole = train_study(MASK, settings, pixel_mm=(5.0, 5.0), seed=7)
    one = OneSlice.of(Slices.of(MASK, None, None, settings, (5.0, 5.0), 7, 0), k)
    seen = Seen(20)
    codebook, bridged = one.train(seen.look)
    assert np.array_equal(codebook, whole.codebook_on(k))
    assert np.array_equal(bridged, whole.bridged[np.searchsorted(whole.slices, k)])
    assert len(one.lattice) == len(whole.lattice)
    assert len(seen.rows) > 2


def test_a_slice_with_too_few_pixels_is_refused() -> None:
    few = MASK.copy()
    few[4] = False
    few[4, 20, 20:24] = True
    settings = NetworkSettings(neurons=20, network="ring")
    with pytest.raises(EmptyError, match="too few"):
        OneSlice.of(Slices.of(few, None, None, settings, (5.0, 5.0), 0, 0), 4)
    assert 4 not in train_study(few, settings, pixel_mm=(5.0, 5.0)).slices
