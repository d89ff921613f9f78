"""What we write, opened in clients: each format in two at least, judged by place, unit, color and closedness."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import trimesh

from conftest import sphere
from test_io_mesh_formats import colors_of, lopsided, volume_of
from tomomesh.cli import main
from tomomesh.io import write_mesh, write_points
from tomomesh.io.colors import linear
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh

    Read = tuple[NDArray[Any], NDArray[Any], NDArray[np.uint8] | None]
    """What a client made of a file: vertices, faces, and colors where it knows any."""

SCRIPT = Path(__file__).with_name("clients.mjs")
NODE = shutil.which("node")
CM = 10
"""Millimeters in the unit of the meshes written here, which is not the default."""


def asked_of_node(client: str, *files: Path) -> list[dict[str, Any]]:
    """Return what a client on Node.js says of some files."""
    if NODE is None:
        pytest.skip("Node.js is not installed")
    asked = [NODE, "--print", "require.resolve.paths('it').join('\\n')"]
    folders = subprocess.run(asked, capture_output=True, check=True, text=True).stdout.splitlines()
    if not any(Path(folder, client).is_dir() for folder in folders):
        pytest.skip(f"Node.js finds no package {client}: npm install {client}, and NODE_PATH where it went")
    command = [NODE, str(SCRIPT), client, *map(str, files)]
    told = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    return [json.loads(line) for line in told.splitlines()]


def of_trimesh(path: Path) -> Read:
    found = trimesh.load(path, process=False, merge_norm=False, merge_tex=False)
    one = found.to_geometry() if isinstance(found, trimesh.Scene) else found
    # in a .glb they are light, which trimesh passes on: see TestColors
    known = one.visual.kind == "vertex" and path.suffix != ".glb"
    return one.vertices, one.faces, one.visual.vertex_colors[:, :3] if known else None


def of_three(path: Path) -> Read:
    (found,) = asked_of_node("three", path)
    places = np.array(found["places"])
    faces = np.array(found["index"] or range(len(places))).reshape(-1, 3)
    shown = np.array(found["shown"]) if found.get("shown") and path.suffix != ".ply" else None
    return places, faces, None if shown is None else np.stack([shown >> n & 255 for n in (16, 8, 0)], axis=1)


def of_niivue(path: Path) -> Read:
    (found,) = asked_of_node("@niivue/niivue", path)
    places, faces = (np.array(found[name]).reshape(-1, 3) for name in ("places", "index"))
    colors = found.get("fractions")
    return places, faces, None if colors is None else np.rint(255 * np.array(colors).reshape(-1, 3)).astype(np.uint8)


def of_meshio(path: Path) -> Read:
    meshio = pytest.importorskip("meshio", reason="the package meshio is not installed")
    found = meshio.read(path)
    names = ("red", "green", "blue")
    known = "red" in found.point_data  # as signed bytes
    colors = np.stack([found.point_data[name] for name in names], axis=1).view(np.uint8) if known else None
    return found.points, found.cells_dict["triangle"], colors


def of_vtk(path: Path) -> Read:
    geometry, ply, xml, obj = (
        pytest.importorskip(f"vtkmodules.{name}", reason="the package vtk is not installed")
        for name in ("vtkIOGeometry", "vtkIOPLY", "vtkIOXML", "vtkIOGeometry")
    )
    from vtkmodules.util.numpy_support import vtk_to_numpy

    readers = {
        ".stl": geometry.vtkSTLReader, ".ply": ply.vtkPLYReader, ".vtp": xml.vtkXMLPolyDataReader,
        ".obj": obj.vtkOBJReader, ".off": geometry.vtkOFFReader, ".glb": geometry.vtkGLTFReader,
    }  # fmt: skip
    reader = readers[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    found = _placed_by_nodes(reader.GetOutput()) if path.suffix == ".glb" else reader.GetOutput()
    colors = found.GetPointData().GetArray("RGB")
    faces = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(found.GetPoints().GetData()), faces, None if colors is None else vtk_to_numpy(colors)


def _placed_by_nodes(scene: Any) -> Any:
    """Return the one mesh of VTK's blocks."""
    filters = pytest.importorskip("vtkmodules.vtkFiltersGeometry", reason="the package vtk is not installed")
    one = filters.vtkCompositeDataGeometryFilter()
    one.SetInputData(scene)
    one.Update()
    return one.GetOutput()


def of_lib3mf(path: Path) -> Read:
    lib3mf = pytest.importorskip("lib3mf", reason="the package lib3mf is not installed")
    model = lib3mf.Wrapper().CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(path))
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    items = model.GetBuildItems()
    assert items.MoveNext()
    body = model.GetMeshObjectByID(items.GetCurrent().GetObjectResource().GetResourceID())
    vertices = np.array([list(one.Coordinates) for one in body.GetVertices()])
    faces = np.array([list(one.Indices) for one in body.GetTriangleIndices()])
    assert body.IsManifoldAndOriented()
    return vertices, faces, _colors_of_3mf(model, body, faces)


def _colors_of_3mf(model: Any, body: Any, faces: NDArray[np.int64]) -> NDArray[np.uint8] | None:
    """Return what lib3mf has for the corners, which is one color a vertex where we wrote it."""
    if not body.GetObjectLevelProperty()[2]:
        return None
    found = np.zeros((faces.max() + 1, 3), np.uint8)
    for corners, told in zip(faces, body.GetAllTriangleProperties(), strict=True):
        group = model.GetColorGroupByID(told.ResourceID)
        for corner, number in zip(corners, told.PropertyIDs, strict=True):
            color = group.GetColor(number)
            found[corner] = color.Red, color.Green, color.Blue
    return found


def of_nibabel(path: Path) -> Read:
    vertices, faces = nibabel.load(path).agg_data(("pointset", "triangle"))
    colors = nibabel.load(path).agg_data("NIFTI_INTENT_RGB_VECTOR")
    return vertices, faces, np.rint(np.asarray(colors) * 255).astype(np.uint8) if len(colors) else None


CLIENTS: dict[str, tuple[Callable[[Path], Read], ...]] = {
    ".stl": (of_trimesh, of_vtk, of_meshio, of_three, of_niivue),
    ".ply": (of_trimesh, of_vtk, of_meshio, of_three, of_niivue),
    ".obj": (of_trimesh, of_vtk, of_three, of_niivue),
    ".off": (of_trimesh, of_vtk, of_meshio, of_niivue),
    ".vtp": (of_vtk,),
    ".3mf": (of_trimesh, of_lib3mf),
    ".glb": (of_trimesh, of_vtk, of_three),
    ".gii": (of_nibabel, of_niivue),
}
"""Suffix to what opens it. Of packages for Python, VTK alone opens .vtp, which 3D Slicer, ParaView and PyVista use."""
PAIRS: Iterable[tuple[str, Callable[[Path], Read]]] = [
    (suffix, one) for suffix, all_ in CLIENTS.items() for one in all_
]


def right_places(mesh: TriMesh, suffix: str) -> NDArray[np.float64]:
    """Return where a client must see the vertices of a mesh in centimeters, LPS."""
    left, back, up = mesh.vertices.T
    if suffix == ".glb":
        return np.stack([left, up, -back], axis=1) / 100
    turns: dict[str, NDArray[np.float64]] = {".3mf": CM * np.ones(3), ".gii": CM * np.array([-1.0, -1.0, 1.0])}
    return mesh.vertices * turns.get(suffix, np.ones(3))


@pytest.mark.parametrize(("suffix", "client"), PAIRS, ids=[f"{suffix[1:]}-{one.__name__[3:]}" for suffix, one in PAIRS])
class TestEveryClient:
    def test_sees_each_corner_at_its_place_and_in_its_color(
        self, tmp_path: Path, suffix: str, client: Callable[[Path], Read]
    ) -> None:
        mesh, fields = lopsided(), colors_of(lopsided())
        write_mesh(mesh, tmp_path / f"m{suffix}", unit="cm", vertex_fields=fields)
        vertices, faces, colors = client(tmp_path / f"m{suffix}")
        right = right_places(mesh, suffix)
        np.testing.assert_allclose(vertices[faces], right[mesh.faces], atol=1e-6 * np.abs(right).max())
        if colors is not None:
            wanted = np.stack([fields[name] for name in ("red", "green", "blue")], axis=1)
            np.testing.assert_array_equal(colors[faces], wanted[mesh.faces])

    def test_sees_a_closed_solid_of_its_volume(
        self, tmp_path: Path, suffix: str, client: Callable[[Path], Read]
    ) -> None:
        mesh = lopsided()
        write_mesh(mesh, tmp_path / f"m{suffix}", unit="cm", face_fields={})
        vertices, faces, _ = client(tmp_path / f"m{suffix}")
        judge = trimesh.Trimesh(vertices, faces, process=True)  # STL repeats its corners
        assert judge.is_watertight
        assert judge.is_winding_consistent
        right = volume_of(right_places(mesh, suffix), mesh.faces)
        assert judge.volume == pytest.approx(right, rel=1e-5)


class TestGlb:
    def test_gltf_validator_has_nothing_to_say(self, tmp_path: Path) -> None:
        mesh = lopsided()
        fields = {**colors_of(mesh), "depth": mesh.vertices[:, 2]}
        fields["holed"] = np.where(np.arange(len(mesh.vertices)) == 1, np.nan, 2.0)  # glTF has no NaN
        write_mesh(mesh, tmp_path / "plain.glb")
        write_mesh(mesh, tmp_path / "full.glb", vertex_fields=fields)
        for told in asked_of_node("gltf-validator", tmp_path / "plain.glb", tmp_path / "full.glb"):
            assert told == {"messages": [], "triangles": len(mesh.faces)}

    def test_three_shows_the_very_colors_on_a_dull_material(self, tmp_path: Path) -> None:
        mesh = lopsided()
        one = {
            name: np.full(len(mesh.vertices), level, np.uint8)
            for name, level in (("red", 20), ("green", 60), ("blue", 180))
        }
        write_mesh(mesh, tmp_path / "m.glb", vertex_fields=one)
        (found,) = asked_of_node("three", tmp_path / "m.glb")
        assert set(found["shown"]) == {20 << 16 | 60 << 8 | 180}
        assert (found["metalness"], found["roughness"]) == (0, 1)

    def test_trimesh_has_a_color_for_it(self, tmp_path: Path) -> None:
        """Its `to_color`, which its viewer asks, knows no material but one that names its color."""
        write_mesh(lopsided(), tmp_path / "m.glb")
        (found,) = trimesh.load(tmp_path / "m.glb").geometry.values()
        assert (np.asarray(found.visual.to_color().vertex_colors) == 255).all()

    def test_colors_are_light(self) -> None:
        """IEC 61966-2-1's own inverse brings each back."""
        levels = np.arange(256)
        light = linear(levels.astype(np.uint8)).astype(np.float64)
        back = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(255 * back, levels, atol=1e-4)

    @pytest.mark.parametrize("command", [["print"], ["surface", "--scale", "2", "--units", "mm"]])
    def test_a_part_stands_upright(self, tmp_path: Path, command: list[str], cloud_of_a_pole: Path) -> None:
        """GlTF has y up, printers z."""
        source = cloud_of_a_pole if command[0] == "surface" else tmp_path / "pole.stl"
        if command[0] == "print":
            trimesh.creation.box((10, 20, 60)).export(source)
        part = tmp_path / "part.glb"
        assert main([command[0], str(source), "-o", str(part), "--quiet", *command[1:]]) == 0
        for read in (of_trimesh, of_three):
            size = np.ptp(read(part)[0], axis=0)
            assert size.argmax() == 1


@pytest.fixture(name="cloud_of_a_pole")
def _cloud_of_a_pole(tmp_path: Path) -> Path:
    np.savetxt(tmp_path / "pole.xyz", sphere(600) * [1, 1, 3])
    return tmp_path / "pole.xyz"


class TestPly:
    def test_three_draws_what_is_written_with_32_bits(self, tmp_path: Path) -> None:
        """Its geometries take the numbers as they stand, and WebGL has none of 64 bits."""
        for bits in (32, 64):
            write_mesh(lopsided(), tmp_path / f"m{bits}.ply", precision=bits)
        told = asked_of_node("three", tmp_path / "m32.ply", tmp_path / "m64.ply")
        assert [one["array"] for one in told] == ["Float32Array", "Float64Array"]

    @pytest.mark.parametrize("suffix", [".ply", ".vtp"])
    def test_32_bits_are_left_where_vertices_would_fall_together(self, tmp_path: Path, suffix: str) -> None:
        for shift, dtype in ((0.0, np.float32), (1e9, np.float64)):
            mesh = lopsided(shift)
            write_mesh(mesh, tmp_path / f"m{suffix}", precision=32)
            vertices, _, _ = of_vtk(tmp_path / f"m{suffix}") if suffix == ".vtp" else of_meshio(tmp_path / "m.ply")
            np.testing.assert_array_equal(vertices, mesh.vertices.astype(dtype))

    def test_points_in_32_bits(self, tmp_path: Path) -> None:
        points = PointSet.from_positions(sphere(50))
        for suffix in (".ply", ".vtp"):
            write_points(points, tmp_path / f"p{suffix}", precision=32)
        meshio = pytest.importorskip("meshio", reason="the package meshio is not installed")
        assert meshio.read(tmp_path / "p.ply").points.dtype == np.float32
        np.testing.assert_array_equal(of_vtk_points(tmp_path / "p.vtp"), points.positions.astype(np.float32))

    @pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8", "?"])
    def test_meshio_and_vtk_read_a_field_of_any_kind(self, tmp_path: Path, kind: str) -> None:
        """Such as the 16-bit intensity of a LAS file; meshio's names of types are fewer, and its bytes have a sign."""
        meshio = pytest.importorskip("meshio", reason="the package meshio is not installed")
        mesh = lopsided()
        field = (np.arange(len(mesh.vertices)) % 120).astype(kind)
        write_mesh(mesh, tmp_path / "m.ply", vertex_fields={"f": field})
        write_points(replace(PointSet.from_positions(mesh.vertices), attributes={"f": field}), tmp_path / "p.ply")
        for name in ("m", "p"):
            np.testing.assert_array_equal(meshio.read(tmp_path / f"{name}.ply").point_data["f"], field)
        np.testing.assert_allclose(of_vtk(tmp_path / "m.ply")[0], mesh.vertices, rtol=1e-5)

    def test_meshio_opens_a_surface_without_filled_faces(self, tmp_path: Path, cloud_of_a_pole: Path) -> None:
        """It knows no property of faces."""
        assert main(["surface", str(cloud_of_a_pole), "-o", str(tmp_path / "m.ply"), "--quiet"]) == 0
        vertices, faces, _ = of_meshio(tmp_path / "m.ply")
        assert trimesh.Trimesh(vertices, faces, process=False).is_watertight
        assert b"filled" not in (tmp_path / "m.ply").read_bytes()[:400]


def of_vtk_points(path: Path) -> NDArray[Any]:
    xml = pytest.importorskip("vtkmodules.vtkIOXML", reason="the package vtk is not installed")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = xml.vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return np.asarray(vtk_to_numpy(reader.GetOutput().GetPoints().GetData()))


@pytest.mark.parametrize("suffix", [".3mf", ".gii"])
def test_a_cloud_in_meters_is_written_in_millimeters_and_told_so(
    tmp_path: Path, suffix: str, cloud_of_a_pole: Path
) -> None:
    """A ball of radius 10 m, three times as high."""
    report = tmp_path / "report.json"
    line = ["surface", str(cloud_of_a_pole), "-o", str(tmp_path / f"m{suffix}"), "--units", "m", "--quiet"]
    assert main([*line, "--report", str(report)]) == 0
    for read in CLIENTS[suffix]:
        vertices, _, _ = read(tmp_path / f"m{suffix}")
        assert np.ptp(vertices, axis=0) == pytest.approx([20e3, 20e3, 60e3], rel=0.05)
    assert json.loads(report.read_text())["written"] == {"unit": "mm", "frame": "unknown"}
