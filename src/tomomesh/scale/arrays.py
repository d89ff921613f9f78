"""Arrays of Dask and of Zarr as voxels that are read part by part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..model.lazy import ArraySource, LazyVoxels

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class DaskArray(ArraySource):
    """An array of Dask, computed part by part where the part is wanted: tasks within a task wait for nobody."""

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the numbers of a part."""
        import dask

        with dask.config.set(scheduler="synchronous"):
            return np.array(self.array[box])


def lazy_voxels(array: Any) -> LazyVoxels:
    """Return the voxels of an array in chunks, none of which is read before it is asked for.

    Parameters
    ----------
    array : dask.array.Array, zarr.Array, or of a kind that has `chunks`, `shape` and `dtype` and takes slices
        (K, J, I) or (K, J, I, L), of real numbers.

    Raises
    ------
    UsageError
        For another array, and one of Dask whose sizes are not known.

    Examples
    --------
    >>> import dask.array
    >>> import numpy as np
    >>> from tomomesh import Volume
    >>> from tomomesh.scale.arrays import lazy_voxels
    >>> voxels = lazy_voxels(dask.array.zeros((600, 500, 400), np.uint8, chunks=100))
    >>> Volume.from_stored(voxels, np.diag([0.5, 0.5, 2.0, 1.0])), voxels[10].shape
    (Volume(600 x 500 x 400 of uint8, 0.5 x 0.5 x 2 mm), (500, 400))
    """
    shape, chunks = getattr(array, "shape", ()), getattr(array, "chunks", None)
    known = len(shape) in (3, 4) and all(isinstance(size, (int, np.integer)) for size in shape)
    if not known or not chunks or np.dtype(array.dtype).kind not in "biuf":
        raise UsageError(
            "the array is no volume in chunks",
            found=f"{type(array).__name__} of shape {shape}",
            expected="a Dask or Zarr array (slices, rows, columns), or colors behind, of real numbers and known sizes",
            hint="array.compute_chunk_sizes()" if shape and not known and len(shape) in (3, 4) else "",
        )
    if hasattr(array, "__dask_graph__"):
        return LazyVoxels.of(DaskArray(array, tuple(map(max, chunks))))
    return LazyVoxels.of(ArraySource(array, tuple(chunks)))
