"""Every label of a label map by itself, from one reading: to the byte what a run for that label alone writes."""

from __future__ import annotations

import csv
import json
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import nibabel
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from conftest import law
from segmentations import written as dicom_segmentation
from studies import write_nifti
from test_io_nrrd import BALL, CORE, layered, segment
from tomomesh import TomomeshError, Volume, reconstruct, reconstruct_labels
from tomomesh.cli import main
from tomomesh.cli.each_label import SINGLE
from tomomesh.errors import UsageError
from tomomesh.segmentation.labels import Labelled

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

    from tomomesh.results import Surface

T = TypeVar("T")

APOSTROPHE = "'"
"""In front of what a spreadsheet may take for a formula."""
AFFINE = np.array([[-0.7, 0.0, 0.0, 10.3], [0.0, 0.8, 0.1, -77.1], [0.0, 0.0, 1.3, 3.33], [0.0, 0.0, 0.0, 1.0]])
ASKED: list[dict[str, Any]] = [
    {}, {"keep": "largest"}, {"surface": "outer"}, {"slices": "sagittal"}, {"way": "contours"}, {"smooth": 1.0},
    {"slice_range": (0, 0)}, {"roi": (4.0, 20.0, -78.0, -75.0, 0.0, 9.0)}, {"fill_slices": True},
]  # fmt: skip
NAMED = b"""<?xml version="1.0"?><CaretExtension><VolumeInformation><LabelTable>
<Label Key="2" Red="0"><![CDATA[liver]]></Label><Label Key="5" Red="1"><![CDATA[../a b/rm -rf]]></Label>
<Label Key="7" Red="1"><![CDATA[liver]]></Label></LabelTable></VolumeInformation></CaretExtension>"""


def blocks() -> NDArray[np.uint8]:
    """Return three labels, of which two touch and one is cut by the border, and a voxel of a fourth."""
    voxels = np.zeros((8, 9, 14), np.uint8)
    voxels[2:6, 2:6, 1:5], voxels[2:6, 2:6, 5:9], voxels[:4, 5:, 10:] = 2, 5, 7
    voxels[7, 0, 0] = 9
    return voxels


@st.composite
def label_maps(draw: st.DrawFn) -> NDArray[Any]:
    """Draw small maps (K, J, I) whose labels lie anywhere, as blocks and single voxels, of any kind of whole number."""
    shape = draw(st.tuples(*[st.integers(1, 7)] * 3))
    labels = draw(st.sampled_from([(0, 1, 2, 5), (0, 3), (-7, 0, 4), (0, 1, 70_000, 2**31 - 1), (6, 9)]))
    kinds = [np.int32, np.int64, np.float64] + [np.uint8, np.float32] * (max(labels) < 100 and min(labels) >= 0)
    voxels = draw(arrays.arrays(draw(st.sampled_from(kinds)), shape, elements=st.sampled_from(labels)))
    for axis, times in enumerate(draw(st.tuples(*[st.integers(1, 3)] * 3))):
        voxels = np.repeat(voxels, times, axis=axis)
    return voxels


def outcome(make: Callable[[], T]) -> T | str:
    """Return what is made, or the words in which it is refused."""
    try:
        return make()
    except TomomeshError as fault:
        return f"{fault.exit_code} {fault}"


def told(surface: Surface) -> dict[str, Any]:
    return {key: value for key, value in surface.report.items() if key != "timings"}


class TestLaw:
    @law(80)
    @given(label_maps(), st.sampled_from(ASKED))
    def test_each_surface_is_that_of_its_label_alone(self, voxels: NDArray[Any], options: dict[str, Any]) -> None:
        volume = Volume.from_stored(voxels, AFFINE)
        numbers = [number for number in np.unique(voxels.astype(np.int64)).tolist() if number]
        alone = {number: outcome(partial(reconstruct, volume, select=(number,), **options)) for number in numbers}
        found = outcome(lambda: reconstruct_labels(volume, **options))
        if isinstance(found, str):
            assert all(isinstance(one, str) for one in alone.values())
            return
        assert set(found) <= set(alone)
        assert all(isinstance(one, str) for number, one in alone.items() if number not in found)
        for number in found:
            one, other = alone[number], outcome(partial(found.__getitem__, number))
            if isinstance(one, str) or isinstance(other, str):
                assert one == other
                continue
            assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
            assert one.mesh.faces.tobytes() == other.mesh.faces.tobytes()
            assert told(one) == told(other)

    def test_it_is_a_mapping_of_the_labels(self) -> None:
        found = reconstruct_labels(Volume.from_stored(blocks(), AFFINE))
        assert list(found) == [2, 5, 7, 9]
        assert len(found) == 4
        assert 5 in found
        assert 4 not in found
        chosen = reconstruct_labels(Volume.from_stored(blocks(), AFFINE), select=(7, 4, 7))
        assert list(chosen) == [7, 4]
        segmented = chosen[7].segmentation
        assert segmented is not None
        assert segmented.mask.sum() == np.count_nonzero(blocks() == 7)
        with pytest.raises(TomomeshError, match="no such label"):
            chosen[4]

    @law(200)
    @given(label_maps())
    def test_boxes_are_those_of_the_voxels(self, voxels: NDArray[Any]) -> None:
        found = Labelled.of(Volume.from_stored(voxels, np.eye(4)))
        assert found.numbers.tolist() == np.unique(voxels).tolist()
        for number, box in zip(found.numbers, found.boxes, strict=True):
            places = np.argwhere(voxels == number)
            assert box.tolist() == [places.min(axis=0).tolist(), (places.max(axis=0) + 1).tolist()]

    @law(100)
    @given(label_maps(), st.data())
    def test_masks_are_those_of_the_voxels(self, voxels: NDArray[Any], data: st.DataObject) -> None:
        wanted = data.draw(st.lists(st.sampled_from(np.unique(voxels).tolist()), min_size=1))
        mask = Labelled.of(Volume.from_stored(voxels, np.eye(4))).mask(wanted)
        np.testing.assert_array_equal(mask[:], np.isin(voxels, wanted))


def written(folder: Path, voxels: NDArray[Any] | None = None, names: bytes = b"") -> Path:
    path = write_nifti(folder / "map.nii", blocks() if voxels is None else voxels, AFFINE)
    if names:
        image = nibabel.Nifti1Image.from_bytes(path.read_bytes())
        image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, names))
        path.write_bytes(image.to_bytes())
    return path


def each(path: Path, *options: str) -> int:
    return main(["reconstruct", str(path), "--each-label", "-o", str(path.parent / "out"), *options])


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "out" / "reports.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


class TestCommand:
    @pytest.mark.parametrize("options", [[], ["--way", "voxels", "--format", "ply"], ["--smooth", "1"]])
    def test_files_are_those_of_runs_for_one_label(self, tmp_path: Path, options: list[str]) -> None:
        path = written(tmp_path)
        assert each(path, "--quiet", *options) == 0
        suffix = "ply" if "ply" in options else "stl"
        alone = tmp_path / f"alone.{suffix}"
        plain = [option for option in options if option not in ("--format", "ply")]
        for number in (2, 5, 7, 9):
            line = ["reconstruct", str(path), "--select", str(number), "-o", str(alone), "--quiet", *plain]
            assert main(line) == 0
            assert (tmp_path / "out" / f"label-{number:04d}.{suffix}").read_bytes() == alone.read_bytes()

    def test_every_label_has_a_mesh_a_report_and_a_row(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = written(tmp_path)
        assert each(path) == 0
        assert "4/4 label-0009" in capsys.readouterr().err
        rows = table(tmp_path)
        assert [(row["label"], row["exit_code"], row["sound"]) for row in rows] == [(n, "0", "true") for n in "2579"]
        for row in rows:
            report = json.loads((tmp_path / "out" / f"{row['name']}.json").read_text())
            assert report["settings"]["window"]["select"] == [int(row["label"])]
            mesh = trimesh.load(tmp_path / "out" / f"{row['name']}.stl")
            assert mesh.is_watertight
            assert float(row["volume_mm3"]) == report["quality"]["volume_mm3"] == pytest.approx(mesh.volume, rel=1e-4)

    def test_beside_a_study(self, tmp_path: Path) -> None:
        labels = written(tmp_path)
        study = write_nifti(tmp_path / "study.nii", blocks().astype(np.int16) * 100, AFFINE)
        line = ["reconstruct", str(study), "--labels-in", str(labels), "--quiet"]
        assert main([*line, "--each-label", "--select", "7,5", "-o", str(tmp_path / "out")]) == 0
        assert main([*line, "--select", "5", "-o", str(tmp_path / "alone.stl")]) == 0
        assert [row["label"] for row in table(tmp_path)] == ["7", "5"]
        assert (tmp_path / "out" / "label-0005.stl").read_bytes() == (tmp_path / "alone.stl").read_bytes()

    def test_what_fails_stops_nothing_and_says_what_it_says_alone(
        self, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        voxels = blocks().astype(np.int16)
        voxels[0, 0, :3] = -4
        path = written(tmp_path, voxels)
        assert each(path, "--select", "2,6") == 10
        assert "1 of 2 labels failed" in capsys.readouterr().err
        assert main(["reconstruct", str(path), "--select", "6", "-o", str(tmp_path / "m.stl")]) == 6
        assert capsys.readouterr().err.splitlines()[-1] == f"error: {table(tmp_path)[1]['error']}"
        assert each(path) == 10
        capsys.readouterr()
        assert main(["reconstruct", str(path), "--select=-4", "-o", str(tmp_path / "m.stl")]) == 2
        row = table(tmp_path)[0]
        assert (row["label"], row["exit_code"]) == ("-4", "2")
        assert capsys.readouterr().err.splitlines()[-1] == f"error: {row['error'].removeprefix(APOSTROPHE)}"

    def test_what_is_finished_is_passed_over(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = written(tmp_path)
        assert each(path) == 0
        (tmp_path / "out" / "label-0005.stl").unlink()
        capsys.readouterr()
        assert each(path) == 0
        assert "1 reconstructed, 3 finished before" in capsys.readouterr().out
        written(tmp_path, blocks()[:, ::-1])
        assert each(path) == 0
        assert "4 reconstructed, 0 finished before" in capsys.readouterr().out

    def test_a_map_without_labels_is_refused_and_leaves_nothing(
        self, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        assert each(written(tmp_path, np.zeros((3, 3, 3), np.uint8))) == 6
        assert "holds no label" in capsys.readouterr().err
        assert not (tmp_path / "out").exists()

    def test_gray_levels_are_not_all_taken_for_labels(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        levels = np.arange(5000, dtype=np.int16).reshape(20, 10, 25)
        assert each(written(tmp_path, levels)) == 2
        assert "4999 levels" in capsys.readouterr().err
        assert not (tmp_path / "out").exists()
        assert each(tmp_path / "map.nii", "--select", "7,8", "--quiet") == 0
        heads = Volume.from_stored(blocks().astype(np.int16), AFFINE, unit="HU")
        with pytest.raises(UsageError, match="HU"):
            reconstruct_labels(heads)

    def test_all_without_the_option_names_it(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        line = ["reconstruct", str(written(tmp_path)), "--select", "all", "-o", str(tmp_path / "m.stl")]
        assert main(line) == 2
        assert "--each-label" in capsys.readouterr().err

    def test_gray_levels_between_whole_numbers_are_refused(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert each(written(tmp_path, blocks() + np.float32(0.5))) == 2
        assert len(capsys.readouterr().err.splitlines()[-1:]) == 1
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize("name", SINGLE)
    def test_what_is_for_one_mesh_is_refused(self, tmp_path: Path, name: str, capsys: CaptureFixture[str]) -> None:
        option = f"--{name.replace('_', '-')}"
        values = {
            "each": [],
            "slab": ["2"],
            "pieces": ["2"],
            "memory": ["1GB"],
            "workers": ["2"],
            "report": ["r.json"],
            "points": ["p.ply"],
        }.get(name, ["x.nii"])
        assert each(written(tmp_path), option, *values) == 2
        assert option in capsys.readouterr().err
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize(
        "options", [["--lower", "3"], ["--preset", "bone"], ["--frame", "voxel", "--format", "3mf"]]
    )
    def test_what_no_label_could_have_is_refused_once(
        self, tmp_path: Path, options: list[str], capsys: CaptureFixture[str]
    ) -> None:
        assert each(written(tmp_path), *options) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
        assert not (tmp_path / "out").exists()


class TestNames:
    def test_files_have_the_names_of_the_map_made_safe(self, tmp_path: Path) -> None:
        path = written(tmp_path, names=NAMED)
        assert each(path, "--select", "all", "--quiet") == 0
        rows = table(tmp_path)
        assert [row["name"] for row in rows] == [
            "label-0002-liver", "label-0005-.._a_b_rm_-rf", "label-0007-liver", "label-0009",
        ]  # fmt: skip
        assert [row["label_name"] for row in rows] == ["liver", "../a b/rm -rf", "liver", ""]
        stems = {path.stem for path in (tmp_path / "out").iterdir()}
        assert stems == {row["name"] for row in rows} | {"reports"}

    def test_a_table_beside_it_wins_and_chooses(self, tmp_path: Path) -> None:
        path, names = written(tmp_path, names=NAMED), tmp_path / "names.tsv"
        names.write_text("index\tname\n5\tSpleen\n9\tDot\n")
        assert each(path, "--select", "spleen,9", "--label-names", str(names), "--quiet") == 0
        assert [row["name"] for row in table(tmp_path)] == ["label-0005-Spleen", "label-0009-Dot"]

    def test_overlapping_segments_are_each_read_alone(self, tmp_path: Path) -> None:
        told = segment(0, "Whole ball", 1, 0) | segment(1, "core", 7, 1)
        path = layered(tmp_path / "s.seg.nrrd", [BALL, CORE * 7], **told)
        assert each(path, "--quiet", "--way", "voxels") == 0
        for number, name in ((1, "label-0001-Whole_ball"), (7, "label-0007-core")):
            line = f"reconstruct {path} --select {number} -o {tmp_path}/m.stl --quiet --way voxels"
            assert main(line.split()) == 0
            assert (tmp_path / "out" / f"{name}.stl").read_bytes() == (tmp_path / "m.stl").read_bytes()

    @pytest.mark.parametrize("apart", [True, False])
    def test_segments_of_dicom(self, tmp_path: Path, apart: bool) -> None:
        masks = {1: blocks() == 2, 3: blocks() == 5 if apart else blocks() < 5}
        path = dicom_segmentation(masks, np.eye(4), tmp_path / "seg.dcm")
        assert each(path, "--quiet") == 0
        rows = table(tmp_path)
        assert [row["label"] for row in rows] == ["1", "3"]
        for row in rows:
            assert row["name"] == f"label-000{row['label']}-{row['label_name'].replace(' ', '_')}"
            line = f"reconstruct {path} --select {row['label']} -o {tmp_path}/m.stl --quiet"
            assert main(line.split()) == 0
            assert (tmp_path / "out" / f"{row['name']}.stl").read_bytes() == (tmp_path / "m.stl").read_bytes()
