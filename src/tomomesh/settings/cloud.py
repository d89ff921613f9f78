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
    thickness: float | None = param(
        None, "how thick a contour is made that goes on in no other slice, in a cloud's unit; by default as far as the "
        "slices are apart, and one slice alone is refused", unit="mm", above=0,
    )  # fmt: skip
    skip_flat: bool = param(False, "leave out contours that enclose nothing: of one or two corners, or on one line")
