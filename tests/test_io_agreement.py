"""Every study and label map of the public data, as SimpleITK reads it; and one brain in eight orders of its axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from studies import DATA, shared
from tomomesh import reconstruct
from tomomesh.cli import main
from tomomesh.io import read_mesh, read_volume, write_mesh
from tomomesh.settings import ReadSettings
from writers import assert_agrees, needed

if TYPE_CHECKING:
    from pathlib import Path

SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".mha", ".mhd")
STUDIES = sorted(
    path.relative_to(DATA).as_posix()
    for path in DATA.rglob("*")
    if path.name.endswith(SUFFIXES) and "malformed" not in path.parts and not path.is_symlink()
)
LEVEL = 40.0
"""A gray level of the brain."""

ORDERS = [name for name in STUDIES if "nifti_space" in name]


@pytest.mark.parametrize("name", STUDIES or ["none of them is here"])
def test_voxels_and_millimeters_are_simpleitks(name: str) -> None:
    path = shared(name)
    assert_agrees(read_volume(path), needed("SimpleITK").ReadImage(str(path)))


@pytest.mark.parametrize("kind", ["png", "tif"])
def test_voxels_of_a_stack_are_simpleitks(kind: str) -> None:
    folder = shared(f"derived/dev54_t1/{kind}")
    names = sorted(str(path) for path in folder.iterdir())
    volume = read_volume(folder, settings=ReadSettings(spacing=(0.9375, 0.9375, 2.695)))
    np.testing.assert_array_equal(
        volume.voxels, needed("SimpleITK").GetArrayFromImage(needed("SimpleITK").ReadImage(names))
    )


class TestOneBrain:
    def test_its_eight_orders_are_one_array(self) -> None:
        shared("niivue")
        volumes = [read_volume(shared(name)) for name in ORDERS]
        assert len(volumes) == 8
        assert len({volume.grid.axes + volume.grid.flipped for volume in volumes}) == 8
        for volume in volumes[1:]:
            np.testing.assert_array_equal(volume.voxels, volumes[0].voxels)
            np.testing.assert_array_equal(volume.affine[:3, :3], volumes[0].affine[:3, :3])
            np.testing.assert_allclose(volume.affine, volumes[0].affine, atol=1e-5)  # the files' own origins

    def test_they_give_one_mesh_up_to_the_files_own_origins(self, tmp_path: Path) -> None:
        shared("niivue")
        for number, name in enumerate(ORDERS):
            write_mesh(
                reconstruct(read_volume(shared(name)), network="none", lower=LEVEL).mesh, tmp_path / f"{number}.ply"
            )
        self.assert_one_mesh(tmp_path, ORDERS)

    @pytest.mark.parametrize("network", ["none", "ring"])
    def test_the_command_line_gives_one_mesh_too(self, tmp_path: Path, network: str) -> None:
        shared("niivue")
        names = [ORDERS[0], ORDERS[-1]]
        for number, name in enumerate(names):
            words = ["reconstruct", str(shared(name)), "-o", str(tmp_path / f"{number}.ply"), "--quiet"]
            assert main([*words, "--lower", str(LEVEL), "--network", network]) == 0
        self.assert_one_mesh(tmp_path, names)

    def assert_one_mesh(self, folder: Path, names: list[str]) -> None:
        first = read_mesh(folder / "0.ply")
        origins = [read_volume(shared(name)).affine[:3, 3] for name in names]
        for number, origin in enumerate(origins):
            mesh = read_mesh(folder / f"{number}.ply")
            np.testing.assert_array_equal(mesh.faces, first.faces)
            np.testing.assert_allclose(mesh.vertices - origin, first.vertices - origins[0], rtol=0, atol=1e-9)
            if (origin == origins[0]).all():
                assert (folder / f"{number}.ply").read_bytes() == (folder / "0.ply").read_bytes()
