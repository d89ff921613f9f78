"""The child process that decodes: what it may not do, and what its end means."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pydicom
import pytest
from pydicom.uid import JPEGLSLossless

from studies import AFFINES, save, slice_dataset
from tomomesh.cli import main
from tomomesh.errors import FormatError, ResourceError, TomomeshError
from tomomesh.io import read_volume
from tomomesh.io.dicom.pixels import child, decoding
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable

resource = pytest.importorskip("resource", reason="this system has no limits for processes")

PIXELS = np.arange(480, dtype=np.uint16).reshape(20, 24)
ONE = ReadSettings(spacing_z=1)
SERVE = "import os, signal, sys, time\nline = sys.stdin.buffer.readline()\n"
HEAD = '{"kind": "<u2", "shape": [20, 24], "photometric": "MONOCHROME2"}'


@pytest.fixture
def path(tmp_path: Path) -> Path:
    data = slice_dataset(PIXELS, AFFINES["axial"], 0)
    data.compress(JPEGLSLossless, generate_instance_uid=False)
    return save(data, tmp_path / "study" / "a.dcm")


@pytest.fixture
def run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], TomomeshError]:
    """Return what reads the file with another program as the child."""
    ended: list[subprocess.Popen[bytes]] = []
    start = child._started

    def started(frame_bytes: int) -> subprocess.Popen[bytes]:
        ended.append(start(frame_bytes))
        return ended[-1]

    def error(program: str) -> TomomeshError:
        (tmp_path / "program.py").write_text(SERVE + program)
        monkeypatch.setattr(child, "PROGRAM", str(tmp_path / "program.py"))
        monkeypatch.setattr(child, "_started", started)
        with pytest.raises(TomomeshError) as caught:
            read_volume(path, settings=ONE)
        assert ended
        assert all(process.poll() is not None for process in ended)
        return caught.value

    return error


class TestTheEndOfAChild:
    def test_a_crash_is_an_error_of_the_file(self, run: Callable[[str], TomomeshError]) -> None:
        fault = run("os.kill(os.getpid(), signal.SIGSEGV)")
        assert isinstance(fault, FormatError)
        assert "a.dcm [TransferSyntaxUID = JPEG-LS Lossless Image Compression, crash]" in str(fault)

    def test_a_child_that_takes_too_long_is_ended(
        self, run: Callable[[str], TomomeshError], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(decoding, "seconds_for", lambda size: 0.1)
        assert isinstance(run("time.sleep(60)"), ResourceError)

    def test_the_limit_of_the_processor_is_a_limit(self, run: Callable[[str], TomomeshError]) -> None:
        assert isinstance(run("os.kill(os.getpid(), signal.SIGXCPU)"), ResourceError)

    @pytest.mark.parametrize("fault", ["MemoryError", "ValueError"])
    def test_what_the_child_says_is_said(self, run: Callable[[str], TomomeshError], fault: str) -> None:
        expected = ResourceError if fault == "MemoryError" else FormatError
        assert isinstance(run(f'print(\'{{"fault": "{fault}"}}\')'), expected)

    @pytest.mark.parametrize(
        "answer",
        [
            "text",
            "{}",
            "[]",
            HEAD.replace("20", "21"),
            HEAD.replace("<u2", "|O"),
            HEAD.replace("[20, 24]", "[1e9, 1e9]"),
            HEAD,
            "x" * 10**6,
        ],
    )
    def test_an_answer_that_cannot_be_is_refused(self, run: Callable[[str], TomomeshError], answer: str) -> None:
        assert isinstance(run(f"print({answer!r}, flush=True)"), FormatError)

    def test_the_command_line_says_it_in_one_line(
        self,
        path: Path,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        (tmp_path / "program.py").write_text("import os; os.abort()")
        monkeypatch.setattr(child, "PROGRAM", str(tmp_path / "program.py"))
        assert main(["reconstruct", str(path), "--spacing-z", "1", "-o", str(tmp_path / "m.stl")]) == 4
        assert len(capsys.readouterr().err.splitlines()) == 1
        assert sorted(one.name for one in tmp_path.iterdir()) == ["program.py", "study"]

    def test_a_child_is_gone_when_its_study_is_read(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        started: list[subprocess.Popen[bytes]] = []
        start = child._started

        def kept(size: int) -> subprocess.Popen[bytes]:
            started.append(start(size))
            return started[-1]

        monkeypatch.setattr(child, "_started", kept)
        np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels[0], PIXELS)
        assert [process.poll() is not None for process in started] == [True]

    def test_a_child_ends_with_the_pipe_of_its_parent(self) -> None:
        """As it is when the parent is killed."""
        process = child._started(1000)
        process.communicate(timeout=30)
        assert process.returncode == 0


class TestLimits:
    def confined(self, attempt: str) -> str:
        """Return what becomes of a few lines in a process that has given up its rights."""
        program = (
            f"import sys, runpy, signal, numpy\ndecoding = runpy.run_path({decoding.__file__!r})\n"
            f"decoding['confine'](1000)\ntry:\n    {attempt}\nexcept BaseException as fault:\n"
            "    print(type(fault).__name__)\nelse:\n    print('done')\n"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60)
        return done.stdout.strip()

    def test_little_memory_is_there(self) -> None:
        assert self.confined("numpy.ones(2**20)") == "done"
        assert self.confined("numpy.ones(2**29)") == "MemoryError"

    def test_no_file_is_opened(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("x")
        assert self.confined(f"open({str(tmp_path / 'a')!r})") == "OSError"
        assert self.confined(f"open({str(tmp_path / 'new')!r}, 'w')") == "OSError"
        assert not (tmp_path / "new").exists()

    def test_no_program_is_started(self) -> None:
        assert self.confined("import subprocess; subprocess.run(['true'])") == "OSError"

    def test_limits_cannot_be_lifted(self) -> None:
        import os

        if os.geteuid() == 0:
            pytest.skip("root may lift any limit")
        attempt = "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (99, 99))"
        assert self.confined(attempt) == "ValueError"

    def test_endless_work_is_ended(self) -> None:
        program = (
            f"import runpy\ndecoding = runpy.run_path({decoding.__file__!r})\n"
            "decoding['allow_time'](0)\nwhile True:\n    pass\n"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, timeout=60)
        assert done.returncode < 0

    def test_nothing_of_the_environment_gets_there(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        monkeypatch.setenv("A_SECRET", "password")
        program = tmp_path / "program.py"
        program.write_text("import os; print('A_SECRET' in os.environ, 'HOME' in os.environ, flush=True)")
        monkeypatch.setattr(child, "PROGRAM", str(program))
        output, _ = child._started(1000).communicate(timeout=30)
        assert output.split() == [b"False", b"False"]

    def test_the_child_imports_nothing_of_tomomesh(self) -> None:
        text = Path(decoding.__file__).read_text()
        assert "tomomesh" not in text.split('"""', 2)[2]
        assert "pickle" not in text.split('"""', 2)[2]

    def test_it_works_where_there_are_no_limits(
        self, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As on Windows."""
        program = tmp_path / "program.py"
        program.write_text(
            f"import runpy, sys\nsys.modules['resource'] = None\n"
            f"runpy.run_path({decoding.__file__!r}, run_name='__main__')\n"
        )
        monkeypatch.setattr(child, "PROGRAM", str(program))
        np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels[0], PIXELS)


def test_the_pixels_are_those_of_pydicom(path: Path) -> None:
    np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels[0], pydicom.dcmread(path).pixel_array)
