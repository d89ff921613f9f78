"""How near a mesh is to a segmentation: the window of a study, or labels of a label map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..segmentation.labels import labels_in
from ..segmentation.study import APART, chosen_by, select_study
from ..settings import Settings
from .voxels import compare_with_voxels

if TYPE_CHECKING:
    from ..model.mesh import TriMesh
    from ..model.volume import Volume


def compare_with_study(
    mesh: TriMesh,
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    **changes: Any,
) -> dict[str, Any]:
    """Tell how near a mesh is to the voxels of a window, chosen as for a reconstruction.

    Parameters
    ----------
    mesh : TriMesh
        Patient millimeters, LPS.
    volume : Volume
        A study, or a label map alone.
    settings : Settings, optional
    labels : Volume, optional
        A label map on the study's grid, for ``select``.
    **changes
        Parameters by their bare names, as ``select=(5,)`` or ``lower=300``.

    Returns
    -------
    dict
        Dice's coefficient, and mean, percentiles and maximum of the distances both ways (see docs/report.md); ``notes``
        has what was decided and what is in doubt.

    Raises
    ------
    UsageError
        Where no label is chosen and there are several.
    TomomeshError
        As `tomomesh.reconstruct`, of a window that there is not.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import TriMesh, Volume, compare_with_study
    >>> block = np.zeros((5, 5, 5), np.uint8)
    >>> block[1:4, 1:4, 1:4] = 7
    >>> corners = np.array(list(np.ndindex(2, 2, 2))) * 3 + 0.5
    >>> sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    >>> box = TriMesh(corners, np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]]))
    >>> found = compare_with_study(box, Volume.from_stored(block, np.eye(4)), select=(7,))
    >>> found["dice"], round(found["max_mm"], 9), round(found["back_max_mm"], 9)
    (1.0, 0.0, 0.0)
    """
    settings = _settled((settings or Settings()).replace(**changes), volume, labels)
    selected = select_study(volume, labels, settings)
    kept = selected.value
    found = compare_with_voxels(mesh, kept.mask, kept.study, threads=settings.run.threads)
    told = [*selected.stats["study"]["notes"], *selected.warnings]
    return {**found, "chosen_by": chosen_by(settings), "notes": told}


def _settled(settings: Settings, volume: Volume, labels: Volume | None) -> Settings:
    """Take the only label of a label map where no window is asked for; refuse to choose among several."""
    if labels is not None or chosen_by(settings) != "otsu":
        return settings
    there = labels_in(np.asarray(volume.voxels[::APART])) or {}
    if len(there) < 2:
        return settings
    raise UsageError(
        "it is not said which labels the mesh should follow", found=f"labels {', '.join([*there][:8])}",
        expected="--select with one or several of them",
    )  # fmt: skip
