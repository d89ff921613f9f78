"""How a study is read."""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param


@dataclass(frozen=True)
class ReadSettings(Group):
    """How a study is read where its files leave a choice."""

    series: int | None = param(None, "number of the series to take from a folder that holds several", kind=int, low=1)
    spacing: tuple[float, ...] | None = param(
        None,
        "distance of the voxels along columns, rows and slices, for files that hold none",
        unit="mm",
        above=0,
        length=(3,),
    )
    spacing_z: float | None = param(
        None, "distance of the slices, for one slice or slices without positions", unit="mm", above=0
    )
    fill_gaps: bool = param(False, "interpolate the slices that are missing from a regular stack")
    resample_slices: bool = param(
        False, "interpolate an even stack where the distance of the slices varies by more than 1 %"
    )
    skip_bad: bool = param(
        False, "go on without the files of a series that cannot be read, where the others still make a regular stack"
    )
    nifti_form: str = param(
        "sform", "the frame that is taken of a NIfTI file that holds two", choices=("sform", "qform")
    )
    level: int = param(0, "level of an OME-Zarr pyramid, 0 being the full resolution", low=0)
    fill_chunks: bool = param(
        False, "take missing chunks of a Zarr array for its fill value, whatever the voxels beside them are"
    )
