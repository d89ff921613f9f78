"""Every reader of clouds, meshes and settings, on damaged bytes: a result, or one line with exit code 4 to 7."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from fuzz import EXIT_CODES, fuzz
from tomomesh.io import read_mesh, read_points, read_settings, write_mesh, write_points, write_settings
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import PointSet
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

BALL = trimesh.creation.icosphere(subdivisions=1)
MESH = TriMesh(np.array(BALL.vertices), np.array(BALL.faces, np.int64))
COLORS = np.arange(3 * len(MESH.vertices), dtype=np.uint8).reshape(-1, 3)
CLOUD = PointSet.from_positions(MESH.vertices)
PCD = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA {1}\n"


def cloud(path: Path) -> None:
    write_points(CLOUD, path)


def mesh(path: Path) -> None:
    write_mesh(MESH, path, vertex_fields={"red": COLORS[:, 0], "green": COLORS[:, 1], "blue": COLORS[:, 2]})


def of_trimesh(**options: Any) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(_bytes(BALL.export(file_type=path.suffix[1:], **options)))


def _bytes(data: str | bytes) -> bytes:
    return data.encode() if isinstance(data, str) else data


def npz(path: Path) -> None:
    np.savez_compressed(path, points=MESH.vertices, red=COLORS[:, 0])


def text_pcd(path: Path) -> None:
    rows = "\n".join(f"{x} {y} {z}" for x, y, z in MESH.vertices)
    path.write_text(PCD.format(len(MESH.vertices), "ascii") + rows + "\n")


def binary_pcd(path: Path) -> None:
    path.write_bytes(PCD.format(len(MESH.vertices), "binary").encode() + MESH.vertices.astype("<f4").tobytes())


def packed_pcd(path: Path) -> None:
    """Write literal runs alone, which any LZF decoder takes."""
    plain = MESH.vertices.astype("<f4").T.tobytes()
    runs = [plain[at : at + 32] for at in range(0, len(plain), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    sizes = np.array([len(packed), len(plain)], "<u4").tobytes()
    path.write_bytes(PCD.format(len(MESH.vertices), "binary_compressed").encode() + sizes + packed)


def las(path: Path) -> None:
    laspy: Any = pytest.importorskip("laspy", reason="the package laspy is not installed")
    pytest.importorskip("lazrs", reason="the package lazrs is not installed")
    scan = laspy.LasData(laspy.LasHeader(point_format=7, version="1.4"))
    scan.x, scan.y, scan.z = MESH.vertices.T
    scan.write(path)


CLOUDS: dict[str, Callable[[Path], object]] = {
    "a.ply": cloud,
    "text.ply": of_trimesh(encoding="ascii"),
    "a.xyz": cloud,
    "a.csv": cloud,
    "a.npy": cloud,
    "a.npz": npz,
    "text.pcd": text_pcd,
    "binary.pcd": binary_pcd,
    "packed.pcd": packed_pcd,
    "a.las": las,
    "a.laz": las,
    "a.obj": mesh,
    "a.off": mesh,
    "a.stl": mesh,
}


def mixed_ply(path: Path) -> None:
    """Triangles and squares, in which rows differ in length, behind an element with a list."""
    head = "ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty list uchar short views\nelement vertex 6\n"
    head += "property float x\nproperty double y\nproperty float z\nelement face 40\n"
    head += "property list uchar int vertex_indices\nproperty uchar flag\nend_header\n"
    vertices = b"".join(struct.pack("<fdf", *place) for place in MESH.vertices[:6].tolist())
    faces = b"".join(struct.pack(f"<B{n}iB", n, *range(n), 7) for n in (3, 4) * 20)
    path.write_bytes(head.encode() + struct.pack("<B2h", 2, 1, 2) + vertices + faces)


def strip_ply(path: Path) -> None:
    places = "\n".join(f"{x} {y} {z}" for x, y, z in MESH.vertices[:6])
    head = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    path.write_text(f"{head}{places}\n11 0 1 2 3 4 -1 5 3 1 0 2\n")


MESHES: dict[str, Callable[[Path], object]] = {
    "a.stl": mesh,
    "text.stl": lambda path: path.write_text(_bytes(BALL.export(file_type="stl_ascii")).decode()),
    "a.ply": mesh,
    "text.ply": of_trimesh(encoding="ascii"),
    "mixed.ply": mixed_ply,
    "strip.ply": strip_ply,
    "a.obj": mesh,
    "a.off": mesh,
}


@pytest.mark.parametrize("name", CLOUDS)
def test_damaged_clouds(tmp_path: Path, name: str) -> None:
    CLOUDS[name](tmp_path / name)
    fuzz(read_points, tmp_path / name)


@pytest.mark.parametrize("name", MESHES)
def test_damaged_meshes(tmp_path: Path, name: str) -> None:
    MESHES[name](tmp_path / name)
    fuzz(read_mesh, tmp_path / name)


def test_damaged_settings(tmp_path: Path) -> None:
    """A value outside its limits is a fault of usage, in a file as on the command line."""
    write_settings(Settings(), tmp_path / "s.toml")
    fuzz(read_settings, tmp_path / "s.toml", codes=(2, *EXIT_CODES))
