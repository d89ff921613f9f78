"""What the gray levels of some frames are in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...names import shown
from .kinds import class_of
from .multiframe import DOSE, STORAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .header import ImageFrame

HOUNSFIELD, STORED = "HU", "stored"
NAMED = {
    "US": "unspecified", "OD": "thousandths of optical density", "MGML": "mg/ml", "PCT": "percent",
    "HU_MOD": "modified HU", "Z_EFF": "effective atomic number", "ED": "1e23 electrons/ml",
    "EDW": "electron density of water",
}  # fmt: skip
"""Values of RescaleType that are not HU, in words (PS3.3, C.11.1.1.2)."""
CAPTURES = tuple(f"{STORAGE}7{kind}" for kind in ("", ".1", ".2", ".3", ".4"))
"""Storage classes of secondary captures: pictures of a screen, among others."""


def gray_unit(frames: Sequence[ImageFrame]) -> tuple[str, tuple[str, ...]]:
    """Return what the gray levels of a series are in, and a note where a CT is not in Hounsfield units.

    Parameters
    ----------
    frames : sequence of ImageFrame
        Of one series.
    """
    header = frames[0].header
    if class_of(header) == DOSE:
        unit = "Gy" if header.get("DoseUnits", "GY") == "GY" else "relative dose"
        return unit, (f"a dose: gray levels are in {unit}",)
    if header.get("Modality") != "CT":
        return STORED, ()
    if int(header.get("SamplesPerPixel") or 1) > 1 or header.get("PhotometricInterpretation") == "PALETTE COLOR":
        return STORED, ("CT in color: its levels are not Hounsfield units",)
    if class_of(header) in CAPTURES and "RescaleSlope" not in header:
        return STORED, ("a secondary capture without a scale: its levels are not Hounsfield units",)
    others = sorted({_kind(frame) for frame in frames} - {HOUNSFIELD})
    if not others:
        return HOUNSFIELD, ()
    note = f"RescaleType = {shown(', '.join(others))}: the gray levels are not Hounsfield units"
    if others == ["US"] and _by_gdcm(header):
        note += ", or may be: GDCM, by which ITK writes DICOM, says so where it was told nothing"
    return NAMED.get(others[0], shown(others[0])), (note,)


def _by_gdcm(header: Any) -> bool:
    return str(getattr(header, "file_meta", {}).get("ImplementationVersionName") or "").startswith("GDCM")


def _kind(frame: ImageFrame) -> str:
    """Return what a frame's scale or table gives; Hounsfield units where a CT does not say."""
    tables = frame.header.get("ModalityLUTSequence") or []
    said = tables[0].get("ModalityLUTType") if tables else frame.rescale_type
    return str(said or "").strip().upper() or HOUNSFIELD
