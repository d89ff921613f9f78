"""Networks in a real browser: a class sees every epoch, however quick the training is."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from looked_at import looking_at
from pages import served
from studies import write_nifti
from tomomesh import phantom

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

HEAD = phantom((10, 48, 48), (5.0, 5.0, 14.0))
SEEN = """() => {
    window.seen = [];
    const player = document.getElementById("net-player");
    const look = () => { if (player.dataset.shown !== window.seen.at(-1)) window.seen.push(player.dataset.shown); };
    new MutationObserver(look).observe(player, { attributes: true });
}"""
"""Notes which frames the page has drawn."""
NEXT_FRAMES = """() => new Promise((done) => {
    let left = 60;
    const tick = () => { if (left--) requestAnimationFrame(tick); else done(); };
    tick();
})"""
"""Waits for 60 frames: at 10 a second, a training that plays has shown several of its own."""
SAID = 60_000
"""Milliseconds within which the page says what it shall, on whatever machine."""
TITLES = {
    "1a": "A single input: chain", "1b": "A single input: ring", "2": "A triangle: ring of 50",
    "5": "head: ring of 24", "6": "head: ring of 80", "Grid": "A square: grid", "Sphere": "A cube: sphere",
}  # fmt: skip
"""What each figure trains."""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "head.nii"
    write_nifti(path, np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    return path


@pytest.fixture
def of_study(study: Path) -> Iterator[Any]:
    with served(study, "--lower", str(HEAD.lower), "--way", "ring", "--trim", "0") as page, looking_at(page) as seen:
        seen.click("#tab-networks")
        seen.wait_for_selector("#net-train:enabled")
        yield seen


def expect(found: Any) -> Any:
    """Ask again and again; `wait_for_function` would do so by what our page forbids, eval."""
    from playwright.sync_api import expect

    expect.set_options(timeout=SAID)
    return expect(found)


def until(seen: Any, words: str | re.Pattern[str]) -> None:
    """Wait until the page says which frame it shows."""
    expect(seen.locator("#net-step")).to_have_text(words)


def test_30_of_30_epochs_are_shown(of_study: Any) -> None:
    seen = of_study
    seen.fill("#option-epochs", "30")
    seen.press("#option-epochs", "Enter")
    expect(seen.locator("#command")).to_contain_text("--epochs 30")
    seen.select_option("#net-speed", "30")
    seen.evaluate(SEEN)
    seen.click("#net-train")
    until(seen, "As the run hands it on")
    shown = [one for one in seen.evaluate("window.seen") if one]
    assert [int(one) for one in shown] == list(range(32))  # the start, 30 epochs, the ring spaced evenly
    assert seen.locator(".curve").count() == 3
    seen.keyboard.press("ArrowLeft")
    until(seen, "Epoch 30 of 30")


def test_a_training_is_stepped_played_and_paused_by_keys(of_study: Any) -> None:
    seen = of_study
    seen.select_option("#net-speed", "1")
    seen.click("#net-train")
    until(seen, "Start")
    seen.keyboard.press("Space")
    expect(seen.locator("#net-toggle")).to_have_text("Play")
    seen.keyboard.press("Home")
    for key, epoch in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1)):
        seen.keyboard.press(key)
        until(seen, f"Epoch {epoch} of 10")
    seen.keyboard.press("End")
    until(seen, "As the run hands it on")
    seen.keyboard.press("Space")  # once more from the start
    until(seen, "Start")


def test_all_slices_are_trained_and_shown_one_by_one(of_study: Any) -> None:
    seen = of_study
    seen.click("#net-all")
    expect(seen.locator("#net-caption")).to_contain_text("The network of slice 4")
    seen.focus("#net-canvas")
    seen.keyboard.press("ArrowUp")
    expect(seen.locator("#net-caption")).to_contain_text("The network of slice 5")
    seen.select_option("#option-training", "online")
    expect(seen.locator("#net-caption")).to_contain_text("changed since")


def test_a_training_is_seen_again_where_the_page_is_opened_anew(of_study: Any) -> None:
    seen = of_study
    seen.click("#net-train")
    until(seen, "As the run hands it on")
    seen.reload()
    seen.click("#tab-networks")
    until(seen, "As the run hands it on")


def test_a_class_plays_the_figures_without_a_study() -> None:
    with served() as page, looking_at(page, scheme="dark") as seen:
        seen.wait_for_selector("#net-train:enabled")
        expect(seen.locator("#net-caption")).to_contain_text("Choose a figure")
        for name, title in TITLES.items():
            seen.locator(".net-figures button", has_text=name).first.click()
            expect(seen.locator("#net-title")).to_contain_text(title)
            seen.wait_for_selector("#net-train:enabled")
            seen.focus("#net-canvas")
            seen.keyboard.press("End")
            until(seen, re.compile("^Presentation (8 of 8|10,000 of 10,000)$"))
        seen.locator(".net-figures button", has_text="3").first.click()
        expect(seen.locator("#net-relief")).to_be_visible()
        expect(seen.locator("#net-relief")).not_to_have_js_property("naturalHeight", 0)
        seen.locator(".net-figures button", has_text="4").first.click()
        seen.wait_for_selector("#net-canvas:visible")
        assert "LT < k <= HT" in seen.inner_text("#net-caption")


def test_a_still_figure_is_not_taken_over_by_a_training_that_plays() -> None:
    with served() as page, looking_at(page) as seen:
        seen.wait_for_selector("#net-train:enabled")
        seen.locator(".net-figures button", has_text="2").first.click()
        until(seen, re.compile("^Presentation [1-9]"))
        seen.locator(".net-figures button", has_text="4").first.click()
        expect(seen.locator("#net-caption")).to_contain_text("LT < k <= HT")
        expect(seen.locator(".net-curves")).to_be_hidden()
        seen.evaluate(NEXT_FRAMES)
        assert "LT < k <= HT" in seen.inner_text("#net-caption")


def test_what_was_refused_is_forgotten_once_it_is_put_right() -> None:
    with served() as page, looking_at(page, refused=True) as seen:
        seen.wait_for_selector("#net-train:enabled")
        seen.wait_for_load_state("networkidle")
        neurons = seen.locator("#option-neurons")
        neurons.fill("1")
        neurons.press("Tab")
        expect(seen.locator(".toast.fault")).to_contain_text("at least 3")
        seen.locator("#option-neurons").fill("30")
        seen.locator("#option-neurons").press("Tab")
        expect(seen.locator(".toast.fault")).to_have_count(0)


def test_what_is_being_typed_stays() -> None:
    """Whatever the program tells meanwhile, as that a training has ended."""
    with served() as page, looking_at(page) as seen:
        seen.wait_for_selector("#net-train:enabled")
        there = False
        while not there:  # until the form has been filled for the last time
            seen.evaluate("() => { window.kept = document.getElementById('option-neurons'); }")
            seen.evaluate(NEXT_FRAMES)
            there = seen.evaluate("() => window.kept.isConnected")
        seen.locator("#option-neurons").press_sequentially("4")
        seen.evaluate("() => fetch('/api/choose', { method: 'POST', body: '{}' }).then((answer) => answer.json())")
        seen.evaluate(NEXT_FRAMES)
        assert seen.evaluate("() => [window.kept.isConnected, window.kept.value]") == [True, "4"]


def test_half_of_a_pair_wants_the_other() -> None:
    with served() as page, looking_at(page) as seen:
        seen.wait_for_selector("#net-train:enabled")
        seen.wait_for_load_state("networkidle")
        last = seen.locator("#option-radius-last")
        seen.locator("#option-radius").fill("4")
        seen.locator("#option-radius").press("Tab")
        expect(last).to_have_attribute("placeholder", "needed")
        last.fill("1")
        last.press("Tab")
        expect(seen.locator(".net-option.chosen")).to_contain_text("Radius")
        told = seen.evaluate("async () => (await (await fetch('/api/state')).json()).choices")
        assert told == {"radius": [4, 1]}


def test_no_epoch_is_lost_where_the_page_cannot_follow() -> None:
    with served("--epochs", "3000", "--neurons", "9", "--trim", "0") as page, looking_at(page) as seen:
        seen.select_option("#net-source", "triangle")
        seen.click("#net-train")
        seen.wait_for_selector("text=Save GIF")
        expect(seen.locator("#net-frames")).to_have_attribute("max", re.compile("^300[01]$"))
        seen.focus("#net-canvas")
        seen.keyboard.press("End")
        seen.keyboard.press("ArrowLeft")
        until(seen, "Epoch 3000 of 3000")


def test_a_sheet_has_maps_and_undo_takes_a_figure_back() -> None:
    with served() as page, looking_at(page) as seen:
        seen.locator(".net-figures button", has_text="Grid").first.click()
        seen.wait_for_selector("#net-train:enabled")
        seen.focus("#net-canvas")
        seen.keyboard.press("End")
        seen.wait_for_selector(".net-map")
        assert seen.locator(".net-map").count() == 2
        assert seen.locator("#option-neurons").input_value() == "64"
        seen.click("#undo")
        expect(seen.locator("#option-neurons")).to_have_value("")
        seen.click("#net-paper")
        expect(seen.locator("#option-training")).to_have_value("online")


def test_what_is_refused_is_said_and_taken_back() -> None:
    with served() as page, looking_at(page, refused=True) as seen:
        seen.fill("#option-neurons", "1")
        seen.press("#option-neurons", "Enter")
        seen.wait_for_selector(".toast.fault")
        assert "--neurons is outside its limits" in seen.inner_text(".toast.fault")
        expect(seen.locator("#option-neurons")).to_have_value("")


def test_a_long_training_is_stopped_from_the_page() -> None:
    long = ("--training", "online", "--iterations", "30000000", "--neurons", "60")  # looked at 60 times, all in all
    with served(*long) as page, looking_at(page) as seen:
        seen.select_option("#net-source", "square")
        seen.click("#net-train")
        seen.wait_for_selector("#work-stop:visible")
        assert seen.is_disabled("#net-train")
        until(seen, re.compile("^Presentation "))
        seen.click("#work-stop")
        seen.wait_for_selector("text=Save GIF")  # all is received
        assert seen.is_enabled("#net-train")
        seen.focus("#net-canvas")
        seen.keyboard.press("End")
        until(seen, re.compile(r"^Presentation [\d,]+ of 30,000,000, stopped$"))


def test_the_film_and_the_settings_are_saved(tmp_path: Path) -> None:
    with served() as page, looking_at(page) as seen:
        seen.locator(".net-figures button", has_text="1a").first.click()
        seen.wait_for_selector("text=Save GIF")
        for words, start in (("Save GIF", b"GIF89a"), ("Save settings.toml", b"[read]")):
            with seen.expect_download() as saved:
                seen.click(f"text={words}")
            saved.value.save_as(tmp_path / "saved")
            assert (tmp_path / "saved").read_bytes().startswith(start)


def test_nothing_lies_over_another_part_in_a_narrow_window() -> None:
    with served() as page, looking_at(page) as seen:
        seen.select_option("#net-source", "square")
        seen.click("#net-train")
        seen.wait_for_selector("text=Save GIF")
        for width, height in ((1280, 720), (1000, 700), (900, 600)):
            seen.set_viewport_size({"width": width, "height": height})
            parts = [seen.locator(part).bounding_box() for part in (".net-side", ".net-stage", ".net-beside")]
            ends = [(part["x"], part["x"] + part["width"]) for part in parts]
            assert all(one[1] <= other[0] for one, other in pairwise(ends))
            for one in seen.locator(".net-player > *").all():
                box = one.bounding_box()
                assert ends[1][0] <= box["x"]
                assert box["x"] + box["width"] <= ends[1][1] + 0.5
