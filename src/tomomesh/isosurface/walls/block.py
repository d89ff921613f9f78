"""A label map as small numbers in a box, and made so that each label's surface is a 2-manifold.

Where two voxels of a label touch along an edge or at a corner alone, one of the voxels beside them is given to it, as
`tomomesh.isosurface.well_composed` adds voxels to a mask. Here that voxel is another label's, whose own voxels must not
part by it, so labels have ranks: a voxel only ever goes to a label of a higher rank, and the rounds end. The fewer
voxels a label has the higher it ranks, for these are what it would lose; the background ranks lowest.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...errors import ResourceError, UsageError
from ...kernels.isosurface.walls import count_mixed, find_contacts, list_mixed
from ...kernels.threads import in_blocks
from ..means import BLOCK
from ..thick_slices import finer, parts_of
from ..well_composed import CORNERS, JOINING, LAYERS, MOST_CELLS
from .thick import MARGIN, divided

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...model.sliced import Sliced
    from ...segmentation.labels import Labelled

    Ints = NDArray[np.int32]
    Labels = NDArray[np.uint16]

MOST_LABELS = 2**16 - 1
"""Labels of a map beside its background, at most: they are numbered with 16 bits."""


def _touching(case: int) -> int:
    """Return the corners of a case, as bits, that touch along an edge or at a corner alone."""
    found = 0
    for axis, side in product(range(3), (0, 1)):
        a, b, c, d = (n for n in range(8) if CORNERS[n, axis] == side)
        for pair, others in ((1 << a | 1 << d, 1 << b | 1 << c), (1 << b | 1 << c, 1 << a | 1 << d)):
            found |= pair if case & (pair | others) == pair else 0
    opposite = [1 << n | 1 << 7 - n for n in range(4)]
    return case if case in opposite or 255 - case in opposite else found


TOUCHING = np.array([_touching(case) for case in range(256)], np.uint8)


@dataclass(frozen=True)
class LabelBlock:
    """A box of a label map.

    Attributes
    ----------
    labels : (K, J, I) uint16 array
        One more than a label's place in `numbers`, 0 for the background; with a layer of it around.
    low : (3,) int32 array
        Its first voxel (x, y, z) in the map.
    numbers : (n,) int64 array
        The labels, in order.
    affine : (4, 4) float array
        Indices of the map's voxels, or of the parts of thick ones, to millimeters.
    shape : tuple of int
        Of the map in these.
    shares : (K, J, I) float16 array or None
        How much of each part its label has; NaN beyond the map.
    parts : int
        Into how many each voxel was divided.
    given : (m,) int64 array
        Voxels of `labels`, flat and in order, that were given to another label, so that none touches itself along an
        edge or at a corner alone.
    before : (m,) uint16 array
        What stands for the labels that they had.
    """

    labels: Labels
    low: Ints
    numbers: NDArray[np.int64]
    affine: NDArray[np.float64]
    shape: tuple[int, ...]
    shares: NDArray[np.float16] | None
    parts: int
    given: NDArray[np.int64]
    before: Labels

    @classmethod
    def of(
        cls,
        found: Labelled,
        inside: Sliced | None = None,
        *,
        divide: bool = False,
        threads: int = 0,
    ) -> LabelBlock:
        """Take all labels of a map but 0, of the voxels that are inside; what is changed in it is a copy.

        With `divide`, voxels of thick slices are divided first.

        Raises
        ------
        UsageError, ResourceError
            Where there are too many labels, or too much boundary.
        """
        numbers = found.numbers[found.numbers != 0]
        if len(numbers) > MOST_LABELS:
            raise UsageError("too many labels share walls", found=str(len(numbers)), expected=f"at most {MOST_LABELS}")
        axis, times = parts_of(found.volume.affine) if divide else (0, 1)
        labels, low = _numbered(found, numbers, inside, MARGIN if times > 1 else 0)
        shares, affine, scale = None, found.volume.affine, np.ones(3, np.int64)
        if times > 1:
            labels, shares = divided(labels, affine, threads)
            affine, scale[2 - axis] = finer(affine, axis, times), times
            shares = np.pad(shares, 1, constant_values=np.nan)
        labels = np.pad(labels, 1)
        counts = sum(np.bincount(plane.ravel(), minlength=len(numbers) + 1) for plane in labels)
        given, before = _composed(labels, _ranks(np.asarray(counts)), threads)
        if shares is not None:
            shares.reshape(-1)[given] = 0.5  # all but in the label that it had
        shape = tuple((np.array(found.volume.shape) * scale).tolist())
        return cls(
            labels, ((low * scale)[::-1] - 1).astype(np.int32), numbers, affine, shape, shares, times, given, before
        )

    def index(self, number: int) -> int:
        """Return what stands for a label; 0 where the map does not have it."""
        place = int(np.searchsorted(self.numbers, number))
        return place + 1 if place < len(self.numbers) and self.numbers[place] == number else 0


def _numbered(
    found: Labelled, numbers: NDArray[np.int64], inside: Sliced | None, margin: int
) -> tuple[Labels, NDArray[np.int64]]:
    """Return numbers for the labels in the box that holds them with a margin, and its first slice, row and column."""
    boxes = found.boxes[found.numbers != 0]
    low, high = boxes[:, 0].min(axis=0) - margin, boxes[:, 1].max(axis=0) + margin
    low, high = np.maximum(low, 0), np.minimum(high, found.volume.shape)
    labels = np.empty(high - low, np.uint16)
    side = tuple(map(slice, low[1:], high[1:]))
    for k in range(low[0], high[0]):
        plane = found.volume.voxels[k][side]
        own = (np.searchsorted(numbers, plane) + 1) * (plane != 0)
        labels[k - low[0]] = own if inside is None else own * inside[k][side]
    return labels, low


def _ranks(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rank labels by how few voxels they have, the background lowest; of equal ones, the later is higher."""
    ranks = np.zeros(len(counts), np.int64)
    ranks[1 + np.argsort(-counts[1:], kind="stable")] = np.arange(1, len(counts))
    return ranks


def mixed_cells(labels: Labels, threads: int = 0) -> tuple[Ints, NDArray[np.uint32]]:
    """Find the cells between eight voxels that are not all of one label.

    Parameters
    ----------
    labels : (K, J, I) uint16 array
    threads : int

    Returns
    -------
    cells : (n, 3) int32 array
        The voxel (x, y, z) in the lowest corner of each, ordered by z, then y, then x.
    codes : (n,) uint32 array
        See `tomomesh.kernels.isosurface.walls`.

    Raises
    ------
    ResourceError
        Where there are more than `MOST_CELLS`.
    """
    layers = len(labels) - 1
    count = np.empty(layers, np.int64)
    in_blocks(lambda a, b: count_mixed(labels, count, a, b), layers, block=LAYERS, threads=threads)
    total = int(count.sum())
    if total > MOST_CELLS:
        raise ResourceError(
            "the walls between the labels are too large", found=f"cells = {total}", expected=f"at most {MOST_CELLS}",
            hint="a part of the map, or no --shared-walls",
        )  # fmt: skip
    cells, codes = np.empty((total, 3), np.int32), np.empty(total, np.uint32)
    first = np.cumsum(count) - count
    in_blocks(lambda a, b: list_mixed(labels, first, cells, codes, a, b), layers, block=LAYERS, threads=threads)
    return cells, codes


def _composed(labels: Labels, ranks: NDArray[np.int64], threads: int) -> tuple[NDArray[np.int64], Labels]:
    """Give voxels away, in place, until no label touches itself along an edge or at a corner alone.

    All voxels that are equally good are given away at once, so that mirrored maps have mirrored results.

    Returns
    -------
    given : (m,) int64 array
        In order.
    before : (m,) uint16 array
        The labels that they had.
    """
    cells, of_rank, flat = mixed_cells(labels, threads)[0], np.argsort(ranks).astype(np.uint16), labels.reshape(-1)
    given, before = np.empty(0, np.int64), np.empty(0, np.uint16)
    while len(cells := _with_contacts(labels, cells, threads)):
        voxels, rank = _given(labels, cells, ranks)
        given, before = np.concatenate([given, voxels]), np.concatenate([before, flat[voxels]])
        flat[voxels] = of_rank[rank]
        places = np.stack(np.unravel_index(voxels, labels.shape)[::-1], axis=1)
        cells = np.unique((places[:, None] - CORNERS).reshape(-1, 3), axis=0).astype(np.int32)
    given, first = np.unique(given, return_index=True)
    return given, before[first]


def _with_contacts(labels: Labels, cells: Ints, threads: int) -> Ints:
    found = np.empty(len(cells), np.bool_)
    in_blocks(
        lambda start, stop: find_contacts(labels, cells, JOINING, found, start, stop), len(cells), block=BLOCK,
        threads=threads,
    )  # fmt: skip
    return cells[found]


def _given(labels: Labels, cells: Ints, ranks: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the voxels (m,) that are given away in cells with a contact, and the ranks of the labels they go to.

    Of the voxels that would join two others, those of the lowest rank go to their label; where all of them rank higher
    than that, the two go to the lowest of these.
    """
    x, y, z = (cells[:, None, :] + CORNERS).transpose(2, 0, 1)
    numbers, own = np.ravel_multi_index((z, y, x), labels.shape), labels[z, y, x]
    found = []
    for n in range(8):
        case = np.packbits(own == own[:, n, None], axis=1, bitorder="little")[:, 0]
        cell = np.flatnonzero((JOINING[case] > 0) & (own[:, n] > 0))
        rank, mine = ranks[own[cell]], ranks[own[cell, n]]
        least = np.where(_bits(JOINING[case[cell]]), rank, len(ranks)).min(axis=1)
        joins = least < mine
        goes = np.where(
            joins[:, None], _bits(JOINING[case[cell]]) & (rank == least[:, None]), _bits(TOUCHING[case[cell]])
        )
        row, corner = np.nonzero(goes)
        found.append((numbers[cell[row], corner], np.maximum(mine, least)[row]))
    voxels, rank = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.lexsort((rank, voxels))
    last = np.append(np.diff(voxels[order]) > 0, True)
    return voxels[order][last], rank[order][last]


def _bits(cases: NDArray[np.uint8]) -> NDArray[np.bool_]:
    return np.unpackbits(cases[:, None], axis=1, bitorder="little").view(np.bool_)
