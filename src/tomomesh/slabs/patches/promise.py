"""What is promised of every mesh, checked on one in patches."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...measure.topology import require_finite, require_promise
from .positions import ALONG, distinct_in
from .seams import whole_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .patch import Patches
    from .seams import Whole


def check_patches(
    patches: Patches, *, cavities: int = 0, open_: bool = False, along: Sequence[float] = ALONG
) -> Whole:  # fmt: skip
    """Check across all seams what `tomomesh.measure.topology.check_promise` checks on a whole mesh.

    Parameters
    ----------
    patches : Patches
    cavities : int
        Components that are known to line a cavity, and so must face inward.
    open_ : bool
        Let the mesh have borders.
    along : sequence of 3 floats
        A direction along which the patches follow one another: the normal of the slices.

    Returns
    -------
    Whole
        What was counted.

    Raises
    ------
    InternalCheckError
        Naming what was found.
    """
    whole = whole_of(patches, cavities=cavities)
    require_finite(finite=whole.finite)
    require_promise(whole.topology, patches.vertices - distinct_in(patches, along=along), open_=open_)
    return whole
