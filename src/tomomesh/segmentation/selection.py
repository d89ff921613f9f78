"""What of a study is kept: the voxels of a window or of labels, and which of their components."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError, UsageError
from .body import Components, components_of_body, is_dense, largest_component
from .labels import select
from .window import choose_window, window

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.volume import Volume
    from ..settings import Settings, WindowSettings
    from .window import Limit


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
    found, dropped : int
        Components of the window, and those that were left out; 0 where all were to be kept.
    dropped_voxels : int
    spared_voxels : int
        Voxels that lie in no body, and were kept for all that: for being all of the window, or on a guess most of it.
    """

    volume: Volume
    mask: NDArray[np.bool_]
    lower: Limit
    upper: Limit
    found: int = 0
    dropped: int = 0
    dropped_voxels: int = 0
    spared_voxels: int = 0


def choose(stack: Volume, labels: Volume | None, settings: Settings, inside: NDArray[np.bool_] | None = None) -> Chosen:
    """Return what the settings keep of a study.

    Parameters
    ----------
    stack : Volume
    labels : Volume or None
        A label map on its grid, for ``select``; where there is none, the study is the label map itself.
    settings : Settings
    inside : (K, J, I) bool array, optional
        The voxels that may be kept.

    Raises
    ------
    UsageError, EmptyError
        As `window` and `select`.
    """
    asked = settings.window
    if asked.select is None:
        lower, upper = choose_window(stack, asked)
        chosen = Chosen(stack, window(stack, lower=lower, upper=upper, layers=asked.layers), lower, upper)
    else:
        mask = select(stack if labels is None else labels, asked.select)
        chosen = Chosen(replace(stack, voxels=mask.view(np.uint8)), mask, 0.5, np.inf)
    if inside is not None:
        chosen = replace(chosen, mask=_within(chosen.mask, inside))
    return _some(chosen, _kept_components(chosen, stack, asked), guessed=asked.keep == "auto")


def _within(mask: NDArray[np.bool_], inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    mask = mask & inside
    if not mask.any():
        raise EmptyError("nothing of the window lies in the box", expected="a window with voxels in --roi")
    return mask


def _kept_components(chosen: Chosen, stack: Volume, asked: WindowSettings) -> Components | None:
    """Return the components that are kept; None where all are."""
    ct = stack.layers == 1 and (stack.unit == "HU" or asked.preset is not None)
    keep = asked.keep
    if keep == "auto":
        keep = "body" if ct and asked.select is None and is_dense(chosen.mask, stack) else "all"
    if keep == "largest":
        return largest_component(chosen.mask)
    if keep == "all":
        return None
    if not ct:
        raise UsageError(
            "the body is found in Hounsfield units, which the study is not in", found="--keep = body",
            expected="a CT", hint="--keep largest",
        )  # fmt: skip
    return components_of_body(chosen.mask, stack)


def _some(chosen: Chosen, kept: Components | None, *, guessed: bool) -> Chosen:
    """Leave components out; not all of them, where a study shows no body at all, nor most of a window on a guess."""
    if kept is None:
        return chosen
    voxels = int(np.count_nonzero(chosen.mask))
    dropped_voxels = voxels - int(np.count_nonzero(kept.mask))
    if dropped_voxels == voxels or (guessed and 2 * dropped_voxels > voxels):
        return replace(chosen, found=kept.found, spared_voxels=dropped_voxels)
    return replace(
        chosen, mask=kept.mask, found=kept.found, dropped=kept.dropped, dropped_voxels=dropped_voxels
    )  # fmt: skip
