"""Points and meshes as other programs write them, and what is ours read back: by value, or refused."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh import PointSet, TriMesh, io
from tomomesh.errors import FormatError
from tomomesh.io import read_mesh, read_points
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

KINDS = {"B": "uchar", "h": "short", "i": "int"}
BOX = trimesh.creation.box((2, 3, 4))
TORUS = trimesh.creation.torus(10, 4, major_sections=24, minor_sections=12)
QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
CORNERS = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)


def volume_of(path: Path) -> float:
    mesh = read_mesh(path)
    uses = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_counts=True)[1]
    assert (uses == 2).all()
    return float(mesh.face_volumes.sum())


class TestPlyLists:
    @law(60)
    @given(
        lists=st.lists(st.lists(st.integers(0, 250), max_size=4), min_size=1, max_size=6),
        behind=st.booleans(), order=st.sampled_from(["<", ">", ""]), length=st.sampled_from("Bhi"),
        element_before=st.booleans(),
    )  # fmt: skip
    def test_beside_x_y_and_z(
        self, tmp_path_factory: Any, lists: list[list[int]], behind: bool, order: str, length: str, element_before: bool
    ) -> None:
        path = tmp_path_factory.mktemp("ply") / "c.ply"
        names = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}
        listed = [f"property list {KINDS[length]} ushort seen"]
        single = ["property float x", "property double y", "property float z"]
        head = ["ply", f"format {names[order]} 1.0"]
        head += ["element camera 2", "property list uchar int views"] if element_before else []
        head += [f"element vertex {len(lists)}", *(single + listed if behind else listed + single)]
        head += ["property uchar red", "end_header\n"]
        places = np.arange(3 * len(lists)).reshape(-1, 3) / 4
        rows = [b"", b""]
        for part, views in enumerate([[7, 8], []]) if element_before else ():
            rows[part] = self._list(order, "B", "i", views) + (b"" if order else b"\n")
        for (x, y, z), views in zip(places.tolist(), lists, strict=True):
            numbers = struct.pack(f"{order}fdf", x, y, z) if order else f"{x} {y} {z} ".encode()
            seen = self._list(order, length, "H", views)
            red = struct.pack("B", len(views)) if order else f"{len(views)}\n".encode()
            rows.append(b"".join([numbers, seen, red] if behind else [seen, numbers, red]))
        path.write_bytes("\n".join(head).encode() + b"".join(rows))
        cloud = read_points(path)
        np.testing.assert_array_equal(cloud.positions, places)
        assert cloud.attributes["red"].tolist() == [len(views) for views in lists]

    @staticmethod
    def _list(order: str, length: str, kind: str, values: list[int]) -> bytes:
        if not order:
            return " ".join(map(str, [len(values), *values, ""])).encode()
        return struct.pack(f"{order}{length}{len(values)}{kind}", len(values), *values)

    @pytest.mark.parametrize("lengths", [[3, 200], [-1, 0], [0, 30000]])
    def test_that_lie_are_refused(self, tmp_path: Path, lengths: list[int]) -> None:
        head = "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty list short uchar seen\n"
        head += "property float x\nproperty float y\nproperty float z\nend_header\n"
        rows = b"".join(struct.pack("<h", length) + bytes(3) + struct.pack("<3f", 1, 2, 3) for length in lengths)
        (tmp_path / "c.ply").write_bytes(head.encode() + rows)
        with pytest.raises(FormatError, match=r"lists are broken|cut off"):
            read_points(tmp_path / "c.ply")


class TestColumns:
    @pytest.mark.parametrize("text", [
        "contour,px,py,pz\n7,1,2,3\n7,4,5,6\n", "Z;Y;X\n3;2;1\n6;5;4\n", "id East North Height\n1 1 2 3\n2 4 5 6\n",
        "pos_z pos_y pos_x\n3 2 1\n6 5 4\n", '"Points:0","Points:1","Points:2","t"\n1,2,3,0\n4,5,6,0\n',
        "# made by somebody\nt,X_mm,Y_mm,Z_mm\n0,1,2,3\n0,4,5,6\n", "//Z Y X\n3 2 1\n6 5 4\n",
        "X;Y;Z\n1,0;2,0;3,0\n4,0;5,0;6,0\n", "1,0\t2,0\t3,0\n4,0\t5,0\t6,0\n", "2\n1 2 3\n4 5 6\n",
        "2\nfrom a scanner of somebody\n1 2 3\n4 5 6\n", "2\nz y x\n3 2 1\n6 5 4\n", "h,n,e\n3,2,1\n6,5,4\n",
        "Easting [m],Northing [m],Elevation [m],Code\n1,2,3,a\n4,5,6,b\n", "label,r,a,s\n0,1,2,3\n1,4,5,6\n",
    ])  # fmt: skip
    def test_are_found_by_their_names(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "c.csv").write_text(text)
        assert read_points(tmp_path / "c.csv").positions.tolist() == [[1, 2, 3], [4, 5, 6]]

    @pytest.mark.parametrize("text", [
        '"x","y","z"\n"1","2","3"\n"4","5","6"\n', "// made by somebody\n1 2 3\n4 5 6 // the last\n",
        "% made by somebody\n% x y z\n1 2 3\n4 5 6\n", "%z y x\n3 2 1\n6 5 4\n", "//\n\n1 2 3\n4 5 6",
        '"z";"y";"x"\n"3,0";"2,0";"1,0"\n"6,0";"5,0";"4,0"\n',
    ])  # fmt: skip
    @pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16"])
    def test_with_comments_and_quotes(self, tmp_path: Path, text: str, code: str) -> None:
        (tmp_path / "c.csv").write_text(text, encoding=code)
        assert read_points(tmp_path / "c.csv").positions.tolist() == [[1, 2, 3], [4, 5, 6]]

    @pytest.mark.parametrize("suffix", ["xyzn", "xyzrgb"])
    def test_of_open3d(self, tmp_path: Path, suffix: str) -> None:
        (tmp_path / f"c.{suffix}").write_text("1 2 3 0 0 1\n4 5 6 0 1 0\n")
        assert read_points(tmp_path / f"c.{suffix}").positions.tolist() == [[1, 2, 3], [4, 5, 6]]

    def test_three_of_other_names_are_told(self, tmp_path: Path) -> None:
        (tmp_path / "c.csv").write_text("left,back,high\n1,2,3\n")
        cloud = read_points(tmp_path / "c.csv")
        assert cloud.positions.tolist() == [[1, 2, 3]]
        assert cloud.notes == ("the columns left, back, high were taken as x, y and z",)

    @pytest.mark.parametrize(
        "text", ["n,left,back,high\n1,1,2,3\n", "x,y,intensity,t\n1,2,3,4\n", "vx,vy,vz,t\n1,2,3,4\n"]
    )
    def test_more_of_other_names_are_refused(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "c.csv").write_text(text)
        with pytest.raises(FormatError, match="do not say which are x, y and z"):
            read_points(tmp_path / "c.csv")

    @pytest.mark.parametrize("text", ["3\n1 2 3\n4 5 6\n", "1\n1 2 3\n4 5 6\n"])
    def test_a_count_that_lies_is_refused(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "c.xyz").write_text(text)
        with pytest.raises(FormatError, match=r"cut off|count"):
            read_points(tmp_path / "c.xyz")


class TestLeica:
    def test_pts_of_two_scans(self, tmp_path: Path) -> None:
        (tmp_path / "c.pts").write_text("2\n1 2 3 -5 10 20 30\n4 5 6 7 1 2 3\n1\n7 8 9 0 4 5 6\n")
        cloud = read_points(tmp_path / "c.pts")
        assert cloud.positions.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
        assert cloud.attributes["intensity"].tolist() == [-5, 7, 0]
        assert cloud.attributes["red"].tolist() == [10, 1, 4]

    def test_ptx_is_placed_in_meters_without_its_holes(self, tmp_path: Path) -> None:
        matrix = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n"
        scan = "1\n3\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + matrix + "1 2 3 .5\n0 0 0 0\n4 5 6 .25\n"
        (tmp_path / "c.ptx").write_text(scan + scan.replace("10 20 30", "0 0 0"))
        cloud = read_points(tmp_path / "c.ptx")
        placed = [[-2, 1, 3], [-5, 4, 6]]
        assert cloud.positions.tolist() == [[8, 21, 33], [5, 24, 36], *placed]
        assert cloud.attributes["intensity"].tolist() == [0.5, 0.25, 0.5, 0.25]
        assert cloud.unit == "m"

    @pytest.mark.parametrize("cut", [3, 9, 11])
    def test_a_ptx_that_is_cut_off_is_refused(self, tmp_path: Path, cut: int) -> None:
        scan = "1\n3\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 .5\n0 0 0 0\n4 5 6 .25\n"
        (tmp_path / "c.ptx").write_text("\n".join(scan.split("\n")[:cut]) + "\n")
        with pytest.raises(FormatError):
            read_points(tmp_path / "c.ptx")


class TestObj:
    def test_numbers_count_back_from_where_they_stand(self, tmp_path: Path) -> None:
        one = [f"v {x} {y} {z}" for x, y, z in TORUS.vertices]
        two = [f"v {x + 40} {y} {z}" for x, y, z in TORUS.vertices]
        faces = ["f " + " ".join(f"{corner}//{corner}" for corner in face - len(one)) for face in TORUS.faces]
        (tmp_path / "m.obj").write_text("\n".join(one + faces + two + faces))
        assert volume_of(tmp_path / "m.obj") == pytest.approx(2 * TORUS.volume)

    @pytest.mark.parametrize("corner", ["{0}", "{0}/1", "{0}//1", "{0}/1/1"])
    def test_squares_colors_and_lines_that_go_on(self, tmp_path: Path, corner: str) -> None:
        lines = ["mtllib a.mtl", "o box", "vt 0 0", "vn 0 0 1"]
        lines += [f"v {x} {y} \\\n {z} .1 .2 .3" for x, y, z in CORNERS]
        lines += ["g a b", "usemtl c", "s off", "l 1 2", "p 1"]
        lines += ["f " + " \\\r\n".join(corner.format(n + 1) for n in quad) for quad in QUADS]
        (tmp_path / "m.obj").write_text("\r\n".join(lines))
        assert volume_of(tmp_path / "m.obj") == pytest.approx(1)
        cloud = read_points(tmp_path / "m.obj")
        assert cloud.positions.tolist() == CORNERS.tolist()
        assert cloud.attributes["green"].tolist() == [51] * 8

    def test_a_soup_is_joined(self, tmp_path: Path) -> None:
        rows = [f"v {x} {y} {z}" + ("\nf -3 -2 -1" if n % 3 == 2 else "") for n, (x, y, z) in
                enumerate(TORUS.triangles.reshape(-1, 3))]  # fmt: skip
        (tmp_path / "m.obj").write_text("\n".join(rows))
        assert volume_of(tmp_path / "m.obj") == pytest.approx(TORUS.volume)

    @pytest.mark.parametrize(
        "line", ["f 1 2 0", "f 1 2", f"f 1 2 {9**30}", "f 1 2 99", "f -1 -2 -99", "f a b c", "v 1 2"]
    )
    def test_what_cannot_be_is_refused(self, tmp_path: Path, line: str) -> None:
        (tmp_path / "m.obj").write_text("\n".join(["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 2 3", line]))
        with pytest.raises(FormatError):
            read_mesh(tmp_path / "m.obj")


class TestStl:
    def text(self, name: str = "part", end: str = "endsolid part") -> str:
        facets = [
            "facet normal 0 0 0\n outer loop\n" + "".join(f"  vertex {x:e} {y:e} {z:e}\n" for x, y, z in corners)
            + " endloop\nendfacet\n" for corners in BOX.triangles
        ]  # fmt: skip
        return f"solid {name}\n{''.join(facets)}{end}\n"

    @pytest.mark.parametrize("change", [
        lambda text: text, lambda text: text.upper(), lambda text: text.replace("endsolid", "end solid"),
        lambda text: text.replace("\n", "\r\n"), lambda text: text.replace("endfacet", "end facet"),
        lambda text: text.replace("solid part\n", "solid a facet of vertex 1 2 3\n", 1),
        lambda text: "  " + text, lambda text: text.replace("endsolid part", "endsolid"),
        lambda text: text.replace("\n", "\r"), lambda text: text.replace("\n", " "), lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\t").replace(" ", "\t"), lambda text: text.replace("\n", "\n\n"),
        lambda text: text.replace("part\n", "\n"), lambda text: text.replace("\n", " ").replace("part", ""),
        lambda text: text.replace("part\n", "part of a solid\r"),
    ])  # fmt: skip
    def test_text(self, tmp_path: Path, change: Any) -> None:
        (tmp_path / "m.stl").write_bytes(change(self.text()).encode())
        assert volume_of(tmp_path / "m.stl") == pytest.approx(24)

    @pytest.mark.parametrize("end", ["\n", "\r\n", "\r", " "])
    def test_text_of_several_solids(self, tmp_path: Path, end: str) -> None:
        moved = self.text("b", "endsolid b").split("\n")
        moved = [f"  vertex {float(line.split()[1]) + 10} {' '.join(line.split()[2:])}" if "vertex" in line else line
                 for line in moved]  # fmt: skip
        (tmp_path / "m.stl").write_bytes((self.text() + "\n".join(moved)).replace("\n", end).encode())
        assert volume_of(tmp_path / "m.stl") == pytest.approx(48)

    @pytest.mark.parametrize("head", [b"anything", b"solid of some program", b"solid facet outer loop vertex"])
    @pytest.mark.parametrize("behind", [b"", b"\0", b"more of it, as some programs write"])
    def test_binary_with_bytes_behind(self, tmp_path: Path, head: bytes, behind: bytes) -> None:
        data = BOX.export(file_type="stl")
        if b"facet" in head and behind:
            pytest.skip("nobody can tell that from a text")
        (tmp_path / "m.stl").write_bytes(head.ljust(80) + data[80:] + behind)
        assert volume_of(tmp_path / "m.stl") == pytest.approx(24)

    @pytest.mark.parametrize("change", [
        lambda text: text[: len(text) // 2], lambda text: text.replace("endsolid part", ""),
        lambda text: text.replace("vertex", "vertx", 1), lambda text: text.replace(" endloop\nendfacet\n", "", 1),
        lambda text: text.replace("e+00", "e+zz", 1),
    ])  # fmt: skip
    def test_text_that_is_cut_off_is_refused(self, tmp_path: Path, change: Any) -> None:
        (tmp_path / "m.stl").write_text(change(self.text()))
        with pytest.raises(FormatError):
            read_mesh(tmp_path / "m.stl")


class TestOurOwn:
    @pytest.mark.parametrize("kind", ["vtp", "3mf", "glb", "gii"])
    def test_meshes_come_back(self, tmp_path: Path, kind: str) -> None:
        mesh = TriMesh(np.array(TORUS.vertices), np.array(TORUS.faces))
        path = tmp_path / f"m.{kind}"
        io.write_mesh(
            mesh, path, unit="mm", frame="RAS", vertex_fields={"red": np.full(len(mesh.vertices), 7, np.uint8)}
        )
        back = read_mesh(path)
        np.testing.assert_allclose(back.vertices, mesh.vertices, atol=1e-6 if kind in ("glb", "gii") else 0)
        np.testing.assert_array_equal(back.faces, mesh.faces)
        assert io.frame_of_file(path) == {"unit": "mm", "frame": "RAS"}

    def test_points_with_all_that_is_known_of_them(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(1)
        ids = np.arange(5, dtype=np.int32)
        known: dict[str, NDArray[Any]] = {
            "red": ids.astype(np.uint8),
            "green": ids.astype(np.uint8),
            "blue": ids.astype(np.uint8),
            "t": ids / 3,
        }
        points = PointSet(rng.normal(size=(5, 3)), ids, ids, np.zeros(5, np.uint8), known)
        io.write_points(points, tmp_path / "c.vtp")
        back = read_points(tmp_path / "c.vtp")
        np.testing.assert_array_equal(back.positions, points.positions)
        np.testing.assert_array_equal(back.slices, ids)
        assert sorted(back.attributes) == sorted(known)
        for name, values in known.items():
            np.testing.assert_array_equal(back.attributes[name], values)


class TestVtk:
    @pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
    @pytest.mark.parametrize("packed", [True, False])
    @pytest.mark.parametrize("encoded", [True, False])
    @pytest.mark.parametrize("big", [True, False])
    def test_what_it_writes(self, tmp_path: Path, mode: str, packed: bool, encoded: bool, big: bool) -> None:
        vtk = needed("vtk")
        source = vtk.vtkSphereSource()
        source.SetThetaResolution(40)
        source.SetPhiResolution(40)
        writer = vtk.vtkXMLPolyDataWriter()
        writer.SetFileName(str(tmp_path / "m.vtp"))
        writer.SetInputConnection(source.GetOutputPort())
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.SetEncodeAppendedData(encoded)
        writer.SetByteOrder(0 if big else 1)
        writer.SetBlockSize(4096)
        if not packed:
            writer.SetCompressor(None)
        writer.Write()
        judge = source.GetOutput()
        mesh, cloud = read_mesh(tmp_path / "m.vtp"), read_points(tmp_path / "m.vtp")
        right: NDArray[np.float64] = np.array([judge.GetPoint(n) for n in range(judge.GetNumberOfPoints())])
        np.testing.assert_allclose(mesh.vertices, right, atol=1e-6 if mode == "Ascii" else 0)
        np.testing.assert_array_equal(cloud.positions, mesh.vertices)
        faces = [[judge.GetCell(n).GetPointId(k) for k in range(3)] for n in range(judge.GetNumberOfCells())]
        np.testing.assert_array_equal(mesh.faces, faces)

    def test_glb_of_another_is_in_meters_with_its_seams_joined(self, tmp_path: Path) -> None:
        scene = trimesh.Scene()
        split = trimesh.Trimesh(BOX.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
        scene.add_geometry(split, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
        scene.export(tmp_path / "m.glb")
        assert volume_of(tmp_path / "m.glb") == pytest.approx(24)
        assert read_mesh(tmp_path / "m.glb").vertices[:, 0].mean() == pytest.approx(5)
        assert io.frame_of_file(tmp_path / "m.glb") == {"unit": "m"}

    def test_3mf_of_lib3mf_with_components(self, tmp_path: Path) -> None:
        lib3mf = needed("lib3mf")
        wrapper = lib3mf.get_wrapper()
        model = wrapper.CreateModel()
        model.SetUnit(lib3mf.ModelUnit.Inch)
        mesh = model.AddMeshObject()
        vertices = [lib3mf.Position(Coordinates=tuple(map(float, place))) for place in BOX.vertices]
        mesh.SetGeometry(vertices, [lib3mf.Triangle(Indices=tuple(map(int, face))) for face in BOX.faces])
        both = model.AddComponentsObject()
        both.AddComponent(mesh, wrapper.GetIdentityTransform())
        both.AddComponent(mesh, wrapper.GetTranslationTransform(10, 0, 0))
        model.AddBuildItem(both, wrapper.GetTranslationTransform(0, 7, 0))
        model.QueryWriter("3mf").WriteToFile(str(tmp_path / "m.3mf"))
        assert volume_of(tmp_path / "m.3mf") == pytest.approx(48)
        np.testing.assert_allclose(read_mesh(tmp_path / "m.3mf").vertices.mean(axis=0), [5, 7, 0])
        assert io.frame_of_file(tmp_path / "m.3mf") == {"unit": "in"}

    def test_circles_of_components_are_refused(self, tmp_path: Path) -> None:
        import zipfile

        objects = "".join(
            f'<object id="{n}"><components><component objectid="{n % 20 + 1}"/><component objectid="{n % 20 + 1}"/>'
            "</components></object>" for n in range(1, 21)
        )  # fmt: skip
        text = (
            '<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
            f'{objects}</resources><build><item objectid="1"/></build></model>'
        )
        with zipfile.ZipFile(tmp_path / "m.3mf", "w") as archive:
            archive.writestr("3D/3dmodel.model", text)
        with pytest.raises(FormatError, match="cannot be understood"):
            read_mesh(tmp_path / "m.3mf")
