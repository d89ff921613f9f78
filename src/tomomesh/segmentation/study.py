"""What of a study is looked at: its slices, the part that matters, and the voxels that are kept of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..model.volume import AXES, Volume, order_along
from ..progress import silent
from ..stage import Stage, folded, measured
from .body import Cleaned
from .crop import crop, inside_roi
from .gray_levels import GrayLevels
from .labels import Labelled, doubted, fitting, labels_counted, whole
from .selection import Chosen, choose
from .slabwise.cut import HERE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.run_mask import RunMask
    from ..progress import Progress
    from ..settings import Settings
    from .selection import Counts
    from .slabwise.cut import Cutting
    from .window import Limit

CUT_OFF = 0.25
"""Pixels of an end slice over those of the fullest from which a window is told to go on beyond the study. Only a note
depends on it: a ball that ends within a slice has less there."""
APART = 4
"""One slice in so many is looked at for labels. Only a warning depends on it; labels fill many slices."""


@dataclass(frozen=True)
class Selected:
    """A study, and what is kept of it.

    Attributes
    ----------
    study : Volume
        Its slices along K.
    plane : str
        Of the slices: axial, coronal or sagittal.
    chosen : Chosen
        The voxels that are kept.
    """

    study: Volume
    plane: str
    chosen: Chosen

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The voxels that are kept, (K, J, I)."""
        return self.chosen.mask


@dataclass(frozen=True)
class LaidOut:
    """A study as it is looked at, before any voxel is chosen: the same for all of its labels.

    Attributes
    ----------
    volume : Volume
        The part of it that is asked for, its slices along K.
    plane : str
        Of the slices: axial, coronal or sagittal.
    labels : Labelled or None
        Where labels choose: the label map on its grid, itself or one beside it.
    inside : RunMask or None
        The voxels that may be chosen, where not all may.
    cropped : dict or None
    cutting : Cutting
        How it is looked at, slab by slab.
    """

    volume: Volume
    plane: str
    labels: Labelled | None
    inside: RunMask | None
    cropped: dict[str, list[int]] | None
    cutting: Cutting = HERE

    @cached_property
    def levels(self) -> GrayLevels:
        """Its gray levels, and what its windows have in common."""
        return GrayLevels(self.volume, self.cutting)

    @property
    def notes(self) -> tuple[str, ...]:
        """What its readers, and those of the label map, have decided."""
        beside = () if self.labels is None or self.labels.volume is self.volume else self.labels.volume.notes
        return self.volume.notes + beside


def lay_out(
    volume: Volume, labels: Volume | None, settings: Settings, *, labelled: bool, cutting: Cutting = HERE
) -> LaidOut:
    """Turn the slices of a study the way they are asked for, crop them, and lay a label map over them.

    Parameters
    ----------
    volume : Volume
    labels : Volume or None
        A label map; where there is none and labels choose, the study is the label map itself.
    settings : Settings
    labelled : bool
        Whether labels choose the voxels.
    cutting : Cutting, optional
        How the study is looked at, slab by slab: no result depends on it.

    Raises
    ------
    UsageError, EmptyError
        Where the input is no study, no label map, or nothing is left of it.
    """
    if not isinstance(volume, Volume):
        raise UsageError(
            "a study is a Volume", found=type(volume).__name__,
            expected="read_volume(path) or Volume.from_stored(array, affine)",
        )  # fmt: skip
    _check_labelled(labels, settings, labelled=labelled)
    volume = whole(volume, cutting) if labelled and labels is None else volume
    axis = _slice_axis(volume, settings.network.slices)
    part, box = crop(volume, settings.crop, axis)
    study = part.along(axis)
    laid = study if labels is None else fitting(labels, volume, cutting).cropped(box).along(axis)
    cropped = _cropped(tuple(box[n] for n in order_along(axis)), volume.along(axis).shape)
    found = Labelled.of(laid, cutting) if labelled else None
    return LaidOut(study, AXES[axis], found, inside_roi(study, settings.crop.roi), cropped, cutting)


def _check_labelled(labels: Volume | None, settings: Settings, *, labelled: bool) -> None:
    """Refuse what needs labels where none is chosen."""
    if settings.window.fill_slices and not labelled:
        raise UsageError("slices are filled between labels", found="--fill-slices", hint="--select with the labels")
    if labels is not None and not labelled:
        raise UsageError("no label was chosen", found="a label map", expected="--select with its labels")


def select_in(study: LaidOut, settings: Settings, progress: Progress = silent) -> Stage[Selected]:
    """Choose voxels of a study by gray level or label; raises as `choose` does."""
    chosen = measured("window", choose, study.levels, study.labels, settings, study.inside, progress)
    notes = study.notes + _dropped(chosen.value, settings) + _cut_off(chosen.value)
    section = _section(study.volume, study.plane, study.cropped, notes)
    doubt = () if study.labels is None else doubted(study.labels)
    warnings = (*_doubts(chosen.value, settings, study.cutting), *doubt)
    window = {"window": _window(chosen.value, settings)}
    selected = Selected(study.volume, study.plane, chosen.value)
    return folded(selected, Stage(None, {"study": section}), chosen, Stage(None, window, warnings))


def select_study(volume: Volume, labels: Volume | None, settings: Settings) -> Stage[Selected]:
    """Lay out a study, and choose its voxels; parameters and errors are those of `lay_out` and `select_in`."""
    return select_in(lay_out(volume, labels, settings, labelled=settings.window.select is not None), settings)


def _slice_axis(volume: Volume, slices: str) -> int:
    if slices == "auto":
        return volume.thickest_axis()
    return volume.stored_axis if slices == "stored" else AXES.index(slices)


def _section(study: Volume, plane: str, cropped: dict[str, list[int]] | None, notes: tuple[str, ...]) -> dict[str, Any]:
    columns, rows, slices = study.spacing_mm
    return {
        "slices": study.shape[0],
        "rows": study.shape[1],
        "columns": study.shape[2],
        "plane": plane,
        "column_spacing_mm": columns,
        "row_spacing_mm": rows,
        "slice_spacing_mm": slices,
        "gray_unit": study.unit,
        "crop": cropped,
        "notes": list(notes),
    }


def _cropped(box: tuple[slice, ...], sizes: tuple[int, int, int]) -> dict[str, list[int]] | None:
    """Return the first and last of the slices, rows and columns that are left of a study that was cropped."""
    kept = [[int(side.start), int(side.stop) - 1] for side in box]
    whole = kept == [[0, size - 1] for size in sizes]
    return None if whole else dict(zip(("slices", "rows", "columns"), kept, strict=True))


def _dropped(chosen: Chosen, settings: Settings) -> tuple[str, ...]:
    """Say which components a guess has left out, and what there is to say of slices without labels."""
    found, told = chosen.counts, (chosen.told,) if chosen.told else ()
    if not found.dropped or settings.window.keep != "auto":
        return told
    return (
        f"{found.dropped} of {found.components} components of the window ({found.dropped_voxels} voxels) were "
        "left out, which lie in nothing that is 12 mm thick, as a scanner's table: --keep all keeps them",
        *told,
    )


def _cut_off(chosen: Chosen) -> tuple[str, ...]:
    """Say at which end slices a window is cut off, and goes on beyond the study."""
    pixels = chosen.runs.areas()
    ends = [name for name, end in (("first", 0), ("last", -1)) if pixels[end] > CUT_OFF * pixels.max()]
    return (
        (f"the window is cut off at the {' and the '.join(ends)} slice: the surface is closed there",) if ends else ()
    )


def _window(chosen: Chosen, settings: Settings) -> dict[str, Any]:
    """Tell what the window kept, and the limits of its layers."""
    asked, runs, layers = settings.window, chosen.runs, chosen.volume.layers
    lower, upper = (chosen.lower, chosen.upper) if asked.select is None else (-np.inf, np.inf)
    return {
        "lower": _limits(lower),
        "upper": _limits(upper),
        "layers": layers,
        "joined_by": asked.layers if layers > 1 else None,
        "chosen_by": chosen_by(settings),
        "lower_from": _from("lower", lower, settings),
        "upper_from": _from("upper", upper, settings),
        "voxels": chosen.kept,
        "share": chosen.kept / math.prod(runs.shape),
        "touches_border": any(_edges(chosen)),
        **_became(chosen.counts, chosen.cleaned or Cleaned(runs)),
    }


def _became(counts: Counts, cleaned: Cleaned) -> dict[str, Any]:
    """Tell what of the window was left out, and what was filled."""
    return {
        "padding_voxels": counts.padding,
        "named_padding_voxels": counts.named_padding,
        "window_voxels": counts.window,
        "room_voxels": counts.room,
        "components": counts.components or None,
        "dropped_components": counts.dropped,
        "dropped_voxels": counts.dropped_voxels,
        "specks": cleaned.specks,
        "speck_voxels": cleaned.speck_voxels,
        "largest_speck_voxels": cleaned.largest_speck,
        "filled_pores": cleaned.pores,
        "filled_pore_voxels": cleaned.pore_voxels,
        "filled_lining_voxels": counts.lining,
        "left_out_components": counts.left_out,
        "left_out_voxels": counts.left_out_voxels,
    }


def chosen_by(settings: Settings) -> str:
    """Name what chose the window: labels, preset, given or otsu."""
    asked = settings.window
    given = asked.lower is not None or asked.upper is not None
    return "labels" if asked.select else "preset" if asked.preset else "given" if given else "otsu"


def _from(name: str, limit: Limit, settings: Settings) -> str | None:
    """Say where a bound comes from; None where there is none."""
    given = getattr(settings.window, name) is not None
    return None if np.isinf(limit).all() else "given" if given else chosen_by(settings)


def _edges(chosen: Chosen) -> list[bool]:
    """Tell of both sides of each axis whether a kept voxel lies on them."""
    sides = zip(chosen.box, chosen.runs.shape, strict=True)
    return [end for side, size in sides for end in (side.start == 0, side.stop == size)]


def _doubts(chosen: Chosen, settings: Settings, cutting: Cutting) -> list[str]:
    """Say what about a window may not be as it was meant."""
    warnings, counts = [], chosen.counts
    if 0 < counts.spared_voxels == counts.window:
        warnings.append("nothing of the window lies in a body, 12 mm thick and denser than air: all of it was kept")
    elif counts.spared_voxels:
        warnings.append(
            f"most of the window ({counts.spared_voxels} of {counts.window} voxels) lies in nothing that is "
            "12 mm thick, and was kept for all that: --keep body leaves it out"
        )
    if chosen_by(settings) == "otsu" and len(labels_counted(cutting.of(chosen.volume.voxels[::APART]))) > 1:
        warnings.append("labels of a label map were taken for gray levels: --select chooses labels")
    if any(_edges(chosen)[2:]):
        warnings.append("the window touches the border of the slices: the surface is closed along it")
    return warnings


def _limits(limit: Limit) -> float | list[float | None] | None:
    """Return a limit, or one a layer, with None where there is none; one that all layers share once."""
    found = [None if np.isinf(one) else float(one) for one in np.ravel(limit)]
    return found if len(set(found)) > 1 else found[0]
