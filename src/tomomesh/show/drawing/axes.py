"""Axes, scales of colors and legends: what a panel is read by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .letters import width as width_of
from .marks import dots, lines
from .style import INK, MUTED, RULE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .page import Page, Panel
    from .style import Ramp

    Floats = NDArray[np.float64]

TICK = 3
"""Length of a tick in points."""
NAME = 19
"""Points between an axis and its name."""
SMALL = 8.5
"""Letters of axes and legends, in points."""


def ticks(low: float, high: float, most: int = 6, *, whole: bool = False) -> Floats:
    """Return at most `most` multiples of 1, 2 or 5 times a power of ten within the limits; `whole` numbers only."""
    low, high = min(low, high), max(low, high)
    power = 10.0 ** np.floor(np.log10(max(high - low, 1e-300) / most))
    for step in power * np.array([1, 2, 5, 10, 20]):
        places = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
        if len(places) <= most and (step >= 1 or not whole):
            return np.asarray(places)
    return np.arange(np.ceil(low), np.floor(high) + 1)[:most]


def decades(low: float, high: float, most: int = 6) -> Floats:
    """Return the powers of ten within the limits, thinned to `most`; where there are few, twice and five times too."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    every = 10.0 ** np.arange(first, last + 1)
    kept = every[(every >= low) & (every <= high)]
    if len(kept) > 2:
        return np.asarray(kept[:: -(-len(kept) // most)], np.float64)
    finer = np.outer(every, [1.0, 2.0, 5.0]).ravel()
    return np.asarray(finer[(finer >= low) & (finer <= high)], np.float64)


def written(values: Floats) -> list[str]:
    """Write the ticks of an axis with as many places as they need."""
    step = float(np.diff(values).min()) if len(values) > 1 else abs(float(values[0])) if len(values) else 1.0
    size = float(np.abs(values).max()) if len(values) else 0.0
    if size >= 1e6 or 0 < size < 1e-3:
        return [f"{value:g}" for value in values]
    places = max(0, int(np.ceil(-np.log10(step) - 1e-9))) if step > 0 else 0
    return [f"{value + 0.0:.{places}f}" for value in values]


def rule(
    ax: Panel, *, along: str = "", up: str = "", x: Floats | None = None, y: Floats | None = None,
    words: Sequence[str] | None = None, grid: bool = False, color: str = MUTED,
) -> None:  # fmt: skip
    """Rule a panel at the left and below, with ticks in x and in y, and name both axes.

    `words` are written at the ticks in y in place of their numbers; a `grid` leads across from them.
    """
    page, (left, bottom, right, top) = ax.page, ax.limits
    x = ticks(left, right) if x is None else x
    y = ticks(bottom, top) if y is None else y
    tick, (x0, y0, x1, y1) = page.points(TICK), ax.box
    across, down = (
        ax.place(np.column_stack([x, np.full(len(x), bottom)])),
        ax.place(np.column_stack([np.full(len(y), left), y])),
    )
    for place in down if grid else ():
        ax.rule(np.array([place, [x1, place[1]]]), 0.6, RULE)
    ax.rule(np.array([[x0, y0], [x0, y1]]), 0.6, color)
    ax.rule(np.array([[x0, y1], [x1, y1]]), 0.6, color)
    for place, word in zip(across, written(x), strict=True):
        ax.rule(place + np.array([[0, 0], [0, tick]]), 0.6, MUTED)
        page.write(word, (place[0], place[1] + 2 * tick), color=MUTED, align=0.5, up=1, size=SMALL)
    broad = 0.0
    for place, word in zip(down, written(y) if words is None else words, strict=True):
        ax.rule(place - np.array([[tick, 0], [0, 0]]), 0.6, MUTED)
        page.write(word, (place[0] - 2 * tick, place[1]), color=MUTED, align=1, up=0.5, size=SMALL)
        broad = max(broad, width_of(word, page.points(SMALL)))
    page.write(along, ((x0 + x1) / 2, y1 + page.points(NAME)), color=MUTED, align=0.5, up=1, size=SMALL)
    page.write(
        up, (x0 - 2 * tick - broad - page.points(5), (y0 + y1) / 2), color=MUTED, align=0.5, upward=True, size=SMALL
    )


def around(ax: Panel, color: str = RULE) -> None:
    """Put a thin frame around a panel."""
    x0, y0, x1, y1 = ax.box
    for ends in ([[x0, y0], [x1, y0]], [[x0, y1], [x1, y1]], [[x0, y0], [x0, y1]], [[x1, y0], [x1, y1]]):
        ax.rule(np.array(ends), 0.6, color)


def color_bar(
    page: Page, box: Floats, low: float, high: float, colors: Ramp, name: str, *, whole: bool = False
) -> None:
    """Draw a scale of colors in a box (left, top, right, bottom) of a page, its numbers at the right or below."""
    x0, y0, x1, y1 = np.round(box).astype(int)
    upright, tick = y1 - y0 > x1 - x0, page.points(TICK)
    shades = np.round(colors((np.arange(y1 - y0 if upright else x1 - x0) + 0.5) / max(y1 - y0, x1 - x0))).astype(
        np.uint8
    )
    page.pixels[y0:y1, x0:x1] = shades[::-1][:, None] if upright else shades[None]
    places = ticks(low, high, 8 if upright else 6, whole=whole)
    look: dict[str, Any] = {"color": MUTED, "size": SMALL}
    broad = 0.0
    for value, word in zip(places, written(places), strict=True):
        share = (value - low) / ((high - low) or 1.0)
        if upright:
            page.write(word, (x1 + 2 * tick, y1 - share * (y1 - y0)), up=0.5, **look)
        else:
            page.write(word, (x0 + share * (x1 - x0), y1 + 2 * tick), align=0.5, up=1, **look)
        broad = max(broad, width_of(word, page.points(SMALL)))
    if upright:
        page.write(name, (x1 + 3.5 * tick + broad, (y0 + y1) / 2), align=0.5, up=1, upward=True, **look)
    else:
        page.write(name, ((x0 + x1) / 2, y1 + page.points(NAME)), align=0.5, up=1, **look)


def legend(
    page: Page, entries: Sequence[tuple[str, str, str]], place: tuple[float, float], *, stacked: bool = False
) -> None:
    """Name marks and their colors, (marker, color, name) each: in a row around a pixel, or one under another from it.

    The marker of a curve is a dash.
    """
    step, mark, space = page.points(13), page.points(11), page.points(16)
    wide = [mark + width_of(name, page.points(SMALL)) for *_, name in entries]
    x, y = place if stacked else (place[0] - (sum(wide) + space * (len(wide) - 1)) / 2, place[1])
    for (marker, color, name), broad in zip(entries, wide, strict=True):
        if marker == "-":
            lines(page.paper, np.array([[[x, y], [x + 0.7 * mark, y]]]), color=color, width=1.6)
        middle = np.array([[x + 0.35 * mark, y]])
        dots(page.paper, middle, size=3.5, color=color, marker=marker.replace("-", "o"))
        page.write(name, (x + mark, y), up=0.5, size=SMALL, color=INK)
        x, y = (x, y + step) if stacked else (x + broad + space, y)
