"""Names, folders and languages that a careless program stumbles over: FAULTS rows 35, 39 and 40."""

from __future__ import annotations

import locale
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from conftest import sphere
from doors import as_program, contents, refused
from studies import write_nifti
from test_faults_studies import AFFINE, ball
from tomomesh.cli import main

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture

ODD = ["ein Köpfchen", "頭 蓋", "a'b\"c$d", "-o", "%s%n", "x" * 200, "tab\there", "line\nbreak", "\x1b[31mred\x1b[0m"]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return write_nifti(tmp_path / "s.nii", ball(AFFINE), AFFINE)


class TestOutputs:
    """Row 35: refused before any work, which a study that is not there would betray."""

    @pytest.mark.parametrize(
        ("output", "code"),
        [("no/m.stl", 8), ("m.vtk", 2), ("m", 2), ("m.stl.gz", 2), ("folder.stl", 8), ("file/m.stl", 8)],
    )
    @pytest.mark.parametrize("command", ["reconstruct", "surface"])
    def test_what_cannot_be_written(
        self, tmp_path: Path, capsys: CaptureFixture[str], command: str, output: str, code: int
    ) -> None:
        (tmp_path / "folder.stl").mkdir()
        (tmp_path / "file").touch()
        refused([command, str(tmp_path / "none.nii"), "-o", str(tmp_path / output)], code, tmp_path, capsys)

    def test_the_output_is_never_the_input(self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        again = f"{tmp_path}/../{tmp_path.name}/s.nii"
        for line in (
            ["segment", str(study), "-o", str(tmp_path / "p.ply"), "--labels", str(study)],
            ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--points", str(tmp_path / "m.ply")],
            ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--labels", again],
        ):  # fmt: skip
            refused(line, 2, tmp_path, capsys)

    @pytest.mark.skipif(not hasattr(os, "geteuid"), reason="there are no permissions here")
    def test_a_folder_that_may_not_be_written_to(
        self, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "closed").mkdir(mode=0o500)
        if os.geteuid() == 0:  # root may write anywhere
            monkeypatch.setattr(os, "access", lambda path, mode: "closed" not in str(path))
        line = ["reconstruct", str(tmp_path / "none.nii"), "-o", str(tmp_path / "closed" / "m.stl")]
        assert "may not be written" in refused(line, 8, tmp_path, capsys)


class TestNames:
    """Rows 39 and 40."""

    @pytest.mark.parametrize("name", ODD, ids=map(ascii, range(len(ODD))))
    def test_any_name_works_and_none_reaches_the_terminal_raw(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str], name: str
    ) -> None:
        folder = tmp_path / name
        folder.mkdir()
        moved, mesh = study.rename(folder / f"{name[:50]}.nii"), folder / f"{name[:50]}.stl"
        line = ["reconstruct", str(moved), "-o", str(mesh), "--lower", "50", "--report", str(folder / "r.json")]
        assert main(line) == 0
        assert trimesh.load(mesh).is_watertight
        said = capsys.readouterr()
        assert all(one.isprintable() for one in (said.out + said.err).splitlines())
        moved.write_bytes(b"broken")
        refused(line, 4, tmp_path, capsys)

    def test_a_name_that_is_no_text(self, study: Path, tmp_path: Path) -> None:
        """Bytes that are no UTF-8, in a terminal that knows ASCII alone."""
        folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe \xe9"))
        try:
            folder.mkdir()
        except OSError:
            pytest.skip("this file system takes no such name")
        done = as_program(
            ["reconstruct", str(study), "-o", str(folder / "m.ply"), "--lower", "50"],
            env={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"},
        )
        assert done.returncode == 0, done.stderr
        assert (folder / "m.ply").exists()


def test_a_decimal_comma_changes_nothing(study: Path, tmp_path: Path) -> None:
    """Row 40: what the locale does to C's numbers must reach neither what is read nor what is written."""
    text = tmp_path / "c.xyz"
    np.savetxt(text, sphere(600) * 0.01 + [1.5, 2.25, 0.125])
    before = locale.setlocale(locale.LC_ALL)
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE.utf8", "C"):
        try:
            locale.setlocale(locale.LC_ALL, name)
        except locale.Error:
            continue
        break
    commas = name if name != "C" else None
    try:
        lines = [
            ["reconstruct", str(study), "-o", str(tmp_path / "m.obj"), "--lower", "50.5", "--quiet"],
            ["segment", str(study), "-o", str(tmp_path / "p.csv"), "--lower", "50.5", "--quiet"],
            ["surface", str(text), "-o", str(tmp_path / "c.off"), "--quiet"],
        ]
        assert [main(line) for line in lines] == [0, 0, 0]
    finally:
        locale.setlocale(locale.LC_ALL, before)
    with_commas = {path: value for path, value in contents(tmp_path).items() if path.endswith((".obj", ".csv", ".off"))}
    assert [main(line) for line in lines] == [0, 0, 0]
    plain = contents(tmp_path)
    assert all(value[0] == plain[path][0] for path, value in with_commas.items())  # type: ignore[index]
    if commas is None:
        pytest.skip("no locale with a decimal comma is installed: tried without")
