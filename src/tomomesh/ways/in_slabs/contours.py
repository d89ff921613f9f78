"""Several rings a slice, and nothing whole: networks -> levels around the rings -> mesh in pieces, slab by slab."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...memory.heap import give_back
from ...slabs.surface import Asked, surface_in_slabs
from ...stage import folded, measured
from ..contours import followed_by, levels_of_rings, segment_by_contours
from .voxels import told_of_slabs

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...followed import Followed
    from ...isosurface.run_mask import RunMask
    from ...model.points import PointSet
    from ...model.volume import Volume
    from ...progress import Progress
    from ...segmentation.study import Selected
    from ...settings import Settings
    from ...slabs.cuts import Cuts
    from ...slabs.keep import Slabs
    from ...slabs.surface import SlabSurface
    from ...stage import Stage


def contours_in_slabs(
    kept: Selected, settings: Settings, slabs: Slabs, cuts: Callable[[Volume, RunMask], Cuts], progress: Progress
) -> Stage[tuple[SlabSurface, PointSet, Followed]]:
    """Train a ring on every contour, and let a net around what they enclose come to rest where they pass.

    As `tomomesh.ways.contours` does it in memory; what it should enclose at least is not compared.

    Parameters
    ----------
    kept : Selected
    settings : Settings
    slabs : Slabs
    cuts : callable
        Told the levels around the rings and what lies inside, returns where these are cut.
    progress : callable

    Returns
    -------
    Stage
        Of the surface, of the neurons, and of what the surface is to follow.
    """
    threads, surface = settings.run.threads, "outer" if settings.cubes.surface == "outer" else "all"
    found = segment_by_contours(kept, settings, progress)
    follows = measured("quality", followed_by, found.value, threads)
    give_back()
    levels = measured("contours", levels_of_rings, found.value, threads)
    volume, inside = levels.value
    give_back()
    asked = Asked(inside, volume.voxels, volume.affine, lower=0.0, surface=surface)
    made = measured(
        "fit", surface_in_slabs, asked, cuts(volume, inside), settings.fit, slabs, threads=threads, progress=progress
    )
    told = told_of_slabs(made.value, labels=False)
    return folded((made.value, found.value.points, follows.value), found, follows, levels, made, told)
