"""One mesh as several files: they weld to the whole, and are all there or none."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cut_meshes import cut, cut_off_in, cuts
from test_twins_topology import isosurface, ring
from tomomesh import TriMesh, read_mesh
from tomomesh.errors import OutputError, UsageError
from tomomesh.io import write_pieces
from tomomesh.io.meshes.cells import weld
from tomomesh.measure.topology import check_promise
from tomomesh.slabs.patches.patch import in_one_patch, patches_of
from tomomesh.slabs.patches.shares import shares

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray


def bytes_in(paths: list[Path]) -> list[bytes]:
    return [path.read_bytes() for path in paths]


def welded(paths: list[Path]) -> TriMesh:
    """Put files together and join equal positions."""
    meshes = [read_mesh(path) for path in paths]
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    places, numbers = weld(np.concatenate([mesh.vertices for mesh in meshes]))
    return TriMesh(places, numbers[np.concatenate([mesh.faces + n for mesh, n in zip(meshes, first, strict=False)])])


def sorted_corners(mesh: TriMesh) -> NDArray[np.float64]:
    rows = mesh.corners.reshape(-1, 9)
    return rows[np.lexsort(rows.T)]


class TestFiles:
    @law(30)
    @given(
        seed=seeds, share=st.floats(0.1, 0.6), at=cuts, count=st.integers(1, 7), precision=st.sampled_from([32, 64]),
        suffix=st.sampled_from([".ply", ".stl", ".obj"]), marked=st.sampled_from([0.0, 0.01, 0.5]),
    )  # fmt: skip
    def test_weld_to_the_whole_and_know_no_slabs(
        self, tmp_path_factory: Any, seed: int, share: float, at: list[int], count: int, precision: int, suffix: str,
        marked: float,
    ) -> None:  # fmt: skip
        folder, mesh = tmp_path_factory.mktemp("m"), isosurface(seed, share)
        some = np.random.default_rng(seed).random(len(mesh.faces)) < marked
        pieces = cut(mesh, at, 10, 20, cut_off=some)
        whole, marks = pieces.joined(), cut_off_in(pieces)
        found = write_pieces(patches_of(pieces), folder / f"a{suffix}", count, precision=precision)
        alone = write_pieces(in_one_patch(whole, marks), folder / f"b{suffix}", count, precision=precision)
        assert bytes_in(found[:-1]) == bytes_in(alone[:-1])
        if suffix == ".ply":
            columns = [trimesh.load_mesh(path, process=False).metadata for path in found[:-1]]
            told = [one["_ply_raw"]["face"]["data"]["filled"].sum() for one in columns] if marks.any() else []
            assert sum(told) == marks.sum()
        kind = np.float32 if suffix == ".stl" or (precision == 32 and suffix == ".ply") else np.float64
        again, wanted = welded(found[:-1]), whole.moved(whole.vertices.astype(kind).astype(np.float64))
        np.testing.assert_array_equal(sorted_corners(again), sorted_corners(wanted))

    def test_of_a_ring_weld_to_a_closed_mesh_in_the_order_of_the_whole(self, folder: Path) -> None:
        found = write_pieces(ring(), folder / "m.ply", 5)
        assert [path.name for path in found] == [*(f"m-00{n}.ply" for n in range(1, 6)), "m-pieces.json"]
        assert sorted(folder.iterdir()) == sorted(found)
        check_promise(welded(found[:-1]))
        index = json.loads(found[-1].read_text())
        assert (index["vertices"], index["faces"]) == (len(ring().vertices), len(ring().faces))
        assert "unit=mm frame=LPS" in index["written_by"]
        for told, path in zip(index["pieces"], found, strict=False):
            mesh = read_mesh(path)
            assert told == {
                "file": path.name, "vertices": len(mesh.vertices), "faces": len(mesh.faces),
                "low": mesh.vertices.min(axis=0).tolist(), "high": mesh.vertices.max(axis=0).tolist(),
            }  # fmt: skip

    def test_are_welded_by_trimesh(self, folder: Path) -> None:
        found = write_pieces(ring(), folder / "m.ply", 4)
        judge = trimesh.util.concatenate([trimesh.load_mesh(path, process=False) for path in found[:-1]])
        assert not judge.is_watertight
        judge.merge_vertices(digits_vertex=12)
        assert judge.is_watertight
        assert judge.volume == pytest.approx(float(ring().face_volumes.sum()))

    @law(20)
    @given(seed=seeds, share=st.floats(0.2, 0.6), count=st.integers(1, 6))
    def test_have_about_as_many_faces_each(self, seed: int, share: float, count: int) -> None:
        mesh = isosurface(seed, share)
        found = [len(piece.faces) for piece, _ in shares(in_one_patch(mesh), count)]
        # one vertex is the lowest of a dozen faces at most
        assert max(found) - min(found) <= 24
        assert sum(found) == len(mesh.faces)

    def test_of_32_bits_are_all_of_32_bits_or_none(self, folder: Path) -> None:
        # a few vertices far from the others, so near together that 32 bits join them: none of the others are near
        near = TriMesh(np.concatenate([ring().vertices, [[1e6, 0, 0], [1e6 + 1e-3, 0, 0], [1e6, 9, 9]]]), ring().faces)
        mesh = TriMesh(near.vertices, np.concatenate([ring().faces, len(ring().vertices) + np.array([[0, 1, 2]])]))
        found = write_pieces(mesh, folder / "m.ply", 3, precision=32)
        assert all(b"property double x" in path.read_bytes() for path in found[:-1])


class TestRefusals:
    @pytest.mark.parametrize("count", [0, -1, 201])
    def test_of_a_number_of_pieces(self, folder: Path, count: int) -> None:
        with pytest.raises(UsageError, match="1 to 200"):
            write_pieces(ring(), folder / "m.ply", count)

    def test_of_a_format(self, folder: Path) -> None:
        with pytest.raises(UsageError, match=r"\.obj \| \.ply \| \.stl"):
            write_pieces(ring(), folder / "m.glb", 2)

    def test_of_what_stl_cannot_hold_leave_nothing(self, folder: Path) -> None:
        with pytest.raises(OutputError, match="32-bit"):
            write_pieces(ring().moved(ring().vertices + 1e8), folder / "m.stl", 3)
        assert not list(folder.iterdir())

    @pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), KeyboardInterrupt()])
    def test_half_way_leave_the_old_files(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, fault: BaseException
    ) -> None:
        old = bytes_in(write_pieces(ring(), folder / "m.ply", 3))
        names = sorted(folder.iterdir())

        def fails(*arguments: Any) -> Iterator[tuple[TriMesh, NDArray[np.bool_]]]:
            made = shares(*arguments)
            yield next(made)
            yield next(made)
            raise fault

        monkeypatch.setattr("tomomesh.io.meshes.pieces.files.shares", fails)
        with pytest.raises(OutputError if isinstance(fault, OSError) else KeyboardInterrupt):
            write_pieces(ring().moved(2 * ring().vertices), folder / "m.ply", 3)
        assert sorted(folder.iterdir()) == names
        assert bytes_in(names) == old
