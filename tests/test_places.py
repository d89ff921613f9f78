"""An asymmetric phantom in every input format: its surfaces come back in the patient's millimeters, not mirrored."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from studies import affine_of, indices_of, rotation
from tomomesh import reconstruct
from tomomesh.cli import main
from tomomesh.io import read_mesh, read_volume
from tomomesh.settings import ReadSettings
from writers import (
    with_itk,
    with_nibabel,
    with_numpy,
    with_ome_tiff,
    with_pillow,
    with_pydicom,
    with_pynrrd,
    with_qform,
    with_tifffile,
    with_zarr,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh
    from writers import Writer

SHAPE = (24, 24, 24)
SPACING = (1.0, 1.2, 1.5)
LEVEL = 120
CENTERS = np.array([[9.0, 16.0, 16.0], [17.0, 8.0, 10.0], [6.0, 7.0, 6.0], [18.0, 18.0, 5.0]])
"""Indices (i, j, k) of four balls, no two of a size, that no turn brings onto their mirror image."""
RADII = np.array([4.8, 3.8, 3.0, 2.4])


def centers_of(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where the balls are, in patient millimeters."""
    return np.asarray(CENTERS @ affine[:3, :3].T + affine[:3, 3])


def balls(affine: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return gray levels (K, J, I) that fall by 30 a millimeter through `LEVEL` at the balls' surfaces."""
    places = indices_of(SHAPE) @ affine[:3, :3].T + affine[:3, 3]
    away = np.linalg.norm(places[:, None] - centers_of(affine), axis=2) - RADII
    gray = np.rint(LEVEL - 30 * away.min(axis=1)).clip(0, 255)
    return np.asarray(gray.astype(np.uint8).reshape(SHAPE))


def placed(directions: Any) -> NDArray[np.float64]:
    return affine_of(np.asarray(directions, np.float64), SPACING, (-30.0, 41.0, -7.0))


TURN = rotation(0.2, -0.3, 0.4)
TILT = np.array([[1.0, 0, 0], [0, 1, np.sin(0.32)], [0, 0, np.cos(0.32)]])
OBLIQUE, AXIAL = placed(TURN), placed(np.eye(3))
SHEARED = placed(TURN @ [[1.0, 0.1, 0], [0, 1, 0.3], [0, 0, 1]])
LEFT_HANDED = placed(TURN @ np.diag([1.0, -1.0, 1.0]))
FEET_FIRST = placed(np.diag([1.0, 1.0, -1.0]))
SAGITTAL = placed([[0.0, 0, 1], [1, 0, 0], [0, -1, 0]])
BARE = np.diag([*SPACING, 1.0])

CASES: dict[str, tuple[Writer, NDArray[np.float64]]] = {
    "DICOM": (with_pydicom, AXIAL),
    "DICOM oblique": (with_pydicom, OBLIQUE),
    "DICOM sagittal": (with_pydicom, SAGITTAL),
    "DICOM with a tilted gantry": (with_pydicom, placed(TILT)),
    "DICOM tilted and turned": (with_pydicom, placed(TURN @ TILT)),
    "DICOM from the head to the feet": (with_pydicom, FEET_FIRST),
    "NIfTI oblique": (with_nibabel(".nii.gz"), OBLIQUE),
    "NIfTI sheared": (with_nibabel(".nii"), SHEARED),
    "NIfTI left-handed": (with_nibabel(".nii"), LEFT_HANDED),
    "NIfTI by its qform": (with_qform, OBLIQUE),
    "NIfTI left-handed by its qform": (with_qform, LEFT_HANDED),
    "NIfTI pair": (with_nibabel(".hdr"), OBLIQUE),
    "NIfTI pair sheared": (with_nibabel(".hdr"), SHEARED),
    "MGH": (with_nibabel(".mgh"), OBLIQUE),
    "MGZ left-handed": (with_nibabel(".mgz"), LEFT_HANDED),
    "NRRD": (with_itk(".nrrd", True), OBLIQUE),
    "NRRD sheared": (with_pynrrd(".nrrd"), SHEARED),
    "NHDR": (with_itk(".nhdr"), LEFT_HANDED),
    "NHDR sheared": (with_pynrrd(".nhdr"), SHEARED),
    "MHA": (with_itk(".mha", True), OBLIQUE),
    "MHD": (with_itk(".mhd"), LEFT_HANDED),
    "OME-TIFF": (with_ome_tiff, BARE),
    "TIFF": (with_tifffile, BARE),
    "TIFF stack": (with_pillow(".tif"), BARE),
    "PNG stack": (with_pillow(".png"), BARE),
    "JPEG stack": (with_pillow(".jpg"), BARE),
    "NPY": (with_numpy, BARE),
    "OME-Zarr 0.4": (with_zarr(2), AXIAL),
    "OME-Zarr 0.5": (with_zarr(3), AXIAL),
}
"""How each is written, and where its voxels are."""

NO_SPACING = ("TIFF", "TIFF stack", "PNG stack", "JPEG stack", "NPY")


def pieces_of(mesh: TriMesh) -> list[trimesh.Trimesh]:
    """Return the closed pieces of a mesh, the largest first, by trimesh."""
    pieces = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).split(only_watertight=False)
    return sorted(pieces, key=lambda piece: -piece.volume)


def turn_of(centers: NDArray[np.float64]) -> float:
    """Return the triple product of four places: its sign changes in the mirror."""
    return float(np.linalg.det(centers[1:] - centers[0]))


@pytest.mark.parametrize("case", CASES)
def test_every_ball_is_where_the_patient_has_it(tmp_path: Path, case: str) -> None:
    write, affine = CASES[case]
    study = write(tmp_path, balls(affine), affine)
    settings = ReadSettings(spacing=SPACING if case in NO_SPACING else None)
    pieces = pieces_of(reconstruct(read_volume(study, settings=settings), network="none", lower=float(LEVEL)).mesh)
    found, truth = np.array([piece.center_mass for piece in pieces]), centers_of(affine)
    assert len(pieces) == len(CENTERS)
    assert min(piece.volume for piece in pieces) > 0
    assert np.sign(turn_of(found)) == np.sign(turn_of(truth))
    assert (
        np.abs(np.linalg.solve(affine[:3, :3], (found - truth).T)).max() < 0.1
    )  # of a voxel; half of one is asked for
    for piece, center, radius in zip(pieces, truth, RADII, strict=True):
        assert np.abs(np.linalg.norm(piece.vertices - center, axis=1) - radius).max() < 0.5 * min(SPACING)


@pytest.mark.parametrize("case", ["DICOM oblique", "NIfTI pair", "PNG stack", "NPY", "OME-Zarr 0.5"])
def test_the_command_line_puts_them_there_too(tmp_path: Path, case: str) -> None:
    write, affine = CASES[case]
    (tmp_path / "in").mkdir()
    study = write(tmp_path / "in", balls(affine), affine)
    flags = ["--spacing", *map(str, SPACING)] if case in NO_SPACING else []
    mesh = tmp_path / "balls.ply"
    words = ["reconstruct", str(study), "-o", str(mesh), "--network", "none", "--lower", str(LEVEL), *flags]
    assert main(words) == 0
    found = [piece.center_mass for piece in pieces_of(read_mesh(mesh))]
    np.testing.assert_allclose(found, centers_of(affine), atol=0.1)


@pytest.mark.parametrize("suffix", [".nii", ".nrrd", ".mha", "DICOM"])
@pytest.mark.parametrize("order", [(0.5, 0.7, 2.0), (0.7, 0.5, 2.0), (2.0, 0.7, 0.5)])
def test_a_sphere_of_voxels_that_are_no_cubes_stays_a_sphere(
    tmp_path: Path, suffix: str, order: tuple[float, float, float]
) -> None:
    write = {".nii": with_nibabel(".nii"), ".nrrd": with_itk(".nrrd"), ".mha": with_itk(".mha"), "DICOM": with_pydicom}
    shape = tuple(round(26 / size) for size in reversed(order))
    affine = affine_of(TURN, order)
    center = (np.array(shape[::-1]) - 1) / 2 @ affine[:3, :3].T + affine[:3, 3]
    places = indices_of((shape[0], shape[1], shape[2])) @ affine[:3, :3].T + affine[:3, 3]
    stored = np.rint(1000 - 50 * np.linalg.norm(places - center, axis=1)).reshape(shape).astype(np.int16)
    study = write[suffix](tmp_path, stored, affine)
    mesh = reconstruct(read_volume(study), network="none", lower=500.0).mesh
    assert np.abs(np.linalg.norm(mesh.vertices - center, axis=1) - 10).max() < 0.25  # half of the finest voxel


def test_the_judge_sees_a_mirror() -> None:
    truth = centers_of(OBLIQUE)
    assert np.sign(turn_of(truth * [-1, 1, 1])) != np.sign(turn_of(truth))
