"""Sliced of pixels as bits: grown by octagons, and what their outside reaches.

A plane's row is a row of words: pixel i is bit i % 64 of word i // 64.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]

ONE, LAST, NONE = np.uint64(1), np.uint64(63), np.uint64(0)
"""A step to the next pixel of a word, and to the last one of it; no pixel."""
DOUBLINGS = 6
"""Steps of 1, 2, 4, ... pixels that go through a word."""


@kernel("void(u8[:,::1], i8, i8, u8[:,::1])")
def grow(plane: Words, start: int, stop: int, spare: Words) -> None:
    """Dilate a plane (J, W) by crosses in even steps and by squares in odd ones, from step `start` to before `stop`.

    A cross and a square in turn make an octagon. `spare` (J, W) is overwritten.
    """
    rows, words = plane.shape
    for step in range(start, stop):
        for j in range(rows):
            for w in range(words):
                spare[j, w] = plane[j, w]
        for j in range(rows):
            above, below = max(j - 1, 0), min(j + 1, rows - 1)
            for w in range(words):
                column = spare[above, w] | spare[j, w] | spare[below, w]
                row = column if step % 2 else spare[j, w]
                wide = column | row << ONE | row >> ONE
                if w > 0:
                    before = spare[above, w - 1] | spare[below, w - 1] if step % 2 else NONE
                    wide |= (before | spare[j, w - 1]) >> LAST
                if w + 1 < words:
                    after = spare[above, w + 1] | spare[below, w + 1] if step % 2 else NONE
                    wide |= (after | spare[j, w + 1]) << LAST
                plane[j, w] = wide


@kernel("u8(u8, u8)")
def spread(seeds: np.uint64, room: np.uint64) -> np.uint64:
    """Let pixels of a word spread both ways through the pixels where there is room; they have room themselves."""
    up = down = seeds
    above = below = room
    step = ONE
    for _ in range(DOUBLINGS):
        up |= above & (up << step)
        down |= below & (down >> step)
        above &= above << step
        below &= below >> step
        step <<= ONE
    return up | down


@kernel("b1(u8[:,::1], u8[:,::1], i8, i8)")
def reach_row(room: Words, reached: Words, j: int, beside: int) -> bool:
    """Let what was reached in one row spread to row j and along it; tell whether it has grown."""
    words, grown = room.shape[1], False
    for n in range(2 * words):
        w = n if n < words else 2 * words - 1 - n
        seeds = reached[j, w] | (room[j, w] & reached[beside, w])
        if w > 0:
            seeds |= room[j, w] & (reached[j, w - 1] >> LAST)
        if w + 1 < words:
            seeds |= room[j, w] & (reached[j, w + 1] << LAST)
        if seeds != NONE and seeds != room[j, w]:
            seeds = spread(seeds, room[j, w])
        grown |= seeds != reached[j, w]
        reached[j, w] = seeds
    return grown


@kernel("void(u8[:,::1], i8, u8[:,::1])")
def close_plane(plane: Words, reach: int, hollow: Words) -> None:
    """Fill what the outside of a plane cannot reach through openings narrower than twice `reach` pixels.

    Parameters
    ----------
    plane : (J, W) uint64 array
        Nothing within `reach` pixels of its edge. Result: the filled plane.
    reach : int
    hollow : (J, W) uint64 array
        Result: what the closing left open and the outside does not reach.
    """
    rows = len(plane)
    outside, spare, grown = np.zeros_like(plane), np.empty_like(plane), plane.copy()
    grow(grown, 0, reach, spare)
    for j in range(rows):
        for w in range(plane.shape[1]):
            hollow[j, w] = ~grown[j, w]
    outside[0, 0] = ONE
    more = True
    while more:
        more = False
        for n in range(2 * rows):
            j = n if n < rows else 2 * rows - 1 - n
            beside = max(j - 1, 0) if n < rows else min(j + 1, rows - 1)
            more |= reach_row(hollow, outside, j, beside)
    for j in range(rows):
        for w in range(plane.shape[1]):
            hollow[j, w] &= ~outside[j, w]
    grow(outside, 0, reach, spare)
    for j in range(rows):
        for w in range(plane.shape[1]):
            plane[j, w] |= ~outside[j, w]
