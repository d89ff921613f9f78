"""Draw the skull of a label head made into thick slabs: as 3D Slicer's pipeline makes its surface, and as ours does.

``python benchmarks/slab_picture.py FILE.png [--study 01] [--thick 4] [--data labels] [--way defaults]``
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from PIL import Image

from slab_peers import sinc
from slabs import STUDIES, WAYS, majority, ours, score, slab, thin, truth
from tomomesh.show.camera import Camera
from tomomesh.show.drawing.page import Page, canvas
from tomomesh.show.render import View, draw_faces, frame

if TYPE_CHECKING:
    from tomomesh.model.mesh import TriMesh

HEADS = [name for name, (_, labels, _) in STUDIES.items() if labels]
"""Studies of labels alone: no picture of a patient is drawn."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file")
    parser.add_argument("--study", choices=HEADS, default=HEADS[0])
    parser.add_argument("--thick", type=int, default=4, help="slices of a slab")
    parser.add_argument("--data", choices=("levels", "labels"), default="labels")
    parser.add_argument("--way", choices=WAYS, default="defaults")
    asked = parser.parse_args()
    study = thin(asked.study)
    slabs = majority(study.volume, asked.thick, 0.5) if asked.data == "labels" else slab(study.volume, asked.thick)
    true = truth(study)
    meshes = sinc(slabs, 0.5, asked.thick), ours(WAYS[asked.way], asked.data)(slabs, 0.5, asked.thick)
    panels = []
    for name, mesh in zip(("Marching cubes, smoothed as 3D Slicer does", "tomomesh"), meshes, strict=True):
        found = score(mesh, true)
        panels.append((name, f"{found['mean']:.2f} mm from the true surface, faces turn by {found['turn']:.1f}°", mesh))
    pair(panels).image().quantize(dither=Image.Dither.NONE).save(asked.file, optimize=True)


def pair(panels: list[tuple[str, str, TriMesh]]) -> Page:
    """Draw surfaces side by side from the same place, each face in one shade, all at one scale."""
    view = View(Camera(elevation=32))
    page, axes = canvas(4.8 * len(panels), 5.2, 1, len(panels))
    for ax, (name, told, mesh) in zip(axes, panels, strict=True):
        frame(ax, panels[0][2].vertices, view)
        draw_faces(ax, mesh.vertices, mesh.faces, view.camera)
        ax.heading(name, told)
    return page


if __name__ == "__main__":
    main()
