"""Eigenvectors, Cholesky's factors and tangents of a few dimensions, for loops over points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel("void(f8[:,::1], f8[::1])")
def smallest_axis(matrix: Floats, axis: Floats) -> None:
    """Find the eigenvector (3,) of the smallest eigenvalue of a symmetric (3, 3) matrix by Jacobi's rotations.

    The matrix is overwritten: its smallest diagonal entry becomes that eigenvalue.
    """
    vectors = np.eye(3)
    for _ in range(8):
        off = matrix[0, 1] ** 2 + matrix[0, 2] ** 2 + matrix[1, 2] ** 2
        # squares: what is left beside the diagonal is a million millionth of it, and rounding is next
        if off <= 1e-24 * (matrix[0, 0] ** 2 + matrix[1, 1] ** 2 + matrix[2, 2] ** 2):
            break
        for i in range(2):
            for j in range(i + 1, 3):
                if matrix[i, j] == 0.0:
                    continue
                ratio = (matrix[j, j] - matrix[i, i]) / (2 * matrix[i, j])
                t = 1 / (abs(ratio) + np.sqrt(ratio * ratio + 1))
                t = -t if ratio < 0 else t
                c = 1 / np.sqrt(t * t + 1)
                s = t * c
                for k in range(3):
                    a, b = matrix[k, i], matrix[k, j]
                    matrix[k, i], matrix[k, j] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = matrix[i, k], matrix[j, k]
                    matrix[i, k], matrix[j, k] = c * a - s * b, s * a + c * b
                    a, b = vectors[k, i], vectors[k, j]
                    vectors[k, i], vectors[k, j] = c * a - s * b, s * a + c * b
    least = 0
    for i in range(1, 3):
        if matrix[i, i] < matrix[least, least]:
            least = i
    matrix[0, 0] = matrix[least, least]
    for k in range(3):
        axis[k] = vectors[k, least]


@kernel("b1(f8[:,::1], f8[::1])")
def solve(matrix: Floats, right: Floats) -> bool:
    """Solve a symmetric positive system by Cholesky's factors, in place; tell whether it could be solved."""
    size = len(right)
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            if i == j:
                if rest <= 1e-12:  # not positive, but for rounding
                    return False
                matrix[i, i] = np.sqrt(rest)
            else:
                matrix[i, j] = rest / matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@kernel("void(f8[::1], f8[:,::1])")
def tangents(normal: Floats, axes: Floats) -> None:
    """Find two unit vectors (2, 3) that are perpendicular to a unit normal (3,) and to each other."""
    least = 0
    for axis in range(1, 3):
        if abs(normal[axis]) < abs(normal[least]):
            least = axis
    length = np.sqrt(1 - normal[least] ** 2)
    one, two = (least + 1) % 3, (least + 2) % 3
    axes[0, least] = 0.0
    axes[0, one], axes[0, two] = -normal[two] / length, normal[one] / length
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        axes[1, axis] = normal[one] * axes[0, two] - normal[two] * axes[0, one]
