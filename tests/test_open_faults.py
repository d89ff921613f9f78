"""Studies that are read part by part: what is damaged, gone or changed, told in one line; and what is left of it."""

from __future__ import annotations

import os
import pickle
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydicom import dcmread
from pydicom.uid import RLELossless

from conftest import law
from studies import AFFINES, sampled, write_series
from tomomesh.errors import FormatError, TomomeshError, UnreadableError
from tomomesh.io import open_study, read_volume
from tomomesh.model.lazy import ArraySource, LazyVoxels, in_memory
from tomomesh.settings import ReadSettings
from writers import needed, with_itk, with_nibabel, with_numpy, with_pillow, with_pydicom

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

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


def fill_by_the_definition(
    voxels: NDArray[Any], missing: NDArray[np.bool_], chunks: tuple[int, ...], fill: float
) -> bool:
    """Look at every voxel of another chunk that touches one of a missing chunk."""
    gone = missing
    for axis, chunk in enumerate(chunks):
        gone = np.repeat(gone, chunk, axis)[(*(slice(None),) * axis, slice(0, voxels.shape[axis]))]
    for place in np.argwhere(missing):
        other = area = 0
        inside = tuple(slice(n * chunk, (n + 1) * chunk) for n, chunk in zip(place, chunks, strict=True))
        for index in np.argwhere(np.ones_like(gone[inside])) + [side.start for side in inside]:
            for axis, step in product(range(voxels.ndim), (-1, 1)):
                beside = index.copy()
                beside[axis] += step
                if not 0 <= beside[axis] < voxels.shape[axis] or gone[tuple(beside)]:
                    continue
                area += 1
                other += bool(voxels[tuple(beside)] != fill)
        if other > 0.25 * area:
            return False
    return True


class TestFillRule:
    @law(60)
    @given(
        seed=st.integers(0, 10**6), chunks=st.tuples(*3 * [st.integers(1, 4)]), share=st.sampled_from([0.1, 0.3, 0.6])
    )
    def test_it_is_that_of_the_definition(self, seed: int, chunks: tuple[int, ...], share: float) -> None:
        pytest.importorskip("zarr", reason="the package zarr is not installed")
        from tomomesh.io.volumes.zarr.missing import are_fill

        rng = np.random.default_rng(seed)
        voxels = (rng.random((5, 4, 6)) < rng.choice([0.02, 0.15, 0.3])).astype(np.int16)
        missing = rng.random([-(-size // chunk) for size, chunk in zip(voxels.shape, chunks, strict=True)]) < share
        expected = fill_by_the_definition(voxels, missing, chunks, 0)
        assert are_fill(voxels, missing, chunks, 0) == expected
        assert are_fill(LazyVoxels.of(ArraySource(voxels, chunks)), missing, chunks, 0) == expected


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
