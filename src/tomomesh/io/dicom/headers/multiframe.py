"""Files of several frames that no functional groups describe: where each frame is, or what it is, if no slice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from .kinds import class_of
from .values import numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PER_FRAME, SHARED = "PerFrameFunctionalGroupsSequence", "SharedFunctionalGroupsSequence"
PLACES = ("PlanePositionSequence", "PlanePositionVolumeSequence")
"""Functional groups that say where a frame is."""
DOSE = "1.2.840.10008.5.1.4.1.1.481.2"
"""The storage class of RT Dose."""
NUCLEAR = ("1.2.840.10008.5.1.4.1.1.20", "1.2.840.10008.5.1.4.1.1.5")
"""Storage classes of nuclear medicine, today's and the retired one."""

PROJECTIONS, TIMES, TILES = "projections", "points in time", "tiles of a slide"
FILMS = {
    "3": TIMES, "3.1": TIMES,  # ultrasound, the first retired
    "12.1": PROJECTIONS, "12.1.1": PROJECTIONS,  # X-ray angiography
    "12.2": PROJECTIONS, "12.2.1": PROJECTIONS,  # fluoroscopy
    "12.3": PROJECTIONS, "481.1": PROJECTIONS,  # biplane angiography, retired; RT Image
    "13.1.4": PROJECTIONS, "13.1.5": PROJECTIONS,  # of a breast, before slices are computed from them
    "77.1.1.1": TIMES, "77.1.2.1": TIMES, "77.1.4.1": TIMES,  # videos of endoscopes, microscopes, cameras
    "77.1.6": TILES, "77.1.9": TILES,  # whole slides
}  # fmt: skip
"""What the frames of a storage class are, by the end of its identifier, where they are no slices (PS3.4, B.5)."""
STORAGE = "1.2.840.10008.5.1.4.1.1."

SLICE_VECTORS = ("GridFrameOffsetVector", "SliceVector", "SliceLocationVector")
"""Fields that number frames along the normal, or say how far apart they are."""
EVENLY = ("ImagePositionPatient", "ImageOrientationPatient", "SpacingBetweenSlices")
"""Fields that together say where each frame is, whatever its kind: films have no distance of slices."""
COUNTED = {
    "FrameTime": TIMES, "FrameTimeVector": TIMES, "TimeSliceVector": TIMES, "TimeSlotVector": TIMES,
    "PhaseVector": TIMES, "RRIntervalVector": TIMES, "AngularViewVector": PROJECTIONS, "RotationVector": PROJECTIONS,
}  # fmt: skip
"""What frames are that are counted by a field, where none of `SLICE_VECTORS` counts them too."""
UNRECONSTRUCTED = {"WHOLE BODY": PROJECTIONS, "STATIC": PROJECTIONS, "TOMO": PROJECTIONS, "DYNAMIC": TIMES}
"""What the frames of nuclear medicine are by the third value of their ImageType, where it says nothing of RECON."""

ROUNDED = 0.01
"""How far in mm the first of some offsets may be off the height of the first frame, and still be that height: a hundred
times what headers round away, and no grid of dose is so fine."""


def no_slices(header: Any) -> str:
    """Say what the frames of a file are, and what tells so; nothing where they may be slices."""
    if int(header.get("NumberOfFrames") or 1) < 2:
        return ""
    film = FILMS.get(class_of(header).removeprefix(STORAGE), "")
    if film == TILES or str(header.get("DimensionOrganizationType") or "").startswith("TILED"):
        return TILES
    if any(header.get(vector) for vector in SLICE_VECTORS):
        return ""
    if class_of(header) in NUCLEAR:
        kind = [*(header.get("ImageType") or []), "", "", ""][2]
        words = (word for word in UNRECONSTRUCTED if word in kind and "RECON" not in kind)
        return next((f"{UNRECONSTRUCTED[word]}, ImageType = {word}" for word in words), "")
    if all(header.get(keyword) for keyword in EVENLY):
        return ""
    if film:
        return f"{film}, Modality = {header.get('Modality')}"
    if PER_FRAME in header:
        return ""
    return next((f"{COUNTED[one]}, counted by {one}" for one in counting(header) if one in COUNTED), "")


def counting(header: Any) -> list[str]:
    """Return the keywords of the fields that count the frames of a file."""
    from pydicom.datadict import keyword_for_tag

    tags = header.get("FrameIncrementPointer") or []
    return [keyword_for_tag(tag) for tag in ([tags] if isinstance(tags, int) else list(tags))]


def has_places(header: Any) -> bool:
    """Tell whether functional groups say where frames are; some say other things alone."""
    groups = [*(header.get(PER_FRAME) or []), *(header.get(SHARED) or [])]
    return any(places in group for group in groups for places in PLACES)


def placed_evenly(header: Any) -> bool:
    """Tell whether the distance of the slices alone places frames, in a kind of file that does not define it."""
    several = int(header.get("NumberOfFrames") or 1) > 1 and not has_places(header)
    counted = any(header.get(vector) for vector in SLICE_VECTORS) or class_of(header) in NUCLEAR
    return several and not counted and all(header.get(keyword) for keyword in EVENLY)


def frame_places(header: Any, count: int, first: Floats | None, axes: Floats | None, name: str) -> list[Floats | None]:
    """Return the place of each frame of a file whose functional groups do not say it; None where nothing does.

    Parameters
    ----------
    header : pydicom Dataset
    count : int
        How many frames there are.
    first : (3,) float array or None
        The place of the first, mm, LPS.
    axes : (2, 3) float array or None
        Directions of the columns and of the rows.
    name : str
        The bare name of the file.

    Raises
    ------
    FormatError
        For offsets that are no numbers, too few or too many, or that begin nowhere.
    """
    if first is None or axes is None or count == 1:
        return [first, *([None] * (count - 1))]
    normal = np.cross(*axes)
    with np.errstate(invalid="ignore"):  # directions that are none are refused later on
        normal /= np.linalg.norm(normal)
    offsets = _offsets(header, count, float(first[2]), float(normal[2]), name)
    if offsets is None:
        return [first, *([None] * (count - 1))]
    return [first + offset * normal for offset in offsets]


def _offsets(header: Any, count: int, height: float, up: float, name: str) -> Floats | None:
    """Return how far along the normal each frame is from the first, (f,); None where no field says so.

    Of a dose (PS3.3, C.8.8.3.2) and by slice locations either offsets or heights; of nuclear medicine (C.8.4.15) slice
    numbers, or none, and a distance whose sign is that of the way along the normal.
    """
    vectors = {vector: numbers(header.get(vector), count, vector, name) for vector in SLICE_VECTORS}
    for vector in ("GridFrameOffsetVector", "SliceLocationVector"):
        found = vectors[vector]
        if found is not None:
            return _from_first(found, height, up, f"{vector} = {found[0]:g}, ...", name)
    distance = numbers(header.get("SpacingBetweenSlices"), 1, "SpacingBetweenSlices", name)
    if distance is None or not distance[0]:
        return None
    slices = vectors["SliceVector"]
    return np.asarray(distance[0] * (np.arange(count) if slices is None else slices - slices[0]))


def _from_first(found: Floats, height: float, up: float, words: str, name: str) -> Floats:
    """Return offsets along the normal from offsets that begin with 0, or from heights that begin with the first's."""
    if abs(found[0]) <= ROUNDED:
        return found
    if abs(found[0] - height) <= ROUNDED and abs(up) > 1 - ROUNDED:
        return np.asarray((found - found[0]) * np.sign(up))
    raise FormatError(
        "the frames have no place",
        file=name,
        found=f"{words}, height of the first frame = {height:g} mm",
        expected="offsets from 0, or heights from that of the first frame",
        hint="a corrected header",
    )


def dose_scale(header: Any, name: str) -> tuple[float, float]:
    """Return the scale of a dose.

    Raises
    ------
    FormatError
        Where it has none.
    """
    factor = numbers(header.get("DoseGridScaling"), 1, "DoseGridScaling", name)
    if factor is None:
        raise FormatError("the dose has no scale", file=name, found="DoseGridScaling = missing", hint="a fresh export")
    return float(factor[0]), 0.0
