"""GIFTI surfaces, as Workbench and gifti_tool see them."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pytest

from conftest import sphere
from test_clients import of_nibabel
from test_io_mesh_formats import colors_of, lopsided
from tomomesh.cli import main
from tomomesh.io import keeps, write_mesh, write_points
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(name="cloud_of_colors")
def _cloud_of_colors(tmp_path: Path) -> Path:
    """Return a ball whose points have colors and a field."""
    places = sphere(600)
    fields = {name: np.full(len(places), 90, np.uint8) for name in ("red", "green", "blue")} | {"conf": places[:, 0]}
    write_points(replace(PointSet.from_positions(places), attributes=fields), tmp_path / "colors.ply")
    return tmp_path / "colors.ply"


class TestGifti:
    def test_positions_alone_have_a_coordinate_system(self, tmp_path: Path) -> None:
        mesh = lopsided()
        write_mesh(mesh, tmp_path / "m.gii", vertex_fields={**colors_of(mesh), "depth": mesh.vertices[:, 2]})
        arrays = ElementTree.parse(tmp_path / "m.gii").getroot().findall("DataArray")
        systems = {one.get("Intent"): len(one.findall("CoordinateSystemTransformMatrix")) for one in arrays}
        assert systems == {
            "NIFTI_INTENT_POINTSET": 1, "NIFTI_INTENT_TRIANGLE": 0, "NIFTI_INTENT_RGB_VECTOR": 0,
            "NIFTI_INTENT_NONE": 0,
        }  # fmt: skip

    def test_a_surface_for_workbench_holds_positions_and_triangles_alone(self, tmp_path: Path) -> None:
        """Workbench opens no .surf.gii with another array."""
        mesh, path = lopsided(), tmp_path / "M.Surf.GII"
        write_mesh(mesh, path, vertex_fields={**colors_of(mesh), "depth": mesh.vertices[:, 2]})
        assert not keeps(path, "depth")
        arrays = ElementTree.parse(path).getroot().findall("DataArray")
        assert [one.get("Intent") for one in arrays] == ["NIFTI_INTENT_POINTSET", "NIFTI_INTENT_TRIANGLE"]
        write_mesh(mesh, tmp_path / "bare.gii")
        assert path.read_bytes() == (tmp_path / "bare.gii").read_bytes()

    def test_workbench_opens_it(self, tmp_path: Path, cloud_of_colors: Path) -> None:
        tool = shutil.which("wb_command")
        if tool is None:
            pytest.skip("wb_command is not installed (Debian's connectome-workbench)")
        assert main(["surface", str(cloud_of_colors), "-o", str(tmp_path / "m.surf.gii"), "--quiet"]) == 0
        command = [tool, "-file-information", str(tmp_path / "m.surf.gii")]
        told = subprocess.run(command, capture_output=True, check=True, text=True).stdout
        said = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in told.splitlines())}
        assert (said["Type"], said["Normal Vectors Correct"]) == ("Surface", "true")
        assert int(said["Number of Vertices"]) == len(of_nibabel(tmp_path / "m.surf.gii")[0])

    def test_gifti_tool_calls_it_valid(self, tmp_path: Path) -> None:
        tool = shutil.which("gifti_tool")
        if tool is None:
            pytest.skip("gifti_tool is not installed (Debian's gifti-bin)")
        write_mesh(lopsided(), tmp_path / "m.surf.gii")
        command = [tool, "-gifti_test", "-infile", str(tmp_path / "m.surf.gii")]
        told = subprocess.run(command, capture_output=True, check=True, text=True)
        assert "is VALID" in told.stdout + told.stderr
        assert "**" not in told.stdout + told.stderr
