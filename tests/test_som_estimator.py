"""The estimator: scikit-learn judges its manners, and files keep all of it."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh import SOM
from tomomesh.errors import FormatError, UnreadableError, UsageError
from tomomesh.som.checks import NotFittedError, not_fitted, seed_of
from tomomesh.som.parameters import Parametrized

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def blobs(count: int = 200, d: int = 3, seed: int = 0) -> Floats:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, d)) + rng.integers(0, 2, (count, 1)) * 6


class TestManners:
    @pytest.mark.parametrize(
        "som",
        [
            SOM(20),
            SOM(12, topology="ring", start="random", trim=3.0),
            SOM(12, topology="sphere", start="ellipse"),
            SOM(9, training="online", epochs=3),
        ],
        ids=["grid", "ring", "sphere", "online"],
    )
    def test_scikit_learn_finds_no_fault(self, som: SOM) -> None:
        checks = pytest.importorskip("sklearn.utils.estimator_checks")
        drawn = {"check_sample_weight_equivalence_on_dense_data": "presentations and starts are drawn at random"}
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Estimator SOM does not inherit")
            found = checks.check_estimator(
                som, on_skip=None, on_fail="raise",
                expected_failed_checks=drawn if som.training == "online" or som.start == "random" else None,
            )  # fmt: skip
        assert len(found) > 40

    def test_works_in_a_pipeline_and_a_search(self) -> None:
        selection, pipeline, scaling = (
            pytest.importorskip(f"sklearn.{name}") for name in ("model_selection", "pipeline", "preprocessing")
        )
        pipe = pipeline.make_pipeline(scaling.StandardScaler(), SOM(9, random_state=1))
        assert pipe.fit_transform(blobs()).shape == (200, 9)
        assert pipe.fit(blobs()).predict(blobs()).shape == (200,)
        search = selection.GridSearchCV(pipe, {"som__n_neurons": [4, 25]}, cv=2).fit(blobs())
        assert search.best_params_ == {"som__n_neurons": 25}

    def test_parameters(self) -> None:
        som = SOM(7, topology="ring")
        assert repr(som) == "SOM(n_neurons=7, topology='ring')"
        assert som.set_params(n_neurons=8).get_params()["n_neurons"] == 8
        with pytest.raises(ValueError, match="nonsense"):
            som.set_params(nonsense=1)
        assert isinstance(som, Parametrized)

    def test_two_numbers_are_a_shape(self) -> None:
        inputs = blobs()
        found, asked = SOM((3, 4), random_state=0).fit(inputs), SOM(shape=(3, 4), random_state=0).fit(inputs)
        assert found.lattice_.shape == (3, 4)
        np.testing.assert_array_equal(found.codebook_, asked.codebook_)
        with pytest.raises(UsageError, match="two shapes"):
            SOM((3, 4), shape=(3, 4)).fit(inputs)

    @pytest.mark.parametrize(
        ("params", "named"),
        [
            ({"n_neurons": 2}, "2 neurons"),
            ({"n_neurons": 10.5}, "n_neurons = 10.5"),
            ({"n_neurons": (2, 3, 4)}, "shape = (2, 3, 4)"),
            ({"alpha": (2, 0.1)}, "alpha = 2 0.1"),
            ({"alpha_power": -1}, "alpha_power = -1"),
            ({"epochs": 0}, "epochs = 0"),
            ({"topology": "pyramid"}, "topology = pyramid"),
            ({"neighborhood": "box"}, "neighborhood = box"),
            ({"training": "online", "least_move": -1.0}, "least_move = -1.0"),
        ],
    )
    def test_faults_name_parameters_and_no_options(self, params: dict[str, Any], named: str) -> None:
        with pytest.raises(UsageError) as fault:
            SOM(**params).fit(blobs())
        assert named in str(fault.value)
        assert "--" not in str(fault.value)

    @pytest.mark.parametrize("asked", [58, 37])
    def test_says_that_a_grid_has_another_number(self, asked: int) -> None:
        with pytest.warns(UserWarning, match=f"{asked} neurons make no grid"):
            som = SOM(asked).fit(blobs())
        assert max(som.lattice_.shape) <= 2 * min(som.lattice_.shape)

    @pytest.mark.parametrize("asked", [58, 37])
    def test_says_that_a_sphere_has_another_number(self, asked: int) -> None:
        with pytest.warns(UserWarning, match=f"^{asked} neurons make no even sphere: it has 42$"):
            SOM(asked, topology="sphere").fit(blobs())

    def test_warns_of_what_rises(self) -> None:
        with pytest.warns(UserWarning, match="learning rate rises"):
            SOM(9, training="online", alpha=(0.01, 0.5), epochs=2).fit(blobs())
        with pytest.warns(UserWarning, match="radius rises"):
            SOM(9, radius=(1, 4)).fit(blobs())

    def test_prints_in_one_line(self) -> None:
        som = SOM(9, topology="ring", start=blobs(9), epochs=3).fit(blobs())
        for printed in (som, som.lattice_, som.history_):
            assert "\n" not in repr(printed)
            assert len(repr(printed)) < 120

    def test_without_scikit_learn_there_is_an_error_as_well(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delitem(__import__("sys").modules, "sklearn.exceptions", raising=False)
        assert isinstance(not_fitted("SOM"), NotFittedError)


class TestFit:
    @pytest.mark.parametrize("d", [1, 2, 3, 8, 9, 30])
    @pytest.mark.parametrize("training", ["batch", "online"])
    def test_on_any_dimension(self, d: int, training: str) -> None:
        inputs = blobs(d=d)
        som = SOM(16, training=training, random_state=3).fit(inputs)
        assert som.codebook_.shape == (16, d)
        distance = np.linalg.norm(inputs[:, None] - som.codebook_, axis=2)
        np.testing.assert_allclose(som.transform(inputs), distance, atol=1e-9)
        own = distance[np.arange(200), som.predict(inputs)]
        np.testing.assert_allclose(own, distance.min(axis=1), rtol=1e-4, atol=1e-5)
        np.testing.assert_array_equal(som.labels_, som.predict(inputs))
        assert som.quantization_error_ == pytest.approx(own.mean(), rel=1e-4)
        assert som.score(inputs) == pytest.approx(-som.quantization_error_)
        assert som.n_iter_ == len(som.history_) == 20
        assert som.quantization_error_ < np.linalg.norm(inputs - inputs.mean(axis=0), axis=1).mean()

    def test_has_the_topology_it_was_asked_for(self) -> None:
        assert SOM(shape=(3, 5)).fit(blobs()).lattice_.shape == (3, 5)
        assert SOM(42, topology="sphere").fit(blobs()).lattice_.faces.shape == (80, 3)
        star = SOM(5, topology="graph", edges=[[0, 1], [0, 2], [0, 3], [0, 4]]).fit(blobs())
        assert star.lattice_.farthest == 2
        with pytest.raises(UsageError, match="edges"):
            SOM(5, edges=[[0, 1]]).fit(blobs())
        with pytest.raises(UsageError, match="neurons"):
            SOM(0).fit(blobs())

    def test_the_seed_is_stored_and_decides(self) -> None:
        first = SOM(9, training="online").fit(blobs())
        again, other = (SOM(9, training="online", random_state=first.seed_ + n).fit(blobs()) for n in (0, 1))
        assert first.codebook_.tobytes() == again.codebook_.tobytes()
        assert first.codebook_.tobytes() != other.codebook_.tobytes()
        assert seed_of(np.random.default_rng(5)) == seed_of(np.random.default_rng(5))
        assert seed_of(np.random.RandomState(5)) == seed_of(np.random.RandomState(5))

    def test_falls_starts_and_looks_of_ones_own(self) -> None:
        seen: list[int] = []
        start = np.random.default_rng(0).normal(size=(9, 3))
        som = SOM(
            9, start=start, epochs=5, radius_fall=lambda t: np.sqrt(1 - t), callback=lambda m, epoch: seen.append(epoch)
        ).fit(blobs())
        assert seen == [0, 1, 2, 3, 4]
        first, last = som.history_.radius[[0, -1]]
        np.testing.assert_allclose(som.history_.radius, last + (first - last) * np.sqrt(1 - np.arange(5) / 4))

    def test_warns_where_the_learning_rate_falls_faster_than_the_radius(self) -> None:
        with pytest.warns(UserWarning, match="faster than the radius"):
            SOM(9, training="online", alpha_power=9.0, radius_power=1.0, epochs=1).fit(blobs())

    def test_drops_strays(self) -> None:
        inputs = np.vstack([blobs(), [[500.0, 500, 500]]])
        som = SOM(9, trim=4.0).fit(inputs)
        assert som.strays_ == 1
        assert som.codebook_.max() < 20

    @pytest.mark.parametrize("training", ["batch", "online"])
    def test_goes_on_with_new_inputs(self, training: str) -> None:
        som = SOM(9, training=training, random_state=0, start="random").partial_fit(blobs())
        shifted = blobs(seed=1) + 3
        before, epochs = som.score(shifted), som.n_iter_
        for _ in range(20):
            som.partial_fit(shifted)
        assert som.n_iter_ == len(som.history_) == epochs + 20
        assert som.score(shifted) > before + 0.1
        with pytest.raises(ValueError, match="features"):
            som.partial_fit(blobs(d=4))

    @pytest.mark.parametrize(("neighborhood", "farthest"), [("bubble", 1), ("auto", 6), ("gaussian", 6)])
    def test_trains_on_in_its_own_neighborhood(self, neighborhood: str, farthest: int) -> None:
        """At a last radius of 1 one input moves the winner and its neighbors alone, or all up to 6 radii from it."""
        line = np.linspace(0, 1, 400)[:, None] * [1.0, 2.0]
        som = SOM(40, topology="chain", neighborhood=neighborhood, radius=(5.0, 1.0), epochs=5).fit(line)
        before = som.codebook_.copy()
        winner = int(som.predict(before[20:21] + 1e-3)[0])
        moved = np.flatnonzero(
            (som.partial_fit(np.add(before[20:21], [[0.01, -0.01]])).codebook_ != before).any(axis=1)
        )
        assert np.abs(moved - winner).max() == farthest


class TestFiles:
    def test_keep_all_of_it(self, tmp_path: Path) -> None:
        som = SOM(12, topology="torus", radius=(2.0, 0.5), random_state=np.random.RandomState(3)).fit(blobs())
        som.save(tmp_path / "map.npz")
        found = SOM.load(tmp_path / "map.npz")
        assert found.get_params() == som.get_params() | {"random_state": som.seed_}
        assert found.predict(blobs()).tobytes() == som.predict(blobs()).tobytes()
        for name in ("codebook_", "labels_"):
            assert getattr(found, name).tobytes() == getattr(som, name).tobytes()
        for name in ("edges", "hops", "places", "faces"):
            np.testing.assert_array_equal(getattr(found.lattice_, name), getattr(som.lattice_, name))
        assert found.lattice_.shape == som.lattice_.shape
        np.testing.assert_array_equal(found.history_.radius, som.history_.radius)
        figures = ("n_iter_", "quantization_error_", "seed_", "strays_", "n_features_in_")
        assert [getattr(found, name) for name in figures] == [getattr(som, name) for name in figures]
        assert found.partial_fit(blobs()).codebook_.tobytes() == som.partial_fit(blobs()).codebook_.tobytes()

    def test_hold_plain_arrays_alone(self, tmp_path: Path) -> None:
        SOM(5, topology="graph", edges=[[0, 1], [1, 2], [2, 3], [3, 4]], start=np.eye(5, 3)).fit(blobs()).save(
            tmp_path / "map"
        )
        with np.load(tmp_path / "map", allow_pickle=False) as file:
            assert all(file[name].dtype.kind in "fiuUb" for name in file.files)
        assert SOM.load(tmp_path / "map").fit(blobs()).codebook_.shape == (5, 3)

    def test_refuse_functions(self, tmp_path: Path) -> None:
        som = SOM(4, alpha_fall=lambda t: 1 - t).fit(blobs())
        with pytest.raises(UsageError, match="alpha_fall"):
            som.save(tmp_path / "map.npz")

    def test_refuse_what_is_no_network(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableError):
            SOM.load(tmp_path / "nothing.npz")
        (tmp_path / "text.npz").write_text("no network")
        np.savez(tmp_path / "other.npz", a=np.ones(3))
        objects: Any = np.array([{}], dtype=object)
        np.savez(tmp_path / "pickle.npz", head=objects)
        for name in ("text", "other", "pickle"):
            with pytest.raises(FormatError, match=name):
                SOM.load(tmp_path / f"{name}.npz")
