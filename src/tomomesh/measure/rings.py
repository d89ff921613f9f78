"""The measures of all contours of a study, as its report has them."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.contours import BIRTH, BRANCH, DEATH, MERGE, SIDES
from .contour import ContourMeasures, crossings_between, measure_contour
from .polygon import side_lengths

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.contours import Contour, Contours

    Floats = NDArray[np.float64]


def assess_contours(contours: Contours, pixel_mm: tuple[float, float], *, closed: bool = True) -> dict[str, Any]:
    """Measure the contours of a study, in millimeters.

    Parameters
    ----------
    contours : Contours
        One at least.
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    closed : bool
        Whether they are rings.

    Returns
    -------
    dict
        Its keys are those of the section ``rings`` in docs/report.md.
    """
    lines = [one.codebook * pixel_mm for one in contours.contours]
    found = [
        measure_contour(line, closed=closed, bridged=one.bridged)
        for line, one in zip(lines, contours.contours, strict=True)
    ]
    between = sum(
        _between([line for _, line in group])
        for _, group in groupby(zip(contours.contours, lines, strict=True), key=lambda pair: pair[0].slice)
    )
    return {
        "kind": contours.kind,
        "count": len(contours),
        "dropped": contours.dropped,
        "neurons": sum(map(len, contours.contours)),
        "self_crossings": sum(one.self_crossings for one in found),
        "crossings": between,
        "closure_gap_mm": max(one.closure_gap for one in found),
        "longest_over_median": max(one.longest_over_median for one in found),
        "evenness": float(np.median([one.evenness for one in found])),
        "bridged_gaps": [
            gap
            for one, line in zip(contours.contours, lines, strict=True)
            for gap in _gaps(one, side_lengths(line, closed=closed))
        ],
        "tracks": contours.tracks,
        "births": contours.count(BIRTH),
        "deaths": contours.count(DEATH),
        "branches": contours.count(BRANCH),
        "merges": contours.count(MERGE),
        "events": [asdict(event) for event in contours.events if event.kind in (BRANCH, MERGE)],
        "each": _table(contours.contours, found),
    }


def _between(lines: list[Floats]) -> int:
    """Count how often the rings of one slice cross each other."""
    return int(np.triu(crossings_between(lines), 1).sum()) if len(lines) > 1 else 0


def _gaps(one: Contour, lengths: Floats) -> list[dict[str, Any]]:
    """Name the gaps that a contour bridges; sides that bridge one after the other are of one gap."""
    sides = np.flatnonzero(one.bridged)
    if not len(sides):
        return []
    runs = np.split(sides, np.flatnonzero(np.diff(sides) > 1) + 1)
    if len(runs) > 1 and len(lengths) == len(one) and runs[0][0] == 0 and runs[-1][-1] == len(lengths) - 1:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]
    median = max(float(np.median(lengths)), 1e-300)
    return [
        {
            "slice": one.slice,
            "ring": one.ring,
            "neuron": int(run[0]),
            "length_mm": float(lengths[run].sum()),
            "over_median": float(lengths[run].sum() / median),
        }
        for run in runs
    ]


def _table(contours: tuple[Contour, ...], found: list[ContourMeasures]) -> dict[str, list[Any]]:
    """Return one list a measure, one entry a contour."""
    return {
        "slice": [one.slice for one in contours],
        "ring": [one.ring for one in contours],
        "side": [SIDES[one.side] for one in contours],
        "track": [one.track for one in contours],
        "neurons": [len(one) for one in contours],
        "perimeter_mm": [one.perimeter for one in found],
        "area_mm2": [one.area for one in found],
        "closure_gap_mm": [one.closure_gap for one in found],
        "self_crossings": [one.self_crossings for one in found],
        "longest_over_median": [one.longest_over_median for one in found],
        "evenness": [one.evenness for one in found],
    }
