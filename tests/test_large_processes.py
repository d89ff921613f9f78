"""One study slab by slab on workers that end, or whose scheduler or user does: one line, and nothing is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from batches import WAIT_S, SchedulerAndWorker, children_of, until
from slab_studies import blobs
from studies import write_nifti
from tomomesh.cli import main
from tomomesh.cli.bars import Bars

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Process = subprocess.Popen[str]

pytest.importorskip("distributed", reason="the extra `scale` is not installed")
pytest.importorskip("cryptography", reason="the extra `scale` is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with distributed")
pytest.importorskip("resource", reason="workers are killed by signals, which this system lacks")

STOPPED = "interrupted; no unfinished file is left"


@pytest.fixture
def line(tmp_path: Path, folder: Path) -> list[str]:
    """Arguments of a run that takes some seconds, with a report."""
    write_nifti(tmp_path / "a.nii", blobs(5, (60, 50, 50)), np.eye(4))
    outputs = ["-o", str(folder / "a.ply"), "--report", str(folder / "a.json")]
    return ["reconstruct", str(tmp_path / "a.nii"), "--lower", "20", "--way", "voxels", "--slab", "6", *outputs]


class TestScheduler:
    @pytest.mark.parametrize("when", ["window", "fit", "checks", "write"])
    def test_that_goes_away(
        self, when: str, line: list[str], tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:  # fmt: skip
        with SchedulerAndWorker(tmp_path) as (scheduler, file):

            def and_away(bars: Bars, stage: str, done: int, total: int) -> None:
                if stage == when:
                    scheduler.kill()

            monkeypatch.setattr(Bars, "__call__", and_away)
            assert main([*line, "--scheduler", str(file), "--quiet"]) == 3
            assert scheduler.wait(WAIT_S) == -signal.SIGKILL
        (said,) = capsys.readouterr().err.splitlines()
        assert said == "error: the scheduler is gone. Try: the same command again, once there is one."
        assert not any(folder.iterdir())


class TestStopped:
    """The program in a process of its own, as a user at a terminal starts it."""

    @pytest.fixture
    def start(self, line: list[str], tmp_path: Path) -> Iterator[Callable[..., Process]]:
        """Hand over what starts it, so that SIGINT reaches it: a shell's background jobs ignore it."""
        begun: list[Process] = []
        (tmp_path / "temporary").mkdir()

        def started(*on: str) -> Process:
            begun.append(
                subprocess.Popen(
                    [sys.executable, "-m", "tomomesh", *line, *on], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                    text=True, env={**os.environ, "TMPDIR": str(tmp_path / "temporary")}, start_new_session=True,
                    preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
                )
            )  # fmt: skip
            return begun[0]

        yield started
        for process in begun:
            process.kill()
            process.communicate()

    def stopped(self, process: Process, number: int) -> list[str]:
        """Return what it says to a signal that reaches it and all that it has started, but for those of its own."""
        (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
        said, heard = process.communicate(timeout=WAIT_S)
        assert said == ""
        assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}.get(number, -number)  # type: ignore[call-overload]
        return [told for told in heard.splitlines() if told and told.split()[0] not in ("window", "fit")]

    def nothing_left(self, tmp_path: Path, processes: list[Any]) -> bool:
        _, alive = psutil.wait_procs(processes, WAIT_S)
        until(lambda: not list((tmp_path / "temporary").iterdir()))
        return not alive and not list((tmp_path / "out").iterdir())

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
    def test_with_workers_of_its_own(self, number: int, start: Any, tmp_path: Path) -> None:
        process = start("--workers", "2")
        until_line(process, "window")
        workers = children_of(process)
        assert len(workers) >= 2
        said = self.stopped(process, number)
        assert number == signal.SIGKILL or said == [STOPPED] * (number == signal.SIGINT)
        assert self.nothing_left(tmp_path, workers)

    def test_on_a_cluster_whose_workers_stay(self, start: Any, tmp_path: Path, here: Any) -> None:
        process = start("--scheduler", here.scheduler_address)
        until_line(process, "window")
        assert self.stopped(process, signal.SIGINT) == [STOPPED]
        until(lambda: not here.scheduler.tasks)
        assert len(here.scheduler.workers) == 2
        assert self.nothing_left(tmp_path, [])


class TestNoWorker:
    """A scheduler that waits for its first."""

    @pytest.fixture
    def waiting(self, line: list[str], tmp_path: Path) -> Iterator[tuple[Process, subprocess.Popen[bytes]]]:
        with SchedulerAndWorker(tmp_path, worker=False) as (scheduler, file):
            ours = [sys.executable, "-m", "tomomesh", *line, "--scheduler", str(file)]
            usual = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
            with subprocess.Popen(ours, stderr=subprocess.PIPE, text=True, preexec_fn=usual) as process:
                until_line(process, "waiting for workers")
                yield process, scheduler
                process.kill()

    def test_stopped(self, waiting: tuple[Process, Any], folder: Path) -> None:
        waiting[0].send_signal(signal.SIGINT)
        assert waiting[0].communicate(timeout=WAIT_S)[1].splitlines()[-1] == STOPPED
        assert waiting[0].returncode == 130
        assert not any(folder.iterdir())

    def test_whose_scheduler_goes_away(self, waiting: tuple[Process, Any], folder: Path) -> None:
        waiting[1].kill()
        (said,) = waiting[0].communicate(timeout=WAIT_S)[1].splitlines()
        assert said.startswith(("error: the scheduler is gone.", "error: no scheduler answers there."))
        assert waiting[0].returncode == 3
        assert not any(folder.iterdir())


def until_line(process: Process, begin: str) -> None:
    """Wait for a line on stderr."""
    assert process.stderr is not None
    while not (said := process.stderr.readline()).startswith(begin):
        assert said, "it has ended"
