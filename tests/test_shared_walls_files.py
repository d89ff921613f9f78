"""Shared walls on the command line: files whose walls are the same to the bit, alone, among workers, and refusals."""

from __future__ import annotations

import csv
import json
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from studies import write_nifti
from test_io_nrrd import BALL, CORE, layered, segment
from tomomesh import Volume, reconstruct, reconstruct_labels, reconstruct_points
from tomomesh import segment as stage_one
from tomomesh.cli import main
from tomomesh.errors import UsageError
from tomomesh.io import read_mesh
from tomomesh.io.meshes.attributes import fits_single
from tomomesh.io.meshes.pieces.parts import InOnePiece

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

AFFINE = np.array([[-0.7, 0.0, 0.0, 10.3], [0.0, 0.8, 0.1, -77.1], [0.0, 0.0, 1.3, 3.33], [0.0, 0.0, 0.0, 1.0]])
"""Of thick, slanted slices whose numbers are no sums of powers of 2."""


def organs() -> NDArray[np.uint8]:
    """Return a ball in three labels, with a speck of one of them in another, and a label by itself."""
    k, j, i = (axis - 8.3 for axis in np.ogrid[:20, :18, :19])
    voxels = np.where(i + 0.2 * j < 0, 2, np.where(k - 0.3 * j < 1, 5, 7)) * (k**2 + j**2 + i**2 < 49)
    voxels[8, 8, 5], voxels[18:, :2, :2] = 7, 9
    return voxels.astype(np.uint8)


def each(folder: Path, out: str, *options: str, affine: NDArray[np.float64] = AFFINE) -> int:
    path = write_nifti(folder / "map.nii", organs(), affine)
    return main(["reconstruct", str(path), "--each-label", "--shared-walls", "-o", str(folder / out), *options])


def meshes(folder: Path, suffix: str) -> dict[int, Any]:
    return {int(path.stem[-4:]): read_mesh(path) for path in sorted(folder.glob(f"*.{suffix}"))}


def triangles(mesh: Any, *, turned: bool = False) -> Counter[tuple[bytes, ...]]:
    faces = mesh.faces[:, ::-1] if turned else mesh.faces
    corners = [[corner.tobytes() for corner in face] for face in mesh.vertices[faces]]
    return Counter(tuple(face[first:] + face[:first]) for face in corners for first in [face.index(min(face))])


class TestFiles:
    @pytest.mark.parametrize(
        "options",
        [
            ["--format", "stl"], ["--format", "ply"], ["--format", "obj"], ["--format", "vtp"],
            ["--format", "ply", "--precision", "32"], ["--format", "ply", "--frame", "ras"],
            ["--format", "ply", "--frame", "voxel"], ["--format", "gii"], ["--format", "glb"],
        ],
    )  # fmt: skip
    def test_walls_are_the_same_bits_in_both(self, tmp_path: Path, options: list[str]) -> None:
        assert each(tmp_path, "out", "--quiet", *options) == 0
        found = meshes(tmp_path / "out", options[1])
        assert [*found] == [2, 5, 7, 9]
        for number, mesh in found.items():
            report = json.loads((tmp_path / "out" / f"label-{number:04d}.json").read_text())
            assert 2 * report["surface"]["square_faces"] + 2 * report["voxels"]["split_in_four"] == len(mesh.faces)
            for other, count in report["walls"]["neighbors"].items():
                common = triangles(mesh) & triangles(found[int(other)], turned=True)
                assert 2 * count <= common.total() <= 2 * count + 2 * report["voxels"]["split_in_four"]
            assert sum(report["walls"]["neighbors"].values()) == report["walls"]["shared_faces"]
            beside = {2: ["5", "7"], 5: ["2", "7"], 7: ["2", "5"], 9: []}
            assert sorted(report["walls"]["neighbors"]) == beside[number]

    @pytest.mark.parametrize(("scale", "kind"), [(1.2, "double"), (1.3, "float")])
    @pytest.mark.parametrize("suffix", ["ply", "vtp"])
    def test_the_map_decides_how_many_bits_they_have(
        self, tmp_path: Path, scale: float, kind: str, suffix: str
    ) -> None:
        """So far from 0 that 32 bits hold some of its meshes alone, and others not."""
        far = AFFINE * [[scale, scale, scale, 1.0]]
        far[0, 3] = 6e5
        alone = reconstruct_labels(Volume.from_stored(organs(), far), shared_walls=True)
        assert len({fits_single(InOnePiece(surface.mesh)) for surface in alone.values()}) == 2
        assert each(tmp_path, "out", "--quiet", "--format", suffix, "--precision", "32", affine=far) == 0
        heads = [path.read_bytes()[:2000] for path in (tmp_path / "out").glob(f"*.{suffix}")]
        named = (
            {"float": b"Float32", "double": b"Float64"}[kind] if suffix == "vtp" else b"property %b x" % kind.encode()
        )
        assert [named in head for head in heads] == [True] * 4
        found = meshes(tmp_path / "out", suffix)
        for number in (5, 7):
            assert (triangles(found[2]) & triangles(found[number], turned=True)).total() > 100

    def test_other_programs_find_closed_meshes_and_all_of_the_volume(self, tmp_path: Path) -> None:
        assert each(tmp_path, "out", "--quiet") == 0
        parts = [trimesh.load(path) for path in sorted((tmp_path / "out").glob("*.stl"))]
        assert all(part.is_watertight and part.is_winding_consistent for part in parts)
        voxel = abs(np.linalg.det(AFFINE[:3, :3]))
        assert sum(part.volume for part in parts) == pytest.approx(np.count_nonzero(organs()) * voxel, rel=0.02)

    def test_the_labels_that_are_asked_for_are_those_of_all(self, tmp_path: Path) -> None:
        assert each(tmp_path, "every", "--quiet") == 0
        assert each(tmp_path, "some", "--quiet", "--select", "7,2") == 0
        assert sorted(path.name for path in (tmp_path / "some").glob("*.stl")) == ["label-0002.stl", "label-0007.stl"]
        for path in (tmp_path / "some").glob("*.stl"):
            assert path.read_bytes() == (tmp_path / "every" / path.name).read_bytes()

    def test_what_was_made_without_is_made_again(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert each(tmp_path, "out", "--quiet") == 0
        line = ["reconstruct", str(tmp_path / "map.nii"), "--each-label", "-o", str(tmp_path / "out")]
        for options, again in (["--shared-walls"], 0), ([], 4):
            assert main([*line, *options]) == 0
            assert f"{again} reconstructed, {4 - again} finished before" in capsys.readouterr().out

    def test_a_box_cuts_all_of_them(self, tmp_path: Path) -> None:
        box = ["--roi", "2", "8", "-75", "-66", "5", "20"]
        assert each(tmp_path, "out", "--quiet", "--format", "ply", *box) in (0, 10)
        found = meshes(tmp_path / "out", "ply")
        assert len(found) > 1
        assert all((mesh.vertices.max(axis=0) < (9, -65, 21.5)).all() for mesh in found.values())

    def test_they_lie_on_the_grid_of_the_study(self) -> None:
        """As labels by themselves do, where their own is a little beside it."""
        beside = AFFINE.copy()
        beside[:3, 3] += 0.02
        study, labels = (Volume.from_stored(organs(), affine) for affine in (AFFINE, beside))
        one, other = (reconstruct_labels(study, labels=found, shared_walls=True) for found in (study, labels))
        np.testing.assert_array_equal(one[2].mesh.vertices, other[2].mesh.vertices)

    def test_one_line_tells_of_the_walls(self) -> None:
        from tomomesh.cli.summary.run import of_surface

        found = reconstruct_labels(Volume.from_stored(organs(), AFFINE), shared_walls=True)
        said = of_surface(found[2].report, "m.stl")
        (line,) = [one for one in said if one.startswith("walls ")]
        assert "faces shared with 2 label(s)" in line


class TestWorkers:
    def test_the_same_bytes_and_rows(self, tmp_path: Path, here: Any) -> None:
        assert each(tmp_path, "one", "--quiet") == 0
        assert each(tmp_path, "two", "--quiet", "--scheduler", here.scheduler_address) == 0
        tables = []
        for out in ("one", "two"):
            with (tmp_path / out / "reports.csv").open(newline="", encoding="utf-8") as file:
                tables.append([row | {"seconds": ""} for row in csv.DictReader(file)])
        assert tables[0] == tables[1]
        assert [row["label"] for row in tables[0]] == ["2", "5", "7", "9"]
        for path in (tmp_path / "one").glob("*.stl"):
            assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()

    def test_labels_beside_a_study_and_paths_as_typed(
        self, tmp_path: Path, here: Any, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        write_nifti(tmp_path / "labels.nii", organs(), AFFINE)
        write_nifti(tmp_path / "study.nii", organs().astype(np.int16) * 9, AFFINE)
        monkeypatch.chdir(tmp_path)
        line = ["reconstruct", "study.nii", "--labels-in", "labels.nii", "--each-label", "--select", "2,6,7"]
        assert main([*line, "-o", "one"]) == 10
        assert main([*line, "-o", "two", "--scheduler", here.scheduler_address]) == 10
        said = capsys.readouterr()
        assert "labels     3/3" in said.err
        rows = [(tmp_path / out / "reports.csv").read_text().splitlines()[2].split(",") for out in ("one", "two")]
        assert rows[0] == rows[1]
        assert (tmp_path / "one" / "label-0007.stl").read_bytes() == (tmp_path / "two" / "label-0007.stl").read_bytes()


class TestRefused:
    @pytest.mark.parametrize(
        "options",
        [
            ["--smooth", "1"], ["--edge", "2"], ["--target-faces", "100"], ["--way", "contours"],
            ["--network", "sphere"], ["--keep", "largest"], ["--surface", "outer"], ["--fill-slices"],
            ["--print-check"],
        ],
    )  # fmt: skip
    def test_what_parts_the_walls(self, tmp_path: Path, options: list[str], capsys: CaptureFixture[str]) -> None:
        assert each(tmp_path, "out", *options) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "--shared-walls" in line
        assert not (tmp_path / "out").exists()

    def test_one_mesh_and_many_studies(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = write_nifti(tmp_path / "map.nii", organs(), AFFINE)
        for line in ([str(path), "--select", "2", "-o", "m.stl"], [str(tmp_path), "--each", "-o", str(tmp_path / "o")]):
            assert main(["reconstruct", *line, "--shared-walls"]) == 2
            assert "--each-label" in capsys.readouterr().err.splitlines()[-1]
        for make in (reconstruct, stage_one):
            with pytest.raises(UsageError, match="walls are shared"):
                make(Volume.from_stored(organs(), AFFINE), select=2, shared_walls=True)
        with pytest.raises(UsageError, match="walls are shared"):
            reconstruct_points(np.zeros((3, 3)), shared_walls=True)

    def test_labels_that_overlap(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        told = segment(0, "Whole ball", 1, 0) | segment(1, "core", 7, 1)
        path = layered(tmp_path / "s.seg.nrrd", [BALL, CORE * 7], **told)
        assert main(["reconstruct", str(path), "--each-label", "--shared-walls", "-o", str(tmp_path / "out")]) == 2
        assert "overlap" in capsys.readouterr().err.splitlines()[-1]

    def test_the_background(self, tmp_path: Path) -> None:
        assert each(tmp_path, "out", "--quiet", "--select", "0,2") == 10
        with (tmp_path / "out" / "reports.csv").open(newline="", encoding="utf-8") as file:
            assert [row["exit_code"] for row in csv.DictReader(file)] == ["6", "0"]

    def test_what_changes_nothing_is_told(self) -> None:
        found = reconstruct_labels(Volume.from_stored(organs(), AFFINE), shared_walls=True, closing=2, stiffness=0.2)
        assert found[2].report["warnings"] == ["--closing has no effect with --shared-walls"]
