"""One study in every format that holds a frame, with SimpleITK as judge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from studies import AFFINES, SHAPE, TURNED, assert_in_place, sampled, write_nifti
from tomomesh.errors import FormatError
from tomomesh.io import read_volume, write_labels
from tomomesh.settings import ReadSettings
from writers import assert_agrees, needed, with_itk, with_nibabel

if TYPE_CHECKING:
    from pathlib import Path


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))

WRITERS = {
    "nii.gz": with_nibabel(".nii.gz"),
    "hdr": with_nibabel(".hdr"),
    "nrrd": with_itk(".nrrd"),
    "nrrd gzip": with_itk(".nrrd", True),
    "nhdr": with_itk(".nhdr"),
    "nhdr gzip": with_itk(".nhdr", True),
    "mha": with_itk(".mha"),
    "mha zlib": with_itk(".mha", True),
    "mhd": with_itk(".mhd"),
    "mhd zlib": with_itk(".mhd", True),
    "mgh": with_nibabel(".mgh"),
    "mgz": with_nibabel(".mgz"),
}


class TestOneStudyInEveryFormat:
    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize("kind", WRITERS)
    def test_every_voxel_is_where_its_gray_level_says(self, tmp_path: Path, kind: str, turn: str) -> None:
        volume = read_volume(WRITERS[kind](tmp_path, sampled(TURNED[turn]), TURNED[turn]))
        assert_in_place(volume)
        assert volume.voxels.dtype == np.int16
        assert volume.notes == ()

    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind[0] == "n" or kind[:3] in ("mha", "mhd")])
    def test_simpleitk_agrees(self, tmp_path: Path, kind: str, turn: str) -> None:
        path = WRITERS[kind](tmp_path, sampled(TURNED[turn]), TURNED[turn])
        assert_agrees(read_volume(path), needed("SimpleITK").ReadImage(str(path)))

    def test_all_give_the_same_canonical_volume(self, tmp_path: Path) -> None:
        found = []
        for number, write in enumerate(WRITERS.values()):
            (tmp_path / str(number)).mkdir()
            found.append(read_volume(write(tmp_path / str(number), sampled(AFFINES["oblique"]), AFFINES["oblique"])))
        for volume in found:
            np.testing.assert_array_equal(volume.voxels, found[0].voxels)
            np.testing.assert_allclose(volume.affine, found[0].affine, atol=1e-4)

    @pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_every_kind_of_number_comes_back(self, tmp_path: Path, suffix: str, kind: str) -> None:
        stored = (np.arange(np.prod(SHAPE)) % 100 - (0 if kind[0] == "u" else 50)).astype(kind).reshape(SHAPE)
        path = with_itk(suffix)(tmp_path, stored, AFFINES["axial"])
        volume = read_volume(path)
        assert_agrees(volume, needed("SimpleITK").ReadImage(str(path)))
        assert volume.voxels.dtype == np.dtype(kind)

    @pytest.mark.parametrize("kind", ["u1", "u2", "i2", "i4", "f4"])
    def test_every_kind_of_number_of_mgh(self, tmp_path: Path, kind: str) -> None:
        stored = (np.arange(np.prod(SHAPE)) % 100).astype(kind).reshape(SHAPE)
        volume = read_volume(with_nibabel(".mgz")(tmp_path, stored, AFFINES["axial"]))
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), stored)
        assert volume.voxels.dtype == np.dtype(kind)

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_color_has_three_channels(self, tmp_path: Path, suffix: str) -> None:
        colors = np.stack([sampled(AFFINES["axial"]) % n for n in (251, 7, 13)], axis=-1).astype(np.uint8)
        image = needed("SimpleITK").GetImageFromArray(colors, isVector=True)
        needed("SimpleITK").WriteImage(image, str(tmp_path / f"c{suffix}"))
        volume = read_volume(tmp_path / f"c{suffix}")
        np.testing.assert_array_equal(volume.voxels, colors)

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_several_values_a_voxel_are_refused(self, tmp_path: Path, suffix: str) -> None:
        image = needed("SimpleITK").GetImageFromArray(np.zeros((*SHAPE, 3), np.float32), isVector=True)
        needed("SimpleITK").WriteImage(image, str(tmp_path / f"c{suffix}"))
        with pytest.raises(FormatError, match="several values"):
            read_volume(tmp_path / f"c{suffix}")

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".mgz"])
    def test_nan_becomes_background(self, tmp_path: Path, suffix: str) -> None:
        stored = sampled(AFFINES["axial"]).astype(np.float32)
        stored[3, 2, 1] = np.nan
        write = with_nibabel(suffix) if suffix == ".mgz" else with_itk(suffix)
        volume = read_volume(write(tmp_path, stored, AFFINES["axial"]))
        assert volume.voxels[3, 2, 1] == np.nanmin(stored)
        assert "1" in volume.notes[0]

    @pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd", ".mha"])
    def test_label_maps_keep_their_numbers(self, tmp_path: Path, suffix: str) -> None:
        study = read_volume(write_nifti(tmp_path / "s.nii", sampled(TURNED["left-handed"]), TURNED["left-handed"]))
        labels = (study.voxels % 5 * 129).astype(np.uint16)
        if suffix == ".nii.gz":
            write_labels(labels, study, tmp_path / "l.nii.gz")
        else:
            with_itk(suffix)(tmp_path, study.grid.restore(labels), study.grid.affine).rename(tmp_path / f"l{suffix}")
        found = read_volume(tmp_path / f"l{suffix}")
        assert found.voxels.dtype == np.uint16
        np.testing.assert_array_equal(found.voxels, labels)
        np.testing.assert_allclose(found.affine, study.affine, atol=1e-4)
