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
from tomomesh.model.points import BRIDGE, CAP, PointSet
from tomomesh.model.trace import Trace
from tomomesh.show import draw_all, space
from tomomesh.show.camera import Camera
from tomomesh.show.fit import draw_fit
from tomomesh.show.gallery import median_slice
from tomomesh.show.plane import Plane, gray
from tomomesh.show.relief import draw_relief
from tomomesh.show.render import View, nice_length
from tomomesh.show.slices import draw_contour, draw_regions, draw_window
from tomomesh.show.space import draw_points, draw_shaded, draw_surfaces, draw_wireframe
from tomomesh.show.topologies import draw_adapted, draw_update_regions

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


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


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """Draw a figure and return its canvas, (rows, columns, 4)."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]


def is_drawn(figure: Figure) -> bool:
    """Whether paper and ink are both there, the paper at the rim."""
    seen = pixels(figure)[:, :, :3]
    rim = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
    return bool((rim == 255).all() and (seen < 255).any(axis=2).mean() > 0.002)


class TestSpace:
    def test_ball_covers_its_disk(self, ball: TriMesh) -> None:
        figure = draw_shaded(ball)
        (ax,) = figure.axes
        seen = pixels(figure)
        center, rim = ax.transData.transform([[0, 0], [20, 0]])
        rows, columns = np.mgrid[: len(seen), : len(seen[0])]
        away = np.hypot(columns + 0.5 - center[0], len(seen) - rows - 0.5 - center[1]) / (rim - center)[0]
        inked = seen[:, :, :3].min(axis=2) < 250
        assert inked[away < 0.97].all()
        assert not inked[(away > 1.02) & (away < 1.08)].any()

    def test_ball_is_lit_from_the_upper_left(self, ball: TriMesh) -> None:
        figure = draw_shaded(ball)
        seen = pixels(figure)[:, :, :3].mean(axis=2)
        upper_left, lower_right = (
            figure.axes[0].transData.transform(place).astype(int) for place in ([-8, 8], [8, -12])
        )
        assert seen[len(seen) - upper_left[1], upper_left[0]] > 40 + seen[len(seen) - lower_right[1], lower_right[0]]

    def test_wireframe_hides_the_back(self, cube: QuadMesh) -> None:
        figure = draw_wireframe(cube.triangulated())
        assert len(figure.axes[0].collections[0].get_paths()) == 6
        assert is_drawn(figure)

    @pytest.mark.parametrize("given", [(1, 1, 1), (1, 0, 0), (0, 0, 1)])
    def test_surfaces_side_by_side(self, cube: QuadMesh, given: tuple[int, ...]) -> None:
        stages = (cube, cube.triangulated(), cube.triangulated())
        figure = draw_surfaces(*(stage if one else None for one, stage in zip(given, stages, strict=True)))  # type: ignore[arg-type]
        assert len(figure.axes) == sum(given)
        assert is_drawn(figure)

    @pytest.mark.parametrize(
        ("neuron", "names"),
        [(4, ["neurons", "bridges", "caps"]), (-1, ["crossings", "beside added voxels", "on the border"])],
    )
    def test_points_come_in_kinds(self, neuron: int, names: list[str]) -> None:
        rng = np.random.default_rng(0)
        kinds = np.repeat([0, BRIDGE, CAP], 20).astype(np.uint8)
        neurons = np.where(kinds == 0, neuron, -1).astype(np.int32)
        figure = draw_points(PointSet(rng.normal(size=(60, 3)), np.repeat([2, 3, 3], 20), neurons, kinds))
        legend = figure.axes[0].get_legend()
        assert legend is not None
        assert [entry.get_text() for entry in legend.get_texts()] == [f"{name} (20)" for name in names]
        drawn = [c for c in figure.axes[0].collections if np.shape(c.get_offsets()) == (20, 2)]
        assert len(drawn) == 3
        assert is_drawn(figure)

    def test_nearest_points_are_drawn_last(self) -> None:
        positions = np.array([[0.0, -5, 0], [0, 5, 0], [0, 0, 0]])
        figure = draw_points(PointSet.from_positions(positions), View(Camera(0, 0)))
        assert figure.axes[0].get_legend() is None
        strength = np.asarray(figure.axes[0].collections[0].get_facecolor())[:, 3]
        assert (np.diff(strength) > 0).all()

    def test_large_clouds_are_thinned(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(space, "MOST_POINTS", 100)
        cloud = PointSet.from_positions(np.random.default_rng(0).normal(size=(250, 3)))
        assert np.shape(draw_points(cloud).axes[0].collections[0].get_offsets()) == (84, 2)

    def test_one_point_and_flat_meshes_are_drawn(self) -> None:
        assert is_drawn(draw_points(PointSet.from_positions(np.ones((1, 3)))))
        flat = TriMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
        assert is_drawn(draw_shaded(flat))
        assert is_drawn(draw_wireframe(flat))

    @pytest.mark.parametrize("size", [(1, 1.5, 40), (40, 1, 1.5), (1, 40, 1), (1, 1, 1), (20, 20, 0.1)])
    def test_marks_of_a_long_object_keep_apart(self, size: tuple[float, float, float]) -> None:
        cloud = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * size
        figure = draw_points(PointSet.from_positions(cloud))
        figure.canvas.draw()
        ax = figure.axes[0]
        words = [text.get_window_extent() for text in ax.texts]
        assert len(words) == 5  # the note, the length of the bar, three axes
        assert not any(a.overlaps(b) for n, a in enumerate(words) for b in words[:n])
        assert ax.get_window_extent().x0 < 0.1 * figure.bbox.width

    @given(st.floats(1e-6, 1e9))
    def test_scale_bar_is_round_and_fits(self, size: float) -> None:
        length = nice_length(size)
        assert size / 7.6 < length <= size / 3 * (1 + 1e-6)
        assert f"{length:.6e}"[0] in "125"


class TestSlices:
    def test_window_blackens_the_rest(self, study: dict[str, NDArray[np.generic]]) -> None:
        figure = draw_window(study["images"][1], study["mask"][1])
        shown = np.asarray(figure.axes[1].images[0].get_array())
        assert (shown[study["mask"][1]] == 220).all()
        assert (shown[~study["mask"][1]] == study["images"].min()).all()
        assert is_drawn(figure)

    def test_colors_become_gray(self, study: dict[str, NDArray[np.generic]]) -> None:
        color = np.stack([study["images"][0]] * 3, axis=-1)
        np.testing.assert_array_equal(gray(color), study["images"][0])

    @pytest.mark.parametrize("upward", [False, True])
    def test_neurons_lie_on_their_pixels(self, study: dict[str, NDArray[np.generic]], upward: bool) -> None:
        plane = Plane((0.5, 2.0), upward)
        image = np.zeros((40, 48))
        image[7, 31] = 1.0
        figure = draw_window(image, image > 0, plane)
        seen = pixels(figure)[:, :, :3]
        spot = figure.axes[0].transData.transform(plane.place(np.array([[31, 7]])))[0].astype(int)
        assert (seen[len(seen) - 1 - spot[1], spot[0]] == 255).all()
        assert (seen[len(seen) - 1 - spot[1], spot[0] - 40] == 0).all()
        assert figure.axes[0].transData.transform([[0, 0], [0, 70]])[:, 1].argmax() == int(upward)

    def test_regions_keep_their_colors(self, study: dict[str, NDArray[np.generic]], networks: Networks) -> None:
        labels = study["labels"][0]
        figure = draw_regions(study["images"][0], study["mask"][0], networks.codebooks[0], networks.lattice, labels)
        shown = np.asarray(figure.axes[3].images[0].get_array())
        colors = np.array([shown[labels == label][0] for label in range(17)])
        assert all((shown[labels == label] == colors[label]).all() for label in range(17))
        assert len(np.unique(colors, axis=0)) == 17
        assert (colors[0] == 0).all()
        assert is_drawn(figure)

    @pytest.mark.parametrize(("slice_", "found"), [(1, "2 bridged gaps"), (0, "no bridged gap")])
    def test_contour_marks_the_bridged_gaps(
        self, study: dict[str, NDArray[np.generic]], networks: Networks, slice_: int, found: str
    ) -> None:
        ring, gaps = networks.codebooks[slice_], networks.bridged[slice_]
        figure = draw_contour(study["mask"][1], ring, networks.lattice, bridged=gaps)
        words = [text.get_text() for text in figure.axes[1].texts]
        assert found in words
        assert ("gap" in words) == gaps.any()
        assert is_drawn(figure)

    @pytest.mark.parametrize("shape", [(40, 48), (300, 130), (1, 1), (2, 2), (5, 6, 3)])
    def test_relief_of_any_shape(self, shape: tuple[int, ...]) -> None:
        image = np.random.default_rng(0).integers(0, 200, shape).astype(np.uint8)
        assert is_drawn(draw_relief(image)) or min(shape) == 1
        assert is_drawn(draw_relief(image, Plane(upward=True))) or min(shape) == 1

    def test_relief_of_one_level_is_flat(self) -> None:
        assert is_drawn(draw_relief(np.full((9, 9), 7)))


class TestTopologies:
    def test_ring_moves_one_neuron_more_than_chain(self) -> None:
        figure = draw_update_regions()
        words = [" ".join(text.get_text() for text in ax.texts) for ax in figure.axes]
        assert "4 of 10 neurons move" in words[0]
        assert "5 of 10 neurons move" in words[1]
        assert is_drawn(figure)

    @pytest.mark.parametrize("dimensions", [2, 3])
    def test_region_with_its_start(self, dimensions: int) -> None:
        region = np.random.default_rng(0).random((200, dimensions))
        figure = draw_adapted(region, region[:12], lattice("grid", 12), start=region[12:24], title="Square")
        assert len(figure.axes) == 2
        assert is_drawn(figure)


class TestFit:
    def test_log_axes_leave_zeros_out(self, trace: Trace) -> None:
        figure = draw_fit(trace, tolerance=1e-2)
        assert [ax.get_yscale() for ax in figure.axes] == ["log", "linear", "log", "linear"]
        kinetic = np.asarray(figure.axes[2].lines[0].get_ydata())
        assert np.isnan(kinetic[0])
        assert (kinetic[1:] > 0).all()
        assert is_drawn(figure)

    def test_rest_from_the_start(self) -> None:
        still, none = np.zeros(1), np.zeros(1, np.int64)
        figure = draw_fit(Trace(still, still, still, still, still, none, none, True))
        assert is_drawn(figure)
        assert (figure.axes[3].get_yticks() % 1 == 0).all()


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
                labels=study["labels"],
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
