"""DICOM segmentations, written frame by frame, and by highdicom."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pydicom.dataelem import DataElement
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.uid import CTImageStorage, generate_uid

from studies import save, slice_dataset

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Masks = dict[int, NDArray[Any]]

SEGMENTS, LABEL_MAP = "1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7"
NAMES = {1: "Liver", 2: "Left\x1b[31m kidney", 3: "Tumor", 300: "Rib"}


def item(**fields: Any) -> Dataset:
    """Return a dataset of some fields."""
    made = Dataset()
    for keyword, value in fields.items():
        setattr(made, keyword, value)
    return made


def frames_of(masks: Masks) -> list[tuple[int, int]]:
    """Return the segment and the slice of every frame that is not empty."""
    return [(number, k) for number, mask in masks.items() for k in range(len(mask)) if mask[k].any()]


def segmentation(
    masks: Masks, affine: NDArray[np.float64], *, kind: str = "BINARY", order: list[tuple[int, int]] | None = None
) -> Dataset:
    """Return a segmentation of masks (K, J, I), by their segment numbers.

    Masks of kind FRACTIONAL hold shares; those of a LABELMAP are laid over each other, and have no frame each.
    """
    if kind == "LABELMAP":
        whole = np.zeros(next(iter(masks.values())).shape, np.uint16)
        for number, mask in masks.items():
            whole[mask] = number
        planes = {(0, k): whole[k] for k in range(len(whole)) if whole[k].any()}
    else:
        planes = {(number, k): masks[number][k] for number, k in frames_of(masks)}
    order = order or list(planes)
    data = slice_dataset(np.zeros(next(iter(planes.values())).shape, np.uint8), affine, 0)
    position, turn, spacing = (data[name].value for name in PLACE)
    for keyword in PLACE:
        delattr(data, keyword)
    data.Modality, data.SegmentationType = "SEG", kind
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = LABEL_MAP if kind == "LABELMAP" else SEGMENTS
    data.SegmentSequence = Sequence([item(SegmentNumber=n, SegmentLabel=NAMES[n]) for n in masks])
    data.SharedFunctionalGroupsSequence = Sequence(
        [
            item(
                PixelMeasuresSequence=Sequence([item(PixelSpacing=spacing)]),
                PlaneOrientationSequence=Sequence([item(ImageOrientationPatient=turn)]),
            )
        ]
    )
    data.PerFrameFunctionalGroupsSequence = Sequence([_place(n, k, position, affine) for n, k in order])
    data.NumberOfFrames = len(order)
    set_frames(data, np.stack([planes[key] for key in order]), kind)
    return data


PLACE = ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing")


def _place(number: int, k: int, first: Any, affine: NDArray[np.float64]) -> Dataset:
    position = [float(f"{v:.9f}") for v in np.array(first, float) + k * affine[:3, 2]]
    groups = item(PlanePositionSequence=Sequence([item(ImagePositionPatient=position)]))
    if number:
        groups.SegmentIdentificationSequence = Sequence([item(ReferencedSegmentNumber=number)])
    return groups


def set_frames(data: Dataset, frames: NDArray[Any], kind: str) -> None:
    """Put frames into a segmentation: bits, shares of 200, or labels."""
    data.Rows, data.Columns = frames.shape[1:]
    if kind == "BINARY":
        raw, bits = np.packbits(frames.astype(bool).ravel(), bitorder="little").tobytes(), 1
    elif kind == "FRACTIONAL":
        data.MaximumFractionalValue, data.SegmentationFractionalType = 200, "PROBABILITY"
        raw, bits = np.rint(200 * frames).astype(np.uint8).tobytes(), 8
    else:
        raw, bits = frames.astype("<u2").tobytes(), 16
    data.BitsAllocated = data.BitsStored = bits
    data.HighBit, data.PixelRepresentation = bits - 1, 0
    data["PixelData"] = DataElement(0x7FE00010, "OW" if bits == 16 else "OB", raw + b"\0" * (len(raw) % 2))


def sources(shape: tuple[int, int, int], affine: NDArray[np.float64]) -> list[Dataset]:
    """Return the slices of a CT that highdicom takes as the source of a segmentation."""
    slices = [slice_dataset(np.zeros(shape[1:], np.int16), affine, k) for k in range(shape[0])]
    study, frame = generate_uid(entropy_srcs=["study"]), generate_uid(entropy_srcs=["frame"])
    for data in slices:
        data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = CTImageStorage
        data.Modality, data.StudyInstanceUID, data.FrameOfReferenceUID = "CT", study, frame
        for keyword in ("StudyID", "StudyDate", "StudyTime", "AccessionNumber", "PatientBirthDate", "PatientSex"):
            setattr(data, keyword, "")
        data.ReferringPhysicianName = data.PositionReferenceIndicator = ""
        data.SliceThickness = float(np.linalg.norm(affine[:3, 2]))
    return slices


def by_highdicom(masks: Masks, affine: NDArray[np.float64], path: Path, kind: str, **options: Any) -> Any:
    """Write a segmentation with highdicom, and return what it reads of it."""
    import highdicom as hd
    from pydicom.sr.codedict import codes

    described = [
        hd.seg.SegmentDescription(
            segment_number=number, segment_label=f"Segment {number}", segmented_property_category=codes.SCT.Organ,
            segmented_property_type=codes.SCT.Liver, algorithm_type="MANUAL",
        )
        for number in masks
    ]  # fmt: skip
    stacked = np.stack(list(masks.values()), axis=-1)
    shape = stacked.shape[:3]
    made = hd.seg.Segmentation(
        sources((shape[0], shape[1], shape[2]), affine), stacked if kind == "FRACTIONAL" else stacked.astype(np.uint8),
        kind, described, generate_uid(), 1, generate_uid(), 1, "maker", "model", "1", "1", **options,
    )  # fmt: skip
    made.save_as(path)
    return hd.seg.segread(path)


def written(masks: Masks, affine: NDArray[np.float64], path: Path, **options: Any) -> Path:
    """Write a segmentation frame by frame."""
    return save(segmentation(masks, affine, **options), path)


def palette() -> Any:
    """Return highdicom's colors for labels 0 to 255."""
    import highdicom as hd

    layers = [
        hd.PaletteColorLUT(first_mapped_value=0, lut_data=np.arange(256, dtype=np.uint8)[::step], color=color)
        for step, color in ((1, "red"), (-1, "green"), (1, "blue"))
    ]
    return hd.PaletteColorLUTTransformation(red_lut=layers[0], green_lut=layers[1], blue_lut=layers[2])
