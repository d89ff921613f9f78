"""What was likely meant: another command, another option, a label by its name."""

from __future__ import annotations

import gzip
import json
import re
import shlex
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest

from test_io_nrrd import BALL, CORE, SHELL, layered, segment
from tomomesh import io
from tomomesh.cli import main
from tomomesh.cli.options import build_parser
from tomomesh.cli.options.likely import COMMANDS, USUAL, likely_option

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TABLE = b"""<?xml version="1.0"?><CaretExtension><VolumeInformation Index="0"><LabelTable>
<Label Key="1" Red="0"><![CDATA[spleen]]></Label><Label Key="5" Red="1"><![CDATA[liver]]></Label>
</LabelTable></VolumeInformation></CaretExtension>"""


def ball() -> NDArray[np.uint8]:
    found = np.zeros((12, 12, 12), np.uint8)
    found[2:10, 2:10, 2:10] = 5
    found[0, 0, 0] = 1
    return found


@pytest.fixture
def named(tmp_path: Path) -> Path:
    image = nibabel.Nifti1Image(ball(), np.eye(4))
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, TABLE))
    nibabel.save(image, tmp_path / "seg.nii.gz")
    return tmp_path / "seg.nii.gz"


def said(line: str, code: int, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(shlex.split(line)) == code
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    return told[0]


class TestCommand:
    @pytest.mark.parametrize(
        ("line", "hint"),
        [
            ("reconstruct c.xyz -o m.stl", "tomomesh surface c.xyz -o mesh.stl"),
            ("inspect c.xyz", "tomomesh surface c.xyz"),
            ("segment c.xyz -o p.ply", "tomomesh surface c.xyz"),
            ("surface v.nii.gz -o m.stl", "tomomesh reconstruct v.nii.gz -o mesh.stl"),
            ("surface slices -o m.stl", "tomomesh reconstruct slices"),
            ("check v.nii.gz", "tomomesh reconstruct v.nii.gz"),
            ("print v.nii.gz -o m.stl", "tomomesh reconstruct v.nii.gz"),
        ],
    )
    def test_that_reads_the_file_is_named(
        self, line: str, hint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "c.xyz").write_text("0 0 0\n1 1 1\n")
        (tmp_path / "v.nii.gz").write_bytes(gzip.compress(b""))
        (tmp_path / "slices").mkdir()
        assert f"Try: {hint}" in said(line, 4, capsys)

    @pytest.mark.parametrize(
        ("word", "hint"),
        [("reconstrct", "tomomesh reconstruct"), ("convert", "tomomesh reconstruct"), ("poisson", "surface")],
    )
    def test_is_found_by_what_is_like_it(self, word: str, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert hint in said(f"{word} a b", 2, capsys).split("Try: ")[1]

    def test_of_a_file_alone(self, named: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert f"Try: tomomesh reconstruct {named} -o mesh.stl" in said(str(named), 2, capsys)

    def test_nothing_is_said_of_what_is_like_nothing(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert "Try: `tomomesh --help`" in said("qqqqq", 2, capsys)


class TestOption:
    @pytest.mark.parametrize(
        ("asked", "meant"),
        [
            ("--threshold 300", "--lower 300"),
            ("--isovalue=300", "--lower=300"),
            ("--smoothing 2", "--smooth 2"),
            ("--decimate 1000", "--target-faces 1000"),
            ("--label 5", "--select 5"),
            ("--presett bone", "--preset bone"),
            ("--target_faces 100", "--target-faces 100"),
            ("--organ 5", "--select 5"),
            ("--seg s.nii", "--labels-in s.nii"),
            ("--spacing-xy 1", "--spacing 1"),
            ("--window 300", "--lower 300"),
            ("-q", "--quiet"),
        ],
    )
    def test_is_found_by_its_usual_name(self, asked: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
        told = said(f"reconstruct a.nii -o m.stl {asked}", 2, capsys)
        assert told.endswith(f"Try: {meant}.")

    @pytest.mark.parametrize("option", ["--threshold 3", "--iso 3", "--hu 3", "--window 3", "--seg s.nii"])
    def test_of_another_command_is_not_named(self, option: str, capsys: pytest.CaptureFixture[str]) -> None:
        """Nor one that only shares letters with it, as --json with --iso."""
        assert said(f"surface a.xyz -o m.stl {option}", 2, capsys).endswith("Try: `tomomesh surface --help`.")

    @pytest.mark.parametrize("option", ["--workers 2", "--scheduler=tcp://127.0.0.1:1", "--slab 5"])
    def test_of_large_studies_has_another_for_clouds(self, option: str, capsys: pytest.CaptureFixture[str]) -> None:
        told = said(f"surface a.las -o m.stl {option}", 2, capsys)
        assert told.endswith("Try: --memory SIZE, as 4GB: one process takes the cloud.")
        assert said(f"check m.stl {option}", 2, capsys).endswith("Try: `tomomesh check --help`.")

    @pytest.mark.parametrize(
        ("line", "hint"),
        [
            ("reconstruct a.nii --out m.stl", "--output m.stl"),
            ("reconstruct a.nii --outfile=m.stl", "--output=m.stl"),
            ("reconstruct a.nii m.stl", "-o m.stl"),
            ("surface a.xyz m.PLY", "-o m.PLY"),
            ("surface --depth 8 a.xyz", "`tomomesh surface --help`"),
            ("--threshold 300 a.nii", "`tomomesh --help`"),
        ],
    )
    def test_of_an_output_that_is_missing_or_before_the_command(
        self, line: str, hint: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert said(line, 2, capsys).endswith(f"Try: {hint}.")

    @pytest.mark.parametrize("command", sorted(build_parser().commands))
    def test_the_help_fits_into_eighty_columns(
        self, command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setenv("COLUMNS", "80")
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out.splitlines()
        assert told[0].startswith(f"usage: tomomesh {command} ")
        assert max(map(len, told)) <= 80
        choices = [one.choices for one in build_parser().commands[command]._actions if one.choices]
        words = set(re.split(r"[\s,{}().:;]+", " ".join(told)))
        assert {str(one) for several in choices for one in several if "." not in str(one)} <= words

    def test_the_tables_name_what_there_is(self) -> None:
        commands = build_parser().commands
        options = {option for one in commands.values() for option in one._option_string_actions}
        assert {f"--{name}" for name in USUAL} <= options
        assert set(COMMANDS) <= set(commands)
        usual = {other for others in USUAL.values() for other in others}
        assert not {f"--{other}" for other in usual} & set(commands["reconstruct"]._option_string_actions)
        for called, command in commands.items():
            known = [others for name, others in USUAL.items() if f"--{name}" in command._option_string_actions]
            twice = {other for other in usual if sum(other in others for others in known) > 1}
            assert twice == ({"organ"} if called == "view" else set())  # it opens label maps, and structures too
        assert likely_option("--organ", [*commands["view"]._option_string_actions]) == "--select"


class TestLabels:
    def test_by_name(self, named: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert io.label_names(named) == {1: "spleen", 5: "liver"}
        for label in ("liver", "5", "Liver"):
            line = f"reconstruct --labels-in {named} --select {label} -o {tmp_path}/{label}.stl"
            assert main(line.split()) == 0
            assert "label(s) 5" in capsys.readouterr().out
        assert (tmp_path / "liver.stl").read_bytes() == (tmp_path / "5.stl").read_bytes()

    def test_a_name_like_it_is_named(self, named: Path, capsys: pytest.CaptureFixture[str]) -> None:
        told = said(f"reconstruct {named} -o m.stl --select livr", 2, capsys)
        assert "liver (5)" in told.split("Try: ")[1]

    def test_without_names(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        nibabel.save(nibabel.Nifti1Image(ball(), np.eye(4)), tmp_path / "plain.nii")
        told = said(f"reconstruct {tmp_path}/plain.nii -o m.stl --select liver", 2, capsys)
        assert "names none of its labels" in told
        assert "tomomesh inspect" in told

    @pytest.mark.parametrize("labels", [(1, 7), (1, 1)])
    def test_of_a_segmentation_by_slicer_whose_layers_share_labels(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], labels: tuple[int, int]
    ) -> None:
        told = segment(0, "Whole ball", labels[0], 0) | segment(1, "core", labels[1], 1)
        path = layered(tmp_path / "s.seg.nrrd", [BALL * labels[0], CORE * labels[1]], **told)
        number = labels[1] if labels[1] > 1 else 2
        assert io.label_names(path) == {1: "Whole ball", number: "core"}
        for name, mask in (("whole_ball", BALL), ("CORE", CORE)):
            line = f"reconstruct {path} --select {name} -o {tmp_path}/m.stl --report {tmp_path}/r.json --way voxels"
            assert main(line.split()) == 0
            report = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
            assert report["window"]["window_voxels"] == np.count_nonzero(mask)

    def test_that_two_have_is_no_label(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        told = segment(0, "rib", 1, 0) | segment(1, "rib", 2, 0)
        path = layered(tmp_path / "s.seg.nrrd", [SHELL + 2 * CORE], **told)
        assert "rib (1), rib (2)" in said(f"reconstruct {path} -o m.stl --select rib", 2, capsys)
