"""Cavities for finite elements: a place in each, in the numbers of the file that is meshed."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from conftest import sphere
from studies import AFFINES, write_nifti
from test_clients import of_meshio, of_nibabel, of_trimesh, of_vtk
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

READ: dict[str, Callable[[Path], tuple[Any, Any, Any]]] = {
    ".stl": of_trimesh, ".ply": of_meshio, ".vtp": of_vtk, ".gii": of_nibabel, ".3mf": of_trimesh,
}  # fmt: skip
CAVITIES = (([6, 8, 8], 2.5), ([13, 8, 9], 2.0))
"""Center and radius of each, in voxels (i, j, k), in an ellipsoid about (9.5, 8.5, 8.5)."""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Return labels of an ellipsoid with two cavities, oblique, with an axis turned around."""
    k, j, i = np.indices((18, 18, 20))
    places = np.stack([i, j, k], axis=-1)
    solid = (((places - [9.5, 8.5, 8.5]) / [8.5, 7.2, 7.2]) ** 2).sum(axis=-1) < 1
    for center, radius in CAVITIES:
        solid &= ((places - center) ** 2).sum(axis=-1) > radius**2
    return write_nifti(tmp_path / "labels.nii", solid.astype(np.uint8), AFFINES["oblique"] @ np.diag([-1, 1, 1.5, 1]))


@pytest.fixture
def cloud(tmp_path: Path) -> Path:
    """Return a sphere of 1 m with another in it, far from 0, and off its middle."""
    inner = 0.4 * sphere(800) + np.array([0.3, 0.1, 0])
    np.savetxt(tmp_path / "nested.xyz", np.concatenate([sphere(3000), inner]) + np.array([200, -300, 50]))
    return tmp_path / "nested.xyz"


def windings(path: Path, places: NDArray[Any]) -> tuple[NDArray[np.float64], int]:
    """Return how often each lining winds about each place, (l, p), and how many there are."""
    vertices, faces, _ = READ[path.suffix](path)
    parts = trimesh.Trimesh(vertices, faces).split(only_watertight=False)
    linings = [part for part in parts if part.volume < 0]
    found = [[_winding(part.vertices[part.faces] - place) for place in places] for part in linings]
    return np.array(found), len(linings)


def _winding(corners: NDArray[np.float64]) -> float:
    """Return how often triangles (m, 3, 3) wind about 0: their solid angles by van Oosterom and Strackee (1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    p, q, r = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    up = (a * np.cross(b, c)).sum(axis=1)
    down = p * q * r + (a * b).sum(axis=1) * r + (b * c).sum(axis=1) * p + (c * a).sum(axis=1) * q
    return float(np.arctan2(up, down).sum() / (2 * np.pi))


def told_of(line: list[str], tmp_path: Path, name: str) -> NDArray[np.float64]:
    report = tmp_path / "report.json"
    assert main([*line, "-o", str(tmp_path / name), "--report", str(report), "--quiet"]) == 0
    return np.array(json.loads(report.read_text())["written"]["cavity_places"])


class TestPlaces:
    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("m.stl", []), ("m.ply", ["--frame", "ras"]), ("m.vtp", ["--frame", "voxel"]), ("m.gii", []),
            ("m.surf.gii", ["--frame", "ras"]), ("m.3mf", []),
        ],
    )  # fmt: skip
    def test_each_cavity_of_a_study_has_one(self, study: Path, tmp_path: Path, name: str, options: list[str]) -> None:
        line = ["reconstruct", str(study), "--select", "1", "--network", "none", *options]
        found, linings = windings(tmp_path / name, told_of(line, tmp_path, name))
        assert linings == 2
        np.testing.assert_allclose(np.sort(found.sum(axis=0)), [-1, -1], atol=1e-4)
        np.testing.assert_allclose(np.sort(found.sum(axis=1)), [-1, -1], atol=1e-4)

    @pytest.mark.parametrize(
        ("name", "options"),
        [("m.stl", []), ("m.ply", ["--local-origin"]), ("m.3mf", []), ("m.gii", []), ("m.gii", ["--local-origin"])],
    )
    def test_and_that_of_a_cloud_in_meters(self, cloud: Path, tmp_path: Path, name: str, options: list[str]) -> None:
        places = told_of(["surface", str(cloud), "--units", "m", *options], tmp_path, name)
        found, linings = windings(tmp_path / name, places)
        assert linings == 1
        np.testing.assert_allclose(found, [[-1]], atol=1e-4)

    def test_a_part_and_a_solid_have_none(self, study: Path, tmp_path: Path) -> None:
        for name, options in (("part.stl", ["--scale", "2"]), ("full.stl", ["--surface", "outer"])):
            line = ["reconstruct", str(study), "--select", "1", "--network", "none", *options]
            report = tmp_path / "report.json"
            assert main([*line, "-o", str(tmp_path / name), "--report", str(report), "--quiet"]) == 0
            assert json.loads(report.read_text())["written"].keys() == {"unit", "frame"}


def test_ftetwild_leaves_them_empty(study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It needs no hole points; its envelope, a thousandth of the box, is what its volume may be off."""
    wildmeshing = pytest.importorskip("wildmeshing", reason="the package wildmeshing is not installed")
    line = ["reconstruct", str(study), "--select", "1", "--network", "none", "--target-faces", "600"]
    places = told_of(line, tmp_path, "m.stl")
    vertices, faces, _ = of_meshio(tmp_path / "m.stl")
    monkeypatch.chdir(tmp_path)  # where it leaves a file
    mesher = wildmeshing.Tetrahedralizer(stop_quality=20)
    mesher.set_mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))
    mesher.tetrahedralize()
    corners, solids, *_ = mesher.get_tet_mesh()
    edges = corners[solids][:, 1:] - corners[solids][:, :1]
    volumes = np.abs(np.linalg.det(edges)) / 6
    assert volumes.sum() == pytest.approx(trimesh.load(tmp_path / "m.stl").volume, rel=0.02)
    parts = np.linalg.solve(edges.transpose(0, 2, 1)[:, None], (places - corners[solids][:, :1])[..., None])[..., 0]
    assert not ((parts >= 0).all(axis=-1) & (parts.sum(axis=-1) <= 1)).any()
