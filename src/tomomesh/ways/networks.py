"""One network a slice (the paper's way): networks -> regions -> points -> cubes -> mesh that rests on the points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..stage import Stage, folded
from .cubes import surface_on_cubes
from .rings import BETWEEN, inside_of, of_networks, segment_by_rings
from .sections import body_of_cubes, networks_on_slices
from .way import CUBES, POINTS, SPRINGS, TRAINING, Way, parameters

if TYPE_CHECKING:
    from ..model.networks import Networks
    from ..progress import Progress
    from ..results import Segmentation, Surface
    from ..settings import Settings


def surface_by_networks(found: Segmentation[Networks], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn the neurons of all slices into a closed surface."""
    inside = inside_of(found, settings)
    made = surface_on_cubes(found.points, found.sampling.spacing_mm, settings, progress, inside.value)
    return folded(made.value, inside, made)


RINGS = {"network": ("ring",)}
"""The network for which there is a choice of what draws the mesh."""
WAY = Way(
    applies=lambda settings, input: input not in POINTS,
    because=lambda settings, input: "on networks whose neurons draw the mesh",
    reads=TRAINING | CUBES | SPRINGS | parameters(*BETWEEN, attraction=RINGS),
    segment=segment_by_rings,
    surface=surface_by_networks,
    of_networks=of_networks,
    of_body=body_of_cubes,
    pictures=networks_on_slices,
)
