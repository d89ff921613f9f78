"""A result as one page: it lets nothing in, escapes all, repeats its bytes, and shows what there is."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from conftest import law
from html_pages import apart, require_self_contained
from test_show import round_mesh
from tomomesh import TriMesh, assess
from tomomesh.html import document as html
from tomomesh.html import pictures, three
from tomomesh.html.citation import citations
from tomomesh.html.decimate import decimated, means
from tomomesh.html.document import Contents, document
from tomomesh.html.histogram import HEIGHT, WIDTH, Histogram
from tomomesh.html.index import index
from tomomesh.html.places import NOTE, PROBLEM, WARNING, Problem, problems_of
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
from tomomesh.html.tables import in_words, tables_of
from tomomesh.html.verdict import BAD, CARE, GOOD, verdict_of
from tomomesh.measure.intersections import self_intersections
from tomomesh.model.cubes import CubeGrid, keys_of
from tomomesh.model.mesh import QuadMesh
from tomomesh.show import draw_all
from tomomesh.show.drawing.page import png

HOSTILE = "</script><img src=x onerror=alert(1)>\"'&{{ 7*7 }}<!--"


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


@pytest.fixture(scope="module")
def told(ball: TriMesh) -> Contents:
    drawn = {name: png(page) for name, page in draw_all(mesh=ball)}
    return Contents(
        "ball.stl", assess(ball), scene_of_mesh(ball), ["mesh      a ball"], "tomomesh check ball.stl",
        [Problem(PROBLEM, "a spot", (1.0, 2.0, 3.0), 0.5), Problem(NOTE, "nowhere")], drawn,
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
        assert [one["data-place"] for one in flown] == ["1.0 2.0 3.0"]
        assert [attrs["id"] for tag, attrs in found.elements if tag == "section"][:3] == ["summary", "mesh", "problems"]

    def test_escapes_whatever_it_is_told(self, told: Contents) -> None:
        plain = apart(document(told))
        hostile = replace(
            told, title=HOSTILE, command=HOSTILE, summary=[HOSTILE], problems=[Problem(NOTE, HOSTILE, (0, 0, 0))] * 2,
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


class TestVerdict:
    def test_a_sound_mesh_is_good(self, ball: TriMesh) -> None:
        found = verdict_of(assess(ball))
        assert found.state == GOOD
        assert found.words.startswith("Good to use: the mesh is closed")

    def test_what_is_open_or_crosses_or_is_far_is_bad(self, ball: TriMesh) -> None:
        opened = verdict_of(assess(TriMesh(ball.vertices, ball.faces[5:])))
        assert opened.state == BAD
        assert "open along" in opened.words
        far = verdict_of({"quality": assess(ball) | {"follows": {"far": "it is far", "volume_share": 1.0}}})
        assert far.words == "Not good to use: it is far."
        crossing = verdict_of({"quality": assess(ball) | {"self_intersections": 2}})
        assert "2 face(s) pass through others" in crossing.words

    def test_unrest_and_warnings_want_care(self, ball: TriMesh) -> None:
        found = verdict_of({"quality": assess(ball), "fit": {"converged": False}, "warnings": ["a", "b"]})
        assert found.state == CARE
        assert found.words == "Use with care: the fit is not at rest, there are 2 warnings."

    def test_a_part_is_judged_by_its_print(self) -> None:
        told = {"sound": True, "self_intersections": 0, "printable": False, "reasons": ["too thin"], "notes": []}
        assert verdict_of({"print": told}).words == "Not good to use: it cannot be printed: too thin."
        assert verdict_of({"print": told | {"printable": True}}).state == GOOD

    def test_a_sheet_may_have_borders(self, ball: TriMesh) -> None:
        sheet = {"way": {"name": "sheet"}, "quality": assess(TriMesh(ball.vertices, ball.faces[5:]))}
        assert "sheet with borders" in next(check.text for check in verdict_of(sheet).checks)
        assert [one.matters for one in problems_of(sheet) if "open" in one.text] == [NOTE]


class TestPlaces:
    def test_holes_and_crossings_are_where_they_are(self, ball: TriMesh) -> None:
        center = ball.vertices.mean(axis=0)
        radius = float(np.linalg.norm(ball.vertices - center, axis=1).max())
        top = ball.vertices[ball.faces].mean(axis=1)[:, 2]
        opened = TriMesh(ball.vertices, ball.faces[top < np.sort(top)[-12]])
        both = TriMesh(
            np.concatenate([opened.vertices, opened.vertices + np.array([1.6 * radius, 0, 0])]),
            np.concatenate([opened.faces, opened.faces + len(opened.vertices)]),
        )
        found = problems_of(assess(both), both, self_intersections(both))
        assert {one.matters for one in found} == {PROBLEM}
        holes = [one for one in found if "open there" in one.text]
        assert len(holes) == 2
        for one, away in zip(sorted(holes, key=lambda hole: hole.place or ()), (0, 1.6 * radius), strict=True):
            assert one.place is not None
            np.testing.assert_allclose(one.place, center + np.array([away, 0, radius]), atol=0.2 * radius)
        crossing = [one for one in found if "pass through" in one.text]
        assert crossing
        assert all(one.place is not None for one in crossing)
        assert abs(np.mean([one.place[0] for one in crossing if one.place]) - center[0] - 0.8 * radius) < 0.2 * radius

    def test_edges_of_three_faces_are_placed(self) -> None:
        corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
        fan = TriMesh(corners, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
        found = [one for one in problems_of(assess(fan), fan) if "more than two" in one.text]
        assert [one.place for one in found] == [(0.5, 0.0, 0.0)]

    def test_problems_come_first_and_once(self) -> None:
        report = {
            "quality": {"follows": {"far": "far"}, "cavity_places_mm": [[1, 2, 3]]}, "warnings": ["far", "odd", "odd"],
            "fit": {"converged": False}, "study": {"notes": ["noted"]},
            "print": {"reasons": ["thinnest wall .1"], "thinnest_wall_at_mm": [4, 5, 6], "thinnest_wall_mm": 0.1},
        }  # fmt: skip
        found = problems_of(report)
        assert [one.text for one in found if one.matters == PROBLEM] == ["far", "thinnest wall .1"]
        assert [one.place for one in found if one.place] == [(4.0, 5.0, 6.0), (1.0, 2.0, 3.0)]
        assert [one.text for one in found].count("odd") == 1
        assert [one.text for one in found].count("far") == 1
        assert [one.matters for one in found] == sorted(
            (one.matters for one in found), key=(PROBLEM, WARNING, NOTE).index
        )

    def test_a_sound_mesh_has_none(self, ball: TriMesh) -> None:
        assert problems_of(assess(ball), ball) == []


class TestTables:
    def test_keys_have_values_and_units(self) -> None:
        report = {
            "faces": 3, "points": {"unit": "cm"}, "quality": {"area_mm2": 2.0, "sound": True, "of": {"edge_mm": None}},
            "timings": {"total_s": 1.0}, "warnings": ["odd"], "rings": {"events": [{"slice": 1}, {"slice": 2}]},
        }  # fmt: skip
        found = {name: [(row.key, row.value, row.unit) for row in rows] for name, rows in tables_of(report).items()}
        assert found == {
            "mesh": [("faces", "3", "")],
            "points": [("unit", "cm", "")],
            "quality": [("area_mm2", "2", "cm^2"), ("sound", "yes", ""), ("of.edge_mm", "none", "cm")],
            "rings": [("events", "2", ""), ("events[1].slice", "1", ""), ("events[2].slice", "2", "")],
            "warnings": [("1", "odd", "")],
        }

    def test_long_lists_say_how_many(self) -> None:
        assert in_words([0.5, [1, 2]]) == "0.5, (1, 2)"
        assert in_words(list(range(100))).endswith("11, ... (100 in all)")
        assert in_words([]) == "none"


class TestHistogram:
    def test_the_window_lies_over_its_bars(self) -> None:
        found = Histogram([0, 9, 4, 0], -100, 100, lower=0, upper=None, unit="HU")
        assert found.window == (WIDTH / 2, WIDTH / 2)
        assert max(high for *_, high in found.bars) == HEIGHT
        assert [x for x, *_ in found.bars] == [n * WIDTH / 4 for n in range(4)]
        assert found.words == "Gray levels from -100 to 100 HU; kept are those in 0 < k <= any"
        assert Histogram([1], 5, 5, 7, 9).window == (0.0, WIDTH)
        assert Histogram([1, 1], 0, 10, 20, 30).window == (WIDTH, 0.0)


class TestIndex:
    def test_leads_to_each_and_says_what_failed(self) -> None:
        rows = [
            {"name": "a b&c", "exit_code": 0, "error": "", "sound": True, "faces": 12, "self_intersections": 0},
            {"name": HOSTILE, "exit_code": 4, "error": HOSTILE},
        ]
        found = require_self_contained(index("all", rows, folder="results", command=HOSTILE))
        assert [attrs["href"] for tag, attrs in found.elements if tag == "a"] == ["results/a%20b%26c.html"]
        assert "1 of 2 were made, 1 failed" in found.text
        assert found.text.count(HOSTILE) == 3
        assert "img" not in {tag for tag, _ in found.elements}


def test_cites_what_the_citation_file_names() -> None:
    told = (Path(__file__).parents[1] / "CITATION.cff").read_text(encoding="utf-8")
    paper = citations("1")[0]
    title = " ".join(told.partition("title: >-")[2].partition("authors:")[0].split())
    assert title in paper
    for line in told.partition("preferred-citation")[2].splitlines():
        key, _, value = line.strip().removeprefix("- ").partition(": ")
        if key in ("family-names", "year"):
            assert value in paper
