"""What a page says in words: the verdict, problems with their places, tables, and where to cite."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

from conftest import law, seeds
from html_pages import HOSTILE, require_self_contained
from test_show import round_mesh
from tomomesh import TriMesh, assess, reconstruct_points
from tomomesh.errors import GeometryError
from tomomesh.html.citation import citations
from tomomesh.html.histogram import HEIGHT, WIDTH, Histogram
from tomomesh.html.index import index
from tomomesh.html.places import MOST, NOTE, PROBLEM, WARNING, named_places, problems_of
from tomomesh.html.tables import in_words, tables_of
from tomomesh.html.verdict import BAD, CARE, GOOD, verdict_of
from tomomesh.measure.intersections import self_intersections


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


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
        [holes] = [one.places for one in found if "open there" in one.text]
        for spot, away in zip(sorted(holes), (0, 1.6 * radius), strict=True):
            np.testing.assert_allclose(spot.place, center + np.array([away, 0, radius]), atol=0.2 * radius)
        [crossing] = [one.places for one in found if "pass through" in one.text]
        assert abs(np.mean([spot.place[0] for spot in crossing]) - center[0] - 0.8 * radius) < 0.2 * radius

    def test_edges_of_three_faces_are_placed(self) -> None:
        corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
        fan = TriMesh(corners, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
        [found] = [one for one in problems_of(assess(fan), fan) if "more than two" in one.text]
        assert [spot.place for spot in found.places] == [(0.5, 0.0, 0.0)]

    def test_vertices_where_sheets_touch_are_placed(self, ball: TriMesh) -> None:
        """Two balls that share one corner."""
        at = ball.vertices[0]
        other = np.where(np.arange(len(ball.vertices)) == 0, 0, np.arange(len(ball.vertices)) + len(ball.vertices) - 1)
        both = TriMesh(
            np.concatenate([ball.vertices, 2 * at - ball.vertices[1:]]),
            np.concatenate([ball.faces, other[ball.faces][:, ::-1]]),
        )
        [found] = [one for one in problems_of(assess(both), both) if "sheets touch" in one.text]
        assert [spot.place for spot in found.places] == [tuple(at)]

    def test_faces_that_are_turned_are_placed(self, ball: TriMesh) -> None:
        faces = np.array(ball.faces)
        faces[7] = faces[7, ::-1]
        turned = TriMesh(ball.vertices, faces)
        [found] = [one for one in problems_of(assess(turned), turned) if "do not agree" in one.text]
        corners = ball.vertices[faces[7]]
        np.testing.assert_allclose(
            [spot.place for spot in found.places], [(corners.min(axis=0) + corners.max(axis=0)) / 2]
        )

    def test_pieces_inside_out_are_placed(self, ball: TriMesh) -> None:
        far = ball.vertices + 1000.0
        both = TriMesh(
            np.concatenate([ball.vertices, far]), np.concatenate([ball.faces, ball.faces[:, ::-1] + len(far)])
        )
        [found] = [one for one in problems_of(assess(both), both) if "inside out" in one.text]
        np.testing.assert_allclose([spot.place for spot in found.places], [(far.min(axis=0) + far.max(axis=0)) / 2])

    @law(10)
    @given(seeds)
    def test_a_leak_is_where_the_samples_lack(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        points, hole = (
            rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (rng.normal(size=(n, 3)) for n in (4000, 1))
        )
        center = rng.uniform(-500, 500, 3)
        open_ = 10 * points[points @ hole[0] < 0.4] + center
        with pytest.raises(GeometryError) as refused:
            reconstruct_points(open_)
        warnings = reconstruct_points(open_, allow_leaks=True).report["warnings"]
        for line in (str(refused.value), " ".join(warnings)):
            [spot] = named_places(line)
            np.testing.assert_allclose(spot.place, center + 4 * hole[0], atol=1)
        [told] = [one for one in problems_of({"warnings": warnings}) if one.places]
        assert told.matters == WARNING

    def test_problems_come_first_and_once(self) -> None:
        report = {
            "quality": {"follows": {"far": "far"}, "cavity_places_mm": [[1, 2, 3]]}, "warnings": ["far", "odd", "odd"],
            "fit": {"converged": False}, "study": {"notes": ["noted"]},
            "print": {"reasons": ["thinnest wall .1"], "thinnest_wall_at_mm": [4, 5, 6], "thinnest_wall_mm": 0.1},
        }  # fmt: skip
        found = problems_of(report)
        assert [one.text for one in found if one.matters == PROBLEM] == ["far", "thinnest wall .1"]
        assert [one.places for one in found if one.places] == [(((4.0, 5.0, 6.0), 0.1),), (((1.0, 2.0, 3.0), 0.0),)]
        assert [one.text for one in found].count("odd") == 1
        assert [one.text for one in found].count("far") == 1
        assert [one.matters for one in found] == sorted(
            (one.matters for one in found), key=(PROBLEM, WARNING, NOTE).index
        )

    def test_many_of_a_kind_are_one_with_many_places(self) -> None:
        [found] = problems_of({"quality": {"cavity_places_mm": np.arange(900).reshape(-1, 3).tolist()}})
        assert (found.text, len(found.places)) == ("300 cavities inside", MOST)

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
