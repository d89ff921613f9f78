"""Networks on the page, asked without a browser: what is trained is what the run trains, and no epoch is lost."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from tomomesh import phantom, segment
from tomomesh.cli import main
from tomomesh.errors import EmptyError, UsageError
from tomomesh.settings import Settings
from tomomesh.som.measures import quantization_error
from tomomesh.view.networks import asked as networks
from tomomesh.view.networks import pictures
from tomomesh.view.networks.course import MOST, PICTURES
from tomomesh.view.networks.figures import FIGURES
from tomomesh.view.networks.trainers import head, trainer_of
from tomomesh.view.opened import Opened
from tomomesh.view.session import Session

if TYPE_CHECKING:
    from pathlib import Path

    from tomomesh.view.networks.course import TrainingCourse

HEAD = phantom((10, 48, 48), (5.0, 5.0, 14.0))
RING: dict[str, Any] = {"lower": HEAD.lower, "way": "ring"}
WAYS: dict[str, dict[str, Any]] = {
    "ring": RING,
    "paper": {"lower": HEAD.lower, "way": "paper", "neurons": 40, "iterations": 2500},
    "neighbor": RING | {"start": "neighbor", "neurons": 30},
    "grid": RING | {"network": "grid", "neurons": 25},
    "outline": RING | {"signal": "boundary", "seed": 5},
    "settled": RING | {"training": "online", "least_move": 0.4, "neurons": 20, "iterations": 20_000},
}


class Telling(Session):
    """A session that keeps what it tells."""

    def __init__(self, opened: Opened | None = None, choices: Any = None) -> None:
        super().__init__(opened or Opened(), choices)
        self.told: list[dict[str, Any]] = []
        self.events.tell = self.told.append  # type: ignore[method-assign, assignment]
        self.jobs._tell = self.told.append

    def train(self, **asked: Any) -> TrainingCourse:
        """Train, and wait for it."""
        networks.train(self, asked)
        self.wait()
        assert self.told[-1]["event"] == "done", self.told[-1]
        found = networks.course_of(self)
        assert found is not None
        return found

    def wait(self) -> None:
        job = self.jobs.now
        if job is not None and job.thread is not None:
            job.thread.join()

    @property
    def epochs(self) -> list[dict[str, Any]]:
        return [one for one in self.told if one["event"] == "epoch"]


def study(**choices: Any) -> Telling:
    return Telling(Opened("study", ("head.nii.gz",), volume=HEAD.volume), choices)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("k", [1, 5])
def test_a_slice_is_trained_to_the_last_bit_as_by_the_run(way: str, k: int) -> None:
    session = study(**WAYS[way])
    course = session.train(slice=k)
    run = segment(HEAD.volume, **WAYS[way])
    last = json.loads(json.dumps(session.epochs[-1]))["codebook"]  # as the page has it
    assert np.array_equal(np.array(last).reshape(-1, 2), run.source.codebook_on(k))
    assert course.bridged is not None
    assert np.array_equal(course.bridged, run.source.bridged[np.searchsorted(run.source.slices, k)])
    assert course.note == ""


def test_in_space_a_network_is_trained_to_the_last_bit_as_by_the_run() -> None:
    choices: dict[str, Any] = {"lower": HEAD.lower, "way": "sphere", "neurons": 162}
    course = study(**choices).train(space=True)
    run = segment(HEAD.volume, **choices)
    assert np.array_equal(course.frames[-1].codebook, run.source.network.codebook)
    assert [one.kind for one in course.frames] == ["start", *["epoch"] * 10]


@pytest.mark.parametrize("way", WAYS)
def test_every_epoch_is_told_once_in_order_and_kept(way: str) -> None:
    session = study(**WAYS[way])
    course = session.train(slice=4)
    names = [one["event"] for one in session.told if one["event"] in ("training", "epoch", "done")]
    assert names == ["training", *["epoch"] * len(course.frames), "done"]
    assert [one["n"] for one in session.epochs] == list(range(len(course.frames)))
    assert session.told[-1]["count"] == len(course.frames)
    kept = networks.training(session)["training"]["frames"]
    assert [{"event": "epoch", **one} for one in kept] == session.epochs
    assert [one.kind for one in course.frames[:2]] == ["start", "epoch"]
    json.dumps(session.told, allow_nan=False)


@pytest.mark.parametrize(("epochs", "trim"), [(1, 0.0), (30, 0.0), (30, 2.0)])
def test_there_are_as_many_epochs_as_asked_for(epochs: int, trim: float) -> None:
    course = study(**RING, epochs=epochs, trim=trim, even=False, neurons=30).train(slice=4)
    assert course.stops == list(range(1, epochs + 1))
    count = [one.kind for one in course.frames].count("epoch")
    assert count == epochs if trim == 0 else epochs <= count <= epochs + 5


def test_online_it_is_looked_at_often_and_early() -> None:
    course = study(**WAYS["paper"]).train(slice=4)
    assert len(course.frames) == len(course.stops) + 1 <= PICTURES + 1
    assert course.stops[0] == 1
    assert course.stops[-1] == 2500


def test_errors_are_those_of_the_codebooks() -> None:
    course = study(**RING).train(slice=4)
    pixel = np.array(HEAD.volume.spacing_mm[:2])
    for one in course.frames[:-1]:
        assert one.error == pytest.approx(quantization_error(one.codebook * pixel, course.inputs), rel=1e-6)
    assert course.frames[0].error != course.frames[1].error


def test_frames_from_one_on_are_handed_out_again() -> None:
    session = study(**RING)
    count = len(session.train(slice=4).frames)
    assert [one["n"] for one in networks.training(session, "3")["training"]["frames"]] == list(range(3, count))
    assert networks.training(study())["training"] is None


def test_all_slices_are_the_runs() -> None:
    session = study(**RING, neurons=30)
    networks.segment(session, {})
    session.wait()
    run = segment(HEAD.volume, **RING, neurons=30).source
    assert session.told[-1]["slices"] == run.slices.tolist()
    for k in run.slices:
        told = networks.networks_on(session, int(k))
        assert told["fresh"]
        (one,) = told["networks"]
        assert np.array_equal(np.array(one["codebook"]).reshape(-1, 2), run.codebook_on(k))
    session.choose({"neurons": 31})
    assert not networks.networks_on(session, 4)["fresh"]


def test_all_contours_of_a_slice_are_shown() -> None:
    choices: dict[str, Any] = {"lower": HEAD.lower, "way": "contours"}
    session = study(**choices)
    networks.segment(session, {})
    session.wait()
    each = segment(HEAD.volume, **choices).source.by_slice[4]
    told = networks.networks_on(session, 4)["networks"]
    assert [one["codebook"] for one in told] == [one.codebook.ravel().tolist() for one in each]
    assert len(told) > 1


@pytest.mark.parametrize(("way", "word"), [("voxels", "voxels"), ("contours", "each outline"), ("sphere", "in space")])
def test_it_is_said_where_a_run_would_not_train_so(way: str, word: str) -> None:
    assert word in study(lower=HEAD.lower, way=way).train(slice=4).note


def test_a_training_that_is_stopped_keeps_what_was_seen() -> None:
    session = study(**RING, epochs=MOST, neurons=60)

    def tell(event: dict[str, Any]) -> None:
        session.told.append(event)
        if event["event"] == "epoch" and event["n"] == 9:
            session.jobs.stop()

    session.events.tell = tell  # type: ignore[method-assign]
    networks.train(session, {"slice": 4})
    session.wait()
    assert session.told[-1]["event"] == "stopped"
    told = networks.training(session)["training"]
    assert (told["state"], told["count"]) == ("stopped", 10)
    session.events.tell = session.told.append  # type: ignore[method-assign, assignment]
    session.choose({"epochs": 3})
    assert session.train(slice=4).state == "done"


def test_a_second_click_is_no_second_run() -> None:
    session = study(**RING, epochs=300)
    first, second, other = (
        networks.train(session, {"slice": 4}), networks.train(session, {"slice": 5}), networks.segment(session, {}),
    )  # fmt: skip
    session.wait()
    assert (first["started"], second["started"], other["started"]) == (True, False, False)
    assert first["job"]["job"] == second["job"]["job"] == other["job"]["job"]
    assert [one["event"] for one in session.told].count("training") == 1


@pytest.mark.parametrize(
    ("asked", "choices"),
    [({"slice": 10}, RING), ({"slice": -1}, RING), ({"slice": 4}, RING | {"epochs": MOST + 1}), ({"depth": 1}, RING)],
)
def test_what_cannot_be_trained_is_refused_in_a_line(asked: dict[str, Any], choices: dict[str, Any]) -> None:
    session = study(**choices)
    networks.train(session, asked)
    session.wait()
    assert session.told[-1]["event"] == "failed"
    assert "Expected" in session.told[-1]["error"]


def test_without_a_study_only_regions_are_trained() -> None:
    with pytest.raises(UsageError, match="no study"):
        trainer_of(Telling(), {"slice": 1}, lambda *told: None)
    with pytest.raises(UsageError, match="no such region"):
        trainer_of(Telling(), {"region": "circle"}, lambda *told: None)
    trainer = trainer_of(Telling(choices={"neurons": 4096}), {"region": "head"}, lambda *told: None)
    look = trainer.course.look(lambda told: None, lambda *told: None)
    with pytest.raises(EmptyError, match="fewer inputs"):
        trainer.train(look)


@pytest.mark.parametrize("figure", [one for one in FIGURES if one.choices], ids=lambda one: one.name)
def test_every_figure_can_be_played_and_taken_back(figure: Any) -> None:
    session = Telling(choices={"alpha_power": 1.5, "lower": 3.0})
    session.choose(json.loads(json.dumps(figure.told))["choices"])
    assert "alpha_power" not in session.choices.values
    assert session.choices.values["lower"] == 3.0
    course = session.train(region=figure.region)
    assert course.state == "done"
    assert course.frames[0].error != course.frames[-1].error
    session.undo()
    assert session.choices.values == {"alpha_power": 1.5, "lower": 3.0}


@pytest.mark.parametrize(("name", "moving"), [("1a", [6, 7, 8, 9]), ("1b", [0, 6, 7, 8, 9])])
def test_figure_1_moves_the_neurons_of_the_paper(name: str, moving: list[int]) -> None:
    (figure,) = [one for one in FIGURES if one.name == name]
    frames = Telling(choices=dict(figure.choices)).train(region="input").frames
    moved = (frames[1].codebook != frames[0].codebook).any(axis=1)
    assert np.flatnonzero(moved).tolist() == moving
    signal = 0.15 * frames[0].codebook[8]
    expected = frames[0].codebook + 0.4 * moved[:, None] * (signal - frames[0].codebook)
    np.testing.assert_allclose(frames[1].codebook, expected, atol=1e-15)


@pytest.mark.parametrize("choices", [{"neurons": 20}, {"way": "paper", "neurons": 30, "seed": 3}], ids=str)
def test_the_command_repeats_a_training_on_a_region(choices: dict[str, Any], tmp_path: Path) -> None:
    session = Telling(choices=choices)
    course = session.train(region="square")
    words = session.command.split()
    assert words[:3] == ["tomomesh", "network", "square"]
    assert main([*words[1:], "-o", str(tmp_path / "out"), "--report", str(tmp_path / "report.json"), "--quiet"]) == 0
    found = json.loads((tmp_path / "report.json").read_text())["network"]
    assert found["quantization_error"] == quantization_error(course.frames[-1].codebook, course.inputs)
    assert found["neurons"] == len(course.lattice)


def test_only_options_that_matter_are_offered() -> None:
    batch, online = (networks.options_of(Settings().replace(training=name)) for name in ("batch", "online"))
    assert {"epochs", "way", "signal"} <= set(batch)
    assert not {"iterations", "alpha", "alpha_fall", "alpha_power", "inputs"} & set(batch)
    assert {"iterations", "alpha", "alpha_power"} <= set(online)
    assert "alpha_power" not in networks.options_of(Settings().replace(training="online", alpha_fall="linear"))
    assert "even" not in networks.options_of(Settings().replace(network="grid"))
    assert "inputs" in networks.options_of(Settings(), color=True)
    assert not set(networks.OF_SLICES) & set(networks.options_of(Settings(), region=True))


def test_the_film_and_the_settings_are_of_what_was_trained(tmp_path: Path) -> None:
    session = study(**RING, neurons=20, epochs=4)
    course = session.train(slice=4)
    session.choose({"neurons": 25})
    with Image.open(io.BytesIO(pictures.save_film(session).body)) as film:
        assert (film.format, film.n_frames) == ("GIF", len(course.frames))  # type: ignore[attr-defined]
    (tmp_path / "settings.toml").write_bytes(pictures.save_settings(session).body)
    from tomomesh.io import read_settings

    assert read_settings(tmp_path / "settings.toml") == course.settings
    assert course.settings.network.neurons == 20


@pytest.mark.parametrize("name", ["grid", "hexagonal", "torus"])
def test_maps_of_a_sheet_count_every_input(name: str) -> None:
    session = Telling(choices={"network": name, "neurons": 36, "epochs": 5})
    course = session.train(region="square")
    told = pictures.maps(session, len(course.frames) - 1)
    assert sum(told["hits"]) == len(course.inputs)
    assert len(told["far"]) * 2 == len(told["centers"])
    assert told["hexagonal"] == (name == "hexagonal")
    session.choose({"network": "ring"})
    session.train(region="square")
    with pytest.raises(UsageError, match="no U-matrix"):
        pictures.maps(session, 0)


def test_the_region_of_the_head_is_a_skull_that_is_open_somewhere() -> None:
    inputs, area, back = head()
    assert area == pytest.approx(2.25)
    assert len(inputs) == back.kept.sum() > 500
    assert back.gray[back.kept > 0].min() > back.gray[back.kept == 0].mean()
