"""Many studies on Dask workers: as one after the other, whatever becomes of workers, the scheduler and this process."""

from __future__ import annotations

import json
import os
import signal
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from batches import OPTIONS, SchedulerAndWorker, as_alone, ball, batch, codes, results, table
from studies import write_nifti
from tomomesh.cli import main

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture


dask = pytest.importorskip("dask", reason="the extra `scale` is not installed")
distributed = pytest.importorskip("distributed", reason="the extra `scale` is not installed")
pytest.importorskip("cryptography", reason="the extra `scale` is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with distributed")
resource = pytest.importorskip("resource", reason="workers are killed by signals, which this system lacks")

STUDIES, MANY = 3, 20


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Studies that are whole, and one that is not."""
    made = tmp_path / "studies"
    made.mkdir()
    for number in range(STUDIES):
        write_nifti(made / f"s{number}.nii", ball(14 + 2 * number), np.eye(4))
    (made / "broken.nii").write_bytes(b"no image")
    return made


def on(here: Any) -> list[str]:
    return ["--scheduler", here.scheduler_address]


class TestSame:
    def test_bytes_rows_and_their_order(self, folder: Path, here: Any, capsys: CaptureFixture[str]) -> None:
        assert batch(folder, "out", *on(here)) == 10
        assert as_alone(folder, "out")
        assert list(codes(folder, "out").values()) == ["4", "0", "0", "0"]
        said = capsys.readouterr()
        assert "broken: failed" in said.out
        assert said.out.count("sound") == STUDIES
        assert "studies    4/4" in said.err
        assert said.err.splitlines()[-1].startswith("error: 1 of 4 studies failed.")

    def test_files_are_named_as_they_were_typed(self, folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        """Workers of a cluster have another current folder."""
        monkeypatch.chdir(folder.parent)
        for out, options in (("alone", []), ("out", on(here))):
            assert main(["reconstruct", "studies", "-o", out, *OPTIONS, "--quiet", *options]) == 10
        assert as_alone(folder, "out")
        assert "File: studies/broken.nii " in table(folder, "out")[0]["error"]

    def test_a_scheduler_file(self, folder: Path, here: Any, tmp_path: Path) -> None:
        (tmp_path / "s.json").write_text(json.dumps({"type": "Scheduler", "address": here.scheduler_address}))
        assert batch(folder, "out", "--quiet", "--scheduler", str(tmp_path / "s.json")) == 10
        assert as_alone(folder, "out")

    def test_what_is_finished_is_passed_over(self, folder: Path, here: Any, capsys: CaptureFixture[str]) -> None:
        batch(folder, "out", "--quiet")
        before = results(folder, "out")
        capsys.readouterr()
        assert batch(folder, "out", *on(here)) == 10
        assert capsys.readouterr().out.count(": finished before") == STUDIES
        assert results(folder, "out") == before


def _killed_once(marker: Path) -> None:
    """Let the worker die as it has written its first file, under a hidden name, which its death leaves there."""
    if hasattr(os, "O_TMPFILE"):
        del os.O_TMPFILE
    synced = os.fsync

    def fsync(fd: Any) -> None:
        synced(fd)
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)

    os.fsync = fsync


class Poison(distributed.WorkerPlugin):  # type: ignore[misc, name-defined]
    """One study kills whichever worker takes it, the new ones too."""

    def __init__(self, name: str) -> None:
        self.study = name

    def setup(self, worker: Any) -> None:
        commands = vars(import_module("tomomesh.cli.commands"))
        self.read = commands["read_study"]
        commands["read_study"] = self.poisoned

    def poisoned(self, chosen: Any, *given: Any) -> Any:
        if Path(chosen.study).name == self.study:
            os.kill(os.getpid(), signal.SIGKILL)
        return self.read(chosen, *given)

    def teardown(self, worker: Any) -> None:
        vars(import_module("tomomesh.cli.commands"))["read_study"] = self.read


def _files_of(most: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


class TestFaults:
    def test_a_worker_that_is_killed_while_it_writes_costs_a_retry(
        self, folder: Path, here: Any, client: Any, capsys: CaptureFixture[str]
    ) -> None:
        client.run(_killed_once, folder.parent / "marker")
        assert batch(folder, "out", *on(here)) == 10
        assert (folder.parent / "marker").exists()
        assert as_alone(folder, "out")
        assert ": by itself, as its worker died" in capsys.readouterr().err

    def test_a_study_that_kills_every_worker_is_a_row(self, folder: Path, here: Any, client: Any) -> None:
        client.register_plugin(Poison("s1.nii"), name="poison")
        try:
            assert batch(folder, "out", "--quiet", *on(here)) == 10
        finally:
            client.unregister_worker_plugin("poison")
        assert codes(folder, "out") == {"broken": "4", "s0": "0", "s1": "7", "s2": "0"}
        assert "every worker that took it died" in table(folder, "out")[2]["error"]

    def test_a_full_disk_is_a_fault_of_its_study(self, folder: Path, here: Any, client: Any) -> None:
        write_nifti(folder / "s0.nii", ball(4), np.eye(4))
        batch(folder, "alone", "--quiet", "--no-remesh")
        sizes = [(folder.parent / "alone" / f"{name}.ply").stat().st_size for name in ("s0", "s1")]
        client.run(_files_of, sizes[1] - 1)
        try:
            assert batch(folder, "out", "--quiet", "--no-remesh", *on(here)) == 10
        finally:
            client.run(_files_of, resource.RLIM_INFINITY)
        assert codes(folder, "out") == {"broken": "4", "s0": "0", "s1": "8", "s2": "8"}
        assert {path.name for path in (folder.parent / "out").iterdir()} == {"s0.ply", "s0.json", "reports.csv"}

    def test_a_worker_of_another_version(self, folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.cli.spread.version", lambda name: "0.0.1")
        assert batch(folder, "out", "--quiet", *on(here)) == 10
        assert all("Expected: tomomesh 0.0.1." in row["error"] for row in table(folder, "out"))

    def test_a_worker_that_does_not_see_the_study(self, folder: Path, here: Any, client: Any) -> None:
        client.run(_blind, "s1.nii")
        try:
            assert batch(folder, "out", "--quiet", *on(here)) == 10
        finally:
            client.run(_blind, "")
        assert codes(folder, "out") == {"broken": "4", "s0": "0", "s1": "3", "s2": "0"}

    def test_the_table_stays_where_no_worker_comes(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        batch(folder, "out", "--quiet")
        before = table(folder, "out")
        monkeypatch.setattr("tomomesh.scale.cluster.ANSWER_S", 0.5)
        assert batch(folder, "out", "--quiet", "--scheduler", "tcp://127.0.0.1:1") == 3
        assert table(folder, "out") == before

    def test_a_scheduler_that_goes_away(
        self, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        from tomomesh.cli import summary

        for number in range(MANY):
            write_nifti(folder / f"t{number}.nii", ball(14), np.eye(4))
        with SchedulerAndWorker(tmp_path) as (scheduler, file):
            told = summary.of_row

            def and_away(place: str, row: dict[str, Any]) -> str:
                scheduler.kill()
                return told(place, row)

            monkeypatch.setattr(summary, "of_row", and_away)
            assert batch(folder, "out", "--scheduler", str(file)) == 10
        said = capsys.readouterr().err.splitlines()
        assert said[-1].startswith("error: the scheduler is gone. Try: the same command again")
        assert "distributed" not in "".join(said)
        assert 1 <= len(table(folder, "out")) < MANY


def _blind(name: str) -> None:
    """Let a worker not see a file of that name, as where a folder is not mounted."""
    import tomomesh.io.studies.folder as found
    from tomomesh.io.files.source import existing

    def seen(path: str | Path) -> Path:
        return existing(Path(path).with_name("nowhere") if Path(path).name == name else path)

    vars(found)["existing"] = seen


class TestUsage:
    @pytest.mark.parametrize(
        ("options", "code", "said"),
        [
            (["--force"], 2, "--force without --each"),
            (["--each", "--workers", "0"], 2, "--workers 0"),
            (["--each", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], 2, "--workers and --scheduler"),
            (["--each", "--scheduler", "tcp://127.0.0.1:1"], 3, "no scheduler answers there. File: tcp://127.0.0.1:1"),
            (["--each", "--scheduler", "no such thing"], 3, "no scheduler answers there"),
            (["--each", "--scheduler", __file__], 3, "no scheduler answers there"),
        ],
    )
    def test_refused_in_one_line(
        self, options: list[str], code: int, said: str, folder: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: CaptureFixture[str],
    ) -> None:  # fmt: skip
        monkeypatch.setattr("tomomesh.scale.cluster.ANSWER_S", 0.5)
        assert main(["reconstruct", str(folder), "-o", str(folder.parent / "out"), "--quiet", *options]) == code
        (line,) = capsys.readouterr().err.splitlines()
        assert said in line
        assert not (folder.parent / "out").exists()

    @pytest.mark.parametrize("options", [["--workers", "2"], ["--scheduler", "tcp://127.0.0.1:1"]])
    def test_without_dask_a_line_says_what_to_install(
        self, options: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        monkeypatch.setitem(sys.modules, "distributed", None)
        assert batch(folder, "out", "--quiet", *options) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert 'Try: pip install "tomomesh[scale]".' in line
