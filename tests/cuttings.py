"""Small studies, the places where they are cut into slabs, and whether what is kept of them is the same."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st

from conftest import seeds
from tomomesh import Settings, Volume
from tomomesh.errors import TomomeshError
from tomomesh.model.lazy import ArraySource, LazyVoxels, in_memory
from tomomesh.segmentation.slabwise.cut import Cutting
from tomomesh.segmentation.study import lay_out, select_in
from tomomesh.slabs.keep import InMemory
from tomomesh.ways.choice import take_way

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh.segmentation.study import Selected
    from tomomesh.stage import Stage

SHAPE = (11, 16, 17)
SLICES, ROWS, COLUMNS = np.indices(SHAPE)
BALL = (1.6 * (SLICES - 5)) ** 2 + (ROWS - 7) ** 2 + (COLUMNS - 8) ** 2 < 42
CIRCLE = np.hypot(ROWS - 7.5, COLUMNS - 8) > 7.6
KINDS = ("u1", "i1", "i2", ">i2", "u2", "i4", "u4", ">f4", "f4", "f8", "f2")
TURN = np.deg2rad(20)
OBLIQUE = np.array(
    [[np.cos(TURN), -np.sin(TURN), 0, 4], [np.sin(TURN), np.cos(TURN), 0, -7], [0, 0, 1.5, 2], [0, 0, 0, 1.0]]
)


@st.composite
def cuttings(draw: st.DrawFn) -> Cutting:
    """Draw where studies are cut: in places that are shares of their slices, so that they fit every one."""
    shares = draw(st.lists(st.floats(0.01, 0.99), max_size=6))
    return Cutting(
        lambda shape: sorted({0, shape[0], *(min(shape[0], int(share * shape[0]) + 1) for share in shares)}),
        draw(st.sampled_from([None, InMemory()])),
    )


@st.composite
def grays(draw: st.DrawFn) -> NDArray[Any]:
    """Draw a study of a ball in noise: padding around it or not, specks and pores, levels that are no numbers."""
    rng, kind = np.random.default_rng(draw(seeds)), np.dtype(draw(st.sampled_from(KINDS)))
    levels = np.where(BALL, 1.0, 0.0) + 0.06 * rng.normal(size=SHAPE)
    levels[rng.random(SHAPE) < draw(st.sampled_from([0, 0.01]))] = 1
    levels[BALL & (rng.random(SHAPE) < draw(st.sampled_from([0, 0.02])))] = 0
    padded = draw(st.sampled_from([None, CIRCLE, SLICES < 4, COLUMNS > 12]))
    level = draw(st.sampled_from([0.4, 0.0, -9.0, -0.0]))
    levels = levels if padded is None else np.where(padded, level, levels)
    if kind.kind == "f":
        levels.flat[7:9] = draw(st.sampled_from([0, np.nan, np.inf, -np.inf]))
        return levels.astype(kind)
    scale = 40 if kind.itemsize == 1 else 500
    return np.clip(np.rint(levels * scale + (kind.kind == "u") * scale), *_limits(kind)).astype(kind)


def _limits(kind: np.dtype[Any]) -> tuple[int, int]:
    return int(np.iinfo(kind).min), int(np.iinfo(kind).max)


@st.composite
def label_maps(draw: st.DrawFn) -> NDArray[Any]:
    """Draw a map of three labels, with gaps, specks, and numbers that are nearly whole."""
    rng = np.random.default_rng(draw(seeds))
    labels = np.where(BALL, 1 + (COLUMNS > 8), 0) * draw(st.sampled_from([1, 3, 70_000]))
    labels[rng.random(SHAPE) < draw(st.sampled_from([0, 0.01]))] = 5
    labels[draw(st.sampled_from([slice(0), slice(4, 6), slice(1, None, 2)]))] = 0
    if draw(st.booleans()):
        return np.asarray(labels + draw(st.sampled_from([0, 1e-5, 0.3])) * (labels == 1), np.float32)
    return np.asarray(labels, draw(st.sampled_from(["i4", "u4", "i8"])))


ASKED = st.fixed_dictionaries(
    {},
    optional={
        "keep": st.sampled_from(["auto", "all", "largest"]),
        "slices": st.sampled_from(["axial", "coronal", "sagittal"]),
        "slice_range": st.just((2, 8)),
        "roi": st.just((-3.0, 9.0, -4.0, 12.0, 3.0, 17.0)),
    },
)
"""What may be asked of any study."""


def kept(volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None = None) -> Stage[Selected]:
    settings = Settings().replace(**asked)
    return select_in(lay_out(volume, labels, settings, labelled="select" in asked, cutting=cutting), settings)


def lazily(volume: Volume) -> Volume:
    """Have its voxels stay where they are until they are read."""
    voxels: Any = LazyVoxels.of(ArraySource(volume.voxels))
    return replace(volume, voxels=voxels)


def whole(shape: tuple[int, ...]) -> list[int]:
    return [0, shape[0]]


def assert_the_same(volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None = None) -> None:
    """Compare what is kept, bit for bit, and every word that is told of it, or the error."""
    there = None if labels is None else lazily(labels)
    wanted = kept_or_not(volume, asked, Cutting(whole), labels)
    for study, map_ in ((volume, labels), (lazily(volume), there)):
        assert_alike(kept_or_not(study, asked, cutting, map_), wanted)


def kept_or_not(
    volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None = None
) -> Stage[Selected] | str:
    """Return what is kept, or why nothing is."""
    return or_why(lambda: kept(volume, asked, cutting, labels))


def or_why(choose: Callable[[], Stage[Selected]]) -> Stage[Selected] | str:
    try:
        return choose()
    except TomomeshError as fault:
        return repr(fault)


def assert_alike(found: Stage[Selected] | str, wanted: Stage[Selected] | str) -> None:
    if isinstance(wanted, str) or isinstance(found, str):
        assert found == wanted
    else:
        assert_equal(found, wanted)


def assert_equal(found: Stage[Selected], wanted: Stage[Selected]) -> None:
    ours, theirs = found.value.chosen, wanted.value.chosen
    for name in ("shape", "begin", "starts", "stops"):
        np.testing.assert_array_equal(getattr(ours.runs, name), getattr(theirs.runs, name))
    np.testing.assert_array_equal(ours.mask, theirs.mask)
    voxels = in_memory(ours.volume.voxels)
    assert (voxels.dtype, voxels.tobytes()) == (theirs.volume.voxels.dtype, theirs.volume.voxels.tobytes())
    np.testing.assert_array_equal(ours.lower, theirs.lower)
    np.testing.assert_array_equal(ours.upper, theirs.upper)
    assert (ours.counts, ours.told) == (theirs.counts, theirs.told)
    assert repr(found.stats) == repr(wanted.stats)
    assert found.warnings == wanted.warnings
    assert found.value.study.notes == wanted.value.study.notes
    ways = [take_way(one.value, Settings()).stats for one in (found, wanted)]
    assert repr(ways[0]) == repr(ways[1])
