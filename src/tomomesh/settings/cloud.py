"""How a cloud is read."""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param


@dataclass(frozen=True)
class CloudSettings(Group):
    """How a cloud is read where its file leaves a choice."""

    structure: str | None = param(
        None, "structure of a DICOM RT Structure Set: its number in the table, or its name", kind=str
    )
    skip_flat: bool = param(False, "leave out contours that enclose nothing: of one or two corners, or on one line")
