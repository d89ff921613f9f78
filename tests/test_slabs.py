"""A surface in slabs is the surface in memory, to the byte: wherever it is cut, whoever works, in whatever order."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds, size
from cut_meshes import cut_off_in
from isosurfaces import volume_of
from test_voxels import LEFT_HANDED, SHEARED
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.isosurface.voxels import boundary, voxel_surface
from tomomesh.settings import FitSettings
from tomomesh.slabs.cuts import Cuts
from tomomesh.slabs.ground import ground
from tomomesh.slabs.keep import InMemory, OnDisk
from tomomesh.slabs.surface import Asked, surface_in_slabs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume
from tomomesh.slabs.keep import Kept, Slabs


@dataclass(frozen=True)
class Study:
    """A window on a volume; without levels its mask is all there is."""

    volume: Volume
    mask: NDArray[np.bool_]
    lower: Any = 0.0
    layers: str = "all"
    surface: str = "all"
    settings: FitSettings = FitSettings()  # noqa: RUF009 - frozen

    def in_memory(self) -> tuple[Any, Any]:
        found = boundary(self.volume, self.mask, lower=self.lower, layers=self.layers, surface=self.surface, threads=1)
        return found, voxel_surface(found, self.settings, threads=1)

    def in_slabs(self, cuts: Cuts, slabs: Slabs, *, drawn: bool = True, levels: bool = True) -> Any:
        mask: Any = self.mask if drawn else RunMask.of([self.mask])
        voxels = self.volume.voxels if levels else None
        asked = Asked(mask, voxels, self.volume.affine, self.lower, layers=self.layers, surface=self.surface)
        return surface_in_slabs(asked, cuts, self.settings, slabs)


class Shuffled(InMemory):
    """Works in any order, on values that were sent to it and that it may not change."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        sent = [pickle.dumps((work, *entries)) for entries in zip(*columns, strict=True)]
        found: list[Kept] = [None] * len(sent)
        for n in self.rng.permutation(len(sent)).tolist():
            called, *entries = pickle.loads(sent[n])  # what was just written here
            found[n] = pickle.dumps(called(*entries))
            assert pickle.dumps((called, *entries)) == sent[n]
        return [pickle.loads(one) for one in found]


@st.composite
def studies(draw: st.DrawFn, slices: int = 40) -> Study:
    """Draw levels from noise to smooth, tall enough for halos to end within them; or masks, or levels with holes."""
    shape = (draw(st.integers(1, size(slices, 14))), *draw(st.tuples(*[st.integers(1, size(14, 5))] * 2)))
    rng = np.random.default_rng(draw(seeds))
    smooth = ndimage.gaussian_filter(rng.normal(size=shape), draw(st.sampled_from([0.0, 0.6, 1.2, 3.0])))
    gray = smooth / (smooth.std() or 1.0) + draw(st.sampled_from([-1.0, -0.3, 0.3, 1.0]))
    gray[tuple(rng.integers(shape))] = 1.0
    kind = draw(st.sampled_from(["float64", "float32", "int16", "mask", "whole", "nan"]))
    if kind == "nan":
        gray[rng.random(shape) < 0.1] = np.nan
        gray[rng.random(shape) < 0.05] = np.inf
    stored = {"mask": gray > 0, "int16": 100 * gray, "whole": np.round(gray)}.get(kind, gray)
    volume = volume_of(stored.astype({"mask": "u1", "whole": "f4", "nan": "f4"}.get(kind, kind)))
    held = np.asarray(volume.voxels > 0)
    held[tuple(rng.integers(shape))] |= not held.any()
    steps = draw(st.sampled_from([100, 100, 100, 5, 1]))
    return Study(volume, held, settings=FitSettings(max_steps=steps))


def cuts_of(data: st.DataObject, slices: int) -> Cuts:
    inner = data.draw(st.sets(st.integers(1, slices - 1), max_size=8)) if slices > 1 else set[int]()
    return Cuts((0, *sorted(inner), slices))


def assert_same(found: Any, study: Study) -> None:
    """The mesh, where it is cut off, what it holds, what the mask got and how the net came to rest are as in memory."""
    bounded, surface = study.in_memory()
    mesh, expected = found.mesh.joined(), surface.mesh
    assert mesh.faces.tobytes() == expected.faces.tobytes()
    assert mesh.vertices.tobytes() == expected.vertices.tobytes()
    assert cut_off_in(found.mesh).tobytes() == surface.cut_off.tobytes()
    assert (found.added, found.stepped) == (bounded.added, bounded.crossings.stepped)
    assert (found.enclosed, found.cavities) == (bounded.volumes.sum(), bounded.cavities)
    trace, before = found.trace, surface.net_fit.trace
    assert trace.speed.tolist() == before.speed.tolist()
    assert trace.converged == before.converged
    assert trace.acceleration.tolist() == before.acceleration.tolist()


class TestAnyCutsGiveTheSameBytes:
    @law(400)
    @given(study=studies(), data=st.data())
    def test_of_any_levels(self, study: Study, data: st.DataObject) -> None:
        assert_same(study.in_slabs(cuts_of(data, len(study.mask)), InMemory()), study)

    @law(40)
    @given(study=studies(), data=st.data(), seed=seeds)
    def test_in_any_order_and_sent_elsewhere(self, study: Study, data: st.DataObject, seed: int) -> None:
        cuts = cuts_of(data, len(study.mask))
        assert_same(study.in_slabs(cuts, Shuffled(seed), drawn=False), study)

    @law(40)
    @given(study=studies(), data=st.data())
    def test_with_every_array_on_disk(self, study: Study, data: st.DataObject) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tomomesh.slabs.keep.LARGE", 1)
            folder = Path(__file__).parent
            assert_same(study.in_slabs(cuts_of(data, len(study.mask)), OnDisk(folder)), study)

    @law(40)
    @given(study=studies(), data=st.data())
    def test_of_masks_whose_levels_are_their_own(self, study: Study, data: st.DataObject) -> None:
        mask = Study(volume_of(study.mask.astype(np.uint8)), study.mask, settings=study.settings)
        found = mask.in_slabs(cuts_of(data, len(study.mask)), InMemory(), drawn=False, levels=False)
        assert_same(found, mask)

    @law(30)
    @given(study=studies(), data=st.data(), layers=st.sampled_from(["all", "any"]), seed=seeds)
    def test_of_color(self, study: Study, data: st.DataObject, layers: str, seed: int) -> None:
        gray = study.volume.voxels.astype(np.float32)
        rolled = np.random.default_rng(seed).permuted(gray, axis=1)
        volume, lower = volume_of(np.stack([gray, rolled, gray[:, ::-1]], axis=3)), np.array([0.0, -0.2, 0.1])
        kept = volume.voxels > lower
        inside = np.asarray(kept.all(axis=3) if layers == "all" else kept.any(axis=3), np.bool_)
        inside[0, 0, 0] |= not inside.any()
        colored = Study(volume, inside, lower, layers)
        assert_same(colored.in_slabs(cuts_of(data, len(inside)), InMemory()), colored)

    @pytest.mark.parametrize("affine", [LEFT_HANDED, SHEARED], ids=["left-handed", "sheared"])
    def test_in_other_frames(self, affine: NDArray[np.float64]) -> None:
        rng = np.random.default_rng(3)
        gray = ndimage.gaussian_filter(rng.normal(size=(30, 9, 9)), 1.0)
        study = Study(volume_of(gray), gray > 0)
        turned = Study(volume_of(gray, affine), study.mask)
        assert_same(turned.in_slabs(Cuts.every(30, 7), InMemory()), turned)


class TestContacts:
    @law(12)
    @given(seed=seeds, share=st.sampled_from([0.12, 0.2, 0.35]), cut=st.integers(2, 12), even=st.booleans())
    def test_noise_takes_more_rounds_than_one_halo_allows(self, seed: int, share: float, cut: int, even: bool) -> None:
        """Also where its levels are taken for those of a mask: then it matters how thin it is once all is joined."""
        gray = np.random.default_rng(seed).random((64, size(16, 8), size(16, 8)))
        study, slabs = Study(volume_of(gray), gray > 1 - share, 1 - share), CountedSlabs()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tomomesh.isosurface.crossings.Levels.are_stepped", lambda levels, lines: even)
            found = study.in_slabs(Cuts.every(64, cut), slabs)
            assert slabs.grounds > 1
            assert_same(found, study)

    @law(60)
    @given(study=studies(), data=st.data(), hollow=st.booleans())
    def test_what_the_outside_does_not_reach_is_filled(self, study: Study, data: st.DataObject, hollow: bool) -> None:
        """As in memory: after contacts are joined, while what is thin is so before."""
        mask = ndimage.binary_dilation(study.mask) & ~study.mask if hollow else study.mask
        outer = replace(study, mask=mask if mask.any() else study.mask, surface="outer")
        assert_same(outer.in_slabs(cuts_of(data, len(study.mask)), Shuffled(0)), outer)


class CountedSlabs(InMemory):
    """Counts how often the slabs were looked at."""

    grounds = 0

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        self.grounds += getattr(work, "func", None) is ground
        return super().each(work, *columns)
