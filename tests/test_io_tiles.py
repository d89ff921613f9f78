"""Folders of tiles are one cloud, however it was cut: the same surface to the last bit."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, law, seeds, sphere
from doors import as_program
from tomomesh import read_points, reconstruct_points
from tomomesh.cli.options.formats import TILE_FORMATS
from tomomesh.errors import EmptyError, FormatError, GeometryError
from tomomesh.io.clouds.read import TILES

if TYPE_CHECKING:
    from numpy.typing import NDArray

laspy: Any = pytest.importorskip("laspy", reason="the package laspy is not installed")
pytest.importorskip("lazrs", reason="the package lazrs is not installed")

STEP = 1e-4


def write(points: NDArray[np.float64], path: Path, *, epsg: int | None = None) -> None:
    """Write a tile with intensities; numbers from its own lowest corner, as cities cut theirs."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, STEP)
    header.offsets = np.floor(points.min(axis=0)) if len(points) else np.zeros(3)
    if epsg:
        header.add_crs(pytest.importorskip("pyproj").CRS.from_epsg(epsg))
    scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = points.T
    scan.intensity = np.rint(1000 + 50 * points[:, 2]).astype(np.uint16)
    scan.write(path)


def rows(cloud: Any) -> NDArray[np.int64]:
    """Positions in steps, and intensities, in the order of all."""
    found = np.column_stack([np.rint(cloud.positions / STEP), cloud.attributes["intensity"]]).astype(np.int64)
    return found[np.lexsort(found.T)]


@law(12)
@given(seeds, st.lists(st.floats(-9, 9), max_size=4), st.integers(0, 2))
def test_any_cuts_hold_the_same_points(seed: int, cuts: list[float], axis: int) -> None:
    rng, cloud = np.random.default_rng(seed), np.round(sphere(500), 3)
    with tempfile.TemporaryDirectory() as folder:
        tile = np.searchsorted(np.sort(cuts), cloud[:, axis])
        for number in rng.permutation(len(cuts) + 1):
            own = cloud[tile == number]
            write(own, Path(folder, f"{rng.integers(1 << 40)}.{rng.choice(TILE_FORMATS)}"))
        Path(folder, "index.txt").write_text("no tile")
        found = read_points(folder)
    write_alone = np.column_stack([np.rint(cloud / STEP), np.rint(1000 + 50 * cloud[:, 2])]).astype(np.int64)
    assert np.array_equal(rows(found), write_alone[np.lexsort(write_alone.T)])
    assert "read as one cloud" in found.notes[0]


@pytest.mark.skipif(not COMPILED, reason="thousands of points settle, minutes without the compiler")
def test_the_surface_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    cloud = np.round(sphere(4000), 3)
    write(cloud, tmp_path / "whole.laz")
    (tmp_path / "tiles").mkdir()
    for number, own in enumerate(np.array_split(cloud[np.argsort(cloud[:, 0])], 5)):
        write(own, tmp_path / "tiles" / f"{number}.las")
    whole, tiles = (read_points(tmp_path / name) for name in ("whole.laz", "tiles"))
    offset = np.abs(whole.positions[np.lexsort(whole.positions.T)] - tiles.positions[np.lexsort(tiles.positions.T)])
    assert offset.max() < STEP / 100
    exact = [np.round(one.positions / STEP) * STEP for one in (whole, tiles)]
    one, other = (reconstruct_points(positions).mesh for positions in exact)
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.faces, other.faces)


def test_the_command_takes_a_folder(tmp_path: Path, folder: Path) -> None:
    (tmp_path / "tiles").mkdir()
    for number, own in enumerate(np.array_split(np.round(sphere(1500), 3), 2)):
        write(own, tmp_path / "tiles" / f"{number}.laz")
    done = as_program(["surface", str(tmp_path / "tiles"), "-o", str(folder / "mesh.ply")])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("points    1500, ")


def test_the_kinds_are_known_to_both() -> None:
    assert tuple(f".{name}" for name in TILE_FORMATS) == TILES


def test_what_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"is a folder.*tiles"):
        read_points(tmp_path)
    write(np.empty((0, 3)), tmp_path / "none.las")
    with pytest.raises(EmptyError, match="no points"):
        read_points(tmp_path)
    write(sphere(20), tmp_path / "meters.las", epsg=25832)
    write(sphere(20), tmp_path / "feet.las", epsg=2263)
    with pytest.raises(GeometryError, match="one coordinate system"):
        read_points(tmp_path)
