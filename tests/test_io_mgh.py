"""MGH and MGZ, with nibabel as judge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest

from studies import AFFINES, LPS_TO_RAS, TURNED, assert_in_place, sampled
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings
from writers import with_nibabel

if TYPE_CHECKING:
    from pathlib import Path


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestMgh:
    def test_nibabel_agrees(self, tmp_path: Path) -> None:
        path = with_nibabel(".mgz")(tmp_path, sampled(TURNED["left-handed"]), TURNED["left-handed"])
        image, volume = nibabel.load(path), read_volume(path)
        np.testing.assert_allclose(volume.grid.affine, LPS_TO_RAS @ image.affine, atol=1e-4)
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels).T, np.asarray(image.dataobj))

    @pytest.mark.parametrize(("suffix", "named"), [(".mgh", ".mgz"), (".mgz", ".mgh")])
    def test_whether_it_is_packed_is_seen_in_its_bytes(self, tmp_path: Path, suffix: str, named: str) -> None:
        path = with_nibabel(suffix)(tmp_path, sampled(AFFINES["oblique"]), AFFINES["oblique"])
        assert_in_place(read_volume(path.rename(tmp_path / f"t{named}")))

    def test_a_file_without_a_frame_has_freesurfers_and_says_so(self, tmp_path: Path) -> None:
        path = with_nibabel(".mgh")(tmp_path, sampled(AFFINES["axial"]), AFFINES["axial"])
        raw = bytearray(path.read_bytes())
        raw[28:30] = b"\0\0"
        path.write_bytes(bytes(raw))
        volume = read_volume(path)
        np.testing.assert_allclose(volume.grid.affine, LPS_TO_RAS @ nibabel.MGHImage.from_bytes(bytes(raw)).affine)
        assert "no frame" in volume.notes[0]
