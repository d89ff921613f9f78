"""Many studies: each is done, failures stop nothing, what is finished is passed over, and the table says it all."""

from __future__ import annotations

import argparse
import csv
import gc
import json
import os
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from studies import write_nifti, write_series
from tomomesh.cli import main
from tomomesh.cli.batch import SINGLE
from tomomesh.cli.options import build_parser
from tomomesh.io import find_studies, write_table
from tomomesh.settings import parameters

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from pydicom.dataset import Dataset

OPTIONS = ["--network", "none", "--lower", "50"]


def block(side: int = 4) -> Any:
    """Return a block of 100 in 0."""
    voxels = np.zeros((8, 9, 10), np.uint8)
    voxels[2:6, 2:6, 2 : 2 + side] = 100
    return voxels


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two studies that are whole, and one that is not."""
    studies = tmp_path / "studies"
    (studies / "inner").mkdir(parents=True)
    write_nifti(studies / "first.nii", block(), np.eye(4))
    write_nifti(studies / "inner" / "scan.nii", block(5), np.eye(4))
    (studies / "broken.nii").write_bytes(b"no image")
    (studies / "notes.txt").write_text("no study")
    return studies


def batch(folder: Path, *options: str) -> int:
    return main(["reconstruct", str(folder), "--each", "-o", str(folder.parent / "out"), *OPTIONS, *options])


def table(folder: Path) -> list[dict[str, str]]:
    with (folder.parent / "out" / "reports.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def done(said: str) -> list[str]:
    """Return the studies that were reconstructed, by what was said."""
    return [line.split()[1].rstrip(":") for line in said.splitlines() if "component(s)" in line]


@pytest.mark.parametrize("options", [["--format", "3mf"], ["--format", "gii"], ["--flat-base", "5"]])
def test_what_has_no_voxels_is_refused_before_any_work(
    folder: Path, options: list[str], capsys: CaptureFixture[str]
) -> None:
    assert batch(folder, "--frame", "voxel", *options) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (folder.parent / "out").exists()


class TestBatch:
    def test_every_study_has_a_mesh_a_report_and_a_row(self, folder: Path, capsys: CaptureFixture[str]) -> None:
        assert batch(folder) == 10
        out = folder.parent / "out"
        names = {"first.stl", "first.json", "inner-scan.stl", "inner-scan.json", "reports.csv"}
        assert {path.name for path in out.iterdir()} == names
        rows = table(folder)
        assert [row["name"] for row in rows] == ["broken", "first", "inner-scan"]
        assert [row["exit_code"] for row in rows] == ["4", "0", "0"]
        for row in rows[1:]:
            mesh = trimesh.load(out / f"{row['name']}.stl")
            quality = json.loads((out / f"{row['name']}.json").read_text())["quality"]
            assert mesh.is_watertight
            assert int(row["faces"]) == len(mesh.faces)
            assert float(row["volume_mm3"]) == quality["volume_mm3"] == pytest.approx(mesh.volume)
            assert row["sound"] == "true"
        said = capsys.readouterr()
        assert "1/3 broken" in said.err
        *_, failed, error = said.err.splitlines()
        assert failed.startswith("failed    broken: the file is cut off.")
        assert failed.endswith(rows[0]["error"])
        assert error.startswith("error: 1 of 3 studies failed.")

    def test_each_mesh_is_that_of_the_study_alone(self, folder: Path, tmp_path: Path) -> None:
        batch(folder, "--format", "ply", "--quiet")
        alone = tmp_path / "alone.ply"
        assert main(["reconstruct", str(folder / "first.nii"), "-o", str(alone), *OPTIONS, "--quiet"]) == 0
        assert (tmp_path / "out" / "first.ply").read_bytes() == alone.read_bytes()

    def test_a_batch_without_failures_ends_well(self, folder: Path, capsys: CaptureFixture[str]) -> None:
        (folder / "broken.nii").unlink()
        assert batch(folder, "--quiet") == 0
        assert capsys.readouterr() == ("", "")

    def test_json_is_the_table(self, folder: Path, capsys: CaptureFixture[str]) -> None:
        batch(folder, "--json")
        assert [row["name"] for row in json.loads(capsys.readouterr().out)] == ["broken", "first", "inner-scan"]

    def test_a_fault_of_the_program_is_a_row_too(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        failing(monkeypatch, at=2, fault=ZeroDivisionError("oh"))
        assert batch(folder) == 10
        assert [row["exit_code"] for row in table(folder)] == ["4", "9", "0"]
        assert "ZeroDivisionError" in table(folder)[1]["error"]
        assert "Traceback" not in capsys.readouterr().err

    def test_one_study_is_held_at_a_time(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from tomomesh.cli import commands, sources

        held: list[weakref.ref[Any]] = []

        def watched(*arguments: Any) -> Any:
            gc.collect()
            assert not [volume for volume in held if volume() is not None]
            found = sources.read_study(*arguments)
            held.append(weakref.ref(found[0]))
            return found

        (folder / "broken.nii").unlink()
        monkeypatch.setattr(commands, "read_study", watched)
        assert batch(folder) == 0
        assert len(held) == 2


def failing(monkeypatch: pytest.MonkeyPatch, *, at: int, fault: BaseException) -> None:
    """Let the study with that number, from 1, raise a fault as it is reconstructed."""
    import tomomesh.pipeline

    reconstruct, calls = tomomesh.pipeline.reconstruct_once, []

    def some(*arguments: Any, **options: Any) -> Any:
        calls.append(1)
        if len(calls) == at:
            raise fault
        return reconstruct(*arguments, **options)

    monkeypatch.setattr(tomomesh.pipeline, "reconstruct_once", some)


def made_by(report: Path, version: str) -> None:
    """Let a report be of another version of the program."""
    told = json.loads(report.read_text())
    told["versions"]["tomomesh"] = version
    report.write_text(json.dumps(told))


class TestAgain:
    @pytest.mark.parametrize(
        ("options", "redone"),
        [([], []), (["--threads", "1"], []), (["--force"], ["first", "inner-scan"]),
         (["--lower", "20"], ["first", "inner-scan"]), (["--format", "obj"], ["first", "inner-scan"])],
    )  # fmt: skip
    def test_what_is_finished_is_passed_over(
        self, options: list[str], redone: list[str], folder: Path, capsys: CaptureFixture[str]
    ) -> None:
        batch(folder)
        capsys.readouterr()
        assert batch(folder, *options) == 10
        said = capsys.readouterr().out
        assert done(said) == redone
        assert said.count("finished before") == 3 - len(redone)  # the last line counts them too

    @pytest.mark.parametrize(
        "change",
        [
            lambda folder, out: write_nifti(folder / "first.nii", block(3), np.eye(4)),
            lambda folder, out: os.utime(folder / "first.nii", (1, 1)),
            lambda folder, out: (out / "first.stl").unlink(),
            lambda folder, out: (out / "first.json").unlink(),
            lambda folder, out: (out / "first.json").write_text("{}"),
            lambda folder, out: (out / "first.json").write_text("[1]"),
            lambda folder, out: made_by(out / "first.json", "0.0.1"),
            lambda folder, out: (out / "first.stl").write_bytes((out / "first.stl").read_bytes()[:-1] + b"!"),
        ],
        ids=["input", "time", "mesh", "report", "record", "no report", "version", "damage"],
    )
    def test_what_has_changed_is_done_again(
        self, change: Callable[[Path, Path], None], folder: Path, capsys: CaptureFixture[str]
    ) -> None:
        batch(folder)
        change(folder, folder.parent / "out")
        capsys.readouterr()
        batch(folder)
        assert done(capsys.readouterr().out) == ["first"]

    def test_the_table_is_the_same(self, folder: Path) -> None:
        batch(folder)
        path = folder.parent / "out" / "reports.csv"
        first = path.read_bytes()
        batch(folder)
        assert path.read_bytes() == first
        batch(folder, "--force")
        again = table(folder)
        path.write_bytes(first)
        assert [row | {"seconds": ""} for row in again] == [row | {"seconds": ""} for row in table(folder)]

    def test_an_interrupted_batch_keeps_what_is_done_and_goes_on(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        with monkeypatch.context() as patched:
            failing(patched, at=3, fault=KeyboardInterrupt())
            assert batch(folder) == 130
        assert {path.name for path in (folder.parent / "out").iterdir()} == {"first.stl", "first.json", "reports.csv"}
        assert [row["name"] for row in table(folder)] == ["broken", "first"]
        capsys.readouterr()
        assert batch(folder) == 10
        assert done(capsys.readouterr().out) == ["inner-scan"]
        assert [row["name"] for row in table(folder)] == ["broken", "first", "inner-scan"]


class TestUsage:
    @pytest.mark.parametrize("options", [["--points", "p.ply"], ["--report", "r.json"], ["--labels-in", "l.nii"]])
    def test_files_of_one_study_are_refused(
        self, options: list[str], folder: Path, capsys: CaptureFixture[str]
    ) -> None:
        assert batch(folder, *options) == 2
        assert options[0] in capsys.readouterr().err
        assert not (folder.parent / "out").exists()

    def test_the_folder_of_the_studies_is_no_place_for_results(self, folder: Path) -> None:
        assert main(["reconstruct", str(folder), "--each", "-o", str(folder)]) == 2
        assert main(["reconstruct", str(folder), "--each", "-o", "-"]) == 2
        assert main(["reconstruct", str(folder / "first.nii"), "-o", "m.stl", "--force"]) == 2

    def test_results_inside_of_the_folder_are_no_studies(self, folder: Path) -> None:
        line = ["reconstruct", str(folder), "--each", "-o", str(folder / "out"), *OPTIONS]
        assert main(line) == main(line) == 10
        assert [study.name for study in find_studies(folder, without=[folder / "out"])] == [
            "broken", "first", "inner-scan",
        ]  # fmt: skip

    def test_folders_without_studies_are_refused(self, folder: Path, tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        (tmp_path / "texts").mkdir()
        (tmp_path / "texts" / "a.txt").write_text("no study")
        for path, code in (("empty", 3), ("texts", 4), ("nowhere", 3), ("studies/first.nii", 4)):
            assert main(["reconstruct", str(tmp_path / path), "--each", "-o", str(tmp_path / "out")]) == code
        assert not (tmp_path / "out").exists()


class TestOptions:
    def test_each_is_a_parameter_refused_or_without_a_say_in_the_mesh(self) -> None:
        """A new option must be one of these, or a finished study would be taken for another one."""
        parameter = {entry.name for group, entry in parameters() if group != "cloud"}
        silent = {"help", "study", "output", "input_format", "format", "each", "force", "quiet", "json", "patient"}
        silent |= {"workers", "scheduler", "each_label", "label_names", "html"}
        kept_in_settings = {"auto", "paper", "settings", "save_settings"}
        (commands,) = (one for one in build_parser()._actions if isinstance(one, argparse._SubParsersAction))
        found = {action.dest for action in commands.choices["reconstruct"]._actions}
        assert found == parameter | set(SINGLE) | silent | kept_in_settings


class TestStudies:
    def test_each_series_of_a_folder_is_a_study_named_by_its_number(self, tmp_path: Path) -> None:
        def named(number: int) -> Callable[[Dataset, int], None]:
            def edit(data: Dataset, k: int) -> None:
                data.SeriesNumber, data.SeriesInstanceUID = number, f"1.2.{number}"
                data.SeriesDescription = "Secret^Name"

            return edit

        for number, side in ((1, 4), (7, 6)):
            write_series(tmp_path / "s" / "head" / f"{number}", block(side), np.eye(4), named(number))
        write_series(tmp_path / "s" / "one", block(), np.eye(4))
        studies = find_studies(tmp_path / "s")
        assert [(one.name, one.series) for one in studies] == [
            ("head-series-1", 1), ("head-series-2", 2), ("one", None),
        ]  # fmt: skip
        assert batch(tmp_path / "s") == 0
        volumes = [float(row["volume_mm3"]) for row in table(tmp_path / "s")]
        assert volumes[0] == volumes[2] < volumes[1]
        everything = b"".join(path.read_bytes() for path in (tmp_path / "out").iterdir())
        assert b"Secret" not in everything
        assert [one.name for one in find_studies(tmp_path / "s", series=2)] == ["head", "one"]

    def test_slices_in_a_sub_folder_are_one_study(self, tmp_path: Path) -> None:
        (tmp_path / "s" / "pages").mkdir(parents=True)
        for k, page in enumerate(block()):
            Image.fromarray(page).save(tmp_path / "s" / "pages" / f"{k}.png")
        assert [one.name for one in find_studies(tmp_path / "s")] == ["pages"]
        assert batch(tmp_path / "s", "--spacing", "1", "1", "1") == 0

    def test_names_that_would_meet_are_told_apart(self, tmp_path: Path) -> None:
        write_series(tmp_path / "a", block(), np.eye(4), slices=[0, 1])
        for name in ("a.nii", "A.nii.gz", "b.nii", "=sum(1).nii"):
            (tmp_path / name).write_bytes(b"?")
        assert [one.name for one in find_studies(tmp_path)] == ["_sum_1_", "A.nii.gz", "a", "a.nii", "b"]


class TestTable:
    def test_no_cell_is_a_formula(self, tmp_path: Path) -> None:
        for start in ("=1+1", "+1", "-1", "@x", "\t=x", "\r@x", "\n +x"):
            write_table([{"name": start, "number": -1.5, "none": None, "bad": float("nan")}],
                        ["name", "number", "none", "bad"], tmp_path / "t.csv")  # fmt: skip
            with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
                _, row = csv.reader(file)
            assert row == [f"'{start.strip()}", "-1.5", "", ""]
