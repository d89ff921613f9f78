"""What the choices keep of a study, found once for all networks that are trained on it."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..segmentation.study import lay_out, select_in
from .session import Made

if TYPE_CHECKING:
    from typing import Any

    from ..progress import Progress
    from ..segmentation.study import LaidOut, Selected
    from ..settings import Settings
    from .session import Session

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
            made = session.made[NAME] = Made(select_in(laid_out_of(session, settings), settings).value, key)
            progress("window", 1, 1)
    found: Selected = made.value
    return found


def laid_out_of(session: Session, settings: Settings) -> LaidOut:
    """Return a study as it is looked at.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    opened = session.opened
    if opened.volume is None:
        raise UsageError("no study is open, or it is still being read", expected="tomomesh view STUDY")
    return lay_out(opened.volume, opened.labels, settings, labelled=settings.window.select is not None)


def _key(session: Session) -> dict[str, Any]:
    """Return what the voxels that are kept follow from."""
    settings = session.settings
    of = (settings.read, settings.crop, settings.window, settings.network.slices)
    return {"settings": of, "volume": id(session.opened.volume)}
