"""Clouds that lie: counts, cut ends, NaN, and files of another kind; told before much memory is taken."""

from __future__ import annotations

import random
import struct
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from test_io_clouds import CLOUD, COUNT, RGB, e57_scan
from test_io_damage import damaged
from tomomesh.errors import EmptyError, FormatError, ResourceError, TomomeshError
from tomomesh.io import read_points
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {0}\nHEIGHT {1}\nPOINTS {2}\nDATA {3}\n"
HALF = PCD.replace("SIZE 4", "SIZE 2")

BROKEN = {
    "nan.pcd": (PCD.format(2, 1, 2, "ascii") + "0 0 0\n1 nan 1\n", "row 9 = nan"),
    "text.pcd": (PCD.format(2, 1, 2, "ascii") + "0 0 0\n1 foo 1\n", "row 9 = text"),
    "ragged.pcd": (PCD.format(2, 1, 2, "ascii") + "0 0 0\n1 11\n", "row 9 = 2 columns"),
    "wide.pcd": (PCD.format(1, 1, 1, "ascii") + "0 0 0 0\n", "row 8 = 4 columns"),
    "short.pcd": (PCD.format(3, 1, 3, "ascii") + "0.000000 0.000000 0\n", "points = 1"),
    "lying.pcd": (PCD.format(10**9, 1, 10**9, "ascii") + "0 0 0\n", "5999999999 bytes"),
    "lying-binary.pcd": (PCD.format(10**9, 1, 10**9, "binary") + "0" * 12, "12000000000 bytes"),
    "lying-packed.pcd": (PCD.format(10**9, 1, 10**9, "binary_compressed") + "\1\0\0\0\x0c\0\0\0a", "12000000000 bytes"),
    "cut-packed.pcd": (PCD.format(1, 1, 1, "binary_compressed") + "\x09\0\0\0\x0c\0\0\0a", "9 bytes"),
    "lzf.pcd": (PCD.format(1, 1, 1, "binary_compressed") + "\x02\0\0\0\x0c\0\0\0\x20\x01", "pypcd4"),
    "bomb.pcd": (PCD.format(1, 1, 1, "binary_compressed") + "\2\0\0\0\xb1\0\0\0\x20\x01", "data = 176 bytes"),
    "half.pcd": (HALF.format(1, 1, 1, "binary_compressed") + "\6\0\0\0\x0c\0\0\0" + "0" * 6, "pypcd4"),
    "size.pcd": (PCD.format(2, 2, 2, "ascii") + "0 0 0\n1 1 1\n", "header"),
    "negative.pcd": (PCD.format(-1, 1, -1, "ascii"), "header"),
    "kind.pcd": (PCD.format(1, 1, 1, "base64") + "0 0 0\n", "header"),
    "type.pcd": (PCD.replace("TYPE F", "TYPE X").format(1, 1, 1, "ascii") + "0 0 0\n", "header"),
    "axes.pcd": (PCD.replace("x y z", "x y w").format(1, 1, 1, "ascii") + "0 0 0\n", "x, y and z"),
    "partial.pcd": (PCD.format(1, 2, 2, "ascii") + "0 0 0\n1 nan 1\n", "row 2"),
    "none.pcd": ("0 0 0\n", "header"),
    "nan.obj": ("v 0 0 0\n# c\nv 1 nan 1\n", "row 3 = nan"),
    "text.obj": ("v 0 0 0\nv 1 foo 1\n", "row 2 = text"),
    "ragged.obj": ("v 0 0 0\nf 1 1 1\nv 1 1\n", "row 3 = 2 columns"),
    "nan.off": ("OFF\n2 0 0\n0 0 0\n0 inf 0\n", "row 2"),
    "lying.off": ("OFF\n1000000000 0 0\n0 0 0\n", "cut off"),
    "text.npz": ("no archive", "zipfile"),
    "text.las": ("no scan" * 60, "LAS header"),
    "short.las": ("LASF", "104 bytes"),
    "text.laz": ("no scan" * 60, "LAS header"),
}  # fmt: skip


class TestFaults:
    @pytest.mark.parametrize("name", BROKEN)
    def test_what_is_broken_is_named(self, tmp_path: Path, name: str) -> None:
        text, word = BROKEN[name]
        (tmp_path / name).write_bytes(text.encode("latin-1"))
        with pytest.raises(FormatError) as caught:
            read_points(tmp_path / name)
        assert word in str(caught.value)

    @pytest.mark.parametrize("kind", ["ascii", "binary", "binary_compressed"])
    def test_no_points_in_pcd_is_empty(self, tmp_path: Path, kind: str) -> None:
        (tmp_path / "c.pcd").write_text(PCD.format(0, 1, 0, kind) + "\0" * 8)
        with pytest.raises(EmptyError):
            read_points(tmp_path / "c.pcd")

    @pytest.mark.parametrize("name", ["c.obj", "c.off"])
    def test_no_vertices_is_empty(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_text({"c.obj": "# nothing\n", "c.off": "OFF\n0 0 0\n"}[name])
        with pytest.raises((EmptyError, FormatError)):
            read_points(tmp_path / name)

    def test_lists_before_and_among_the_vertices(self, tmp_path: Path) -> None:
        head = "ply\nformat binary_little_endian 1.0\n{}element vertex 1\n{}end_header\n"
        faces = "element face 2\nproperty list uchar int i\nproperty uchar f\n"
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        rows = struct.pack("<B3iB", 3, 0, 0, 0, 7) + struct.pack("<B2iB", 2, 0, 0, 7)
        place = struct.pack("<3f", 1, 2, 3)
        (tmp_path / "c.ply").write_bytes(head.format(faces, axes).encode() + rows + place)
        np.testing.assert_array_equal(read_points(tmp_path / "c.ply").positions, [[1, 2, 3]])
        (tmp_path / "c.ply").write_bytes(head.format(faces, axes).encode() + b"\xff" + rows + place)
        with pytest.raises(FormatError, match=r"lists|cut off"):
            read_points(tmp_path / "c.ply")
        listed = axes + "property list uchar int i\n"
        (tmp_path / "c.ply").write_bytes(head.format("", listed).encode() + place + b"\0")
        np.testing.assert_array_equal(read_points(tmp_path / "c.ply").positions, [[1, 2, 3]])
        (tmp_path / "c.ply").write_bytes(head.format("", axes.replace("float x", "list uchar int x")).encode() + place)
        with pytest.raises(FormatError, match="single properties"):
            read_points(tmp_path / "c.ply")


class TestArrays:
    def test_an_archive_without_positions_lists_what_it_has(self, tmp_path: Path) -> None:
        np.savez(tmp_path / "c.npz", a=CLOUD, b=RGB)
        with pytest.raises(FormatError, match="arrays = a, b"):
            read_points(tmp_path / "c.npz")

    @pytest.mark.parametrize("y", [np.zeros(3), np.zeros((COUNT, 2)), np.float64(1), np.array(["1"] * COUNT)])
    def test_axes_that_do_not_belong_together(self, tmp_path: Path, y: Any) -> None:
        np.savez(tmp_path / "c.npz", x=CLOUD[:, 0], y=y, z=CLOUD[:, 2])
        with pytest.raises(FormatError, match="positions"):
            read_points(tmp_path / "c.npz")
        np.save(tmp_path / "c.npy", np.zeros(3, [("x", "f8"), ("y", "f8", 2), ("z", "U3")]))
        with pytest.raises(FormatError, match="positions"):
            read_points(tmp_path / "c.npy")

    def test_objects_are_never_unpickled(self, tmp_path: Path) -> None:
        np.savez(tmp_path / "c.npz", points=np.array([[None] * 3]))
        with pytest.raises(FormatError, match="numpy"):
            read_points(tmp_path / "c.npz")

    @pytest.mark.parametrize("claimed", ["999999999", "-1"])
    def test_a_count_that_lies(self, tmp_path: Path, claimed: str) -> None:
        np.save(tmp_path / "c.npy", CLOUD)
        raw = (tmp_path / "c.npy").read_bytes()
        lie = raw.replace(b"(60, 3), }        ", f"({claimed}, 3), }}        ".encode()[:18].ljust(18))
        assert lie != raw
        assert len(lie) == len(raw)
        (tmp_path / "c.npy").write_bytes(lie)
        with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
            archive.writestr("points.npy", lie)
        for name in ("c.npy", "c.npz"):
            with pytest.raises(FormatError):
                read_points(tmp_path / name)

    def test_an_archive_larger_than_the_memory_is_never_unpacked(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        np.savez(tmp_path / "c.npz", points=CLOUD)
        raw = bytearray((tmp_path / "c.npz").read_bytes())
        at = raw.index(b"PK\x01\x02")
        raw[at + 24 : at + 28] = b"\xfe\xff\xff\xff"  # the directory's word for the size, just below ZIP64's mark
        (tmp_path / "c.npz").write_bytes(raw)
        monkeypatch.setattr("tomomesh.io.files.limits.physical_memory", lambda: 2**31)
        with pytest.raises(ResourceError):
            read_points(tmp_path / "c.npz")


class TestLas:
    @pytest.mark.parametrize("suffix", [".las", ".laz"])
    @pytest.mark.parametrize(("version", "kind"), [("1.2", 0), ("1.4", 6)])
    def test_lies_and_cut_ends(self, tmp_path: Path, suffix: str, version: str, kind: int) -> None:
        laspy = needed("laspy")
        needed("lazrs")
        study = laspy.LasData(laspy.LasHeader(point_format=kind, version=version))
        study.x, study.y, study.z = CLOUD.T
        study.write(tmp_path / f"c{suffix}")
        raw = (tmp_path / f"c{suffix}").read_bytes()
        where, form = (107, "<I") if version == "1.2" else (247, "<Q")
        # a chunk of LAZ that has no layers does not say how many of its points are there
        counts = (10**9,) if (suffix, kind) == (".laz", 0) else (COUNT + 1, 10**9)
        lies = [(where, struct.pack(form, count)) for count in counts]
        lies += [(96, struct.pack("<I", 2**31)), (100, struct.pack("<I", 2**31))]  # the points' offset, the records
        start = struct.unpack_from("<I", raw, 96)[0]
        if suffix == ".laz":  # how many chunks; the length of the first layer
            table = struct.unpack_from("<q", raw, start)[0]
            lies += [(table + 4, b"\xff" * 4)] + ([(start + 8 + 30 + 4, b"\xff" * 4)] if kind == 6 else [])
        broken = [raw[:at] + lie + raw[at + len(lie) :] for at, lie in lies]
        for data in [*broken, raw[: start + 40], raw[: start - 1], raw[:150]]:
            (tmp_path / f"c{suffix}").write_bytes(data)
            with pytest.raises(FormatError):
                read_points(tmp_path / f"c{suffix}")

    def test_no_points_is_empty(self, tmp_path: Path) -> None:
        laspy = needed("laspy")
        laspy.LasData(laspy.LasHeader(point_format=0, version="1.2")).write(tmp_path / "c.las")
        with pytest.raises(EmptyError):
            read_points(tmp_path / "c.las")


class TestE57:
    def test_what_is_no_whole_e57_is_refused(self, tmp_path: Path) -> None:
        pye57 = needed("pye57")
        with pye57.E57(str(tmp_path / "c.e57"), "w") as file:
            file.write_scan_raw(e57_scan(CLOUD))
        raw = (tmp_path / "c.e57").read_bytes()
        for data in (raw[:-1024], raw[:100], b"rubbish" * 400, raw[:2000] + b"\xff\xff" + raw[2002:]):
            (tmp_path / "c.e57").write_bytes(data)
            with pytest.raises(FormatError, match="pye57"):
                read_points(tmp_path / "c.e57")

    def test_no_scans_are_empty(self, tmp_path: Path) -> None:
        with needed("pye57").E57(str(tmp_path / "c.e57"), "w"):
            pass
        with pytest.raises(EmptyError):
            read_points(tmp_path / "c.e57")


def written(folder: Path, name: str) -> bytes:
    """Return the bytes of a good cloud."""
    path, suffix = folder / name, name.partition(".")[2]
    if suffix in ("las", "laz"):
        needed("lazrs")
        laspy: Any = needed("laspy")
        study = laspy.LasData(laspy.LasHeader(point_format=7, version="1.4"))
        study.x, study.y, study.z = CLOUD.T
        study.write(path)
    elif suffix == "e57":
        with needed("pye57").E57(str(path), "w") as file:
            file.write_scan_raw(e57_scan(CLOUD))
    elif suffix == "pcd":
        path.write_bytes(PCD.format(COUNT, 1, COUNT, "binary").encode() + CLOUD.astype("<f4").tobytes())
    elif suffix == "npz":
        np.savez_compressed(path, points=CLOUD, red=RGB[:, 0])
    else:
        trimesh.creation.icosphere(subdivisions=1).export(path)
    return path.read_bytes()


@pytest.mark.parametrize("suffix", ["las", "laz", "e57", "pcd", "npz", "obj", "off", "stl"])
def test_damage_is_told_in_one_line(tmp_path: Path, suffix: str) -> None:
    whole, rng, lines = written(tmp_path, f"c.{suffix}"), random.Random(suffix), []
    for _ in range(40):
        (tmp_path / f"c.{suffix}").write_bytes(damaged(whole, rng))
        try:
            read_points(tmp_path / f"c.{suffix}")
        except TomomeshError as fault:
            lines.append(str(fault))
    assert lines
    assert all(line.isprintable() for line in lines)
    assert [path.name for path in tmp_path.iterdir()] == [f"c.{suffix}"]
