"""Which parameters matter beside certain values of others alone, on whatever way to a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

ONLINE, BATCH = {"training": ("online",)}, {"training": ("batch",)}
POINTS = {"input": ("cloud", "stack")}

MATTERS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "layers": {"input": ("color",)},
    "inputs": {"input": ("color",)},
    "signal": {"contours": ("one", "components")},
    "iterations": ONLINE,
    "epochs": BATCH,
    "start": {"contours": ("one", "components")},
    "alpha": ONLINE,
    "alpha_fall": ONLINE,
    "alpha_power": {**ONLINE, "alpha_fall": ("power",)},
    "radius_power": {"radius_fall": ("power",)},
    "even": {"network": ("chain", "ring")},
    "filled": POINTS,
    "units": POINTS,
    "local_origin": POINTS,
    "thickness": {"input": ("stack",)},
    "allow_far": {"input": ("gray", "color", "stack")},
}
"""Parameter to the values of others, or the inputs (gray or color study, cloud or stack), beside which it changes
anything."""
