"""What the choices keep of a study, found once for all networks that are trained on it."""

from __future__ import annotations

import threading
from dataclasses import fields
from typing import TYPE_CHECKING

from ..errors import UsageError
from ..segmentation.study import lay_out, select_in
from ..settings import NetworkSettings, RunSettings
from .session import Made

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from ..progress import Progress
    from ..segmentation.study import LaidOut, Selected
    from ..settings import Settings
    from .session import Session

_finding = threading.Lock()
"""A page that asks for slice after slice has their window found once."""
NAME = "selected"
OTHERS = frozenset(entry.name for group in (NetworkSettings, RunSettings) for entry in fields(group)) - {"slices"}
"""Parameters that change nothing about what is kept."""


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


def _key(session: Session) -> Mapping[str, Any]:
    """Return the choices that matter; the paper's own choose the slices and the window too."""
    values = session.choices.values
    kept = {name: value for name, value in values.items() if name not in OTHERS}
    return kept | {"paper": values.get("way") == "paper"}
