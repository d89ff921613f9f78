"""Studies that are read part by part: the room that they take, of memory and of disk."""

from __future__ import annotations

import gc
import gzip
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest

from studies import AFFINES, sampled, write_nifti
from tomomesh.errors import ResourceError
from tomomesh.io import open_study, read_volume
from tomomesh.io.files import numbers
from tomomesh.io.files.numbers import MAPPED_BYTES
from tomomesh.io.files.unpack import unpacked
from tomomesh.model.lazy import LazyVoxels, in_memory, slabs
from tomomesh.settings import ReadSettings
from writers import with_nibabel, with_numpy

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

UPRIGHT = AFFINES["axial"]
STORED = sampled(UPRIGHT)
SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestUnpackedCopies:
    @pytest.fixture(autouse=True)
    def temporary(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        folder = tmp_path / "temporary"
        folder.mkdir()
        monkeypatch.setattr("tempfile.tempdir", str(folder))
        numbers._unpacked_again.cache_clear()
        return folder

    @pytest.mark.skipif(sys.platform == "win32", reason="a file that is open keeps its name there")
    def test_they_have_no_name_and_go_with_the_study(self, tmp_path: Path, temporary: Path) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        before = self.deleted()
        opened = open_study(path)
        assert not list(temporary.iterdir())
        assert len(self.deleted() - before) == 1 or sys.platform != "linux"
        part = opened.voxels[1:2]
        del opened
        gc.collect()
        assert in_memory(part).shape == (1, *STORED.shape[1:])
        del part
        gc.collect()
        assert self.deleted() == before

    @staticmethod
    def deleted() -> set[str]:
        """Return the files without a name that this process holds, as far as the system tells."""
        held = Path("/proc/self/fd")
        if not held.exists():
            return set()
        links = {one.name: str(one.readlink()) for one in held.iterdir() if one.is_symlink()}
        return {name for name, link in links.items() if "tomomesh-" in link or "/#" in link}

    def test_a_process_that_gets_them_unpacks_once(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        sent, whole = pickle.dumps(open_study(path)), read_volume(path)
        counted: list[str] = []

        def counting(path: Path, *given: Any, **more: Any) -> Any:
            counted.append(path.name)
            return unpacked(path, *given, **more)

        monkeypatch.setattr(numbers, "unpacked", counting)
        for k in range(3):
            np.testing.assert_array_equal(pickle.loads(sent).voxels[k], whole.voxels[k], strict=True)
        assert counted == [path.name]
        numbers._unpacked_again.cache_clear()

    def test_a_disk_without_room_is_one_line(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=STORED.nbytes - 1))
        with pytest.raises(ResourceError, match=r"no room .* at most \d+ bytes\. Try: TMPDIR=FOLDER"):
            open_study(path)

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no disk that is always full")
    def test_so_is_one_that_fills_up(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        with Path("/dev/full").open("wb", buffering=0) as full:
            monkeypatch.setattr("tempfile.TemporaryFile", lambda **_: full)
            with pytest.raises(ResourceError, match="the disk has no room for the unpacked voxels"):
                open_study(path)

    def test_a_stream_beyond_its_promise_is_told_before_it_fills_the_disk(self, tmp_path: Path) -> None:
        path = write_nifti(tmp_path / "s.nii", STORED, UPRIGHT)
        bomb = tmp_path / "s.nii.gz"
        bomb.write_bytes(gzip.compress(path.read_bytes() + bytes(2**27)))
        with pytest.raises(ResourceError, match="goes on far beyond its voxels"):
            open_study(bomb)


PROGRAM = """
import sys
from pathlib import Path
from tomomesh.io import open_study
from tomomesh.model.lazy import slabs
def peak():
    return 1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
path, axis = sys.argv[1:]
study = open_study(path).along(int(axis))
study.voxels[:2].read()
before, total = peak(), 0
for slab in slabs(study.voxels):
    total += int(slab.read().max())
print(peak() - before, total, *study.shape)
"""


class TestSizes:
    def sparse(self, folder: Path, shape: tuple[int, int, int]) -> Path:
        """Return a NIfTI file of 16 bits, nearly all of it a hole."""
        header = nibabel.Nifti1Header()
        header.set_data_dtype(np.int16)
        header.set_data_shape(shape[::-1])
        header.set_sform(np.diag([-1.0, -1, 1, 1]), 1)
        header["magic"], header["vox_offset"] = b"n+1", 352
        with (folder / "s.nii").open("wb") as file:
            file.write(header.binaryblock + bytes(4))
            file.truncate(352 + 2 * int(np.prod(shape)))
            file.seek(352 + 2 * (shape[1] * shape[2] * 5 + 7))
            file.write(np.int16(1234).tobytes())
        return folder / "s.nii"

    @pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="this system does not tell a process's peak")
    @pytest.mark.parametrize(("axis", "shape"), [(2, (900, 800, 800)), (0, (600, 400, 420))])
    def test_all_of_a_large_file_is_read_in_little_memory(
        self, tmp_path: Path, axis: int, shape: tuple[int, int, int]
    ) -> None:
        path = self.sparse(tmp_path, shape)
        line = [sys.executable, "-c", PROGRAM, str(path), str(axis)]
        taken, total, *_ = map(int, subprocess.run(line, capture_output=True, text=True, check=True).stdout.split())
        assert total == 1234
        assert taken < 4 * MAPPED_BYTES

    def test_one_beyond_any_memory_is_opened_and_read_in_part(self, tmp_path: Path) -> None:
        path = self.sparse(tmp_path, (30000, 10000, 10000))
        opened = open_study(path)
        assert opened.shape == (30000, 10000, 10000)
        part = in_memory(opened.cropped((slice(4, 7), slice(0, 2), slice(5, 9))).voxels)
        assert np.argwhere(part).tolist() == [[1, 0, 2]]
        assert part.max() == 1234
        with pytest.raises(ResourceError, match="memory"):
            read_volume(path)

    def test_slabs_are_whole_chunks_where_one_fits(self) -> None:
        class Wide:
            shape, dtype, chunks = (100, 2048, 2048), np.dtype(np.uint8), (6, 64, 64)

            def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
                return np.zeros([side.stop - side.start for side in box], np.uint8)

        voxels = LazyVoxels.of(Wide())
        assert [len(slab) for slab in slabs(voxels)] == [12] * 8 + [4]
        array = np.zeros((3, 2, 2))
        assert [slab is array for slab in slabs(array)] == [True]

    def test_others_may_go_through_real_numbers_part_by_part(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        stored = STORED.astype(np.float32)
        stored[1, 2, 3] = np.nan
        path = with_numpy(tmp_path, stored, UPRIGHT)
        monkeypatch.setattr("tomomesh.model.lazy.SLAB_BYTES", stored[:2].nbytes)
        given: list[int] = []

        def each(work: Callable[[Any], Any], parts: Sequence[Any]) -> list[Any]:
            given.extend(map(len, parts))
            return [pickle.loads(pickle.dumps(work))(pickle.loads(pickle.dumps(part))) for part in parts]

        opened, whole = open_study(path, SPACING, each=each), read_volume(path, settings=SPACING)
        assert given == [2, 2, 1]
        assert opened.notes == whole.notes
        np.testing.assert_array_equal(in_memory(opened.voxels), whole.voxels, strict=True)

    @pytest.mark.parametrize("mapped", [1, 100, 10**6])
    def test_how_much_is_mapped_at_once_changes_nothing(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mapped: int
    ) -> None:
        path = with_nibabel(".nii")(tmp_path, STORED, UPRIGHT)
        monkeypatch.setattr(numbers, "MAPPED_BYTES", mapped)
        opened, whole = open_study(path), read_volume(path)
        for axis in range(3):
            np.testing.assert_array_equal(
                in_memory(opened.along(axis).voxels[1::2]), whole.along(axis).voxels[1::2], strict=True
            )
