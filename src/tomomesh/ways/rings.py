"""One ring a slice: networks -> regions -> points -> cubes -> mesh that rests on the surface under the rings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from ..followed import outline_followed
from ..isosurface.crossings import Levels
from ..measure.rings import assess_contours
from ..model.lattice import other_number
from ..results import Enclosed, Segmentation
from ..segmentation.contours.inputs import share_of_holes, slices_with_several
from ..segmentation.networks.slices import ByLayer, Slices
from ..segmentation.networks.training import regions, train_study
from ..segmentation.networks.under_rings import surface_under
from ..segmentation.sample import sample
from ..som.schedules import schedule_warnings
from ..stage import Stage, folded, measured, timed
from .cubes import Inside, surface_on_cubes
from .sections import body_of_cubes, missed, networks_on_slices, sampling_found
from .way import CUBES, POINTS, TRAINING, Way, parameters

if TYPE_CHECKING:
    from ..model.networks import Networks
    from ..model.sliced import Sliced
    from ..progress import Progress
    from ..results import Surface
    from ..segmentation.study import Selected
    from ..settings import Settings

CROWDED = 0.25
"""Share of the slices with several components side by side over which one network a slice is warned of. A warning's
threshold, chosen: no mesh depends on it."""
BETWEEN = ("bridge", "even", "caps", "cell_from", "tracking")
"""What is read, besides, of networks whose points are laid in cubes."""
HOLES = 0.15
"""Area of the holes in the slices over that of the window from which an outline that fills them is warned of. A
warning's threshold, chosen: no mesh depends on it."""


def segment_by_rings(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[Networks]]:
    """Train a network on every slice, and place its neurons in space."""
    study, mask, run = kept.study, kept.chosen.runs, settings.run
    trained = measured(
        "networks", train_study, mask, settings.network, layers=_layers(kept, settings),
        levels=levels_of(kept, settings), pixel_mm=study.spacing_mm[:2], seed=run.seed, threads=run.threads,
        progress=progress,
    )  # fmt: skip
    labels = partial(regions, mask, trained.value, pixel_mm=study.spacing_mm[:2], threads=run.threads)
    placed = measured(
        "points", sample, trained.value, study, caps=settings.cubes.caps, bridge=settings.network.bridge,
        cell_from=settings.cubes.cell_from,
    )  # fmt: skip
    sampling = placed.value
    found = Segmentation(
        study, kept.plane, mask, labels, sampling.points, sampling, trained.value,
        stages=(partial(_rings_measured, trained.value, study.spacing_mm[:2]),),
    )  # fmt: skip
    return folded(found, trained, _networks_found(trained.value, kept, settings), placed, sampling_found(placed.value))


def slices_of(kept: Selected, settings: Settings) -> Slices:
    """Return what the networks of a study are shown, one slice as in all of them."""
    return Slices.of(
        kept.chosen.runs, _layers(kept, settings), levels_of(kept, settings), settings.network,
        kept.study.spacing_mm[:2], settings.run.seed, 0,
    )  # fmt: skip


def surface_by_rings(found: Segmentation[Networks], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn the rings of all slices into a closed surface."""
    under = measured("points", surface_under, found.source, found.sampling, found.volume)
    inside = inside_of(found, settings)
    made = surface_on_cubes(
        found.points, found.sampling.spacing_mm, settings, progress, inside.value, under.value
    )  # fmt: skip
    return folded(made.value, under, inside, made)


@timed("quality")
def inside_of(found: Segmentation[Networks], settings: Settings) -> Stage[Inside]:
    """Tell what is known of the inside of networks, and what of the window they are to follow."""
    follows = outline_followed(
        found.runs, found.volume, outlined=bool(found.source.outlined), threads=settings.run.threads
    )  # fmt: skip
    follows = follows if settings.cubes.caps else follows.as_closed(follows.what)
    return Stage(Inside(found.sampling.volume_mm3, Enclosed.window(found).volume, found.runs, follows))


def levels_of(kept: Selected, settings: Settings) -> Levels:
    """Return the gray levels of a study, with the window on them."""
    chosen = kept.chosen
    return Levels(chosen.volume.voxels, chosen.lower, chosen.upper, settings.window.layers)


def _layers(kept: Selected, settings: Settings) -> Sliced | None:
    """Return the window of each layer (K, J, I, L), where networks are shown layers."""
    chosen = kept.chosen
    if chosen.volume.layers == 1 or settings.network.inputs != "layers":
        return None
    return ByLayer(chosen.volume, chosen.runs, chosen.lower, chosen.upper)


def _networks_found(networks: Networks, kept: Selected, settings: Settings) -> Stage[None]:
    """Tell what was trained, and what one network a slice does not show."""
    without, lost = missed(networks.slices, kept.chosen.runs)
    stats: dict[str, dict[str, Any]] = {
        "networks": {
            "topology": networks.lattice.name,
            "neurons": len(networks.lattice),
            "trained": len(networks.slices),
            "signal": "boundary" if networks.outlined else "region",
            "pixels": int(networks.pixels.sum()),
            "strays": int(networks.strays.sum()),
            "slices_without": without,
        }
    }
    other = other_number(networks.lattice, settings.network.neurons)
    told = (*schedule_warnings(settings.network), *((other,) if other else ()))
    return Stage(None, stats, (*told, *lost, *_overlooked(networks, kept, settings)))


def _rings_measured(networks: Networks, pixel_mm: tuple[float, float]) -> Stage[None]:
    """Measure the rings, or the chains, once the report is read."""
    if not len(networks.lines):
        return Stage(None)
    closed = networks.lattice.name == "ring"
    return Stage(None, {"rings": assess_contours(networks.lines, pixel_mm, closed=closed)})


def _overlooked(networks: Networks, kept: Selected, settings: Settings) -> list[str]:
    """Warn where many slices hold several components, and of outlines that fill what is not in the window."""
    warnings, threads = [], settings.run.threads
    several = slices_with_several(kept.chosen.runs, threads)
    if several > CROWDED * len(networks.slices):
        warnings.append(
            f"{several} slices hold several components side by side: --contours components has a ring for each"
        )
    share = share_of_holes(kept.chosen.runs, threads) if networks.outlined else 0.0
    if share > HOLES:
        warnings.append(f"holes of {share:.0%} of the window's area are filled: --way contours follows them too")
    return warnings


def of_networks(report: dict[str, Any]) -> list[str]:
    """Say what was trained."""
    networks = report["networks"]
    return [
        f"networks  {networks['trained']} {networks['topology']}s of {networks['neurons']} neurons on the window's "
        f"{'outline' if networks['signal'] == 'boundary' else 'pixels'}, {networks['strays']} stray pixels dropped"
    ]


WAY = Way(
    applies=lambda settings, input: (
        input not in POINTS and settings.network.topology == "ring" and settings.fit.attraction != "nearest"
    ),
    because=lambda settings, input: "on a ring in each slice",
    reads=TRAINING | CUBES | parameters(*BETWEEN, "attraction", "damping", "step"),
    segment=segment_by_rings,
    surface=surface_by_rings,
    of_networks=of_networks,
    of_body=body_of_cubes,
    pictures=networks_on_slices,
)
