"""A scene of 3D Slicer (MRML): a study and its mesh in one place, each in the file that it has.

As its storage nodes read it: names of files are relative to the scene; a mesh is in RAS unless its node says LPS. What
the file's own header says of that comes first, which ours leave open.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ..errors import GeometryError, UsageError
from .dicom.read import files_of_series
from .files.atomic import replacing
from .files.source import suffix_of
from .studies.slices import slices_among, slices_behind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..model.volume import Volume
    from ..settings import ReadSettings

SCENES = (".mrml",)
"""Suffixes of scenes."""
MESHES = (".stl", ".ply", ".obj", ".vtp")
"""Suffixes of our meshes that 3D Slicer reads."""
STUDIES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
"""Suffixes of studies of a single file that it places as we do; DICOM is known by its content."""
SQUARE = 1e-3
"""Largest cosine between axes that count as square: over 300 mm they are a third of a millimeter off. It has no shear:
half and twice of it part no study that was met, a tilted gantry has 0.02 and more."""
ENCODED = {"%": "%25", " ": "%20", "'": "%27", ">": "%3E", "<": "%3C", '"': "%22"}
"""What the names of files are written with: these alone are read back, in the opposite order."""
VIEWS = ("Red", "Yellow", "Green")
"""Of the three planes."""


def require_slicer_study(path: str | Path | Sequence[str | Path], settings: ReadSettings) -> list[Path]:
    """Return the files of a study as 3D Slicer is to read them, in their order along the slices.

    Parameters
    ----------
    path : path, or sequence of path
        As `tomomesh.read_volume` takes it.
    settings : ReadSettings
        That it was read with.

    Raises
    ------
    UsageError
        For what 3D Slicer cannot open by itself, or would not place as it is placed here.
    """
    paths = [Path(path)] if isinstance(path, (str, Path)) else [Path(one) for one in path]
    several, shown = len(paths) > 1, str(paths[0])
    slices = slices_among(paths) if several else slices_behind(paths[0], shown)
    changed = [f"--{name.replace('_', '-')}" for name in ("spacing", "spacing_z") if getattr(settings, name)]
    if changed or settings.nifti_form != "sform":
        raise UsageError(
            "3D Slicer knows no other place of a study than its file's", file=shown,
            found=" ".join(changed) or "--nifti-form qform", expected="no --slicer beside it",
        )  # fmt: skip
    found = files_of_series(slices.dicom, settings, study=shown) if slices.dicom else []
    if found:
        return found
    if several or suffix_of(shown) not in STUDIES or Path(shown).is_dir():
        raise UsageError(
            "3D Slicer does not open such a study by itself", file=shown, found="--slicer",
            expected=f"a DICOM series, or one of {' | '.join(STUDIES)}",
        )  # fmt: skip
    return [Path(shown)]


def require_same_place(volume: Volume, files: Sequence[Path], *, file: str) -> None:
    """Refuse a study that 3D Slicer would place otherwise: of axes that are not square, or of slices made up here.

    Raises
    ------
    GeometryError
    """
    if volume.other_frame:
        raise GeometryError(
            "the study's file holds two frames, and 3D Slicer may take the other", file=file,
            found=volume.other_frame, expected="no --slicer",
        )  # fmt: skip
    axes = volume.affine[:3, :3] / volume.spacing_mm
    cosine = float(np.abs(axes.T @ axes - np.eye(3)).max())
    if cosine > SQUARE:
        raise GeometryError(
            "3D Slicer straightens a study whose slices are not stacked square", file=file,
            found=f"cosine between its axes = {cosine:.4f}", expected="no --slicer",
        )  # fmt: skip
    if len(files) > 1 and volume.grid.shape[0] != len(files):
        raise GeometryError(
            "3D Slicer would stack the slices otherwise", file=file,
            found=f"{len(files)} files for {volume.grid.shape[0]} slices", expected="no --slicer",
        )  # fmt: skip


def write_slicer_scene(
    path: str | Path, *, study: Sequence[Path], mesh: str | Path, frame: str, color: bool = False
) -> None:
    """Write a scene of a study and its mesh, whole or not at all.

    Parameters
    ----------
    path : path
        The scene, .mrml.
    study : sequence of path
        Its files, as `require_slicer_study` orders them.
    mesh : path
    frame : {"LPS", "RAS"}
        Of the mesh's numbers.
    color : bool
        Whether voxels of the study have colors.

    Raises
    ------
    OutputError
        Where it cannot be written.
    """
    scene = Element("MRML", version="Slicer4.11", userTags="")
    folder = Path(os.path.realpath(Path(path).parent))
    _add_study(scene, [_relative(one, folder) for one in study], color)
    _add_mesh(scene, _relative(Path(mesh), folder), frame)
    indent(scene, " ")
    with replacing(path) as file:
        file.write(b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(scene, "utf-8") + b"\n")


def _add_study(scene: Element, names: Sequence[str], color: bool) -> None:
    """Add the voxels, where they lie, and that the three planes show them."""
    kind = "Vector" if color else "Scalar"
    volume, display = f"vtkMRML{kind}VolumeNode1", f"vtkMRML{kind}VolumeDisplayNode1"
    storage = "vtkMRMLVolumeArchetypeStorageNode1"
    members = {f"fileListMember{n}": name for n, name in enumerate(names)} if len(names) > 1 else {}
    SubElement(
        scene, "VolumeArchetypeStorage", members, id=storage, name="study storage", fileName=names[0],
        centerImage="0", singleFile="0" if members else "1", UseOrientationFromFile="1",
    )  # fmt: skip
    grays = {} if color else {"colorNodeID": "vtkMRMLColorTableNodeGrey", "autoWindowLevel": "1"}
    SubElement(scene, f"{kind}VolumeDisplay", grays, id=display, name="study display")
    tag = "VectorVolume" if color else "Volume"
    SubElement(scene, tag, id=volume, name="study", references=f"display:{display};storage:{storage};")
    for view in VIEWS:
        SubElement(
            scene, "SliceComposite", id=f"vtkMRMLSliceCompositeNode{view}", name=f"SliceComposite {view}",
            singletonTag=view, layoutName=view, backgroundVolumeID=volume,
        )  # fmt: skip


def _add_mesh(scene: Element, name: str, frame: str) -> None:
    """Add the mesh, in the frame of its numbers, and its outlines on the planes."""
    model, display, storage = (f"vtkMRMLModel{kind}Node1" for kind in ("", "Display", "Storage"))
    SubElement(scene, "ModelStorage", id=storage, name="mesh storage", fileName=name, coordinateSystem=frame)
    SubElement(
        scene, "ModelDisplay", id=display, name="mesh display", color="0.85 0.79 0.66", visibility="true",
        visibility2D="true", sliceIntersectionVisibility="true", sliceIntersectionThickness="2",
    )  # fmt: skip
    SubElement(scene, "Model", id=model, name="mesh", references=f"display:{display};storage:{storage};")


def _relative(path: Path, folder: Path) -> str:
    """Return a file's name as it is seen from a folder, as a scene spells it."""
    whole = Path(os.path.realpath(path.parent), path.name)
    try:
        name = Path(os.path.relpath(whole, folder)).as_posix()
    except ValueError:  # another drive
        name = whole.as_posix()
    return "".join(ENCODED.get(letter, letter) for letter in name)
