"""The rings of one slice, looked at while they are trained once more: those that the whole study has there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .train import Ring, trained_ring

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...model.contours import Contour, Contours
    from ...som.passes import Look
    from .shown import Shown


def train_slice(study: Contours, shown: Shown, k: int, looks: Sequence[Look]) -> list[Contour]:
    """Train the rings of slice `k` of a study again, which gives the same to the last bit.

    Parameters
    ----------
    study : Contours
        All of it, as it was trained.
    shown : Shown
        What it was trained on.
    k : int
        A slice that has rings.
    looks : sequence of Look
        Who looks at each of them.
    """
    inputs, _ = shown.on(k, k + 1)[0]
    before = {one.track: one.codebook[0] for one in study.on(k - 1)}
    return [
        trained_ring(
            shown.settings, shown.seed, shown.pixel_mm, Ring(k, one.ring, inputs[one.ring], len(one), one.track),
            before.get(one.track), look,
        )
        for one, look in zip(study.on(k), looks, strict=True)
    ]  # fmt: skip
