"""DICOM RT Structure Sets: contours of known solids, cut by parallel planes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ImplicitVRLittleEndian, RTStructureSetStorage

from segmentations import item
from studies import save

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Contours = list[Floats]


def circle(radius: float, z: float, corners: int = 72, center: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return the corners (u, 3) of a polygon in a circle, of the circle's own area."""
    angle = 2 * np.pi * np.arange(corners) / corners
    outer = radius * np.sqrt(2 * np.pi / corners / np.sin(2 * np.pi / corners))
    x, y = center[0] + outer * np.cos(angle), center[1] + outer * np.sin(angle)
    return np.stack([x, y, np.full(corners, z)], axis=1)


def sphere(radius: float = 20.0, step: float = 3.0, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Contours:
    """Return the contours of a ball."""
    heights = np.arange(-radius + step / 2, radius, step)
    return [
        circle(float(np.sqrt(radius**2 - z**2)), center[2] + z, center=center[:2])
        for z in heights.tolist()
        if radius**2 > z**2
    ]


def torus(ring: float = 20.0, tube: float = 8.0, step: float = 2.0) -> list[tuple[Floats, Floats]]:
    """Return the outer and the inner contour of a torus about the z axis on each plane."""
    widths = [(float(np.sqrt(tube**2 - z**2)), z) for z in np.arange(-tube + step / 2, tube, step).tolist()]
    return [(circle(ring + width, z), circle(ring - width, z)) for width, z in widths]


def keyhole(outer: Floats, inner: Floats) -> Floats:
    """Join two contours by a slit."""
    return np.concatenate([outer, outer[:1], inner[:1], inner[:0:-1], inner[:1], outer[:1]])


def structure_set(structures: dict[str, Any], kind: str = "CLOSED_PLANAR") -> Dataset:
    """Return a structure set; contours are corners (u, 3), or pairs of a kind and corners."""
    data = Dataset()
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = RTStructureSetStorage
    data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = "1.2.3.9"
    data.Modality, data.PatientName, data.PatientID = "RTSTRUCT", "Secret^Name", "SECRET-ID"
    data.SpecificCharacterSet = "ISO_IR 192"
    numbers = [10 * n for n in range(len(structures), 0, -1)]  # neither rising nor from 1
    data.StructureSetROISequence = Sequence(
        [item(ROINumber=n, ROIName=name) for n, name in zip(numbers, structures, strict=True)]
    )
    data.ROIContourSequence = Sequence(
        [
            item(ReferencedROINumber=n, ContourSequence=Sequence([contour(one, kind) for one in contours]))
            for n, contours in zip(numbers, structures.values(), strict=True)
        ]
    )
    return data


def contour(corners: Any, kind: str) -> Dataset:
    """Return an item of a contour sequence."""
    kind, corners = corners if isinstance(corners, tuple) else (kind, corners)
    values = [float(f"{value:.4f}") for value in np.ravel(corners)]
    return item(ContourGeometricType=kind, NumberOfContourPoints=len(corners), ContourData=values)


def written(structures: dict[str, Any], path: Path, kind: str = "CLOSED_PLANAR") -> Path:
    """Write a structure set."""
    return save(structure_set(structures, kind), path)
