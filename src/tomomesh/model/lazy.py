"""Voxels that stay in their file, and are read part by part."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn, Protocol, TypeVar

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from ..errors import ResourceError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import DTypeLike, NDArray


SLAB_BYTES = 2**26
"""Bytes of voxels that are read together where all are gone through: as many as `io.files.numbers` maps together."""


class Stored(Protocol):
    """An array that something else holds, and that parts are read of.

    It can be pickled: it names a file, and holds none open.
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes, in the file's order."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers that `read` returns."""

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes along all axes of what is read together, however little of it is wanted."""

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the numbers of a part, a new array: a slice an axis, none of them empty, of steps above 0."""


@dataclass(frozen=True)
class Mapped:
    """A stored array whose numbers are each put through a function as they are read.

    Attributes
    ----------
    inner : Stored
    function : callable
        From an array to one of the same shape; it can be pickled.
    dtype : data type
        Of what it returns.
    """

    inner: Stored
    function: Callable[[NDArray[Any]], NDArray[Any]]
    dtype: np.dtype[Any]

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes."""
        return self.inner.shape

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together."""
        return self.inner.chunks

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the numbers of a part."""
        return self.function(self.inner.read(box)).astype(self.dtype, copy=False)


@dataclass(frozen=True, eq=False)
class LazyVoxels(NDArrayOperatorsMixin):
    """A view of a stored array: axes turned and parts taken as NumPy does it, and nothing read before `read`.

    What needs all voxels at once, as every function of NumPy does, is refused: nothing reads them by accident.

    Attributes
    ----------
    source : Stored
    order : tuple of int
        The stored axis behind each axis.
    ranges : tuple of range
        Which numbers along every stored axis; one alone where the view has no such axis.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh.model.lazy import ArraySource, LazyVoxels
    >>> stored = LazyVoxels.of(ArraySource(np.arange(24).reshape(4, 3, 2)))
    >>> part = stored.transpose((2, 0, 1))[:, ::-1]
    >>> part.shape, part[1].tolist()
    ((2, 4, 3), [[19, 21, 23], [13, 15, 17], [7, 9, 11], [1, 3, 5]])
    """

    source: Stored
    order: tuple[int, ...]
    ranges: tuple[range, ...]

    @classmethod
    def of(cls, source: Stored) -> LazyVoxels:
        """View the whole of a stored array."""
        return cls(source, tuple(range(len(source.shape))), tuple(map(range, source.shape)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the axes."""
        return tuple(len(self.ranges[axis]) for axis in self.order)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.order)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers."""
        return self.source.dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes along the axes of what is read together."""
        return tuple(self.source.chunks[axis] for axis in self.order)

    def __len__(self) -> int:
        return self.shape[0]

    def transpose(self, axes: Sequence[int]) -> LazyVoxels:
        """Return a view with its axes in another order."""
        return replace(self, order=tuple(self.order[axis] for axis in axes))

    def layer(self, number: int) -> LazyVoxels:
        """Return a view without the last axis: what it has at one number."""
        last, ranges = self.order[-1], list(self.ranges)
        ranges[last] = ranges[last][number : number + 1]
        return LazyVoxels(self.source, self.order[:-1], tuple(ranges))

    def map(self, function: Callable[[NDArray[Any]], NDArray[Any]], dtype: DTypeLike) -> LazyVoxels:
        """Return a view of the same numbers, each put through a function as they are read."""
        return replace(self, source=Mapped(self.source, function, np.dtype(dtype)))

    def __getitem__(self, key: Any) -> Any:
        """Return a view of a part for slices, the first axis first; with a number among them, that part, read."""
        parts = key if isinstance(key, tuple) else (key,)
        if len(parts) > self.ndim or not all(isinstance(part, (int, np.integer, slice)) for part in parts):
            self._refused()
        ranges = list(self.ranges)
        for axis, part in zip(self.order, parts, strict=False):
            side = ranges[axis]
            ranges[axis] = side[part] if isinstance(part, slice) else range(side[part], side[part] + 1)
        view = replace(self, ranges=tuple(ranges))
        if all(isinstance(part, slice) for part in parts):
            return view
        return view.read()[tuple(slice(None) if isinstance(part, slice) else 0 for part in parts)]

    def read(self) -> NDArray[Any]:
        """Read all of the view."""
        if 0 in self.shape:
            return np.empty(self.shape, self.dtype)
        found = self.source.read(tuple(map(_rising, self.ranges)))
        found = found[tuple(slice(None, None, -1 if side.step < 0 else 1) for side in self.ranges)]
        gone = tuple(axis for axis in range(found.ndim) if axis not in self.order)
        return np.asarray(found.transpose((*gone, *self.order))[(0,) * len(gone)])

    def __reduce__(self) -> tuple[Any, ...]:
        """Let another process have no more of a source that is held in memory than is viewed."""
        source, (slices, *others) = self.source, self.ranges
        if 0 not in self.shape and hasattr(source, "part"):
            held = _rising(slices)
            source = source.part(held.start, held.stop)
            slices = range(slices.start - held.start, slices.stop - held.start, slices.step)
        return LazyVoxels, (source, self.order, (slices, *others))

    def _refused(self, *_: object, **__: object) -> NoReturn:
        raise ResourceError(
            "the study is read part by part, and this needs all of its voxels at once",
            found=f"{' x '.join(map(str, self.shape))} of {self.dtype}",
            hint="read_volume, where the memory holds them, or a smaller part",
        )

    __array__ = __array_ufunc__ = _refused

    def __getattr__(self, name: str) -> Any:
        """Refuse what an array would have."""
        if not name.startswith("_") and hasattr(np.ndarray, name):
            self._refused()
        raise AttributeError(name)


Voxels = TypeVar("Voxels", "NDArray[Any]", LazyVoxels)
"""Voxels of one kind in, and of the same kind out."""


@dataclass(frozen=True)
class ArraySource:
    """An array in memory, or whatever takes slices as one does, as what is stored.

    Attributes
    ----------
    array : array
    chunks : tuple of int
        Sizes of what is read together.
    """

    array: Any
    chunks: tuple[int, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers."""
        dtype: np.dtype[Any] = np.dtype(self.array.dtype)
        return dtype

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the numbers of a part."""
        return np.array(self.array[box])


def layer_of(voxels: Voxels, number: int) -> Voxels:
    """Return a view of one layer (K, J, I) of voxels (K, J, I, L)."""
    return voxels.layer(number) if isinstance(voxels, LazyVoxels) else voxels[..., number]


def in_memory(voxels: NDArray[Any] | LazyVoxels) -> NDArray[Any]:
    """Return voxels as an array: read where they lie in a file, else as they are."""
    return voxels.read() if isinstance(voxels, LazyVoxels) else voxels


def slabs(voxels: Voxels) -> list[Voxels]:
    """Cut voxels along their first axis: an array not at all, others by `SLAB_BYTES`, in whole chunks if any fits."""
    if not isinstance(voxels, LazyVoxels):
        return [voxels]
    depth = max(SLAB_BYTES // max(math.prod(voxels.shape[1:]) * voxels.dtype.itemsize, 1), 1)
    depth -= depth % min(voxels.chunks[0], depth)
    return [voxels[start : start + depth] for start in range(0, len(voxels), depth)]


def _rising(side: range) -> slice:
    """Return the same numbers of an axis from the lowest on."""
    up = side if side.step > 0 else side[::-1]
    return slice(up.start, up[-1] + 1, up.step)
