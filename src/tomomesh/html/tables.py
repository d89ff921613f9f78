"""A report as tables of keys, values and units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

LISTED = 12
"""Entries of a list that are shown; all are in the report that --report writes. Chosen: one or two lines."""
LEFT_OUT = ("timings", "batch")
"""Sections that differ from run to run: the same input gives the same file."""
POWERS = {"_mm3": "^3", "_mm2": "^2", "_mm": ""}
OTHERS = {"_deg": "deg", "_s": "s", "_voxels": "voxels", "_share": "0 to 1"}


@dataclass(frozen=True)
class Row:
    """A key of a section, its value in words, and its unit."""

    key: str
    value: str
    unit: str


def tables_of(report: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Return the sections of a report as rows.

    Parameters
    ----------
    report : mapping

    Returns
    -------
    dict
        Section to its rows, in the report's order; what stands beside sections comes first, as ``mesh``.
    """
    length = report.get("points", {}).get("unit", "mm")
    alone = {key: value for key, value in report.items() if not isinstance(value, Mapping) and key != "warnings"}
    sections = {"mesh": alone} | {key: value for key, value in report.items() if isinstance(value, Mapping)}
    if report.get("warnings"):
        sections["warnings"] = {str(number): text for number, text in enumerate(report["warnings"], 1)}
    return {
        name: [Row(key, words, _unit(key, length)) for key, words in _flat(found)]
        for name, found in sections.items()
        if found and name not in LEFT_OUT
    }


def _flat(found: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Yield keys, those within others behind a dot, and values in words."""
    for name, value in found.items():
        key = f"{above}{name}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{key}.")
        elif _is_table(value):
            yield key, f"{len(value)}"
            for number, one in enumerate(value[:LISTED], 1):
                yield from _flat(one, f"{key}[{number}].")
        else:
            yield key, in_words(value)


def _is_table(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)


def in_words(value: Any) -> str:
    """Return a value as it is read."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        shown = ", ".join(
            f"({in_words(one)})" if isinstance(one, list | tuple) else in_words(one) for one in value[:LISTED]
        )
        return (f"{shown}, ... ({len(value)} in all)" if len(value) > LISTED else shown) or "none"
    return str(value)


def _unit(key: str, length: str) -> str:
    """Return the unit that the end of a key names; lengths are in that of the report."""
    last = key.rpartition(".")[2]
    for end, power in POWERS.items():
        if last.endswith(end):
            return length + power
    return next((unit for end, unit in OTHERS.items() if last.endswith(end)), "")
