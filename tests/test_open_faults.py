"""Studies that are read part by part: what is damaged, gone or changed, told in one line; and what is left of it."""

from __future__ import annotations

import gc
import gzip
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from pydicom import dcmread
from pydicom.uid import RLELossless

from studies import AFFINES, sampled, write_nifti, write_series
from tomomesh.errors import FormatError, ResourceError, TomomeshError, UnreadableError
from tomomesh.io import open_study, read_volume
from tomomesh.io.files import numbers
from tomomesh.io.files.numbers import MAPPED_BYTES
from tomomesh.io.files.unpack import unpacked
from tomomesh.model.lazy import LazyVoxels, in_memory, slabs
from tomomesh.settings import ReadSettings
from writers import needed, with_itk, with_nibabel, with_numpy, with_pillow, with_pydicom

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

UPRIGHT = AFFINES["axial"]
STORED = sampled(UPRIGHT)
SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


def cut(path: Path, count: int = 40) -> Path:
    path.write_bytes(path.read_bytes()[:-count])
    return path


def packed_series(folder: Path) -> Path:
    return write_series(folder / "series", STORED, UPRIGHT, lambda data, k: data.compress(RLELossless))


def same_fault(path: Path, settings: ReadSettings, told: Callable[[], object]) -> str:
    """Return the line of a fault, which is that of reading the study whole."""
    with pytest.raises(TomomeshError) as whole:
        read_volume(path, settings=settings)
    with pytest.raises(type(whole.value)) as fault:
        told()
    assert str(fault.value) == str(whole.value)
    assert "\n" not in str(fault.value)
    return str(fault.value)


class TestDamage:
    @pytest.mark.parametrize(
        "write",
        [
            with_nibabel(".nii"), with_nibabel(".nii.gz"), with_nibabel(".mgh"), with_nibabel(".mgz"),
            with_itk(".nrrd"), with_itk(".nrrd", True), with_itk(".mha"), with_itk(".mha", True), with_numpy,
        ],
    )  # fmt: skip
    def test_a_file_that_is_cut_off_is_told_when_it_is_opened(self, tmp_path: Path, write: Any) -> None:
        path = cut(write(tmp_path, STORED, UPRIGHT))
        same_fault(path, SPACING, lambda: open_study(path, SPACING))

    def test_a_wrong_check_sum_is_told_when_it_is_opened(self, tmp_path: Path) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        raw = bytearray(path.read_bytes())
        raw[-8] ^= 1
        path.write_bytes(bytes(raw))
        same_fault(path, SPACING, lambda: open_study(path))

    def test_a_slice_that_is_cut_off_is_told_when_its_series_is_opened(self, tmp_path: Path) -> None:
        folder = with_pydicom(tmp_path, STORED, UPRIGHT)
        cut(sorted(folder.iterdir())[3])
        same_fault(folder, SPACING, lambda: open_study(folder))

    def test_a_packed_slice_that_is_damaged_is_told_when_it_is_read(self, tmp_path: Path) -> None:
        folder = packed_series(tmp_path)
        bad = max(folder.iterdir(), key=lambda path: float(dcmread(path).ImagePositionPatient[2]))
        cut(bad)
        opened = open_study(folder)
        assert opened.voxels[0].shape == STORED.shape[1:]
        same_fault(folder, SPACING, lambda: opened.voxels[len(STORED) - 1])
        skipping = open_study(folder, ReadSettings(skip_bad=True))
        assert skipping.shape[0] == len(STORED) - 1
        assert skipping.notes == read_volume(folder, settings=ReadSettings(skip_bad=True)).notes

    def test_slices_that_differ_at_one_place_are_told_when_they_are_opened(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "series", STORED, UPRIGHT)
        write_series(folder / "again", STORED + 1, UPRIGHT)
        same_fault(folder, SPACING, lambda: open_study(folder))

    @pytest.mark.parametrize("how", ["size", "kind", "bytes"])
    def test_a_picture_that_is_damaged_is_told_when_it_is_read(self, tmp_path: Path, how: str) -> None:
        folder = with_pillow(".png")(tmp_path, STORED.astype(np.uint16), UPRIGHT)
        from PIL import Image

        if how == "bytes":
            cut(folder / "slice3.png", 60)
        else:
            shape = (5, 6) if how == "size" else STORED.shape[1:]
            Image.fromarray(np.zeros(shape, np.uint8)).save(folder / "slice3.png")
        opened = open_study(folder, SPACING)
        assert opened.voxels[2].shape == STORED.shape[1:]
        same_fault(folder, SPACING, lambda: opened.voxels[3])

    def test_a_packed_page_that_is_damaged_is_told_when_it_is_read(self, tmp_path: Path) -> None:
        tifffile = needed("tifffile")
        path = tmp_path / "s.tif"
        tifffile.imwrite(path, STORED, compression="zlib", metadata=None)
        with tifffile.TiffFile(path) as pages:
            start, count = pages.pages[3].dataoffsets[0], pages.pages[3].databytecounts[0]
        raw = bytearray(path.read_bytes())
        raw[start : start + count] = bytes(count)
        path.write_bytes(bytes(raw))
        opened = open_study(path, SPACING)
        assert opened.voxels[2].shape == STORED.shape[1:]
        same_fault(path, SPACING, lambda: opened.voxels[3])

    def test_more_than_half_no_numbers_is_told_when_it_is_opened(self, tmp_path: Path) -> None:
        stored = STORED.astype(np.float32)
        stored[1:] = np.nan
        path = with_numpy(tmp_path, stored, UPRIGHT)
        assert "no numbers" in same_fault(path, SPACING, lambda: open_study(path, SPACING))


class TestChunks:
    @pytest.fixture
    def stores(self) -> Any:
        needed("zarr")
        import stores

        return stores

    @pytest.mark.parametrize("zarr_format", [2, 3])
    def test_a_lost_one_is_told_when_it_is_opened(self, tmp_path: Path, stores: Any, zarr_format: int) -> None:
        folder = stores.write(tmp_path / "s.zarr", zarr_format=zarr_format)
        stores.chunk(folder).unlink()
        assert "missing = 1 of 12" in same_fault(folder, SPACING, lambda: open_study(folder))
        filled = open_study(folder, ReadSettings(fill_chunks=True))
        whole = read_volume(folder, settings=ReadSettings(fill_chunks=True))
        assert filled.notes == whole.notes
        np.testing.assert_array_equal(in_memory(filled.voxels[:]), whole.voxels, strict=True)

    @pytest.mark.parametrize("zarr_format", [2, 3])
    def test_a_damaged_one_is_told_when_it_is_read(self, tmp_path: Path, stores: Any, zarr_format: int) -> None:
        folder = stores.write(tmp_path / "s.zarr", zarr_format=zarr_format)
        cut(stores.chunk(folder), 5)
        opened = open_study(folder)
        assert opened.voxels[0].shape == stores.STORED.shape[1:]
        same_fault(folder, SPACING, lambda: opened.voxels[4])

    def test_a_bomb_is_told_before_it_is_unpacked(self, tmp_path: Path, stores: Any) -> None:
        codec = needed("numcodecs").Zstd()
        folder = stores.write(tmp_path / "s.zarr", zarr_format=2, compressors=codec)
        stores.chunk(folder).write_bytes(codec.encode(bytes(2**22)))
        opened = open_study(folder)
        assert "far more than its voxels" in same_fault(folder, SPACING, lambda: opened.voxels[4])

    def test_one_that_goes_after_it_was_opened_is_never_taken_for_fill(self, tmp_path: Path, stores: Any) -> None:
        folder = stores.write(tmp_path / "s.zarr")
        opened = open_study(folder)
        stores.chunk(folder).unlink()
        with pytest.raises(UnreadableError, match=r"^a chunk is gone since the array was opened\. File: .*c/1/1/1"):
            opened.voxels[4]

    def test_only_planes_beside_a_missing_one_are_read(
        self, tmp_path: Path, stores: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from tomomesh.io.volumes.zarr.array import Chunks

        stored = np.zeros((16, 16, 16), np.int16)
        stored[:4, :4, :4] = 7
        stored[0, 0, 0] = 3
        folder = stores.write(tmp_path / "s.zarr", stored)
        boxes: list[Any] = []
        inner = Chunks.read

        def read(self: Chunks, box: tuple[slice, ...]) -> NDArray[Any]:
            boxes.append(box)
            return inner(self, box)

        monkeypatch.setattr(Chunks, "read", read)
        with pytest.raises(FormatError, match="missing = 63 of 64"):
            open_study(folder)
        assert len(boxes) == 3
        assert all(sorted(side.stop - side.start for side in box) == [1, 1, 4, 4] for box in boxes)


class TestChanges:
    @pytest.mark.parametrize("suffix", [".nii", ".mgh"])
    def test_a_file_that_was_written_since_is_refused(self, tmp_path: Path, suffix: str) -> None:
        path = with_nibabel(suffix)(tmp_path, STORED, UPRIGHT)
        opened = open_study(path)
        assert opened.voxels[1].shape == STORED.shape[1:]
        os.utime(path, ns=(1, 1))
        with pytest.raises(UnreadableError, match=r"^the file has changed since it was opened\. File: .*\. Try: "):
            opened.voxels[1]
        path.unlink()
        with pytest.raises(UnreadableError, match="no such file"):
            opened.voxels[1]

    @pytest.mark.parametrize("kind", ["dicom", "png", "tif", "zarr"])
    def test_so_are_slices_pages_and_stores(self, tmp_path: Path, kind: str) -> None:
        stored = STORED.astype(np.uint16)
        if kind == "zarr":
            needed("zarr")
            import stores

            path = stores.write(tmp_path / "s.zarr", stored)
            written = [path / "0" / "zarr.json"]
        elif kind == "tif":
            path = tmp_path / "s.tif"
            needed("tifffile").imwrite(path, stored, compression="zlib", metadata=None)
            written = [path]
        else:
            path = (with_pydicom if kind == "dicom" else with_pillow(".png"))(tmp_path, stored, UPRIGHT)
            written = list(path.iterdir())
        opened = open_study(path, SPACING)
        for file in written:
            os.utime(file, ns=(1, 1))
        with pytest.raises(UnreadableError, match="has changed since"):
            opened.voxels[1]

    def test_what_was_unpacked_stays_as_it_was(self, tmp_path: Path) -> None:
        path = with_nibabel(".nii.gz")(tmp_path, STORED, UPRIGHT)
        opened, whole = open_study(path), read_volume(path)
        sent = pickle.dumps(opened)
        path.unlink()
        np.testing.assert_array_equal(in_memory(opened.voxels[:]), whole.voxels, strict=True)
        with pytest.raises(UnreadableError, match="no such file"):
            pickle.loads(sent).voxels[1]


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
        same_fault(bomb, SPACING, lambda: open_study(bomb))


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
