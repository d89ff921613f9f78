"""Where in an archive a study belongs: never shown, never reported, written where the user asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...files.source import third_party

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .header import ImageFrame

KEYWORDS = (
    "StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID", "PositionReferenceIndicator", "PatientName",
    "PatientID", "PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "StudyID", "AccessionNumber",
    "ReferringPhysicianName",
)  # fmt: skip
"""Fields that tell a study's patient, date and frame of reference."""

OF_ALL = ("StudyInstanceUID", "FrameOfReferenceUID")
"""Those of them that every file must share."""


def identity_of(frames: Sequence[ImageFrame]) -> dict[str, Any]:
    """Return the fields of a study by which a mesh of it is found again, and its ``sources``.

    Parameters
    ----------
    frames : sequence of ImageFrame
        Those that were read.

    Returns
    -------
    dict
        Text by keyword, where the header has it, empty where files differ in one of `OF_ALL`; ``sources`` are the
        storage class and the identifier of each file.
    """
    header, files = frames[0].header, {frame.path: frame.header for frame in frames}
    with third_party("pydicom", frames[0].path.name):
        found: dict[str, Any] = {word: str(header.get(word)) for word in KEYWORDS if header.get(word)}
        found |= {word: "" for word in OF_ALL if len({str(one.get(word)) for one in files.values()}) > 1}
        named = [(one.get("SOPClassUID"), one.get("SOPInstanceUID")) for one in files.values()]
        found["sources"] = tuple((str(kind), str(instance)) for kind, instance in named if kind and instance)
    return found
