"""What a command reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import io
from ..errors import UsageError

if TYPE_CHECKING:
    from argparse import Namespace

    from ..model.volume import Volume
    from ..settings import Settings
    from .bars import Bars


def sources_of(chosen: Namespace, settings: Settings) -> list[str]:
    """Return the files that are read; refuse a label map without labels, and a command without any."""
    sources = [path for path in (chosen.study, chosen.labels_in) if path]
    if not sources:
        raise UsageError("there is no study", expected="STUDY, or --labels-in with --select")
    if chosen.labels_in and settings.window.select is None:
        raise UsageError(
            "no label was chosen", found=f"--labels-in {chosen.labels_in}", expected="--select with its labels"
        )
    return sources


def read_study(chosen: Namespace, settings: Settings, progress: Bars) -> tuple[Volume, Volume | None]:
    """Read the study, and the label map where there is one beside it."""
    total = 2 if chosen.study and chosen.labels_in else 1
    progress("read", 0, total)
    select = settings.window.select
    volume = io.read_volume(chosen.study or chosen.labels_in, settings=settings.read, select=select)
    labels = io.read_volume(chosen.labels_in, settings=settings.read, select=select) if total == 2 else None
    progress("read", total, total)
    return volume, labels
