"""Which columns of a table are the positions, by what they are called, and in what unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import FormatError
from ...model.units import unit_named
from ..fields import AXES

if TYPE_CHECKING:
    from collections.abc import Sequence

LETTER = re.compile(r"(?:p|pos|position|point|coord|coordinate)?([xyz])(?:pos|position|coord|coordinate)?")
"""A coordinate's name without its unit and marks: ``x``, ``px``, ``pos_x``, ``XCoord``."""

EAST = frozenset({"east", "easting", "e", "rechtswert", "ostwert"})
NORTH = frozenset({"north", "northing", "n", "hochwert", "nordwert"})
UP = frozenset({"height", "h", "elevation", "elev", "altitude", "alt", "z", "up", "höhe", "hoehe"})
LONGITUDE, LATITUDE = frozenset({"lon", "long", "lng", "longitude"}), frozenset({"lat", "latitude"})
TRIPLES: tuple[tuple[frozenset[str], ...], ...] = (
    *(tuple(frozenset({word}) for word in words) for words in (AXES, ("r", "a", "s"), ("l", "p", "s"))),
    *(tuple(frozenset({f"{word}{n}"}) for n in range(3)) for word in ("points", "coords", "coordinates")),
    (EAST, NORTH, UP),
    (LONGITUDE, LATITUDE, UP),
    (frozenset({"axis2"}), frozenset({"axis1"}), frozenset({"axis0"})),
)
"""What the three are called together: coordinates, a patient's axes, ParaView's columns, a surveyor's, napari's, which
count from the slowest."""

FRAMES = {frozenset("r"): "RAS", frozenset("l"): "LPS"}
"""The frame of a patient's axes, by the first of them."""

NO_LENGTHS = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "degree"),
    **dict.fromkeys(("px", "pixel", "pixels", "voxel", "voxels"), "voxel"),
}
"""Words for units that are no lengths, to their names."""

NAME = re.compile(r"(?P<name>.*?)[\s_]*(?:[\[(/]\s*(?P<marked>[^\])]*?)\s*[\])]?|_(?P<behind>[a-zµμ]+))?")
"""A column's name and unit: ``x``, ``X_mm``, ``x [m]``, ``East (ft)``."""


@dataclass(frozen=True)
class PositionColumns:
    """The columns of the positions, from 0, their unit and frame where named, and what is to be told about them."""

    axes: tuple[int, ...] = (0, 1, 2)
    unit: str | None = None
    notes: tuple[str, ...] = ()
    frame: str | None = None


def positions_among(names: Sequence[str], *, file: str) -> PositionColumns:
    """Find the columns of the positions; the first three where there are no names, or no more than three.

    Raises
    ------
    FormatError
        Where more than three columns have names, and none say which are the positions.
    """
    if not names:
        return PositionColumns()
    found = named_positions(names)
    if found:
        return found
    if len(names) > 3:
        raise FormatError(
            "the columns do not say which are x, y and z", file=file, found=f"columns = {', '.join(names)[:200]}",
            expected="three columns named x, y and z",
        )  # fmt: skip
    return PositionColumns(notes=(f"the columns {', '.join(names)} were taken as x, y and z",))


def named_positions(names: Sequence[str]) -> PositionColumns | None:
    """Find the columns that names say are the positions; None where they say nothing."""
    plain, units = [_parted(name)[0] for name in names], [_parted(name)[1] for name in names]
    for triple in TRIPLES:
        places = [next((n for n, name in enumerate(plain) if name in words), -1) for words in triple]
        if min(places) >= 0 and len(set(places)) == 3:
            named = {units[place] for place in places}
            if triple[0] is LONGITUDE:
                return PositionColumns(tuple(places), "degree")
            frame = FRAMES.get(triple[0])
            if len(named) == 1:
                return PositionColumns(tuple(places), named.pop(), frame=frame)
            told = ", ".join(sorted(unit or "none" for unit in named))
            notes = (f"the columns name several units, {told}: none was taken",)
            return PositionColumns(tuple(places), notes=notes, frame=frame)
    return None


def _parted(name: str) -> tuple[str, str | None]:
    """Return a name in small letters without marks, a coordinate's as its letter, and the unit behind it."""
    word = name.strip().lower()
    found = NAME.fullmatch(word)
    marked = (found and (found["marked"] or found["behind"])) or ""
    unit = NO_LENGTHS.get(marked) or unit_named(marked)
    base = found["name"] if found and (unit or found["marked"] is not None) else word
    plain = re.sub(r"[\s_.:-]+", "", base)
    letter = LETTER.fullmatch(plain)
    return letter[1] if letter else plain, unit
