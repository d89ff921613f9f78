"""The account of stage one: study, window, networks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.rings import assess_contours
from ..segmentation.labels import labels_in
from ..som.schedules import schedule_warning
from .ledger import Ledger

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.contours import Contours
    from ..model.networks import Networks, SpaceNetwork
    from ..model.volume import Volume
    from ..segmentation.selection import Chosen
    from ..segmentation.window import Limit

LEFT_OUT = 0.01
"""Share of the window in small pieces over which a network in space is warned of."""
APART = 4
"""One slice in so many is looked at for labels."""
CROWDED = 0.25
"""Share of the slices with several components side by side over which one network a slice is warned of."""
HOLES = 0.15
"""Area of the holes in the slices over that of the window from which an outline that fills them is warned of."""


class StageOne(Ledger):
    """What was read, what the window kept, and what was trained on it."""

    def study(self, volume: Volume, plane: str) -> None:
        """Note what the slices are."""
        self._sections["study"] = {
            "slices": volume.shape[0],
            "rows": volume.shape[1],
            "columns": volume.shape[2],
            "plane": plane,
            "column_spacing_mm": volume.spacing_mm[0],
            "row_spacing_mm": volume.spacing_mm[1],
            "slice_spacing_mm": volume.spacing_mm[2],
            "gray_unit": volume.unit,
            "notes": list(volume.notes),
        }

    def cropped(self, box: tuple[slice, ...], sizes: tuple[int, int, int]) -> None:
        """Note which slices, rows and columns of the whole study are left, where it was cropped."""
        kept = [[int(side.start), int(side.stop) - 1] for side in box]
        cropped = kept != [[0, size - 1] for size in sizes]
        names = ("slices", "rows", "columns")
        self._sections["study"]["crop"] = dict(zip(names, kept, strict=True)) if cropped else None

    def notes(self, notes: tuple[str, ...]) -> None:
        """Note what was decided on a label map beside the study."""
        self._sections["study"]["notes"] += notes

    def window(self, chosen: Chosen) -> None:
        """Note what the window kept, the limits of its layers, and the components that were left out."""
        asked, mask, layers = self._settings.window, chosen.mask, chosen.volume.layers
        limits = (chosen.lower, chosen.upper) if asked.select is None else (-np.inf, np.inf)
        given = asked.lower is not None or asked.upper is not None
        edges = [np.take(mask, end, axis=axis).any() for axis in range(3) for end in (0, -1)]
        self._sections["window"] = {
            "lower": _limits(limits[0]),
            "upper": _limits(limits[1]),
            "layers": layers,
            "joined_by": asked.layers if layers > 1 else None,
            "chosen_by": "labels" if asked.select else "preset" if asked.preset else "given" if given else "otsu",
            "voxels": int(mask.sum()),
            "share": float(mask.mean()),
            "touches_border": bool(any(edges)),
            "components": chosen.found or None,
            "dropped_components": chosen.dropped,
            "dropped_voxels": chosen.dropped_voxels,
        }
        if chosen.dropped and asked.keep == "auto":
            self._sections["study"]["notes"].append(
                f"{chosen.dropped} of {chosen.found} components of the window ({chosen.dropped_voxels} voxels) were "
                "left out, which lie in nothing that is 12 mm thick, as a scanner's table: --keep all keeps them"
            )
        if chosen.spared_voxels == int(mask.sum()):
            self.warn("nothing of the window lies in a body, 12 mm thick and denser than air: all of it was kept")
        elif chosen.spared_voxels:
            self.warn(
                f"most of the window ({chosen.spared_voxels} of {int(mask.sum())} voxels) lies in nothing that is 12 "
                "mm thick, and was kept for all that: --keep body leaves it out"
            )
        if self._sections["window"]["chosen_by"] == "otsu" and len(labels_in(chosen.volume.voxels[::APART])) > 1:
            self.warn("labels of a label map were taken for gray levels: --select chooses labels")
        if any(edges[2:]):
            self.warn("the window touches the border of the slices: the surface is closed along it")

    def networks(self, networks: Networks, mask: NDArray[np.bool_]) -> None:
        """Note what was trained, and which slices could not be."""
        if warning := schedule_warning(self._settings.network):
            self.warn(warning)
        signal = "boundary" if networks.outlined else "region"
        self._networks(
            networks.slices,
            mask,
            networks.lattice.name,
            len(networks.lattice),
            signal,
            networks.pixels,
            networks.strays,
        )
        self._lines(networks.lines, closed=networks.lattice.name == "ring")

    def contours(self, contours: Contours, mask: NDArray[np.bool_]) -> None:
        """Note the contours that were trained, and which slices have none."""
        each = contours.contours
        seen = {"boundary" if one.outlined else "region" for one in each}
        pixels, strays = (np.array([getattr(one, name) for one in each]) for name in ("pixels", "strays"))
        neurons = self._settings.network.neuron_count
        self._networks(contours.slices, mask, "ring", neurons, seen.pop() if len(seen) == 1 else "both", pixels, strays)
        self._lines(contours)
        crossings = self._sections["rings"]["crossings"]
        if crossings:
            self.warn(f"contours of a slice cross each other {crossings} time(s): more --neurons keep them apart")

    def space(self, network: SpaceNetwork, pieces: int, dropped: int) -> None:
        """Note the one network in space, and what of the window it does not stand for."""
        self._sections["networks"] = {
            "topology": network.lattice.name,
            "neurons": len(network.lattice),
            "trained": 1,
            "signal": "boundary" if network.outlined else "region",
            "pixels": network.inputs,
            "strays": network.strays,
            "slices_without": [],
        }
        self._sections["space"] = {"pieces": pieces, "dropped_voxels": dropped}
        voxels = self._sections["window"]["voxels"]
        if pieces > 1:
            self.warn(f"the window is in {pieces} pieces, and one network spans them all")
        if dropped > LEFT_OUT * voxels:
            self.warn(f"{dropped} of {voxels} voxels of the window lie in small pieces, and were left out")

    def crowded(self, slices: int, trained: int) -> None:
        """Warn of one network where many slices hold several components side by side."""
        if slices > CROWDED * trained:
            self.warn(
                f"{slices} slices hold several components side by side: --contours components has a ring for each"
            )

    def filled_holes(self, share: float) -> None:
        """Warn of outlines that fill much that is not in the window."""
        if share > HOLES:
            self.warn(f"holes of {share:.0%} of the window's area are filled: --contours loops follows them too")

    def _networks(
        self, slices: NDArray[np.int32], mask: NDArray[np.bool_], topology: str, neurons: int, signal: str,
        pixels: NDArray[np.int64], strays: NDArray[np.int64],
    ) -> None:  # fmt: skip
        without = np.setdiff1d(np.arange(len(mask)), slices)
        self._sections["networks"] = {
            "topology": topology,
            "neurons": neurons,
            "trained": len(slices),
            "signal": signal,
            "pixels": int(pixels.sum()),
            "strays": int(strays.sum()),
            "slices_without": without.tolist(),
        }
        inside = (without > slices[0]) & (without < slices[-1])
        missed = without[inside | mask[without].any(axis=(1, 2))]
        if len(missed):
            named = ", ".join(map(str, missed[:8])) + (", ..." if len(missed) > 8 else "")
            self.warn(f"{len(missed)} slice(s) without pixels enough for a network: {named}")

    def _lines(self, contours: Contours, *, closed: bool = True) -> None:
        if len(contours):
            self._sections["rings"] = assess_contours(contours, self._pixel_mm, closed=closed)

    @property
    def _pixel_mm(self) -> tuple[float, float]:
        study = self._sections["study"]
        return study["column_spacing_mm"], study["row_spacing_mm"]


def _limits(limit: Limit) -> float | list[float | None] | None:
    """Return a limit, or one a layer, with None where there is none; one that all layers share once."""
    found = [None if np.isinf(one) else float(one) for one in np.ravel(limit)]
    return found if len(set(found)) > 1 else found[0]
