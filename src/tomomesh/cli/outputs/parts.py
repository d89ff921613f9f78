"""What a part to print is measured in: the unit and frame of the mesh that it is made of, and its own."""

from __future__ import annotations

from ... import io
from ...errors import GeometryError

PATIENT = ("LPS", "RAS")
"""Frames in which front and back, left and right are the patient's."""


def frame_of_mesh(path: str, unit: str | None = None) -> dict[str, str]:
    """Return the unit and frame of a mesh file: as asked for, else as it states them itself, else millimeters.

    Raises
    ------
    GeometryError
        For a unit that has no length, as voxels.
    """
    from ...printing.part import PRINTED_MM

    named = {"unit": "mm", "frame": "unknown"} | io.frame_of_file(path) | ({"unit": unit} if unit else {})
    if named["unit"] not in PRINTED_MM:
        raise GeometryError(
            "the mesh's unit has no known length", file=path, found=f"unit = {named['unit']}",
            expected="a unit of length, as mm", hint="--frame lps where the mesh is made",
        )  # fmt: skip
    return named


def frame_of_part(frame: dict[str, str], scale: float) -> dict[str, str]:
    """Name unit and frame of a part: a patient's frame is kept where the part has the object's own size."""
    unit = frame["unit"] if frame["unit"] == "unknown" else "mm"
    return {"unit": unit, "frame": frame["frame"] if frame["frame"] in PATIENT and scale == 1 else "unknown"}
