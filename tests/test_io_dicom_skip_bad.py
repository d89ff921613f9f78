"""Broken files in an otherwise good series: listed, or left out with --skip-bad where the rest is regular."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from studies import AFFINES, assert_in_place, enhanced, sampled, save, write_series
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)
SKIP = ReadSettings(skip_bad=True)


def cut(folder: Path, bytes_left: dict[int, int]) -> list[str]:
    """Cut the files of some slices off; a negative number counts from the end. Return their names."""
    names = []
    for k, left in bytes_left.items():
        path = next(folder.glob(f"*-{k}.dcm"))
        path.write_bytes(path.read_bytes()[:left])
        names.append(path.name)
    return names


HEADER, PIXELS = 400, -20


@pytest.mark.parametrize("left", [HEADER, PIXELS])
class TestKinds:
    """The same whether it is the header that is cut off, or the pixels."""

    def test_one_is_named_with_its_own_fault_and_the_flag(self, tmp_path: Path, left: int) -> None:
        [name] = cut(write_series(tmp_path / "s", STORED, AXIAL), {0: left})
        with pytest.raises(FormatError, match=rf"cut off.*{name}.*--skip-bad"):
            read_volume(tmp_path / "s")

    def test_several_are_listed(self, tmp_path: Path, left: int) -> None:
        names = cut(write_series(tmp_path / "s", STORED, AXIAL), {3: left, 4: left})
        with pytest.raises(FormatError, match=r"2 of 5 files cannot be read.*--skip-bad") as caught:
            read_volume(tmp_path / "s")
        assert all(name in str(caught.value) for name in names)

    def test_at_the_end_of_the_stack_they_are_left_out_and_said(self, tmp_path: Path, left: int) -> None:
        names = cut(write_series(tmp_path / "s", STORED, AXIAL), {0: left, 4: left})
        volume = read_volume(tmp_path / "s", settings=SKIP)
        assert_in_place(volume)
        assert volume.shape == (3, 7, 9)
        note, now = volume.notes
        assert now == "the distance of the slices is now 2 mm, from the first to the last 4 mm"
        assert note.startswith("unreadable files left out: 2 (")
        assert all(name in note for name in names)

    def test_every_second_one_leaves_no_gap_and_twice_the_distance_is_said(self, tmp_path: Path, left: int) -> None:
        cut(write_series(tmp_path / "s", STORED, AXIAL), {1: left, 3: left})
        volume = read_volume(tmp_path / "s", settings=SKIP)
        assert_in_place(volume)
        assert volume.notes[1:] == ("the distance of the slices is now 4 mm, from the first to the last 8 mm",)

    def test_in_its_middle_they_leave_a_gap_that_is_refused(self, tmp_path: Path, left: int) -> None:
        cut(write_series(tmp_path / "s", STORED, AXIAL), {2: left})
        with pytest.raises(GeometryError, match=r"missing: 1.*--fill-gaps"):
            read_volume(tmp_path / "s", settings=SKIP)
        assert_in_place(read_volume(tmp_path / "s", settings=ReadSettings(skip_bad=True, fill_gaps=True)), 1.01)

    def test_where_none_is_left_the_fault_stays(self, tmp_path: Path, left: int) -> None:
        cut(write_series(tmp_path / "s", STORED, AXIAL), dict.fromkeys(range(5), left))
        for settings in (ReadSettings(), SKIP):
            with pytest.raises(FormatError, match="cut off") as caught:
                read_volume(tmp_path / "s", settings=settings)
            assert "--skip-bad" not in str(caught.value)


def test_headers_and_pixels_may_be_broken_in_one_series(tmp_path: Path) -> None:
    cut(write_series(tmp_path / "s", STORED, AXIAL), {0: HEADER, 4: PIXELS})
    volume = read_volume(tmp_path / "s", settings=SKIP)
    assert_in_place(volume)
    assert [note.split(" (")[0] for note in volume.notes[:2]] == ["unreadable files left out: 1"] * 2


def test_a_sound_series_is_read_the_same_with_the_flag(tmp_path: Path) -> None:
    volume = read_volume(write_series(tmp_path / "s", STORED, AXIAL), settings=SKIP)
    assert_in_place(volume)
    assert volume.notes == ()


def test_of_one_slice_there_is_no_distance(tmp_path: Path) -> None:
    cut(write_series(tmp_path / "s", STORED, AXIAL), dict.fromkeys(range(1, 5), HEADER))
    notes = read_volume(tmp_path / "s", settings=ReadSettings(skip_bad=True, spacing_z=2)).notes
    assert notes[0].startswith("unreadable files left out: 4 (")
    assert not any("is now" in note for note in notes)


def test_a_broken_copy_of_a_slice_leaves_the_other(tmp_path: Path) -> None:
    folder = write_series(tmp_path / "s", STORED, AXIAL)
    whole = next(folder.glob("*-2.dcm"))
    (folder / "again.dcm").write_bytes(whole.read_bytes()[:PIXELS])
    assert_in_place(read_volume(folder, settings=SKIP))


def test_names_are_shown_without_what_could_write_to_a_terminal(tmp_path: Path) -> None:
    folder = write_series(tmp_path / "s", STORED, AXIAL)
    [name] = cut(folder, {0: PIXELS})
    (folder / name).rename(folder / "a\x1b[31m.dcm")
    note, _ = read_volume(folder, settings=SKIP).notes
    assert note == "unreadable files left out: 1 (a?[31m.dcm)"


def test_many_names_are_cut_short(tmp_path: Path) -> None:
    folder = write_series(tmp_path / "s", STORED, AXIAL)
    for n in range(20):
        (folder / f"bad-{n:02d}").write_bytes(next(folder.glob("*-2.dcm")).read_bytes()[:HEADER])
    with pytest.raises(FormatError, match=r"20 of 25 files.*bad-07, \.\.\."):
        read_volume(folder)


def test_all_frames_of_a_broken_file_go_with_it(tmp_path: Path) -> None:
    path = save(enhanced(STORED, AXIAL, [0, 1, 2, 3, 4]), tmp_path / "e.dcm")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(FormatError, match="cut off"):
        read_volume(path, settings=SKIP)
