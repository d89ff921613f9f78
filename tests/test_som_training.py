"""Training: schedules, starts, weights, early stop, history, and what one sees of it."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from tomomesh.errors import UsageError
from tomomesh.model.graph import lattice_of
from tomomesh.model.lattice import TOPOLOGIES, lattice
from tomomesh.settings import FALLS, NetworkSettings
from tomomesh.som.fit import fit, match, start_positions
from tomomesh.som.schedules import falling, radius_power, schedule_warnings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BATCH = NetworkSettings(neurons=20, trim=0.0, epochs=6)
ONLINE = NetworkSettings(neurons=20, trim=0.0, training="online", iterations=600)
RING = lattice("ring", 20)


def circle(count: int = 300, seed: int = 0, noise: float = 0.02) -> Floats:
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * rng.random(count)
    return np.stack([np.cos(turn), np.sin(turn)], axis=1) + rng.normal(0, noise, (count, 2))


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


class TestFall:
    @law(100)
    @given(
        fall=st.sampled_from(FALLS), first=st.floats(0.01, 100), share=st.floats(0, 1), steps=st.integers(2, 200),
        power=st.floats(0.2, 8),
    )  # fmt: skip
    def test_goes_from_first_to_last_and_never_up(
        self, fall: str, first: float, share: float, steps: int, power: float
    ) -> None:
        found = falling(first, share * first, steps, fall=fall, power=power)
        assert found[[0, -1]] == pytest.approx([first, share * first], abs=1e-9 * first)
        assert (np.diff(found) <= 1e-9 * first).all()

    def test_formulas(self) -> None:
        t = np.arange(11) / 10
        np.testing.assert_allclose(falling(8, 2, 11, fall="linear"), 8 - 6 * t)
        np.testing.assert_allclose(falling(8, 2, 11, fall="power", power=3), 2 + 6 * (1 - t) ** 3)
        np.testing.assert_allclose(falling(8, 2, 11, fall="exponential"), 8 * 0.25**t)
        np.testing.assert_allclose(falling(8, 2, 11, fall="inverse"), 8 / (1 + 3 * t))
        np.testing.assert_allclose(falling(8, 2, 11, fall=lambda t: (1 - t) ** 2), 2 + 6 * (1 - t) ** 2)

    @pytest.mark.parametrize("fall", ["linear", "power", "exponential", "inverse"])
    @pytest.mark.parametrize("scale", [1e-3, 0.0625, 1.0, 1e3])
    def test_are_the_same_in_every_unit(self, fall: str, scale: float) -> None:
        """A learning rate falls from below 1, a radius from above: both alike."""
        whole = falling(8, 2, 11, fall=fall)
        np.testing.assert_allclose(falling(8 * scale, 2 * scale, 11, fall=fall), scale * whole, rtol=1e-12)

    @pytest.mark.parametrize("wrong", [lambda t: t[:-1], lambda t: t * np.nan, "steep"])
    def test_refuses_what_is_none(self, wrong: Any) -> None:
        with pytest.raises(UsageError, match="fall"):
            falling(1, 0, 5, fall=wrong)

    def test_one_epoch_has_the_first_radius(self) -> None:
        np.testing.assert_array_equal(falling(5, 1, 1, power=3.0), [5])

    def test_warns_where_the_learning_rate_falls_faster(self) -> None:
        calm = NetworkSettings(training="online")
        assert schedule_warnings(calm) == []
        assert schedule_warnings(NetworkSettings(alpha_power=9.0, radius_power=1.0)) == []
        steep = NetworkSettings(training="online", alpha_fall="exponential", radius_fall="linear")
        for found in (schedule_warnings(steep), schedule_warnings(calm, alpha_fall=lambda t: 1.0 * (t == 0))):
            assert len(found) == 1
            assert "faster" in found[0]

    @pytest.mark.parametrize(
        ("settings", "rising"),
        [
            ({"training": "online", "alpha": (0.01, 0.5)}, ["learning rate rises from 0.01 to 0.5"]),
            ({"training": "online", "alpha": (0.1, 0.5), "radius": (1, 9)}, ["learning rate rises", "radius rises"]),
            ({"radius": (1, 9)}, ["radius rises from 1 to 9"]),
            ({"alpha": (0.01, 0.5)}, []),  # in batch there is no learning rate
            ({"training": "online", "alpha": (0.1, 0.1), "radius": (2, 2)}, []),
            ({"training": "online", "alpha": (0.0, 0.5), "alpha_fall": "exponential"}, ["learning rate rises"]),
        ],
    )
    def test_warns_of_what_rises(self, settings: dict[str, Any], rising: list[str]) -> None:
        found = schedule_warnings(NetworkSettings(**settings))
        assert len(found) == len(rising)
        assert all(words in told for words, told in zip(rising, found, strict=True))

    def test_warns_of_a_fall_that_rises(self) -> None:
        (found,) = schedule_warnings(NetworkSettings(), radius_fall=lambda t: t)
        assert "radius rises from 1 to 10" in found

    def test_the_power_follows_the_training(self) -> None:
        kinds = [NetworkSettings(), NetworkSettings(training="online"), NetworkSettings(radius_power=3.5)]
        assert [radius_power(kind) for kind in kinds] == [2, 5, 3.5]


class TestStart:
    @pytest.mark.parametrize("name", TOPOLOGIES)
    @pytest.mark.parametrize("d", [1, 2, 3, 5])
    @pytest.mark.parametrize("start", ["axes", "ellipse", "random"])
    def test_is_centered_and_as_wide_as_the_inputs(self, name: str, d: int, start: str) -> None:
        inputs = np.random.default_rng(3).normal(size=(4000, d)) * np.arange(1, d + 1) + 5
        graph = lattice(name, 60)
        found = start_positions(inputs, graph, start, rng())
        assert found.shape == (len(graph), d)
        if start == "random":
            assert {tuple(place) for place in found} <= {tuple(place) for place in inputs}
            return
        np.testing.assert_allclose(found.mean(axis=0), inputs.mean(axis=0), atol=1e-9)
        widest = 1 if name == "chain" else min(d, graph.places.shape[1])
        spread = np.sort(np.linalg.eigvalsh(np.atleast_2d(np.cov(found.T))))[::-1]
        assert (spread[:widest] > 0.3).all()
        assert spread[0] < 1.5 * d**2

    def test_axes_lay_the_longest_side_along_the_longest_axis(self) -> None:
        inputs = np.random.default_rng(3).normal(size=(4000, 2)) * [9, 1]
        found = start_positions(inputs, lattice("grid", 0, shape=(12, 3)), "axes", rng())
        assert np.ptp(found[:, 0]) > 5 * np.ptp(found[:, 1])
        along = found.reshape(12, 3, 2)[:, 0, 0]
        assert (np.diff(along) > 1).all()

    def test_a_given_start_is_taken_as_it_is(self) -> None:
        given_start = np.random.default_rng(0).normal(size=(20, 2))
        seen: list[Floats] = []
        fit(circle(), RING, NetworkSettings(trim=0.0, radius=(0.0, 0.0), epochs=1), rng(), start=given_start,
              callback=lambda codebook, epoch: seen.append(codebook))  # fmt: skip
        winners, _ = match(given_start, circle())
        dead = np.setdiff1d(np.arange(20), winners)
        np.testing.assert_array_equal(seen[0][dead], given_start[dead])

    @pytest.mark.parametrize("start", [np.zeros((19, 2)), np.zeros((20, 3)), np.full((20, 2), np.nan)])
    def test_refuses_a_start_that_does_not_fit(self, start: Floats) -> None:
        with pytest.raises(UsageError, match="start"):
            fit(circle(), RING, BATCH, rng(), start=start)


class TestWeights:
    @law(25)
    @given(seed=seeds, name=st.sampled_from(TOPOLOGIES), d=st.sampled_from([1, 3, 12]), trim=st.sampled_from([0, 2.5]))
    def test_a_weight_is_a_number_of_repetitions(self, seed: int, name: str, d: int, trim: float) -> None:
        draw = np.random.default_rng(seed)
        inputs, times = draw.normal(size=(60, d)), draw.integers(0, 4, 60)
        times[:2] = 1
        kind = NetworkSettings(network=name, trim=trim, epochs=4, start="axes")
        graph = lattice(name, 9)
        weighted = fit(inputs, graph, kind, rng(), weights=times.astype(float))
        repeated = fit(np.repeat(inputs, times, axis=0), graph, kind, rng())
        np.testing.assert_allclose(weighted.codebook, repeated.codebook, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(np.repeat(weighted.kept, times), repeated.kept)
        assert not weighted.kept[times == 0].any()

    def test_online_draws_in_proportion(self) -> None:
        inputs, weights = np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 9.0]]), np.array([1.0, 3.0, 0.0])
        kind = NetworkSettings(training="online", iterations=20_000, alpha=(0.001, 0.001), trim=0, radius=(9.0, 9.0))
        fitted = fit(inputs, lattice("chain", 3), kind, rng(), weights=weights)
        np.testing.assert_allclose(fitted.codebook, [[0.75, 0.0]] * 3, atol=0.05)
        np.testing.assert_array_equal(fitted.kept, [True, True, False])

    @pytest.mark.parametrize("weights", [np.ones(299), -np.ones(300), np.zeros(300), np.full(300, np.inf)])
    def test_refuses_what_are_none(self, weights: Floats) -> None:
        with pytest.raises(UsageError, match="weights"):
            fit(circle(), RING, BATCH, rng(), weights=weights)


class TestWatched:
    @pytest.mark.parametrize("kind", [BATCH, ONLINE, NetworkSettings(neurons=20, epochs=6, trim=1.5)])
    @pytest.mark.parametrize("d", [1, 2, 12])
    def test_looking_on_changes_nothing(self, kind: NetworkSettings, d: int) -> None:
        inputs = np.random.default_rng(1).normal(size=(200, d))
        seen: list[tuple[int, Floats]] = []
        alone = fit(inputs, RING, kind, rng()).codebook
        watched = fit(inputs, RING, kind, rng(), callback=lambda codebook, epoch: seen.append((epoch, codebook)))
        assert alone.tobytes() == watched.codebook.tobytes() == seen[-1][1].tobytes()
        assert [epoch for epoch, _ in seen] == list(range(len(watched.history)))
        start = start_positions(inputs, RING, kind.start, rng())
        places = [start, *(codebook for _, codebook in seen)]
        moved = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(places)]
        np.testing.assert_allclose(watched.history.largest_move, moved, rtol=1e-9)

    def test_history_is_what_happened(self) -> None:
        places: list[Floats] = []
        found = fit(
            circle(), RING, ONLINE, rng(), callback=lambda codebook, epoch: places.append(codebook), record=True
        ).history
        assert len(found) == 2
        errors = [np.linalg.norm(circle()[:, None] - m, axis=2).min(axis=1).mean() for m in places]
        np.testing.assert_allclose(found.quantization_error, errors, rtol=1e-5)
        assert found.alpha[-1] == 0.01
        assert found.radius[-1] == 1
        batch = fit(circle(), RING, BATCH, rng(), pixel_area=0).history
        assert batch.quantization_error[-1] < batch.quantization_error[0]
        np.testing.assert_allclose(batch.radius, falling(5, batch.radius[-1], 6, power=2.0))
        assert batch.radius[-1] == 0.4

    def test_a_callback_may_stop_it(self) -> None:
        def stop(codebook: Floats, epoch: int) -> None:
            if epoch == 2:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            fit(circle(), RING, BATCH, rng(), callback=stop)


class TestThreads:
    @pytest.mark.parametrize("start", ["random", "axes"])
    @pytest.mark.parametrize("d", [2, 9, 101])
    def test_no_bit_depends_on_the_threads_of_matrix_products(self, start: str, d: int) -> None:
        limits = pytest.importorskip("threadpoolctl").threadpool_limits
        inputs, found = np.random.default_rng(0).normal(size=(5000, d)), []
        for threads in (1, 2):
            with limits(threads):
                found.append(fit(inputs, lattice("grid", 400), NetworkSettings(epochs=3, start=start), rng()))
        assert found[0].codebook.tobytes() == found[1].codebook.tobytes()
        assert found[0].kept.tobytes() == found[1].kept.tobytes()


class TestEarlyStop:
    @pytest.mark.parametrize("watched", [False, True])
    def test_stops_when_nothing_moves_farther(self, watched: bool) -> None:
        kind = NetworkSettings(trim=0.0, epochs=200, least_move=1e-3)
        look = (lambda codebook, epoch: None) if watched else None
        found = fit(circle(), RING, kind, rng(), callback=look).history
        assert 5 < len(found) < 200
        assert found.largest_move[-1] <= 1e-3
        assert found.radius[-1] <= 1.1 * falling(5, found.radius.min(), 200, power=2.0)[-1]

    def test_does_not_stop_while_the_neighborhood_is_wide(self) -> None:
        kind = NetworkSettings(trim=0.0, epochs=12, least_move=1e9)
        found = fit(circle(), RING, kind, rng(), pixel_area=0).history
        assert found.radius[-1] < 1
        assert len(found) > 6

    def test_online(self) -> None:
        kind = NetworkSettings(training="online", trim=0.0, iterations=3000, least_move=10.0, radius=(1.0, 1.0))
        assert len(fit(circle(), RING, kind, rng()).history) == 1


class TestNeighborhoods:
    @pytest.mark.parametrize("training", ["online", "batch"])
    @pytest.mark.parametrize("name", TOPOLOGIES)
    def test_inhibition_drives_no_neuron_out_of_the_inputs(self, training: str, name: str) -> None:
        inputs = np.random.default_rng(2).normal(size=(400, 3))
        kind = NetworkSettings(training=training, neighborhood="lateral", start="random", iterations=2000, trim=0.0)
        codebook = fit(inputs, lattice(name, 30), kind, rng()).codebook
        assert (codebook >= inputs.min(axis=0)).all()
        assert (codebook <= inputs.max(axis=0)).all()
        _, squared = match(codebook, inputs)
        assert np.sqrt(squared).mean() < 0.8 * np.linalg.norm(inputs, axis=1).mean()


class TestConverges:
    @pytest.mark.parametrize("start", ["random", "ellipse"])
    @pytest.mark.parametrize(("neurons", "count"), [(8, 8), (8, 2000), (58, 58), (80, 2000), (200, 200), (500, 2000)])
    def test_with_any_number_of_neurons_and_inputs(self, start: str, neurons: int, count: int) -> None:
        inputs = 50 * circle(size(count, min(count, 200)), noise=0.01)
        kind = NetworkSettings(neurons=neurons, start=start)
        ring = fit(inputs, lattice("ring", neurons), kind, rng(), pixel_area=0.1).codebook
        turn = np.diff(np.unwrap(np.arctan2(*np.concatenate([ring, ring[:1]]).T)))
        assert abs(turn.sum()) == pytest.approx(2 * np.pi)
        if neurons >= 58:
            assert np.abs(np.linalg.norm(ring, axis=1) - 50).mean() < 1

    def test_a_graph_learns_as_well(self) -> None:
        graph = lattice_of([[0, 1], [1, 2], [2, 0], [2, 3], [3, 4]], 5)
        codebook = fit(circle(), graph, BATCH, rng()).codebook
        assert (np.linalg.norm(codebook, axis=1) > 0.4).all()
        assert (np.linalg.norm(codebook, axis=1) < 1.1).all()

    def test_a_sphere_of_neurons_is_closed_about_its_shell(self) -> None:
        draw = np.random.default_rng(4).normal(size=(3000, 3))
        shell = draw / np.linalg.norm(draw, axis=1, keepdims=True) * 30
        graph = lattice("sphere", 162)
        codebook = fit(shell, graph, NetworkSettings(network="sphere", epochs=10), rng()).codebook
        corners = codebook[graph.faces]
        volume = np.einsum("na,na->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert volume == pytest.approx(4 / 3 * np.pi * 30**3, rel=0.1)
        assert (np.einsum("na,na->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0).all()
