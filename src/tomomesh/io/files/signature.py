"""How a written file names itself."""

from __future__ import annotations


def signature(unit: str, frame: str) -> str:
    """Return the program, its version, and the unit and frame of the coordinates."""
    from ... import __version__

    return f"tomomesh {__version__} unit={unit} frame={frame}"
