"""What the choices keep of a study, for networks that are trained on it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...errors import UsageError
from ...segmentation.study import lay_out
from ..studies import opened_volume
from ..windows import kept

if TYPE_CHECKING:
    from ...progress import Progress
    from ...segmentation.study import LaidOut, Selected
    from ..session import Session


def selected_of(session: Session, progress: Progress) -> Selected:
    """Return what the choices keep of a study; found once for all who ask.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    progress("window", 0, 1)
    try:
        _, found = kept(session)
    except LookupError:
        raise UsageError("the choices have changed meanwhile", hint="the same once more") from None
    progress("window", 1, 1)
    return found.selected


def slices_of(session: Session) -> LaidOut:
    """Return the slices of a study as they are looked at, without looking for labels in them.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    settings = session.settings
    window = replace(settings.window, select=None, fill_slices=False)
    return lay_out(opened_volume(session), None, replace(settings, window=window), labelled=False)
