"""Which part of a study matters."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import UsageError
from .parameter import Group, param


@dataclass(frozen=True)
class CropSettings(Group):
    """The part of a study that matters; the rest is cropped away before all else."""

    roi: tuple[float, ...] | None = param(
        None, "box that is kept: the voxels whose centers lie from X0 to X1, Y0 to Y1 and Z0 to Z1 in the patient, "
        "LPS; of a cloud the points that do, in its own frame and unit",
        unit="mm", length=(6,), metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"),
    )  # fmt: skip
    slice_range: tuple[int, int] | None = param(
        None,
        "first and last slice that are kept, both included, counted from 0 along the slices' axis; negative from the "
        "end",
        kind=int,
        length=(2,),
        metavar=("FIRST", "LAST"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.roi is not None and any(low > high for low, high in zip(self.roi[::2], self.roi[1::2], strict=True)):
            raise UsageError(
                "the box is empty", found=f"--roi = {' '.join(f'{side:g}' for side in self.roi)}",
                expected="X0 <= X1, Y0 <= Y1 and Z0 <= Z1",
            )  # fmt: skip
