"""Studies slab by slab on Dask workers: the bytes of the run in memory, or a line, whatever becomes of workers."""

from __future__ import annotations

import errno
import os
import signal
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from slab_studies import MEMORY, blobs, same
from studies import write_nifti
from tomomesh import Volume, reconstruct
from tomomesh.cli import main
from tomomesh.large import reconstruct_large
from tomomesh.segmentation.slabwise import cut
from tomomesh.slabs import keep, rest, surface

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

resource = pytest.importorskip("resource", reason="workers are killed by signals, which this system lacks")

STAGES = [
    (cut, "_read_first"),
    *((surface, name) for name in ("ground", "squares_from", "region", "chosen", "piece")),
    *((rest, name) for name in ("begun", "returned", "stepped")),
]
"""What is done to a slab, by the function that does it and the module that asks for it."""


def killed_once(*given: Any, work: Any, marker: Path, **named: Any) -> Any:
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return work(*given, **named)


def dying(module: Any, stage: str, marker: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the worker die that comes first to a stage."""
    monkeypatch.setattr(module, stage, partial(killed_once, work=getattr(module, stage), marker=marker))


def ball() -> NDArray[np.int16]:
    """Return the depth in a ball, from 0 outside on."""
    k, j, i = np.ogrid[:24, :30, :30]
    return (100 - 8 * np.sqrt((k - 11.5) ** 2 + (j - 14.5) ** 2 + (i - 14.5) ** 2)).astype(np.int16)


class TestWorkers:
    @pytest.fixture
    def study(self, tmp_path: Path) -> Path:
        write_nifti(tmp_path / "labels.nii", np.pad((blobs(5) > 20).astype(np.uint8), 1), np.eye(4))
        return tmp_path / "labels.nii"

    def line(self, study: Path, name: str) -> list[str]:
        return ["reconstruct", str(study), "--select", "1", "--quiet", "-o", str(study.parent / name)]

    def test_the_same_bytes(self, study: Path, here: Any) -> None:
        on = ["--scheduler", here.scheduler_address, "--slab", "6"]
        assert main([*self.line(study, "workers.ply"), *on]) == 0
        assert main([*self.line(study, "whole.ply"), "--no-remesh"]) == 0
        assert (study.parent / "workers.ply").read_bytes() == (study.parent / "whole.ply").read_bytes()

    @pytest.mark.parametrize(("module", "stage"), STAGES)
    def test_a_worker_killed_in_any_stage(
        self, module: Any, stage: str, study: Path, here: Any, client: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        marker = study.parent / "marker"
        monkeypatch.setattr(module, stage, partial(killed_once, work=getattr(module, stage), marker=marker))
        monkeypatch.setattr(here.scheduler, "allowed_failures", 1)
        labels = Volume.from_stored((blobs(5) > 20).astype(np.uint8), np.eye(4))
        found = reconstruct_large(labels, client=client, slab=6, select=(1,))
        assert marker.exists()
        assert same(found, reconstruct(labels, select=(1,), remesh=False))


class TestRings:
    """Ways whose networks are trained here, of slices that workers read and choose from."""

    @pytest.mark.parametrize(
        ("way", "module", "stage"),
        [
            ("ring", cut, "_read_first"),
            *(("contours", *one) for one in [(cut, "_read_first"), (surface, "region"), (surface, "piece")]),
        ],
    )
    def test_the_same_bytes_though_a_worker_is_killed(
        self, way: str, module: Any, stage: str, tmp_path: Path, here: Any, client: Any,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:  # fmt: skip
        study = Volume.from_stored(ball(), np.diag([0.7, 0.8, 0.9, 1.0]))
        asked: dict[str, Any] = {"way": way, "lower": 20, **(MEMORY if way == "contours" else {})}
        whole = reconstruct(study, **asked)
        dying(module, stage, tmp_path / "marker", monkeypatch)
        monkeypatch.setattr(here.scheduler, "allowed_failures", 1)
        found = reconstruct_large(study, client=client, slab=5, **asked)
        assert (tmp_path / "marker").exists()
        assert same(found, whole)

    @pytest.mark.parametrize("way", ["ring", "contours"])
    def test_the_same_files(self, way: str, tmp_path: Path, here: Any) -> None:
        """With what formats keep of the neurons."""
        write_nifti(tmp_path / "ball.nii", ball(), np.eye(4))
        line = ["reconstruct", str(tmp_path / "ball.nii"), "--lower", "20", "--way", way, "--quiet"]
        line += ["--no-remesh", "--no-divide"]
        assert main([*line, "-o", str(tmp_path / "whole.ply")]) == 0
        on = ["--scheduler", here.scheduler_address, "--slab", "5"]
        assert main([*line, *on, "-o", str(tmp_path / "slabs.ply")]) == 0
        assert (tmp_path / "slabs.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()


def _files_of(most: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def _full(full: bool) -> None:
    """Let the disk have no room for what another process sends."""

    def put(file: keep.File, array: NDArray[Any]) -> Any:
        if sys._getframe(2).f_code.co_name == "_received":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return written(file, array)

    kept: Any = keep.File
    written = kept.__dict__.get("before", kept._written)
    kept.before, kept._written = written, put if full else written


def _blind(name: str) -> None:
    """Let there be no file of a name, as where a folder is not mounted."""

    def stat(path: Path, **how: Any) -> Any:
        if path.name == name:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        return before(path, **how)

    there: Any = Path
    before = there.__dict__.get("before", Path.stat)
    there.before, there.stat = before, stat if name else before


def _lacking(*given: Any, **named: Any) -> Any:
    raise MemoryError


@pytest.fixture
def on_workers(client: Any) -> Iterator[Callable[..., None]]:
    """Hand over what changes all workers, which are as before afterwards."""
    yield client.run
    for change, usual in ((_files_of, resource.RLIM_INFINITY), (_full, False), (_blind, "")):
        client.run(change, usual)


class TestFaults:
    """One line, the code that fits, and no file."""

    @pytest.fixture
    def told(
        self, tmp_path: Path, folder: Path, here: Any, capsys: pytest.CaptureFixture[str]
    ) -> Callable[[], tuple[int, str]]:
        write_nifti(tmp_path / "a.nii", blobs(5, (60, 30, 30)), np.eye(4))

        def run() -> tuple[int, str]:
            line = ["reconstruct", str(tmp_path / "a.nii"), "--lower", "20", "--way", "voxels", "--slab", "20"]
            code = main([*line, "--scheduler", here.scheduler_address, "--quiet", "-o", str(folder / "a.ply")])
            assert not any(folder.iterdir())
            (said,) = capsys.readouterr().err.splitlines()
            return code, said

        return run

    @pytest.mark.parametrize("most", [keep.LARGE, 6 * keep.LARGE])
    def test_a_full_disk_where_a_slab_is_kept(self, most: int, told: Any, on_workers: Any) -> None:
        on_workers(_files_of, most)
        code, said = told()
        assert code == 8
        assert said.startswith("error: what was made of a slab cannot be kept. File: /")
        assert "[the disk is full]. Try: TMPDIR on a disk with more room" in said

    @pytest.mark.parametrize("side", ["workers", "here"])
    def test_a_full_disk_where_a_slab_is_sent_to(self, side: str, told: Any, on_workers: Any) -> None:
        if side == "workers":
            on_workers(_full, True)
            code, said = told()
        else:
            _full(True)
            try:
                code, said = told()
            finally:
                _full(False)
        assert (code, "[the disk is full]" in said) == (8, True)

    def test_a_worker_that_does_not_see_the_study(self, told: Any, on_workers: Any) -> None:
        on_workers(_blind, "a.nii")
        code, said = told()
        assert code == 3
        assert said.startswith("error: the file that was opened is not there. File: a.nii [no such file or directory].")
        assert "at the same path on every machine" in said

    def test_a_worker_of_another_version(self, told: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.slabs.on_client.version", lambda name: "0.0.1")
        code, said = told()
        assert code == 7
        assert said.startswith("error: a worker is of another version. Found: [")
        assert said.endswith("Expected: tomomesh 0.0.1.")

    def test_a_worker_whose_memory_is_full(self, told: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(surface, "region", _lacking)
        code, said = told()
        assert (code, "memory is full" in said) == (7, True)
