"""What `tomomesh inspect` finds: what is in a study, or why it would be refused, and what to do next."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from ... import io
from ...errors import EmptyError, FormatError, GeometryError, ResourceError, TomomeshError, UnreadableError
from .next_step import first_try, next_step

if TYPE_CHECKING:
    from ...io import Listing
    from ...model.volume import Volume
    from ...settings import Settings

REFUSALS = (FormatError, GeometryError, ResourceError, UnreadableError)
"""What reading raises because of the study; anything else is the user's or the program's fault."""


def inspected(study: str | tuple[str, ...], settings: Settings, *, typed: str = "") -> dict[str, Any]:
    """Return what is in a study, ready for JSON and without any patient data.

    Parameters
    ----------
    study : str, or tuple of str
        The path of the study, or those of its slices.
    settings : Settings
        How it is read, and which part of it.
    typed : str
        What the user typed in its place, for the study of a stream and slices that are named one by one.

    Returns
    -------
    dict
        What `survey` says where the study can be read; always `series`, all of a DICOM study, `segments`, those of a
        DICOM segmentation, `left_out`, `refused` with the `exit_code` and the `error` of a run, None where it would go
        on, and `next`, a command.

    Raises
    ------
    TomomeshError
        Where nothing can be said of the study.
    """
    listing = io.list_series(study, settings=settings.read)
    found, fault = _surveyed(study, settings, listing)
    found |= {"series": listing.told, "segments": dict(listing.segments), "left_out": dict(listing.left_out)}
    found["refused"] = None if fault is None else fault.told
    if typed and isinstance(study, str):
        _rename(found, study, shlex.split(typed)[0])
    path = f"./{study}" if str(study).startswith("-") else str(study)  # else it would look like an option
    return found | {"next": next_step(found, typed or shlex.quote(path), settings, fault, listing.series)}


def _rename(found: dict[str, Any], study: str, name: str) -> None:
    """Name the study in errors as it was typed, not the temporary file in its place."""
    for one in (found, *found["series"]):
        if one["refused"]:
            one["refused"]["error"] = one["refused"]["error"].replace(study, name)


def _surveyed(
    study: str | tuple[str, ...], settings: Settings, listing: Listing
) -> tuple[dict[str, Any], TomomeshError | None]:
    """Return what is in a study, or the error that refuses it; a single file that is broken says nothing more."""
    from ...segmentation.crop import crop
    from ...segmentation.survey import survey

    try:
        volume = io.read_volume(study, settings=settings.read)
    except REFUSALS as fault:
        if listing.files > 1 or (listing.files and isinstance(fault, GeometryError)):
            return {}, fault
        raise
    found = survey(crop(volume, settings.crop, volume.thickest_axis())[0])
    return found | {"way": _way(volume, settings.replace(**first_try(found)))}, None


def _way(volume: Volume, settings: Settings) -> dict[str, Any] | None:
    """Return the way that the next command takes, as the report has it; None where nothing lies in its window."""
    from ...segmentation.study import select_study
    from ...ways.choice import take_way

    try:
        return dict(take_way(select_study(volume, None, settings).value, settings).stats["way"])
    except EmptyError:
        return None
