"""Damaged files: one error of the family in one line, or a result; never a traceback or a name."""

from __future__ import annotations

import gzip
import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from studies import AFFINES, enhanced, sampled, save, slice_dataset, write_nifti
from tomomesh.errors import TomomeshError
from tomomesh.io import read_mesh, read_points, read_volume, write_mesh, write_points
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import PointSet
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

STORED, AFFINE = sampled(AFFINES["oblique"]), AFFINES["oblique"]
SETTINGS = ReadSettings(spacing=(1, 1, 1), spacing_z=1)


def volume_file(folder: Path, name: str) -> Any:
    if name.endswith(".gz"):
        write_nifti(folder / "plain.nii", STORED, AFFINE)
        (folder / name).write_bytes(gzip.compress((folder / "plain.nii").read_bytes(), mtime=0))
    elif name.endswith(".nii"):
        write_nifti(folder / name, STORED, AFFINE)
    elif name == "enhanced.dcm":
        save(enhanced(STORED, AFFINE, [0, 1, 2, 3, 4]), folder / name)
    elif name.endswith(".dcm"):
        save(slice_dataset(STORED[0], AFFINE, 0), folder / name)
    else:
        Image.fromarray(STORED[0].astype(np.uint16)).save(folder / name)
    return lambda path: read_volume(path.parent if path.suffix in (".png", ".tif") else path, settings=SETTINGS)


def surface_file(folder: Path, name: str) -> Any:
    ball = trimesh.creation.icosphere(subdivisions=1)
    mesh = TriMesh(np.array(ball.vertices), np.array(ball.faces, np.int64))
    if name.endswith(".off"):
        ball.export(folder / name)
    elif name.startswith("mesh"):
        write_mesh(mesh, folder / name)
    else:
        write_points(PointSet.from_positions(mesh.vertices), folder / name)
    return read_mesh if name.startswith("mesh") else read_points


VOLUMES = ("a.nii", "a.nii.gz", "enhanced.dcm", "slice.dcm", "a.png", "a.tif")
SURFACES = ("mesh.stl", "mesh.ply", "mesh.obj", "mesh.off", "c.ply", "c.xyz", "c.csv", "c.npy")


def damaged(whole: bytes, rng: random.Random) -> bytes:
    """Change, drop or insert a few bytes, more often in the header; or cut the file off."""
    raw = bytearray(whole)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(whole) if rng.random() < 0.4 else min(len(whole), 700))
        raw[at : at + rng.randrange(9)] = rng.randbytes(rng.randrange(9))
    return bytes(raw[: rng.randrange(1, len(raw))] if rng.random() < 0.1 else raw)


@pytest.mark.parametrize("name", VOLUMES + SURFACES)
def test_damage_is_told_in_one_line(tmp_path: Path, name: str) -> None:
    (tmp_path / "good").mkdir()
    (tmp_path / "bad").mkdir()
    prepare: Callable[[Path, str], Any] = volume_file if name in VOLUMES else surface_file
    read = prepare(tmp_path / "good", name)
    whole, rng = (tmp_path / "good" / name).read_bytes(), random.Random(name)
    read(tmp_path / "good" / name)
    lines = []
    for _ in range(30):
        (tmp_path / "bad" / name).write_bytes(damaged(whole, rng))
        try:
            read(tmp_path / "bad" / name)
        except TomomeshError as fault:
            lines.append(str(fault))
    assert lines
    assert all(line.isprintable() and "secret" not in line.lower() for line in lines)
    assert [path.name for path in (tmp_path / "bad").iterdir()] == [name]
