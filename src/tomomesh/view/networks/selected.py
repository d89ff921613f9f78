"""What the choices keep of a study, found once for all networks that are trained on it."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import TYPE_CHECKING

from ...errors import UsageError
from ...segmentation.study import lay_out, select_in
from ..session import Product

if TYPE_CHECKING:
    from typing import Any

    from ...model.volume import Volume
    from ...progress import Progress
    from ...segmentation.study import LaidOut, Selected
    from ..session import Session

_finding = threading.Lock()
"""A page that asks for slice after slice has their window found once."""
NAME = "selected"


def selected_of(session: Session, progress: Progress) -> Selected:
    """Return what the choices keep of a study.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    with _finding:
        key, settings = _key(session), session.settings
        made = session.made.get(NAME)
        if made is None or made.choices != key:
            progress("window", 0, 1)
            labelled = settings.window.select is not None
            laid = lay_out(opened_volume(session), session.opened.labels, settings, labelled=labelled)
            made = session.made[NAME] = Product(select_in(laid, settings).value, key)
            progress("window", 1, 1)
    found: Selected = made.value
    return found


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


def opened_volume(session: Session) -> Volume:
    """Return the study.

    Raises
    ------
    UsageError
        Where there is none, or not yet.
    """
    if session.opened.volume is None:
        raise UsageError("no study is open, or it is still being read", expected="tomomesh view STUDY")
    return session.opened.volume


def _key(session: Session) -> dict[str, Any]:
    """Return what the voxels that are kept follow from."""
    settings = session.settings
    of = (settings.read, settings.crop, settings.window, settings.network.slices)
    return {"settings": of, "volume": id(session.opened.volume)}
