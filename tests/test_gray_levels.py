"""Windows of one study, one after the other: what they have in common is found once, and changes none of them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from cuttings import OBLIQUE, assert_alike, assert_equal, cuttings, grays, kept, kept_or_not, or_why
from tomomesh import Settings, Volume
from tomomesh.segmentation import body
from tomomesh.segmentation.gray_levels import GrayLevels
from tomomesh.segmentation.study import lay_out, select_in
from tomomesh.segmentation.window import PRESETS_HU

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.segmentation.slabwise.cut import Cutting

WINDOWS = st.fixed_dictionaries(
    {},
    optional={
        "lower": st.sampled_from([-5.0, 0.2, 30.0, 200.0]),
        "upper": st.sampled_from([220.0, 900.0]),
        "keep": st.sampled_from(["auto", "all", "largest", "body"]),
    },
)


def body_on_a_table() -> NDArray[Any]:
    """Draw a patient with bones on a scanner's table, in Hounsfield units, and padding outside of a circle."""
    k, j, i = np.ogrid[:20, :60, :60]
    levels = np.asarray(np.where((j - 26) ** 2 + (i - 30) ** 2 < 18**2, 40, -1000) + 0 * k, np.int16)
    levels[:, 20:24, 20:24], levels[:, 52:54, 27:33] = 900, 400
    levels[np.broadcast_to((j - 30) ** 2 + (i - 30) ** 2 > 30**2, levels.shape)] = -2000
    return levels


CT = replace(Volume.from_stored(body_on_a_table(), np.diag([3.0, 3, 3, 1]), unit="HU"), padding=(-2000, -2000))


@law(60)
@given(grays(), st.lists(WINDOWS, min_size=2, max_size=4), cuttings(), st.sampled_from([None, (-9.0, -9.0)]))
def test_a_window_is_the_same_whatever_was_chosen_before(
    levels: NDArray[Any], asked: list[dict[str, Any]], cutting: Cutting, padding: tuple[float, float] | None
) -> None:
    volume = replace(Volume.from_stored(levels, OBLIQUE, unit="HU"), padding=padding)
    study = lay_out(volume, None, Settings(), labelled=False, cutting=cutting)
    for one in asked:
        assert_alike(or_why(partial(select_in, study, Settings().replace(**one))), kept_or_not(volume, one, cutting))


class TestOfACt:
    PRESETS = ("bone", "skin", "soft-tissue", "lung")

    def test_every_preset_is_the_same_as_alone(self) -> None:
        study = lay_out(CT, None, Settings(), labelled=False)
        for preset in (*self.PRESETS, *self.PRESETS[::-1]):
            found = select_in(study, Settings().replace(preset=preset))
            assert_equal(found, kept(CT, {"preset": preset}, study.cutting))

    def test_the_body_is_looked_for_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        opened, asked = [], body._opened

        def counted(*given: Any) -> Any:
            opened.append(1)
            return asked(*given)

        monkeypatch.setattr(body, "_opened", counted)
        study = lay_out(CT, None, Settings(), labelled=False)
        for lower in (-100.0, 100.0, PRESETS_HU["bone"][0]):
            found = select_in(study, Settings().replace(lower=lower))
            assert found.stats["window"]["dropped_components"] == 1
        assert len(opened) == 1

    def test_padding_is_replaced_once_however_it_was_found(self) -> None:
        levels = GrayLevels(CT)
        assert levels.shown(guessed=False) is levels.shown(guessed=False)
        assert int((CT.voxels == -2000).sum()) == levels.shown(guessed=False).padded
        assert levels.shown(guessed=False).volume.voxels.min() == -1000

    def test_what_no_longer_matters_is_given_up(self) -> None:
        """Between its steps a choice asks whether anybody waits for it."""
        steps: list[tuple[str, int, int]] = []

        def progress(*step: Any) -> None:
            steps.append(step)
            if step[1] == 2:
                raise InterruptedError

        with pytest.raises(InterruptedError):
            select_in(lay_out(CT, None, Settings(), labelled=False), Settings(), progress)
        assert steps == [("window", 1, 4), ("window", 2, 4)]
