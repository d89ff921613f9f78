"""The order of slices by the numbers in their names: by value, and told where it could be otherwise."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from PIL import Image

from conftest import law
from tomomesh.io import read_volume
from tomomesh.io.volumes.slice_names import in_order
from tomomesh.settings import ReadSettings

STACKS = {
    "plain": [f"s{n + 1}.png" for n in range(20)],
    "zeros": [f"s{n:03d}.png" for n in range(20)],
    "parentheses": [f"scan ({n + 1}).png" for n in range(20)],
    "constant numbers": [f"p2_2024-01-05_{n}.png" for n in range(20)],
    "times of the clock": [f"{20240101123456789000 + n}.png" for n in range(20)],
    "capitals": [f"{'sS'[n % 2]}{n}.png" for n in range(20)],
    "versions": [f"img_1.{n + 1}.png" for n in range(20)],
    "identifiers": [f"1.2.840.{n + 1}.png" for n in range(20)],
    "only letters": [f"{letter}.png" for letter in "abcdefgh"],
}
"""Names in their order, of which nothing is to be told."""

TOLD = {
    "minus signs": [f"slice_{n - 10}.png" for n in range(20)],
    "all below zero": [f"slice_{n - 30}.png" for n in range(20)],
    "signs of both kinds": [f"z{n - 10:+d}.png" for n in range(20)],
    "a true minus": [f"z{n - 10}.png".replace("-", "\u2212") for n in range(20)],
    "minus and fractions": [f"z{(n - 10) * 2.5:.1f}.png" for n in range(20)],
    "fractions": [f"z_{0.25 * (n + 1):g}.png" for n in range(20)],
    "fractions and a unit": [f"pos{0.5 * n:g}mm.png" for n in range(20)],
    "a comma": [f"pos{0.5 * n:g}mm.png".replace(".", ",") for n in range(20)],
    "p for a point": [f"z{0.25 * n:g}.png".replace(".", "p", 1) for n in range(1, 20)],
    "exponents": [f"z{(n - 10) * 1e-3:.1e}.png" for n in range(20)],
    "dashes between": [f"slice-{n + 1}.png" for n in range(20)],
    "hexadecimal": [f"s{n:02x}.png" for n in range(40)],
    "hexadecimal without zeros": [f"s{n:X}.png" for n in range(40)],
    "fractions in some names": [f"z{n / 2:.2f}.png".replace(".00", "") for n in range(24)],
    "fractions and a step of one": ["s1.png", "s1.5.png", "s2.png", "s2.5.png", "s3.png", "s10.png", "s10.5.png"],
    "letters behind": [f"s{n}{letter}.png" for n in range(9, 12) for letter in "ab"],
    "a stray": [*(f"s{n}.png" for n in range(9, 12)), "s11_2.png"],
    "two runs": [f"{run}_{n + 1}.png" for run in (1, 2) for n in range(12)],
}
TOLD["p for a point"] = [name.replace("ppng", ".png") for name in TOLD["p for a point"]]


def shuffled(names: list[str]) -> list[Path]:
    mixed = list(names)
    Random(3).shuffle(mixed)
    return [Path("folder", name) for name in mixed]


@pytest.mark.parametrize("names", (STACKS | TOLD).values(), ids=(STACKS | TOLD))
def test_slices_are_in_the_order_of_their_numbers(names: list[str]) -> None:
    found, notes = in_order(shuffled(names))
    assert [path.name for path in found] == names
    assert bool(notes) == (names in TOLD.values())


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ([f"s{n:03d}.png" for n in (1, 2, 3, 6, 7)], "missing among the names: 4, 5:"),
        ([f"s{n}.png" for n in (2, 4, 8)], "missing among the names: 6:"),
        ([f"z{n / 4:g}.png" for n in (1, 2, 5)], "missing among the names: 0.75, 1:"),
        (["s1.png", "s2.png", "s9000000000000.png"], "missing among the names: 3, 4, 5, 6, 7, 8, ...:"),
        ([f"z{n}.png" for n in (0, 1, 2.3, 3)], "0.7 to 1.3 apart"),
        ([f"s{n}.png" for n in (1, 1.5, 2, 3, 4, 5)], "0.5 to 1 apart"),
        (["s1.png", "s01.png", "s2.png"], "the same number"),
        (["s1e+999.png", "s1e+99999.png", "s0e+00.png"], "exponents"),
    ],
)
def test_what_is_odd_is_told(names: list[str], words: str) -> None:
    assert any(words in note for note in in_order(shuffled(names))[1])


@law(100)
@given(
    numbers=st.sets(st.integers(-500, 500), min_size=2, max_size=20),
    step=st.sampled_from([1, 0.5, 0.25, 2.5, 0.001, 1e-7]),
    spelling=st.sampled_from(["{:g}", "{:.9f}", "{:+g}", "{:.6e}"]),
    around=st.sampled_from([("z_", ""), ("", "mm"), ("a 7 b=", " c")]),
)
def test_numbers_as_python_spells_them_are_in_the_order_of_their_values(
    numbers: set[int], step: float, spelling: str, around: tuple[str, str]
) -> None:
    spelled = [spelling.format(number * step) for number in sorted(numbers)]
    assume(len({float(one) for one in spelled}) == len(spelled))
    names = [f"{around[0]}{one}{around[1]}.png" for one in spelled]
    assert [path.name for path in in_order(shuffled(names))[0]] == names


def test_a_cone_stays_a_cone_and_the_gap_is_among_the_notes(tmp_path: Path) -> None:
    j, i = np.indices((32, 32)) - 16
    for n in (0, 1, 2, 5, 6):
        Image.fromarray(((i**2 + j**2 <= (4 + n) ** 2) * 200).astype(np.uint8)).save(tmp_path / f"z{n - 3}.png")
    volume = read_volume(tmp_path, settings=ReadSettings(spacing=(1.0, 1.0, 1.0)))
    areas = (volume.voxels > 0).sum(axis=(1, 2))
    assert (np.diff(areas) > 0).all()
    assert any("missing among the names: 0, 1:" in note for note in volume.notes)
