"""What of a study is kept: the voxels of a window or of labels, and which of their components."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError, UsageError
from ..model.boxes import box_of
from .body import Cleaned, components_of_body, is_dense, largest_component, solid, thick_components, without_specks
from .contours.labelled import filled_slices, gaps_in
from .padding import all_padding, named_padding
from .window import PRESETS_HU, choose_window, window

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.walls.walls import Walls
    from ..model.boxes import Box
    from ..model.volume import Volume
    from ..settings import Settings, WindowSettings
    from .body import Components
    from .labels import Labelled
    from .window import Limit


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


@dataclass(frozen=True)
class Chosen:
    """The voxels that are kept, and where between them and the others the levels cross a bound.

    Attributes
    ----------
    volume : Volume
        The gray levels that were asked for; for labels, 1 where one of them is, else 0.
    mask : (K, J, I) bool array
    lower, upper : float or (L,) float array
        Bounds on the levels of `volume`.
    counts : Counts
    cleaned : Cleaned
        Specks and pores.
    told : str
        What is to be said of slices without labels.
    around : box or None
        Outside of which no voxel is kept, where that is known.
    walls : Walls or None
        Of all labels, where neighbors share them.
    """

    volume: Volume
    mask: NDArray[np.bool_]
    lower: Limit
    upper: Limit
    counts: Counts = field(default_factory=Counts)
    cleaned: Cleaned | None = None
    told: str = ""
    around: Box | None = None
    walls: Walls | None = None

    @cached_property
    def box(self) -> Box:
        """What the voxels that are kept lie in: outside of it nothing has to be looked at."""
        return box_of(self.mask, self.around)

    @cached_property
    def kept(self) -> int:
        """How many voxels are kept."""
        return int(np.count_nonzero(self.mask[self.box]))

    def counted(self, mask: NDArray[np.bool_], **counts: int) -> Chosen:
        """Return the same with another mask and some counts."""
        return replace(self, mask=mask, counts=replace(self.counts, **counts))


def choose(
    stack: Volume, labels: Labelled | None, settings: Settings, inside: NDArray[np.bool_] | None = None
) -> Chosen:
    """Return what the settings keep of a study.

    Parameters
    ----------
    stack : Volume
    labels : Labelled or None
        A label map on its grid, for ``select``: the study itself, or one beside it.
    settings : Settings
    inside : (K, J, I) bool array, optional
        The voxels that may be kept.

    Raises
    ------
    UsageError, EmptyError
        As `window` and `Labelled.mask`.
    """
    asked = settings.window
    chosen = _of_levels(stack, asked) if labels is None else _of_labels(stack, labels, asked)
    chosen = chosen if inside is None else replace(chosen, mask=_within(chosen.mask, inside))
    chosen = _parts(chosen.counted(chosen.mask, window=chosen.kept), stack, asked)
    if asked.keep == "all" or settings.cubes.shared_walls:  # a speck left out of one label would be a gap
        return chosen
    cleaned = without_specks(chosen.mask, chosen.around)
    return replace(chosen, mask=cleaned.mask, cleaned=cleaned)


def _of_labels(stack: Volume, labels: Labelled, asked: WindowSettings) -> Chosen:
    mask, box = labels.mask(asked.select or ())
    if asked.fill_slices:
        volume, told = filled_slices(mask, stack)
        return Chosen(volume, volume.voxels > 0, 0.0, np.inf, told=told)
    gaps = gaps_in(mask, box)
    told = f"{gaps.told}: --fill-slices interpolates them" if gaps else ""
    voxels = replace(stack, voxels=mask.view(np.uint8))
    return Chosen(voxels, mask, 0.5, np.inf, told=told, around=box, walls=labels.walls)


def _of_levels(stack: Volume, asked: WindowSettings) -> Chosen:
    """Window a study whose padding is background: what its header names, and what is found where no window is given."""
    given = asked.lower is not None or asked.upper is not None
    padded, named = all_padding(stack, guessed=not given), named_padding(stack)
    stack, changed = _as_background(stack, padded)
    lower, upper = choose_window(stack, asked, padded)
    mask = window(stack, lower=lower, upper=upper, layers=asked.layers)
    counts = [0 if one is None else int(np.count_nonzero(changed & one)) for one in (padded, named)]
    return Chosen(stack, mask, lower, upper, Counts(padding=counts[0], named_padding=counts[1]))


def _as_background(stack: Volume, padded: NDArray[np.bool_] | None) -> tuple[Volume, NDArray[np.bool_] | np.bool_]:
    """Give padding the lowest of the other levels; return also which voxels had another."""
    if padded is None:
        return stack, np.False_
    lowest = stack.voxels.min(where=~padded, initial=stack.voxels.max())
    changed = padded & (stack.voxels != lowest)
    return replace(stack, voxels=np.where(padded, lowest, stack.voxels)), changed


def _within(mask: NDArray[np.bool_], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    mask = mask & inside
    if not mask.any():
        raise EmptyError("nothing of the window lies in the box", expected="a window with voxels in --roi")
    return mask


def _parts(chosen: Chosen, stack: Volume, asked: WindowSettings) -> Chosen:
    """Leave out components, and what is no body; where it is asked for, fill or look into the body."""
    ct = stack.layers == 1 and (stack.unit == "HU" or asked.preset is not None)
    guessed, keep = asked.keep == "auto", asked.keep
    if keep == "all":
        return chosen
    if asked.preset == "lung" and guessed:
        return _inside_body(chosen)
    if guessed:
        keep = "body" if ct and asked.select is None and is_dense(chosen.mask, chosen.volume) else "all"
    if keep == "body" and not ct:
        raise UsageError(
            "the body is found in Hounsfield units, which the study is not in", found="--keep = body",
            expected="a CT", hint="--keep largest",
        )  # fmt: skip
    if keep != "all":
        by_body = keep == "body"
        kept = components_of_body(chosen.mask, chosen.volume) if by_body else largest_component(chosen.mask)
        chosen = _some(chosen, kept, guessed=guessed)
    return _filled(chosen) if asked.preset == "skin" else chosen


def _some(chosen: Chosen, kept: Components, *, guessed: bool) -> Chosen:
    """Leave components out; not all of them, where a study shows no body at all, nor most of a window on a guess."""
    voxels = chosen.counts.window
    dropped = voxels - int(np.count_nonzero(kept.mask))
    if dropped == voxels or (guessed and 2 * dropped > voxels):
        return chosen.counted(chosen.mask, components=kept.found, spared_voxels=dropped)
    return chosen.counted(kept.mask, components=kept.found, dropped=kept.dropped, dropped_voxels=dropped)


def _filled(chosen: Chosen) -> Chosen:
    """Fill what a skin encloses."""
    filled = solid(chosen.mask, chosen.volume)
    return chosen.counted(filled, lining=int(np.count_nonzero(filled) - np.count_nonzero(chosen.mask)))


def _inside_body(chosen: Chosen) -> Chosen:
    """Leave out the air of the room, and then what is nowhere thick; not where nothing would be left."""
    volume, window = chosen.volume, chosen.counts.window
    skin = volume.voxels > PRESETS_HU["skin"][0]
    mask = chosen.mask & solid(components_of_body(skin, volume).mask, volume)
    if not mask.any():
        return chosen.counted(chosen.mask, spared_voxels=window)
    inside = int(np.count_nonzero(mask))
    found = replace(chosen, mask=mask, counts=replace(chosen.counts, window=inside))
    kept = _some(found, thick_components(mask, volume), guessed=True)
    return kept.counted(kept.mask, window=window, room=window - inside)
