"""Pages: nothing is covered, no half is empty, panels are of one scale, labels are no gray levels."""

from __future__ import annotations

import io
import logging
import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tomomesh import Volume, reconstruct
from tomomesh.cli import main
from tomomesh.cli.outputs.pictures import pictures
from tomomesh.model.lattice import lattice
from tomomesh.model.points import PointSet
from tomomesh.settings import Settings
from tomomesh.show import save
from tomomesh.show.contact import scale_bar
from tomomesh.show.drawing.page import canvas
from tomomesh.show.drawing.style import INK, NETWORK, SIGNAL, rgb
from tomomesh.show.maps import draw_maps
from tomomesh.show.plane import PIXELS
from tomomesh.show.space import MOST_LINED, draw_points, draw_surfaces
from tomomesh.show.topologies import draw_adapted

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.show.drawing.page import Page


def drawn(page: Page) -> NDArray[np.uint8]:
    file = io.BytesIO()
    save(page, file)
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGB"))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_long_cloud_leaves_no_half_of_its_page_empty(axis: int) -> None:
    """Rows and columns with ink reach over most of the page, whichever way the cloud is long."""
    places = np.random.default_rng(0).uniform(-1, 1, (2000, 3))
    places[:, axis] *= 20
    ink = np.asarray((drawn(draw_points(PointSet.from_positions(places))) < 250).any(axis=2))
    for side in (0, 1):
        inked = np.flatnonzero(ink.any(axis=side))
        assert np.diff(inked).max() < 0.3 * ink.shape[1 - side]


def test_the_scale_bar_lies_outside_of_the_slice() -> None:
    page, (ax,) = canvas(2.0, 2.4)
    bounds = np.array([[0.0, 0.0], [50.0, 50.0]])
    PIXELS.crop(ax, bounds)
    scale_bar(ax, bounds, PIXELS)
    rows, columns = np.nonzero((page.pixels == rgb(INK)).all(axis=2))
    assert rows.max() < ax.box[1]
    left, right = ax.place(np.array([[0, 0], [10, 0]]))[:, 0]
    assert np.ptp(columns) + 1 == pytest.approx(right - left, abs=1)
    assert "10 mm" in [word.text for word in page.words]


def test_many_squares_are_drawn_without_lines() -> None:
    """Mean brightness of a fine surface is that of a coarse one: lines do not turn it to mud."""

    def surface(count: int) -> NDArray[np.uint8]:
        side = np.linspace(-1, 1, count)
        x, z = (each.ravel() for each in np.meshgrid(side, side))
        node = np.arange(count * count).reshape(count, count)
        corners = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:]], axis=-1).reshape(-1, 3)
        from tomomesh.model.mesh import TriMesh

        mesh = TriMesh(np.column_stack([x, np.zeros_like(x), z]), corners)
        seen = drawn(draw_surfaces(None, mesh, None))
        middle = tuple(slice(int(0.4 * n), int(0.5 * n)) for n in seen.shape[:2])
        return seen[middle]

    assert MOST_LINED < 2 * 200**2
    assert surface(260).mean() > surface(130).mean()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_panels_of_a_network_share_their_limits(dimensions: int) -> None:
    region = np.random.default_rng(0).random((200, dimensions))
    graph = lattice("grid", 12)
    page = draw_adapted(region, region[:12], graph, start=3 * region[12:24])
    one, other = page.panels
    np.testing.assert_array_equal(one.limits, other.limits)
    shown = {tuple(color) for color in other.pixels.reshape(-1, 3)}
    between = tuple(((rgb(SIGNAL) + rgb(NETWORK)) / 2).round())
    near = [color for color in shown if np.abs(np.array(color) - between).max() < 12]
    assert bool(near) == (dimensions == 3)


def test_the_scale_of_a_u_matrix_begins_at_its_least_distance() -> None:
    graph = lattice("grid", 16)
    page = draw_maps(10 + graph.places + 0.1 * np.random.default_rng(0).random((16, 2)), graph, np.arange(16))
    first, second = page.panels
    below = [word for word in page.words if word.y > first.box[3] and word.text[0].isdigit()]
    distances, hits = ([float(w.text) for w in below if (w.x > second.box[0]) == of_hits] for of_hits in (False, True))
    assert min(distances) > 0
    assert min(hits) == 0
    heights = [ax.box[3] - ax.box[1] for ax in (first, second)]
    assert heights[0] == pytest.approx(heights[1], rel=0.05)


def test_labels_by_themselves_are_drawn_as_chosen_others_and_background() -> None:
    labels = np.zeros((8, 12, 12), np.uint8)
    labels[2:6, 2:8, 2:8], labels[2:6, 9:11, 2:8] = 7, 200
    found = reconstruct(Volume.from_stored(labels, np.eye(4)), select=(7,))
    stage_one = found.segmentation
    assert stage_one is not None
    window = dict(pictures(stage_one, None, Settings().replace(select=(7,))))["04-window"]
    assert {*np.unique(window.panels[0].pixels)} == {0, 127, 128, 255} - {
        127 if 128 in window.panels[0].pixels else 128
    }


def test_a_window_that_goes_on_is_told_of() -> None:
    levels = np.zeros((10, 16, 16), np.float32)
    levels[:, 4:12, 4:12] = 100
    notes = reconstruct(Volume.from_stored(levels, np.eye(4)), lower=50.0).report["study"]["notes"]
    assert any("cut off at the first and the last slice" in note for note in notes)
    levels[[0, -1]] = 0
    notes = reconstruct(Volume.from_stored(levels, np.eye(4)), lower=50.0).report["study"]["notes"]
    assert not any("cut off" in note for note in notes)


def test_smoothing_longer_than_the_object_says_that_it_changes_nothing() -> None:
    levels = np.zeros((10, 16, 16), np.float32)
    levels[2:8, 4:12, 4:12] = 100
    volume = Volume.from_stored(levels, np.eye(4))
    told, plain = (reconstruct(volume, lower=50.0, smooth=length) for length in (500.0, 0.0))
    assert sum("changes nothing" in warning for warning in told.report["warnings"]) == 1
    np.testing.assert_array_equal(told.mesh.vertices, plain.mesh.vertices)


def test_silent_stretches_are_told_of_and_the_time_is_the_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    levels = np.zeros((10, 16, 16), np.uint8)
    levels[2:8, 4:12, 4:12] = 100
    np.save(tmp_path / "v.npy", levels)
    line = [
        "reconstruct",
        str(tmp_path / "v.npy"),
        "--spacing",
        "1",
        "1",
        "1",
        "-o",
        str(tmp_path / "m.stl"),
        "--way",
        "voxels",
    ]
    before = [signal.getsignal(signal.SIGTERM), list(logging.getLogger().handlers)]
    assert main(line) == 0
    assert [signal.getsignal(signal.SIGTERM), list(logging.getLogger().handlers)] == before
    said = capsys.readouterr()
    stages = [row.split()[0] for row in said.err.splitlines()]
    assert {"read", "window", "voxels", "fit", "checks", "remesh", "judgement", "measure"} <= set(stages)
    assert "computed in" in said.out
    assert "reading and writing included" in said.out
