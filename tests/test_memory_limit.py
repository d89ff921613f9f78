"""A limit on memory: the same bytes, a peak below it, no file that anybody sees, one line where the disk is full."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy._core.multiarray import get_handler_name

from conftest import COMPILED, law, seeds, sphere
from doors import as_program
from tomomesh import memory_limit, reconstruct_points
from tomomesh.errors import OutputError, ResourceError, UsageError
from tomomesh.memory import arrays, limit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not COMPILED, reason="memory is limited on Linux only, by compiled functions"
)

MIB = 1 << 20


@contextmanager
def all_in_files(least: int = 1) -> Iterator[None]:
    """Limit the memory, and have all arrays of so many bytes and more lie in files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arrays, "LARGE", least)
        patch.setattr(limit, "KEPT", 0.0)
        with memory_limit("1GB"):
            yield


def maps() -> list[str]:
    """The files without a name that this process has in its memory."""
    return [line for line in Path("/proc/self/maps").read_text().splitlines() if line.endswith("(deleted)")]


def in_files() -> int:
    """Resident bytes of this process that are files'."""
    return 1024 * int(Path("/proc/self/status").read_text().split("RssFile:")[1].split()[0])


class TestArrays:
    @law(30)
    @given(
        seeds, st.lists(st.sampled_from(["zeros", "sort", "grow", "shrink", "join", "iterate", "leave"]), max_size=9)
    )
    def test_hold_what_they_hold_elsewhere(self, seed: int, steps: list[str]) -> None:
        rng = np.random.default_rng(seed)
        with all_in_files():
            array = rng.integers(0, 1000, rng.integers(1, 5000))
            twin = array.tolist()
            for step in steps:
                array, twin = CHANGES[step](array, twin, rng)
                assert get_handler_name(array) == "tomomesh"
        assert array.tolist() == twin

    def test_lie_in_files_that_nobody_sees_and_that_go_with_them(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(limit, "disk_folder", lambda: tmp_path)
        before = len(maps())
        with all_in_files():
            array = np.arange(100_000)
            assert len(maps()) > before
            del array
            assert len(maps()) == before
        assert not any(tmp_path.iterdir())

    def test_of_large_ones_the_first_stay_in_memory(self) -> None:
        before = len(maps())
        with memory_limit(limit._resident() + 10**9):  # a process of many tests has much in its memory
            few = [np.empty(8 * MIB, np.uint8) for _ in range(3)]
            assert len(maps()) == before
            many = [np.empty(64 * MIB, np.uint8) for _ in range(8)]
            assert before < len(maps()) <= before + len(many)
            del few[:], many[:]
            again = [np.empty(64 * MIB, np.uint8) for _ in range(2)]
            assert len(maps()) == before
            del again

    def test_small_ones_never_lie_in_files(self) -> None:
        before = len(maps())
        with memory_limit("400MiB"):
            small = [np.empty(arrays.LARGE - 1, np.uint8) for _ in range(50)]
            assert len(maps()) == before
            del small

    def test_those_of_other_threads_and_of_later_are_as_ever(self) -> None:
        found = list[str | None]()

        def look() -> None:
            found.append(get_handler_name(np.empty(8 * MIB, np.uint8)))

        with memory_limit("1GB"):
            thread = threading.Thread(target=look)
            thread.start()
            thread.join()
        look()
        assert found == ["default_allocator"] * 2

    def test_limits_within_one_another(self) -> None:
        with memory_limit("1GB"):
            with memory_limit("500MB"):
                inner = np.arange(8 * MIB)
            assert get_handler_name(np.arange(5)) == "tomomesh"
            with memory_limit(None):
                assert get_handler_name(np.arange(5)) == "tomomesh"
        assert get_handler_name(np.arange(5)) == "default_allocator"
        assert inner[-1] == 8 * MIB - 1


def _zeros(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    return np.zeros_like(array), [0] * len(twin)


def _sort(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    array.sort()
    return array, sorted(twin)


def _grow(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    more = int(rng.integers(1, 9000))
    array.resize(len(array) + more, refcheck=False)
    return array, twin + [0] * more


def _shrink(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    left = int(rng.integers(1, len(array) + 1))
    array.resize(left, refcheck=False)
    return array, twin[:left]


def _join(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    return np.concatenate([array, array[::-1]]), twin + twin[::-1]


def _iterate(
    array: NDArray[np.int64], twin: list[int], rng: np.random.Generator
) -> tuple[NDArray[np.int64], list[int]]:
    return np.fromiter((value + 1 for value in array), np.int64), [value + 1 for value in twin]


def _leave(array: NDArray[np.int64], twin: list[int], rng: np.random.Generator) -> tuple[NDArray[np.int64], list[int]]:
    for made in gc.get_objects():
        if isinstance(made, arrays.Arrays):
            leave_all(made)
    return array, twin


def leave_all(made: arrays.Arrays) -> None:
    """Let all pages go, once, as where no page may be in the memory."""
    with made.watched(0):
        pass


CHANGES: dict[str, Any] = {
    "zeros": _zeros, "sort": _sort, "grow": _grow, "shrink": _shrink, "join": _join, "iterate": _iterate,
    "leave": _leave,
}  # fmt: skip


def test_pages_that_are_left_take_no_memory_until_they_are_read() -> None:
    made = arrays.Arrays(limit.disk_folder(), 0)
    before = arrays.swapped(made.capsule)
    try:
        array = np.resize(np.arange(256, dtype=np.uint8), 64 * MIB)
    finally:
        arrays.swapped(before)
    taken = in_files()
    assert taken > 60 * MIB
    leave_all(made)
    assert in_files() < taken - 60 * MIB
    assert np.array_equal(array.reshape(-1, 256), np.broadcast_to(np.arange(256), (64 * MIB // 256, 256)))


class TestLimits:
    @pytest.mark.parametrize("asked", ["", "much", "4 PB", "-4GB", "1e9", "1..5GB", "399MiB", "0", 1000, float("nan")])
    def test_what_is_none_is_refused(self, asked: str | float) -> None:
        with pytest.raises(UsageError, match="400MiB or more"), memory_limit(asked):
            pass

    def test_in_units(self) -> None:
        asked: list[str | float] = ["1GB", "1 gb", "1G", "1000MB", "1.0 GB", 1e9, 10**9]
        assert {limit.bytes_of(one) for one in asked} == {10**9}
        assert limit.bytes_of("1GiB") == limit.bytes_of("1024 MiB") == 2**30

    def test_elsewhere_than_on_linux(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(sys, "platform", "win32")
        with pytest.raises(UsageError, match="Linux only"), memory_limit("1GB"):
            pass

    def test_without_a_compiler(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(limit, "COMPILED", False)
        with pytest.raises(UsageError, match="compiled"), memory_limit("1GB"):
            pass

    def test_files_in_the_memory_do_not_count_as_a_disk(self, monkeypatch: pytest.MonkeyPatch) -> None:
        if limit._kind(Path("/dev/shm")) != "tmpfs":
            pytest.skip("/dev/shm is not in the memory here")
        monkeypatch.setattr(tempfile, "tempdir", "/dev/shm")
        assert limit._kind(limit.disk_folder()) not in limit.IN_MEMORY
        monkeypatch.setattr(limit, "_kind", lambda folder: "tmpfs")
        with pytest.raises(ResourceError, match="TMPDIR"), memory_limit("1GB"):
            pass


class TestFullDisk:
    PROGRAM = """
import resource, sys
import numpy as np
from tomomesh import TomomeshError, memory_limit
resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, resource.RLIM_INFINITY))
try:
    with memory_limit("400MiB"):
        kept = [np.ones(8 << 20) for _ in range(20)]
except TomomeshError as error:
    print(error.exit_code, error)
"""

    def test_is_one_line(self) -> None:
        done = subprocess.run([sys.executable, "-c", self.PROGRAM], capture_output=True, text=True, check=True)
        assert done.stdout.startswith("8 what is beyond the limit of the memory cannot be kept. File: ")
        assert "the disk is full" in done.stdout
        assert done.stdout.count("\n") == 1
        assert not done.stderr

    def test_other_faults_are_told_too(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        monkeypatch.setattr(limit, "disk_folder", lambda: tmp_path / "none")
        with pytest.raises(OutputError, match=r"no file can be made"), all_in_files():
            np.arange(1000)

    def test_what_is_full_is_the_memory_where_no_file_failed(self) -> None:
        with pytest.raises(MemoryError), memory_limit("1GB"):
            raise MemoryError


def test_errors_go_through_arrays_that_are_given_back() -> None:
    """NumPy gives memory back while an error is on its way: nothing of Python may run there."""

    def fail() -> None:
        one = np.arange(5000)
        one.sum()
        raise KeyError

    with all_in_files():
        for _ in range(50):
            with pytest.raises(KeyError):
                fail()


KILLED = """
import sys
import numpy as np
from tomomesh import memory_limit
with memory_limit("400MiB"):
    array = np.ones(16 << 20)
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_a_process_that_is_killed_leaves_nothing(tmp_path: Path) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", KILLED], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    with program:
        assert program.stdout is not None
        assert program.stdout.readline() == b"ready\n"
        assert "(deleted)" in Path(f"/proc/{program.pid}/maps").read_text()
        assert not list(tmp_path.iterdir())
        program.kill()
    assert not list(tmp_path.iterdir())


PEAK = """
import numpy as np
from pathlib import Path
from tomomesh import memory_limit
with memory_limit("800MiB"):
    columns = [np.full(4 << 20, float(n)) for n in range(64)]  # 2 GiB
    for n, column in enumerate(columns):
        column += columns[n - 1]
    assert [column[-1] for column in columns[1:]] == [sum(range(n + 1)) + 63 for n in range(1, 64)]
print(int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024)
"""


def test_the_peak_stays_below() -> None:
    done = subprocess.run([sys.executable, "-c", PEAK], capture_output=True, text=True, check=True)
    assert 300 < float(done.stdout) < 800
    assert not done.stderr  # nor is anything said when arrays go as the process ends


HOLDING = """
import ctypes
import numpy as np
from pathlib import Path
from tomomesh import memory_limit
with memory_limit("800MiB"):
    array = np.empty(3 << 29, np.uint8)
    ctypes.PyDLL(None).memset(ctypes.c_void_p(array.ctypes.data), 1, ctypes.c_size_t(array.nbytes))
    assert array[::4096].all()
print(int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024)
"""


def test_pages_go_while_a_call_holds_the_lock_of_the_interpreter() -> None:
    """1,536 MiB are filled in one call, beside 180 of Python: how far beyond the limit, a busy machine says."""
    done = subprocess.run([sys.executable, "-c", HOLDING], capture_output=True, text=True, check=True)
    assert 300 < float(done.stdout) < 1536


@law(3)
@given(seeds, st.sampled_from([1 << 12, 1 << 15]))
def test_a_surface_is_the_same(seed: int, least: int) -> None:
    cloud = sphere(3000) + np.random.default_rng(seed).normal(0, 0.005, (3000, 3))
    free = reconstruct_points(cloud)
    with all_in_files(least):
        held = reconstruct_points(cloud, memory="400MiB")
    assert get_handler_name(held.mesh.vertices) == "tomomesh"
    assert np.array_equal(free.mesh.vertices, held.mesh.vertices)
    assert np.array_equal(free.mesh.faces, held.mesh.faces)
    reports = [{key: part for key, part in one.report.items() if key != "timings"} for one in (free, held)]
    assert reports[0] == reports[1]


def test_the_command_writes_the_same_file(folder: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "cloud.npy", sphere(3000))
    line = ["surface", str(tmp_path / "cloud.npy"), "--quiet", "-o"]
    assert as_program([*line, str(folder / "free.ply")]).returncode == 0
    assert as_program([*line, str(folder / "held.ply"), "--memory", "400MiB"]).returncode == 0
    assert (folder / "free.ply").read_bytes() == (folder / "held.ply").read_bytes()
    refused = as_program([*line, str(folder / "none.ply"), "--memory", "little"])
    assert refused.returncode == 2
    assert "[memory = little]" in refused.stderr
