"""No network, and nothing whole: the boundary of the window's own voxels -> mesh in pieces, slab by slab."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import UsageError
from ...followed import Followed
from ...judgement import follow_apart
from ...segmentation.slabwise.sources import MaskVoxels
from ...settings import option_of
from ...slabs.patches.following import apart_in
from ...slabs.patches.patch import patches_of
from ...slabs.patches.promise import check_patches
from ...slabs.patches.report import assess_patches
from ...slabs.surface import Asked, surface_in_slabs
from ...stage import Stage, folded, timed
from ..sections import net_found

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...progress import Progress
    from ...segmentation.selection import Chosen
    from ...segmentation.study import Selected
    from ...settings import Settings
    from ...slabs.cuts import Cuts
    from ...slabs.keep import Slabs
    from ...slabs.patches.patch import Patches
    from ...slabs.patches.seams import Gathered
    from ...slabs.surface import SlabSurface

WHOLE = ("smooth", "edge", "target_faces")
"""Parameters of a run that need the whole mesh at once."""


def require_slabs(settings: Settings) -> None:
    """Refuse what cannot be done of a mesh that is never whole.

    Raises
    ------
    UsageError
    """
    asked = [option_of(name) for name in WHOLE if getattr(settings.run, name)]
    asked += ["a part to print"] * settings.printing.asked
    if asked:
        raise UsageError(
            "this needs the whole mesh at once", found=f"{asked[0]}, and a mesh that is made slab by slab",
            hint="the same without it; `tomomesh print` where the mesh fits into the memory",
        )  # fmt: skip


@timed("fit")
def mesh_in_slabs(
    kept: Selected, settings: Settings, slabs: Slabs, cuts: Cuts, progress: Progress
) -> Stage[SlabSurface]:
    """Let a net around the voxels come to rest, as `tomomesh.ways.voxels` does it in memory.

    Voxels of thick slices are not divided.
    """
    asked = _asked(kept.chosen, settings)
    made = surface_in_slabs(asked, cuts, settings.fit, slabs, threads=settings.run.threads, progress=progress)
    points = {"unit": "mm", "count": made.squares, "spacing_mm": max(kept.study.spacing_mm)}
    told = told_of_slabs(made, labels=settings.window.select is not None)
    return folded(made, Stage(None, {"points": points}), told)


def _asked(chosen: Chosen, settings: Settings) -> Asked:
    """Ask for the boundary of the voxels that are kept; of labels that all are, they tell all that there is to know."""
    volume, runs = chosen.volume, chosen.runs
    source = getattr(volume.voxels, "source", None)
    alone = isinstance(source, MaskVoxels) and source.mask.count == runs.count
    surface = "outer" if settings.cubes.surface == "outer" else "all"
    return Asked(
        runs, None if alone else volume.voxels, volume.affine, chosen.lower, chosen.upper, settings.window.layers,
        surface,
    )  # fmt: skip


def told_of_slabs(made: SlabSurface, *, labels: bool) -> Stage[None]:
    """Tell of the voxels, and how the net came to rest, as `tomomesh.ways.sections.boundary_found` does."""
    stats: dict[str, dict[str, Any]] = {
        "voxels": {
            "added_for_composition": made.added,
            "interpolated": not made.stepped,
            "divided_into": 1,
            "split_in_four": int(made.mesh.counts[:, 1].sum()),
        },
        "surface": {"square_faces": made.squares},
        "slabs": {"count": len(made.mesh.pieces)},
    }
    return folded(None, Stage(None, stats), net_found(made.trace, of_mask=made.stepped and not labels))


def followed_by(made: SlabSurface, affine: NDArray[np.float64]) -> Followed:
    """Return what a mesh of a window's own voxels is to follow."""
    return Followed("voxels", affine, made.crossings, float(made.enclosed))


@timed("quality")
def checked_in_slabs(made: SlabSurface, kept: Selected, progress: Progress) -> Stage[tuple[Patches, Gathered, int]]:
    """Check across all seams what is promised of a mesh; return it as patches, what was counted, and its cavities.

    Raises
    ------
    InternalCheckError
    """
    progress("checks", 0, 1)
    across = np.linalg.inv(kept.study.affine)[2, :3]  # at right angles to the slices, also where these are tilted
    patches = patches_of(made.mesh, tuple(map(float, across)))
    whole = check_patches(patches, cavities=made.cavities)
    progress("checks", 1, 1)
    found, inside = whole.topology.components, made.enclosed
    told = {"found": found, "cavities": made.cavities, "taken": found, "debris": 0, "enclosed_cubes": inside}
    return Stage((patches, whole, made.cavities), {"surface": told})


@timed("quality")
def followed_in_slabs(patches: Patches, followed: Followed, settings: Settings) -> Stage[None]:
    """Refuse a mesh that does not follow what it was made from, as `tomomesh.finish.finish` does.

    Raises
    ------
    GeometryError
    """
    return follow_apart(followed, apart_in(patches, followed, settings.run.threads), settings)


@timed("quality")
def measured_in_slabs(patches: Patches, whole: Gathered, cavities: int) -> Stage[None]:
    """Measure a mesh that is never whole."""
    return Stage(None, {"quality": assess_patches(patches, whole, cavities=cavities)})
