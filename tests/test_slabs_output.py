"""From a window in slabs to its files: checked, measured and written as in memory, by workers in any order."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cut_meshes import Sent
from test_slabs import Study, cuts_of, studies
from test_slabs_measures import wanted
from tomomesh import write_mesh
from tomomesh.followed import Followed
from tomomesh.io import write_pieces
from tomomesh.measure.topology import topology
from tomomesh.slabs.keep import InMemory
from tomomesh.slabs.mesh import SlabMesh
from tomomesh.slabs.patches.following import apart_in
from tomomesh.slabs.patches.patch import in_one_patch, patches_of
from tomomesh.slabs.patches.promise import check_patches
from tomomesh.slabs.patches.report import assess_patches

if TYPE_CHECKING:
    from pathlib import Path


class TestOutput:
    @law(30)
    @given(study=studies(), data=st.data(), seed=seeds)
    def test_of_a_window_is_that_in_memory(
        self, tmp_path_factory: Any, study: Study, data: st.DataObject, seed: int
    ) -> None:
        folder: Path = tmp_path_factory.mktemp("m")
        bounded, surface = study.in_memory()
        mesh, cavities, cut_off = surface.mesh, bounded.cavities, surface.cut_off
        fields = {"filled": cut_off} if cut_off.any() else None
        in_slabs = study.in_slabs(cuts_of(data, len(study.mask)), InMemory())
        found = patches_of(SlabMesh.of(in_slabs.mesh.pieces, Sent(seed)))
        whole = check_patches(found, cavities=cavities)
        assert whole.topology == topology(mesh, cavities=cavities)
        assert assess_patches(found, whole, cavities=cavities) == wanted(mesh, cavities)
        for suffix in (".ply", ".stl", ".obj"):
            for name, one in (("whole", mesh), ("slabs", found)):
                write_mesh(one, folder / f"{name}{suffix}", face_fields=fields if one is mesh else None)
            assert (folder / f"whole{suffix}").read_bytes() == (folder / f"slabs{suffix}").read_bytes()
        follows = Followed("voxels", study.volume.affine, bounded.crossings.positions, float(bounded.volumes.sum()))
        crossings = replace(in_slabs.crossings, slabs=Sent(seed))
        near, far = follows.apart(mesh, leave_out=cut_off), apart_in(found, replace(follows, places=crossings))
        assert (near.share, near.offset) == (far.share, far.offset)
        assert (near.there.tobytes(), near.back.tobytes()) == (far.there.tobytes(), far.back.tobytes())
        files = [
            write_pieces(one, folder / f"{name}.ply", 3)
            for name, one in (("whole", in_one_patch(mesh, cut_off)), ("slabs", found))
        ]
        assert [path.read_bytes() for path in files[0][:3]] == [path.read_bytes() for path in files[1][:3]]
