"""What the page is told of a study is the study: its slices, what the settings keep of it, and what may be opened."""

from __future__ import annotations

import json
import shlex
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("starlette")

from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from segmentations import written
from studies import TURNED, affine_of, sampled, setting, write_nifti, write_series
from tomomesh import Volume, phantom, read_volume, segment
from tomomesh.errors import EmptyError, UsageError
from tomomesh.model.volume import AXES
from tomomesh.segmentation.study import lay_out, select_in, select_study
from tomomesh.segmentation.survey import survey
from tomomesh.settings import Settings
from tomomesh.view import slices, studies, windows
from tomomesh.view.opened import Opened
from tomomesh.view.reach import Reach
from tomomesh.view.session import Session
from tomomesh.view.windows import Kept

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from starlette.responses import Response

    from tomomesh.progress import Progress
    from tomomesh.segmentation.study import LaidOut

HEAD = phantom((14, 40, 36), (6.0, 6.0, 11.0))
SHAPE = (5, 7, 9)


def session_of(volume: Volume, **choices: Any) -> Session:
    return Session(Opened("study", ("study.nii",), volume=volume), choices)


def numbers(answer: Response) -> NDArray[Any]:
    shape = tuple(map(int, answer.headers["x-shape"].split(",")))
    return np.frombuffer(bytes(answer.body), "<" + answer.headers["x-dtype"]).reshape(shape)


def opened(session: Session) -> Session:
    """Wait until a study is read, or refused."""
    if (job := session.jobs.now) is not None and job.thread is not None:
        job.thread.join()
    return session


class TestSlices:
    @pytest.mark.parametrize("kind", ["<i2", ">i2", "u1", "i1", "<u2", "<i4", "<f4", "<f8", "<f2", "<i8"])
    def test_a_slice_is_the_volumes(self, kind: str) -> None:
        stored = np.arange(60).reshape(3, 4, 5).astype(kind)
        session = session_of(Volume.from_stored(stored, affine_of(np.diag([-1.0, 1, -1]))))
        voxels = session.opened.volume.voxels  # type: ignore[union-attr]
        for plane in AXES:
            axis = slices.axis_of(plane)
            for k in range(voxels.shape[axis]):
                found = numbers(slices._slice(session, plane, str(k)))
                assert found.tolist() == voxels.take(k, axis).tolist()

    def test_slices_in_color_have_their_layers(self) -> None:
        stored = np.arange(72, dtype=np.uint8).reshape(2, 3, 4, 3)
        session = session_of(Volume.from_stored(stored, np.eye(4)))
        assert numbers(slices._slice(session, "coronal", "1")).tolist() == stored[:, 1].tolist()

    @pytest.mark.parametrize(("plane", "k"), [("axial", "5"), ("axial", "-1"), ("axial", "x"), ("oblique", "0")])
    def test_there_are_no_others(self, plane: str, k: str) -> None:
        session = session_of(Volume.from_stored(np.zeros(SHAPE), np.eye(4)))
        with pytest.raises((LookupError, ValueError)):
            slices._slice(session, plane, k)

    @pytest.mark.parametrize("name", TURNED)
    def test_letters_and_steps_are_the_patients(self, name: str) -> None:
        volume = Volume.from_stored(sampled(TURNED[name]), TURNED[name])
        told = slices._planes(session_of(volume))
        for plane in told["planes"].values():
            for side, axis, step in zip(
                ("rows", "columns"), (plane["rows"], plane["columns"]), plane["pixel_mm"], strict=True
            ):
                direction = volume.affine[:3, 2 - axis]
                assert step == pytest.approx(np.linalg.norm(direction))
                main = int(np.argmax(np.abs(direction)))
                come, to = plane["letters"][side]
                assert (come[0], to[0]) == ("RAI"[main], "LPS"[main])[:: 1 if direction[main] > 0 else -1]
                assert len(come) == len(to) == (np.abs(direction / step) > slices.ALONG).sum()

    def test_nothing_waits_for_short_integers(self) -> None:
        told = slices._planes(session_of(Volume.from_stored(np.ones(SHAPE, np.int16), np.eye(4))))
        assert (told["lowest"], told["highest"], told["whole"]) == (-(2**15), 2**15 - 1, True)
        told = slices._planes(session_of(Volume.from_stored(np.full(SHAPE, 0.5), np.eye(4))))
        assert (told["lowest"], told["highest"], told["whole"]) == (0.5, 0.5, False)


WINDOWS: dict[str, dict[str, Any]] = {
    "otsu": {}, "given": {"lower": 60.0}, "between": {"lower": 60.0, "upper": 180.0}, "all": {"keep": "all"},
    "largest": {"keep": "largest", "upper": 150.0}, "range": {"slice_range": (3, 9)},
    "box": {"lower": 60.0, "roi": (-60.0, 70.0, -50.0, 90.0, -60.0, 50.0)},
}  # fmt: skip


class TestBeside:
    """A label map beside the study: chosen by its labels, drawn over its gray levels."""

    @pytest.fixture
    def session(self, tmp_path: Path) -> Session:
        stored = np.zeros(HEAD.volume.shape, np.uint8)
        stored[3:9, 10:20, 5:15], stored[3:9, 20:30, 15:25] = 4, 7
        gray = write_nifti(tmp_path / "gray.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
        beside = write_nifti(tmp_path / "labels.nii", stored[:, ::-1], HEAD.volume.affine @ flipped(1, stored.shape[1]))
        session = Session(Opened("study", (str(gray),), str(beside)))
        session.read(session.opened)
        return opened(session)

    def test_its_labels_are_told_and_chosen(self, session: Session) -> None:
        assert slices._planes(session)["labelled"]
        assert studies._study(session)["labels"] == {"4": 600, "7": 600}
        windows._pick(session, {"voxel": [5, 25, 20]})
        assert session.settings.window.select == (7,)
        assert [one["voxels"] for one in windows.kept(session)[1].listed()] == [600]
        windows._pick(session, {"voxel": [5, 15, 10]})
        assert session.choices.values == {"select": (4, 7)}
        windows._pick(session, {"voxel": [5, 25, 20]})
        assert session.choices.values == {"select": (4,)}
        with pytest.raises(UsageError, match="no label lies here"):
            windows._pick(session, {"voxel": [0, 0, 0]})

    def test_they_are_sent_as_they_lie_over_the_study(self, session: Session) -> None:
        for plane, axis in {"axial": 0, "coronal": 1, "sagittal": 2}.items():
            across = np.moveaxis(session.opened.laid.voxels, axis, 0)  # type: ignore[union-attr]
            sent = np.frombuffer(slices._labels(session, plane, "8").body, np.uint8)
            assert np.array_equal(sent.reshape(across.shape[1:]), across[8])
        assert session.opened.laid.voxels[5, 15, 10] == 4  # type: ignore[union-attr]

    def test_the_command_names_it_where_it_matters(self, session: Session) -> None:
        assert "--labels-in" not in session.command
        session.choose({"select": [4]})
        gray, beside = session.opened.words[0], session.opened.beside
        assert shlex.split(session.command) == [
            "tomomesh", "reconstruct", gray, "--labels-in", beside, "--select=4", "-o", "mesh.stl",
        ]  # fmt: skip

    def test_others_can_be_chosen_after_one(self, tmp_path: Path) -> None:
        """A segmentation is read whole, whatever is chosen."""
        session = segmented(tmp_path, {1: self.box(5, 10), 3: self.box(10, 15)}, select=[1])
        assert studies._study(session)["labels"] == {"1": 300, "3": 300}
        before = session.opened
        session.choose({"select": [1, 3]})
        assert session.opened is before
        assert [one["voxels"] for one in windows.kept(session)[1].listed()] == [600]

    def test_read_whole_it_keeps_and_tells_what_the_command_does(self, tmp_path: Path) -> None:
        session = segmented(tmp_path, {1: self.box(5, 10), 3: self.box(10, 15)}, select=[3])
        assert session.opened.volume is not None
        labels = read_volume(session.opened.beside, select=(3,))
        alone, (_, found) = select_study(session.opened.volume, labels, session.settings), windows.kept(session)
        assert found.told == {**alone.stats, "warnings": list(alone.warnings)}
        assert np.array_equal(found.selected.mask, alone.value.mask)

    def test_of_labels_that_overlap_those_are_read_that_are_chosen(self, tmp_path: Path) -> None:
        session = segmented(tmp_path, {1: self.box(5, 10), 3: self.box(8, 15)})
        assert "segments overlap" in session.opened.refused
        assert studies._series(session)["segments"] == {"1": "Liver", "3": "Tumor"}
        session.choose({"select": [1]})
        told = studies._study(opened(session))
        assert (told["labels"], told["label_names"]["3"]) == ({"1": 300, "3": None}, "Tumor")
        session.choose({"select": [1, 3]})
        assert studies._study(opened(session))["labels"] == {"1": 300, "3": 300}
        assert windows.kept(session)[1].runs.mask.count == 600

    def box(self, first: int, last: int) -> NDArray[np.bool_]:
        mask = np.zeros(HEAD.volume.shape, np.bool_)
        mask[3:9, 10:20, first:last] = True
        return mask

    def test_one_that_does_not_fit_is_refused(self, tmp_path: Path) -> None:
        gray = write_nifti(tmp_path / "gray.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
        beside = write_nifti(tmp_path / "other.nii", np.ones((4, 4, 4), np.uint8), np.diag([3.0, 3, 3, 1]))
        session = Session(Opened("study", (str(gray),), str(beside)))
        session.read(session.opened)
        assert "grid" in opened(session).opened.refused


def segmented(folder: Path, masks: dict[int, NDArray[np.bool_]], **choices: Any) -> Session:
    """Open a study with a DICOM segmentation over it."""
    gray = write_nifti(folder / "gray.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    session = Session(
        Opened("study", (str(gray),), str(written(masks, HEAD.volume.affine, folder / "seg.dcm"))), choices
    )
    session.read(session.opened)
    return opened(session)


def flipped(axis: int, size: int) -> NDArray[np.float64]:
    """Return what leads from the indices (i, j, k) of a flipped array to those of the array."""
    turn = np.eye(4)
    turn[axis, axis], turn[axis, 3] = -1, size - 1
    return turn


def kept_of(volume: Volume, settings: Settings) -> Kept:
    return Kept.of(lay_out(volume, None, settings, labelled=False), volume, settings)


class TestKept:
    @pytest.mark.parametrize("direction", ["axial", "coronal", "sagittal"])
    @pytest.mark.parametrize("name", WINDOWS)
    def test_it_is_what_the_run_keeps(self, name: str, direction: str) -> None:
        settings = Settings().replace(slices=direction, **WINDOWS[name])
        kept = kept_of(HEAD.volume, settings)
        whole = np.stack([kept.plane(0, k, HEAD.volume.shape[1:]) for k in range(HEAD.volume.shape[0])])
        run = segment(HEAD.volume, settings, neurons=8)
        expected = np.zeros(HEAD.volume.shape, bool)
        k, j, i = np.nonzero(run.mask)
        at = run.volume.to_mm(np.column_stack([i, j, k]).astype(float))
        expected[tuple(np.rint(HEAD.volume.to_indices(at)).astype(int).T[::-1])] = True
        assert (whole > 0).tolist() == expected.tolist()
        assert kept.told["window"]["voxels"] == expected.sum()

    @law(60)
    @given(st.integers(0, 2**60 - 1), st.sampled_from(AXES))
    def test_planes_are_cuts_of_one_volume(self, bits: int, direction: str) -> None:
        stored = np.array([bits >> n & 1 for n in range(60)], np.uint8).reshape(3, 4, 5)
        if stored.min() == stored.max():
            return
        volume = Volume.from_stored(stored, np.eye(4))
        kept = kept_of(volume, Settings().replace(lower=0.5, keep="all", slices=direction))
        whole = np.stack([kept.plane(0, k, (4, 5)) for k in range(3)])
        assert ((whole > 0) == (stored > 0)).all()
        assert np.stack([kept.plane(1, j, (3, 5)) for j in range(4)], 1).tolist() == whole.tolist()
        assert np.stack([kept.plane(2, i, (3, 4)) for i in range(5)], 2).tolist() == whole.tolist()
        sizes = np.bincount(whole.ravel())[1:]
        listed = kept.listed()
        assert [one["voxels"] for one in listed] == sizes.tolist() == sorted(sizes.tolist(), reverse=True)
        assert [int(whole[tuple(one["inside"])]) for one in listed] == [one["number"] for one in listed]

    def test_many_components_share_the_last_number(self) -> None:
        stored = np.zeros((1, 60, 60), np.uint8)
        stored[0, ::2, ::2] = 1
        stored[0, 0, 0:3] = 1
        kept = kept_of(Volume.from_stored(stored, np.eye(4)), Settings().replace(lower=0.5, keep="all"))
        drawn = kept.plane(0, 0, (60, 60))
        assert drawn[0, 0] == 1
        assert set(drawn[stored[0] > 0].tolist()) == set(range(1, 256))
        assert len(kept.listed()) == windows.LISTED

    @pytest.mark.parametrize("scale", [1.0, 0.0007, 300.0])
    def test_the_place_of_a_component_picks_it(self, scale: float) -> None:
        stored = np.zeros((6, 9, 9), np.uint8)
        stored[1:5, 1:3, 1:8], stored[1:5, 5:8, 2:7] = 1, 1
        volume = Volume.from_stored(
            stored, affine_of(np.diag([1.0, -1, 1])) * np.array([[scale], [scale], [scale], [1]])
        )
        kept = kept_of(volume, Settings().replace(lower=0.5))
        for one in kept.listed():
            alone = kept_of(volume, Settings().replace(lower=0.5, keep_at=[one["place"]]))
            assert [other["voxels"] for other in alone.listed()] == [one["voxels"]]
            assert alone.listed()[0]["inside"] == one["inside"]

    @law(40)
    @given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=12))
    def test_clicks_leave_out_and_bring_back(self, clicks: list[tuple[int, int]]) -> None:
        """Whichever voxel of a component is clicked; but the last one stays."""
        stored = np.zeros((3, 9, 9), np.uint8)
        corners = [(0, 0), (0, 5), (5, 0), (5, 5)]
        for j, i in corners:
            stored[:, j : j + 3, i : i + 3] = 1
        session = session_of(Volume.from_stored(stored, np.diag([2.0, 0.5, 1.0, 1.0])), lower=0.5)
        there = {0, 1, 2, 3}
        for part, off in clicks:
            voxel = [off, corners[part][0] + off, corners[part][1] + 2 - off]
            if there == {part}:
                with pytest.raises(UsageError, match="no other component"):
                    windows._pick(session, {"voxel": voxel})
                continue
            windows._pick(session, {"voxel": voxel})
            there ^= {part}
            plane = windows.kept(session)[1].plane(0, 1, (9, 9))
            assert [bool(plane[j, i]) for j, i in corners] == [n in there for n in range(4)]
        with pytest.raises(UsageError, match="nothing of the window"):
            windows._pick(session, {"voxel": [0, 4, 4]})

    def test_a_component_that_is_kept_alone_is_joined_by_a_click(self) -> None:
        stored = np.zeros((2, 3, 9), np.uint8)
        stored[:, :, ::4] = 1
        session = session_of(Volume.from_stored(stored, np.eye(4)), lower=0.5, keep="all", keep_at=[(4, 1, 0)])
        windows._pick(session, {"voxel": [1, 2, 8]})
        assert session.choices.values["keep_at"] == ((4, 1, 0), (8, 2, 1))
        windows._pick(session, {"voxel": [0, 0, 4]})
        assert session.choices.values == {"lower": 0.5, "keep": "all", "keep_at": ((8, 2, 1),)}
        session.undo()
        session.undo()
        assert session.choices.values["keep_at"] == ((4, 1, 0),)

    def test_the_same_choices_are_looked_at_once(self) -> None:
        session = session_of(HEAD.volume, lower=60.0)
        first = windows.kept(session)
        session.choose({"neurons": 50})
        assert windows.kept(session)[1] is first[1]
        session.choose({"lower": 80.0})
        other = windows.kept(session)
        assert other[0] != first[0]
        session.undo()
        assert windows.kept(session)[1] is first[1]
        shape = HEAD.volume.shape
        assert numbers(windows._plane(session, "axial", "3", other[0])).shape == shape[1:]
        with pytest.raises(LookupError):
            windows._plane(session, "axial", "3", "another")

    @pytest.mark.parametrize("meanwhile", [lambda one: one.choose({"lower": 9.0}), lambda one: one.open(one.opened)])
    def test_what_nobody_waits_for_any_more_is_given_up(
        self, monkeypatch: pytest.MonkeyPatch, meanwhile: Callable[[Session], Any]
    ) -> None:
        session = session_of(HEAD.volume, lower=60.0)

        def overtaken(study: LaidOut, settings: Settings, progress: Progress) -> Any:
            monkeypatch.setattr(windows, "select_in", select_in)
            threading.Thread(target=meanwhile, args=(session,), daemon=True).start()
            while True:
                progress("window", 1, 4)

        monkeypatch.setattr(windows, "select_in", overtaken)
        with pytest.raises(LookupError):
            windows.kept(session)

    def test_a_window_that_keeps_nothing_says_so(self) -> None:
        session = session_of(HEAD.volume, lower=1e6)
        with pytest.raises(EmptyError) as fault:
            windows.kept(session)
        assert windows._kept(session) == {"refused": str(fault.value), "flags": []}

    def test_nothing_is_kept_before_a_study_is_open(self) -> None:
        session = Session(Opened("study", ("study.nii",)))
        for ask in (windows._kept, studies._study, slices._planes):
            with pytest.raises(UsageError):
                ask(session)


class TestSurvey:
    def test_the_page_has_more_bars_of_the_same_levels(self) -> None:
        session = session_of(HEAD.volume)
        told, printed = studies._study(session), survey(HEAD.volume)
        assert told["windows"] == printed["windows"]
        assert sum(told["histogram"]) == sum(printed["histogram"])
        assert 32 < len(told["histogram"]) <= studies.BARS
        assert told["slices"] == "axial"
        session.choose({"slices": "sagittal"})
        assert studies._study(session)["slices"] == "sagittal"
        json.dumps(told)

    @pytest.mark.parametrize("most", [2, 10, 100, 512])
    def test_whole_levels_share_bars_evenly(self, most: int) -> None:
        levels = np.arange(0, 361, dtype=np.int16).reshape(19, 19, 1)
        bars = survey(Volume.from_stored(levels, np.eye(4)), most)["histogram"]
        assert len(bars) <= most
        assert sum(bars) == 361
        assert max(bars[:-1], default=0) - min(bars[:-1], default=0) <= 1

    def test_shares_are_those_of_the_window(self) -> None:
        for volume in (HEAD.volume, Volume.from_stored(HEAD.volume.voxels.astype(np.float32) / 7, np.eye(4))):
            for window in survey(volume)["windows"].values():
                inside = volume.voxels > window["lower"]
                assert window["share"] == inside.mean()


class TestOpening:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        inside, outside = tmp_path / "inside", tmp_path / "outside"
        inside.mkdir()
        outside.mkdir()
        for path in (inside / "a.nii", outside / "b.nii"):
            write_nifti(path, sampled(TURNED["axial"]), TURNED["axial"])
        (inside / "link.nii").symlink_to(outside / "b.nii")
        (inside / "there").symlink_to(outside)
        return tmp_path

    def outside(self, folder: Path) -> list[str]:
        inside = folder / "inside"
        return [
            str(folder / "outside" / "b.nii"), str(inside / "link.nii"), str(inside / "there" / "b.nii"),
            str(inside / ".." / "outside" / "b.nii"), str(folder), "/etc/passwd", "", "a\0b", str(folder / "nowhere"),
        ]  # fmt: skip

    def test_only_what_was_named_can_be_opened(self, folder: Path) -> None:
        named = str(folder / "inside" / "a.nii")
        session = Session(Opened("study", (named,)), None, Reach((named,)))
        for path in self.outside(folder):
            with pytest.raises(UsageError, match="named on the command line"):
                studies._open(session, {"path": path})
        state = studies._open(session, {"path": named})
        assert state["opened"]["name"] == "a.nii"
        assert opened(session).opened.volume is not None

    def test_all_in_a_folder_can_be_browsed_and_no_link_leads_out(self, folder: Path) -> None:
        session = Session(Opened(), None, Reach((), folder / "inside"))
        assert [one["name"] for one in studies._files(session)["files"]] == ["a"]
        for path in self.outside(folder):
            with pytest.raises(UsageError, match="named on the command line"):
                studies._open(session, {"path": path})
        studies._open(session, {"path": str(folder / "inside" / "a.nii")})
        assert opened(session).opened.volume is not None

    @pytest.mark.parametrize("body", [{}, [], {"path": 3}, {"series": 1}])
    def test_something_has_to_be_named(self, body: Any) -> None:
        with pytest.raises(UsageError):
            studies._open(Session(Opened(), None), body)

    def test_what_was_chosen_goes_with_the_study(self, folder: Path) -> None:
        named = str(folder / "inside" / "a.nii")
        session = Session(Opened("study", (named,)), {"lower": 5.0}, Reach((named,)))
        state = studies._open(session, {"path": named})
        assert state["choices"] == {}
        assert (state["undo"], state["redo"]) == (0, 0)
        opened(session)


@pytest.fixture
def two(tmp_path: Path) -> Path:
    """Write a folder of two series."""
    folder = tmp_path / "two"
    for n, slices_of in ((1, 5), (2, 3)):
        uid = setting(SeriesInstanceUID=f"1.2.{n}", SeriesNumber=n, SeriesDescription=f"series {n}")
        own = setting(SOPInstanceUID=tuple(f"1.2.{n}.{k}" for k in range(5)))

        def edit(data: Any, k: int, uid: Any = uid, own: Any = own) -> None:
            uid(data, k)
            own(data, k)
            data.file_meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID

        write_series(folder / str(n), sampled(TURNED["axial"])[:slices_of], TURNED["axial"], edit)
    return folder


def test_a_series_is_chosen_and_taken_back(two: Path) -> None:
    session = Session(Opened("study", (str(two),)), None, Reach((str(two),)))
    session.read(session.opened)
    state = opened(session).state
    assert not state["opened"]["ready"]
    assert "2 series" in state["opened"]["refused"]
    assert state["opened"]["flags"] == ["--series"]
    listed = studies._series(session)["series"]
    assert [(one["number"], one["slices"], one["refused"]) for one in listed] == [(1, 5, None), (2, 3, None)]
    session.choose({"series": 2})
    assert opened(session).opened.volume.shape[0] == 3  # type: ignore[union-attr]
    assert session.command == f"tomomesh reconstruct {two} --series 2 -o mesh.stl"
    assert [one["number"] for one in studies._series(session)["series"]] == [1, 2]
    session.undo()
    assert "2 series" in opened(session).opened.refused


def test_a_refused_study_says_why_and_is_read_once_that_is_mended(tmp_path: Path) -> None:
    folder = write_series(tmp_path / "gap", sampled(TURNED["axial"]), TURNED["axial"], slices=[0, 1, 3, 4])
    session = Session(Opened("study", (str(folder),)), None, Reach((str(folder),)))
    session.read(session.opened)
    told = opened(session).state["opened"]
    assert "slices are missing" in told["refused"]
    assert "--fill-gaps" in told["flags"]
    assert studies._series(session)["series"][0]["refused"]["error"].startswith("slices are missing")
    with pytest.raises(UsageError, match="slices are missing"):
        slices._planes(session)
    session.choose({"fill_gaps": True})
    assert opened(session).opened.ready
    assert not session.opened.refused


def test_what_is_read_otherwise_waits_for_other_work(tmp_path: Path) -> None:
    path = write_nifti(tmp_path / "a.nii", sampled(TURNED["axial"]), TURNED["axial"])
    session, over = Session(Opened("study", (str(path),), volume=HEAD.volume)), threading.Event()

    def work(progress: Progress) -> None:
        over.wait()

    job = session.jobs.start("reconstruct", work)
    with pytest.raises(UsageError, match="underway"):
        session.choose({"nifti_form": "qform"})
    assert session.choices.values == {}
    over.set()
    assert job.thread is not None
    job.thread.join()
    session.choose({"nifti_form": "qform"})
    assert opened(session).opened.volume.shape == SHAPE  # type: ignore[union-attr]
