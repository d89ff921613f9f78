"""Options that change nothing are told, and what is told of them is true."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from conftest import COMPILED
from studies import write_nifti
from tomomesh import PointSet, Settings, Volume, reconstruct, reconstruct_points
from tomomesh.cli import main
from tomomesh.effect import without_effect
from tomomesh.settings import MATTERS, parameters
from tomomesh.ways import WAYS as TABLE
from tomomesh.ways import way_of

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

NAMES = [entry.name for _, entry in parameters()]
OTHER: dict[str, Any] = {
    "layers": "any", "inputs": "layers", "signal": "region", "neurons": 30, "training": "online", "iterations": 77,
    "epochs": 2, "start": "axes", "neighborhood": "bubble", "alpha": (0.3, 0.1), "alpha_fall": "exponential",
    "alpha_power": 1.5, "radius": (4.0, 0.9), "radius_fall": "linear", "radius_power": 3.0, "least_move": 0.5,
    "bridge": 1.1, "even": False, "trim": 1.5, "cell_mm": (1.5,), "cell_factor": 1.7, "caps": False, "closing": 3,
    "stacks": "none", "filled": True, "allow_leaks": True, "fill_holes": True, "open": True, "low_pass": 0,
    "attraction": "surface", "stiffness": 0.9,
    "damping": 0.9, "step": 0.5, "springs": "triangles", "limit": "shorten", "allow_returns": True,
    "units": "cm", "local_origin": True, "allow_far": True,
    "largest": True, "surface": "outer", "divide": False, "seed": 99, "cell_from": "nearest", "tracking": "faces",
    "thickness": 2.0,
}  # fmt: skip
"""Another value of each parameter that may be without effect."""
SOMETIMES = {*MATTERS, *(name for way in TABLE for name in way_of(way).reads)}
"""Parameters that are read on some ways alone, or beside some values of others alone."""
ALWAYS = {
    "series", "spacing", "spacing_z", "fill_gaps", "resample_slices", "skip_bad", "nifti_form", "level", "fill_chunks",
    "structure", "skip_flat", "roi", "slice_range", "lower", "upper", "preset", "select", "fill_slices", "keep",
    "keep_at", "drop_at",
    "slices", "way", "network", "space", "contours", "tolerance", "max_steps", "scale", "flat_base", "down", "hollow",
    "drain", "least_wall", "print_check", "threads", "frame", "target_faces", "smooth", "remesh", "edge",
    "precision", "one_piece", "fill_cavities", "thicken", "shared_walls",
}  # fmt: skip
"""Parameters that matter on every way, or that choose what is read, the way, or what becomes of the mesh."""
STUDY: dict[str, dict[str, Any]] = {
    "networks": {"way": "ring", "neurons": 24},
    "nearest neurons": {"way": "ring", "neurons": 24, "attraction": "nearest"},
    "online": {
        "way": "ring",
        "neurons": 24,
        "training": "online",
        "iterations": 300,
        "alpha_fall": "linear",
        "radius_fall": "linear",
    },
    "grid": {"neurons": 25, "network": "grid", "allow_leaks": True},
    "components": {"neurons": 24, "contours": "components"},
    "loops": {"neurons": 24, "contours": "loops"},
    "voxels": {"network": "none"},
    "space": {"network": "sphere", "neurons": 42},
    "nearest in space": {"network": "sphere", "neurons": 42, "attraction": "nearest"},
}
CLOUD: dict[str, dict[str, Any]] = {
    "cloud": {},
    "nearest": {"attraction": "nearest"},
    "sheet": {"open": True},
    "filled": {"filled": True},
}
POWERS = {"training": "online", "alpha_fall": "power", "radius_fall": "power"}
WAYS = [*(("gray", asked) for asked in STUDY.values()), *(("cloud", asked) for asked in CLOUD.values()), ("stack", {})]
"""What is read, and what is asked for, on each way to a mesh."""


def ball() -> Volume:
    """Return a ball of radius 6 mm, its gray levels falling outward, in slices thick enough to be divided."""
    offset = (np.indices((11, 16, 16)) - np.array([5, 7.5, 7.5])[:, None, None, None]) * np.array([1.5, 1, 1])[
        :, None, None, None
    ]
    levels = 100 - 10 * np.sqrt((offset**2).sum(axis=0))
    return Volume.from_stored(levels.astype(np.float32), np.diag([1.0, 1.0, 1.5, 1.0]))


def sphere() -> PointSet:
    """Return 600 points on a sphere, evenly spread and in no layers."""
    height = 1 - 2 * (np.arange(600) + 0.5) / 600
    angle = np.pi * (1 + 5**0.5) * np.arange(600)
    ring = np.sqrt(1 - height**2)
    return PointSet.from_positions(10 * np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1))


def two_spheres() -> PointSet:
    """Return 1200 points on two spheres apart, the second the smaller."""
    first = sphere().positions
    return PointSet.from_positions(np.concatenate([first, 0.8 * first + [40, 0, 0]]))


def stack() -> PointSet:
    """Return the contours of two balls apart, 60 points each, on parallel slices."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rings = [
        np.stack([x + r * np.cos(angle), r * np.sin(angle), np.full(60, z)], axis=1)
        for x, most in ((0, 10), (30, 8))
        for z in range(-8, 9, 2)
        if (r := np.sqrt(most**2 - z**2)) > 1
    ]
    return PointSet.from_positions(np.concatenate(rings))


def settled(settings: dict[str, Any]) -> Settings:
    """Return settings that leave nothing open about the way, a ring on every slice where they name none."""
    asked = Settings().replace(**settings)
    return replace(
        asked, network=asked.network.taking(asked.network.detailed or asked.network.way.replace("auto", "ring"))
    )


def silent(settings: dict[str, Any], kind: str) -> list[str]:
    """Return the parameters that are said to have no effect."""
    asked = settled(settings)
    return [name for name in NAMES if name not in settings and without_effect(asked, [name], input=kind)]


def vertices(settings: dict[str, Any], kind: str) -> NDArray[np.float64]:
    if kind in ("cloud", "stack"):
        return reconstruct_points(sphere() if kind == "cloud" else stack(), **settings).mesh.vertices
    return reconstruct(ball(), lower=40.0, **settings).mesh.vertices


class TestTable:
    def test_names_parameters_and_their_values_alone(self) -> None:
        choices = {entry.name: entry.metadata["choices"] for _, entry in parameters()}
        assert set(NAMES) >= SOMETIMES
        for conditions in (*MATTERS.values(), *(found for name in TABLE for found in way_of(name).reads.values())):
            for key, values in conditions.items():
                assert key == "input" or set(values) < set(choices[key])

    def test_every_parameter_is_in_it_or_always_matters(self) -> None:
        assert set(NAMES) == SOMETIMES | ALWAYS
        assert not SOMETIMES & ALWAYS
        assert set(OTHER) == SOMETIMES

    @pytest.mark.parametrize("name", sorted(SOMETIMES))
    def test_what_is_in_it_matters_on_some_ways_and_not_on_others(self, name: str) -> None:
        told = {bool(without_effect(settled(asked), [name], input=kind)) for kind, asked in [*WAYS, ("color", POWERS)]}
        assert told == {True, False}

    def test_the_defaults_have_something_to_say_of_few(self) -> None:
        assert {"alpha", "iterations"} < set(silent({}, "gray"))
        assert not {"neurons", "lower", "closing", "low_pass", "cell_mm", "seed"} & set(silent({}, "gray"))


@pytest.mark.skipif(not COMPILED, reason="some hundred meshes, seconds each without the compiler")
class TestTruth:
    @pytest.mark.parametrize("way", STUDY)
    def test_what_has_no_effect_on_a_study_leaves_the_mesh_as_it_is(self, way: str) -> None:
        self.leaves_the_mesh(STUDY[way], "gray")

    @pytest.mark.parametrize("way", CLOUD)
    def test_what_has_no_effect_on_a_cloud_leaves_the_mesh_as_it_is(self, way: str) -> None:
        self.leaves_the_mesh(CLOUD[way], "cloud")

    def test_what_has_no_effect_on_a_stack_leaves_the_mesh_as_it_is(self) -> None:
        self.leaves_the_mesh({}, "stack")

    @staticmethod
    def leaves_the_mesh(settings: dict[str, Any], kind: str) -> None:
        before, names = vertices(settings, kind), silent(settings, kind)
        assert names
        for name in names:
            np.testing.assert_array_equal(vertices(settings | {name: OTHER[name]}, kind), before, err_msg=name)

    def test_what_has_an_effect_changes_the_mesh(self) -> None:
        before = vertices(STUDY["networks"], "gray")
        for name in ("epochs", "radius", "even", "caps", "low_pass", "step", "cell_mm"):
            assert name not in silent(STUDY["networks"], "gray")
            after = vertices(STUDY["networks"] | {name: OTHER[name], "allow_far": True}, "gray")
            assert after.shape != before.shape or not np.array_equal(after, before), name


class TestLargest:
    """A surface of several parts, on the ways that keep all of them."""

    @pytest.mark.parametrize(
        "asked", [{"network": "none"}, {"contours": "components"}, {"contours": "walls"}, {"network": "sphere"}]
    )
    def test_another_option_is_named_where_it_has_no_effect(self, asked: dict[str, Any]) -> None:
        [told] = without_effect(settled(asked), ["largest"], input="gray")
        assert told.startswith("--largest has no effect with --")
        assert told.endswith(": --keep largest has")

    def test_a_stack_of_contours_is_told_apart_from_a_cloud(self) -> None:
        told = reconstruct_points(stack(), largest=True).report["warnings"]
        assert "--largest has no effect on a stack of contours" in told
        found = reconstruct_points(two_spheres(), largest=True).report
        assert not any("--largest" in one for one in found["warnings"])
        assert found["quality"]["components"] == 1


class TestReport:
    def test_what_was_asked_for_is_told_and_nothing_else(self) -> None:
        settings = Settings().replace(alpha=(0.3, 0.1), neurons=24)
        assert not any("alpha" in told for told in reconstruct(ball(), settings, lower=40.0).report["warnings"])
        told = reconstruct(ball(), lower=40.0, neurons=24, alpha=(0.3, 0.1), even=False).report["warnings"]
        assert told[0] == "--alpha has no effect with --training batch"
        assert not any("even" in one for one in told)

    @pytest.mark.parametrize("way", ["voxels", "contours", "ring"])
    def test_auto_written_out_asks_for_nothing(self, way: str) -> None:
        told = reconstruct(ball(), lower=40.0, way=way, neurons="auto").report["warnings"]
        assert not any("neurons" in one for one in told)

    def test_the_command_line_tells_options_but_no_settings_file(
        self, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        study, kept = tmp_path / "s.nii", tmp_path / "s.toml"
        write_nifti(study, (ball().voxels > 40).astype(np.uint8), np.eye(4))
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--report", str(tmp_path / "r.json")]
        assert main([*line, "--network", "none", "--closing", "2", "--save-settings", str(kept)]) == 0
        said = "--closing has no effect with --way voxels"
        assert f"warning   {said}" in capsys.readouterr().out
        assert said in json.loads((tmp_path / "r.json").read_text())["warnings"]
        assert main([*line, "--settings", str(kept)]) == 0
        assert said not in capsys.readouterr().out

    def test_the_network_command_tells_it_too(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert (
            main(
                [
                    "network",
                    "square",
                    "-o",
                    str(tmp_path / "n"),
                    "--iterations",
                    "50",
                    "--epochs",
                    "2",
                    "--neurons",
                    "12",
                ]
            )
            == 0
        )
        assert "warning   --iterations has no effect with --training batch" in capsys.readouterr().out
