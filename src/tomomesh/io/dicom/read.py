"""A DICOM study from its files to a volume."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.volume import Volume
from ..files.parts import read_later
from ..files.source import counted
from .bad import leave_out
from .files import read_frames
from .headers.identity import identity_of
from .headers.kinds import SEGMENTED, class_of
from .headers.multiframe import placed_evenly
from .headers.unit import gray_unit
from .parts import opened
from .pixels.decoder import Decoder
from .series.choice import choose, stacks_among
from .series.stack import Stack, stacked
from .series.voxels import Gray, gray

if TYPE_CHECKING:
    from pathlib import Path

    from ...settings import ReadSettings
    from .headers.header import ImageFrame


ULTRASOUND_VOLUME = "1.2.840.10008.5.1.4.1.1.6.2"
"""The storage class of ultrasound in three dimensions."""


def read_dicom(files: list[Path], settings: ReadSettings, *, study: str, others: Counter[str] | None = None) -> Volume:
    """Read one series of slices.

    Parameters
    ----------
    files : list of Path
        Files in any order; those that are no images are left out and counted.
    settings : ReadSettings
        What to do where the files leave a choice.
    study : str
        The path as the user typed it.
    others : Counter, optional
        Entries of the folder that were passed over before, by reason.

    Returns
    -------
    Volume
        In patient millimeters, with the shear of a tilted gantry; HU where the study is CT.

    Raises
    ------
    FormatError
        For files without images, and files that are broken.
    GeometryError
        Where the slices do not make one regular stack.
    ResourceError
        Where the voxels do not fit into the memory.
    """
    with Decoder() as decode:
        for frame in read_frames(files[:1]).frames[:1]:
            decode.expect(frame)
        return _read(files, settings, study, others or Counter(), decode)


def _read(files: list[Path], settings: ReadSettings, study: str, others: Counter[str], decode: Decoder) -> Volume:
    reading = read_frames(files)
    passed = others + reading.others
    good = len({frame.path for frame in reading.frames})
    broken = leave_out(reading.bad, good, skip=settings.skip_bad, study=study)
    if not good:
        raise FormatError(
            f"0 of {sum(passed.values())} files are images",
            file=study,
            found=counted(passed),
            expected="a DICOM series",
            hint="one of the segmentations alone" if passed[SEGMENTED] else "",
        )
    left = (f"left out: {counted(passed)}",) if passed else ()
    choice = choose(reading.frames, settings.series, folder=study)
    stack, levels, without = _decoded(choice.frames, decode, settings, study)
    header = choice.frames[0].header
    unit, in_unit = gray_unit(choice.frames)
    skipped = _left(stack) if broken or without else ()
    notes = left + broken + choice.notes + without + skipped + stack.notes + levels.notes + in_unit + _said(header)
    read = Volume.from_stored(levels.voxels, stack.affine, unit=unit, notes=notes)
    return replace(read, padding=levels.padding, dicom=identity_of(choice.frames))


def _said(header: Any) -> tuple[str, ...]:
    """Say of a header what turned its levels over, and where its places are not the patient's."""
    notes = []
    if header.get("PhotometricInterpretation") == "MONOCHROME1":
        kept = header.get("Modality") == "CT"
        notes.append("MONOCHROME1: HU were kept" if kept else "MONOCHROME1: gray levels were inverted")
    if class_of(header) == ULTRASOUND_VOLUME:
        notes.append("placed by the transducer, not by the patient: left, back and up are not known")
    if placed_evenly(header):
        notes.append("frames placed by SpacingBetweenSlices, one behind the other along their normal")
    return tuple(notes)


def _left(stack: Stack) -> tuple[str, ...]:
    """Say how the slices lie that are left: those that are gone at the ends, or every second one, leave no gap."""
    if len(stack.places) < 2 or stack.places[0][0].position is None:
        return ()
    columns, rows, step = stack.affine[:3, :3].T
    normal = np.cross(columns, rows)
    apart = abs(float(step @ normal)) / float(np.linalg.norm(normal))
    reach = apart * float(np.ptp(stack.levels))
    return (f"the distance of the slices is now {apart:.4g} mm, from the first to the last {reach:.4g} mm",)


def files_of_series(files: list[Path], settings: ReadSettings, *, study: str) -> list[Path]:
    """Return the files of the series that `read_dicom` would take, in the order of their slices.

    None where no file holds slices of gray levels, as of a segmentation.

    Raises
    ------
    FormatError, GeometryError
        As that does.
    """
    frames = read_frames(files).frames
    if not frames:
        return []
    choice = choose(frames, settings.series, folder=study)
    stack = stacked(choice.frames, settings, study=study)
    return [*dict.fromkeys(frame.path for place in stack.places for frame in place)]


def list_stacks(files: list[Path]) -> list[int]:
    """Return the numbers of the series among some files that could be a study each, for ``ReadSettings.series``."""
    return stacks_among(read_frames(files).frames)


def _decoded(
    frames: list[ImageFrame], decode: Decoder, settings: ReadSettings, study: str
) -> tuple[Stack, Gray, tuple[str, ...]]:
    """Stack and decode slices; those whose pixels turn out to be broken are refused, or left out and the rest stacked.

    What is left must be a regular stack by itself.
    """
    notes: tuple[str, ...] = ()
    while True:
        stack = stacked(frames, settings, study=study)
        take = partial(opened, all_now=settings.skip_bad) if read_later() else gray
        levels = take(stack, decode, study=study)
        if not levels.bad:
            return stack, levels, notes
        frames = [frame for frame in frames if frame.path not in levels.bad]
        good = len({frame.path for frame in frames})
        notes += leave_out(levels.bad, good, skip=settings.skip_bad, study=study)
