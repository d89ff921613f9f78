"""Moments of the slices of a window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(b1[:,:,::1], f8[:,::1])")
def plane_moments(mask: NDArray[np.bool_], sums: NDArray[np.float64]) -> None:
    """Add up what the pixels of each slice have.

    Parameters
    ----------
    mask : (K, J, I) bool array
    sums : (K, 6) float array
        Result: the sums of 1, i, j, i^2, i j and j^2.
    """
    for k in range(len(mask)):
        own = sums[k]
        own[:] = 0.0
        for j in range(mask.shape[1]):
            row = mask[k, j]
            count, first, second = np.int64(0), np.int64(0), np.int64(0)
            for i in range(len(row)):
                pixel = np.int64(row[i])
                count, first, second = count + pixel, first + i * pixel, second + i * i * pixel
            if count > 0:
                own[0], own[1], own[2] = own[0] + count, own[1] + first, own[2] + j * count
                own[3], own[4], own[5] = own[3] + second, own[4] + j * first, own[5] + j * j * count
