"""Many studies on Dask workers: as one after the other, whatever becomes of workers, the scheduler and this process."""

from __future__ import annotations

import csv
import json
import logging
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from studies import write_nifti
from tomomesh.cli import main
from tomomesh.kernels.threads import cores
from tomomesh.scale.cluster import Cluster
from tomomesh.scale.tasks import Tasks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from _pytest.capture import CaptureFixture

    from tomomesh.scale.tasks import Told

dask = pytest.importorskip("dask", reason="the extra `scale` is not installed")
distributed = pytest.importorskip("distributed", reason="the extra `scale` is not installed")
pytest.importorskip("cryptography", reason="the extra `scale` is not installed")
psutil = pytest.importorskip("psutil", reason="it comes with distributed")
resource = pytest.importorskip("resource", reason="workers are killed by signals, which this system lacks")

OPTIONS = ["--each", "--lower", "50", "--format", "ply"]
STUDIES, MANY = 3, 20
WAIT_S = 60.0
"""Most that processes may take to end on a busy machine."""


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Two worker processes on loopback; one death is enough for Dask to hand a task back."""
    settings = {
        "distributed.scheduler.allowed-failures": 0,
        "distributed.scheduler.worker-saturation": 1.0,
        "temporary-directory": str(tmp_path_factory.mktemp("scratch")),
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", memory_limit=0,
            silence_logs=logging.CRITICAL, dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},
        ) as made,
    ):  # fmt: skip
        yield made


@pytest.fixture
def client(here: Any) -> Iterator[Any]:
    with distributed.Client(here, set_as_default=False) as made:
        made.wait_for_workers(2)
        yield made


def ball(side: int) -> Any:
    """Return a ball of 100 in 0."""
    k, j, i = (axis - (side - 1) / 2 for axis in np.ogrid[:side, :side, :side])
    return np.where(k**2 + j**2 + i**2 < (0.35 * side) ** 2, 100, 0).astype(np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Studies that are whole, and one that is not."""
    made = tmp_path / "studies"
    made.mkdir()
    for number in range(STUDIES):
        write_nifti(made / f"s{number}.nii", ball(14 + 2 * number), np.eye(4))
    (made / "broken.nii").write_bytes(b"no image")
    return made


def batch(folder: Path, out: str, *options: str) -> int:
    return main(["reconstruct", str(folder), "-o", str(folder.parent / out), *OPTIONS, *options])


def on(here: Any) -> list[str]:
    return ["--scheduler", here.scheduler_address]


def table(folder: Path, out: str) -> list[dict[str, str]]:
    """Return the rows of a table, without what is about time."""
    with (folder.parent / out / "reports.csv").open(newline="", encoding="utf-8") as file:
        return [row | {"seconds": ""} for row in csv.DictReader(file)]


def codes(folder: Path, out: str) -> dict[str, str]:
    return {row["name"]: row["exit_code"] for row in table(folder, out)}


def results(folder: Path, out: str) -> dict[str, object]:
    """Return what a batch has left: bytes of meshes, reports without what is about time, and names of all else."""
    found: dict[str, object] = {}
    for path in sorted((folder.parent / out).iterdir()):
        found[path.name] = path.read_bytes() if path.suffix == ".ply" else None
        if path.suffix == ".json":
            report = json.loads(path.read_text())
            del report["timings"], report["batch"]["seconds"]
            found[path.name] = report
    return found


def as_alone(folder: Path, out: str) -> bool:
    """Tell whether a batch has left the very same as one that does one study after the other."""
    if not (folder.parent / "alone").exists():
        assert batch(folder, "alone", "--quiet") == 10
    return results(folder, out) == results(folder, "alone") and table(folder, out) == table(folder, "alone")


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
        with scheduler_and_worker(tmp_path) as (scheduler, file):
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


class scheduler_and_worker:  # noqa: N801
    """A scheduler and a worker of its own, in processes that can be killed."""

    def __init__(self, folder: Path) -> None:
        self._file, self._env = folder / "scheduler.json", {**os.environ, "TMPDIR": str(folder)}
        common = ["--scheduler-file", str(self._file), "--no-dashboard"]
        self._lines = (
            ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common],
            ["distributed.cli.dask_worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", *common],
        )  # fmt: skip

    def __enter__(self) -> tuple[subprocess.Popen[bytes], Path]:
        self._processes = []
        for module, *options in self._lines:
            line = [sys.executable, "-m", module, *options]
            nowhere = subprocess.DEVNULL
            self._processes.append(subprocess.Popen(line, env=self._env, stdout=nowhere, stderr=nowhere))
            until(self._file.exists)
        return self._processes[0], self._file

    def __exit__(self, *fault: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()


def until(true: Callable[[], Any]) -> None:
    """Wait for something that comes about soon."""
    for _ in range(int(WAIT_S / 0.05)):
        if true():
            return
        time.sleep(0.05)
    raise AssertionError("it did not come about")


def _echo(number: int, told: Told) -> tuple[int, int]:
    told("echo", 1, 1)
    return number, cores()


class TestTasks:
    @pytest.mark.parametrize("pooled", [True, False])
    def test_large_ones_are_done_by_themselves_and_too_large_ones_not(self, client: Any, pooled: bool) -> None:
        cluster = Cluster(client, {"127.0.0.1": 2}, share=10, most=100, pooled=pooled)
        heard: list[int] = []
        warned: dict[int, str] = {}
        tasks = Tasks(
            _echo, [50, 5, 200, 7, 60], float, lambda number, *stage: heard.append(number), warned.__setitem__
        )
        found = list(tasks.done_on(cluster))
        order = [number for number, _ in found]
        assert (order[0], sorted(order[1:3]), order[3:]) == (2, [1, 3], [0, 4])
        by_number = dict(found)
        assert by_number[2].exit_code == 7
        assert "Expected: at most 100 bytes" in str(by_number[2])
        assert warned.keys() == {0, 4}
        assert warned[0] == "by itself, as it needs about 50 bytes, and a worker's share is 10 bytes"
        until(lambda: sorted(heard) == [0, 1, 3, 4])
        half, whole = max(dask.system.CPU_COUNT // 2, 1), dask.system.CPU_COUNT
        assert by_number[1] == (5, half)
        assert by_number[3] == (7, half)
        assert by_number[0] == (50, whole)

    @law(100)
    @given(st.integers(1, 100), st.floats(1, 100), st.floats(1, 1e4))
    def test_as_many_as_fit_are_done_at_once(self, slots: int, share: float, size: float) -> None:
        """Of one memory; were there twice as many, they would not fit."""
        count = Cluster(None, {"a": slots}, share, math.inf, pooled=True).fitting(size)
        assert 1 <= count <= slots
        assert count == 1 or count * size <= slots * share * (1 + 1e-12)
        assert count == slots or (2 * count + 1) * size > slots * share

    def test_nothing_is_left_on_the_scheduler(self, client: Any) -> None:
        cluster = Cluster(client, {"127.0.0.1": 2}, share=10, most=100, pooled=True)
        tasks = Tasks(_forever, [0, 1], float, lambda *stage: None, lambda *why: None)
        coming = tasks.done_on(cluster)
        assert next(coming) == (0, "done")
        coming.close()
        until(lambda: not client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)))
        until(lambda: not any(client.processing().values()))
        until(lambda: all(not count for count in client.run(_at_work).values()))


def _forever(item: int, told: Told) -> str:
    """Work until nobody wants it any more, but for one."""
    if item == 0:
        return "done"
    while True:
        told("working", 0, 1)
        time.sleep(0.01)


def _at_work(dask_worker: Any) -> int:
    return len(dask_worker.state.tasks)


def children_of(process: subprocess.Popen[str]) -> list[Any]:
    return list(psutil.Process(process.pid).children(recursive=True))


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
        line = [sys.executable, "-m", "tomomesh", "reconstruct", str(many), "-o", str(many.parent / "out")]
        with subprocess.Popen(
            [*line, *OPTIONS, "--workers", "2"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            cwd=many.parent / "current", env={**os.environ, "TMPDIR": str(many.parent / "temporary")},
            start_new_session=True,
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


class TestUsage:
    @pytest.mark.parametrize(
        ("options", "code", "said"),
        [
            (["--workers", "2"], 2, "--workers without --each"),
            (["--scheduler", "tcp://127.0.0.1:1"], 2, "--scheduler without --each"),
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
