"""What of a study is kept: the voxels of a window or of labels, and which of their components."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError
from ..isosurface.run_mask import RunMask
from ..model.lazy import LazyVoxels
from ..progress import silent
from .body import (
    Cleaned,
    components_of_body,
    largest_component,
    solid,
    thick_components,
    without_specks,
)  # fmt: skip
from .contours.labelled import filled_slices, gaps_in
from .gray_levels import Shown
from .picked import picked
from .slabwise.sources import MaskVoxels
from .window import is_dense, otsu_in, skin_of, window_in, window_limits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.walls.walls import Walls
    from ..model.boxes import Box
    from ..model.volume import Volume
    from ..progress import Progress
    from ..settings import Settings, WindowSettings
    from .body import Components
    from .gray_levels import GrayLevels
    from .labels import Labelled
    from .slabwise.cut import Cut
    from .window import Limit

STEPS = 4
"""From a study to what is kept of it, and the way that it goes."""


@dataclass(frozen=True)
class Counts:
    """What became of the voxels of a window.

    Attributes
    ----------
    padding, named_padding : int
        Voxels of the study that are padding, and were given its lowest other level; those of which its header says so.
    window : int
        Voxels within the bounds, or of the labels, in the box that was asked for.
    room : int
        Of them, those that lie in the air of the room.
    components, dropped : int
        Components of the window, and those that were left out as no part of the body; 0 where none were looked for.
    dropped_voxels : int
    spared_voxels : int
        Voxels that lie in no body, and were kept for all that: for being all of the window, or on a guess most of it.
    lining : int
        Voxels outside of the bounds that were filled, for the outer surface alone to be left.
    left_out, left_out_voxels : int
        Components of what was then left, and their voxels, that were left out by places in them.
    """

    padding: int = 0
    named_padding: int = 0
    window: int = 0
    room: int = 0
    components: int = 0
    dropped: int = 0
    dropped_voxels: int = 0
    spared_voxels: int = 0
    lining: int = 0
    left_out: int = 0
    left_out_voxels: int = 0


@dataclass(frozen=True)
class Chosen:
    """The voxels that are kept, and where between them and the others the levels cross a bound.

    Attributes
    ----------
    volume : Volume
        The gray levels that were asked for; for labels, 1 where one of them is, else 0.
    runs : RunMask
        The voxels that are kept.
    lower, upper : float or (L,) float array
        Bounds on the levels of `volume`.
    counts : Counts
    cleaned : Cleaned
        Specks and pores.
    told : str
        What is to be said of slices without labels.
    walls : Walls or None
        Of all labels, where neighbors share them.
    """

    volume: Volume
    runs: RunMask
    lower: Limit
    upper: Limit
    counts: Counts = field(default_factory=Counts)
    cleaned: Cleaned | None = None
    told: str = ""
    walls: Walls | None = None

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The voxels that are kept, (K, J, I), all in memory."""
        return self.runs.dense

    @property
    def box(self) -> Box:
        """What the voxels that are kept lie in: outside of it nothing has to be looked at."""
        return self.runs.box

    @property
    def kept(self) -> int:
        """How many voxels are kept."""
        return self.runs.count

    def counted(self, runs: RunMask, **counts: int) -> Chosen:
        """Return the same with another mask and some counts."""
        return replace(self, runs=runs, counts=replace(self.counts, **counts))


def choose(
    levels: GrayLevels, labels: Labelled | None, settings: Settings, inside: RunMask | None = None,
    progress: Progress = silent,
) -> Chosen:  # fmt: skip
    """Return what the settings keep of a study.

    Parameters
    ----------
    levels : GrayLevels
        Of the study.
    labels : Labelled or None
        A label map on its grid, for ``select``: the study itself, or one beside it.
    settings : Settings
    inside : RunMask, optional
        The voxels that may be kept.
    progress : Progress, optional

    Raises
    ------
    UsageError, EmptyError
        As `window` and `Labelled.mask`.
    """
    asked = settings.window
    shown, chosen = _of_levels(levels, asked) if labels is None else _of_labels(levels, labels, asked)
    chosen = chosen if inside is None else replace(chosen, runs=_within(chosen.runs, inside))
    progress("window", 1, STEPS)
    chosen = _parts(chosen.counted(chosen.runs, window=chosen.kept), shown, levels.volume, asked)
    progress("window", 2, STEPS)
    if asked.keep != "all" and not settings.cubes.shared_walls:  # a speck left out of one label would be a gap
        cleaned = without_specks(chosen.runs)
        chosen = replace(chosen, runs=cleaned.mask, cleaned=cleaned)
    progress("window", 3, STEPS)
    return chosen if asked.keep_at is None and asked.drop_at is None else _picked(chosen, asked)


def _picked(chosen: Chosen, asked: WindowSettings) -> Chosen:
    found = picked(chosen.runs, chosen.volume, keep_at=asked.keep_at, drop_at=asked.drop_at)
    return chosen.counted(found.mask, left_out=found.dropped, left_out_voxels=chosen.kept - found.mask.count)


def _of_labels(levels: GrayLevels, labels: Labelled, asked: WindowSettings) -> tuple[Shown, Chosen]:
    chosen = _labelled(levels.volume, labels, asked)
    return Shown(chosen.volume, levels.cutting.of(chosen.volume.voxels)), chosen


def _labelled(stack: Volume, labels: Labelled, asked: WindowSettings) -> Chosen:
    runs = labels.mask(asked.select or ())
    if asked.fill_slices:
        return _interpolated(stack, runs, labels.volume)
    gaps = gaps_in(runs)
    told = f"{gaps.told}: --fill-slices interpolates them" if gaps else ""
    voxels: Any = LazyVoxels.of(MaskVoxels(runs)) if labels.volume.in_parts else runs.dense.view(np.uint8)
    return Chosen(replace(stack, voxels=voxels), runs, 0.5, np.inf, told=told, walls=labels.walls)


def _interpolated(stack: Volume, runs: RunMask, labels: Volume) -> Chosen:
    """Fill the slices between labelled ones, which looks at all of them at once."""
    if labels.in_parts:
        raise UsageError(
            "slices are filled in memory alone", found="--fill-slices, and a study that is read part by part",
            hint="the same without it, or a study that fits into the memory",
        )  # fmt: skip
    volume, told = filled_slices(runs.dense, stack)
    return Chosen(volume, RunMask.of([volume.voxels > 0]), 0.0, np.inf, told=told)


def _of_levels(levels: GrayLevels, asked: WindowSettings) -> tuple[Shown, Chosen]:
    """Window a study whose padding is background: what its header names, and what is found where no window is given."""
    given = asked.lower is not None or asked.upper is not None
    shown = levels.shown(guessed=not given)
    lower, upper = window_limits(levels.volume, shown.cut, asked, partial(otsu_in, levels.cut, shown.padding))
    runs = window_in(shown.cut, lower=lower, upper=upper, layers=asked.layers)
    counts = Counts(padding=shown.padded, named_padding=shown.named)
    return shown, Chosen(shown.volume, runs, lower, upper, counts)


def _within(runs: RunMask, inside: RunMask) -> RunMask:
    runs = runs & inside
    if not runs.count:
        raise EmptyError("nothing of the window lies in the box", expected="a window with voxels in --roi")
    return runs


def _parts(chosen: Chosen, shown: Shown, stack: Volume, asked: WindowSettings) -> Chosen:
    """Leave out components, and what is no body; where it is asked for, fill or look into the body."""
    cut = shown.cut
    ct = stack.layers == 1 and (stack.unit == "HU" or asked.preset is not None)
    guessed, keep = asked.keep == "auto", asked.keep
    if keep == "all":
        return chosen
    if asked.preset == "lung" and guessed:
        return _inside_body(chosen, shown)
    if guessed:
        keep = "body" if ct and asked.select is None and is_dense(chosen.runs, cut) else "all"
    if keep == "body" and not ct:
        raise UsageError(
            "the body is found in Hounsfield units, which the study is not in", found="--keep = body",
            expected="a CT", hint="--keep largest",
        )  # fmt: skip
    if keep != "all":
        by_body = keep == "body"
        kept = components_of_body(chosen.runs, shown.body) if by_body else largest_component(chosen.runs)
        chosen = _some(chosen, kept, guessed=guessed)
    return _filled(chosen, cut) if asked.preset == "skin" else chosen


def _some(chosen: Chosen, kept: Components, *, guessed: bool) -> Chosen:
    """Leave components out; not all of them, where a study shows no body at all, nor most of a window on a guess."""
    voxels = chosen.counts.window
    dropped = voxels - kept.mask.count
    if dropped == voxels or (guessed and 2 * dropped > voxels):
        return chosen.counted(chosen.runs, components=kept.found, spared_voxels=dropped)
    return chosen.counted(kept.mask, components=kept.found, dropped=kept.dropped, dropped_voxels=dropped)


def _filled(chosen: Chosen, cut: Cut) -> Chosen:
    """Fill what a skin encloses."""
    filled = solid(chosen.runs, chosen.volume, cut)
    return chosen.counted(filled, lining=filled.count - chosen.kept)


def _inside_body(chosen: Chosen, shown: Shown) -> Chosen:
    """Leave out the air of the room, and then what is nowhere thick; not where nothing would be left."""
    (volume, cut), window = (shown.volume, shown.cut), chosen.counts.window
    body = components_of_body(skin_of(cut), shown.body).mask
    runs = chosen.runs & solid(body, volume, cut)
    if not runs.count:
        return chosen.counted(chosen.runs, spared_voxels=window)
    inside = runs.count
    found = replace(chosen, runs=runs, counts=replace(chosen.counts, window=inside))
    kept = _some(found, thick_components(runs, volume, cut), guessed=True)
    return kept.counted(kept.runs, window=window, room=window - inside)
