"""Clouds as users have them: written by somebody else, read with what they say of each point."""

from __future__ import annotations

import struct
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import FormatError
from tomomesh.io import read_points
from writers import needed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

RNG = np.random.default_rng(7)
COUNT = 60
CLOUD = RNG.normal(scale=40, size=(COUNT, 3))
RGB = RNG.integers(0, 256, (COUNT, 3)).astype(np.uint8)
INTENSITY = RNG.random(COUNT).astype(np.float32)
LABELS = RNG.integers(0, 9, COUNT)


def check_colors(attributes: Any, colors: NDArray[np.uint8] = RGB) -> None:
    for name, column in zip(("red", "green", "blue"), colors.T, strict=True):
        assert attributes[name].dtype == np.uint8
        np.testing.assert_array_equal(attributes[name], column)


class TestArrays:
    @pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
    @pytest.mark.parametrize("name", ["points", "xyz", "vertices", "arr_0"])
    def test_npz(self, tmp_path: Path, save: Callable[..., None], name: str) -> None:
        others = {"labels": LABELS, "normals": CLOUD, "rgb": RGB, "scale": 2.0, "names": np.array(["a"] * COUNT)}
        save(tmp_path / "c.npz", **{name: CLOUD.astype(">f4")}, **others)
        points = read_points(tmp_path / "c.npz")
        np.testing.assert_array_equal(points.positions, CLOUD.astype(np.float32))
        assert list(points.attributes) == ["labels", "rgb"]
        np.testing.assert_array_equal(points.attributes["labels"], LABELS)
        np.testing.assert_array_equal(points.attributes["rgb"], RGB)

    def test_npz_with_an_array_an_axis(self, tmp_path: Path) -> None:
        np.savez(tmp_path / "c.npz", x=CLOUD[:, 0], y=CLOUD[:, 1], z=CLOUD[:, 2], age=LABELS)
        points = read_points(tmp_path / "c.npz")
        np.testing.assert_array_equal(points.positions, CLOUD)
        np.testing.assert_array_equal(points.attributes["age"], LABELS)

    @pytest.mark.parametrize("order", ["<", ">"])
    def test_npy_with_named_fields(self, tmp_path: Path, order: str) -> None:
        rows = np.zeros(COUNT, [("z", f"{order}f8"), ("y", f"{order}f8"), ("x", f"{order}f8"), ("age", f"{order}i4")])
        rows["x"], rows["y"], rows["z"] = CLOUD.T
        rows["age"] = LABELS
        np.save(tmp_path / "c.npy", rows)
        points = read_points(tmp_path / "c.npy")
        np.testing.assert_array_equal(points.positions, CLOUD)
        np.testing.assert_array_equal(points.attributes["age"], LABELS)
        assert points.attributes["age"].dtype == np.int32

    def test_npy_in_either_order_of_axes(self, tmp_path: Path) -> None:
        np.save(tmp_path / "c.npy", np.asfortranarray(CLOUD))
        np.testing.assert_array_equal(read_points(tmp_path / "c.npy").positions, CLOUD)


class TestPcd:
    @pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
    def test_what_pypcd4_wrote(self, tmp_path: Path, encoding: str) -> None:
        pypcd4 = needed("pypcd4")
        packed = pypcd4.PointCloud.encode_rgb(RGB)
        single = CLOUD.astype(np.float32)
        rows = [*single.T, packed, INTENSITY, LABELS.astype(np.uint16), *single.T]
        names = ("x", "y", "z", "rgb", "intensity", "label", "normal_x", "normal_y", "normal_z")
        kinds = (*[np.float32] * 5, np.uint16, *[np.float32] * 3)
        pypcd4.PointCloud.from_points(rows, names, kinds).save(tmp_path / "c.pcd", pypcd4.Encoding(encoding))
        points = read_points(tmp_path / "c.pcd")
        tolerance = 1e-5 if encoding == "ascii" else 0  # pypcd4 writes ten decimals: too few for packed colors
        np.testing.assert_allclose(points.positions, single, rtol=tolerance, atol=tolerance)
        assert list(points.attributes) == ["red", "green", "blue", "intensity", "label"]
        if encoding != "ascii":
            check_colors(points.attributes)
        np.testing.assert_allclose(points.attributes["intensity"], INTENSITY, rtol=tolerance)
        np.testing.assert_array_equal(points.attributes["label"], LABELS)
        assert [points.attributes[name].dtype for name in ("intensity", "label")] == [np.float32, np.uint16]

    def test_organized_text_with_padding_several_values_and_holes(self, tmp_path: Path) -> None:
        (tmp_path / "c.pcd").write_text(
            "# .PCD v.7\nVERSION .7\nFIELDS hist x _ y z rgba\nSIZE 4 4 1 4 4 4\nTYPE F F U F F U\n"
            "COUNT 2 1 3 1 1 1\nWIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n"
            f"7 8 1 0 0 0 2 3 {0x80FF0102}\n1 2 nan 0 0 0 nan nan 0\n5 6 4 0 0 0 5 6 1\n0 0 7 0 0 0 8 1000000001 0\n"
        )
        points = read_points(tmp_path / "c.pcd")
        np.testing.assert_array_equal(points.positions, [[1, 2, 3], [4, 5, 6], [7, 8, 1000000001]])
        np.testing.assert_array_equal(points.attributes["hist"], [[7, 8], [5, 6], [0, 0]])
        assert {name: column.tolist() for name, column in points.attributes.items() if name != "hist"} == {
            "red": [255, 0, 0],
            "green": [1, 0, 0],
            "blue": [2, 1, 0],
            "alpha": [128, 0, 0],
        }

    @law(100)
    @given(
        counts=st.lists(st.integers(1, 3), max_size=4),
        names=st.lists(st.sampled_from(["a(m)", "b:0", "_", "c"]), min_size=4, max_size=4, unique=True),
        packed=st.booleans(),
        points=st.integers(1, 5),
    )
    def test_fields_of_any_name_and_several_values(
        self, tmp_path_factory: pytest.TempPathFactory, counts: list[int], names: list[str], packed: bool, points: int
    ) -> None:
        """The twin follows PCL: packed, one field after the other, in it all values of one point after the other's."""
        needed("pypcd4")
        fields = {name: (points, count) for name, count in zip(names, counts, strict=False)}
        shapes = {**fields, "x": (points, 1), "y": (points, 1), "z": (points, 1)}
        rng = np.random.default_rng(points)
        values = {name: rng.integers(-99, 99, shape).astype("<f4") for name, shape in shapes.items()}
        head = {
            "FIELDS": values,
            "SIZE": [4 for _ in values],
            "TYPE": ["F" for _ in values],
            "COUNT": [table.shape[1] for table in values.values()],
            "WIDTH": [points],
            "HEIGHT": [1],
            "DATA": ["binary_compressed" if packed else "binary"],
        }
        text = "".join(f"{word} {' '.join(map(str, row))}\n" for word, row in head.items())
        body = np.concatenate(list(values.values()), axis=1).tobytes()
        if packed:
            body = lzf_literals(b"".join(table.tobytes() for table in values.values()))
        path = tmp_path_factory.mktemp("pcd") / "c.pcd"
        path.write_bytes(text.encode() + body)
        found = read_points(path)
        np.testing.assert_array_equal(found.positions, np.concatenate([values.pop(axis) for axis in "xyz"], axis=1))
        assert set(found.attributes) == set(values) - {"_"}
        for name, column in found.attributes.items():
            np.testing.assert_array_equal(column.reshape(points, -1), values[name])


def lzf_literals(plain: bytes) -> bytes:
    """Return LZF behind its two sizes that copies nothing: at most 32 bytes at a time, behind their number less one."""
    parts = [plain[at : at + 32] for at in range(0, len(plain), 32)]
    stream = b"".join(bytes([len(part) - 1]) + part for part in parts)
    return struct.pack("<II", len(stream), len(plain)) + stream


class TestLas:
    @pytest.mark.parametrize("suffix", [".las", ".laz"])
    @pytest.mark.parametrize(("version", "kind"), [("1.2", 2), ("1.4", 7), ("1.4", 8)])
    def test_what_laspy_wrote(self, tmp_path: Path, suffix: str, version: str, kind: int) -> None:
        laspy = needed("laspy")
        needed("lazrs")
        header = laspy.LasHeader(point_format=kind, version=version)
        header.scales, header.offsets = [1e-3] * 3, [1e6, 0, -5]
        header.add_extra_dim(laspy.ExtraBytesParams("height", "f4"))
        header.add_extra_dim(laspy.ExtraBytesParams("slope", "2i2"))
        study = laspy.LasData(header)
        study.x, study.y, study.z = CLOUD.T
        study.red, study.green, study.blue = RGB.T.astype(np.uint16) * 257
        study.intensity, study.classification = LABELS * 7000, LABELS
        study.height, study.slope = INTENSITY, np.stack([LABELS, -LABELS], axis=1)
        study.write(tmp_path / f"c{suffix}")
        points = read_points(tmp_path / f"c{suffix}")
        np.testing.assert_allclose(points.positions, CLOUD, atol=5.1e-4, rtol=0)
        check_colors(points.attributes)
        np.testing.assert_array_equal(points.attributes["intensity"], LABELS * 7000)
        np.testing.assert_array_equal(points.attributes["classification"], LABELS)
        np.testing.assert_array_equal(points.attributes["height"], INTENSITY)
        np.testing.assert_array_equal(points.attributes["slope"], np.stack([LABELS, -LABELS], axis=1))

    def test_colors_of_8_bits_in_16_are_not_scaled(self, tmp_path: Path) -> None:
        laspy = needed("laspy")
        study = laspy.LasData(laspy.LasHeader(point_format=2, version="1.2"))
        study.x, study.y, study.z = CLOUD.T
        study.red, study.green, study.blue = RGB.T
        study.write(tmp_path / "c.las")
        check_colors(read_points(tmp_path / "c.las").attributes)


def quarter_turn(cloud: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a scan stands that is turned about z and moved."""
    return np.stack([10 - cloud[:, 1], 20 + cloud[:, 0], 30 + cloud[:, 2]], axis=1)


def e57_scan(cloud: NDArray[np.float64], **fields: NDArray[Any]) -> dict[str, NDArray[Any]]:
    return dict(zip(("cartesianX", "cartesianY", "cartesianZ"), cloud.T, strict=True)) | fields


class TestE57:
    def test_all_scans_at_their_poses_without_invalid_points(self, tmp_path: Path) -> None:
        pye57 = needed("pye57")
        colors = dict(zip(("colorRed", "colorGreen", "colorBlue"), RGB.T, strict=True))
        single = CLOUD.astype(np.float32).astype(np.float64)
        with pye57.E57(str(tmp_path / "c.e57"), "w") as file:
            file.write_scan_raw(
                e57_scan(single, **colors, intensity=INTENSITY, cartesianInvalidState=(LABELS == 3).astype(int)),
                rotation=np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]),
                translation=np.array([10.0, 20.0, 30.0]),
            )
            file.write_scan_raw(e57_scan(single, **colors))
        points = read_points(tmp_path / "c.e57")
        valid = LABELS != 3
        expected = np.concatenate([quarter_turn(single)[valid], single])
        np.testing.assert_allclose(points.positions, expected, atol=1e-12 * 200)
        assert list(points.attributes) == ["red", "green", "blue"]
        check_colors(points.attributes, np.concatenate([RGB[valid], RGB]))

    def test_intensity(self, tmp_path: Path) -> None:
        pye57 = needed("pye57")
        with pye57.E57(str(tmp_path / "c.e57"), "w") as file:
            file.write_scan_raw(e57_scan(CLOUD, intensity=INTENSITY))
        attributes = read_points(tmp_path / "c.e57").attributes
        np.testing.assert_array_equal(attributes["intensity"], INTENSITY)
        assert attributes["intensity"].dtype == np.float32

    def test_spherical_coordinates(self, tmp_path: Path) -> None:
        pye57 = needed("pye57")
        write_spherical(pye57, str(tmp_path / "c.e57"), [2.0, 3.0, 4.0], [0.0, np.pi / 2, 0.0], [0.0, 0.0, np.pi / 2])
        positions = read_points(tmp_path / "c.e57").positions
        np.testing.assert_allclose(positions, [[2, 0, 0], [0, 3, 0], [0, 0, 4]], atol=1e-12)


def write_spherical(pye57: Any, path: str, *columns: list[float]) -> None:
    lib, arrays = pye57.libe57, [np.array(column) for column in columns]
    with pye57.E57(path, "w") as file:
        image = file.image_file
        scan, kinds, buffers = lib.StructureNode(image), lib.StructureNode(image), lib.VectorSourceDestBuffer()
        scan.set("guid", lib.StringNode(image, "{1}"))
        for name, array in zip(("sphericalRange", "sphericalAzimuth", "sphericalElevation"), arrays, strict=True):
            kinds.set(name, lib.FloatNode(image, 0.0, lib.E57_DOUBLE, -9.0, 9.0))
            buffers.append(lib.SourceDestBuffer(image, name, array, len(array), True, True))
        points = lib.CompressedVectorNode(image, kinds, lib.VectorNode(image, True))
        scan.set("points", points)
        file.data3d.append(scan)
        writer = points.writer(buffers)
        writer.write(len(columns[0]))
        writer.close()


class TestMeshes:
    @pytest.mark.parametrize("suffix", [".obj", ".off", ".stl", ".ply"])
    def test_vertices_that_trimesh_wrote(self, tmp_path: Path, suffix: str) -> None:
        ball = trimesh.creation.icosphere(subdivisions=2, radius=9)
        ball.export(tmp_path / f"m{suffix}")
        positions = read_points(tmp_path / f"m{suffix}").positions
        assert positions.shape == ball.vertices.shape  # STL names each vertex six times

        def rows(cloud: NDArray[np.float64]) -> NDArray[np.float64]:
            return cloud[np.lexsort(np.rint(cloud * 1e4).T)]

        np.testing.assert_allclose(rows(positions), rows(np.array(ball.vertices)), atol=2e-6)

    @pytest.mark.parametrize("suffix", [".obj", ".ply"])
    def test_vertex_colors_that_trimesh_wrote(self, tmp_path: Path, suffix: str) -> None:
        colors = np.column_stack([RGB[:42], np.full(42, 255)])
        ball = trimesh.creation.icosphere(subdivisions=1)
        trimesh.Trimesh(ball.vertices, ball.faces, vertex_colors=colors, process=False).export(tmp_path / f"m{suffix}")
        check_colors(read_points(tmp_path / f"m{suffix}").attributes, RGB[:42])

    def test_obj_without_faces_with_a_weight(self, tmp_path: Path) -> None:
        (tmp_path / "c.obj").write_text("# c\nvn 0 0 1\nv 0 1 2 1.0\nvt 0 0\n  v\t3 4 5 1.0\nv 6 7 8 1.0 # last\n")
        points = read_points(tmp_path / "c.obj")
        np.testing.assert_array_equal(points.positions, np.arange(9.0).reshape(3, 3))
        assert points.attributes == {}


class TestMissingPackages:
    @pytest.mark.parametrize(
        ("suffix", "missing"),
        [(".las", "laspy"), (".laz", "laspy"), (".laz", "lazrs"), (".e57", "pye57"), (".pcd", "pypcd4")],
    )
    def test_they_are_named_with_the_extra(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, missing: str
    ) -> None:
        if missing == "lazrs":
            needed("laspy")
        monkeypatch.setitem(sys.modules, missing, None)
        pcd = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA binary_compressed\n"
        head = pcd + struct.pack("<II", 12, 12) if suffix == ".pcd" else b"LASF"
        (tmp_path / f"c{suffix}").write_bytes(head + bytes(400))
        with pytest.raises(FormatError, match=rf"package {missing}.*tomomesh\[clouds\]"):
            read_points(tmp_path / f"c{suffix}")
