"""Pictures of space: surfaces, wireframes and points, what hides what, and their scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from test_show import at, box, is_drawn, pixels, round_mesh, words
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import BRIDGE, CAP, PointSet
from tomomesh.show import space
from tomomesh.show.camera import Camera, normals
from tomomesh.show.drawing.style import ACCENT, HEIGHT, INK, rgb
from tomomesh.show.render import View, nice_length
from tomomesh.show.space import draw_points, draw_shaded, draw_surfaces, draw_wireframe


class TestSpace:
    def test_ball_covers_its_disk(self) -> None:
        page = draw_shaded(round_mesh())
        (ax,) = page.panels
        seen = pixels(page)
        center, rim = ax.place(np.array([[0.0, 0], [20, 0]]))
        rows, columns = np.mgrid[: len(seen), : len(seen[0])]
        away = np.hypot(columns + 0.5 - center[0], rows + 0.5 - center[1]) / (rim - center)[0]
        inked = seen.min(axis=2) < 250
        assert inked[away < 0.99].all()
        assert not inked[(away > 1.005) & (away < 1.08)].any()

    def test_ball_is_lit_from_the_upper_left(self) -> None:
        page = draw_shaded(round_mesh())
        upper_left, lower_right = (
            at(pixels(page), page.panels[0].place(np.array(place))).mean() for place in ([-8.0, 8.0], [8.0, -12.0])
        )
        assert upper_left > 40 + lower_right

    def test_wireframe_hides_the_back(self) -> None:
        """Without the three squares that turn away the picture is the same; without those in front it is not."""
        camera = Camera(30, 20)
        cube = box()
        faces = cube.triangulated().faces
        toward = normals(camera.project(cube.vertices), faces)[:, 2] > 0
        whole, front, back = (
            draw_wireframe(TriMesh(cube.vertices, part), View(camera)).pixels
            for part in (faces, faces[toward], faces[~toward])
        )
        np.testing.assert_array_equal(whole, front)
        assert (whole != back).any()

    def test_both_sides_of_a_sheet_are_drawn(self) -> None:
        """In their own colors, one as the mirror image of the other."""
        flat = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        front, back = (pixels(draw_shaded(TriMesh(flat, each), View(Camera(0, 0)))) for each in (faces, faces[:, ::-1]))
        inked = np.asarray((front < 255).any(axis=2))
        middle = tuple(n // 2 for n in front.shape[:2])
        assert inked[middle]
        np.testing.assert_array_equal(inked, (back < 255).any(axis=2))
        assert front[middle][0] > front[middle][2]
        assert back[middle][0] < back[middle][2]

    def test_faces_that_interlock_hide_each_other_by_halves(self) -> None:
        """Two squares through each other: left the one is in front, right the other."""
        one = np.array([[-1.0, -1, -1], [1, 1, -1], [1, 1, 1], [-1, -1, 1]])
        other = one * [1, -1, 1]
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        mesh = TriMesh(np.concatenate([one, other]), np.concatenate([faces, faces + 4]))
        alone = [pixels(draw_surfaces(None, TriMesh(each, faces), None, View(Camera(0, 0)))) for each in (one, other)]
        both = pixels(draw_surfaces(None, mesh, None, View(Camera(0, 0))))
        row, column = (n // 2 for n in both.shape[:2])
        left, right = column - column // 3, column + column // 3
        np.testing.assert_array_equal(both[row, left], alone[0][row, left])
        np.testing.assert_array_equal(both[row, right], alone[1][row, right])
        assert (both[row, left] != both[row, right]).any()

    @pytest.mark.parametrize("given", [(1, 1, 1), (1, 0, 0), (0, 0, 1)])
    def test_surfaces_side_by_side(self, given: tuple[int, ...]) -> None:
        stages = (box(), box().triangulated(), box().triangulated())
        page = draw_surfaces(*(stage if one else None for one, stage in zip(given, stages, strict=True)))  # type: ignore[arg-type]
        assert len(page.panels) == sum(given)
        assert is_drawn(page)

    @pytest.mark.parametrize(
        ("neuron", "names"),
        [(4, ["neurons", "bridges", "caps"]), (-1, ["crossings", "beside added voxels", "on the border"])],
    )
    def test_points_come_in_kinds(self, neuron: int, names: list[str]) -> None:
        rng = np.random.default_rng(0)
        kinds = np.repeat([0, BRIDGE, CAP], 20).astype(np.uint8)
        neurons = np.where(kinds == 0, neuron, -1).astype(np.int32)
        page = draw_points(PointSet(rng.normal(size=(60, 3)), np.repeat([2, 3, 3], 20), neurons, kinds))
        assert [word for word in words(page) if word.endswith("(20)")] == [f"{name} (20)" for name in names]
        shown = {tuple(color) for color in pixels(page).reshape(-1, 3)}
        assert {tuple(int(level) for level in rgb(color)) for color in (ACCENT, INK)} < shown
        assert is_drawn(page)

    def test_the_nearest_point_hides_those_behind_it(self) -> None:
        positions = np.array([[0.0, -5, 0], [0, 5, 9], [0, 0, 4]])
        for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
            page = draw_points(PointSet.from_positions(positions[order]), View(Camera(0, 0)))
            assert not any("(" in word and "height" not in word for word in words(page))
            (ax,), seen = page.panels, pixels(page)
            ink = [255.0 - at(seen, ax.place(positions[n, [0, 2]])).min() for n in range(3)]
            assert ink[0] > ink[2] > ink[1] > 0

    def test_points_at_one_place_are_the_nearest_one(self) -> None:
        """The farther has another color, by its height, and is not seen."""
        camera = Camera(0, 30)
        positions = np.array([[0.0, 0, 0]]) + np.array([[0.0], [-40.0]]) * camera.rotation[2]
        pages = [draw_points(PointSet.from_positions(positions[order]), View(camera)) for order in ([0, 1], [1, 0])]
        seen = [at(pixels(page), page.panels[0].place(np.zeros(2))) for page in pages]
        np.testing.assert_array_equal(seen[0], HEIGHT(1.0))
        np.testing.assert_array_equal(seen[1], HEIGHT(1.0))

    def test_large_clouds_are_thinned(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(space, "MOST_POINTS", 100)
        cloud = np.random.default_rng(0).normal(size=(250, 3))
        thinned = draw_points(PointSet.from_positions(cloud))
        monkeypatch.setattr(space, "MOST_POINTS", 84)
        assert "250 points, one in 3 drawn" in words(thinned)
        third = draw_points(PointSet.from_positions(cloud[::3]))
        np.testing.assert_array_equal(thinned.pixels, third.pixels)

    def test_one_point_and_flat_meshes_are_drawn(self) -> None:
        assert is_drawn(draw_points(PointSet.from_positions(np.ones((1, 3)))))
        flat = TriMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
        assert is_drawn(draw_shaded(flat))
        assert is_drawn(draw_wireframe(flat))

    @pytest.mark.parametrize("size", [1e-60, 1e-9, 1e9, 1e60])
    def test_size_changes_nothing_but_the_scale(self, size: float) -> None:
        """A ball of any size is the same picture, but for its scale bar."""
        ball = round_mesh()
        one, other = (draw_shaded(TriMesh(each * ball.vertices, ball.faces)).pixels for each in (1.0, size))
        upper = slice(0, int(0.8 * len(one)))
        assert np.abs(one[upper].astype(int) - other[upper]).max() <= 30  # a corner may round to the next step
        assert (one[upper] != other[upper]).mean() < 1e-3

    @pytest.mark.parametrize("size", [(1, 1.5, 40), (40, 1, 1.5), (1, 40, 1), (1, 1, 1), (20, 20, 0.1)])
    def test_marks_of_a_long_object_keep_apart(self, size: tuple[float, float, float]) -> None:
        cloud = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * size
        page = draw_points(PointSet.from_positions(cloud))
        boxes = [word.box for word in page.words]
        assert {"The points P", "200 points", "L", "P", "S"} < {*words(page)}
        assert not any(
            a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3] for n, a in enumerate(boxes) for b in boxes[:n]
        )
        assert page.panels[0].box[0] < 0.1 * page.pixels.shape[1]

    @given(st.floats(1e-6, 1e9))
    def test_scale_bar_is_round_and_fits(self, size: float) -> None:
        length = nice_length(size)
        assert size / 7.6 < length <= size / 3 * (1 + 1e-6)
        assert f"{length:.6e}"[0] in "125"
