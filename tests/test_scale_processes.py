"""Batches on workers of their own, as users and machines end them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from batches import OPTIONS, WAIT_S, as_alone, ball, batch, children_of, codes, table, until
from studies import write_nifti

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytest.importorskip("distributed", reason="the extra `scale` is not installed")
pytest.importorskip("cryptography", reason="the extra `scale` is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with distributed")
pytest.importorskip("resource", reason="workers are killed by signals, which this system lacks")


def line_of(process: Any) -> str:
    with suppress(psutil.Error):
        return " ".join(process.cmdline())
    return ""


def addresses(processes: list[Any]) -> set[str]:
    """Return where processes listen."""
    found = (one for process in processes for one in process.net_connections("inet"))
    return {one.laddr.ip for one in found if one.status == psutil.CONN_LISTEN}


class TestOwnWorkers:
    """The program with --workers, in a process of its own, as a user at a terminal starts it."""

    @pytest.fixture
    def many(self, tmp_path: Path) -> Path:
        made = tmp_path / "studies"
        made.mkdir()
        for number in range(12):
            write_nifti(made / f"s{number:02d}.nii", ball(30), np.eye(4))
        for name in ("temporary", "current"):
            (tmp_path / name).mkdir()
        return made

    @pytest.fixture
    def starting(self, many: Path) -> Iterator[subprocess.Popen[str]]:
        """Start a batch that SIGINT reaches: a shell's background jobs ignore it."""
        line = [sys.executable, "-m", "tomomesh", "reconstruct", str(many), "-o", str(many.parent / "out")]
        with subprocess.Popen(
            [*line, *OPTIONS, "--workers", "2"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            cwd=many.parent / "current", env={**os.environ, "TMPDIR": str(many.parent / "temporary")},
            start_new_session=True, preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
        ) as process:  # fmt: skip
            yield process
            process.kill()

    @pytest.fixture
    def started(self, starting: subprocess.Popen[str]) -> subprocess.Popen[str]:
        """Hand it over when the first study is done."""
        assert starting.stdout is not None
        assert "sound" in starting.stdout.readline()
        return starting

    def nothing_left(self, many: Path, processes: list[Any]) -> bool:
        """Tell whether processes are gone, and no file is left but whole results."""
        _, alive = psutil.wait_procs(processes, WAIT_S)
        until(lambda: not list((many.parent / "temporary").iterdir()))
        left = [path.name for path in (many.parent / "out").iterdir() if path.name.startswith(".")]
        return not alive and not left and not list((many.parent / "current").iterdir())

    def test_to_the_end(self, many: Path, started: subprocess.Popen[str]) -> None:
        workers = children_of(started)
        assert addresses([psutil.Process(started.pid), *workers]) == {"127.0.0.1"}
        said, heard = started.communicate(timeout=WAIT_S)
        assert started.returncode == 0, heard
        assert heard.splitlines()[0] == "waiting for workers"
        assert heard.splitlines()[1].startswith("headers    12/12")
        assert all(line.startswith("studies ") for line in heard.splitlines()[2:])
        assert said.count("sound") == 11
        assert self.nothing_left(many, workers)
        assert batch(many, "alone", "--quiet") == 0
        assert as_alone(many, "out")

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_stopped(self, many: Path, started: subprocess.Popen[str], number: int) -> None:
        workers = children_of(started)
        if number == signal.SIGINT:
            os.killpg(started.pid, number)  # a terminal sends it to all
        else:
            started.send_signal(number)
        _, heard = started.communicate(timeout=WAIT_S)
        assert started.returncode == (130 if number == signal.SIGINT else 143)
        assert "Traceback" not in heard
        assert "distributed" not in heard
        assert self.nothing_left(many, workers)
        assert 1 <= len(table(many, "out")) < 12
        assert set(codes(many, "out").values()) == {"0"}

    def test_stopped_while_workers_start(self, many: Path, starting: subprocess.Popen[str]) -> None:
        until(lambda: any("spawn_main" in line_of(child) for child in children_of(starting)))
        workers = children_of(starting)
        os.killpg(starting.pid, signal.SIGINT)
        _, heard = starting.communicate(timeout=WAIT_S)
        assert starting.returncode == 130
        assert heard.splitlines() == ["waiting for workers", "", "interrupted; no unfinished file is left"]
        (many.parent / "out").mkdir()  # it has not been made
        assert self.nothing_left(many, workers)

    def test_killed(self, many: Path, started: subprocess.Popen[str]) -> None:
        workers = children_of(started)
        started.kill()
        assert self.nothing_left(many, workers)
