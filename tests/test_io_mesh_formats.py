"""OFF, GLB, VTP, 3MF and GIFTI: written files are judged by trimesh, VTK, lib3mf and nibabel."""

from __future__ import annotations

import json
import struct
import zipfile
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import trimesh

from tomomesh.errors import OutputError
from tomomesh.io import MESH_WRITERS, keeps, read_mesh, write_mesh, write_points
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from pathlib import Path

FORMATS = (".off", ".glb", ".vtp", ".3mf", ".gii")
HEAD = "tomomesh 0.1.0 unit=mm frame=LPS"


def lopsided(shift: float = 0.0) -> TriMesh:
    """Return a closed surface that no turn or flip carries to itself."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=10 / 3)
    x, y, z = np.array(sphere.vertices).T
    vertices = np.stack([1.5 * x + 0.03 * y**2, y + 0.05 * x**2, 0.7 * z + 0.04 * z**2], axis=1)
    return TriMesh(vertices + shift, np.array(sphere.faces, np.int64))


def colors_of(mesh: TriMesh) -> dict[str, Any]:
    rng = np.random.default_rng(3)
    return {name: rng.integers(0, 256, len(mesh.vertices)).astype(np.uint8) for name in ("red", "green", "blue")}


def volume_of(vertices: Any, faces: Any) -> float:
    return float(trimesh.Trimesh(vertices, faces, process=False).volume)


def vtk_read(path: Path) -> tuple[Any, Any]:
    """Return VTK's polygons, and what turns its arrays into numpy's."""
    xml = pytest.importorskip("vtkmodules.vtkIOXML", reason="the package vtk is not installed")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = xml.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    assert reader.GetErrorCode() == 0
    return reader.GetOutput(), vtk_to_numpy


def fields_in(data: Any, to_numpy: Any) -> dict[str, Any]:
    return {data.GetArrayName(n): to_numpy(data.GetArray(n)) for n in range(data.GetNumberOfArrays())}


@pytest.mark.parametrize("suffix", FORMATS)
class TestEveryFormat:
    def test_bytes_repeat(self, tmp_path: Path, suffix: str) -> None:
        mesh = lopsided()
        for name in ("a", "b"):
            write_mesh(mesh, tmp_path / f"{name}{suffix}", vertex_fields=colors_of(mesh))
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
        assert len(list(tmp_path.iterdir())) == 2

    def test_the_colors_are_kept(self, tmp_path: Path, suffix: str) -> None:
        assert suffix in MESH_WRITERS
        assert keeps(f"m{suffix}", "red") == (suffix != ".off")

    def test_one_that_fails_leaves_nothing(self, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
        def full(handle: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("os.fsync", full)
        with pytest.raises(OutputError, match="no space left"):
            write_mesh(lopsided(), tmp_path / f"m{suffix}")
        assert not list(tmp_path.iterdir())


class TestOff:
    def test_64_bits_come_back_exactly(self, tmp_path: Path) -> None:
        mesh = lopsided(1e9)
        write_mesh(mesh, tmp_path / "m.off")
        for back in (read_mesh(tmp_path / "m.off"), trimesh.load(tmp_path / "m.off", process=False)):
            np.testing.assert_array_equal(back.vertices, mesh.vertices)
            np.testing.assert_array_equal(back.faces, mesh.faces)

    def test_vtk_reads_it(self, tmp_path: Path) -> None:
        geometry = pytest.importorskip("vtkmodules.vtkIOGeometry", reason="the package vtk is not installed")
        from vtkmodules.util.numpy_support import vtk_to_numpy

        mesh = lopsided()
        write_mesh(mesh, tmp_path / "m.off")
        reader = geometry.vtkOFFReader()
        reader.SetFileName(str(tmp_path / "m.off"))
        reader.Update()
        read = reader.GetOutput()
        np.testing.assert_allclose(vtk_to_numpy(read.GetPoints().GetData()), mesh.vertices, rtol=1e-6)
        faces = vtk_to_numpy(read.GetPolys().GetConnectivityArray()).reshape(-1, 3)
        np.testing.assert_array_equal(faces, mesh.faces)

    def test_it_is_plain(self, tmp_path: Path) -> None:
        """Niivue takes the second line for the counts; it, CloudCompare and meshio know no COFF."""
        mesh = TriMesh(np.array([[0, 0, 0], [1, 0, 0], [0, 0.1, 0]]), np.array([[0, 1, 2]]))
        colors = {name: np.array([1, 2, 255], np.uint8) for name in ("red", "green", "blue")}
        write_mesh(mesh, tmp_path / "m.off", vertex_fields=colors)
        lines = ["OFF", "3 1 0", "0.0 0.0 0.0", "1.0 0.0 0.0", "0.0 0.1 0.0", "3 0 1 2"]
        assert (tmp_path / "m.off").read_text().splitlines() == lines
        assert not keeps("m.off", "red")


class TestGlb:
    def test_it_is_in_meters_with_y_up_and_z_to_the_front(self, tmp_path: Path) -> None:
        mesh = lopsided()
        left, back, up = mesh.vertices.T
        expected = np.stack([left, up, -back], axis=1) / 1000
        ras = mesh.moved(mesh.vertices * [-1, -1, 1])
        for frame, one in (("LPS", mesh), ("RAS", ras)):
            write_mesh(one, tmp_path / "m.glb", frame=frame)
            judge = trimesh.load(tmp_path / "m.glb", process=False).to_geometry()
            np.testing.assert_allclose(judge.vertices, expected, atol=1e-9)
            np.testing.assert_array_equal(judge.faces, mesh.faces)
            assert judge.is_watertight
            assert judge.volume * 1e9 == pytest.approx(volume_of(mesh.vertices, mesh.faces), rel=1e-5)

    def test_an_unknown_frame_is_not_turned(self, tmp_path: Path) -> None:
        mesh = lopsided()
        write_mesh(mesh, tmp_path / "m.glb", unit="unknown", frame="unknown")
        judge = trimesh.load(tmp_path / "m.glb", process=False).to_geometry()
        np.testing.assert_array_equal(judge.vertices, mesh.vertices.astype(np.float32))

    def test_colors_and_fields(self, tmp_path: Path) -> None:
        mesh = lopsided()
        fields = {**colors_of(mesh), "flow": np.arange(2.0 * len(mesh.vertices)).reshape(-1, 2)}
        write_mesh(mesh, tmp_path / "m.glb", vertex_fields=fields)
        (judge,) = trimesh.load(tmp_path / "m.glb", process=False).geometry.values()
        np.testing.assert_array_equal(np.ravel(judge.vertex_attributes["_FLOW_1"]), fields["flow"][:, 1])
        assert judge.metadata["unit"] == "mm"
        assert judge.metadata["frame"] == "LPS"

    def test_its_numbers_are_where_the_text_says(self, tmp_path: Path) -> None:
        mesh = lopsided()
        holed = np.where(np.arange(len(mesh.vertices)) == 1, np.nan, 2.0)
        write_mesh(mesh, tmp_path / "m.glb", vertex_fields={**colors_of(mesh), "holed": holed})
        raw = (tmp_path / "m.glb").read_bytes()
        magic, version, length, size, kind = struct.unpack_from("<4sIII4s", raw)
        assert (magic, version, length, kind, size % 4) == (b"glTF", 2, len(raw), b"JSON", 0)
        text = json.loads(raw[20 : 20 + size], parse_constant=pytest.fail)  # JSON has no NaN
        assert text["asset"]["generator"] == HEAD
        block_size, block_kind = struct.unpack_from("<I4s", raw, 20 + size)
        assert (block_kind, block_size) == (b"BIN\0", text["buffers"][0]["byteLength"])
        assert 28 + size + block_size == len(raw)
        assert all(view["byteOffset"] % 4 == 0 for view in text["bufferViews"])
        position = text["accessors"][text["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
        np.testing.assert_array_equal(position["min"], mesh.vertices.astype(np.float32).min(axis=0))
        np.testing.assert_array_equal(position["max"], mesh.vertices.astype(np.float32).max(axis=0))

    @pytest.mark.parametrize("suffix", [".glb", ".gii"])
    def test_vertices_that_32_bits_do_not_tell_apart(self, tmp_path: Path, suffix: str) -> None:
        with pytest.raises(OutputError, match="32-bit"):
            write_mesh(lopsided(1e9), tmp_path / f"m{suffix}")
        assert not list(tmp_path.iterdir())


class TestVtp:
    def test_a_mesh_comes_back_from_vtk_with_all_its_fields(self, tmp_path: Path) -> None:
        mesh = lopsided(1e9)
        rng, n, m = np.random.default_rng(3), len(mesh.vertices), len(mesh.faces)
        fields = {**colors_of(mesh), "intensity": rng.random(n).astype(np.float32), "flow": rng.normal(size=(n, 2))}
        write_mesh(mesh, tmp_path / "m.vtp", vertex_fields=fields, face_fields={"filled": rng.random(m) < 0.5})
        read, to_numpy = vtk_read(tmp_path / "m.vtp")
        np.testing.assert_array_equal(to_numpy(read.GetPoints().GetData()), mesh.vertices)
        np.testing.assert_array_equal(to_numpy(read.GetPolys().GetConnectivityArray()).reshape(-1, 3), mesh.faces)
        at_points, on_cells = (fields_in(data, to_numpy) for data in (read.GetPointData(), read.GetCellData()))
        np.testing.assert_array_equal(at_points["RGB"], np.stack(list(fields.values())[:3], axis=1))
        np.testing.assert_array_equal(at_points["intensity"], fields["intensity"])
        np.testing.assert_array_equal(at_points["flow_1"], fields["flow"][:, 1])
        assert set(np.unique(on_cells["filled"])) == {0, 1}
        texts = read.GetFieldData()
        assert texts.GetAbstractArray("unit").GetValue(0) == "mm"
        assert texts.GetAbstractArray("frame").GetValue(0) == "LPS"
        assert texts.GetAbstractArray("written_by").GetValue(0) == HEAD

    def test_points_come_back_from_vtk(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(5)
        plain = PointSet.from_positions(rng.normal(size=(7, 3)))
        points = PointSet(
            plain.positions, np.arange(7, dtype=np.int32), plain.neurons, plain.kinds, {"intensity": rng.random(7)}
        )
        write_points(points, tmp_path / "p.vtp", unit="cm", frame="unknown")
        read, to_numpy = vtk_read(tmp_path / "p.vtp")
        np.testing.assert_array_equal(to_numpy(read.GetPoints().GetData()), points.positions)
        assert read.GetNumberOfVerts() == 7
        assert read.GetNumberOfPolys() == 0
        fields = fields_in(read.GetPointData(), to_numpy)
        np.testing.assert_array_equal(fields["slice"], points.slices)
        np.testing.assert_array_equal(fields["neuron"], points.neurons)
        np.testing.assert_array_equal(fields["kind"], points.kinds)
        np.testing.assert_array_equal(fields["intensity"], points.attributes["intensity"])
        assert read.GetFieldData().GetAbstractArray("unit").GetValue(0) == "cm"


class Test3mf:
    @pytest.mark.parametrize(("unit", "mm"), [("um", 0.001), ("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4)])
    def test_lib3mf_reads_it_without_a_warning_in_millimeters(self, tmp_path: Path, unit: str, mm: float) -> None:
        lib3mf = pytest.importorskip("lib3mf", reason="the package lib3mf is not installed")
        mesh = lopsided()
        wrapper = lib3mf.Wrapper()
        for name, fields in (("plain", {}), ("colored", colors_of(mesh))):
            write_mesh(mesh, tmp_path / f"{name}.3mf", unit=unit, vertex_fields=fields)
            model = wrapper.CreateModel()
            reader = model.QueryReader("3mf")
            reader.SetStrictModeActive(True)
            reader.ReadFromFile(str(tmp_path / f"{name}.3mf"))
            assert reader.GetWarningCount() == 0
            assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
            items = model.GetBuildItems()
            assert items.MoveNext()
            (found,) = [items.GetCurrent().GetObjectResource()]
            body = model.GetMeshObjectByID(found.GetResourceID())
            vertices = [list(one.Coordinates) for one in body.GetVertices()]
            np.testing.assert_array_equal(vertices, (mm * mesh.vertices).astype(np.float32))
            np.testing.assert_array_equal([list(one.Indices) for one in body.GetTriangleIndices()], mesh.faces)
            assert body.IsManifoldAndOriented()
            if fields:
                self._assert_colors(model, body, mesh, fields)

    def _assert_colors(self, model: Any, body: Any, mesh: TriMesh, fields: dict[str, Any]) -> None:
        for face in (0, 7, 100):
            chosen = body.GetTriangleProperties(face)
            group = model.GetColorGroupByID(chosen.ResourceID)
            for vertex, number in zip(mesh.faces[face], chosen.PropertyIDs, strict=True):
                color = group.GetColor(number)
                expected = [fields[name][vertex] for name in ("red", "green", "blue")]
                assert [color.Red, color.Green, color.Blue] == expected

    def test_trimesh_reads_64_bits(self, tmp_path: Path) -> None:
        pytest.importorskip("lxml", reason="the package lxml is not installed")
        mesh = lopsided(1e6)
        write_mesh(mesh, tmp_path / "m.3mf")
        judge = trimesh.load(tmp_path / "m.3mf", process=False).to_geometry()
        np.testing.assert_array_equal(judge.vertices, mesh.vertices)
        np.testing.assert_array_equal(judge.faces, mesh.faces)

    def test_the_text_names_unit_and_frame(self, tmp_path: Path) -> None:
        write_mesh(lopsided(), tmp_path / "m.3mf")
        with zipfile.ZipFile(tmp_path / "m.3mf") as archive:
            text = archive.read("3D/3dmodel.model").decode()
            assert {one.date_time for one in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert 'unit="millimeter"' in text
        assert HEAD in text

    def test_an_unknown_unit_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match="--units"):
            write_mesh(lopsided(), tmp_path / "m.3mf", unit="unknown")
        assert not list(tmp_path.iterdir())


class TestGifti:
    @pytest.mark.parametrize(("frame", "turn"), [("LPS", (-1, -1, 1)), ("RAS", (1, 1, 1))])
    def test_it_is_in_ras_millimeters(self, tmp_path: Path, frame: str, turn: tuple[int, ...]) -> None:
        mesh = lopsided()
        write_mesh(mesh, tmp_path / "m.surf.gii", unit="cm", frame=frame)
        image = nibabel.load(tmp_path / "m.surf.gii")
        points, faces = image.agg_data(("pointset", "triangle"))
        np.testing.assert_array_equal(points, (mesh.vertices * 10 * turn).astype(np.float32))
        np.testing.assert_array_equal(faces, mesh.faces)
        assert volume_of(points, faces) == pytest.approx(1000 * volume_of(mesh.vertices, mesh.faces), rel=1e-5)
        (placed,) = image.get_arrays_from_intent("NIFTI_INTENT_POINTSET")
        assert nibabel.nifti1.xform_codes.niistring[placed.coordsys.dataspace] == "NIFTI_XFORM_SCANNER_ANAT"
        np.testing.assert_array_equal(placed.coordsys.xform, np.eye(4))
        assert image.meta["Description"] == "tomomesh 0.1.0 unit=mm frame=RAS"

    def test_an_unknown_frame_is_said_to_be_unknown(self, tmp_path: Path) -> None:
        mesh = lopsided()
        write_mesh(mesh, tmp_path / "m.gii", unit="unknown", frame="unknown")
        (placed,) = nibabel.load(tmp_path / "m.gii").get_arrays_from_intent("NIFTI_INTENT_POINTSET")
        assert nibabel.nifti1.xform_codes.niistring[placed.coordsys.dataspace] == "NIFTI_XFORM_UNKNOWN"
        np.testing.assert_array_equal(placed.data, mesh.vertices.astype(np.float32))

    def test_fields_are_arrays_with_names(self, tmp_path: Path) -> None:
        mesh = lopsided()
        depth = np.arange(len(mesh.vertices)) / 7
        write_mesh(mesh, tmp_path / "m.gii", vertex_fields={**colors_of(mesh), "depth": depth})
        arrays = {one.meta.get("Name"): one.data for one in nibabel.load(tmp_path / "m.gii").darrays}
        np.testing.assert_array_equal(arrays["depth"], depth.astype(np.float32))
        np.testing.assert_array_equal(np.rint(arrays["color"] * 255)[:, 0], colors_of(mesh)["red"])
