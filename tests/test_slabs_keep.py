"""What slabs make stays as it was, nothing of it stays on the disk, and the memory holds one slab."""

from __future__ import annotations

import errno
import gc
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, law, seeds
from tomomesh.errors import OutputError
from tomomesh.slabs.cuts import Cuts
from tomomesh.slabs.keep import InMemory, OnDisk
from tomomesh.slabs.parts import Part, exchanged, gathered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.slabs.keep import Slabs

DESCRIPTORS = Path("/proc/self/fd")


class Pair(NamedTuple):
    one: Any
    other: Any


@dataclass(frozen=True)
class Value:
    arrays: tuple[NDArray[Any], ...]
    told: Any


def value_of(kind: str, count: int) -> Value:
    rows = np.arange(3 * count).astype(kind).reshape(count, 3)
    return Value((rows, rows[::2], rows[:0]), [Pair(rows[:, 0], "words"), (1, None, count)])


def summed(*values: Value) -> Pair:
    """Return what is in values, and change it, as no work may: what is kept stays."""
    total = sum(float(array.sum()) for value in values for array in value.arrays)
    for value in values:
        value.arrays[0][:] = 0
    return Pair(total, values[0].told[0].one.copy())


@pytest.mark.parametrize("kind", ["f8", "f4", "i4", "u1", "?"])
def test_values_come_back_from_the_disk_as_they_were(kind: str, tmp_path: Path) -> None:
    slabs, counts = OnDisk(tmp_path), [0, 1, 40_000, 100_000]
    kept = slabs.each(partial(value_of, kind), counts)
    for value, count in zip(slabs.fetch(kept), counts, strict=True):
        expected = value_of(kind, count)
        assert type(value) is Value
        assert value.told[1] == expected.told[1]
        pairs = zip((*value.arrays, value.told[0].one), (*expected.arrays, expected.told[0].one), strict=True)
        for one, other in pairs:
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
            assert one.flags.writeable


def test_what_is_kept_is_handed_in_as_it_was_however_it_was_used(tmp_path: Path) -> None:
    slabs = OnDisk(tmp_path)
    kept = slabs.each(partial(value_of, "f8"), [40_000, 60_000])
    first = slabs.fetch(slabs.each(summed, kept, kept[::-1]))
    again = slabs.fetch(slabs.each(summed, kept, kept[::-1]))
    assert [one[0] for one in first] == [one[0] for one in again]
    assert first[0].one == InMemory().each(summed, [value_of("f8", 40_000)], [value_of("f8", 60_000)])[0].one


@pytest.mark.skipif(not DESCRIPTORS.exists(), reason="this system does not list what a process has open")
def test_no_file_has_a_name_and_none_outlives_its_values(tmp_path: Path) -> None:
    slabs, before = OnDisk(tmp_path), len(list(DESCRIPTORS.iterdir()))
    kept = slabs.each(partial(value_of, "f8"), [40_000] * 3)
    assert list(tmp_path.iterdir()) == []
    assert len(list(DESCRIPTORS.iterdir())) == before + 1
    values = slabs.fetch(kept)
    assert values[2].arrays[0][-1, -1] == 3 * 40_000 - 1
    del kept, values
    gc.collect()
    assert len(list(DESCRIPTORS.iterdir())) == before


def test_a_disk_that_is_full_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Full:
        def seek(self, place: int) -> None: ...

        def write(self, data: Any) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        def close(self) -> None: ...

    monkeypatch.setattr("tomomesh.slabs.keep.tempfile.TemporaryFile", lambda **kind: Full())
    with pytest.raises(OutputError, match=r"^what was made of a slab cannot be kept\. .*\[the disk is full\]\. Try: "):
        OnDisk(tmp_path).each(partial(value_of, "f8"), [40_000])


def test_a_folder_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no such file"):
        OnDisk(tmp_path / "gone").each(partial(value_of, "f8"), [40_000])


class TestCuts:
    @law(100)
    @given(layers=st.integers(1, 60), thickness=st.integers(0, 70))
    def test_slabs_of_one_thickness_cover_all_layers_once(self, layers: int, thickness: int) -> None:
        own = Cuts.every(layers, thickness).own
        assert [layer for start, stop in own for layer in range(start, stop)] == list(range(layers))
        assert {stop - start for start, stop in own[:-1]} <= {max(thickness, 1)}

    @law(100)
    @given(data=st.data(), layers=st.integers(2, 30), halo=st.integers(0, 40))
    def test_a_halo_is_what_the_slabs_beside_have(self, data: st.DataObject, layers: int, halo: int) -> None:
        cuts = cuts_of(data, layers)
        for slab, (start, stop) in enumerate(cuts.own):
            near = set(range(start - halo, stop + halo)) & set(range(layers))
            assert set(range(*cuts.around(slab, halo))) == near
            assert cuts.beside(slab, halo) == [
                n for n, (a, b) in enumerate(cuts.own) if n != slab and near & set(range(a, b))
            ]


def cuts_of(data: st.DataObject, layers: int) -> Cuts:
    return Cuts((0, *sorted(data.draw(st.sets(st.integers(1, layers - 1), max_size=9))), layers))


def rows_of(first: int, last: int, whole: NDArray[Any]) -> Part:
    return Part(first, (whole[first:last], 2 * whole[first:last, 0]))


def gathered_in(span: tuple[int, int], parts: list[Part]) -> tuple[NDArray[Any], ...]:
    return gathered(parts, span)


@law(100)
@given(data=st.data(), layers=st.integers(2, 20), halo=st.integers(0, 25), seed=seeds, on_disk=st.booleans())
def test_what_is_exchanged_is_what_the_whole_has_there(
    data: st.DataObject, layers: int, halo: int, seed: int, on_disk: bool
) -> None:
    rng = np.random.default_rng(seed)
    before = np.concatenate([[0], np.cumsum(rng.integers(0, 5, layers))])
    whole, cuts = rng.random((before[-1], 3)), cuts_of(data, layers)
    slabs: Slabs = OnDisk(Path(__file__).parent) if on_disk else InMemory()
    starts, stops = ([int(before[layer]) for layer in side] for side in (cuts.places[:-1], cuts.places[1:]))
    parts = slabs.each(rows_of, starts, stops, [whole] * len(cuts))
    reach = [cuts.around(slab, halo) for slab in range(len(cuts))]
    spans = [(int(before[start]), int(before[stop])) for start, stop in reach]
    found = slabs.fetch(slabs.each(gathered_in, spans, exchanged(slabs, parts, cuts, before, halo)))
    for (start, stop), (rows, numbers) in zip(spans, found, strict=True):
        assert rows.tobytes() == whole[start:stop].tobytes()
        assert numbers.tobytes() == (2 * whole[start:stop, 0]).tobytes()


PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.isosurface.voxels import boundary, voxel_surface
from tomomesh.model.volume import Grid, Volume
from tomomesh.settings import FitSettings
from tomomesh.slabs.cuts import Cuts
from tomomesh.slabs.keep import OnDisk
from tomomesh.slabs.surface import Asked, surface_in_slabs
def peak():
    return 1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
def mask_of(side, slices):
    turns = np.arange(side) * (2 * np.pi / 24)
    z, y, x = np.meshgrid(turns[:slices], turns, turns, indexing="ij", sparse=True)
    return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x) > 0
def run(mask):
    if sys.argv[1] == "slabs":
        asked = Asked(RunMask.of([mask]), None, np.eye(4))
        surface_in_slabs(asked, Cuts.every(len(mask), 16), FitSettings(), OnDisk(Path(sys.argv[2])))
    else:
        volume = Volume(mask.view(np.uint8), np.eye(4), Grid((0, 1, 2), (False,) * 3, np.eye(4)))
        voxel_surface(boundary(volume, mask, lower=0.0, threads=1), FitSettings(), threads=1)
run(mask_of(96, 8))
mask = mask_of(96, 96)
before = peak()
run(mask)
print(peak() - before)
"""


@pytest.mark.skipif(not COMPILED, reason="kernels in plain Python take minutes for it")
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="this system does not tell the peak of a process")
def test_the_memory_holds_one_slab_and_its_halo(tmp_path: Path) -> None:
    """Slabs of 16 slices of 96, with a halo of eight on each side: a third of it."""
    taken = {
        way: float(subprocess.check_output([sys.executable, "-c", PROGRAM, way, str(tmp_path)]))
        for way in ("slabs", "memory")
    }
    assert taken["slabs"] < 0.4 * taken["memory"]
