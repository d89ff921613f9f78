"""Which gray levels or labels are the window."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import UsageError
from .parameter import LAYERS, MANY, Group, param

PRESETS = ("bone", "compact-bone", "spongy-bone", "enamel", "skin", "soft-tissue", "muscle", "fat", "lung")
"""Names of the windows for CT; `segmentation.window` has their bounds."""


@dataclass(frozen=True)
class WindowSettings(Group):
    """Gray-level window (eq. 3): a voxel is kept where lower < k <= upper."""

    lower: float | tuple[float, ...] | None = param(
        None, "lowest gray level, itself left out, one or one a layer; Otsu's where not given",
        unit="stored, HU for CT", length=LAYERS,
    )  # fmt: skip
    upper: float | tuple[float, ...] | None = param(
        None, "highest gray level, itself kept, one or one a layer; no limit where not given",
        unit="stored, HU for CT", length=LAYERS,
    )  # fmt: skip
    layers: str = param(
        "all", "whether all layers of a color voxel must lie in their windows, or any", choices=("all", "any"),
        paper="any",
    )  # fmt: skip
    preset: str | None = param(
        None,
        "a window for CT, in HU: bone over 300, compact-bone 661 to 1988, spongy-bone 147 to 661, enamel 1552 to 2850, "
        "skin over -300, its outer surface alone, soft-tissue -300 to 225, muscle -6 to 135, fat -206 to -51, lung up "
        "to -400, inside of the body alone",
        kind=str,
        choices=PRESETS,
    )
    select: tuple[int, ...] | None = param(
        None,
        "labels of a label map whose voxels are the window; on the command line by their names too, where the file has "
        "them: a NIfTI label table (TotalSegmentator), a .seg.nrrd, a DICOM segmentation",
        kind=int,
        low=0,
        length=MANY,
    )
    fill_slices: bool = param(
        False, "interpolate the slices without labels between those with, as one smooth solid, and end it beyond them"
    )
    keep: str = param(
        "auto",
        "what is kept of the window: the patient's body, without the scanner's table; the largest component; or all. "
        "auto is body for what is dense in CT, and everything elsewhere and for labels. But under all, specks are left "
        "out and pores filled: under 8 voxels, and under a thousandth of the largest component",
        choices=("auto", "body", "largest", "all"),
    )
    keep_at: tuple[tuple[float, float, float], ...] | None = param(
        None, "keep of that the component alone that holds a place in the patient, LPS; again for one more",
        unit="mm", length=(3,), metavar=("X", "Y", "Z"), repeated=True,
    )  # fmt: skip
    drop_at: tuple[tuple[float, float, float], ...] | None = param(
        None, "leave out of that the component that holds a place in the patient, LPS; again for one more",
        unit="mm", length=(3,), metavar=("X", "Y", "Z"), repeated=True,
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("lower", "upper"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) == 1:
                object.__setattr__(self, name, value[0])
        limited = self.lower is not None or self.upper is not None
        if self.preset is not None and limited:
            raise UsageError("two windows are asked for", found="--preset and a window", expected="one of them")
        if self.select is not None and (limited or self.preset is not None):
            raise UsageError("two windows are asked for", found="--select and a window", expected="one of them")
        if self.lower is not None and self.upper is not None:
            self._check_limits(self.lower, self.upper)

    @staticmethod
    def _check_limits(*limits: float | tuple[float, ...]) -> None:
        lower, upper = (limit if isinstance(limit, tuple) else (limit,) for limit in limits)
        count = max(len(lower), len(upper))
        found = ", ".join(
            f"--{name} = {' '.join(f'{value:g}' for value in limit)}"
            for name, limit in (("lower", lower), ("upper", upper))
        )
        if len(lower) not in (1, count) or len(upper) not in (1, count):
            raise UsageError("the limits do not fit each other", found=found, expected="one, or as many as layers")
        pairs = zip(lower * (count // len(lower)), upper * (count // len(upper)), strict=True)
        if any(low >= high for low, high in pairs):
            raise UsageError("the window is empty", found=found, expected="lower < upper")
