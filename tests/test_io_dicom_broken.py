"""DICOM files that are broken, and folders that hold other things."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence

from studies import AFFINES, assert_in_place, sampled, save, setting, slice_dataset, without, write_series
from tomomesh.errors import FormatError, ResourceError, UnreadableError
from tomomesh.io import read_volume
from tomomesh.io.files import limits
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


class TestBrokenFiles:
    def test_a_header_that_is_cut_off_is_named(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        worst = sorted(folder.iterdir())[2]
        worst.write_bytes(worst.read_bytes()[:400])
        with pytest.raises(FormatError, match=worst.name):
            read_volume(folder)

    def test_pixels_that_are_cut_off_are_named_with_both_sizes(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        worst = sorted(folder.iterdir())[2]
        worst.write_bytes(worst.read_bytes()[:-20])
        with pytest.raises(FormatError) as caught:
            read_volume(folder)
        assert f"{worst.name} [data = 106 bytes]. Expected: 126 bytes" in str(caught.value)

    @pytest.mark.parametrize(("rows", "word"), [(14, "cut off"), (3, "more pixels")])
    def test_a_wrong_number_of_rows_is_refused(self, tmp_path: Path, rows: int, word: str) -> None:
        with pytest.raises(FormatError, match=word):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, setting(Rows=rows)))

    def test_a_header_without_pixels_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FormatError, match="PixelData = missing"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, without("PixelData")))

    def test_pixels_beyond_the_memory_are_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        monkeypatch.setattr(limits, "physical_memory", lambda: 200)
        with pytest.raises(ResourceError):
            read_volume(folder)

    @pytest.mark.parametrize("depth", [10, 300])
    def test_nested_sequences_never_recurse_without_end(self, tmp_path: Path, depth: int) -> None:
        raw = b""
        for _ in range(depth):
            item = b"\xfe\xff\x00\xe0\xff\xff\xff\xff" + raw + b"\xfe\xff\x0d\xe0\x00\x00\x00\x00"
            raw = b"\x40\x00\x30\xa7SQ\x00\x00\xff\xff\xff\xff" + item
            raw += b"\xfe\xff\xdd\xe0\x00\x00\x00\x00"
        path = save(slice_dataset(STORED[0], AXIAL, 0), tmp_path / "deep.dcm")
        whole = path.read_bytes()
        place = whole.index(b"\xe0\x7f\x10\x00")
        path.write_bytes(whole[:place] + raw + whole[place:])
        settings = ReadSettings(spacing_z=1)
        if depth < 100:
            assert read_volume(path, settings=settings).shape == (1, 7, 9)
        else:
            with pytest.raises(FormatError):
                read_volume(path, settings=settings)

    def test_text_with_the_suffix_of_dicom_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "t.dcm").write_text("text " * 100)
        with pytest.raises(FormatError, match="0 of 1 files"):
            read_volume(tmp_path / "t.dcm")

    def test_a_field_of_text_where_a_number_belongs_is_refused_without_its_value(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        path = sorted(folder.iterdir())[0]
        path.write_bytes(
            path.read_bytes().replace(b"0.7000000000", b"Secret^Name "[:12]).replace(b"0.7\\0.5 ", b"Secr\\t. ")
        )
        with pytest.raises(FormatError) as caught:
            read_volume(folder)
        assert "Secr" not in str(caught.value)

    def test_empty_modality_tables_are_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.ModalityLUTSequence = Sequence([Dataset()])

        with pytest.raises(FormatError, match="table"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))


class TestPaths:
    def test_links_that_leave_the_folder_are_not_followed(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, slices=[0, 1, 2])
        write_series(tmp_path / "t", STORED, AXIAL, slices=[3])
        (folder / "out.dcm").symlink_to(next((tmp_path / "t").iterdir()))
        (folder / "loop.dcm").symlink_to(folder / "loop.dcm")
        os.mkfifo(folder / "pipe.dcm")
        volume = read_volume(folder)
        assert volume.shape == (3, 7, 9)
        assert volume.notes == (
            "left out: 1 links that lead nowhere, 1 links that leave the folder, 1 no regular files",
        )

    def test_links_inside_the_folder_are_read(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        first = sorted(folder.iterdir())[0]
        (folder / ".hidden").mkdir()
        first.rename(folder / ".hidden" / "x")
        first.symlink_to(folder / ".hidden" / "x")
        assert_in_place(read_volume(folder))

    def test_an_empty_folder_is_unreadable(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableError, match="empty"):
            read_volume(tmp_path)

    def test_a_folder_without_images_counts_the_reasons(self, tmp_path: Path) -> None:
        (tmp_path / "a.txt").write_text("x")
        (tmp_path / "b.nii").write_text("x")
        (tmp_path / ".c").write_text("x")
        with pytest.raises(
            FormatError,
            match=r"0 of 3 files are images.*1 \.nii files, 1 hidden, 1 of an unknown kind.*the file of the volume",
        ):
            read_volume(tmp_path)
