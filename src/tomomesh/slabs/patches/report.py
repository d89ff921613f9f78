"""The quality of a mesh in patches, as `tomomesh.measure.report.assess` tells it of a whole one."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ...measure.components import LISTED
from ...measure.shape import unfolded
from .cavities import places_in
from .crossing import crossing_in
from .seams import whole_of
from .shapes import shapes_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .patch import Patches
    from .seams import Gathered

    Floats = NDArray[np.float64]


def assess_patches(patches: Patches, whole: Gathered | None = None, *, cavities: int = 0) -> dict[str, Any]:
    """Measure a mesh that is never whole.

    Parameters
    ----------
    patches : Patches
        One face at least, and finite vertices; it may have borders.
    whole : Gathered, optional
        What was counted on it, where that is known already.
    cavities : int
        Components that may face inward.

    Returns
    -------
    dict
        What `tomomesh.measure.report.assess` tells, to the last bit, but for what asks for all vertices in one place:
        the median edge of each component, whether a mesh is sound after welding in which 32 bits join vertices, and how
        far points lie from it.
    """
    whole = whole_of(patches, cavities=cavities) if whole is None else whole
    counts, table = whole.topology, whole.table
    found: dict[str, Any] = {"vertices": patches.vertex_count, "faces": patches.face_count, **asdict(counts)}
    closed = counts.boundary_edges == 0
    found |= {
        "pieces": counts.components - cavities, "cavities": cavities, "closed": closed, "sound": counts.sound,
    }  # fmt: skip
    if patches.distinct(np.float32) == patches.vertex_count:
        found["sound_after_welding"] = counts.sound
    found["area_mm2"] = float(unfolded(table.areas.sum(axis=0)[None])[0])
    found["volume_mm3"] = float(unfolded(table.volumes.sum(axis=0)[None])[0]) if closed else None
    shapes, ends = shapes_in(patches, whole)
    crossing = np.bincount(whole.numbers, crossing_in(patches), len(table.faces)).astype(np.int64)
    found |= shapes | {"self_intersections": int(crossing.sum())}
    found["cavity_places_mm"] = places_in(patches, whole, cavities).tolist() if closed else []
    found["per_component"] = _components(whole, ends, crossing)
    return found | {"components_not_listed": counts.components - len(found["per_component"])}


def _components(whole: Gathered, ends: Floats, crossing: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return one dictionary a component, that of the largest area first."""
    table, areas = whole.table, unfolded(whole.table.areas)
    largest = np.argsort(-areas, kind="stable")[:LISTED]
    euler = table.vertices - table.edges + table.faces
    volumes = zip(table.borders[largest], unfolded(table.volumes)[largest].tolist(), strict=True)
    columns: dict[str, list[Any]] = {
        "faces": table.faces[largest].tolist(),
        "area_mm2": areas[largest].tolist(),
        "volume_mm3": [None if borders else volume for borders, volume in volumes],
        "genus": (1 - (euler + table.loops) // 2)[largest].tolist(),
        "boundary_edges": table.borders[largest].tolist(),
        "boundary_loops": table.loops[largest].tolist(),
        "shortest_edge_mm": ends[0, largest].tolist(),
        "longest_edge_mm": ends[1, largest].tolist(),
        "self_intersections": crossing[largest].tolist(),
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
