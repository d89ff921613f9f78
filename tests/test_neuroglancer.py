"""Levels of detail for Neuroglancer, read by the definition of the format and by cloud-volume."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cut_meshes import cut, cuts
from test_slabs_measures import finer
from test_twins_topology import ball, isosurface, ring
from tomomesh import TriMesh
from tomomesh.errors import FormatError, OutputError, UsageError
from tomomesh.io import write_neuroglancer
from tomomesh.io.meshes.cells import weld
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.topology import topology
from tomomesh.slabs.keep import OnDisk
from tomomesh.slabs.patches.patch import patches_of

if TYPE_CHECKING:
    from pathlib import Path

draco = pytest.importorskip("DracoPy")
pytest.importorskip("pyfqmr")


def levels_in(folder: Path, segment: int = 1) -> tuple[list[TriMesh], float]:
    """Read the files as the format's page says; return the levels in nanometers, and the side of a cell."""
    raw, data = (folder / f"{segment}.index").read_bytes(), (folder / str(segment)).read_bytes()
    info = json.loads((folder / "info").read_text())
    shape, origin, count = (
        np.frombuffer(raw, "<f4", 3),
        np.frombuffer(raw, "<f4", 3, 12),
        int.from_bytes(raw[24:28], "little"),
    )
    at = 28 + 4 * count
    offsets = np.frombuffer(raw, "<f4", 3 * count, at).reshape(count, 3)
    numbers = np.frombuffer(raw, "<u4", count, at + 12 * count)
    at += 16 * count
    transform = np.array(info["transform"]).reshape(3, 4)
    start, found = 0, []
    for level, number in enumerate(numbers.tolist()):
        cells = np.frombuffer(raw, "<u4", 3 * number, at).reshape(3, number).T
        sizes = np.frombuffer(raw, "<u4", number, at + 12 * number)
        at += 16 * number
        corners = [np.empty((0, 3, 3))]
        for cell, size in zip(cells, sizes.tolist(), strict=True):
            one = draco.decode(data[start : start + size])
            whole = np.asarray(one.points, np.float64)
            assert (whole == np.round(whole)).all()
            assert whole.min() >= 0
            assert whole.max() < 2 ** info["vertex_quantization_bits"]
            places = origin + offsets[level] + shape * 2.0**level * (cell + whole / (2.0**16 - 1))
            corners.append((places @ transform[:, :3].T + transform[:, 3])[np.asarray(one.faces, np.int64)])
            start += size
        places, faces = weld(np.round(np.concatenate(corners).reshape(-1, 3), 3))
        faces = faces.reshape(-1, 3)
        found.append(TriMesh(places, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]))
    assert (start, at) == (len(data), len(raw))
    return found, float(shape[0])


def fine() -> TriMesh:
    return finer(finer(finer(ball())))


class TestLevels:
    def test_the_finest_is_the_mesh_and_all_are_closed(self, folder: Path) -> None:
        mesh = finer(fine())
        write_neuroglancer(mesh, folder / "m", faces=3000)
        levels, side = levels_in(folder / "m")
        assert len(levels) == 3
        step = 1e6 * side / 65535
        far = distance_to_surface(mesh.vertices * 1e6, levels[0])
        assert far.max() < step
        assert distance_to_surface(levels[0].vertices, mesh.moved(mesh.vertices * 1e6)).max() < step
        for level in levels:
            assert topology(level).boundary_edges == 0
            assert topology(level).euler_number == 2
            assert level.face_volumes.sum() == pytest.approx(mesh.face_volumes.sum() * 1e18, rel=0.05)
        counts = [len(level.faces) for level in levels]
        assert all(fewer < 0.6 * more for more, fewer in pairwise(counts))

    @law(12)
    @given(seed=seeds, share=st.floats(0.1, 0.5), at=cuts, faces=st.sampled_from([30, 300, 5000]))
    def test_know_no_slabs(self, tmp_path_factory: Any, seed: int, share: float, at: list[int], faces: int) -> None:
        folder, mesh = tmp_path_factory.mktemp("m"), isosurface(seed, share)
        pieces = cut(mesh, at, slabs=OnDisk(folder))
        write_neuroglancer(mesh, folder / "a", faces=faces)
        write_neuroglancer(patches_of(pieces), folder / "b", faces=faces)
        for name in ("info", "1.index", "1"):
            assert (folder / "a" / name).read_bytes() == (folder / "b" / name).read_bytes()
        assert topology(levels_in(folder / "a")[0][0]).boundary_edges == 0

    @pytest.mark.parametrize(("unit", "nanometers"), [("mm", 1e6), ("um", 1e3), ("nm", 1), ("voxel", 1e6)])
    def test_are_in_nanometers(self, folder: Path, unit: str, nanometers: float) -> None:
        write_neuroglancer(ring(), folder / "m", unit=unit)
        levels, _ = levels_in(folder / "m")
        assert np.ptp(levels[0].vertices, axis=0) == pytest.approx(
            np.ptp(ring().vertices, axis=0) * nanometers, rel=1e-3
        )

    def test_of_several_meshes_lie_in_one_folder(self, folder: Path) -> None:
        write_neuroglancer(ring(), folder, segment=7)
        write_neuroglancer(ball(), folder, segment=8)
        assert [len(levels_in(folder, number)[0][0].faces) for number in (7, 8)] == [
            len(ring().faces),
            len(ball().faces),
        ]


def test_cloud_volume_reads_all_levels(tmp_path: Path) -> None:
    cloudvolume = pytest.importorskip("cloudvolume")
    mesh = fine()
    write_neuroglancer(mesh, tmp_path / "mesh", faces=200)
    scale = {
        "chunk_sizes": [[64, 64, 64]], "encoding": "raw", "key": "1_1_1", "resolution": [1, 1, 1], "size": [9, 9, 9],
        "voxel_offset": [0, 0, 0],
    }  # fmt: skip
    info = {
        "type": "segmentation", "data_type": "uint64", "num_channels": 1, "scales": [scale], "mesh": "mesh",
        "@type": "neuroglancer_multiscale_volume",
    }  # fmt: skip
    (tmp_path / "info").write_text(json.dumps(info))
    volume = cloudvolume.CloudVolume(f"file://{tmp_path}", progress=False)
    levels, _ = levels_in(tmp_path / "mesh")
    for number, level in enumerate(levels):
        found = volume.mesh.get(1, lod=number)[1]
        judged = TriMesh(np.asarray(found.vertices, np.float64), np.asarray(found.faces, np.int64))
        assert judged.face_areas.sum() == pytest.approx(level.face_areas.sum(), rel=1e-5)
        assert distance_to_surface(judged.vertices, level).max() < 2


class TestRefusals:
    def test_of_a_folder_of_other_data_leave_it(self, folder: Path) -> None:
        (folder / "info").write_text('{"@type": "neuroglancer_multiscale_volume"}')
        with pytest.raises(UsageError, match="other data"):
            write_neuroglancer(ring(), folder)
        assert [path.name for path in folder.iterdir()] == ["info"]

    def test_where_a_package_is_missing_name_the_extra(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        import sys

        monkeypatch.setitem(sys.modules, "DracoPy", None)
        with pytest.raises(FormatError, match=r"tomomesh\[neuroglancer\]"):
            write_neuroglancer(ring(), folder / "m")
        assert not list(folder.iterdir())

    def test_half_way_leave_nothing(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def fails(*arguments: Any) -> Any:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("tomomesh.io.meshes.pieces.neuroglancer._encoded", fails)
        with pytest.raises(OutputError, match="no space"):
            write_neuroglancer(ring(), folder / "m")
        assert not list(folder.iterdir())
