"""What a command reads."""

from __future__ import annotations

import shlex
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from .. import io
from ..errors import UsageError

if TYPE_CHECKING:
    from ..model.volume import Volume
    from ..settings import Settings
    from .bars import Bars


def gathered(chosen: Namespace) -> Namespace:
    """Make one study of the files that were named one by one: None, a path, or a tuple of paths.

    Raises
    ------
    UsageError
        For standard input among others.
    """
    named = getattr(chosen, "study", None)
    if not isinstance(named, list):
        return chosen
    if len(named) < 2:
        return Namespace(**vars(chosen) | {"study": named[0] if named else None})
    if "-" in named:
        raise UsageError("standard input is one study by itself", found=f"- and {len(named) - 1} files")
    return Namespace(**vars(chosen) | {"study": tuple(named), "typed": _in_short(named)})


def _in_short(named: list[str]) -> str:
    """Return words of a command line that a shell expands to these files: a pattern where there is one."""
    first = Path(named[0])
    for pattern in (f"*{first.suffix}", "*"):
        found = {path for path in first.parent.glob(pattern) if not path.name.startswith(".")}
        if found == set(map(Path, named)):
            return f"{shlex.quote(str(first.parent))}/{pattern}"
    return " ".join(map(shlex.quote, named))


def sources_of(chosen: Namespace, settings: Settings) -> list[str]:
    """Return the files that are read; refuse a label map without labels, and a command without any."""
    study = chosen.study if isinstance(chosen.study, tuple) else (chosen.study,)
    sources = [path for path in (*study, chosen.labels_in) if path]
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
