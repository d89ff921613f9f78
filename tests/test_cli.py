"""The door: commands, options, exit codes, what is written and what is said."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import trimesh

from studies import write_nifti
from test_end_to_end import ball
from tomomesh.cli import main
from tomomesh.settings import Settings, option_of, parameters

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture

COMMANDS = ("demo", "reconstruct", "segment", "surface", "network", "inspect", "check")
ERROR = re.compile(r"^error: .+\. ?(File: .+\.)? ?(Found: .+\.)? ?(Expected: .+\.)? ?(Try: .+\.)?$")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A ball of 100 in 0, as NIfTI."""
    path = tmp_path / "ball.nii"
    write_nifti(path, ball(), np.eye(4))
    return path


def fails(arguments: list[str], code: int, capsys: CaptureFixture[str]) -> str:
    """Run a command that must fail cleanly, and return its line."""
    assert main(arguments) == code
    *stages, said = capsys.readouterr().err.splitlines()
    assert not any("error" in stage for stage in stages)
    assert ERROR.match(said), said
    assert "Traceback" not in said
    return said


class TestHelp:
    @pytest.mark.parametrize("arguments", [["--help"], *([name, "--help"] for name in COMMANDS)])
    def test_help_is_grouped_and_names_every_option(self, arguments: list[str], capsys: CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as left:
            main(arguments)
        assert left.value.code == 0
        text = capsys.readouterr().out
        assert all(name in text for name in (COMMANDS if arguments == ["--help"] else ["usage"]))

    def test_every_parameter_has_an_option_with_unit_and_default(self, capsys: CaptureFixture[str]) -> None:
        for command in ("reconstruct", "surface"):
            with pytest.raises(SystemExit):
                main([command, "--help"])
        text = " ".join(capsys.readouterr().out.split())
        for _, entry in parameters():
            assert option_of(entry.name) in text or option_of(f"no_{entry.name}") in text
            assert entry.metadata["unit"] in text

    def test_help_imports_nothing_heavy(self) -> None:
        code = "import sys; sys.argv = ['tomomesh', '--help']\ntry: import tomomesh.cli; tomomesh.cli.main()\n"
        code += "except SystemExit: pass\nprint(sorted({'numpy', 'numba', 'scipy', 'matplotlib'} & set(sys.modules)))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == "[]"


class TestReconstruct:
    def test_everything_is_written_and_read_back(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        out = {name: str(tmp_path / name) for name in ("m.stl", "p.ply", "l.nii.gz", "r.json", "s.toml", "figures")}
        assert main([
            "reconstruct", str(study), "-o", out["m.stl"], "--points", out["p.ply"], "--labels", out["l.nii.gz"],
            "--report", out["r.json"], "--save-settings", out["s.toml"], "--figures", out["figures"],
        ]) == 0  # fmt: skip
        assert trimesh.load(out["m.stl"]).is_watertight
        assert Path(out["m.stl"]).read_bytes()[:80].startswith(b"tomomesh")
        report = json.loads(Path(out["r.json"]).read_text())
        assert len(trimesh.load(out["p.ply"]).vertices) == report["points"]["count"]
        labels, source = nibabel.load(out["l.nii.gz"]), nibabel.load(study)
        np.testing.assert_allclose(labels.affine, source.affine)
        labelled, kept = np.asarray(labels.dataobj) > 0, np.asarray(source.dataobj) > 50
        without = report["networks"]["slices_without"]
        assert not labelled[..., without].any()
        assert (np.delete(labelled, without, axis=2) == np.delete(kept, without, axis=2)).all()
        assert tomllib.loads(Path(out["s.toml"]).read_text()) == Settings().to_dict()
        drawn = {path.stem for path in Path(out["figures"]).glob("*.png")}
        assert len(drawn) == 11
        assert {"06-slices-1", "12-outlines-1"} < drawn
        said = capsys.readouterr().out
        assert "Otsu" in said
        assert len(said.splitlines()) <= 15

    def test_settings_repeat_a_run_byte_for_byte(self, study: Path, tmp_path: Path) -> None:
        first, second, kept = (tmp_path / name for name in ("1.ply", "2.ply", "s.toml"))
        options = ["--neurons", "40", "--training", "online", "--iterations", "500", "--seed", "3", "--quiet"]
        assert main(["reconstruct", str(study), "-o", str(first), *options, "--save-settings", str(kept)]) == 0
        assert main(["reconstruct", str(study), "-o", str(second), "--settings", str(kept), "--quiet"]) == 0
        assert first.read_bytes() == second.read_bytes()

    def test_options_win_over_the_file_and_the_file_over_the_paper(self, tmp_path: Path) -> None:
        from tomomesh.cli.commands import settings_of
        from tomomesh.cli.options import build_parser

        file = tmp_path / "s.toml"
        file.write_text("[network]\nneurons = 33\nstart = 'ellipse'\n")
        line = ["reconstruct", "x.nii", "-o", "m.stl", "--paper", "--settings", str(file), "--neurons", "44"]
        found = settings_of(build_parser().parse_args(line))
        assert found.network.neurons == 44
        assert found.network.start == "ellipse"
        assert found.network.training == "online"

    def test_json_is_the_report(self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert main(["reconstruct", str(study), "-o", str(tmp_path / "m.obj"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["quality"]["sound"]

    def test_other_topologies_run(self, study: Path, tmp_path: Path) -> None:
        for network in ("chain", "grid"):
            output = tmp_path / f"{network}.ply"
            line = ["reconstruct", str(study), "-o", str(output), "--network", network, "--allow-leaks", "--quiet"]
            assert main(line) == 0
            assert trimesh.load(output).is_watertight


class TestOtherCommands:
    def test_demo_writes_its_folder(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        folder = tmp_path / "demo"
        assert main(["demo", "-o", str(folder)]) == 0
        names = {"mesh.stl", "points.ply", "labels.nii.gz", "truth.ply", "report.json", "settings.toml", "figures"}
        names |= {"report.html"}
        assert {path.name for path in folder.iterdir()} == names
        assert trimesh.load(folder / "truth.ply").is_volume
        assert "truth" in json.loads((folder / "report.json").read_text())
        said = capsys.readouterr().out
        assert len(said.splitlines()) <= 15
        assert re.search(r"error: mean 0\.\d+ mm", said)

    def test_segment_then_surface(self, study: Path, tmp_path: Path) -> None:
        points, mesh = tmp_path / "p.ply", tmp_path / "m.stl"
        assert main(["segment", str(study), "-o", str(points), "--quiet"]) == 0
        assert main(["surface", str(points), "-o", str(mesh), "--quiet", "--cell-mm", "5"]) == 0
        assert trimesh.load(mesh).is_watertight

    @pytest.mark.parametrize("region", ["square", "triangle", "cube"])
    def test_network_draws_a_region(self, region: str, tmp_path: Path) -> None:
        network = "grid" if region == "cube" else "ring"
        line = ["network", region, "-o", str(tmp_path / "n"), "--network", network, "--neurons", "50", "--quiet"]
        assert main(line) == 0
        maps = {"02-maps.png"} if network == "grid" else set()
        assert {path.name for path in (tmp_path / "n").iterdir()} == {
            "01-topologies.png", "02-network.png", "02-learning.png", *maps,
        }  # fmt: skip

    def test_network_tells_its_warnings(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        line = ["network", "square", "-o", str(tmp_path / "n"), "--network", "grid", "--neurons", "37"]
        assert main([*line, "--radius", "1,4"]) == 0
        told = capsys.readouterr().out
        assert "the radius rises from 1 to 4" in told
        assert "37 neurons make no grid" in told

    def test_inspect_suggests_windows(self, study: Path, capsys: CaptureFixture[str]) -> None:
        assert main(["inspect", str(study)]) == 0
        assert "otsu: k >" in capsys.readouterr().out
        assert main(["inspect", str(study), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["slices_rows_columns"] == [40, 48, 44]

    def test_check_takes_the_lining_of_a_cavity_for_sound(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        inner = trimesh.creation.icosphere(2, radius=0.5)
        inner.invert()
        trimesh.util.concatenate([trimesh.creation.icosphere(2), inner]).export(tmp_path / "shell.stl")
        assert main(["check", str(tmp_path / "shell.stl"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["sound"]
        inner.apply_translation([5, 0, 0])
        trimesh.util.concatenate([trimesh.creation.icosphere(2), inner]).export(tmp_path / "apart.stl")
        assert main(["check", str(tmp_path / "apart.stl"), "--json"]) == 0
        assert not json.loads(capsys.readouterr().out)["sound"]

    def test_check_judges_good_and_bad_meshes(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        sphere = trimesh.creation.icosphere(2)
        sphere.export(tmp_path / "good.ply")
        trimesh.Trimesh(sphere.vertices, sphere.faces[1:]).export(tmp_path / "bad.ply")
        assert main(["check", str(tmp_path / "good.ply"), "--against", str(tmp_path / "good.ply")]) == 0
        said = capsys.readouterr().out
        assert "closed, manifold, outward" in said
        assert "against   the other: Dice 1.0000" in said
        assert re.search(r"mean +95 % +largest\n +to the other +(0|\d(\.\d+)?e-\d+) ", said)
        assert main(["check", str(tmp_path / "bad.ply")]) == 0
        assert "NOT sound: 3 boundary edges" in capsys.readouterr().out


class TestFaults:
    def test_usage(self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        mesh = str(tmp_path / "m.stl")
        for line, named in [
            ([], "COMMAND"),
            (["reconstruct", str(study)], "--output"),
            (["reconstruct", str(study), "-o", mesh, "--neurons", "2"], "--neurons"),
            (["reconstruct", str(study), "-o", mesh, "--neurons", "many"], "--neurons"),
            (["reconstruct", str(study), "-o", mesh, "--lower", "5", "--upper", "5"], "lower < upper"),
            (["reconstruct", str(study), "-o", mesh, "--lower", "5", "--auto"], "--auto"),
            (["reconstruct", str(study), "-o", mesh, "--step", "1.5"], "--step"),
            (["reconstruct", str(study), "-o", mesh, "--cell-mm", "0"], "--cell-mm"),
            (["reconstruct", str(study), "-o", mesh, "--cell-mm", "nan"], "--cell-mm"),
            (["reconstruct", str(study), "-o", str(tmp_path / "m.xyz"),], "suffix"),
            (["reconstruct", str(study), "-o", mesh, "--preset", "bone"], "Hounsfield"),
        ]:  # fmt: skip
            assert named in fails(line, 2, capsys)
            assert not Path(mesh).exists()

    def test_missing_and_broken_files(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        mesh = str(tmp_path / "m.stl")
        assert "nowhere.nii" in fails(["reconstruct", str(tmp_path / "nowhere.nii"), "-o", mesh], 3, capsys)
        (tmp_path / "text").mkdir()
        (tmp_path / "text" / "a.txt").write_text("no image")
        assert "0 of 1" in fails(["reconstruct", str(tmp_path / "text"), "-o", mesh], 4, capsys)
        (tmp_path / "c.xyz").write_text("1 2 3\n4 5\n")
        fails(["surface", str(tmp_path / "c.xyz"), "-o", mesh], 4, capsys)
        assert not Path(mesh).exists()

    def test_outputs_are_refused_before_any_work(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        fails(["reconstruct", str(study), "-o", str(tmp_path / "no" / "m.stl")], 8, capsys)
        fails(["reconstruct", "nowhere.nii", "-o", str(tmp_path / "no" / "m.stl")], 8, capsys)
        fails(["reconstruct", str(study), "-o", str(tmp_path / "m.stl"), "--report", "no/r.json"], 8, capsys)

    def test_two_outputs_of_one_name_are_refused(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        mesh = str(tmp_path / "same.ply")
        fails(["reconstruct", str(study), "-o", mesh, "--points", mesh], 2, capsys)
        assert not Path(mesh).exists()

    def test_one_or_three_edges_may_stand_before_the_study(self, study: Path, tmp_path: Path) -> None:
        for edges in (["4"], ["3", "4", "5"]):
            output = tmp_path / "m.stl"
            assert main(["reconstruct", "--cell-mm", *edges, str(study), "-o", str(output), "--quiet"]) == 0
            assert trimesh.load(output).is_watertight

    def test_an_unknown_region_names_those_there_are(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert "triangle" in fails(["network", "hexagon", "-o", str(tmp_path / "n")], 3, capsys)
        assert not (tmp_path / "n").exists()

    def test_an_empty_window_is_told_with_the_datas_range(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.stl"), "--lower", "500"]
        assert "between 0 and 100" in fails(line, 6, capsys)

    def test_cells_too_small_name_the_smallest(self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.stl"), "--cell-mm", "1e-7"]
        assert "at least" in fails(line, 7, capsys)

    def test_a_bug_is_one_line_without_a_path(
        self, study: Path, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        from tomomesh.cli import commands

        def broken(chosen: object) -> None:
            raise ZeroDivisionError("oh")

        monkeypatch.setitem(commands._COMMANDS, "inspect", broken)
        said = fails(["inspect", str(study)], 9, capsys)
        assert "ZeroDivisionError" in said
        assert str(Path(__file__).parent) not in said

    def test_the_handlers_of_whoever_calls_stay(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As in a server or a notebook, whether it ends well, in an error, by a signal or beside the main thread."""
        from tomomesh.cli import commands

        heard: list[int] = []
        handlers: dict[int, Any] = {
            signal.SIGTERM: lambda number, frame: heard.append(number), signal.SIGINT: signal.SIG_IGN,
        }  # fmt: skip
        before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        try:
            codes = [main(["inspect", str(study)]), main(["inspect", str(tmp_path / "gone")])]
            with ThreadPoolExecutor(1) as pool:
                codes.append(pool.submit(main, ["inspect", str(study)]).result())
            killed = {"inspect": lambda chosen: signal.raise_signal(signal.SIGTERM)}
            monkeypatch.setattr(commands, "_COMMANDS", killed)
            codes.append(main(["inspect", str(study)]))
            assert codes == [0, 3, 0, 143]
            assert {number: signal.getsignal(number) for number in handlers} == handlers
            signal.raise_signal(signal.SIGTERM)
            assert heard == [signal.SIGTERM]
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    @pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
    def test_signals_leave_nothing_behind(self, number: int, code: int, study: Path, tmp_path: Path) -> None:
        folder = tmp_path / "out"
        folder.mkdir()
        line = [
            "reconstruct",
            str(study),
            "-o",
            str(folder / "m.stl"),
            "--max-steps",
            "100000000",
            "--tolerance",
            "1e-30",
        ]
        ready = tmp_path / "ready"
        program = (
            "import sys, pathlib, signal, tomomesh.dynamics.moving_least_squares as d, tomomesh.cli as c\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background jobs ignore it
            f"def slow(self, motion, count): pathlib.Path({str(ready)!r}).touch(); return False\n"
            "d._ProjectionSteps.rested = slow\n"
            f"sys.exit(c.main({line!r}))"
        )
        running = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, env=os.environ)
        while not ready.exists():
            assert running.poll() is None, running.communicate()
            time.sleep(0.01)
        running.send_signal(number)
        _, said = running.communicate(timeout=60)
        assert running.returncode == code
        assert b"Traceback" not in said
        assert list(folder.iterdir()) == []
