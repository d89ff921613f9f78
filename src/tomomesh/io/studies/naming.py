"""Names of results, after those of files."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

LONGEST = 200
"""Bytes of a name, so that a suffix still fits into the 255 that file systems allow."""


def distinct_names(short: Sequence[str], full: Sequence[str]) -> list[str]:
    """Name each of several results by letters, digits, dots, dashes and underscores alone.

    Parameters
    ----------
    short, full : sequence of str
        For each result the name that it should have, and the one for where it shares that with others.

    Returns
    -------
    list of str
        No two are the same, also where upper and lower case are; what full names share, numbers tell apart.
    """
    wanted = [safe_name(name) for name in short]
    count = Counter(name.casefold() for name in wanted)
    longer = [safe_name(name) for name in full]
    chosen = [one if count[one.casefold()] == 1 else other for one, other in zip(wanted, longer, strict=True)]
    taken: set[str] = set()
    return [_free(name, taken) for name in chosen]


def safe_name(name: str) -> str:
    """Replace what may mean something to a system, a shell or a terminal, and what would hide a file."""
    kept = "".join(c if c.isalnum() or c in "._-" else "_" for c in name)
    return kept.encode()[:LONGEST].decode(errors="ignore").strip(".-") or "study"


def _free(name: str, taken: set[str]) -> str:
    """Return the name, with the next free number where it is taken."""
    number, free = 1, name
    while free.casefold() in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free.casefold())
    return free
