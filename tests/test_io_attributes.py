"""What a file says of its points: read, kept apart from normals and ids, written, and read again."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from test_io_points import POINTS
from tomomesh.errors import UsageError
from tomomesh.io import read_points, write_points
from tomomesh.io.colors import named_colors
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from pathlib import Path

ATTRIBUTES: dict[str, Any] = {
    "red": np.array([0, 1, 128, 255], np.uint8),
    "green": np.array([4, 3, 2, 1], np.uint8),
    "blue": np.array([255, 255, 0, 0], np.uint8),
    "intensity": np.array([0.1, np.nan, 3e38, -1.0], np.float32),
    "time": np.array([1e9 + 1e-6, 1 / 3, 0.0, 2.0]),
    "return": np.array([-7, 0, 1, 2**31 - 1], np.int64),
    "gray level": np.array([1, 2, 3, 65535], np.uint16),
    "valid": np.array([True, False, True, True]),
    "slope": np.array([[1, 2], [3, 4], [5, 6], [7, 8]], np.int16),
}

TEXTS = {
    "id_first.csv": "id,X,Y,Z,Intensity\n7,1,2,3,0.5\n8,4,5,6,1\n",
    "units.csv": "intensity;x [mm];y [mm];z [mm]\n0.5;1;2;3\n1.0;4;5;6\n",
    "quoted.csv": '"z","y","x","Intensity"\n3,2,1,0.5\n6,5,4,1\n',
    "cloudcompare.txt": "//X Y Z Intensity\n1 2 3 0.5\n4 5 6 1\n",
    "savetxt.xyz": "# x y z intensity nx ny nz\n1 2 3 0.5 0 0 1\n4 5 6 1 0 1 0\n",
    "words.csv": "x_mm,y_mm,z_mm,intensity,tissue\n1,2,3,0.5,bone\n4,5,6,1,\n",
}


class TestText:
    @pytest.mark.parametrize("name", TEXTS)
    def test_columns_are_found_by_their_names(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_text(TEXTS[name])
        points = read_points(tmp_path / name)
        np.testing.assert_array_equal(points.positions, [[1, 2, 3], [4, 5, 6]])
        found = {name.lower(): values for name, values in points.attributes.items()}
        assert set(found) - {"id"} == {"intensity"}
        np.testing.assert_array_equal(found["intensity"], [0.5, 1.0])

    def test_types(self, tmp_path: Path) -> None:
        (tmp_path / "c.csv").write_text("x,y,z,r,g,b,class,age,gap\n1,2,3,255,0,7,4,1.0,\n4,5,6,0,9,8,2,2.0,3\n")
        attributes = read_points(tmp_path / "c.csv").attributes
        kinds = {"red": "u1", "green": "u1", "blue": "u1", "class": "i8", "age": "f8", "gap": "f8"}
        assert {name: values.dtype.str[1:] for name, values in attributes.items()} == kinds
        np.testing.assert_array_equal(attributes["gap"], [np.nan, 3])

    def test_columns_without_names_are_passed_over(self, tmp_path: Path) -> None:
        (tmp_path / "c.xyz").write_text("1 2 3 255 0 0\n4 5 6 0 0 0\n")
        assert read_points(tmp_path / "c.xyz").attributes == {}


class TestPly:
    @pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
    def test_every_type_in_every_encoding(self, tmp_path: Path, encoding: str) -> None:
        names = ["char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint16", "float64"]
        kinds = "bBhHiIfdbHd"
        values = [-128, 255, -32768, 65535, -(2**31), 2**32 - 1, 0.5, 1 / 3, 127, 9, -1e300]
        head = f"ply\nformat {encoding} 1.0\nelement vertex 1\n" + "".join(
            f"property double {axis}\n" for axis in "xyz"
        )
        head += "".join(f"property {name} p{number}\n" for number, name in enumerate(names)) + "end_header\n"
        order = "<" if "little" in encoding else ">"
        row = " ".join(map(repr, [1.0, 2.0, 3.0, *values])).encode()
        packed = struct.pack(f"{order}3d{kinds}", 1, 2, 3, *values)
        (tmp_path / "c.ply").write_bytes(head.encode() + (row if encoding == "ascii" else packed))
        points = read_points(tmp_path / "c.ply")
        np.testing.assert_array_equal(points.positions, [[1, 2, 3]])
        assert [column.item() for column in points.attributes.values()] == values
        assert [column.dtype.char for column in points.attributes.values()] == list(kinds)

    def test_text_that_its_type_cannot_hold_stays_as_it_is(self, tmp_path: Path) -> None:
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        head = f"ply\nformat ascii 1.0\nelement vertex 2\n{axes}property uchar a\nproperty int b\nend_header\n"
        (tmp_path / "c.ply").write_text(head + "0 0 1000000001 300 nan\n0 0 1 0 1\n")
        points = read_points(tmp_path / "c.ply")
        assert points.positions[0, 2] == 1000000001
        np.testing.assert_array_equal(points.attributes["a"], [300, 0])
        np.testing.assert_array_equal(points.attributes["b"], [np.nan, 1])

    def test_colors_of_a_cloud_that_trimesh_wrote(self, tmp_path: Path) -> None:
        colors = np.random.default_rng(1).integers(0, 256, (9, 4)).astype(np.uint8)
        trimesh.PointCloud(np.zeros((9, 3)), colors=colors).export(tmp_path / "c.ply")
        attributes = read_points(tmp_path / "c.ply").attributes
        assert list(attributes) == ["red", "green", "blue", "alpha"]
        np.testing.assert_array_equal(np.stack(list(attributes.values()), axis=1), colors)


class TestColors:
    @pytest.mark.parametrize(
        "scaled",
        [
            lambda c: c,
            lambda c: c.astype(np.uint16) * 257,
            lambda c: c.astype(np.int64),
            lambda c: c / 255,
            lambda c: (c / 255).astype(np.float32),
            lambda c: c.astype(float),
        ],
    )
    @pytest.mark.parametrize("names", ["Red Green Blue", "r g b", "diffuse_red diffuse_green diffuse_blue"])
    def test_every_scale_and_spelling(self, scaled: Any, names: str) -> None:
        bytes_ = np.array([[0, 255, 128], [7, 200, 55]], np.uint8)
        found = named_colors(dict(zip(names.split(), scaled(bytes_).T, strict=True)))
        assert found is not None
        assert found[0] == names.split()
        assert found[1].dtype == np.uint8
        np.testing.assert_array_equal(found[1], bytes_)

    @pytest.mark.parametrize("red", [[-1.0], [np.nan], [1e9], [[1.0, 2.0]]])
    def test_what_no_color_has_is_left(self, red: Any) -> None:
        assert named_colors({"red": np.array(red), "green": np.ones(1), "blue": np.ones(1)}) is None

    def test_two_of_three_are_no_color(self) -> None:
        assert named_colors({"r": np.ones(1), "g": np.ones(1)}) is None


class TestWrite:
    @pytest.mark.parametrize("suffix", [".ply", ".csv"])
    def test_what_is_written_comes_back(self, tmp_path: Path, suffix: str) -> None:
        for name in ("a", "b"):
            write_points(replace(POINTS, attributes=ATTRIBUTES), tmp_path / f"{name}{suffix}")
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()
        back = read_points(tmp_path / f"a{suffix}")
        np.testing.assert_array_equal(back.positions, POINTS.positions)
        for name in ("slices", "neurons", "kinds"):
            assert getattr(back, name).dtype == getattr(POINTS, name).dtype
            np.testing.assert_array_equal(getattr(back, name), getattr(POINTS, name))
        slope = {f"slope_{column}": ATTRIBUTES["slope"][:, column] for column in (0, 1)}
        single = {name.replace(" ", "_"): values for name, values in ATTRIBUTES.items() if name != "slope"}
        expected = {**single, **slope}
        assert list(back.attributes) == list(expected)
        for name, values in expected.items():
            np.testing.assert_array_equal(back.attributes[name], values)
            if suffix == ".ply":
                stored = {"b1": np.uint8, "u1": np.uint8, "f4": np.float32, "f8": np.float64}
                assert back.attributes[name].dtype == stored.get(values.dtype.str[1:], np.int32)

    def test_trimesh_sees_the_colors(self, tmp_path: Path) -> None:
        write_points(replace(POINTS, attributes=ATTRIBUTES), tmp_path / "c.ply")
        judge = trimesh.load(tmp_path / "c.ply")
        expected = np.stack([ATTRIBUTES[name] for name in ("red", "green", "blue")], axis=1)
        np.testing.assert_array_equal(judge.colors[:, :3], expected)

    def test_names_that_are_taken_get_underscores(self, tmp_path: Path) -> None:
        column = np.arange(4.0) + 0.5
        names = ("x", "kind", "a b", "a,b", "é", "")
        write_points(replace(POINTS, attributes=dict.fromkeys(names, column)), tmp_path / "c.ply")
        attributes = read_points(tmp_path / "c.ply").attributes
        assert list(attributes) == ["x_", "kind_", "a_b", "a_b_", "_", "__"]

    def test_text_is_no_attribute(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="label"):
            write_points(replace(POINTS, attributes={"label": np.array(list("abcd"))}), tmp_path / "c.ply")

    def test_ids_of_another_file_are_attributes(self, tmp_path: Path) -> None:
        (tmp_path / "c.csv").write_text("x,y,z,slice,neuron,kind\n0,0,0,1,2,9\n")
        points = read_points(tmp_path / "c.csv")
        assert set(points.attributes) == {"slice", "neuron", "kind"}
        assert points.slices.tolist() == [-1]


class TestPointSet:
    def test_attributes_fit_their_points(self) -> None:
        for shape in [(3,), (4, 1, 1), ()]:
            with pytest.raises(UsageError, match="intensity"):
                replace(POINTS, attributes={"intensity": np.zeros(shape)})

    @given(st.sets(st.sampled_from("abc")), st.sets(st.sampled_from("abc")))
    def test_joined_keeps_what_both_have(self, one: set[str], other: set[str]) -> None:
        first = replace(POINTS, attributes={name: np.arange(4) for name in one})
        second = PointSet.from_positions(np.zeros((2, 3)))
        second = replace(second, attributes={name: np.arange(2.0) for name in other} | {"d": np.zeros((2, 2))})
        joined = first.joined(second)
        assert len(joined) == 6
        assert set(joined.attributes) == one & other
        assert all(values.tolist() == [0, 1, 2, 3, 0, 1] for values in joined.attributes.values())
