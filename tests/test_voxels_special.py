"""Boundaries of few, many, touching and odd voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import ndimage

from isosurfaces import ball, volume_of
from test_voxels import surface_of
from tomomesh.errors import EmptyError, ResourceError
from tomomesh.isosurface.voxels import boundary
from tomomesh.isosurface.well_composed import without_contacts
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.points import BORDER
from tomomesh.pipeline import reconstruct

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class TestSpecial:
    def test_one_voxel_is_a_closed_box(self) -> None:
        gray = np.full((3, 3, 3), -1.0)
        gray[1, 1, 1] = 1.0
        for levels in (gray, np.ones((1, 1, 1))):
            _, made = surface_of(volume_of(levels))
            assert (len(made.mesh.vertices), len(made.mesh.faces)) == (8, 12)
            assert topology(made.mesh).sound
            assert 0 < made.mesh.face_volumes.sum() <= 1
            assert np.abs(made.mesh.vertices - np.array(levels.shape) // 2).max() <= 0.5

    @pytest.mark.parametrize("noise", [0.0, 0.1])
    def test_a_checkerboard_is_closed_and_manifold(self, noise: float) -> None:
        z, y, x = np.mgrid[:12, :12, :12]
        gray = np.where((x + y + z) % 2, 1.0, -1.0) + noise * np.random.default_rng(0).normal(size=x.shape)
        found, made = surface_of(volume_of(gray))
        check_promise(made.mesh, cavities=found.cavities)
        assert not self_intersections(made.mesh).any()
        assert found.added > 0

    def test_what_touches_the_border_is_capped_half_a_voxel_further(self) -> None:
        found, made = surface_of(volume_of(np.ones((4, 5, 6))))
        assert (found.points.kinds == BORDER).all()
        np.testing.assert_allclose(found.crossings.positions.min(axis=0), -0.5)
        np.testing.assert_allclose(found.crossings.positions.max(axis=0), [5.5, 4.5, 3.5])
        assert topology(made.mesh).euler_number == 2

    def test_what_is_no_number_is_background(self) -> None:
        gray = ball(6).voxels.copy()
        gray[gray > 0.5], gray[0] = np.nan, -np.inf
        found, made = surface_of(volume_of(gray))
        check_promise(made.mesh, cavities=found.cavities)
        assert found.cavities == 1
        assert np.isfinite(found.crossings.positions).all()

    def test_of_colors_the_first_to_leave_the_window_counts(self) -> None:
        gray = ball(8).voxels
        _, plain = surface_of(volume_of(gray))
        _, colored = surface_of(volume_of(np.stack([gray, gray + 0.2, np.full(gray.shape, 1.0)], axis=3)))
        np.testing.assert_allclose(plain.mesh.vertices, colored.mesh.vertices, atol=1e-12)

    def test_the_surface_of_masks_is_as_surface_nets_have_it(self) -> None:
        """A vertex in every mixed cell, and a square for every face: VTK counts the same."""
        core, data = (pytest.importorskip(f"vtkmodules.{name}") for name in ("vtkFiltersCore", "vtkCommonDataModel"))
        from vtkmodules.util.numpy_support import numpy_to_vtk

        gray = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(14, 15, 16)), 1.5)
        joined = without_contacts(np.pad(gray > 0, 1), lambda voxels: np.zeros(len(voxels)))
        found = boundary(volume_of(joined.astype(np.uint8)), joined, lower=0.5)
        image = data.vtkImageData()
        image.SetDimensions(*joined.shape[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(joined.ravel().astype(np.uint8), deep=True))
        peer = core.vtkSurfaceNets3D()
        peer.SetInputData(image)
        peer.SetValue(0, 1)
        peer.SmoothingOff()
        peer.SetOutputMeshTypeToQuads()
        peer.Update()
        assert peer.GetOutput().GetNumberOfPoints() == len(found.net.low)
        assert peer.GetOutput().GetNumberOfCells() == len(found.net.quads)

    def test_what_would_not_fit_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.isosurface.well_composed.MOST_CELLS", 100)
        with pytest.raises(ResourceError, match="too large") as refused:
            reconstruct(ball(6), lower=0.0, network="none")
        assert refused.value.exit_code == 7

    def test_an_empty_window_is_refused(self) -> None:
        with pytest.raises(EmptyError):
            reconstruct(ball(6), lower=5.0, network="none")
