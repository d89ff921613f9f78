"""The series of a study as a table."""

from __future__ import annotations

from typing import Any

TILTED = 0.1
"""Degrees from which on a tilt is mentioned."""
SAME = 1e-3
"""Distances that differ by less than this part are shown as one."""

LEFT = ("modality", "verdict", "description")
"""Columns of words; those of numbers end on the right."""


def table_of(series: list[dict[str, Any]]) -> list[str]:
    """Return a heading and a line a series; columns in which no series has anything are left out.

    Parameters
    ----------
    series : list of dict
        As `inspected` returns them.
    """
    rows = [_cells(one) for one in series]
    columns = [name for name in rows[0] if any(row[name] for row in rows)]
    widths = {name: max(len(name), *(len(row[name]) for row in rows)) for name in columns}
    lines = [dict(zip(columns, columns, strict=True)), *rows]
    return ["  ".join(_aligned(name, line[name], widths[name]) for name in columns).rstrip() for line in lines]


def _cells(series: dict[str, Any]) -> dict[str, str]:
    refused, tilt = series["refused"], series["tilt_deg"] or 0.0
    return {
        "#": str(series["number"]),
        "modality": series["modality"],
        "slices": str(series["slices"]),
        "rows x columns": f"{series['rows']} x {series['columns']}",
        "pixel mm": _pair(series["pixel_mm"], " x "),
        "apart mm": _pair(series["distances_mm"], " to "),
        "tilt": f"{tilt:.1f} deg" if tilt >= TILTED else "",
        "missing": str(series["missing"] or ""),
        "repeated": str(series["repeats"] or ""),
        "verdict": f"exit {refused['exit_code']}" if refused else "read",
        "description": series["description"] or "",
    }


def _pair(values: tuple[float, float] | None, between: str) -> str:
    if values is None:
        return ""
    low, high = values
    return f"{low:.4g}" if abs(high - low) <= SAME * abs(low) else f"{low:.4g}{between}{high:.4g}"


def _aligned(name: str, cell: str, width: int) -> str:
    return cell.ljust(width) if name in LEFT else cell.rjust(width)
