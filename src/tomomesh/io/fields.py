"""The fields of a file, and what they are called: ids, colors, normals, and anything else."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError, UsageError
from ..model.points import COLORS, KINDS, PointSet
from .colors import named_colors

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    Fields = dict[str, NDArray[Any]]
    Cloud = tuple[NDArray[np.float64], Fields]
    """What every reader returns: positions (n, 3) and the other fields, n rows each."""

AXES = ("x", "y", "z")

IDS = {"slice": np.int32, "neuron": np.int32, "kind": np.uint8}
"""The fields by which tomomesh's own files say where each point came from."""

NORMALS = frozenset([*(f"{mark}{axis}" for mark in ("n", "normal", "normal_") for axis in AXES), "normal", "normals"])
"""Fields that are passed over: normals of the points would be wrong on the vertices of a mesh."""


def split_fields(columns: Mapping[str, NDArray[Any]], *, file: str) -> Cloud:
    """Part the positions from the other fields.

    Raises
    ------
    FormatError
        Where x, y and z are not there, or are not as many real numbers each.
    """
    axes = [columns[axis] for axis in AXES if axis in columns]
    if len(axes) < 3 or len({axis.shape for axis in axes}) > 1 or axes[0].ndim != 1 or not all(map(_are_numbers, axes)):
        raise FormatError("the points have no positions", file=file, expected="as many numbers x, y and z")
    return side_by_side(axes), {name: column for name, column in columns.items() if name not in AXES}


def side_by_side(columns: Sequence[NDArray[Any]]) -> NDArray[np.float64]:
    """Return columns (n,) of numbers as doubles (n, k), each copied once; NaN of whatever bits is told later."""
    rows = np.empty((len(columns[0]), len(columns)))
    with np.errstate(invalid="ignore"):
        for number, column in enumerate(columns):
            rows[:, number] = column
    return rows


def doubles(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return numbers as they are in 64 bits; NaN of whatever bits is told later, in words."""
    with np.errstate(invalid="ignore"):
        return np.array(values, np.float64, order="C")


def point_set(positions: NDArray[np.float64], fields: Mapping[str, NDArray[Any]]) -> PointSet:
    """Return the points with what their file says of them.

    Parameters
    ----------
    positions : (n, 3) float array
        Finite.
    fields : mapping of str to (n,) or (n, c) array
        Numbers become attributes, colors as uint8 ``red``, ``green`` and ``blue``; ids of tomomesh's own files
        become slices, neurons and kinds; normals and text are passed over.
    """
    ids = _ids(fields)
    colors = named_colors(fields)
    taken = {*ids, *(colors[0] if colors else ())}
    attributes: Fields = dict(zip(COLORS, colors[1].T.copy(), strict=True)) if colors else {}
    for name, values in fields.items():
        if name not in taken and name not in attributes and name.lower() not in NORMALS and _are_numbers(values):
            attributes[name] = np.array(values, values.dtype.newbyteorder("="))
    if ids:
        slices, neurons, kinds = ids.values()
        return PointSet(positions, slices, neurons, kinds, attributes)
    return replace(PointSet.from_positions(positions), attributes=attributes)


def _are_numbers(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "biuf" and values.ndim in (1, 2) and 0 not in values.shape[1:]


def _ids(fields: Mapping[str, NDArray[Any]]) -> Fields:
    """Return the three ids where all are there and can be what they say; another's file may use the names."""
    if not all(name in fields and fields[name].dtype.kind in "iu" and fields[name].ndim == 1 for name in IDS):
        return {}
    ids: Fields = {name: fields[name].astype(kind) for name, kind in IDS.items()}
    same = all(fields[name].dtype == kind or np.array_equal(ids[name], fields[name]) for name, kind in IDS.items())
    return ids if same and ids["kind"].max(initial=0) <= max(KINDS) else {}


def flat_columns(fields: Mapping[str, NDArray[Any]], count: int, taken: Iterable[str]) -> Fields:
    """Return fields as single columns, under names that every format can hold.

    Parameters
    ----------
    fields : mapping of str to (count,) or (count, c) array
        Numbers, truth values among them; c columns get the names ``name_0`` to ``name_{c-1}``.
    count : int
        Rows.
    taken : iterable of str
        Names that are already given; a field of such a name gets underscores behind.

    Raises
    ------
    UsageError
        For a field of another length, or one that holds no numbers.
    """
    found: Fields = {}
    reserved = set(taken)
    for name, values in fields.items():
        table = np.asarray(values)
        if not _are_numbers(table) or len(table) != count:
            raise UsageError(
                "a field does not fit",
                found=f"{name}: shape = {table.shape}, type = {table.dtype}",
                expected=f"{count} rows of numbers",
            )
        table = table.astype(np.uint8) if table.dtype.kind == "b" else table
        names = [name] if table.ndim == 1 else [f"{name}_{number}" for number in range(table.shape[1])]
        for column, single in zip(names, table.reshape(count, len(names)).T, strict=True):
            found[_free(column, reserved)] = single
    return found


def _free(name: str, taken: set[str]) -> str:
    """Spell a name in letters that no format parts, take it, and return it."""
    plain = re.sub(r"[^0-9A-Za-z_.\-]+", "_", name) or "_"
    while plain in taken:
        plain += "_"
    taken.add(plain)
    return plain
