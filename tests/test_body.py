"""Which components of a CT are the patient: tables go, bones and arms stay."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_edt

from conftest import law
from studies import shared
from tomomesh import read_volume, segment
from tomomesh.errors import UsageError
from tomomesh.model.volume import Volume
from tomomesh.segmentation import body

if TYPE_CHECKING:
    from numpy.typing import NDArray

AIR, SKIN, BONE, TABLE, LUNG = -1000, 40, 900, 500, -850


def head(*, table: bool = True, thin: float = 3.0) -> Volume:
    """A head of skin around a skull whose jaw hangs apart, 10 mm over a curved table; 2 mm voxels."""
    z, y, x = 2.0 * np.indices((24, 90, 80))
    x, y = x - 80, y - 70
    out = np.sqrt((x / 60) ** 2 + (y / 60) ** 2)
    levels = np.where(out < 1, SKIN, AIR)
    levels[(out > 0.8) & (out < 0.9) & (y > -20)] = BONE
    levels[(np.abs(x) < 10) & (np.abs(y + 40) < 6) & (z < 20)] = BONE
    if table:
        around = np.sqrt(x**2 + (y + 100) ** 2)
        levels[(around > 170) & (around < 170 + thin) & (np.abs(x) < 70)] = TABLE
    return Volume.from_stored(levels.astype(np.int16), np.diag([2.0, 2.0, 2.0, 1.0]), unit="HU")


@pytest.mark.parametrize("preset", ["skin", "bone"])
class TestTable:
    def test_a_table_is_left_out_and_nothing_else(self, preset: str) -> None:
        with_table, without = (segment(head(table=table), preset=preset, network="none") for table in (True, False))
        assert np.array_equal(with_table.mask, without.mask)
        window = with_table.report["window"]
        assert window["dropped_components"] == 1
        assert window["dropped_voxels"] == np.count_nonzero(head().voxels == TABLE)
        assert any("--keep all" in note for note in with_table.report["study"]["notes"])
        assert without.report["window"]["dropped_components"] == 0
        assert [note for note in without.report["study"]["notes"] if "cut off" not in note] == []

    def test_all_keeps_it(self, preset: str) -> None:
        found = segment(head(), preset=preset, network="none", keep="all")
        assert found.mask[head().voxels == TABLE].all()
        assert found.report["window"]["components"] is None

    def test_what_is_thick_is_a_body_too(self, preset: str) -> None:
        found = segment(head(thin=24.0), preset=preset, network="none")
        assert found.report["window"]["dropped_components"] == 0


class TestKeep:
    def test_a_jaw_apart_from_its_skull_stays(self) -> None:
        found = segment(head(), preset="bone", network="none")
        assert found.report["window"]["components"] == 3
        assert np.array_equal(found.mask, head().voxels == BONE)

    def test_the_largest_is_the_one_with_the_most_voxels(self) -> None:
        found = segment(head(), preset="bone", network="none", keep="largest")
        _, rows, _ = np.nonzero(found.mask)
        assert rows.min() > 24
        assert found.report["window"]["dropped_components"] == 2

    def test_elsewhere_than_in_ct_all_is_kept(self) -> None:
        levels = np.zeros((9, 20, 20), np.uint8)
        levels[:, 2:9, 2:9], levels[4, 15, 15] = 100, 100
        volume = Volume.from_stored(levels, np.eye(4))
        assert segment(volume, lower=50.0, network="none").mask[4, 15, 15]
        with pytest.raises(UsageError, match="Hounsfield"):
            segment(volume, lower=50.0, network="none", keep="body")

    def test_a_small_body_has_thin_limbs(self) -> None:
        small = head()
        tiny = Volume.from_stored(small.voxels, np.diag([0.2, 0.2, 0.2, 1.0]), unit="HU")
        found = segment(tiny, preset="bone", network="none")
        assert np.array_equal(found.mask, small.voxels == BONE)

    def test_where_there_is_no_air_all_is_kept(self) -> None:
        levels = np.full((6, 12, 12), SKIN, np.int16)
        levels[:, 3:6, 3:6], levels[0, 0, 0] = BONE, -5
        found = segment(Volume.from_stored(levels, np.eye(4), unit="HU"), preset="bone", network="none")
        assert np.array_equal(found.mask, levels == BONE)


def lungs(*, bubble: bool = True) -> Volume:
    """A chest with two lungs, and one voxel of air between them, which coarse voxels miss."""
    spacing = (1.0, 3.0, 3.0)
    z, y, x = (np.indices((48, 80, 110)) - np.array([24, 40, 55]).reshape(3, 1, 1, 1)) * np.reshape(
        spacing, (3, 1, 1, 1)
    )
    levels = np.where((x / 150) ** 2 + (y / 105) ** 2 < 1, SKIN, AIR)
    for side in (-70, 70):
        levels[((x - side) / 45) ** 2 + (y / 65) ** 2 + (z / 20) ** 2 < 1] = LUNG
    if bubble:
        levels[25, 40, 55] = LUNG
    return Volume.from_stored(levels.astype(np.int16), np.diag([*spacing[::-1], 1.0]), unit="HU")


class TestAuto:
    """What is thrown away unasked must not be what was wanted."""

    @pytest.mark.parametrize("bubble", [False, True])
    @pytest.mark.parametrize("upper", [-500.0, -200.0])
    def test_a_window_of_air_is_kept(self, bubble: bool, upper: float) -> None:
        study = lungs(bubble=bubble)
        found = segment(study, lower=-950.0, upper=upper, network="none")
        assert np.array_equal(found.mask, lungs(bubble=False).voxels == LUNG)
        assert found.report["window"]["components"] is None
        assert found.report["window"]["speck_voxels"] == bubble

    def test_body_is_taken_at_its_word(self) -> None:
        found = segment(lungs(), lower=-950.0, upper=-500.0, network="none", keep="body")
        assert np.count_nonzero(found.mask) == 1

    def test_where_none_is_in_a_body_it_is_said_that_all_is_kept(self) -> None:
        study = lungs(bubble=False)
        found = segment(study, lower=-950.0, upper=-500.0, network="none", keep="body")
        assert np.array_equal(found.mask, study.voxels == LUNG)
        assert found.report["window"]["dropped_components"] == 0
        [warning] = [told for told in found.report["warnings"] if "body" in told]
        assert "all of it was kept" in warning

    def test_where_there_is_a_body_nothing_is_said(self) -> None:
        said = segment(head(), preset="bone", network="none", keep="body").report["warnings"]
        assert [told for told in said if "body" in told] == []

    def test_a_table_goes_from_a_window_that_begins_in_air(self) -> None:
        found = segment(head(), lower=-470.0, network="none")
        assert found.report["window"]["dropped_voxels"] == np.count_nonzero(head().voxels == TABLE)

    def test_most_of_a_window_is_kept_with_a_warning(self) -> None:
        study = head(table=False)
        study.voxels[:, :8] = TABLE - 1
        study.voxels[:, 8:10, 40] = study.voxels[:, 2:8:2] = AIR
        study.voxels[:, 70, 40] = TABLE - 1
        found = segment(study, lower=TABLE - 2.0, upper=TABLE - 1.0, network="none")
        assert np.array_equal(found.mask, study.voxels == TABLE - 1)
        [warning] = [told for told in found.report["warnings"] if "most of the window" in told]
        assert "--keep body" in warning


def test_a_real_table_is_left_out_and_the_arms_stay() -> None:
    volume = read_volume(shared("totalsegmentator/example_ct_dicom"))
    found = segment(volume, preset="skin", network="none")
    assert found.report["window"]["components"] == 4
    assert found.report["window"]["dropped_components"] == 2
    columns = np.flatnonzero(found.mask.any(axis=(0, 1)))
    assert columns.max() > 500  # an arm that lies apart
    assert np.flatnonzero(found.mask.any(axis=(0, 2))).max() < 425  # the table lies behind


@law(150)
@given(
    arrays(np.bool_, st.tuples(*[st.integers(1, 9)] * 3), elements=st.booleans()), st.integers(0, 2), st.integers(0, 2),
    st.tuples(*[st.sampled_from([0.7, 1.0, 2.5, 6.0])] * 3), st.integers(0, 3),
)  # fmt: skip
def test_opening_looks_at_nothing_that_matters_not(
    core: NDArray[np.bool_], before: int, after: int, spacing: tuple[float, float, float], thicker: int
) -> None:
    """Beside its twin that looks at all: a mask in the middle, along a border, or on all of it."""
    mask = np.pad(np.repeat(core, 1 + thicker, axis=2), [(before, after), (after, 0), (0, before)])
    found = body._opened(mask, np.array(spacing))
    if mask.all():
        assert found.all()
        return
    depth = distance_transform_edt(mask, spacing)
    radius = body._radius(depth)
    assert np.array_equal(found, mask & (distance_transform_edt(depth <= radius, spacing) <= radius))
