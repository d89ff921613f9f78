"""A label of a map among its neighbors: the squares that bound it, of the net over the walls between all -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError
from ..followed import Followed
from ..results import Segmentation, Surface
from ..segmentation.sample import Sampling
from ..settings import option_of
from ..settings import parameters as parameters_of_all
from ..stage import Stage, folded
from .sections import boundary_found, points_found
from .way import POINTS, Way, parameters

if TYPE_CHECKING:
    from ..isosurface.walls.walls import WallBoundary
    from ..progress import Progress
    from ..segmentation.study import Selected
    from ..settings import Settings

OPTION = "--shared-walls"
OWN = {
    "smooth": (0.0,), "edge": (None,), "target_faces": (None,), "fill_slices": (False,), "keep": ("auto", "all"),
    "surface": ("auto", "all"), "way": ("auto", "voxels"), "contours": ("auto", "one"), "space": ("slice",),
    "network": ("auto", "none"),
}  # fmt: skip
"""Parameters with the values that leave walls where they are; all others change each mesh by itself."""
NOTHING = np.empty(0)


def segment_by_walls(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[WallBoundary]]:
    """Take the boundary of a label as it lies between those of all others."""
    (number,) = settings.window.select or (0,)
    walls = kept.chosen.walls
    bounded = None if walls is None else walls.of(number)
    if bounded is None:
        raise EmptyError(
            "nothing is left of the label: its voxels touch at edges or corners alone, as those of others there",
            found=f"{OPTION}, label {number}", hint=f"no {OPTION}",
        )  # fmt: skip
    spacing = max(kept.study.spacing_mm)
    sampling = Sampling(bounded.points, spacing, bounded.added, NOTHING, NOTHING)
    labels = kept.mask.view(np.uint8)
    found = Segmentation(kept.study, kept.plane, kept.chosen.runs, labels, bounded.points, sampling, bounded)
    return folded(found, points_found(bounded.points, spacing, bridged=bounded.added))


def surface_by_walls(found: Segmentation[WallBoundary], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Take the mesh of a label, which lies in its cells as the net around its voxels alone would."""
    source = found.source
    made = source.made
    surface = Surface(
        found.points, source.cuberille, made.smoothed, made.mesh, made.nearest, cavities=source.cavities,
        follows=Followed("voxels", source.affine, source.crossings.positions, float(source.volumes.sum())),
        cut_off=made.cut_off,
    )  # fmt: skip
    return folded(surface, boundary_found(source, made, labels=True), _walls_found(source))


def _walls_found(source: WallBoundary) -> Stage[None]:
    """Tell with which labels a mesh shares its walls, and what of its voxels is another's than in the map."""
    labels, squares = np.unique(source.beyond[source.beyond != 0], return_counts=True)
    neighbors = {str(label): count for label, count in zip(labels.tolist(), squares.tolist(), strict=True)}
    told = {"neighbors": neighbors, "shared_faces": int(squares.sum()), "gained": source.added, "lost": source.lost}
    return Stage(None, {"walls": told})


def _body_of_walls(report: dict[str, Any]) -> list[str]:
    """Say in the summary with whom a mesh shares its walls."""
    walls, faces = report["walls"], report["surface"]["square_faces"]
    shared = f"{walls['shared_faces'] / faces:.0%} of {faces} faces shared with {len(walls['neighbors'])} label(s)"
    return [f"walls     {shared}, {walls['gained']} voxels from others, {walls['lost']} to others"]


def _require(settings: Settings) -> None:
    """Refuse what would part the walls of neighbors."""
    values = {entry.name: getattr(getattr(settings, group), entry.name) for group, entry in parameters_of_all()}
    found = [f"{option_of(name)} = {values[name]}" for name, left in OWN.items() if values[name] not in left]
    found += ["a part to print"] if settings.printing.asked else []
    if found:
        raise UsageError(
            "walls are shared no more where each mesh is changed by itself", found=f"{found[0]} with {OPTION}",
            hint=f"no {OPTION}",
        )  # fmt: skip


WAY = Way(
    applies=lambda settings, input: settings.cubes.shared_walls and input not in POINTS,
    because=lambda settings, input: f"with {OPTION}",
    reads=parameters("surface", "stiffness", "divide"),
    segment=segment_by_walls,
    surface=surface_by_walls,
    require=_require,
    of_body=_body_of_walls,
)
