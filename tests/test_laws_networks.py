"""Networks: inside the hull of their inputs, the same for any number of threads, repeatable by their seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from conftest import law, seeds, size
from tomomesh.errors import EmptyError
from tomomesh.model.lattice import TOPOLOGIES, lattice
from tomomesh.segmentation.networks.training import regions, train_study
from tomomesh.settings import FALLS, NetworkSettings
from tomomesh.som.fit import fit, match, radii, start_positions
from tomomesh.som.region import train_region
from tomomesh.som.shapes import SHAPES, shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

PRESENTATIONS = size(2000, 200)

kinds = st.builds(
    NetworkSettings,
    network=st.sampled_from(TOPOLOGIES),
    training=st.sampled_from(["online", "batch"]),
    neighborhood=st.sampled_from(["bubble", "gaussian"]),
    alpha_fall=st.sampled_from(FALLS),
    radius_fall=st.sampled_from(FALLS),
    start=st.just("random"),
    neurons=st.integers(3, 20),
    iterations=st.just(PRESENTATIONS),
    trim=st.sampled_from([0.0, 2.5]),
)


def band(rng: np.random.Generator, slices: int = 1, wide: int = 40, half_width: float = 2.0) -> NDArray[np.bool_]:
    """Draw slices with an elliptic band of pixels and a few strays."""
    row, column = np.mgrid[:wide, :wide] - wide / 2 + 0.5
    radii = rng.uniform(0.25, 0.4, (slices, 2, 1, 1)) * wide
    reach = np.hypot(row / radii[:, 0], column / radii[:, 1])
    near = np.abs(reach - 1) * radii.min(axis=1) < half_width
    return np.asarray(near | (rng.random(near.shape) < 0.003))


def in_hull(point: NDArray[np.float64], hull: NDArray[np.float64]) -> bool:
    """Find out whether a point is a convex combination of others, by linear programming."""
    equal = np.vstack([hull.T, np.ones(len(hull))])
    found = linprog(np.zeros(len(hull)), A_eq=equal, b_eq=np.append(point, 1), bounds=(0, None), method="highs")
    return bool(found.status == 0)


class TestHull:
    @law(60)
    @given(seed=seeds, kind=kinds, d=st.sampled_from([1, 2, 3, 10]))
    def test_the_codebook_stays_inside_the_hull_of_its_inputs(self, seed: int, kind: NetworkSettings, d: int) -> None:
        rng = np.random.default_rng(seed)
        inputs = rng.normal(size=(60, d)) * 10
        codebook = fit(inputs, lattice(kind.network, kind.neuron_count), kind, rng).codebook
        slack = 1e-9
        assert (codebook >= inputs.min(axis=0) - slack).all()
        assert (codebook <= inputs.max(axis=0) + slack).all()
        for neuron in codebook[:3]:
            toward_middle = neuron + 1e-6 * (inputs.mean(axis=0) - neuron)
            assert in_hull(toward_middle, inputs)

    @law(30)
    @given(seed=seeds, kind=kinds)
    def test_equal_inputs_draw_every_neuron_onto_them(self, seed: int, kind: NetworkSettings) -> None:
        inputs = np.full((30, 3), 7.25)
        fitted = fit(inputs, lattice(kind.network, kind.neuron_count), kind, np.random.default_rng(seed))
        np.testing.assert_allclose(fitted.codebook, 7.25, rtol=1e-12)
        assert fitted.kept.all()

    @pytest.mark.parametrize("name", TOPOLOGIES)
    def test_an_ellipse_start_has_the_center_of_its_inputs(self, name: str) -> None:
        inputs = np.random.default_rng(0).normal(size=(500, 2)) * [9, 2] + [100, -50]
        start = start_positions(inputs, lattice(name, 24), "ellipse", np.random.default_rng(0))
        np.testing.assert_allclose(start.mean(axis=0), inputs.mean(axis=0), atol=1e-9)


class TestRepeatable:
    @law(12)
    @given(seed=seeds, kind=kinds, outlined=st.sampled_from(["region", "boundary"]))
    def test_one_thread_and_many_give_the_same_bytes(self, seed: int, kind: NetworkSettings, outlined: str) -> None:
        mask = band(np.random.default_rng(seed), slices=5)
        settings = NetworkSettings(**{**vars(kind), "signal": outlined})
        one, two, many = (train_study(mask, settings, seed=seed, threads=n) for n in (1, 2, 7))
        assert one.codebooks.tobytes() == two.codebooks.tobytes() == many.codebooks.tobytes()
        assert one.strays.tobytes() == two.strays.tobytes() == many.strays.tobytes()
        labels = [regions(mask, one, threads=n) for n in (1, 2)]
        assert labels[0].tobytes() == labels[1].tobytes()

    @pytest.mark.parametrize("training", ["online", "batch"])
    def test_the_seed_decides_and_nothing_else(self, training: str) -> None:
        mask = band(np.random.default_rng(1), slices=3)
        kind = NetworkSettings(training=training, neurons=20, start="random", iterations=PRESENTATIONS, trim=0.0)
        again = [train_study(mask, kind, seed=seed).codebooks.tobytes() for seed in (5, 5, 6)]
        assert again[0] == again[1] != again[2]

    @pytest.mark.parametrize("training", ["online", "batch"])
    def test_a_slice_does_not_depend_on_the_slices_after_it(self, training: str) -> None:
        mask = band(np.random.default_rng(1), slices=4)
        kind = NetworkSettings(training=training, neurons=20, signal="region", iterations=PRESENTATIONS)
        whole, part = (train_study(m, kind, seed=3).codebooks for m in (mask, mask[:2]))
        assert whole[:2].tobytes() == part.tobytes()

    def test_an_enlarged_image_gives_an_enlarged_network(self) -> None:
        mask = band(np.random.default_rng(1), slices=2)
        kind = NetworkSettings(neurons=20, signal="region")
        one, two = (train_study(mask, kind, pixel_mm=(s, s)).codebooks for s in (1.0, 4.0))
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-9)


class TestStudy:
    def test_regions_hold_the_nearest_neuron_of_every_window_pixel(self) -> None:
        mask, pixel_mm = band(np.random.default_rng(2), slices=3), (0.5, 0.8)
        mask[1] = False
        networks = train_study(mask, NetworkSettings(neurons=12), pixel_mm=pixel_mm)
        labels = regions(mask, networks, pixel_mm=pixel_mm)
        np.testing.assert_array_equal(networks.slices, [0, 2])
        assert not labels[~mask].any()
        for plane, codebook in zip(networks.slices, networks.codebooks, strict=True):
            pixels = np.argwhere(mask[plane])
            off = (pixels[:, None, ::-1] - codebook) * pixel_mm
            wanted = (off**2).sum(axis=2).argmin(axis=1) + 1
            np.testing.assert_array_equal(labels[plane][mask[plane]], wanted)

    @pytest.mark.parametrize("power", [(1.0, 1.0), (3.0, 5.0)])
    def test_a_ring_lies_on_the_middle_of_its_band(self, power: tuple[float, float]) -> None:
        row, column = np.mgrid[:100, :100] - 49.5
        mask = (np.abs(np.hypot(row, column) - 35) < 3)[None]
        errors = {}
        for training in ("online", "batch"):
            kind = NetworkSettings(
                training=training, neurons=40, alpha_power=power[0], radius_power=power[1],
                iterations=size(10_000, 2000), signal="region",
            )  # fmt: skip
            ring = train_study(mask, kind).codebooks[0] - 49.5
            errors[training] = np.abs(np.hypot(*ring.T) - 35).mean()
        assert errors["batch"] < 0.15
        assert errors["online"] < 1.5

    def test_without_its_strays_a_ring_is_as_good_as_new(self) -> None:
        row, column = np.mgrid[:100, :100] - 49.5
        mask = (np.abs(np.hypot(row, column) - 35) < 3)[None]
        mask |= np.random.default_rng(3).random(mask.shape) < 0.008
        off = {}
        for trim in (0.0, 2.5):
            networks = train_study(mask, NetworkSettings(neurons=60, signal="region", trim=trim))
            off[trim] = np.abs(np.hypot(*(networks.codebooks[0] - 49.5).T) - 35).mean()
        assert networks.strays[0] > 40
        assert off[2.5] < 0.25 * off[0.0]

    def test_slices_with_fewer_pixels_than_neurons_have_no_network(self) -> None:
        mask = np.zeros((2, 9, 9), bool)
        mask[0, 4, :5], mask[1, 3:6] = True, True
        networks = train_study(mask, NetworkSettings(neurons=6, signal="region"))
        np.testing.assert_array_equal(networks.slices, [1])

    def test_nothing_to_train_on_is_an_error(self) -> None:
        with pytest.raises(EmptyError, match="at most 1 pixels") as refused:
            train_study(np.eye(9, dtype=bool)[None] & (np.arange(9) == 4), NetworkSettings(neurons=6))
        assert refused.value.exit_code == 6


class TestRegion:
    @pytest.mark.parametrize("name", SHAPES)
    @pytest.mark.parametrize("network", TOPOLOGIES)
    @pytest.mark.parametrize("training", ["online", "batch"])
    def test_fills_the_paper_s_shapes(self, name: str, network: str, training: str) -> None:
        kind = NetworkSettings(
            network=network,
            training=training,
            neurons=25,
            iterations=size(5000, 300),
            epochs=size(10, 3),
            trim=0.0,
        )
        inputs = shape(name)[0][:: size(1, 7)]
        trained = train_region(inputs, kind, seed=1)
        again = train_region(inputs, kind, seed=1)
        assert trained.codebook.tobytes() == again.codebook.tobytes()
        assert trained.measures["seed"] == 1
        assert (trained.codebook >= 0).all()
        assert (trained.codebook <= 1).all()
        _, squared = match(trained.codebook, inputs)
        assert trained.measures["quantization_error"] == pytest.approx(np.sqrt(squared).mean())
        assert trained.measures["quantization_error"] < 0.4

    def test_says_so_where_the_learning_rate_falls_faster_than_the_radius(self) -> None:
        inputs = shape("square")[0][::40]
        kind = NetworkSettings(training="online", neurons=8, iterations=50, alpha_power=4.0, radius_power=2.0)
        assert "faster than the radius" in train_region(inputs, kind).measures["warnings"][0]
        assert not train_region(inputs, NetworkSettings(neurons=8)).measures["warnings"]

    def test_wants_an_input_for_every_neuron(self) -> None:
        with pytest.raises(EmptyError, match="5 inputs"):
            train_region(np.zeros((5, 2)), NetworkSettings(neurons=6))


class TestRadius:
    @law(30)
    @given(neurons=st.integers(60, 90), radius=st.floats(45, 60), half_width=st.floats(5, 8), share=st.floats(0.3, 3))
    def test_of_a_ring_ends_at_half_of_its_band_in_neurons(
        self, neurons: int, radius: float, half_width: float, share: float
    ) -> None:
        """However finely the band is sampled."""
        mask = np.abs(np.hypot(*np.mgrid[-70:70, -70:70]) - radius) < half_width
        kind = NetworkSettings(training="batch", neighborhood="gaussian")
        last = radii(np.argwhere(mask) * share**0.5, lattice("ring", neurons), kind, share)[1]
        assert last == pytest.approx(half_width * neurons / (2 * np.pi * radius), rel=0.06)


class TestNeighborStart:
    def test_follows_the_slice_below(self) -> None:
        """A ring that starts where the one below came to rest lies as well, and neuron k keeps its meridian."""
        mask = np.stack([annulus(20 + k, 12 + k) for k in range(6)])
        settings = NetworkSettings(neurons=40, start="neighbor")
        found = train_study(mask, settings, threads=2)
        plain = train_study(mask, NetworkSettings(neurons=40))
        for one, other in zip(found.codebooks, plain.codebooks, strict=True):
            assert np.abs(radius_of(one).mean() - radius_of(other).mean()) < 0.2
            assert radius_of(one).std() < 0.5
        turned = np.diff(np.unwrap(np.arctan2(*(found.codebooks - 31.5).T).T, axis=0), axis=0)
        assert np.abs(turned).max() < 2 * np.pi / 40
        assert np.array_equal(found.codebooks, train_study(mask, settings, threads=1).codebooks)


def annulus(outer: float, inner: float) -> NDArray[np.bool_]:
    """Draw a ring of pixels about the middle of a picture of 64 x 64."""
    away = np.hypot(*(np.mgrid[:64, :64] - 31.5))
    return np.asarray((away < outer) & (away > inner))


def radius_of(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each neuron from the middle."""
    return np.asarray(np.hypot(*(ring - 31.5).T))
