"""Labels on the grid of a study's own file, as NIfTI: LPS becomes RAS here."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OutputError
from ..files.atomic import check_output, replacing
from ..files.source import suffix_of
from .nifti_frame import FLIP

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.volume import Volume

LABEL_WRITERS = (".nii", ".nii.gz")
"""Suffixes in which labels are written."""

SHEARED = 1e-4
"""Part of a voxel by which a qform may be off the affine, for each index: over 1,000 voxels a tenth of one."""
LARGEST_SIDE = 32767
"""NIfTI-1 keeps its sizes in 16 bits with a sign."""


def write_labels(labels: NDArray[np.unsignedinteger[Any]], volume: Volume, path: str | Path) -> None:
    """Write labels on the grid of the study's own file, as NIfTI.

    Parameters
    ----------
    labels : (K, J, I) uint8 or uint16 array
        In the order of ``volume.voxels``.
    volume : Volume
        The study; its `grid` says how the file stores its voxels.
    path : path
        ``.nii`` or ``.nii.gz``. The bytes repeat: no name and no time is kept.

    Raises
    ------
    UsageError
        For a suffix that has no writer.
    OutputError
        Where the file cannot be written, or a side is too long for NIfTI-1.
    """
    check_output(path, LABEL_WRITERS)
    import nibabel

    stored = np.asarray(volume.grid.restore(labels), np.uint16).T
    if max(stored.shape) > LARGEST_SIDE:
        raise OutputError(
            "the labels do not fit into a NIfTI file",
            file=str(path),
            found=f"shape = {stored.shape}",
            expected=f"sides of at most {LARGEST_SIDE}",
        )
    image = nibabel.Nifti1Image(stored, None)
    _place(image.header, FLIP @ volume.grid.affine)
    data = image.to_bytes()
    with replacing(path) as file:
        if suffix_of(path) == ".nii.gz":
            with gzip.GzipFile(filename="", fileobj=file, mode="wb", mtime=0) as packed:
                packed.write(data)
        else:
            file.write(data)


def _place(header: Any, affine: NDArray[np.float64]) -> None:
    """Write an affine, RAS, as both forms: readers differ in the one that they take, and some take the zooms alone.

    A qform holds no shear; beside a sheared affine, as that of a tilted gantry, none is written.
    """
    header.set_sform(affine, code="scanner")
    header.set_qform(affine, code="scanner", strip_shears=True)
    header.set_xyzt_units("mm")
    if not np.allclose(header.get_qform(), affine, rtol=0, atol=SHEARED * min(header.get_zooms())):
        header.set_qform(None, code="unknown")
        header.set_zooms(np.sqrt((affine[:3, :3] ** 2).sum(axis=0)))
