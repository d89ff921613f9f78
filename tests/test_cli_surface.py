"""The door for clouds: what is written beside the mesh, and bad input."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from conftest import sphere, torus
from test_cli import ERROR
from tomomesh.cli import main

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

STEP = 2.0**-17
"""Detail that clouds near 2^30 keep in 64 bits."""
FAR = 2.0**30
PLY = "ply\nformat ascii 1.0\nelement vertex {0}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
LATTICE = np.indices((8, 8)).reshape(2, -1).T.astype(float)


def saved(points: NDArray[np.float64], folder: Path) -> str:
    path = folder / "cloud.npy"
    np.save(path, points)
    return str(path)


def refused(cloud: str, folder: Path, code: int, capsys: CaptureFixture[str], *options: str) -> str:
    """Run ``surface``, which must fail with one clean line and leave nothing, and return the line."""
    before = Path(cloud).read_bytes() if Path(cloud).is_file() else b""
    assert main(["surface", cloud, "-o", str(folder / "m.ply"), "--quiet", *options]) == code
    heard = capsys.readouterr()
    assert heard.out == ""
    (said,) = heard.err.splitlines()
    assert ERROR.match(said), said
    assert list(folder.iterdir()) == []
    assert before == (Path(cloud).read_bytes() if before else b"")
    return said


def surfaced(cloud: str, folder: Path, *options: str, suffix: str = ".ply") -> tuple[trimesh.Trimesh, dict[str, Any]]:
    """Run ``surface``, which must give a closed mesh, and return it with its report."""
    mesh, report = folder / f"m{suffix}", folder / "r.json"
    assert main(["surface", cloud, "-o", str(mesh), "--report", str(report), "--quiet", *options]) == 0
    found = trimesh.load(mesh, process=False)
    assert trimesh.load(mesh).is_watertight
    assert trimesh.load(mesh).is_winding_consistent
    assert found.volume > 0
    return found, json.loads(report.read_text())


class TestBesideTheMesh:
    @pytest.fixture
    def cloud(self, tmp_path: Path) -> str:
        points = sphere(600)
        rows = [f"{x!r} {y!r} {z!r} 9 {128 if x > 0 else 64} 7 {2 * z!r}" for x, y, z in points.tolist()]
        path = tmp_path / "cloud.xyz"
        path.write_text("\n".join(["x y z red green blue heat", *rows]))
        return str(path)

    def test_ply_holds_what_is_known_of_the_points_and_the_filled_faces(self, cloud: str, folder: Path) -> None:
        mesh, _ = surfaced(cloud, folder)
        held = mesh.metadata["_ply_raw"]
        at_vertices, on_faces = held["vertex"]["data"], held["face"]["data"]
        assert (at_vertices["red"] == 9).all()
        aside = np.abs(mesh.vertices[:, 0]) > 1.5
        np.testing.assert_array_equal(at_vertices["green"][aside], np.where(mesh.vertices[aside, 0] > 0, 128, 64))
        np.testing.assert_allclose(at_vertices["heat"], 2 * mesh.vertices[:, 2], atol=1)
        assert "filled" not in on_faces.dtype.names  # nothing was

    def test_a_hole_is_marked_as_filled(self, folder: Path, tmp_path: Path) -> None:
        points = sphere(3000)
        mesh, report = surfaced(saved(points[points[:, 2] < 9.6], tmp_path), folder)
        filled = mesh.metadata["_ply_raw"]["face"]["data"]["filled"].astype(bool).ravel()
        assert filled.sum() == report["fit"]["filled_faces"] > 0
        centers = mesh.triangles_center
        assert (centers[filled, 2] > 9).all()
        assert filled[np.hypot(centers[:, 0], centers[:, 1]) < 1].any()

    def test_obj_holds_the_colors_and_stl_nothing(self, cloud: str, folder: Path) -> None:
        surfaced(cloud, folder, suffix=".obj")
        assert len((folder / "m.obj").read_text().splitlines()[1].split()) == 7
        surfaced(cloud, folder, suffix=".stl")

    def test_a_study_marks_its_caps(self, folder: Path, tmp_path: Path) -> None:
        from studies import write_nifti
        from test_end_to_end import ball

        write_nifti(tmp_path / "ball.nii", ball(), np.eye(4))
        line = ["reconstruct", str(tmp_path / "ball.nii"), "-o", str(folder / "m.ply"), "--way", "ring", "--quiet"]
        assert main(line) == 0
        mesh = trimesh.load(folder / "m.ply", process=False)
        filled = mesh.metadata["_ply_raw"]["face"]["data"]["filled"].astype(bool).ravel()
        height = mesh.triangles_center[:, 2]
        assert 0 < filled.sum() < 0.5 * len(filled)
        assert filled[np.argmax(height)]
        assert filled[np.argmin(height)]

    def test_cell_is_another_name(self, folder: Path, tmp_path: Path) -> None:
        cloud = saved(sphere(600), tmp_path)
        _, one = surfaced(cloud, folder, "--cell", "1.5")
        first = (folder / "m.ply").read_bytes()
        _, other = surfaced(cloud, folder, "--cell-mm", "1.5")
        assert one["cubes"] == other["cubes"]
        assert first == (folder / "m.ply").read_bytes()

    def test_three_cells_may_stand_before_the_cloud(self, folder: Path, tmp_path: Path) -> None:
        cloud = saved(sphere(600), tmp_path)
        line = ["surface", "--cell", "1.2", "1.4", "1.6", cloud, "-o", str(folder / "m.stl"), "--quiet"]
        assert main([*line, "--report", str(folder / "r.json")]) == 0
        assert json.loads((folder / "r.json").read_text())["cubes"]["cell_mm"] == [1.2, 1.4, 1.6]


class TestFarFromZero:
    """FAULTS row 31."""

    @pytest.fixture
    def near(self) -> NDArray[np.float64]:
        return np.round(torus(2000, 0.02, 0.008) / STEP) * STEP

    def test_a_local_origin_gives_the_bytes_of_the_near_mesh(
        self, near: NDArray[np.float64], folder: Path, tmp_path: Path
    ) -> None:
        for suffix in (".ply", ".stl"):
            bodies = []
            for points in (near, near + FAR):
                _, report = surfaced(saved(points, tmp_path), folder, "--local-origin", suffix=suffix)
                assert report["points"]["origin"] == points.min(axis=0).tolist()
                assert report["quality"]["sound_after_welding"]
                bodies.append((folder / f"m{suffix}").read_bytes())
            corner = ",".join(repr(c).removesuffix(".0") for c in points.min(axis=0).tolist())
            assert f"frame=local:{corner}".encode() in bodies[1]
            cut = [body.partition(b"end_header\n")[2] if suffix == ".ply" else body[80:] for body in bodies]
            assert cut[0] == cut[1]

    def test_without_it_the_mesh_is_the_shifted_one(
        self, near: NDArray[np.float64], folder: Path, tmp_path: Path
    ) -> None:
        one, report = surfaced(saved(near, tmp_path), folder, "--no-remesh")
        assert report["points"]["origin"] == near.min(axis=0).tolist()
        other, _ = surfaced(saved(near + FAR, tmp_path), folder, "--no-remesh")
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_allclose(other.vertices - FAR, one.vertices, rtol=0, atol=4e-7)

    def test_stl_names_the_way_out(
        self, near: NDArray[np.float64], folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        cloud = saved(near + FAR, tmp_path)
        assert main(["surface", cloud, "-o", str(folder / "m.stl"), "--quiet"]) == 8
        assert re.search(r"\.ply.*--local-origin", capsys.readouterr().err)
        assert list(folder.iterdir()) == []

    def test_a_long_corner_is_whole_in_the_text_of_an_stl(self, folder: Path, tmp_path: Path) -> None:
        _, report = surfaced(saved(sphere(300) + 1e9 / 3, tmp_path), folder, "--local-origin", suffix=".stl")
        words = (folder / "m.stl").read_bytes()[:80].decode().split()
        assert words[0] == "tomomesh"
        corner = [float(c) for c in words[-1].removeprefix("frame=local:").split(",")]
        assert corner == report["points"]["origin"]

    @pytest.mark.parametrize("apart", [1e2, 1e6, 1e12])
    def test_two_far_spheres_are_two_spheres_or_too_far(
        self, apart: float, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        cloud = saved(np.concatenate([sphere(1000), sphere(1000) + np.array([apart, 0, 0])]), tmp_path)
        code = main(["surface", cloud, "-o", str(folder / "m.ply"), "--report", str(folder / "r.json"), "--quiet"])
        if code:
            assert code == 7
            assert "Traceback" not in capsys.readouterr().err
            return
        report = json.loads((folder / "r.json").read_text())
        assert report["quality"]["components"] == 2
        assert report["quality"]["volume_mm3"] == pytest.approx(2 * 4 / 3 * np.pi * 1000, rel=0.02)


class TestDegenerate:
    """FAULTS row 29."""

    def test_no_points(self, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        refused(saved(np.zeros((0, 3)), tmp_path), folder, 6, capsys)
        for name, text in (("c.xyz", "x y z\n"), ("c.ply", PLY.format(0))):
            (tmp_path / name).write_text(text)
            refused(str(tmp_path / name), folder, 6, capsys)

    @pytest.mark.parametrize(
        "points",
        [
            np.array([[1.0, 2, 3]]),
            np.array([[1.0, 2, 3], [1, 2, 4]]),
            np.array([[1.0, 2, 3], [1, 2, 4], [1, 3, 3]]),
            np.full((500, 3), 5.0),
            np.outer(np.arange(5.0), [1, 2, 3]),
            np.outer(np.arange(200.0), [1, 2, 3]),
            np.outer(np.random.default_rng(0).random(300), [1, 0, 0]),
            np.column_stack([LATTICE, np.zeros(64)]),
            np.column_stack([LATTICE @ [[0.8, 0.6], [-0.6, 0.8]], LATTICE @ [0.3, 0.4]]),
            np.column_stack([np.random.default_rng(0).random((2000, 2)), np.full(2000, 0.1)]),
        ],
        ids=["one", "two", "three", "identical", "five in line", "line", "random line", "lattice", "tilted", "plane"],
    )
    def test_too_flat_for_a_fit_gives_the_shell_and_a_warning(
        self, points: NDArray[np.float64], folder: Path, tmp_path: Path
    ) -> None:
        _, report = surfaced(saved(points, tmp_path), folder)
        assert "plane" in " ".join(report["warnings"])
        assert report["fit"]["iterations"] == 0
        assert report["quality"]["sound"]
        assert report["quality"]["components"] == 1
        assert report["quality"]["points_to_surface_max_mm"] <= 2 * report["cubes"]["cell_mm"][0]

    def test_repeats_change_nothing(self, folder: Path, tmp_path: Path) -> None:
        points = torus(1500)
        surfaced(saved(points, tmp_path), folder)
        once = (folder / "m.ply").read_bytes()
        surfaced(saved(np.concatenate([np.repeat(points[:1], 100_000, axis=0), points[::-1]]), tmp_path), folder)
        assert once == (folder / "m.ply").read_bytes()


class TestBadFiles:
    """FAULTS row 30."""

    @pytest.mark.parametrize(
        ("name", "text", "word"),
        [
            ("nan.xyz", "0 0 0\n1 nan 1\n", "row 2"),
            ("inf.csv", "x,y,z\n0,0,0\n0,0,0\n-inf,1,1\n", "row 4"),
            ("text.xyz", "0 0 0\n1 one 1\n", "row 2"),
            ("ragged.xyz", "0 0 0\n1 1 1\n1 1\n", "row 3"),
            ("lying.ply", PLY.format(1000) + "0 0 0\n", "cut off"),
            ("much.ply", PLY.replace("ascii", "binary_little_endian").format(10**12) + "0 0 0\n", "12000000000000"),
        ],
    )
    def test_the_row_is_named(
        self, name: str, text: str, word: str, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        (tmp_path / name).write_text(text)
        assert word in refused(str(tmp_path / name), folder, 4, capsys)

    def test_not_finite_in_an_array(self, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        points = sphere(100)
        points[41, 1] = np.nan
        assert re.search(r"row.* 4[12]\b", refused(saved(points, tmp_path), folder, 4, capsys))

    def test_a_missing_file(self, folder: Path, capsys: CaptureFixture[str]) -> None:
        assert "nowhere.ply" in refused("nowhere.ply", folder, 3, capsys)


class TestLimits:
    """FAULTS rows 32 and 33."""

    @pytest.mark.parametrize("option", ["--cell", "--cell-mm"])
    @pytest.mark.parametrize("edge", ["0", "-1", "nan", "inf"])
    def test_impossible_cells(
        self, option: str, edge: str, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        said = refused(saved(sphere(100), tmp_path), folder, 2, capsys, f"{option}={edge}")
        assert "over 0" in said

    @pytest.mark.parametrize("options", [("--step", "2"), ("--closing", "-1"), ("--target-faces", "3")])
    def test_impossible_numbers_name_their_limit(
        self, options: tuple[str, str], folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        said = refused(saved(sphere(100), tmp_path), folder, 2, capsys, *options)
        assert options[0] in said
        assert "at " in said

    @pytest.mark.parametrize("edge", [1e-5, 1e-9, 1e-300])
    def test_cells_too_small_name_the_smallest(
        self, edge: float, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        said = refused(saved(sphere(2000), tmp_path), folder, 7, capsys, "--cell", str(edge))
        least = re.search(r"at least ([-+.e\d]+)\.", said)
        assert least is not None, said
        assert float(least[1]) > edge
