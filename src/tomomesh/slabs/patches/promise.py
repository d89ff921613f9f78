"""What is promised of every mesh, checked on one in patches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...measure.topology import require_finite, require_promise
from .seams import whole_of

if TYPE_CHECKING:
    from .patch import Patches
    from .seams import Gathered


def check_patches(
    patches: Patches, *, cavities: int = 0, open_: bool = False
) -> Gathered:  # fmt: skip
    """Check across all seams what `tomomesh.measure.topology.check_promise` checks on a whole mesh.

    Parameters
    ----------
    patches : Patches
    cavities : int
        Components that are known to line a cavity, and so must face inward.
    open_ : bool
        Let the mesh have borders.

    Returns
    -------
    Gathered
        What was counted.

    Raises
    ------
    InternalCheckError
        Naming what was found.
    """
    whole = whole_of(patches, cavities=cavities)
    require_finite(finite=whole.finite)
    require_promise(whole.topology, patches.vertex_count - patches.distinct(np.float64), open_=open_)
    return whole
