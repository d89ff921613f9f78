"""Pictures: what lands where on the canvas, and bytes that repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tomomesh.model.lattice import lattice
from tomomesh.model.mesh import QuadMesh, TriMesh
from tomomesh.model.networks import Networks
from tomomesh.model.points import PointSet
from tomomesh.model.trace import Trace
from tomomesh.show import draw_all
from tomomesh.show.drawing.axes import decades, ticks
from tomomesh.show.drawing.style import NETWORK, rgb
from tomomesh.show.fit import draw_fit
from tomomesh.show.gallery import median_slice
from tomomesh.show.plane import PIXELS, Plane, gray
from tomomesh.show.relief import draw_relief
from tomomesh.show.slices import draw_contour, draw_regions, draw_window
from tomomesh.show.topologies import draw_adapted, draw_update_regions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.show.drawing.page import Page


def round_mesh() -> TriMesh:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=20.0)
    return TriMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64))


def box() -> QuadMesh:
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return QuadMesh(corners, np.array(quads))


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


@pytest.fixture(scope="module")
def cube() -> QuadMesh:
    return box()


@pytest.fixture(scope="module")
def study() -> dict[str, NDArray[np.generic]]:
    """Three slices of a bright ring, thicker from slice to slice, open in front in the middle one."""
    j, i = np.mgrid[:40, :48]
    away = np.hypot(i - 24, j - 20)
    mask = np.stack([np.abs(away - 12) < half for half in (1.5, 2.5, 3.5)])
    mask[1] &= (j > 15) | (np.abs(i - 24) > 4)
    images = np.where(mask, 220, np.where(away < 15, 120, 10)).astype(np.uint8)
    turn = np.linspace(-np.pi / 2 + 0.35, 1.5 * np.pi - 0.35, 16)
    codebook = np.stack([24 + 12 * np.cos(turn), 20 + 12 * np.sin(turn)], axis=1)
    nearest = np.hypot(i[..., None] - codebook[:, 0], j[..., None] - codebook[:, 1]).argmin(axis=-1)
    return {"images": images, "mask": mask, "labels": np.where(mask, nearest + 1, 0), "codebook": codebook}


@pytest.fixture(scope="module")
def networks(study: dict[str, NDArray[np.float64]]) -> Networks:
    nothing = np.zeros(3, np.int64)
    books = np.stack([study["codebook"]] * 3)
    gaps = np.zeros((3, 16), bool)
    gaps[1, [2, 7]] = True
    return Networks(lattice("ring", 16), np.arange(3, dtype=np.int32), books, gaps, False, nothing, nothing)


@pytest.fixture(scope="module")
def trace() -> Trace:
    fall = np.geomspace(1.0, 1e-3, 9)
    counts = np.arange(9)[::-1]
    return Trace(fall, 2 * fall, np.append(0.0, fall[1:]), 5 + fall, 1 + fall, counts, 0 * counts, True)


def pixels(page: Page) -> NDArray[np.uint8]:
    """Return the colors of a page with its words, (rows, columns, 3)."""
    return np.asarray(page.image())


def words(page: Page) -> list[str]:
    return [word.text for word in page.words]


def at(seen: NDArray[np.uint8], place: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the color of the pixel that holds a place."""
    column, row = np.floor(place).astype(int)
    return np.asarray(seen[row, column])


def is_drawn(page: Page) -> bool:
    """Whether paper and ink are both there, the paper at the rim, and all words on it."""
    seen = pixels(page)
    rim = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
    high, wide, _ = seen.shape
    held = all(x0 >= 0 and y0 >= 0 and x1 <= wide and y1 <= high for x0, y0, x1, y1 in (w.box for w in page.words))
    return held and bool((rim == 255).all() and (seen < 255).any(axis=2).mean() > 0.002)


def on_slice(page: Page, panel: int, image: NDArray[np.generic], plane: Plane = PIXELS) -> NDArray[np.uint8]:
    """Return the color in the middle of each pixel of a slice, 0 beside the panel, (J, I, 3)."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    places = page.panels[panel].place(plane.place(np.stack([columns, rows], axis=-1)))
    i, j = np.moveaxis(np.floor(places).astype(int), -1, 0)
    left, top, right, bottom = page.panels[panel].box
    inside = (i >= left) & (i < right) & (j >= top) & (j < bottom)
    return np.asarray(page.pixels[np.where(inside, j, 0), np.where(inside, i, 0)] * inside[..., None])


class TestSlices:
    def test_window_blackens_the_rest(self, study: dict[str, NDArray[np.generic]]) -> None:
        page = draw_window(study["images"][1], study["mask"][1])
        shown = on_slice(page, 1, study["mask"][1])
        assert (shown[study["mask"][1]] == 255).all()
        assert (shown[~study["mask"][1]] == 0).all()
        assert is_drawn(page)

    def test_colors_become_gray(self, study: dict[str, NDArray[np.generic]]) -> None:
        color = np.stack([study["images"][0]] * 3, axis=-1)
        np.testing.assert_array_equal(gray(color), study["images"][0])

    @pytest.mark.parametrize("upward", [False, True])
    def test_neurons_lie_on_their_pixels(self, study: dict[str, NDArray[np.generic]], upward: bool) -> None:
        plane = Plane((0.5, 2.0), upward)
        image = np.zeros((40, 48))
        image[7, 31] = 1.0
        page = draw_window(image, image > 0, plane)
        shown = on_slice(page, 0, image, plane)
        np.testing.assert_array_equal(shown, np.repeat(255 * image[..., None], 3, axis=2))
        assert page.panels[0].place(np.array([[0, 0], [0, 70]]))[:, 1].argmax() == int(not upward)

    def test_regions_keep_their_colors(self, study: dict[str, NDArray[np.generic]], networks: Networks) -> None:
        labels = study["labels"][0]
        page = draw_regions(study["images"][0], study["mask"][0], networks.codebooks[0], networks.lattice)
        shown = on_slice(page, 3, labels)
        rows, columns = np.mgrid[:40, :48]
        first, second = np.sort(
            np.hypot(columns[..., None] - study["codebook"][:, 0], rows[..., None] - study["codebook"][:, 1]), axis=-1
        )[..., :2].transpose(2, 0, 1)
        clear = (labels == 0) | (second - first > 1e-4)  # half way between two neurons a pixel may go to either
        colors = np.array([shown[clear & (labels == label)][0] for label in range(17)])
        assert all((shown[clear & (labels == label)] == colors[label]).all() for label in range(17))
        assert len(np.unique(colors, axis=0)) == 17
        assert (colors[0] == 0).all()
        assert is_drawn(page)

    @pytest.mark.parametrize(("slice_", "found"), [(1, "2 bridged gaps"), (0, "no bridged gap")])
    def test_contour_marks_the_bridged_gaps(
        self, study: dict[str, NDArray[np.generic]], networks: Networks, slice_: int, found: str
    ) -> None:
        ring, gaps = networks.codebooks[slice_], networks.bridged[slice_]
        page = draw_contour(study["mask"][1], ring, networks.lattice, bridged=gaps)
        assert found in words(page)
        assert ("gap" in words(page)) == gaps.any()
        assert is_drawn(page)

    @pytest.mark.parametrize("shape", [(40, 48), (300, 130), (1, 1), (2, 2), (5, 6, 3)])
    def test_relief_of_any_shape(self, shape: tuple[int, ...]) -> None:
        image = np.random.default_rng(0).integers(0, 200, shape).astype(np.uint8)
        assert is_drawn(draw_relief(image)) or min(shape) == 1
        assert is_drawn(draw_relief(image, Plane(upward=True))) or min(shape) == 1

    def test_relief_of_one_level_is_flat(self) -> None:
        assert is_drawn(draw_relief(np.full((9, 9), 7)))


class TestTopologies:
    def test_ring_moves_one_neuron_more_than_chain(self) -> None:
        page = draw_update_regions()
        told = [word for word in words(page) if "neurons move" in word]
        assert ["4 of 10" in told[0], "5 of 10" in told[1]] == [True, True]
        assert is_drawn(page)

    @pytest.mark.parametrize("dimensions", [2, 3])
    def test_region_with_its_start(self, dimensions: int) -> None:
        region = np.random.default_rng(0).random((200, dimensions))
        page = draw_adapted(region, region[:12], lattice("grid", 12), start=region[12:24], title="Square")
        assert len(page.panels) == 2
        assert is_drawn(page)


class TestFit:
    def test_log_axes_leave_zeros_out(self, trace: Trace) -> None:
        page = draw_fit(trace, tolerance=1e-2)
        assert {"1", "0.1", "0.01", "0.001", "tolerance"} < {*words(page)}
        (ax, seen) = page.panels[2], pixels(page)
        for step, kinetic in enumerate(trace.kinetic[1:], 2):  # that of the first step is 0
            assert tuple(at(seen, ax.place(np.array([step, np.log10(kinetic)])))) == tuple(rgb(NETWORK).astype(int))
        assert is_drawn(page)

    def test_rest_from_the_start(self) -> None:
        still, none = np.zeros(1), np.zeros(1, np.int64)
        page = draw_fit(Trace(still, still, still, still, still, none, none, True))
        assert is_drawn(page)
        assert page.panels[3].limits[3] >= 1

    @given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 9))
    def test_ticks_are_round_few_and_within(self, low: float, size: float, most: int) -> None:
        places = ticks(low, low + size, most)
        assert 1 <= len(places) <= most
        assert (places >= low - 1e-6 * size).all()
        assert (places <= low + size * (1 + 1e-6)).all()
        whole = ticks(low, low + size, most, whole=True)
        assert (whole % 1 == 0).all()

    @given(st.floats(-9, 9), st.floats(0.5, 12))
    def test_ticks_of_a_logarithmic_axis_are_powers(self, low: float, size: float) -> None:
        places = decades(10**low, 10 ** (low + size))
        assert 1 <= len(places) <= 9
        assert {f"{place:.6e}"[0] for place in places} <= {*"125"}
        assert (np.diff(places) > 0).all()


class TestGallery:
    def test_draws_every_stage_in_order(
        self,
        study: dict[str, NDArray[np.generic]],
        networks: Networks,
        ball: TriMesh,
        cube: QuadMesh,
        trace: Trace,
    ) -> None:
        drawn = dict(
            draw_all(
                images=study["images"],
                mask=study["mask"].astype(bool),
                networks=networks,
                points=PointSet.from_positions(ball.vertices),
                cuberille=cube,
                triangulated=cube.triangulated(),
                smoothed=ball,
                mesh=ball,
                on_slices=ball,
                trace=trace,
            )
        )
        assert list(drawn) == [
            "03-relief", "04-window", "05-regions", "06-network", "06-slices-1", "07-points",
            "08-surfaces", "09-wireframe", "10-shaded", "11-fit", "12-outlines-1",
        ]  # fmt: skip
        assert all(map(is_drawn, drawn.values()))

    def test_draws_only_what_is_there(self, ball: TriMesh, study: dict[str, NDArray[np.generic]]) -> None:
        assert [name for name, _ in draw_all()] == []
        assert [name for name, _ in draw_all(mesh=ball)] == ["09-wireframe", "10-shaded"]
        slices = draw_all(images=study["images"], mask=study["mask"].astype(bool))
        assert [name for name, _ in slices] == ["03-relief", "04-window"]

    def test_takes_the_median_slice(self) -> None:
        mask = np.zeros((5, 3, 3), bool)
        for k, count in enumerate([0, 9, 4, 1, 6]):
            mask[k].flat[:count] = True
        assert median_slice(mask) == 2
        assert median_slice(mask, np.array([1, 4], np.int32)) == 4
        assert median_slice(np.zeros((2, 3, 3), bool)) == 0
