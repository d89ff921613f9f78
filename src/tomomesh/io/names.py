"""Names that people typed into a file, made safe to show."""

from __future__ import annotations

LONGEST_SHOWN = 40
"""Letters of a name that are shown: half a line of a terminal."""


def shown(name: object) -> str:
    """Return a name on one line, without control characters and not too long; ``"no name"`` where it is empty."""
    text = "".join(letter if letter.isprintable() else " " for letter in str(name or ""))
    text = " ".join(text.split())
    return f"{text[:LONGEST_SHOWN]}..." if len(text) > LONGEST_SHOWN else text or "no name"
