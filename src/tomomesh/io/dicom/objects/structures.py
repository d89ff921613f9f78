"""DICOM RT Structure Sets: the closed contours of structures as rings of points, each with its slice."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ....errors import EmptyError, FormatError, GeometryError, ResourceError, TomomeshError, UsageError
from ....measure.polygon import side_lengths
from ....model.points import NEURON, RING, STRUCTURE, PointSet
from ...files.source import counted, third_party
from ...names import shown
from ..headers.dataset import read_dataset
from ..headers.kinds import STRUCTURES, storage_class
from .contours import CLOSED, OPEN, corners_of, ends_meet
from .planes import directions, planes_of
from .rings import filled, parted, pieces_of, thinned

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ....settings import CloudSettings

    Floats = NDArray[np.float64]

FINEST, FINE = 0.1, 0.3
"""Distances of the points on a contour, in distances of the slices: corners that are nearer are left out; longer sides
get points. Chosen, on a torus: half of the first changes the distance by -6 %, twice by +18 %; half of the other by
-23 %, twice by +58 %."""
ALL = "all"
"""What stands for every structure that has closed contours."""
MOST_POINTS = 20_000_000
"""Points that a structure may have: their positions alone are half a gigabyte."""


@dataclass(frozen=True)
class Structure:
    """A structure of the set.

    Attributes
    ----------
    number : int
        Its number in the table, from 1.
    name : str
        As the file has it.
    contours : list of pydicom Dataset
        Those that are closed, or whose ends meet.
    met : int
        How many are said to be open.
    others : Counter
        How many others there are, by their kind.
    """

    number: int
    name: str
    contours: list[Any]
    met: int
    others: Counter[str]

    def __str__(self) -> str:
        return f"{self.number}: {shown(self.name)}"


def read_structure(path: Path, settings: CloudSettings) -> PointSet:
    """Read the closed planar contours of one structure.

    Parameters
    ----------
    path : Path
    settings : CloudSettings
        `structure` chooses, where there are several.

    Returns
    -------
    PointSet
        Points along the contours, in millimeters, LPS; the slices rise along the normal of the contours' planes, and
        the attribute ``ring`` tells the contours of a slice apart. Contours within others are holes.

    Raises
    ------
    FormatError
        For a broken file, and a contour that is; it names the contour.
    GeometryError
        Where a structure must be chosen, or its contours do not lie in parallel planes.
    EmptyError
        Where the structure has no closed contours, or all on one slice.
    UsageError
        For a structure that there is not.
    ResourceError
        Where the contours are so long beside the distance of the slices that their points would not fit.
    """
    if storage_class(path) != STRUCTURES:
        raise FormatError(
            "the DICOM file holds no contours", file=str(path), expected="an RT Structure Set",
            hint="tomomesh reconstruct, for slices and segmentations",
        )  # fmt: skip
    structures = _listed(path)
    taken = _chosen(structures, settings.structure, file=str(path))
    read = [_read(one, path, len(structures), settings) for one in taken]
    points = reduce(_stacked, (points for points, _ in read))
    return replace(points, frame="LPS", unit="mm", notes=tuple(note for _, notes in read for note in notes))


def _read(taken: Structure, path: Path, of: int, settings: CloudSettings) -> tuple[PointSet, list[str]]:
    """Return the points of one structure, and what is to be told of it."""
    with third_party("pydicom", path.name):
        where = f"structure {taken.number}"
        corners = corners_of(taken.contours, where=where, file=path.name, skip_flat=settings.skip_flat)
    told = f"structure {taken} of {of}, {len(corners)} contours"
    if ways := directions(corners):
        notes = [f"{told} in planes of {ways} directions: their points are taken as a cloud"]
        points = _points(corners, np.zeros(len(corners), np.int64), _side(corners) / FINE, file=str(path))
        points = PointSet.from_positions(points.positions)
    else:
        planes = planes_of(corners, file=str(path), thickness=settings.thickness)
        notes = [f"{told} on {planes.slices} slices"]
        points = _points(corners, planes.labels, planes.apart, file=str(path))
        number = np.full(len(points), taken.number, np.int32)
        points = replace(points, attributes={**points.attributes, STRUCTURE: number})
    if taken.met:
        notes.append(f"open contours whose ends meet, taken as closed: {taken.met}")
    if taken.others:
        notes.append(f"contours that are not closed, left out: {counted(taken.others)}")
    if flat := len(taken.contours) - len(corners):
        notes.append(f"contours that enclose nothing, left out: {flat}")
    return points, notes


def _stacked(one: PointSet, other: PointSet) -> PointSet:
    """Append the points of another structure, whose planes get numbers of their own."""
    return one.joined(replace(other, slices=other.slices + one.slices.max() + 1))


def _listed(path: Path) -> list[Structure]:
    """Return the structures in the order of the file."""
    with third_party("pydicom", path.name):
        data = read_dataset(path)
        drawn: dict[str, list[Any]] = {}
        for one in data.get("ROIContourSequence") or []:
            drawn.setdefault(str(one.get("ReferencedROINumber")), []).extend(one.get("ContourSequence") or [])
        return [
            _structure(n, str(one.get("ROIName") or ""), drawn.get(str(one.get("ROINumber")), []))
            for n, one in enumerate(data.get("StructureSetROISequence") or [], 1)
        ]


def _structure(number: int, name: str, items: Sequence[Any]) -> Structure:
    kinds = [str(item.get("ContourGeometricType") or "").strip().upper() or "no type" for item in items]
    met = [kind == OPEN and ends_meet(item) for item, kind in zip(items, kinds, strict=True)]
    closed = [kind in CLOSED or one for kind, one in zip(kinds, met, strict=True)]
    others = Counter(shown(kind) for kind, one in zip(kinds, closed, strict=True) if not one)
    return Structure(number, name, [item for item, one in zip(items, closed, strict=True) if one], sum(met), others)


def _chosen(structures: list[Structure], wanted: str | None, *, file: str) -> list[Structure]:
    """Return the structures that are wanted, or the only one that has closed contours."""
    closed = [one for one in structures if one.contours]
    if wanted is None and len(closed) == 1:
        return closed
    if wanted is not None and wanted.strip() == ALL and closed:
        return closed
    if wanted is None:
        if closed:
            _refuse_several(f"the file holds {len(closed)} structures", structures, file)
        raise _no_contours(structures, file)
    if found := _named(structures, wanted):
        return [_only(found, structures, file)]
    each = [_named(structures, name) for name in wanted.split(",")]
    if not all(each):
        raise UsageError(
            "there is no such structure", file=file, found=_table(structures, file),
            expected="--structure with a number or a name of the table",
        )  # fmt: skip
    chosen = {one.number: one for one in (_only(found, structures, file) for found in each)}
    return [chosen[number] for number in sorted(chosen)]


def _named(structures: list[Structure], wanted: str) -> list[Structure]:
    """Return the structure of a number, else those of a name."""
    found = [one for one in structures if str(one.number) == wanted.strip()]
    return found or [one for one in structures if wanted.strip() in (one.name.strip(), shown(one.name))]


def _only(found: list[Structure], structures: list[Structure], file: str) -> Structure:
    """Return the structure that is found, where it is one that has closed contours."""
    if len(found) > 1:
        _refuse_several("several structures could be meant", structures, file)
    if not found[0].contours:
        raise _no_contours(found, file)
    return found[0]


def _refuse_several(what: str, structures: list[Structure], file: str) -> NoReturn:
    raise GeometryError(
        what, file=file, found=_table(structures, file), expected="one structure, or several by their numbers",
        hint="--structure N, --structure N,M or --structure all",
    )  # fmt: skip


def _no_contours(listed: list[Structure], file: str) -> EmptyError:
    found = _table(listed, file) or "0 structures"
    return EmptyError("there are no closed contours", file=file, found=found, expected=" or ".join(CLOSED))


def _table(structures: list[Structure], file: str) -> str:
    """Put structures into words: number, name, contours, slices, and what else there is where that is all."""
    return "; ".join(
        f"{one}, contours {len(one.contours)}, slices {_slices(one, file)}"
        + (f", {counted(one.others)}" if one.others and not one.contours else "")
        for one in structures
    )


def _slices(structure: Structure, file: str) -> str:
    if len(structure.contours) < 2:
        return str(len(structure.contours))
    try:
        with third_party("pydicom", file):
            corners = corners_of(structure.contours, where="", file=file, skip_flat=True)
            return str(planes_of(corners, file=file).slices)
    except EmptyError:
        return "1"
    except TomomeshError:
        return "unknown"


def _side(contours: list[Floats]) -> float:
    """Return the median side of contours (u, 3)."""
    return float(np.median(np.concatenate([side_lengths(one) for one in contours])))


def _points(contours: list[Floats], labels: NDArray[np.int64], apart: float, *, file: str) -> PointSet:
    """Draw contours as points as far apart as their corners are as a rule, as is fit for slices that far `apart`."""
    rings = [
        (thinned(ring, FINEST * apart), int(label))
        for contour, label in zip(contours, labels, strict=True)
        for ring in parted(contour)
    ]
    rings.sort(key=lambda one: one[1])
    distance = min(_side([ring for ring, _ in rings]), FINE * apart)
    pieces = [pieces_of(ring, distance) for ring, _ in rings]
    if (total := sum(float(one.sum()) for one in pieces)) > MOST_POINTS:
        raise ResourceError(
            "the contours are too long beside the distance of their points", file=file,
            found=f"{total:.3g} points {distance:.3g} mm apart", expected=f"at most {MOST_POINTS}",
        )  # fmt: skip
    drawn = [filled(ring, one.astype(np.int64)) for (ring, _), one in zip(rings, pieces, strict=True)]
    lengths, slices = [len(one) for one in drawn], np.array([label for _, label in rings])
    numbers = np.arange(len(rings)) - np.searchsorted(slices, slices)
    count = sum(lengths)
    return PointSet(
        np.concatenate(drawn),
        np.repeat(slices, lengths).astype(np.int32),
        np.concatenate([np.arange(n) for n in lengths]).astype(np.int32),
        np.full(count, NEURON, np.uint8),
        {RING: np.repeat(numbers, lengths).astype(np.int32)},
    )
