"""Real studies from end to end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tomomesh
from studies import shared
from test_end_to_end import judged
from tomomesh import reconstruct

if TYPE_CHECKING:
    from tomomesh.model.volume import Volume


class TestRealStudies:
    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("derived/dev54_t1/dev54_t1.nii.gz", {}),
            ("derived/dev54_t1/dev54_t1.nii.gz", {"lower": 140.0, "allow_far": True}),
            ("volrender/seg3D/MR.nii.gz", {"slices": "axial"}),
            ("dicom2stl/ct_example.nii.gz", {"preset": "bone", "allow_far": True}),
        ],
    )
    def test_closed_and_manifold_with_a_plausible_volume(self, name: str, options: dict[str, Any]) -> None:
        found = reconstruct(tomomesh.read_volume(shared(name)), way="ring", **options)
        mesh = judged(found)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert 1.0e6 < mesh.volume < 5.0e6
        far = found.report["quality"]["follows"]["far"]
        assert ("allow_far" in options) == ("does not follow" in str(far))
        advised = any("--contours components" in warning for warning in found.report["warnings"])
        assert advised == (options.get("lower") == 140)  # scalp and brain in one window are more than one ring
        assert advised or found.report["cubes"]["tight"]
        assert advised or 0.8 < found.report["quality"]["volume_over_rings"] < 1.25

    def test_a_vendors_slab_of_four_slices_is_closed(self) -> None:
        found = reconstruct(tomomesh.read_volume(shared("dicom2nifti/siemens/anatomical/001")), way="ring")
        assert judged(found).is_watertight
        assert found.report["quality"]["genus"] == 0
        assert 0.8 < found.report["quality"]["volume_over_rings"] < 1.2

    def test_axis_orders_and_image_stacks_give_the_same_mesh(self) -> None:
        from tomomesh.settings import ReadSettings

        nifti = tomomesh.read_volume(shared("derived/dev54_t1/dev54_t1.nii.gz"))
        spacing = ReadSettings(spacing=nifti.spacing_mm)
        for folder in ("derived/dev54_t1/png", "derived/dev54_t1/tif"):
            assert_same_but_for_the_place(nifti, tomomesh.read_volume(shared(folder), settings=spacing), way="ring")
        first, *others = (tomomesh.read_volume(p) for p in sorted(shared("niivue/nifti_space").iterdir())[:4])
        for other in others:
            assert_same_but_for_the_place(first, other)


def assert_same_but_for_the_place(one: Volume, other: Volume, **changes: Any) -> None:
    first, second = (reconstruct(each, allow_far=True, **changes).mesh for each in (one, other))
    assert first.faces.tobytes() == second.faces.tobytes()
    np.testing.assert_allclose(
        first.vertices - first.vertices.min(axis=0), second.vertices - second.vertices.min(axis=0), atol=1e-6
    )
