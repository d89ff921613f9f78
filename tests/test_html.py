"""A result as one page: it lets nothing in, escapes all, repeats its bytes, and shows what there is."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from conftest import law
from html_pages import HOSTILE, apart, require_self_contained
from test_show import round_mesh
from tomomesh import TriMesh, assess
from tomomesh.html import document as html
from tomomesh.html import pictures, three
from tomomesh.html.citation import citations
from tomomesh.html.decimate import decimated, means
from tomomesh.html.document import Contents, document
from tomomesh.html.histogram import Histogram
from tomomesh.html.places import NOTE, PROBLEM, Problem, Spot
from tomomesh.html.scene import (
    APART,
    LEVELS,
    Scene,
    Values,
    scene_of_cubes,
    scene_of_mesh,
    scene_of_points,
    scene_of_quads,
)
from tomomesh.model.cubes import CubeGrid, keys_of
from tomomesh.model.mesh import QuadMesh
from tomomesh.show import draw_all
from tomomesh.show.drawing.page import png


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


@pytest.fixture(scope="module")
def told(ball: TriMesh) -> Contents:
    drawn = {name: png(page) for name, page in draw_all(mesh=ball)}
    return Contents(
        "ball.stl", assess(ball), scene_of_mesh(ball), ["mesh      a ball"], "tomomesh check ball.stl",
        [Problem(PROBLEM, "a spot", (Spot((1.0, 2.0, 3.0), 0.5),)), Problem(NOTE, "nowhere")], drawn,
        Histogram([4, 0, 1], 0, 9, 3),
    )  # fmt: skip


def unpacked(told: bytes) -> tuple[dict[str, Any], list[Any]]:
    """Read a scene as its module says that it is laid out."""
    length = int.from_bytes(told[:4], "little")
    header, at, found = json.loads(told[4 : 4 + length]), 4 + length, []
    index = "<u2" if header["index_bytes"] == 2 else "<u4"
    parts = [("<u2", header["vertices"], 3), (index, header["faces"], 3), (index, header["lines"], 2)]
    for kind, rows, columns in [*parts, *[("<f4", header["vertices"], 1)] * len(header["values"])]:
        array = np.frombuffer(told, kind, rows * columns, at)
        found.append(array.reshape(rows, columns))
        at += -(-array.nbytes // 4) * 4
    assert at == len(told)
    return header, found


class TestScene:
    @law(60)
    @given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(0, 30), st.floats(1e-6, 1e6), st.booleans())
    def test_what_is_packed_is_read_again(self, seed: int, many: int, faces: int, size: float, named: bool) -> None:
        rng = np.random.default_rng(seed)
        vertices = size * rng.normal(size=(many, 3)) + 1e3 * size
        numbers = np.where(rng.random(many) < 0.2, np.nan, rng.normal(size=many))
        values = {"d": Values(numbers, "distance", "mm")} if named else {}
        scene = Scene(
            vertices, rng.integers(0, many, (faces, 3)), rng.integers(0, many, (faces // 2, 2)), values, faces
        )
        header, (positions, corners, lines, *at) = unpacked(scene.packed())
        placed = np.array(header["low"]) + header["step"] * positions
        assert np.abs(placed - vertices).max() <= 0.501 * header["step"]
        assert header["step"] * LEVELS <= np.ptp(vertices, axis=0).max() * (1 + 1e-9) or many == 1
        np.testing.assert_array_equal(corners, scene.faces)
        np.testing.assert_array_equal(lines, scene.lines)
        assert [one["name"] for one in header["values"]] == [*values]
        for numbers_read in at:
            np.testing.assert_array_equal(numbers_read[:, 0], numbers.astype(np.float32))
        assert base64.b64decode(scene.base64()) == scene.packed()

    def test_large_scenes_have_wide_indices(self) -> None:
        vertices = np.random.default_rng(0).normal(size=(LEVELS + 2, 3))
        header, (_, faces, _) = unpacked(Scene(vertices, np.array([[0, 1, LEVELS + 1]])).packed())
        assert header["index_bytes"] == 4
        assert faces.tolist() == [[0, 1, LEVELS + 1]]

    def test_cubes_show_their_sides_and_points_have_no_faces(self) -> None:
        square = QuadMesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2, 3]]))
        scene = scene_of_quads(square)
        assert scene.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
        assert sorted(map(sorted, scene.lines.tolist())) == [[0, 1], [0, 3], [1, 2], [2, 3]]
        assert scene.flat
        assert not len(scene_of_points(square.vertices).faces)

    def test_colors_end_before_the_outliers(self) -> None:
        told = Values(np.array([*np.linspace(1, 2, 99), 1000.0, np.nan]), "distance").told("d")
        assert told["low"] == 1
        assert 1.9 < told["high"] <= 2

    def test_cubes_stand_where_they_are_each_by_itself_and_outward(self) -> None:
        cells = np.array([(0, 0, 0), (1, 0, 0), (5, 2, 7)])
        origin, edges = np.array([3.0, -2.0, 1.0]), np.array([0.5, 1.0, 2.0])
        scene = scene_of_cubes(CubeGrid(keys_of(cells), origin, edges, np.empty(0, np.int64), np.zeros(4, np.int64)))
        for n, cell in enumerate(cells[np.argsort(keys_of(cells))]):
            own = TriMesh(scene.vertices, scene.faces[12 * n : 12 * n + 12])
            corners = own.vertices[own.faces].reshape(-1, 3)
            assert own.face_volumes.sum() == pytest.approx((1 - 2 * APART) ** 3 * edges.prod())
            np.testing.assert_allclose(corners.min(axis=0) + corners.max(axis=0), 2 * origin + edges * (2 * cell + 1))


class TestDecimation:
    @law(40)
    @given(st.integers(0, 2**32 - 1), st.integers(8, 4000))
    def test_has_few_faces_whole_and_once_each_in_place(self, seed: int, most: int) -> None:
        ball = round_mesh()
        rng = np.random.default_rng(seed)
        mesh = ball.moved(ball.vertices * rng.uniform(0.01, 100, 3) + rng.normal(size=3))
        fewer, became = decimated(mesh, most)
        assert len(fewer.faces) <= most
        corners = np.sort(fewer.faces, axis=1)
        assert (np.diff(corners, axis=1) > 0).all()
        assert len(np.unique(corners, axis=0)) == len(corners)
        assert (fewer.vertices >= mesh.vertices.min(axis=0) - 1e-9).all()
        assert (fewer.vertices <= mesh.vertices.max(axis=0) + 1e-9).all()
        for n in range(len(fewer.vertices)):
            np.testing.assert_allclose(fewer.vertices[n], mesh.vertices[became == n].mean(axis=0))

    def test_keeps_the_shape(self, ball: TriMesh) -> None:
        fewer, _ = decimated(ball, len(ball.faces) // 4)
        assert len(fewer.faces) > len(ball.faces) // 16
        np.testing.assert_allclose(fewer.face_areas.sum(), ball.face_areas.sum(), rtol=0.1)

    def test_a_small_mesh_is_itself(self, ball: TriMesh) -> None:
        fewer, became = decimated(ball, len(ball.faces))
        assert fewer is ball
        np.testing.assert_array_equal(became, np.arange(len(ball.vertices)))

    def test_values_are_the_means_of_those_that_became_one(self) -> None:
        found = means(np.array([1.0, 2, 3, 50]), np.array([1, 0, 1, -1]))
        assert found.tolist() == [2, 2]


class TestDocument:
    def test_lets_nothing_in_but_itself(self, told: Contents) -> None:
        found = require_self_contained(document(told))
        assert len(found.inside["script"]) == 4
        assert "THREE" in found.inside["script"][0]

    def test_says_first_what_it_is_and_whether_it_is_good(self, told: Contents) -> None:
        text = document(told).partition("<body>")[2]
        order = [text.index(word) for word in ("ball.stl", "Good to use", "a ball", '"problems-head"', '"report-head"')]
        assert order == sorted(order)

    def test_repeats_its_bytes(self, told: Contents) -> None:
        assert document(told) == document(replace(told, report=dict(told.report)))

    def test_tells_everything(self, told: Contents) -> None:
        found = apart(document(told))
        for word in ("euler_number", "tomomesh check ball.stl", "a spot", "nowhere", *citations("0")[:1]):
            assert word in found.text
        flown = [attrs for tag, attrs in found.elements if attrs.get("class") == "fly"]
        assert [one["data-places"] for one in flown] == ["1.0 2.0 3.0 0.5"]
        assert [attrs["id"] for tag, attrs in found.elements if tag == "section"][:3] == ["summary", "mesh", "problems"]

    def test_escapes_whatever_it_is_told(self, told: Contents) -> None:
        plain = apart(document(told))
        hostile = replace(
            told, title=HOSTILE, command=HOSTILE, summary=[HOSTILE],
            problems=[Problem(NOTE, HOSTILE, (Spot((0, 0, 0)),))] * 2,
            report={**told.report, HOSTILE: {HOSTILE: HOSTILE}, "warnings": [HOSTILE]}, frame=HOSTILE,
            histogram=Histogram([1, 2], 0, 1, unit=HOSTILE),
            scene=replace(told.scene, unit=HOSTILE, axes=((HOSTILE, HOSTILE),) * 3, values={
                HOSTILE: Values(np.zeros(len(told.scene.vertices)), HOSTILE, HOSTILE)}),
        )  # fmt: skip
        found = require_self_contained(document(hostile))
        assert {tag for tag, _ in found.elements} == {tag for tag, _ in plain.elements}
        assert found.inside == plain.inside
        assert found.text.count(HOSTILE) >= 8
        assert "49" not in found.text.replace(plain.text, "").split()

    def test_says_how_many_faces_stand_for_how_many(self, told: Contents, ball: TriMesh) -> None:
        scene = scene_of_mesh(ball, most=100)
        text = " ".join(apart(document(replace(told, scene=scene))).text.split())
        assert f"{len(scene.faces)} faces stand for the {len(ball.faces):,} of the mesh" in text
        assert f"All {len(ball.faces):,} faces" in " ".join(apart(document(told)).text.split())

    def test_without_three_a_picture_stands_in(self, told: Contents, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(html, "three_js", lambda: "")
        found = require_self_contained(document(told))
        assert len(found.inside["script"]) == 3
        assert [tag for tag, attrs in found.elements if attrs.get("class") == "view-picture"] == ["img"]

    def test_times_are_left_out(self, told: Contents) -> None:
        report = {"way": {"name": "rings"}, "quality": told.report}
        slow, quick = (document(replace(told, report={**report, "timings": {"fit_s": n}})) for n in (1.0, 2.0))
        assert slow == quick


class TestPictures:
    def test_are_kept_while_they_fit_the_best_first(self, monkeypatch: pytest.MonkeyPatch) -> None:
        noise = np.random.default_rng(0).integers(0, 255, (300, 1600, 3), dtype=np.uint8)
        file = io.BytesIO()
        Image.fromarray(noise).save(file, "png")
        drawn = {name: file.getvalue() for name in ("03-relief", "12-outlines-1", "11-fit")}
        taken, left = pictures.pictures_of(drawn)
        assert ([one.name for one in taken], left) == (["12-outlines-1", "11-fit", "03-relief"], [])
        assert {one.width for one in taken} == {pictures.WIDEST}
        monkeypatch.setattr(pictures, "BUDGET", 1)
        taken, left = pictures.pictures_of(drawn)
        assert ([one.name for one in taken], left) == (["12-outlines-1"], ["11-fit", "03-relief"])

    def test_every_picture_of_a_run_has_words(self) -> None:
        assert pictures.caption_of("12-outlines-2") == "Slices with the outline of the mesh (2)"
        assert {name[:2] for name in pictures.SHOWS} == set(pictures.ORDER)


class TestThree:
    def test_is_that_of_trimesh_with_its_license(self) -> None:
        library = three.three_js()
        assert library.startswith("/**\n * @license")
        assert "SPDX-License-Identifier: MIT" in library[:200]
        assert library.rstrip().endswith("THREE.TrackballControls=TrackballControls;})();")

    @pytest.mark.parametrize("page", ["", three.BEGIN, three.END + three.BEGIN, f"{three.BEGIN}</SCRIPT>{three.END}"])
    def test_another_page_gives_nothing(self, page: str) -> None:
        assert three.cut_out(page) == ""
        assert three.cut_out(f"<script>{three.BEGIN} x {three.END}</script>") == f"{three.BEGIN} x {three.END}"
