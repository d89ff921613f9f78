"""Networks of a window and levels that are drawn and read some slices at a time: the bytes of the run in memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from tomomesh import Settings, Volume, phantom, reconstruct
from tomomesh.errors import EmptyError
from tomomesh.followed import outline_followed
from tomomesh.isosurface.crossings import Levels
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.isosurface.sides import WindowSides
from tomomesh.judgement import follow
from tomomesh.large import LargeSurface, reconstruct_large
from tomomesh.model.lattice import lattice
from tomomesh.model.lazy import LazyVoxels
from tomomesh.segmentation.contours.between import Between, filled_between
from tomomesh.segmentation.contours.train import train_contours
from tomomesh.segmentation.networks.slices import ByLayer, Slices
from tomomesh.segmentation.networks.training import regions, train_some, train_study
from tomomesh.segmentation.outlines import outlines_of
from tomomesh.segmentation.selection import Chosen
from tomomesh.segmentation.study import Selected
from tomomesh.segmentation.window import by_layer
from tomomesh.settings import NetworkSettings
from tomomesh.slabs.cuts import Cuts
from tomomesh.slabs.keep import InMemory
from tomomesh.slabs.surface import Asked, surface_in_slabs
from tomomesh.ways import contours, rings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tomomesh.results import Segmentation, Surface
    from tomomesh.ways.way import Way

    Floats = NDArray[np.float64]

thickness = st.integers(1, 5)
BESIDE = 2
"""Slices beside those of spaces between rings that are looked at with them."""


@dataclass(frozen=True)
class Watched:
    """A stored array of which no more slices may be read at once than a number; `read_of` are those that were."""

    array: NDArray[Any]
    most: int
    read_of: list[tuple[int, int]] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes."""
        return self.array.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers."""
        return self.array.dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together."""
        return (1, *self.array.shape[1:])

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part."""
        assert box[0].stop - box[0].start <= self.most, "more was read than is worked on"
        self.read_of.append((box[0].start, box[0].stop))
        return self.array[box].copy()


def some_at_once(patch: pytest.MonkeyPatch, most: int) -> None:
    """Have so many slices worked on together, and refuse to draw more of a mask, but for those that tell of these."""
    draw, blocks = RunMask.__getitem__, 4 * -(-most // 4)

    def watched(mask: RunMask, slices: int | slice) -> NDArray[np.bool_]:
        drawn = draw(mask, slices)
        assert drawn.ndim == 2 or len(drawn) <= max(most + BESIDE, blocks + 1), (
            "more was drawn at once than is worked on together"
        )
        return drawn

    patch.setattr("tomomesh.model.sliced.SOME", most)
    patch.setattr("tomomesh.isosurface.sides.LAYERS", blocks)
    patch.setattr(RunMask, "__getitem__", watched)
    patch.setattr(RunMask, "dense", property(lambda mask: pytest.fail("the whole mask was drawn")))


def gray_levels(seed: int, count: int = 9) -> Floats:
    """Return the gray levels of smooth blots over a number of slices."""
    noise = np.random.default_rng(seed).normal(size=(count, 36, 40))
    smooth = ndimage.gaussian_filter(noise, (1.0, 3.0, 3.0))
    return np.asarray(smooth / smooth.std(), np.float64)


def bytes_of(*arrays: NDArray[Any]) -> list[bytes]:
    return [array.tobytes() for array in arrays]


class TestNetworks:
    """One network on every slice."""

    @law(8)
    @given(seeds, thickness, st.sampled_from(["neighbor", "ellipse"]), st.sampled_from(["auto", "region", "boundary"]))
    def test_those_of_any_ranges_are_those_of_the_whole(self, seed: int, most: int, start: str, signal: str) -> None:
        gray = gray_levels(seed)
        gray[3] = -9.0
        settings = NetworkSettings(start=start, signal=signal, neurons=16)
        whole = train_study(gray > 0.3, settings, levels=Levels(gray, 0.3, np.inf))
        source = Watched(gray, max(most, 1))
        with pytest.MonkeyPatch.context() as patch:
            mask = RunMask.of([gray > 0.3])
            some_at_once(patch, most)
            parts = train_study(mask, settings, levels=Levels(LazyVoxels.of(source), 0.3, np.inf))
            labels = regions(mask, parts)
        assert bytes_of(parts.codebooks, parts.bridged) == bytes_of(whole.codebooks, whole.bridged)
        assert bytes_of(parts.slices, parts.pixels, parts.strays) == bytes_of(whole.slices, whole.pixels, whole.strays)
        assert labels.tobytes() == regions(gray > 0.3, whole).tobytes()

    @law(6)
    @given(seeds, st.lists(st.integers(1, 8), max_size=4, unique=True))
    def test_ranges_need_not_be_alike(self, seed: int, cuts: list[int]) -> None:
        """And may be trained in any order, as long as none starts from the one below."""
        gray = gray_levels(seed)
        settings = NetworkSettings(neurons=16)
        slices = Slices.of(gray > 0.3, None, Levels(gray, 0.3, np.inf), settings, (1.0, 1.0), 0, 0)
        whole = train_some(slices, graph := lattice("ring", 16), 16)
        places = [0, *sorted(cuts), len(gray)]
        found = {a: train_some(slices.part(a, b), graph, 16) for a, b in reversed([*pairwise(places)])}
        for n, column in enumerate(whole[:4]):
            assert np.concatenate([found[a][n] for a in sorted(found)]).tobytes() == column.tobytes()

    @law(4)
    @given(seeds, thickness)
    def test_layers_are_shown_as_in_memory(self, seed: int, most: int) -> None:
        color = np.stack([gray_levels(seed + n, 6) for n in range(3)], axis=-1)
        volume, kept = Volume.from_stored(color, np.eye(4)), np.asarray((color > 0.3).any(axis=-1))
        settings = NetworkSettings(inputs="layers", neurons=16, signal="region")
        whole = train_study(kept, settings, layers=by_layer(volume, lower=0.3) & kept[..., None])
        source = Watched(color, most)
        with pytest.MonkeyPatch.context() as patch:
            runs = RunMask.of([kept])
            some_at_once(patch, most)
            lazy = Volume.from_stored(LazyVoxels.of(source), np.eye(4))
            parts = train_study(runs, settings, layers=ByLayer(lazy, runs, 0.3, np.inf))
        assert bytes_of(parts.codebooks, parts.pixels) == bytes_of(whole.codebooks, whole.pixels)


class TestContours:
    """Several rings on every slice, on tracks from slice to slice."""

    @law(9)
    @given(seeds, thickness, st.sampled_from(["loops", "components", "walls"]), st.sampled_from(["auto", "boundary"]))
    def test_those_of_any_ranges_are_those_of_the_whole(self, seed: int, most: int, kind: str, signal: str) -> None:
        gray = gray_levels(seed)
        settings = NetworkSettings(contours=kind, signal=signal, neurons=40)
        levels = Levels(gray, 0.3, np.inf)
        try:
            whole = train_contours(gray > 0.3, settings, levels=levels)
        except EmptyError:
            return
        with pytest.MonkeyPatch.context() as patch:
            mask = RunMask.of([gray > 0.3])
            some_at_once(patch, most)
            parts = train_contours(mask, settings, levels=Levels(LazyVoxels.of(Watched(gray, most)), 0.3, np.inf))
        assert (parts.events, parts.dropped, len(parts)) == (whole.events, whole.dropped, len(whole))
        for one, other in zip(parts.contours, whole.contours, strict=True):
            assert (one.slice, one.ring, one.side, one.track) == (other.slice, other.ring, other.side, other.track)
            assert bytes_of(one.codebook, one.bridged) == bytes_of(other.codebook, other.bridged)

    @law(6)
    @given(seeds, st.data(), st.sampled_from([0.8, 2.0, 3.0]))
    def test_what_lies_between_is_drawn_alike_in_any_box(self, seed: int, data: st.DataObject, step: float) -> None:
        gray = gray_levels(seed)
        gray[4] = -9.0
        study = Volume.from_stored(gray, np.diag([1.0, 1.0, step, 1.0]))
        levels = Levels(gray, 0.3, np.inf)
        found = train_contours(gray > 0.3, NetworkSettings(contours="loops"), levels=levels)
        whole = filled_between(found, gray > 0.3, study, levels=levels).voxels
        between = Between.of(found, RunMask.of([gray > 0.3]), study, levels)
        assert between.shape == whole.shape
        assert between.times == max(round(step), 1)
        for _ in range(3):
            ends = [sorted(data.draw(st.sets(st.integers(0, n), min_size=2, max_size=2))) for n in whole.shape]
            box = tuple(slice(a, b) for a, b in ends)
            assert between.read(box).tobytes() == np.ascontiguousarray(whole[box]).tobytes()


class TestJudgement:
    """What of a window is followed."""

    @law(10)
    @given(seeds, thickness, st.booleans())
    def test_faces_and_outlines_are_those_of_the_whole(self, seed: int, most: int, outlined: bool) -> None:
        gray = gray_levels(seed, 14)
        gray[5] = -9.0
        mask = gray > 0.3
        study, places = Volume.from_stored(gray, np.eye(4)), np.random.default_rng(seed).uniform(-9, 45, (60, 3))
        whole, sides = outline_followed(mask, study, outlined=outlined), WindowSides.of(mask)
        expected = [sides.some(7), sides.distances(places)]
        reached = whole._from(places, 1)
        with pytest.MonkeyPatch.context() as patch:
            runs = RunMask.of([mask])
            some_at_once(patch, most)
            parts, own = outline_followed(runs, study, outlined=outlined), WindowSides.of(runs)
            assert bytes_of(own.some(7), own.distances(places)) == bytes_of(*expected)
            assert parts._from(places, 1).tobytes() == reached.tobytes()
        assert (parts.what, parts.inside, parts.unit, len(parts.places)) == (
            whole.what, whole.inside, whole.unit, len(whole.places),
        )  # fmt: skip

    @law(10)
    @given(seeds, thickness)
    def test_slices_are_told_alike_in_any_ranges(self, seed: int, most: int) -> None:
        mask = gray_levels(seed, 14) > 0.6
        mask[6] = False
        whole = outlines_of(mask, (0.5, 0.75))
        with pytest.MonkeyPatch.context() as patch:
            runs = RunMask.of([mask])
            some_at_once(patch, most)
            parts = outlines_of(runs, (0.5, 0.75))
        for name, value in vars(whole).items():
            assert np.array_equal(vars(parts)[name], value), name


HEAD = phantom((26, 64, 64), (3.75, 3.75, 5.7))
WAYS: dict[str, tuple[Way, dict[str, Any]]] = {
    "ring": (rings.WAY, {"network": "ring", "neurons": 40}),
    "contours": (contours.WAY, {"contours": "loops"}),
    "components": (contours.WAY, {"contours": "components", "neurons": 60}),
}


def made(name: str, voxels: Any, most: int | None = None) -> Iterator[Segmentation[Any] | Surface]:
    """Take the built-in head to networks, and to its surface."""
    way, changes = WAYS[name]
    settings = Settings().replace(even=False, allow_far=True, **changes)
    study = Volume(voxels, HEAD.volume.affine, HEAD.volume.grid)
    runs = RunMask.of([HEAD.volume.voxels > HEAD.lower])
    with pytest.MonkeyPatch.context() as patch:
        if most is not None:
            some_at_once(patch, most)
        kept = Selected(study, "axial", Chosen(study, runs, HEAD.lower, HEAD.upper))
        assert way.segment is not None
        found = way.segment(kept, settings, lambda *told: None).value
        yield found
        surface = way.surface(found, settings, lambda *told: None).value
        follow(surface, settings)
        yield surface


class TestWays:
    """From a study that is read some slices at a time to its mesh."""

    @pytest.mark.parametrize("most", [3, 8])
    @pytest.mark.parametrize("name", WAYS)
    def test_a_study_is_read_in_parts_and_gives_the_same_bytes(self, name: str, most: int) -> None:
        source = Watched(HEAD.volume.voxels, most if name == "ring" else most + BESIDE)
        whole, parts = list(made(name, HEAD.volume.voxels)), list(made(name, LazyVoxels.of(source), most))
        for one, other in zip(whole, parts, strict=True):
            assert one.points.positions.tobytes() == other.points.positions.tobytes()
        meshes = [found[1].mesh for found in (whole, parts)]  # type: ignore[union-attr]
        assert len({mesh.vertices.tobytes() + mesh.faces.tobytes() for mesh in meshes}) == 1
        if name == "ring":
            ranges = [one for one in source.read_of if one[1] - one[0] > 1]
            assert ranges == sorted(set(ranges)), "a range was read twice"

    @law(3)
    @given(st.lists(st.integers(1, 52), max_size=5, unique=True))
    def test_levels_around_rings_go_through_slabs(self, cuts: list[int]) -> None:
        found, surface = made("contours", HEAD.volume.voxels)
        volume, inside = contours.levels_of_rings(found)  # type: ignore[arg-type]
        places = tuple(place for place in sorted(cuts) if place < volume.shape[0])
        asked = Asked(inside, volume.voxels, volume.affine, lower=0.0)
        slabs = surface_in_slabs(asked, Cuts((0, *places, volume.shape[0])), Settings().fit, InMemory())
        pieces = InMemory().fetch(slabs.mesh.pieces)
        vertices = np.concatenate([one.vertices for one in pieces] + [one.centers for one in pieces])
        faces = np.concatenate([one.halves for one in pieces] + [one.quarters for one in pieces])
        assert vertices.tobytes() == surface.mesh.vertices.tobytes()  # type: ignore[union-attr]
        assert np.array_equal(faces, surface.mesh.faces)  # type: ignore[union-attr]

    @pytest.mark.parametrize("slab", [5, 64])
    def test_contours_are_meshed_slab_by_slab(self, slab: int) -> None:
        """From a study that stays in its file; only how far the mesh is from its window is not measured."""
        settings = Settings().replace(way="contours", lower=HEAD.lower, remesh=False)
        whole = reconstruct(HEAD.volume, settings)
        voxels: Any = LazyVoxels.of(Watched(HEAD.volume.voxels, 26))
        parts = reconstruct_large(Volume(voxels, HEAD.volume.affine, HEAD.volume.grid), settings, slab=slab)
        assert isinstance(parts, LargeSurface)
        mesh = parts.joined()
        assert (mesh.vertices.tobytes(), mesh.faces.tolist()) == (
            whole.mesh.vertices.tobytes(),
            whole.mesh.faces.tolist(),
        )
        for section in ("networks", "rings", "points", "voxels"):
            assert parts.report[section] == whole.report[section]
        assert parts.report["quality"]["closed"]
