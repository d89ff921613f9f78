"""Pictures of networks: films, maps and contact sheets, for every topology."""

from __future__ import annotations

import io
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

from tomomesh.cli import main
from tomomesh.errors import UsageError
from tomomesh.model.contours import HOLE, OUTER, Contour, Contours
from tomomesh.model.graph import lattice_of
from tomomesh.model.lattice import TOPOLOGIES, Lattice, lattice
from tomomesh.model.networks import Networks
from tomomesh.settings import NetworkSettings
from tomomesh.show import save
from tomomesh.show.contact import COLUMNS, ROWS, draw_slices
from tomomesh.show.film import END_MS, MOST_FRAMES, START_MS, film, film_slice
from tomomesh.show.maps import SHEETS, draw_maps, laid_flat, u_matrix
from tomomesh.show.plane import Plane
from tomomesh.show.topologies import draw_adapted
from tomomesh.som.region import train_region
from tomomesh.som.shapes import shape
from tomomesh.som.snapshots import snapshots, thinned

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.show.drawing.page import Page

EVERY = (*TOPOLOGIES, "graph")


def network_of(name: str, neurons: int = 20) -> Lattice:
    """Return a network; as a graph, a tree."""
    if name != "graph":
        return lattice(name, neurons)
    node = np.arange(1, neurons)
    return lattice_of(np.stack([node, (node - 1) // 2], axis=1), neurons)


def png(page: Page) -> bytes:
    file = io.BytesIO()
    save(page, file)
    return file.getvalue()


def frames_of(gif: bytes) -> list[NDArray[np.uint8]]:
    with Image.open(io.BytesIO(gif)) as picture:
        assert picture.format == "GIF"
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(picture)]


def is_drawn(page: Page) -> bool:
    """Whether ink is on paper, and none of it is cut off at the rim."""
    with Image.open(io.BytesIO(png(page))) as picture:
        seen = np.asarray(picture.convert("RGB"))
    rim = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
    return bool((rim == 255).all() and (seen < 200).any(axis=2).mean() > 0.002)


@pytest.fixture(scope="module")
def mask() -> NDArray[np.bool_]:
    """Five slices of a ring of pixels, the first without any."""
    j, i = np.mgrid[:40, :48]
    found = np.stack([np.abs(np.hypot(i - 24, j - 20) - radius) < 1.5 for radius in (9, 10, 11, 12, 13)])
    found[0] = False
    return found


def networks_on(mask: NDArray[np.bool_], graph: Lattice) -> Networks:
    """Lay one network on each slice but the first two, one of its edges a gap."""
    slices = np.arange(2, len(mask), dtype=np.int32)
    places = np.resize(graph.places[:, :2], (len(graph), 2)) if graph.places.shape[1] < 2 else graph.places[:, :2]
    books = np.stack([24 + (2 + k) * places for k in range(len(slices))])
    gaps = np.zeros((len(slices), len(graph.edges)), bool)
    gaps[0, 0] = True
    count = np.full(len(slices), 60)
    return Networks(graph, slices, books, gaps, False, count, 0 * count)


def words_of(page: Page) -> list[str]:
    return [word.text for word in page.words]


class TestSnapshots:
    @pytest.mark.parametrize("training", ["online", "batch"])
    @pytest.mark.parametrize("start", ["random", "ellipse"])
    def test_end_where_the_training_ends(self, training: str, start: str) -> None:
        inputs, area = shape("triangle")
        settings = NetworkSettings(neurons=30, training=training, start=start, even=False, iterations=2000)
        trained = train_region(inputs, settings, seed=3, pixel_area=area)
        seen = snapshots(inputs, trained.lattice, settings, seed=3, pixel_area=area, most=12)
        np.testing.assert_allclose(seen.codebooks[-1], trained.codebook, atol=1e-9)
        np.testing.assert_allclose(seen.codebooks[0], trained.start, atol=1e-12)
        assert len(seen) == len(seen.codebooks) == 12
        assert seen.steps[0] == 0
        assert (np.diff(seen.steps) > 0).all()
        assert seen.steps[-1] == (2000 if training == "online" else len(trained.history))

    def test_of_a_rate_that_does_not_fall(self) -> None:
        inputs, _ = shape("square")
        settings = NetworkSettings(neurons=9, training="online", alpha=(0.1, 0.1), iterations=5)
        assert len(snapshots(inputs, lattice("ring", 9), settings, most=50)) == 6

    @pytest.mark.parametrize(("count", "most"), [(1, 5), (5, 5), (100, 7), (3, 1)])
    def test_thinned_keeps_the_last(self, count: int, most: int) -> None:
        chosen = thinned(count, most)
        assert chosen[-1] == count - 1
        assert len(chosen) == min(count, most)


class TestFilm:
    @pytest.mark.parametrize("name", EVERY)
    @pytest.mark.parametrize("region", ["square", "cube"])
    def test_of_every_topology(self, name: str, region: str) -> None:
        inputs, area = shape(region)
        graph = network_of(name)
        settings = NetworkSettings(training="online", start="random", iterations=400)
        seen = snapshots(inputs, graph, settings, pixel_area=area, most=5)
        gif = film(inputs, seen.codebooks, graph)
        frames = frames_of(gif)
        assert len(frames) == 5
        assert all((one != other).any() for one, other in pairwise(frames))
        assert gif == film(inputs, seen.codebooks, graph)

    def test_over_a_slice(self, mask: NDArray[np.bool_]) -> None:
        graph = lattice("ring", 20)
        turned = [24 + reach * graph.places for reach in (2.0, 5.0, 8.0)]
        notes = ["first", "second", "third"]
        gif = film_slice(mask[4], turned, graph, Plane((0.5, 0.8)), notes=notes)
        frames = frames_of(gif)
        assert len(frames) == 3
        assert gif == film_slice(mask[4], turned, graph, Plane((0.5, 0.8)), notes=notes)
        assert gif != film_slice(mask[4], turned, graph, Plane((0.5, 0.8)))

    def test_holds_its_ends_and_goes_on_for_ever(self) -> None:
        graph = lattice("chain", 5)
        codebooks = np.random.default_rng(0).random((4, 5, 2))
        with Image.open(io.BytesIO(film(codebooks[0], codebooks, graph))) as picture:
            shown = [frame.info["duration"] for frame in ImageSequence.Iterator(picture)]
            assert picture.info["loop"] == 0
        assert (shown[0], shown[-1]) == (START_MS, END_MS)
        assert len(set(shown[1:-1])) == 1

    def test_of_one_codebook_is_one_frame(self) -> None:
        assert len(frames_of(film(np.eye(2), np.eye(2)[None], lattice_of([[0, 1]], 2)))) == 1

    def test_has_a_limit(self) -> None:
        graph = lattice("chain", 3)
        codebooks = np.random.default_rng(0).random((MOST_FRAMES + 30, 3, 2))
        assert len(frames_of(film(codebooks[0], codebooks, graph))) == MOST_FRAMES

    def test_what_stands_still_does_not_change(self, mask: NDArray[np.bool_]) -> None:
        graph = lattice("ring", 12)
        frames = frames_of(film_slice(mask[4], [24 + reach * graph.places for reach in (1.0, 2.0)], graph))
        changed = np.flatnonzero((frames[0] != frames[1]).any(axis=2).any(axis=1))
        below = slice(int(0.8 * len(frames[0])), None)
        np.testing.assert_array_equal(frames[0][below], frames[1][below])
        assert len(changed)


class TestMaps:
    @pytest.mark.parametrize("name", SHEETS)
    def test_of_every_sheet(self, name: str) -> None:
        inputs, _ = shape("square")
        graph = network_of(name, 24)
        codebook = np.random.default_rng(0).random((len(graph), 2))
        labels = np.random.default_rng(1).integers(0, len(graph), len(inputs))
        page = draw_maps(codebook, graph, labels, unit="mm")
        assert is_drawn(page)
        assert png(page) == png(draw_maps(codebook, graph, labels, unit="mm"))
        held = page.panels[1].box
        inside = [w.text for w in page.words if held[0] < w.x < held[2] and held[1] < w.y < held[3]]
        assert sum(map(int, inside)) == len(inputs)

    @pytest.mark.parametrize("name", sorted({*EVERY} - {*SHEETS}))
    def test_are_refused_in_one_line(self, name: str) -> None:
        graph = network_of(name)
        with pytest.raises(UsageError, match=f"no U-matrix.*{name}.*hexagonal") as fault:
            draw_maps(np.zeros((len(graph), 2)), graph, np.zeros(1, np.int64))
        assert "\n" not in str(fault.value)

    def test_counts_dead_neurons(self) -> None:
        graph = lattice("grid", 4)
        words = words_of(draw_maps(np.eye(4), graph, np.array([0, 0, 2, 3])))
        assert "4 inputs, 1 dead neuron" in words

    @pytest.mark.parametrize("name", SHEETS)
    def test_of_a_sheet_at_rest_is_even(self, name: str) -> None:
        """Neurons one apart, across the cuts too: every cell tells 1."""
        graph = network_of(name, 24)
        around = {"cylinder": (False, True), "torus": (True, True)}.get(name, (False, False))
        row_column = laid_flat(graph)[:, ::-1]
        axes = []
        for axis, count, closed in zip(row_column.T, graph.shape, around, strict=True):
            turn, radius = 2 * np.pi * axis / count, 0.5 / np.sin(np.pi / count)
            axes += [radius * np.cos(turn), radius * np.sin(turn)] if closed else [axis]
        _, far = u_matrix(np.stack(axes, axis=1), graph)
        np.testing.assert_allclose(far, 1)

    @pytest.mark.parametrize("name", SHEETS)
    def test_cells_fill_the_plane_once(self, name: str) -> None:
        graph = network_of(name, 24)
        rows, columns = graph.shape
        centers, far = u_matrix(np.zeros((len(graph), 2)), graph)
        assert len(np.unique(np.round(centers, 6), axis=0)) == len(centers) == len(far)
        if name == "hexagonal":
            assert len(centers) == len(graph) + len(graph.edges)
        else:
            cut = {"cylinder": (1, 0), "torus": (0, 0)}.get(name, (1, 1))
            assert len(centers) == (2 * rows - cut[0]) * (2 * columns - cut[1])

    def test_a_border_is_dark(self) -> None:
        """Two groups of columns, far from each other: the cells between them are the farthest."""
        graph = lattice("grid", 16)
        codebook = laid_flat(graph) + np.where(laid_flat(graph)[:, :1] > 1.5, 10.0, 0.0)
        centers, far = u_matrix(codebook, graph)
        assert (centers[far > 5, 0] == 1.5).sum() == 7
        assert np.argmax(far) in np.flatnonzero(centers[:, 0] == 1.5)


class TestSlices:
    @pytest.mark.parametrize("name", EVERY)
    def test_of_every_topology(self, name: str, mask: NDArray[np.bool_]) -> None:
        found = networks_on(mask, network_of(name))
        (page,) = draw_slices(mask, found, Plane((0.5, 0.5)))
        assert is_drawn(page)
        assert png(page) == png(next(draw_slices(mask, found, Plane((0.5, 0.5)))))
        words = words_of(page)
        assert [text for text in words if text in "12345"] == ["2", "3", "4", "5"]
        assert words.count("no network") == 1
        assert words.count("1 gap") == 1

    def test_measures_a_circle(self, mask: NDArray[np.bool_]) -> None:
        graph = lattice("ring", 40)
        found = networks_on(mask, graph)
        words = words_of(next(draw_slices(mask, found, Plane((0.5, 0.5)))))
        radius = 0.5 * 2 * np.sqrt(2)
        assert f"{2 * np.pi * radius:,.0f} mm  {np.pi * radius**2:,.0f} mm²  1.0x" in words

    @pytest.mark.parametrize("rings", [1, 3, 5])
    def test_of_several_contours(self, rings: int, mask: NDArray[np.bool_]) -> None:
        places = lattice("ring", 20).places
        still = np.zeros(20, bool)
        every = [
            Contour(k, ring, HOLE if ring % 2 else OUTER, ring, 24 + (ring + 2) * places, still, False, 60, 0)
            for k in (1, 2, 3, 4)
            for ring in range(rings)
        ]
        (page,) = draw_slices(mask, Contours("loops", tuple(every)))
        told = [text for text in words_of(page) if text.endswith("x")]
        assert len(told) == 4 * min(rings, 3)
        assert words_of(page).count("and 2 more") == (4 if rings == 5 else 0)
        assert is_drawn(page)

    def test_turns_the_page(self) -> None:
        many = np.ones((COLUMNS * ROWS + 3, 6, 6), bool)
        pages = list(draw_slices(many, networks_on(many, lattice("ring", 5))))
        numbers = [text for page in pages for text in words_of(page) if text.isdigit()]
        assert len(pages) == 2
        assert numbers == [str(k) for k in range(1, len(many) + 1)]
        assert all(map(is_drawn, pages))

    def test_of_an_empty_window_is_nothing(self) -> None:
        empty = np.zeros((3, 4, 4), bool)
        assert list(draw_slices(empty, networks_on(empty, lattice("ring", 5)))) == []


class TestRegions:
    @pytest.mark.parametrize("name", EVERY)
    @pytest.mark.parametrize("region", ["triangle", "cube"])
    def test_of_every_topology(self, name: str, region: str) -> None:
        inputs, _ = shape(region)
        graph = network_of(name)
        codebook = inputs[:: len(inputs) // len(graph)][: len(graph)]
        assert png(draw_adapted(inputs, codebook, graph)) == png(draw_adapted(inputs, codebook, graph))


class TestCommand:
    @pytest.mark.parametrize(("network", "maps"), [("ring", False), ("hexagonal", True), ("sphere", False)])
    def test_writes_the_film_and_the_maps(self, network: str, maps: bool, tmp_path: Path) -> None:
        line = ["network", "triangle", "--network", network, "--neurons", "20", "--film", "--quiet"]
        assert main([*line, "-o", str(tmp_path / "n")]) == 0
        names = {path.name for path in (tmp_path / "n").iterdir()}
        drawn = {"01-topologies.png", "02-network.png", "02-learning.png", "02-film.gif"}
        assert names == drawn | ({"02-maps.png"} if maps else set())
        assert main([*line, "-o", str(tmp_path / "again")]) == 0
        for name in names:
            assert (tmp_path / "n" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()

    def test_a_film_that_fails_leaves_nothing(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def broken(*_: Any, **__: Any) -> bytes:
            raise MemoryError

        monkeypatch.setattr("tomomesh.cli.outputs.pictures.film", broken)
        assert main(["network", "square", "--neurons", "9", "--film", "--quiet", "-o", str(tmp_path / "n")]) != 0
        assert {path.suffix for path in (tmp_path / "n").iterdir()} == {".png"}
