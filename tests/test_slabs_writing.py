"""A mesh in pieces is written with the bytes of the whole, wherever it is cut, or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cut_meshes import cut, cut_off_in, cuts
from test_twins_topology import isosurface, ring
from tomomesh import TriMesh, read_mesh, write_mesh
from tomomesh.errors import OutputError, UsageError
from tomomesh.io.frames import Frame
from tomomesh.slabs.keep import OnDisk
from tomomesh.slabs.patches.patch import patches_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tomomesh.slabs.patches.patch import Patches

SUFFIXES = (".ply", ".stl", ".obj")


def written(mesh: Any, path: Path, **options: Any) -> bytes:
    write_mesh(mesh, path, **options)
    return path.read_bytes()


@pytest.fixture
def few_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let parts of few rows be handed out, so that small meshes have several."""
    monkeypatch.setattr("tomomesh.model.columns.PART", 37)


class TestBytes:
    @pytest.mark.usefixtures("few_rows")
    @pytest.mark.parametrize("suffix", SUFFIXES)
    @law(25)
    @given(
        seed=seeds, share=st.floats(0.05, 0.6), at=cuts, centers=st.integers(0, 40),
        precision=st.sampled_from([32, 64]), marked=st.sampled_from([0.0, 0.01, 0.5]),
    )  # fmt: skip
    def test_are_the_whole_s(
        self, tmp_path_factory: Any, suffix: str, seed: int, share: float, at: list[int], centers: int, precision: int,
        marked: float,
    ) -> None:  # fmt: skip
        folder, mesh = tmp_path_factory.mktemp("m"), isosurface(seed, share)
        some = np.random.default_rng(seed).random(len(mesh.faces)) < marked
        pieces = cut(mesh, at, min(centers, len(mesh.vertices)), 2 * centers, slabs=OnDisk(folder), cut_off=some)
        options = {"unit": "um", "frame": "RAS", "precision": precision}
        fields = {"filled": cut_off_in(pieces)} if some.any() else None
        wanted = written(pieces.joined(), folder / f"whole{suffix}", face_fields=fields, **options)
        assert written(patches_of(pieces), folder / f"pieces{suffix}", **options) == wanted

    @law(40)
    @given(seed=seeds, at=cuts, mirrored=st.booleans())
    def test_are_the_whole_s_in_another_frame(
        self, tmp_path_factory: Any, seed: int, at: list[int], mirrored: bool
    ) -> None:
        folder, mesh = tmp_path_factory.mktemp("m"), ring()
        matrix = np.vstack([np.random.default_rng(seed).normal(size=(3, 4)), [0, 0, 0, 1]])
        matrix[0, :3] *= 1 if (np.linalg.det(matrix) < 0) == mirrored else -1
        pieces = cut(mesh, [one % len(mesh.vertices) for one in at])
        wanted = written(Frame("mm", "voxel", matrix).mesh(pieces.joined()), folder / "whole.ply")
        assert written(patches_of(pieces).carried(matrix), folder / "pieces.ply") == wanted

    @pytest.mark.parametrize("at", [[0, 0, 0], [5, 6, 7, 7], list(range(200))])
    def test_are_the_whole_s_where_slabs_hold_next_to_nothing(self, tmp_path: Path, at: list[int]) -> None:
        pieces = cut(ring(), at)
        for suffix in SUFFIXES:
            wanted = written(pieces.joined(), tmp_path / f"whole{suffix}")
            assert written(patches_of(pieces), tmp_path / f"pieces{suffix}") == wanted

    def test_of_nothing_are_the_whole_s(self, tmp_path: Path) -> None:
        empty = TriMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))
        nothing = cut(empty, [0, 0])
        for suffix in SUFFIXES:
            wanted = written(empty, tmp_path / f"whole{suffix}")
            assert written(patches_of(nothing), tmp_path / f"pieces{suffix}") == wanted


class TestClients:
    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_read_a_closed_mesh(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"m{suffix}"
        write_mesh(patches_of(cut(ring(), [30, 60], 10, 20)), path)
        wanted = float(ring().face_volumes.sum())
        judge = trimesh.load_mesh(path, process=False)
        judge.merge_vertices()
        assert judge.is_watertight
        assert judge.volume == pytest.approx(wanted, rel=1e-5)
        other = meshio.read(path)
        assert len(other.cells_dict["triangle"]) == len(ring().faces)
        assert read_mesh(path).face_volumes.sum() == pytest.approx(wanted, rel=1e-5)

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_vtk_reads_as_many_faces(self, tmp_path: Path, suffix: str) -> None:
        readers = pytest.importorskip("vtkmodules.vtkIOGeometry")
        plys = pytest.importorskip("vtkmodules.vtkIOPLY")
        path = tmp_path / f"m{suffix}"
        write_mesh(patches_of(cut(ring(), [30, 60])), path)
        kinds = {".ply": plys.vtkPLYReader, ".stl": readers.vtkSTLReader, ".obj": readers.vtkOBJReader}
        reader = kinds[suffix]()
        reader.SetFileName(str(path))
        reader.Update()
        assert reader.GetOutput().GetNumberOfPolys() == len(ring().faces)


class Huge:
    """A mesh that says that it is larger than any file."""

    def __init__(self, vertices: int, faces: int) -> None:
        self.vertex_count, self.face_count = vertices, faces

    def vertices(self) -> Iterator[Any]:
        raise AssertionError("nothing is asked of it")

    faces = corners = filled = vertices

    def distinct(self, kind: Any) -> int:
        raise AssertionError("nothing is asked of it")


class TestRefusals:
    @pytest.mark.parametrize("suffix", [".vtp", ".glb", ".off", ".3mf", ".gii"])
    def test_of_other_formats_name_those_that_can_be(self, folder: Path, suffix: str) -> None:
        with pytest.raises(UsageError, match=r"part by part.*\.obj \| \.ply \| \.stl"):
            write_mesh(patches_of(cut(ring(), [30])), folder / f"m{suffix}")
        assert not list(folder.iterdir())

    @pytest.mark.parametrize(("name", "counts", "told"), [
        ("m.ply", (2**31, 5), "PLY numbers vertices in 32 bits"),
        ("m.stl", (5, 2**32 - 1), "STL counts faces in 32 bits"),
    ])  # fmt: skip
    def test_of_what_a_format_cannot_count(self, folder: Path, name: str, counts: tuple[int, int], told: str) -> None:
        with pytest.raises(OutputError, match=told):
            write_mesh(Huge(*counts), folder / name)
        assert not list(folder.iterdir())

    def test_of_what_32_bits_cannot_hold_are_those_of_the_whole(self, folder: Path) -> None:
        far = ring().moved(ring().vertices + 1e8)
        told = []
        for mesh in (far, patches_of(cut(far, [30, 60]))):
            with pytest.raises(OutputError, match="cannot keep the vertices apart") as found:
                write_mesh(mesh, folder / "m.stl")
            told.append(str(found.value))
        assert told[0] == told[1]

    @pytest.mark.parametrize("suffix", SUFFIXES)
    @pytest.mark.parametrize("fault", [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), KeyboardInterrupt()])
    def test_half_way_leave_the_old_file(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, fault: BaseException
    ) -> None:
        path, pieces = folder / f"m{suffix}", patches_of(cut(ring(), [30, 60]))
        path.write_bytes(b"old")
        handed = 0

        def fails(one: Patches) -> Any:
            nonlocal handed
            for some in whole(one):
                handed += 1
                if handed > 1:
                    raise fault
                yield some

        whole = type(pieces).corners if suffix == ".stl" else type(pieces).faces
        monkeypatch.setattr(type(pieces), whole.__name__, fails)
        with pytest.raises(OutputError if isinstance(fault, OSError) else KeyboardInterrupt):
            write_mesh(pieces, path)
        assert handed > 1
        assert path.read_bytes() == b"old"
        assert len(list(folder.iterdir())) == 1

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
    def test_a_disk_that_is_full_is_told_in_one_line(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        monkeypatch.setattr("tomomesh.io.files.unfinished._nameless", lambda parent: Path("/dev/full").open("wb"))  # noqa: SIM115
        with pytest.raises(OutputError, match="no space left") as found:
            write_mesh(patches_of(cut(ring(), [30, 60])), folder / "m.ply")
        assert "\n" not in str(found.value)
        assert not list(folder.iterdir())
