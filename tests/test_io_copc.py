"""A box of a cloud: of COPC files the nodes that meet it alone are unpacked, and it is what is in it."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, sphere
from doors import as_program
from tomomesh import PointSet, read_points
from tomomesh.errors import EmptyError, FormatError, UsageError
from tomomesh.io.clouds.copc import ENTRY, OWN, nodes_meeting
from tomomesh.io.clouds.write import write_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

laspy: Any = pytest.importorskip("laspy", reason="the package laspy is not installed")
pytest.importorskip("lazrs", reason="the package lazrs is not installed")

STEP = 1e-4
HALF = 1.5
"""Half the side of the octree's root."""


def ball(count: int) -> NDArray[np.float64]:
    return sphere(count, 1.0)


def write_copc(cloud: NDArray[np.float64], level: int, path: Path) -> None:
    """Write a tenth of a cloud at the root of an octree, and the rest at one of its levels, by others' software."""
    copc: Any = pytest.importorskip("copclib", reason="the package copclib is not installed")
    config = copc.CopcConfigWriter(7, (STEP,) * 3, (0, 0, 0))
    config.las_header.min, config.las_header.max = (copc.Vector3(*side) for side in (cloud.min(0), cloud.max(0)))
    config.copc_info.halfsize, config.copc_info.spacing = HALF, HALF / 64
    writer = copc.FileWriter(str(path), config)
    side = 2 * HALF / 2**level
    keys = np.column_stack([np.full(len(cloud), level), np.floor((cloud + HALF) / side).astype(int)])
    keys[: len(cloud) // 10] = 0
    for key in np.unique(keys, axis=0):
        points = copc.Points(config.las_header)
        for number in np.flatnonzero(np.all(keys == key, axis=1)):
            point = points.CreatePoint()
            point.x, point.y, point.z = cloud[number]
            point.intensity = int(number)
            points.AddPoint(point)
        writer.AddNode(copc.VoxelKey(*map(int, key)), points)
    writer.Close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("copc") / "c.copc.laz"
    write_copc(np.round(ball(3000), 4), 2, path)
    return path


def within(cloud: PointSet, box: NDArray[np.float64]) -> NDArray[np.bool_]:
    low, high = box.reshape(3, 2).T
    return np.asarray(((cloud.positions >= low) & (cloud.positions <= high)).all(axis=1))


def assert_is_part(found: PointSet, whole: PointSet, kept: NDArray[np.bool_]) -> None:
    assert found.positions.tobytes() == whole.positions[kept].tobytes()
    assert found.attributes.keys() == whole.attributes.keys()
    for name, values in whole.attributes.items():
        assert np.array_equal(found.attributes[name], values[kept])


def boxes(rng: np.random.Generator, cloud: NDArray[np.float64]) -> NDArray[np.float64]:
    """A box whose sides go through points, some through all."""
    box = np.sort(cloud[rng.integers(len(cloud), size=2)], axis=0).T
    box[rng.random(3) < 0.3] = -9.0, 9.0
    return np.asarray(box.ravel())


class TestCopc:
    @law(8)
    @given(seeds, st.integers(0, 4), st.integers(20, 600))
    def test_a_box_of_any_octree_is_what_a_reader_of_all_finds_in_it(self, seed: int, level: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        cloud = np.round(rng.uniform(-1.4, 1.4, (count, 3)) * rng.random(3), 4)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "c.copc.laz")
            write_copc(cloud, level, path)
            whole, scan = read_points(path), laspy.read(path)
            assert np.array_equal(whole.positions, np.column_stack([scan.x, scan.y, scan.z]))
            for _ in range(10):
                box = boxes(rng, whole.positions)
                kept = within(whole, box)
                assert_is_part(read_points(path, roi=tuple(box)), whole, kept)

    def test_what_lies_beside_the_box_is_not_unpacked(self, file: Path, tmp_path: Path) -> None:
        """Chunks of other nodes are made noise, which no reader of all takes for what it was."""
        box = np.array([0.5, 1, 0.5, 1, -1, 1])
        whole, data = read_points(file), bytearray(file.read_bytes())
        with laspy.open(file) as reader:
            nodes = nodes_meeting(file, reader.header, (-9.0, 9.0) * 3)
            near = nodes_meeting(file, reader.header, tuple(box))
            head = reader.header.point_format.size + 4 + 4 * 11
        assert nodes is not None
        assert near is not None
        assert 0 < len(near) < len(nodes) / 3
        for node in nodes[~np.isin(nodes["offset"], near["offset"])]:
            begin, end = int(node["offset"]) + head, int(node["offset"] + node["size"])
            data[begin:end] = bytes(byte ^ 0x5A for byte in data[begin:end])
        (tmp_path / "c.copc.laz").write_bytes(data)
        assert_is_part(read_points(tmp_path / "c.copc.laz", roi=tuple(box)), whole, within(whole, box))
        with contextlib.suppress(FormatError):
            assert not np.array_equal(read_points(tmp_path / "c.copc.laz").positions, whole.positions)

    def test_some_nodes_at_a_time_are_all(self, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        whole, box = read_points(file), np.array([-1, 0.3, -1, 1, -1, 1])
        monkeypatch.setattr("tomomesh.io.clouds.las.POINTS_AT_ONCE", 50)
        assert_is_part(read_points(file, roi=tuple(box)), whole, within(whole, box))

    @pytest.mark.parametrize(("field", "value"), [("offset", 1 << 60), ("size", 0), ("size", -32), ("size", 1 << 30)])
    def test_pages_that_cannot_be_are_refused(self, file: Path, tmp_path: Path, field: str, value: int) -> None:
        with pytest.raises(FormatError):
            read_points(changed(file, tmp_path, **{"count": -1, field: value}), roi=(0, 1, 0, 1, 0, 1))

    def test_a_page_that_leads_to_itself_ends(self, file: Path, tmp_path: Path) -> None:
        start, size = root_of(file)
        with pytest.raises(FormatError):
            read_points(changed(file, tmp_path, count=-1, offset=start, size=size), roi=(0, 1, 0, 1, 0, 1))

    def test_an_octree_that_does_not_lead_to_all_points_is_passed_over(self, file: Path, tmp_path: Path) -> None:
        whole, box = read_points(file), np.array([0.0, 1, 0, 1, -1, 1])
        found = read_points(changed(file, tmp_path, count=0), roi=tuple(box))
        assert_is_part(found, whole, within(whole, box))


def root_of(file: Path) -> tuple[int, int]:
    with laspy.open(file) as reader:
        info = next(one for one in reader.header.vlrs if (one.user_id, one.record_id) == OWN)
        return info.hierarchy_root_offset, info.hierarchy_root_size


def changed(file: Path, folder: Path, **values: int) -> Path:
    """Change the first entry with points of the octree's first page."""
    data, (start, size) = bytearray(file.read_bytes()), root_of(file)
    entries = np.frombuffer(data, ENTRY, size // ENTRY.itemsize, start)
    first = int(np.flatnonzero(entries["count"] > 0)[0])
    for name, value in values.items():
        entries[name][first] = value
    (folder / "c.copc.laz").write_bytes(data)
    return folder / "c.copc.laz"


def write_las(cloud: NDArray[np.float64], path: Path) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, STEP)
    scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = cloud.T
    scan.intensity = np.arange(len(cloud)) % 1000
    scan.write(path)


class TestOthers:
    @law(10)
    @given(seeds, st.sampled_from(["las", "laz", "npy", "ply", "xyz", "csv"]))
    def test_a_box_is_what_a_reader_of_all_finds_in_it(self, seed: int, suffix: str) -> None:
        rng, cloud = np.random.default_rng(seed), np.round(ball(300), 3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"c.{suffix}")
            if suffix in ("las", "laz"):
                write_las(cloud, path)
            else:
                write_points(PointSet.from_positions(cloud), path)
            whole = read_points(path)
            box = boxes(rng, whole.positions)
            assert_is_part(read_points(path, roi=tuple(box)), whole, within(whole, box))

    def test_of_tiles_those_that_it_meets_are_read(self, tmp_path: Path) -> None:
        cloud = np.round(ball(600), 3)
        for number, own in enumerate(np.array_split(cloud[np.argsort(cloud[:, 0])], 4)):
            write_las(own, tmp_path / f"{number}.laz")
        whole, box = read_points(tmp_path), np.array([0.6, 1, -1, 1, -1, 0.5])
        data = bytearray((tmp_path / "0.laz").read_bytes())
        data[900:1000] = bytes(100)  # what is beside the box may be broken
        (tmp_path / "0.laz").write_bytes(data)
        found = read_points(tmp_path, roi=tuple(box))
        assert_is_part(found, whole, within(whole, box))
        assert found.notes[0].startswith("1 tiles of 4 files") or found.notes[0].startswith("2 tiles of 4 files")

    def test_a_header_that_states_no_bounds_says_nothing(self, tmp_path: Path) -> None:
        write_las(np.round(ball(100), 3), tmp_path / "c.las")
        data = bytearray((tmp_path / "c.las").read_bytes())
        data[179:227] = bytes(48)
        (tmp_path / "c.las").write_bytes(data)
        whole = read_points(tmp_path / "c.las")
        assert len(read_points(tmp_path / "c.las", roi=(0.1, 1, 0.1, 1, -1, 1))) == np.count_nonzero(
            within(whole, np.array([0.1, 1, 0.1, 1, -1, 1]))
        )

    @pytest.mark.parametrize("suffix", ["las", "npy"])
    def test_a_box_of_no_points(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"c.{suffix}"
        write_las(ball(50), path) if suffix == "las" else np.save(path, ball(50))
        with pytest.raises(EmptyError, match=r"no point of the cloud lies in the box.*--roi = 5 6 0 1 0 1"):
            read_points(path, roi=(5, 6, 0, 1, 0, 1))

    def test_of_no_tile(self, tmp_path: Path) -> None:
        write_las(ball(50), tmp_path / "c.las")
        with pytest.raises(EmptyError, match=r"no point of the cloud lies in the box.*1 file.*--roi"):
            read_points(tmp_path, roi=(5, 6, 0, 1, 0, 1))

    def test_nan_beside_the_box_is_told(self, tmp_path: Path) -> None:
        np.save(tmp_path / "c.npy", np.array([[0, 0, 0], [np.nan, 0, 0], [1, 1, 1]]))
        with pytest.raises(FormatError, match="row 2"):
            read_points(tmp_path / "c.npy", roi=(0, 1, 0, 1, 0, 1))

    @pytest.mark.parametrize("box", [(0, 1), (1, 0, 0, 1, 0, 1), (0, float("nan"), 0, 1, 0, 1)])
    def test_what_is_no_box(self, tmp_path: Path, box: tuple[float, ...]) -> None:
        np.save(tmp_path / "c.npy", ball(50))
        with pytest.raises(UsageError):
            read_points(tmp_path / "c.npy", roi=box)


def test_the_command_takes_a_box(folder: Path, tmp_path: Path) -> None:
    cloud = np.concatenate([ball(1500), ball(1500) + np.array([5, 0, 0])])
    write_las(cloud, tmp_path / "two.laz")
    part = read_points(tmp_path / "two.laz", roi=(-2, 2, -2, 2, -2, 2))
    np.save(tmp_path / "one.npy", part.positions)
    line = ["--quiet", "-o"]
    box = ["--roi", "-2", "2", "-2", "2", "-2", "2"]
    assert as_program(["surface", str(tmp_path / "two.laz"), *line, str(folder / "a.stl"), *box]).returncode == 0
    assert as_program(["surface", str(tmp_path / "one.npy"), *line, str(folder / "b.stl")]).returncode == 0
    assert (folder / "a.stl").read_bytes() == (folder / "b.stl").read_bytes()
