"""What a command reads."""

from __future__ import annotations

import shlex
from argparse import Namespace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from .. import io
from ..errors import UnreadableError, UsageError
from ..io.names import shown

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from ..model.volume import Volume
    from ..progress import Progress
    from ..settings import Settings


ALL = "all"
"""Takes the place of every label, where each has a mesh of its own."""


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


def numbered(chosen: Namespace) -> Namespace:
    """Put numbers in the place of labels that were chosen by their names, as the label map has them.

    Raises
    ------
    UsageError
        For a name that it does not have.
    """
    asked, table = getattr(chosen, "select", ()), getattr(chosen, "label_names", None)
    if getattr(chosen, "each_label", False) and asked == (ALL,):
        return Namespace(**vars(chosen) | {"select": None})
    if not any(isinstance(label, str) for label in asked):
        return chosen
    named = (getattr(chosen, name, None) for name in ("label_names", "labels_in", "against", "study"))
    path = next((path for path in named if path), None)
    known = names_of(table, path)
    return Namespace(**vars(chosen) | {"select": tuple(_number_of(label, known, str(path)) for label in asked)})


def names_of(table: str | None, path: object) -> dict[int, str]:
    """Return the names of labels by their numbers: of a table, or else of the label map's own file."""
    if table:
        return io.read_label_names(table)
    return io.label_names(path) if isinstance(path, str) else {}


def _number_of(label: int | str, known: dict[int, str], path: str) -> int:
    if isinstance(label, int):
        return label
    names = {number: _plain(name) for number, name in known.items()}
    found = [number for number, name in names.items() if name == _plain(label)]
    if len(found) == 1:
        return found[0]
    near = {*get_close_matches(_plain(label), names.values(), 3, 0.5)}
    told = ", ".join(f"{name} ({number})" for number, name in names.items() if name in near)
    what = "the label map names none of its labels" if not known else "the label map has no label of that name"
    counted = f"`tomomesh inspect {shlex.quote(path)}`, which counts its labels, and --select N"
    raise UsageError(
        "several labels have that name" if found else what, file=path, found=f"--select {label}",
        hint="--each-label" if label == ALL else told or counted,
    )  # fmt: skip


def _plain(name: str) -> str:
    """Return a name as it is compared: as it is shown, in small letters, and without spaces."""
    return shown(name).lower().replace(" ", "_")


def sources_of(chosen: Namespace, settings: Settings) -> list[str]:
    """Return the files that are read; refuse a label map without labels, and a command without any.

    Raises
    ------
    UsageError
    """
    study = chosen.study if isinstance(chosen.study, tuple) else (chosen.study,)
    sources = [path for path in (*study, chosen.labels_in) if path]
    if not sources:
        raise UsageError("there is no study", expected="STUDY, or --labels-in with --select")
    if chosen.labels_in and settings.window.select is None and not getattr(chosen, "each_label", False):
        raise UsageError(
            "no label was chosen", found=f"--labels-in {chosen.labels_in}", expected="--select with its labels"
        )
    return sources


def read_study(chosen: Namespace, settings: Settings, progress: Progress) -> tuple[Volume, Volume | None]:
    """Read the study, and the label map where there is one beside it."""
    return _both(io.read_volume, chosen, settings, progress)


def open_study(chosen: Namespace, settings: Settings, progress: Progress) -> tuple[Volume, Volume | None]:
    """Open what `read_study` reads, to be read slab by slab."""
    return _both(io.open_study, chosen, settings, progress)


def _both(
    read: Callable[..., Volume], chosen: Namespace, settings: Settings, progress: Progress
) -> tuple[Volume, Volume | None]:
    total = 2 if chosen.study and chosen.labels_in else 1
    progress("read", 0, total)
    select = settings.window.select
    volume = read(chosen.study or chosen.labels_in, settings=settings.read, select=select)
    labels = read(chosen.labels_in, settings=settings.read, select=select) if total == 2 else None
    progress("read", total, total)
    return volume, labels


def region_of(name: str, settings: Settings) -> tuple[NDArray[np.float64], float, list[str]]:
    """Return the inputs of a test region or of a picture, the area that each stands for, and what is to be said.

    Raises
    ------
    UnreadableError
        For what is neither.
    """
    from ..som.shapes import SHAPES, shape

    if name in SHAPES:
        return *shape(name), []
    if not Path(name).exists():
        regions = f"{' | '.join(SHAPES)} | a PNG or TIFF file"
        raise UnreadableError("there is no such region", file=name, expected=regions)
    notes: list[str] = []
    return _window_of_picture(name, settings, notes), 1.0, notes


def _window_of_picture(path: str, settings: Settings, notes: list[str]) -> NDArray[np.float64]:
    """Return the window's pixels of one picture as (column, -row[, layer]), so that up stays up.

    Where no window was asked for, and what Otsu's threshold takes has most of the picture's border, that is the paper:
    the figure is the rest, and a note says so.
    """
    import numpy as np

    from ..segmentation.signal import pixels_of
    from ..segmentation.window import by_layer, choose_window, window

    picture, asked = io.read_picture(path), settings.window
    lower, upper = choose_window(picture, asked)
    mask = window(picture, lower=lower, upper=upper, layers=asked.layers)[0]
    border = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    chosen = any(limit is not None for limit in (asked.lower, asked.upper, asked.preset))
    dark = not chosen and border.mean() > 0.5 and not mask.all()
    if dark:
        notes.append("the border of the picture is bright: what is dark on it was taken (--lower for what is bright)")
    mask = mask ^ dark
    if picture.layers > 1 and settings.network.inputs == "layers":
        mask = (by_layer(picture, lower=lower, upper=upper)[0] ^ dark) & mask[..., None]
    pixels = pixels_of(mask)
    return np.asarray(pixels * np.array([1.0, -1.0, 1.0])[: pixels.shape[1]])
