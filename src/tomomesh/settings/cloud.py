"""How a cloud is read."""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param


@dataclass(frozen=True)
class CloudSettings(Group):
    """How a cloud is read where its file leaves a choice."""

    structure: str | None = param(
        None,
        "structures of a DICOM RT Structure Set: a number in the table or a name, several with commas between, or all",
        kind=str,
    )
    skip_flat: bool = param(False, "leave out contours that enclose nothing: of one or two corners, or on one line")
