"""The ways from data to a mesh: one table, and one module a way."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..settings import Settings
    from .way import Way

WAYS = {
    "walls": "a label map, --shared-walls: the walls between all labels as one net, of which each mesh is a part",
    "voxels": "a study, --way voxels: the window's own boundary, where gray levels cross its bounds",
    "space": "a study, --way sphere, --network torus or --space volume: one network in space, and its own faces",
    "contours": "a study, --way contours: several rings a slice, closed between the slices",
    "rings": "a study, --way ring: one ring a slice, cubes around its neurons, a mesh on the surface under them",
    "networks": "any other study: one network a slice, cubes around its neurons, a mesh that rests on them",
    "filled": "points, --filled: the boundary of the solid that they fill",
    "nearest": "points, --attraction nearest: cubes around them, a mesh that rests on the points themselves",
    "stack": "points on parallel slices: each slice's inside, and the shape between the slices",
    "sheet": "points, --open: a one-sided sheet with borders",
    "cloud": "any other points: cubes around them, a mesh that rests on the surface under them",
}
"""Name of a module of this folder to what it is for; the first one that applies is taken."""


def way_of(name: str) -> Way:
    """Return a way by its name."""
    found: Way = import_module(f"{__name__}.{name}").WAY
    return replace(found, name=name)


def choose_way(settings: Settings, input: str) -> str:
    """Return the name of the way for these settings and this input, a key of `tomomesh.ways.way.INPUTS`."""
    return next(name for name in WAYS if way_of(name).applies(settings, input))
