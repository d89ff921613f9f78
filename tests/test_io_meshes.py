"""Meshes: written files are judged by trimesh and by their bytes."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studies import shared
from tomomesh.errors import EmptyError, FormatError, OutputError, UsageError
from tomomesh.io import read_mesh, read_points, write_mesh
from tomomesh.io.meshes.cells import weld
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from pathlib import Path


def ball(shift: float = 0.0) -> TriMesh:
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=10 / 3)
    return TriMesh(np.array(sphere.vertices) + shift, np.array(sphere.faces, np.int64))


def as_single(mesh: TriMesh) -> TriMesh:
    return mesh.moved(mesh.vertices.astype(np.float32).astype(np.float64))


def fields_of(mesh: TriMesh) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return fields at the vertices and on the faces, the colors first."""
    rng, n, m = np.random.default_rng(3), len(mesh.vertices), len(mesh.faces)
    colors = {name: rng.integers(0, 256, n).astype(np.uint8) for name in ("red", "green", "blue")}
    others = {"intensity": rng.random(n).astype(np.float32), "flow": rng.normal(size=(n, 2))}
    return {**colors, **others}, {"filled": rng.random(m) < 0.5, "gray level": rng.integers(-9, 9, m)}


class TestWrite:
    @pytest.mark.parametrize("suffix", [".ply", ".obj"])
    def test_64_bits_come_back_exactly(self, tmp_path: Path, suffix: str) -> None:
        mesh = ball(1e9)
        write_mesh(mesh, tmp_path / f"m{suffix}")
        back = read_mesh(tmp_path / f"m{suffix}")
        np.testing.assert_array_equal(back.vertices, mesh.vertices)
        np.testing.assert_array_equal(back.faces, mesh.faces)
        judge = trimesh.load(tmp_path / f"m{suffix}", process=False)
        np.testing.assert_array_equal(judge.triangles, mesh.corners)

    def test_stl_comes_back_closed_with_its_faces_in_order(self, tmp_path: Path) -> None:
        mesh = as_single(ball())
        write_mesh(mesh, tmp_path / "m.stl")
        back = read_mesh(tmp_path / "m.stl")
        np.testing.assert_array_equal(back.corners, mesh.corners)
        assert len(back.vertices) == len(mesh.vertices)
        judge = trimesh.load(tmp_path / "m.stl")
        assert judge.is_watertight
        assert judge.is_winding_consistent
        assert judge.volume == pytest.approx(trimesh.Trimesh(mesh.vertices, mesh.faces).volume)

    def test_stl_bytes(self, tmp_path: Path) -> None:
        write_mesh(ball(), tmp_path / "m.stl", unit="cm", frame="RAS")
        raw = (tmp_path / "m.stl").read_bytes()
        assert raw[:80].rstrip() == b"tomomesh 0.1.0 unit=cm frame=RAS"
        (count,) = struct.unpack("<I", raw[80:84])
        assert len(raw) == 84 + 50 * count
        for at in range(84, len(raw), 50):
            row = np.array(struct.unpack("<12f", raw[at : at + 48])).reshape(4, 3)
            normal = np.cross(row[2] - row[1], row[3] - row[1])
            np.testing.assert_allclose(row[0], normal / np.linalg.norm(normal), atol=1e-5)
            assert row[0] @ row[1] > 0
            assert raw[at + 48 : at + 50] == b"\0\0"

    def test_ply_bytes(self, tmp_path: Path) -> None:
        mesh = ball()
        write_mesh(mesh, tmp_path / "m.ply")
        head, _, body = (tmp_path / "m.ply").read_bytes().partition(b"end_header\n")
        assert head.decode().splitlines() == [
            "ply",
            "format binary_little_endian 1.0",
            "comment tomomesh 0.1.0 unit=mm frame=LPS",
            f"element vertex {len(mesh.vertices)}",
            "property double x",
            "property double y",
            "property double z",
            f"element face {len(mesh.faces)}",
            "property list uchar int vertex_indices",
        ]
        split = 24 * len(mesh.vertices)
        np.testing.assert_array_equal(list(struct.iter_unpack("<ddd", body[:split])), mesh.vertices)
        faces = np.array(list(struct.iter_unpack("<B3i", body[split:])))
        assert (faces[:, 0] == 3).all()
        np.testing.assert_array_equal(faces[:, 1:], mesh.faces)

    def test_ply_holds_the_fields_of_vertices_and_faces(self, tmp_path: Path) -> None:
        mesh = ball()
        at_vertices, on_faces = fields_of(mesh)
        write_mesh(mesh, tmp_path / "m.ply", vertex_fields=at_vertices, face_fields=on_faces)
        head = (tmp_path / "m.ply").read_bytes().partition(b"end_header\n")[0].decode()
        assert [line for line in head.splitlines() if line.startswith("property")] == [
            *(f"property double {axis}" for axis in "xyz"),
            *(f"property uchar {name}" for name in ("red", "green", "blue")),
            "property float intensity",
            "property double flow_0",
            "property double flow_1",
            "property list uchar int vertex_indices",
            "property uchar filled",
            "property int gray_level",
        ]
        judge = trimesh.load(tmp_path / "m.ply", process=False)
        np.testing.assert_array_equal(judge.triangles, mesh.corners)
        np.testing.assert_array_equal(
            judge.visual.vertex_colors[:, :3], np.stack(list(at_vertices.values())[:3], axis=1)
        )
        rows = {name: element["data"] for name, element in judge.metadata["_ply_raw"].items()}
        np.testing.assert_array_equal(rows["vertex"]["intensity"], at_vertices["intensity"])
        np.testing.assert_array_equal(rows["vertex"]["flow_1"], at_vertices["flow"][:, 1])
        np.testing.assert_array_equal(rows["face"]["filled"], on_faces["filled"])
        np.testing.assert_array_equal(rows["face"]["gray_level"], on_faces["gray level"])
        np.testing.assert_array_equal(read_mesh(tmp_path / "m.ply").corners, mesh.corners)
        attributes = read_points(tmp_path / "m.ply").attributes
        np.testing.assert_array_equal(attributes["flow_0"], at_vertices["flow"][:, 0])

    def test_obj_holds_the_colors(self, tmp_path: Path) -> None:
        mesh = ball()
        at_vertices, on_faces = fields_of(mesh)
        write_mesh(mesh, tmp_path / "m.obj", vertex_fields=at_vertices, face_fields=on_faces)
        colors = np.stack(list(at_vertices.values())[:3], axis=1)
        judge = trimesh.load(tmp_path / "m.obj", process=False)
        np.testing.assert_array_equal(judge.visual.vertex_colors[:, :3], colors)
        np.testing.assert_array_equal(judge.triangles, mesh.corners)
        points = read_points(tmp_path / "m.obj")
        np.testing.assert_array_equal(points.positions, mesh.vertices)
        np.testing.assert_array_equal(np.stack(list(points.attributes.values()), axis=1), colors)

    def test_stl_and_a_mesh_without_colors_are_as_before(self, tmp_path: Path) -> None:
        mesh = ball()
        at_vertices, on_faces = fields_of(mesh)
        for suffix, fields in ((".stl", at_vertices), (".obj", {"intensity": at_vertices["intensity"]})):
            write_mesh(mesh, tmp_path / f"a{suffix}")
            write_mesh(mesh, tmp_path / f"b{suffix}", vertex_fields=fields, face_fields=on_faces)
            assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()

    def test_fields_that_do_not_fit_are_refused(self, tmp_path: Path) -> None:
        mesh = ball()
        with pytest.raises(UsageError, match="a field does not fit"):
            write_mesh(mesh, tmp_path / "m.ply", vertex_fields={"intensity": np.zeros(len(mesh.faces))})
        with pytest.raises(UsageError, match="a field does not fit"):
            write_mesh(mesh, tmp_path / "m.ply", face_fields={"name": np.array(["a"] * len(mesh.faces))})
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl"])
    def test_the_bytes_repeat(self, tmp_path: Path, suffix: str) -> None:
        for name in ("a", "b"):
            at_vertices, on_faces = fields_of(ball())
            write_mesh(ball(), tmp_path / f"{name}{suffix}", vertex_fields=at_vertices, face_fields=on_faces)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
        assert b"unit=mm frame=LPS" in (tmp_path / f"a{suffix}").read_bytes()[:200]

    @pytest.mark.parametrize("shift", [1e9, 1e39])
    def test_stl_that_cannot_tell_vertices_apart_names_ply(self, tmp_path: Path, shift: float) -> None:
        with pytest.raises(OutputError, match=r"\.ply"):
            write_mesh(ball(shift), tmp_path / "m.stl")
        assert list(tmp_path.iterdir()) == []

    def test_positions_that_are_equal_from_the_start_are_no_fault(self, tmp_path: Path) -> None:
        mesh = as_single(ball())
        soup = TriMesh(mesh.corners.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
        write_mesh(soup, tmp_path / "m.stl")
        assert len(read_mesh(tmp_path / "m.stl").vertices) == len(mesh.vertices)

    def test_outputs_are_checked(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match=r"\.obj \| \.off \| \.ply \| \.stl"):
            write_mesh(ball(), tmp_path / "m.vtk")
        with pytest.raises(OutputError):
            write_mesh(ball(), tmp_path / "none" / "m.stl")


class TestWeld:
    @given(
        positions=hnp.arrays(
            np.float64,
            st.tuples(st.integers(0, 30), st.just(3)),
            elements=st.sampled_from([0.0, -0.0, 1.0, 1e-9]),
        )
    )
    def test_equals_a_dictionary_of_positions(self, positions: np.ndarray) -> None:
        unique, numbers = weld(positions)
        seen: dict[tuple[float, ...], int] = {}
        expected = [seen.setdefault(tuple(row + 0.0), len(seen)) for row in positions]
        assert numbers.tolist() == expected
        np.testing.assert_array_equal(unique, np.array(list(seen)).reshape(-1, 3))


class TestRead:
    @pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off"])
    def test_what_trimesh_wrote(self, tmp_path: Path, suffix: str) -> None:
        mesh = as_single(ball())
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / f"m{suffix}")
        np.testing.assert_allclose(read_mesh(tmp_path / f"m{suffix}").corners, mesh.corners, atol=1e-7)

    def test_text_stl(self, tmp_path: Path) -> None:
        mesh = as_single(ball())
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "m.stl", file_type="stl_ascii")
        back = read_mesh(tmp_path / "m.stl")
        assert len(back.vertices) == len(mesh.vertices)
        np.testing.assert_allclose(back.corners, mesh.corners, atol=1e-6)

    def test_text_ply(self, tmp_path: Path) -> None:
        mesh = as_single(ball())
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "m.ply", encoding="ascii")
        np.testing.assert_allclose(read_mesh(tmp_path / "m.ply").corners, mesh.corners, atol=1e-6)

    @pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off"])
    @pytest.mark.parametrize("content", [b"", b"\0" * 200, b"rubbish\n" * 40])
    def test_rubbish_is_refused(self, tmp_path: Path, suffix: str, content: bytes) -> None:
        (tmp_path / f"m{suffix}").write_bytes(content)
        with pytest.raises((FormatError, EmptyError)):
            read_mesh(tmp_path / f"m{suffix}")

    @pytest.mark.parametrize("suffix", [".stl", ".ply"])
    def test_a_count_that_lies_is_refused(self, tmp_path: Path, suffix: str) -> None:
        write_mesh(ball(), tmp_path / f"m{suffix}")
        whole = (tmp_path / f"m{suffix}").read_bytes()
        (tmp_path / f"m{suffix}").write_bytes(whole[: -len(whole) // 2])
        with pytest.raises(FormatError, match="cut off"):
            read_mesh(tmp_path / f"m{suffix}")

    @pytest.mark.parametrize(
        ("name", "text", "word"),
        [
            ("m.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "vertex 3"),
            ("m.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "Error|vertex numbers"),
            ("m.obj", "v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", "vertex 3"),
            ("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "Error|vertex numbers"),
            ("m.foo", "x", "suffix = .foo"),
        ],
    )
    def test_broken_vertices_and_faces_are_named(self, tmp_path: Path, name: str, text: str, word: str) -> None:
        (tmp_path / name).write_text(text)
        with pytest.raises(FormatError, match=word):
            read_mesh(tmp_path / name)

    def test_a_mesh_without_faces_is_empty(self, tmp_path: Path) -> None:
        write_mesh(TriMesh(np.zeros((3, 3)), np.zeros((0, 3), np.int64)), tmp_path / "m.ply")
        with pytest.raises(EmptyError):
            read_mesh(tmp_path / "m.ply")


class TestSharedData:
    @pytest.mark.parametrize(
        ("name", "vertices", "faces"),
        [
            ("common3d/fandisk.obj", 6475, 12946),
            ("common3d/rocker-arm.obj", 10044, 20088),
            ("odedstein/cube/cube.obj", 26, 48),
            ("odedstein/skull/skull_low_resolution.obj", 5154, 10312),
            ("euclid/bumpy.off", 1250, 2496),
        ],
    )
    def test_meshes_are_read_as_stored(self, name: str, vertices: int, faces: int) -> None:
        mesh = read_mesh(shared(name))
        assert (len(mesh.vertices), len(mesh.faces)) == (vertices, faces)
