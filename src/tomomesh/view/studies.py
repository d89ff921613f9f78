"""What may be opened, its series, and what is in the study that is."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import io
from ..errors import TomomeshError, UsageError
from ..model.volume import AXES
from ..segmentation.survey import survey
from .opened import Opened, kind_of
from .routes import get, post

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from ..model.volume import Volume
    from .session import Session

BARS = 512
"""Bars of the histogram: as many as the page has dots for it."""


def opened_volume(session: Session) -> Volume:
    """Return the study that is opened.

    Raises
    ------
    UsageError
        Where none is, or it is still being read.
    """
    if session.opened.volume is None:
        raise UsageError(session.opened.refused or "no study is open yet", hint="again, once one has been read")
    return session.opened.volume


def _files(session: Session) -> dict[str, Any]:
    """Tell what may be opened."""
    return {"files": session.reach.listed(), "browses": session.reach.folder is not None}


def _series(session: Session) -> dict[str, Any]:
    """Tell the series and segments of what is opened, whether they can be read or not."""
    opened = session.opened
    if opened.kind != "study":
        return {"series": [], "segments": {}, "left_out": {}}
    try:
        listing = io.list_series(opened.words[0], settings=replace(session.settings.read, series=None))
    except TomomeshError:  # told when it was read
        listing = io.Listing()
    segments = {str(number): name for number, name in _segments(opened.beside, listing)}
    return {"series": listing.told, "segments": segments, "left_out": dict(listing.left_out)}


def _segments(beside: str, listing: io.Listing) -> Iterable[tuple[int, str]]:
    """Return the segments that can be chosen: of the label map beside the study, where there is one."""
    if not beside:
        return listing.segments
    with suppress(TomomeshError):  # told when it was read
        return io.label_names(beside).items()
    return ()


def _open(session: Session, body: Any) -> dict[str, Any]:
    """Open a study, points, a mesh or a run that may be opened; ``path``, and the number of its ``series``."""
    if not isinstance(body, dict) or not isinstance(body.get("path"), str):
        raise UsageError("nothing to open was named", expected='{"path": ..., "series": ...}')
    path = session.reach.check(body["path"])
    series = body.get("series")
    session.open(Opened(kind_of(path), (path,)), {} if series is None else {"series": series})
    return session.state


def _study(session: Session) -> dict[str, Any]:
    """Tell what `tomomesh inspect` tells of the study, with more bars, and names of its labels."""
    opened, settings = session.opened, session.settings
    volume = opened_volume(session)
    found: dict[str, Any] = session.surveys.of(None, lambda: _surveyed(session))
    slices = {"auto": found["default_plane"], "stored": AXES[volume.stored_axis]}.get(settings.network.slices)
    unread = {str(number): None for number in opened.names} if opened.part else {}
    labels = {**unread, **found["labels"]}
    return {key: found[key] for key in found if key not in ("corner_mm", "affine")} | {
        "labels": labels, "label_names": _named(labels, opened.names), "slices": slices or settings.network.slices,
    }  # fmt: skip


def _surveyed(session: Session) -> dict[str, Any]:
    """Survey the study; where a label map lies beside it, its labels are that one's."""
    found, laid = survey(opened_volume(session), BARS), session.opened.laid
    return found if laid is None else {**found, "labels": _counted(laid)}


def _counted(labels: Volume) -> dict[str, int]:
    numbers, counts = np.unique(labels.voxels, return_counts=True)
    pairs = zip(numbers.tolist(), counts.tolist(), strict=True)
    return {str(round(number)): count for number, count in pairs if number > 0}


def _named(labels: Iterable[str], names: Mapping[int, str]) -> dict[str, str]:
    return {label: names[int(label)] for label in labels if int(label) in names}


ROUTES = [
    get("/api/files", _files), get("/api/series", _series), post("/api/open", _open), get("/api/study", _study),
]  # fmt: skip
