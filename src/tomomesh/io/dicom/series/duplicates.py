"""What tells apart two images at one position."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...files.source import third_party
from ..headers.multiframe import PER_FRAME, counting

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..headers.header import ImageFrame

DISTINGUISHING = (
    "EchoTime", "EchoNumbers", "TemporalPositionIdentifier", "AcquisitionNumber", "TriggerTime",
    "DiffusionBValue", "InversionTime", "FlipAngle", "KVP", "ConvolutionKernel", "ImageType",
    "InstanceNumber",
)  # fmt: skip
"""Fields that tell apart images at one position, the likeliest first; none of them is personal."""


def difference(a: ImageFrame, b: ImageFrame) -> tuple[str, str]:
    """Return the first field in which two images differ, and its two values in words."""
    with third_party("pydicom", b.path.name):
        for keyword, one, other in _pairs(a, b):
            if one != other:
                return keyword, f"{one} and {other}"
    return "PixelData", "different"


def _pairs(a: ImageFrame, b: ImageFrame) -> Iterator[tuple[str, Any, Any]]:
    """Yield fields with their values in two images: dimensions of an enhanced file, or fields of the header."""
    if a.path != b.path:
        yield from ((keyword, a.header.get(keyword), b.header.get(keyword)) for keyword in DISTINGUISHING)
    elif PER_FRAME in a.header:
        one, other = (_content(frame) for frame in (a, b))
        names = [_pointer(item) for item in a.header.get("DimensionIndexSequence") or []]
        values = (list(content.get("DimensionIndexValues") or []) for content in (one, other))
        yield from zip(names, *values, strict=False)
        yield "TemporalPositionIndex", one.get("TemporalPositionIndex"), other.get("TemporalPositionIndex")
    else:
        vectors = ((keyword, np.atleast_1d(a.header.get(keyword))) for keyword in counting(a.header))
        last = max(a.number, b.number)
        yield from ((keyword, each[a.number], each[b.number]) for keyword, each in vectors if len(each) > last)


def _content(frame: ImageFrame) -> Any:
    items = frame.header.get(PER_FRAME)[frame.number].get("FrameContentSequence")
    return items[0] if items else {}


def _pointer(item: Any) -> str:
    from pydicom.datadict import keyword_for_tag

    return keyword_for_tag(item.get("DimensionIndexPointer") or 0) or "DimensionIndexValues"
