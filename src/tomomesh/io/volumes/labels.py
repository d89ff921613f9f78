"""Labels on the grid of a study's own file, as NIfTI: LPS becomes RAS here."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OutputError
from ..files.atomic import check_output, replacing
from ..files.source import suffix_of
from .nifti import FLIP

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.volume import Volume

LABEL_WRITERS = (".nii", ".nii.gz")
"""Suffixes in which labels are written."""

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
    image.header.set_sform(FLIP @ volume.grid.affine, code="scanner")
    image.header.set_xyzt_units("mm")
    data = image.to_bytes()
    with replacing(path) as file:
        if suffix_of(path) == ".nii.gz":
            with gzip.GzipFile(filename="", fileobj=file, mode="wb", mtime=0) as packed:
                packed.write(data)
        else:
            file.write(data)
