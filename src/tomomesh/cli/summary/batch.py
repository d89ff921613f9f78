"""What is said of many studies."""

from __future__ import annotations

from typing import Any

from .mesh import pieces_in_words


def of_row(place: str, row: dict[str, Any]) -> str:
    """Say in one line what became of one study of a batch."""
    if row["exit_code"]:
        return f"{place}: failed"
    if row.get("passed"):
        return f"{place}: finished before"
    shape = "sound" if row["sound"] else "NOT sound"
    return f"{place}: {row['faces']} faces, {pieces_in_words(row)}, {shape}, {row['seconds']:.1f} s"


def of_batch(rows: list[dict[str, Any]], output: str) -> str:
    """Say in one line what became of a batch."""
    failed, passed = (sum(bool(row.get(name)) for row in rows) for name in ("exit_code", "passed"))
    return f"written   {output}: {len(rows) - failed - passed} reconstructed, {passed} finished before, {failed} failed"
