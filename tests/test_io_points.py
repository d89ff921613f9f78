"""Clouds: every format gives the same points, and rows that lie are named."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studies import shared
from tomomesh.errors import EmptyError, FormatError, OutputError, TomomeshError, UnreadableError, UsageError
from tomomesh.io import read_points, write_points
from tomomesh.model.points import BRIDGE, CAP, NEURON, PointSet

if TYPE_CHECKING:
    from pathlib import Path

CLOUD = np.array([[0.1, 0, -0.0], [1e9 + 1e-3, 2.5, -3], [1 / 3, 1e-300, 7], [-5, 6, 1e300]])
POINTS = PointSet(
    CLOUD,
    np.array([3, 3, 4, -1], np.int32),
    np.array([0, 57, 1, -1], np.int32),
    np.array([NEURON, BRIDGE, CAP, NEURON], np.uint8),
)
TEXTS = {
    "blanks.xyz": "0 1 2\n 3\t4  5 \n\n6 7 8",
    "commas.csv": "0,1,2\n3,4,5\n6,7,8\n",
    "semicolons.csv": "0;1;2\r\n3;4;5\r\n6;7;8\r\n",
    "names.csv": "x,y,z,label\n0,1,2,bone\n3,4,5,skin\n6,7,8,\n",
    "bom.txt": "\ufeffx y z\n0 1 2\n3 4 5\n6 7 8\n",
    "comments.txt": "# a cloud\n0 1 2 9 # first\n3 4 5 9\n6 7 8 9\n",
    "exponents.XYZ": "0e0 1E0 +2\n3. 4.0 5\n6 7 .8e1\n",
}


def ply_text(rows: str, count: int = 3, kind: str = "ascii") -> str:
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    return f"ply\nformat {kind} 1.0\nelement vertex {count}\n{axes}end_header\n{rows}"


class TestRead:
    @pytest.mark.parametrize("name", TEXTS)
    def test_text_in_every_dress(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_text(TEXTS[name], encoding="utf-8")
        points = read_points(tmp_path / name)
        np.testing.assert_array_equal(points.positions, np.arange(9.0).reshape(3, 3))
        assert (points.slices == -1).all()

    @pytest.mark.parametrize("encoding", ["ascii", "binary"])
    def test_ply_that_trimesh_wrote(self, tmp_path: Path, encoding: str) -> None:
        cloud = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32).astype(float)
        trimesh.PointCloud(cloud).export(tmp_path / "c.ply", encoding=encoding)
        np.testing.assert_allclose(read_points(tmp_path / "c.ply").positions, cloud, atol=1e-7)

    @pytest.mark.parametrize("order", ["<", ">"])
    def test_both_byte_orders(self, tmp_path: Path, order: str) -> None:
        kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
        raw = ply_text("", 4, kind).encode() + struct.pack(f"{order}12d", *CLOUD.ravel())
        (tmp_path / "c.ply").write_bytes(raw)
        np.testing.assert_array_equal(read_points(tmp_path / "c.ply").positions, CLOUD)

    def test_text_ply_with_other_elements_and_properties(self, tmp_path: Path) -> None:
        text = (
            "ply\nformat ascii 1.0\ncomment c\nelement camera 1\nproperty float f\nelement vertex 2\n"
            "property uchar red\nproperty float z\nproperty float y\nproperty float x\n"
            "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
            "9\n255 3 2 1\n255 6 5 4\n3 0 1 1\n"
        )
        (tmp_path / "c.ply").write_text(text)
        np.testing.assert_array_equal(read_points(tmp_path / "c.ply").positions, [[1, 2, 3], [4, 5, 6]])

    @pytest.mark.parametrize("kind", ["f4", "f8", "i4", "u1", ">f8"])
    def test_arrays(self, tmp_path: Path, kind: str) -> None:
        np.save(tmp_path / "c.npy", np.arange(12).reshape(4, 3).astype(kind))
        positions = read_points(tmp_path / "c.npy").positions
        np.testing.assert_array_equal(positions, np.arange(12).reshape(4, 3))
        assert positions.dtype == np.float64


BROKEN = {
    "nan.xyz": ("0 0 0\n1 nan 1\n", "row 2 = nan"),
    "inf.csv": ("x,y,z\n0,0,0\n1,-inf,1\n", "row 3 = -inf"),
    "text.xyz": ("0 0 0\n1 foo 1\n", "row 2 = text"),
    "first.xyz": ("0 x 0\n1 1 1\n", "row 1 = text"),
    "ragged.xyz": ("0 0 0\n\n1 1\n", "row 3 = 2 columns"),
    "wide.csv": ("0,0,0\n1,1,1,1\n", "row 2 = 4 columns"),
    "narrow.txt": ("1 2\n3 4\n", "at least 3 columns"),
    "nan.ply": (ply_text("0 0 0\n1 1 1\n2 2 nan\n"), "row 10 = nan"),
    "text.ply": (ply_text("0 0 0\n1 1 foo\n2 2 2\n"), "row 9 = text"),
    "ragged.ply": (ply_text("0 0 0\n1 1\n2 2 22\n"), "row 9 = 2 columns"),
    "short.ply": (ply_text("0 0 0\n1.000 1.000 1\n"), "vertices = 2"),
    "lying.ply": (ply_text("0 0 0\n", 2_000_000_000), "cut off"),
    "lying-binary.ply": (ply_text("0" * 71, 3, "binary_little_endian"), "72 bytes"),
    "negative.ply": (ply_text("0 0 0\n", -1), "header"),
    "format.ply": (ply_text("0 0 0\n", 1, "base64"), "header"),
    "no-header.ply": ("ply\nformat ascii 1.0\n", "no PLY header"),
    "no-ply.ply": ("0 0 0\n", "no PLY header"),
    "no-axes.ply": (
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1 2\n",
        "x, y and z",
    ),
    "kind.ply": ("ply\nformat ascii 1.0\nelement vertex 1\nproperty word x\nend_header\n1\n", "understood"),
    "unknown.foo": ("0 0 0\n", "suffix = .foo"),
}


class TestFaults:
    @pytest.mark.parametrize("name", BROKEN)
    def test_what_is_broken_is_named(self, tmp_path: Path, name: str) -> None:
        text, word = BROKEN[name]
        (tmp_path / name).write_text(text)
        with pytest.raises(FormatError) as caught:
            read_points(tmp_path / name)
        assert word in str(caught.value)

    def test_nan_in_binary_files_names_its_row(self, tmp_path: Path) -> None:
        cloud = np.array([[0, 0, 0], [1, 1, np.inf]])
        np.save(tmp_path / "c.npy", cloud)
        raw = ply_text("", 2, "binary_little_endian").encode() + cloud.astype("<f8").tobytes()
        (tmp_path / "c.ply").write_bytes(raw)
        for name in ("c.npy", "c.ply"):
            with pytest.raises(FormatError, match="row 2"):
                read_points(tmp_path / name)

    def test_arrays_that_are_no_cloud_are_refused(self, tmp_path: Path) -> None:
        for array in (np.zeros((3, 2)), np.zeros(3), np.zeros((2, 3), complex), np.array([[None] * 3])):
            np.save(tmp_path / "c.npy", array)
            with pytest.raises(FormatError):
                read_points(tmp_path / "c.npy")

    def test_an_array_whose_count_lies_is_refused(self, tmp_path: Path) -> None:
        np.save(tmp_path / "c.npy", np.zeros((9, 3)))
        raw = (tmp_path / "c.npy").read_bytes()
        (tmp_path / "c.npy").write_bytes(raw.replace(b"(9, 3)", b"(10**9, 3)"[:6]))
        (tmp_path / "d.npy").write_bytes(raw[:-8])
        for name in ("c.npy", "d.npy"):
            with pytest.raises(FormatError):
                read_points(tmp_path / name)

    @pytest.mark.parametrize("name", ["a.xyz", "b.csv", "c.ply", "d.npy"])
    def test_no_points_is_empty(self, tmp_path: Path, name: str) -> None:
        path = tmp_path / name
        if name == "d.npy":
            np.save(path, np.zeros((0, 3)))
        else:
            path.write_text({"a.xyz": "# nothing\n", "b.csv": "x,y,z\n", "c.ply": ply_text("", 0)}[name])
        with pytest.raises(EmptyError):
            read_points(path)

    def test_paths_that_are_no_files(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableError):
            read_points(tmp_path / "missing.xyz")
        with pytest.raises(FormatError, match="folder"):
            read_points(tmp_path)
        (tmp_path / "bytes.xyz").write_bytes(b"\xff\xfe\x00 1 2")
        with pytest.raises(FormatError, match="no text"):
            read_points(tmp_path / "bytes.xyz")


class TestWrite:
    @pytest.mark.parametrize("suffix", [".ply", ".xyz", ".csv", ".npy"])
    def test_what_is_written_is_read_back_exactly(self, tmp_path: Path, suffix: str) -> None:
        for name in ("a", "b"):
            write_points(POINTS, tmp_path / f"{name}{suffix}")
        np.testing.assert_array_equal(read_points(tmp_path / f"a{suffix}").positions, CLOUD)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()

    def test_ply_keeps_slice_neuron_and_kind(self, tmp_path: Path) -> None:
        write_points(POINTS, tmp_path / "c.ply", unit="cm", frame="RAS")
        head, _, body = (tmp_path / "c.ply").read_bytes().partition(b"end_header\n")
        assert b"comment tomomesh 0.1.0 unit=cm frame=RAS\n" in head
        rows = list(struct.iter_unpack("<dddiiB", body))
        assert [row[3:] for row in rows] == [(3, 0, 0), (3, 57, 1), (4, 1, 2), (-1, -1, 0)]
        np.testing.assert_array_equal(np.array([row[:3] for row in rows]), CLOUD)
        loaded = trimesh.load(tmp_path / "c.ply")
        np.testing.assert_array_equal(loaded.vertices, CLOUD)

    def test_text_names_unit_and_frame(self, tmp_path: Path) -> None:
        write_points(POINTS, tmp_path / "c.xyz")
        assert (tmp_path / "c.xyz").read_text().startswith("# tomomesh 0.1.0 unit=mm frame=LPS\n0.1 0.0 -0.0\n")
        write_points(POINTS, tmp_path / "c.csv")
        assert (tmp_path / "c.csv").read_text().startswith("x_mm,y_mm,z_mm,slice,neuron,kind\n0.1,0.0,-0.0,3,0,0\n")

    @given(
        cloud=hnp.arrays(
            np.float64,
            st.tuples(st.integers(1, 9), st.just(3)),
            elements=st.floats(allow_nan=False, allow_infinity=False),
        )
    )
    def test_every_finite_number_survives_text(
        self, tmp_path_factory: pytest.TempPathFactory, cloud: np.ndarray
    ) -> None:
        path = tmp_path_factory.mktemp("law") / "c.xyz"
        write_points(PointSet.from_positions(cloud), path)
        np.testing.assert_array_equal(read_points(path).positions, cloud)

    def test_outputs_are_checked(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="suffix"):
            write_points(POINTS, tmp_path / "c.foo")
        with pytest.raises(OutputError, match="missing"):
            write_points(POINTS, tmp_path / "none" / "c.ply")


class TestSharedData:
    @pytest.mark.parametrize(
        ("name", "count"),
        [
            ("wnnc/bunny_noised.xyz", 20_000),
            ("contours/torus_sphere_5to1.xyz", 5187),
            ("pcu/duplicated_pcloud.ply", 5395),
            ("pcu/bunny_duplicates.ply", 2895),
        ],
    )
    def test_clouds_are_read(self, name: str, count: int) -> None:
        assert len(read_points(shared("clouds") / name)) == count

    @pytest.mark.parametrize(
        ("name", "error", "word"),
        [
            ("header_only.ply", FormatError, "6 bytes"),
            ("lying_count_binary.ply", FormatError, "24000000000 bytes"),
            ("nan_points.xyz", FormatError, "row 3 = nan"),
            ("ragged.xyz", FormatError, "row 2 = 2 columns"),
        ],
    )
    def test_malformed_files_are_refused(self, name: str, error: type[TomomeshError], word: str) -> None:
        with pytest.raises(error, match=word):
            read_points(shared("malformed") / name)

    def test_coordinates_near_a_billion_keep_their_detail(self) -> None:
        path = shared("malformed/huge_offset_sphere.xyz")
        np.testing.assert_array_equal(read_points(path).positions, np.loadtxt(path)[:, :3])
