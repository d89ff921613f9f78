"""Unit and frame of clouds: what a file states is believed on every door, and --units wins over it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from scipy.spatial import cKDTree

from conftest import COMPILED
from studies import write_nifti
from test_cli import fails
from test_end_to_end import ball
from tomomesh import PointSet, io, reconstruct_points
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.io import read_points
from tomomesh.settings import Settings
from tomomesh.ways.clouds.points import take_points
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

    from tomomesh import TriMesh

WRITTEN = ["ply", "stl", "obj", "glb", "vtp", "3mf", "gii"]


def sphere(radius: float = 3.0, count: int = 1500) -> NDArray[np.float64]:
    turn = np.arange(count) + 0.5
    z, angle = 1 - 2 * turn / count, 2.4 * turn
    return radius * np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])


@pytest.fixture(scope="module")
def mesh() -> TriMesh:
    """The surface of the sphere, which every format writes."""
    return reconstruct_points(sphere()).mesh


def unit_taken(cloud: PointSet, **changes: Any) -> tuple[str, NDArray[np.float64]]:
    taken = take_points(cloud, Settings().replace(**changes)).value
    return taken.place.unit, taken.cloud.positions


class TestStated:
    @pytest.mark.parametrize("kind", ["ply", "xyz", "vtp"])
    @pytest.mark.parametrize("frame", ["LPS", "RAS", "local:1,2,3"])
    def test_by_points_of_ours(self, tmp_path: Path, kind: str, frame: str) -> None:
        path = tmp_path / f"c.{kind}"
        io.write_points(PointSet.from_positions(sphere()), path, unit="cm", frame=frame)
        cloud = read_points(path)
        assert (cloud.unit, cloud.frame) == ("cm", frame)
        np.testing.assert_array_equal(cloud.positions, sphere())

    @pytest.mark.parametrize("kind", WRITTEN)
    def test_by_meshes_of_ours(self, mesh: TriMesh, tmp_path: Path, kind: str) -> None:
        io.write_mesh(mesh, tmp_path / f"m.{kind}", unit="m", frame="LPS")
        cloud, (unit, placed) = read_points(tmp_path / f"m.{kind}"), ("", np.empty(0))
        unit, placed = unit_taken(cloud)
        meters = placed * {"m": 1.0, "mm": 1e-3}[unit]
        turned = np.array([-1, -1, 1]) if cloud.frame == "RAS" else np.ones(3)
        assert cloud.frame == ("RAS" if kind == "gii" else "LPS")
        assert np.max(cKDTree(mesh.vertices).query(meters * turned, p=np.inf)[0]) < 1e-6

    def test_by_an_e57(self, tmp_path: Path) -> None:
        pye57 = needed("pye57")
        file = pye57.E57(str(tmp_path / "c.e57"), mode="w")
        file.write_scan_raw({f"cartesian{axis}": column for axis, column in zip("XYZ", sphere().T, strict=True)})
        file.close()
        assert read_points(tmp_path / "c.e57").unit == "m"

    @pytest.mark.parametrize(("system", "point_format", "unit", "meters", "height"), [
        ("EPSG:25832", 3, "m", 1, 1), ("EPSG:25832", 6, "m", 1, 1),
        ("EPSG:2263", 3, "us-ft", 1200 / 3937, 1), ("EPSG:2263", 7, "us-ft", 1200 / 3937, 1),
        ("EPSG:2263+6360", 6, "us-ft", 1200 / 3937, 1), ("EPSG:2263+5703", 6, "us-ft", 1200 / 3937, 3937 / 1200),
        ("EPSG:2222", 6, "ft", 0.3048, 1),
    ])  # fmt: skip
    def test_by_a_las(
        self, tmp_path: Path, system: str, point_format: int, unit: str, meters: float, height: float
    ) -> None:
        laspy, pyproj = needed("laspy"), needed("pyproj")
        header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format > 5 else "1.2")
        header.scales = np.full(3, 1e-6)
        header.add_crs(pyproj.CRS.from_user_input(system))
        scan = laspy.LasData(header)
        scan.x, scan.y, scan.z = sphere().T
        scan.write(tmp_path / "c.las")
        cloud = read_points(tmp_path / "c.las")
        assert cloud.unit == unit
        np.testing.assert_allclose(cloud.positions, sphere() * [1, 1, height], atol=2e-6)
        assert unit_taken(cloud)[0] == "m"
        np.testing.assert_allclose(unit_taken(cloud)[1], cloud.positions * meters)
        assert unit_taken(cloud, units="cm")[0] == "cm"
        np.testing.assert_array_equal(unit_taken(cloud, units="cm")[1], cloud.positions)

    def test_degrees_are_refused_unless_a_unit_is_given(self, tmp_path: Path) -> None:
        laspy, pyproj = needed("laspy"), needed("pyproj")
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales = np.full(3, 1e-6)
        header.add_crs(pyproj.CRS.from_epsg(4326))
        scan = laspy.LasData(header)
        scan.x, scan.y, scan.z = sphere().T
        scan.write(tmp_path / "c.las")
        with pytest.raises(GeometryError, match=r"degree.*--units"):
            unit_taken(read_points(tmp_path / "c.las"))
        assert unit_taken(read_points(tmp_path / "c.las"), units="m")[0] == "m"

    @pytest.mark.parametrize(("head", "unit"), [
        ("X [m];Y [m];Z [m]", "m"), ("x_cm;y_cm;z_cm", "cm"), ("East (ft);North (ft);Height (ft)", "ft"),
        ("x;y;z", None), ("lon;lat;alt", "degree"), ("x_mm;y_mm;z_cm", None),
        ("x (nm);y (nm);z (nm)", "nm"), ("X [Kilometres];Y [Kilometres];Z [Kilometres]", "km"),
    ])  # fmt: skip
    def test_by_the_names_of_columns(self, tmp_path: Path, head: str, unit: str | None) -> None:
        (tmp_path / "c.csv").write_text(f"{head}\n1;2;3\n")
        cloud = read_points(tmp_path / "c.csv")
        assert cloud.unit == unit
        assert any("cm, mm: none was taken" in note for note in cloud.notes) == ("z_cm" in head and "y_mm" in head)

    @pytest.mark.parametrize(("unit", "taken", "scale"), [("nm", "um", 1e-3), ("yd", "m", 0.9144), ("km", "m", 1e3)])
    def test_lengths_that_no_mesh_is_written_in_become_the_next(self, unit: str, taken: str, scale: float) -> None:
        told = unit_taken(replace(PointSet.from_positions(sphere()), unit=unit))
        assert told[0] == taken
        np.testing.assert_allclose(told[1], scale * sphere())

    def test_millimeters_where_nothing_is(self) -> None:
        assert unit_taken(PointSet.from_positions(sphere()))[0] == "mm"


@pytest.mark.skipif(not COMPILED, reason="surfaces take minutes without the compiler")
class TestDoors:
    def test_a_cloud_in_meters_stays_one(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        io.write_points(PointSet.from_positions(sphere()), tmp_path / "c.ply", unit="m", frame="unknown")
        assert main(["surface", str(tmp_path / "c.ply"), "-o", str(tmp_path / "m.ply")]) == 0
        assert "m^3" in capsys.readouterr().out.replace("mm^3", "")
        assert io.frame_of_file(tmp_path / "m.ply")["unit"] == "m"
        assert main(["surface", str(tmp_path / "m.ply"), "-o", str(tmp_path / "n.ply"), "--json"]) == 0
        report = json.loads(capsys.readouterr().out)
        assert report["written"] == {"unit": "m", "frame": "unknown"}
        assert report["quality"]["volume_mm3"] == pytest.approx(113, rel=0.01)
        assert (
            main(["surface", str(tmp_path / "m.ply"), "-o", str(tmp_path / "n.ply"), "--units", "cm", "--quiet"]) == 0
        )
        assert io.frame_of_file(tmp_path / "n.ply")["unit"] == "cm"

    @pytest.mark.parametrize("frame", ["lps", "ras"])
    def test_points_of_a_study_come_back_to_its_place(self, tmp_path: Path, frame: str) -> None:
        study = write_nifti(tmp_path / "s.nii", ball(), np.diag([1.0, 1.2, 0.9, 1]))
        points, mesh = str(tmp_path / "seg.ply"), str(tmp_path / "m.gii")
        assert main(["segment", str(study), "--lower", "50", "-o", points, "--frame", frame, "--quiet"]) == 0
        assert main(["surface", points, "-o", mesh, "--quiet"]) == 0
        assert main(["reconstruct", str(study), "--lower", "50", "-o", str(tmp_path / "r.gii"), "--quiet"]) == 0
        placed, right = (
            nibabel.load(path).agg_data("pointset").mean(axis=0) for path in (mesh, tmp_path / "r.gii")
        )  # fmt: skip
        np.testing.assert_allclose(placed, right, atol=1)

    def test_voxel_indices_are_no_lengths(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        io.write_points(PointSet.from_positions(sphere()), tmp_path / "c.ply", unit="voxel", frame="voxel")
        fails(["surface", str(tmp_path / "c.ply"), "-o", str(tmp_path / "m.stl"), "--scale", "2"], 5, capsys)
        assert not (tmp_path / "m.stl").exists()

    def test_at_large_coordinates_64_bits_need_no_weld(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        far = 0.001 * sphere() + [500000.25, 5400000.125, 300]
        io.write_points(PointSet.from_positions(far), tmp_path / "c.ply", unit="m", frame="unknown")
        assert main(["surface", str(tmp_path / "c.ply"), "-o", str(tmp_path / "m.ply")]) == 0
        told = capsys.readouterr().out
        assert "closed and manifold" in told
        assert "NOT" not in told
        fails(["surface", str(tmp_path / "c.ply"), "-o", str(tmp_path / "m.stl")], 8, capsys)
        assert not (tmp_path / "m.stl").exists()
