"""Meshes as many programs write them: polygons, strips, properties in between, seams, counts that are not known."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import EmptyError, FormatError
from tomomesh.io import read_mesh, read_points
from tomomesh.io.meshes.cells import joined, strips
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

    from tomomesh import TriMesh

BOX = trimesh.creation.box((2, 3, 4))
CORNERS = np.array([[x, y, z] for z in (0, 4) for x, y in ((0, 0), (2, 0), (2, 3), (0, 3))], float)
QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
MIXED = [*QUADS[:3], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
NAMES = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}


def assert_solid(mesh: TriMesh, volume: float = 24.0) -> None:
    """Demand every edge once in each direction, and the volume."""
    edges = mesh.half_edges
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge[::-1]) for edge in edges.tolist()}
    assert mesh.face_volumes.sum() == pytest.approx(volume)


def ply(path: Path, faces: list[list[int]], order: str = "<", texture: bool = False, end: str = "\n") -> Path:
    """Write polygons behind properties, lists and elements that are no concern of a mesh."""
    head = [
        "ply",
        f"format {NAMES[order]} 1.0",
        "comment made here",
        "element camera 1",
        "property list uchar int views",
    ]
    head += ["element vertex 8", "property float z", "property uchar red", "property double y", "property float x"]
    head += [f"element face {len(faces)}", "property uchar flag", "property list uchar int vertex_indices"]
    head += ["property list uchar float texcoord"] * texture + ["element edge 1", "property int a", "end_header"]
    kinds = "BB2i" if order else ""
    rows: list[tuple[str, list[float]]] = [("B2i", [2, 7, 8])]
    rows += [("fBdf", [z, 200, y, x]) for x, y, z in CORNERS.tolist()]
    for face in faces:
        coordinates = [0.25] * 2 * len(face)
        more = [len(coordinates), *coordinates] if texture else []
        kinds = f"BB{len(face)}i" + (f"B{len(coordinates)}f" if texture else "")
        rows.append((kinds, [1, len(face), *face, *more]))
    rows.append(("i", [5]))
    text = end.join(head) + end
    if order:
        packed = b"".join(struct.pack(order + kinds, *_whole(kinds, values)) for kinds, values in rows)
        path.write_bytes(text.encode() + packed)
    else:
        path.write_bytes((text + end.join(" ".join(f"{value:g}" for value in row) for _, row in rows) + end).encode())
    return path


def _whole(kinds: str, values: list[float]) -> list[float]:
    """Return the numbers as struct wants them."""
    spelled = "".join(kind * int(count or 1) for count, kind in re.findall(r"(\d*)([a-zA-Z])", kinds))
    return [value if kind in "fd" else int(value) for kind, value in zip(spelled, values, strict=True)]


class TestPly:
    @pytest.mark.parametrize("order", NAMES)
    @pytest.mark.parametrize("faces", [QUADS, MIXED, MIXED[::-1]])
    @pytest.mark.parametrize("texture", [False, True])
    def test_polygons_between_other_things(
        self, tmp_path: Path, order: str, faces: list[list[int]], texture: bool
    ) -> None:
        path = ply(tmp_path / "m.ply", faces, order, texture)
        mesh = read_mesh(path)
        assert_solid(mesh)
        np.testing.assert_array_equal(mesh.vertices, CORNERS)
        assert read_points(path).positions.tolist() == CORNERS.tolist()

    @pytest.mark.parametrize("order", NAMES)
    @pytest.mark.parametrize("end", ["\r\n", "\r"])
    def test_line_ends(self, tmp_path: Path, order: str, end: str) -> None:
        assert_solid(read_mesh(ply(tmp_path / "m.ply", MIXED, order, end=end)))

    @pytest.mark.parametrize("binary", [False, True])
    def test_of_meshio(self, tmp_path: Path, binary: bool) -> None:
        cells = [("quad", np.array(QUADS[:3])), ("triangle", np.array(MIXED[3:]))]
        needed("meshio").Mesh(CORNERS, cells).write(tmp_path / "m.ply", binary=binary)
        assert_solid(read_mesh(tmp_path / "m.ply"))

    def test_strips_as_range_scans_have_them(self, tmp_path: Path) -> None:
        around = [4, 0, 5, 1, 6, 2, 7, 3, 4, 0]
        strip = [*around, -1, 4, 5, 7, 6, -1, 0, 3, 1, 2]
        head = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
        rows = [*(" ".join(map(str, place)) for place in CORNERS), " ".join(map(str, [len(strip), *strip]))]
        head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        (tmp_path / "m.ply").write_text(head + "\n".join(rows) + "\n")
        mesh = read_mesh(tmp_path / "m.ply")
        assert len(mesh.faces) == 12
        assert_solid(mesh)

    @pytest.mark.parametrize("order", NAMES)
    @pytest.mark.parametrize("faces", [[[0, 1]], [[0, 1], [0, 1, 2]], [[0, 1, 2], []]])
    def test_faces_of_less_than_three_corners_are_refused(
        self, tmp_path: Path, order: str, faces: list[list[int]]
    ) -> None:
        with pytest.raises(FormatError, match="three vertices or more"):
            read_mesh(ply(tmp_path / "m.ply", faces, order))

    @pytest.mark.parametrize("order", NAMES)
    @pytest.mark.parametrize("faces", [QUADS, MIXED])
    def test_one_that_is_cut_off_is_refused(self, tmp_path: Path, order: str, faces: list[list[int]]) -> None:
        path = ply(tmp_path / "m.ply", faces, order)
        whole = path.read_bytes()
        for lost in (6, 20, 60, 100):
            path.write_bytes(whole[:-lost])
            with pytest.raises(FormatError):
                read_mesh(path)


class TestOff:
    @pytest.mark.parametrize("change", [
        lambda text: text, lambda text: text.replace("OFF\n", "OFF\n# c\n\n"), lambda text: text[4:],
        lambda text: text.replace("OFF\n", "OFF "), lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"), lambda text: "# first\n" + text, lambda text: "\ufeff" + text,
        lambda text: text.replace("\n4 ", "\n4  ").replace(" 0\n", " 0 # x\n", 1),
    ])  # fmt: skip
    @pytest.mark.parametrize(("head", "behind"), [("OFF", ""), ("COFF", " 255 0 0 255"), ("NOFF", " 0 0 1"),
                                                  ("NCOFF", " 9 8 7 255 0 0 1"), ("STOFF", " .5 .5")])  # fmt: skip
    def test_of_many(self, tmp_path: Path, change: Any, head: str, behind: str) -> None:
        rows = [f"{x} {y} {z}{behind}" for x, y, z in CORNERS] + [
            " ".join(map(str, [len(face), *face])) + " 255 0 0" * (head == "OFF") for face in MIXED
        ]
        text = change(f"OFF\n8 {len(MIXED)} 0\n" + "\n".join(rows) + "\n")
        (tmp_path / "m.off").write_bytes(text.replace("OFF", head, 1).encode())
        mesh = read_mesh(tmp_path / "m.off")
        assert_solid(mesh)
        np.testing.assert_array_equal(mesh.vertices, CORNERS)

    @pytest.mark.parametrize("text", [
        "", "OFF", "OFF\n1 1", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
        "OFF\n3 1 0\n0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF\n-3 1 0\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n",
        "OFF BINARY\n3 1 0\n",
        f"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 {9**30}\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n",
    ])  # fmt: skip
    def test_what_cannot_be_is_refused(self, tmp_path: Path, text: str) -> None:
        (tmp_path / "m.off").write_text(text)
        with pytest.raises(FormatError):
            read_mesh(tmp_path / "m.off")


class TestStl:
    @pytest.mark.parametrize("count", [0, 2**32 - 1])
    def test_a_count_that_was_not_known(self, tmp_path: Path, count: int) -> None:
        data = BOX.export(file_type="stl")
        (tmp_path / "m.stl").write_bytes(data[:80] + struct.pack("<I", count) + data[84:])
        assert_solid(read_mesh(tmp_path / "m.stl"))
        (tmp_path / "m.stl").write_bytes(data[:80] + struct.pack("<I", count) + data[84:-7])
        with pytest.raises((FormatError, EmptyError)):
            read_mesh(tmp_path / "m.stl")

    def test_another_count_is_believed(self, tmp_path: Path) -> None:
        data = BOX.export(file_type="stl")
        (tmp_path / "m.stl").write_bytes(data[:80] + struct.pack("<I", 13) + data[84:])
        with pytest.raises(FormatError, match="cut off"):
            read_mesh(tmp_path / "m.stl")

    def test_a_long_name(self, tmp_path: Path) -> None:
        text = BOX.export(file_type="stl_ascii")
        (tmp_path / "m.stl").write_text("solid " + "part " * 1000 + text[text.index("\n") :])
        assert_solid(read_mesh(tmp_path / "m.stl"))

    def test_a_text_without_faces_is_empty(self, tmp_path: Path) -> None:
        (tmp_path / "m.stl").write_text("solid x\nendsolid x\n")
        with pytest.raises(EmptyError):
            read_mesh(tmp_path / "m.stl")


def test_obj_with_comments_behind_its_rows(tmp_path: Path) -> None:
    rows = [f"v {x} {y} {z} # {n}" for n, (x, y, z) in enumerate(CORNERS)]
    rows += [f"{word} {' '.join(str(n + 1) for n in face)}# a face" for word, face in zip("ff", MIXED[:2], strict=True)]
    rows += [f"fo {' '.join(str(n + 1) for n in face)}" for face in MIXED[2:]]
    (tmp_path / "m.obj").write_text("\n".join(rows))
    assert_solid(read_mesh(tmp_path / "m.obj"))
    assert read_points(tmp_path / "m.obj").positions.tolist() == CORNERS.tolist()


class TestSeams:
    """Writers that give each face its own normals or colors leave borders that lie on each other."""

    @pytest.mark.parametrize("suffix", ["ply", "obj", "vtp"])
    @pytest.mark.parametrize("strip", [False, True])
    def test_of_vtk_are_joined(self, tmp_path: Path, suffix: str, strip: bool) -> None:
        vtk = needed("vtk")
        source = vtk.vtkCubeSource()
        source.SetXLength(2)
        source.SetYLength(3)
        source.SetZLength(4)
        triangles, stripper = vtk.vtkTriangleFilter(), vtk.vtkStripper()
        triangles.SetInputConnection(source.GetOutputPort())
        stripper.SetInputConnection(triangles.GetOutputPort())
        kinds = {"ply": vtk.vtkPLYWriter, "obj": vtk.vtkOBJWriter, "vtp": vtk.vtkXMLPolyDataWriter}
        writer = kinds[suffix]()
        writer.SetFileName(str(tmp_path / f"m.{suffix}"))
        writer.SetInputConnection((stripper if strip and suffix == "vtp" else source).GetOutputPort())
        writer.Write()
        mesh = read_mesh(tmp_path / f"m.{suffix}")
        assert_solid(mesh)
        assert len(mesh.vertices) == 8

    @law(60)
    @given(st.data())
    def test_joined_is_what_it_was_before_it_was_cut(self, data: st.DataObject) -> None:
        body = trimesh.creation.icosphere(1)
        parts = np.array(data.draw(st.lists(st.integers(0, 3), min_size=80, max_size=80)))
        pieces = [body.faces[parts == part] for part in np.unique(parts)]
        vertices = np.concatenate([body.vertices] * len(pieces))
        cut = np.concatenate([faces + n * len(body.vertices) for n, faces in enumerate(pieces)])
        unique, faces = joined(vertices, cut)
        whole = body.vertices[np.concatenate(pieces)]
        np.testing.assert_array_equal(unique[faces], whole)
        used = np.unique(faces)
        assert len(used) == len(body.vertices)
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        assert len(np.unique(edges, axis=0)) == len(edges)

    def test_closed_bodies_that_touch_stay_apart(self) -> None:
        one, other = np.array(BOX.vertices), BOX.vertices + np.array([2.0, 3.0, 0.0])
        faces = np.concatenate([BOX.faces, BOX.faces + 8])
        vertices, after = joined(np.concatenate([one, other]), faces)
        assert len(vertices) == 16
        np.testing.assert_array_equal(after, faces)

    def test_borders_that_would_run_the_same_way_stay_apart(self) -> None:
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]], float)
        faces = np.array([[0, 1, 2], [3, 4, 5]])
        np.testing.assert_array_equal(joined(vertices, faces)[1], faces)


@law(100)
@given(st.lists(st.lists(st.integers(-1, 6), max_size=9), max_size=5))
def test_strips_equal_a_slow_twin(rows: list[list[int]]) -> None:
    found = []
    for row in rows:
        words = " ".join(map(str, row)).split("-1")
        for part in ([int(word) for word in one.split()] for one in words):
            for n in range(len(part) - 2):
                a, b, c = part[n : n + 3] if n % 2 == 0 else part[n : n + 3][::-1]
                found += [[a, b, c]] if len({a, b, c}) == 3 else []
    corners = np.array([corner for row in rows for corner in row], np.int64)
    sizes = np.array([len(row) for row in rows], np.int64)
    assert strips(corners, sizes).tolist() == found
