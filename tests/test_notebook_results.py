"""A result shows itself in a notebook, and goes to other programs in one call."""

from __future__ import annotations

import base64
import io
import json
import sys
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import nbformat
import numpy as np
import pytest
from PIL import Image

from browsers import SOFTWARE, Watched, chromium
from html_pages import require_self_contained
from test_imports import loaded_after
from test_show import round_mesh
from tomomesh import (
    Volume,
    phantom,
    reconstruct,
    reconstruct_large,
    reconstruct_points,
)
from tomomesh.errors import ResourceError
from tomomesh.html.inline import MOST, Shown, inline
from tomomesh.html.scene import scene_of_mesh, scene_of_points
from tomomesh.large import LargeSurface
from tomomesh.model.mesh import TriMesh
from tomomesh.pipeline import reconstruct_once
from tomomesh.results import Segmentation, Surface
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

MEGABYTES = 1e6
SIZE, VOXEL = (12, 32, 32), (7.5, 7.5, 12.0)


@pytest.fixture(scope="module")
def found() -> Surface:
    head = phantom(SIZE, VOXEL)
    return reconstruct(head.volume, lower=head.lower, way="voxels")


class Pieces(HTMLParser):
    """The elements of a piece of HTML, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text += data

    @property
    def frame(self) -> dict[str, str | None]:
        (frame,) = (attributes for tag, attributes in self.elements if tag == "iframe")
        return frame


def large_mesh(rows: int) -> TriMesh:
    """Return a sheet of 2 (rows - 1)^2 faces."""
    x, y = np.meshgrid(np.arange(rows, dtype=float), np.arange(rows, dtype=float))
    corner = (np.arange(rows - 1)[:, None] * rows + np.arange(rows - 1)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, rows], corner[:, None] + [1, rows + 1, rows]])
    return TriMesh(np.stack([x.ravel(), y.ravel(), 5 * np.sin(x / 20 + y / 30).ravel()], axis=1), faces)


class TestInline:
    def test_says_what_it_is_outside_of_the_frame(self, found: Surface) -> None:
        """What is left where scripts and frames are taken out: the words, and a table."""
        shown = Pieces(found._repr_html_())
        assert {tag for tag, _ in shown.elements} == {
            "div",
            "p",
            "strong",
            "table",
            "tbody",
            "tr",
            "th",
            "td",
            "img",
            "iframe",
        }
        assert "the mesh is closed" in shown.text
        assert f"{found.report['quality']['faces']:,}" in shown.text

    def test_a_still_picture_is_left_where_scripts_and_frames_are_not(self, found: Surface) -> None:
        """It is drawn by what draws the pages of pictures, the same on every call, and within some kilobytes."""
        stage_one = found.segmentation
        assert stage_one is not None
        for result, caption in ((found, "The mesh, shaded"), (stage_one, "The points")):
            (image,) = (attrs for tag, attrs in Pieces(result._repr_html_()).elements if tag == "img")
            kind, _, data = (image["src"] or "").partition(";base64,")
            with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
                assert kind == f"data:image/{(picture.format or '').lower()}"
                assert np.ptp(np.asarray(picture.convert("L"))) > 100
            assert len(data) / MEGABYTES < 0.2
            assert (image["alt"] or "").startswith(caption)
            assert result._repr_html_() == result._repr_html_()

    def test_its_frame_can_reach_nothing(self, found: Surface) -> None:
        frame = Pieces(found._repr_html_()).frame
        assert frame["sandbox"] == "allow-scripts"
        assert "src" not in frame
        require_self_contained(frame["srcdoc"] or "")

    def test_names_are_words(self) -> None:
        told = Shown("<script>a</script>", "<b>", [("<i>", '"&')], scene_of_mesh(round_mesh()), '"><img src=x>')
        shown = Pieces(inline(told))
        assert not {tag for tag, _ in shown.elements} & {"script", "b", "i", "img"}
        assert not {tag for tag, _ in Pieces(shown.frame["srcdoc"] or "").elements} & {"b", "i", "img"}

    def test_stays_small(self) -> None:
        mesh = large_mesh(400)
        points = scene_of_points(mesh.vertices, most=MOST)
        for scene in (scene_of_mesh(mesh, most=MOST), points):
            assert 0.8 < len(inline(Shown("a", "b", [], scene))) / MEGABYTES < 2.0
        assert len(points.vertices) <= MOST < len(mesh.vertices)
        assert points.words == "40,000 of 160,000 points are shown."

    def test_a_cloud_tells_its_own_unit(self) -> None:
        made = reconstruct_points(round_mesh().vertices / 1000, units="m")
        shown = made._repr_html_()
        assert "area (m^2)" in shown
        assert "m, as in the points" in shown

    def test_every_result_shows_itself(self, found: Surface) -> None:
        head = phantom(SIZE, VOXEL)
        large = reconstruct_large(head.volume, lower=head.lower, way="voxels", slab=5)
        assert isinstance(large, LargeSurface)
        assert "iframe" not in large._repr_html_()
        assert "the mesh is closed" in large._repr_html_()
        stage_one = found.segmentation
        assert stage_one is not None
        assert Pieces(stage_one._repr_html_()).frame["title"] == "Segmentation in 3-D"

    def test_is_a_table_on_paper(self, found: Surface) -> None:
        """Whatever makes paper of a notebook takes Markdown before plain text."""
        rows = found._repr_markdown_().splitlines()
        assert "the mesh is closed" in rows[0]
        assert f"| faces | {len(found.mesh.faces):,} |" in rows

    def test_is_one_line_where_there_is_no_notebook(self, found: Surface) -> None:
        assert repr(found) == f"Surface(voxels, {len(found.mesh.faces):,} faces, {len(found.mesh.vertices):,} vertices)"
        assert repr(found.segmentation).startswith("Segmentation(voxels, ")
        assert len(repr(found.segmentation)) < 120

    def test_imports_nothing_before(self) -> None:
        loaded = loaded_after("import tomomesh.pipeline")
        assert not {"jinja2", "IPython", "pyvista", "napari"} & loaded

    def test_is_drawn_without_a_server(self, found: Surface, tmp_path: Path) -> None:
        """In a browser, in the frame alone: nothing is asked for, and the notebook's page is out of its reach."""
        file = tmp_path / "notebook.html"
        file.write_text(f"<!DOCTYPE html><meta charset=utf-8><body>{found._repr_html_()}", encoding="utf-8")
        with chromium() as launch:
            watched = Watched(launch(*SOFTWARE), file)
            frame = watched.page.frames[1]
            frame.wait_for_selector("html.drawn")
            assert frame.evaluate("document.querySelector('canvas.view-canvas').width") > 300
            assert frame.evaluate("() => { try { return parent.document.title } catch (e) { return e.name } }") == (
                "SecurityError"
            )
            watched.require_quiet(file)

    def test_its_frame_covers_the_still_picture(self, found: Surface, tmp_path: Path) -> None:
        file = tmp_path / "notebook.html"
        file.write_text(f"<!DOCTYPE html><meta charset=utf-8><body>{found._repr_html_()}", encoding="utf-8")
        with chromium() as launch:
            page = Watched(launch(*SOFTWARE), file).page
            still, frame = (page.locator(name).bounding_box() for name in ("img", "iframe"))
            assert frame["x"] <= still["x"]
            assert frame["y"] <= still["y"]
            assert frame["x"] + frame["width"] >= still["x"] + still["width"] > still["x"] + 100
            assert frame["y"] + frame["height"] >= still["y"] + still["height"] > still["y"] + 100

    def test_a_notebook_keeps_it(self, found: Surface) -> None:
        """As a kernel hands it over: the formatters of IPython take what the result says of itself."""
        formatters = pytest.importorskip("IPython.core.formatters")
        data, _ = formatters.DisplayFormatter().format(found, include=["text/html", "text/markdown"])
        assert data == {"text/html": found._repr_html_(), "text/markdown": found._repr_markdown_()}
        output = nbformat.v4.new_output("display_data", data)  # type: ignore[no-untyped-call]
        assert len(json.dumps(output)) / MEGABYTES < 1.0


class TestHandedOn:
    def test_to_trimesh(self) -> None:
        """Also what trimesh would merge or drop: two vertices in one place, and one that no face has."""
        mesh = TriMesh(
            np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [9, 9, 0.1]]), np.array([[0, 1, 2], [3, 2, 1]])
        )
        given = mesh.to_trimesh()
        np.testing.assert_array_equal(given.vertices, mesh.vertices)
        np.testing.assert_array_equal(given.faces, mesh.faces)
        given.vertices[0] = 7
        assert mesh.vertices[0].tolist() == [0, 0, 0]

    def test_to_pyvista(self, found: Surface) -> None:
        pytest.importorskip("pyvista")
        given = found.mesh.to_pyvista()
        assert given.points.dtype == np.float64
        np.testing.assert_array_equal(given.points, found.mesh.vertices)
        np.testing.assert_array_equal(given.regular_faces, found.mesh.faces)
        assert given.is_manifold
        assert given.volume == pytest.approx(found.mesh.face_volumes.sum())
        given.points[0] = 7
        assert not (found.mesh.vertices[0] == 7).all()

    def test_what_is_not_there_is_told_in_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "pyvista", None)
        with pytest.raises(ResourceError, match=r"pyvista = not installed.*Try: pip install pyvista") as fault:
            round_mesh().to_pyvista()
        assert "\n" not in str(fault.value)


def oblique() -> Volume:
    """Return a study that is turned, of voxels of three sizes, stored in an order of its own."""
    head = phantom(SIZE, VOXEL).volume
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    affine = head.affine.copy()
    affine[:3] = turn @ affine[:3]
    return Volume.from_stored(np.asarray(head.voxels), affine)


class TestNapari:
    def layers(self) -> tuple[Surface, list[tuple[Any, dict[str, Any], str]]]:
        made = reconstruct(oblique(), lower=phantom(SIZE, VOXEL).lower, way="voxels")
        return made, made.to_napari_layers()

    def test_every_layer_lies_in_the_same_world(self) -> None:
        """An index of the image, through its affine, is the place (z, y, x) that the study gives to that voxel."""
        made, ((image, of_image, first), (points, of_points, second), (mesh, of_mesh, third)) = self.layers()
        assert (first, second, third) == ("image", "points", "surface")
        assert isinstance(made.segmentation, Segmentation)
        volume = made.segmentation.volume
        index = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [5, 7, 11]], float)
        world = index @ of_image["affine"][:3, :3].T + of_image["affine"][:3, 3]
        np.testing.assert_allclose(world[:, ::-1], volume.to_mm(index[:, ::-1]), atol=1e-9)
        assert image is volume.voxels
        np.testing.assert_array_equal(points[:, ::-1], made.points.positions)
        np.testing.assert_array_equal(mesh[0][:, ::-1], made.mesh.vertices)
        np.testing.assert_array_equal(mesh[1], made.mesh.faces)
        assert not {"affine", "scale", "translate"} & {*of_points, *of_mesh}

    @pytest.mark.filterwarnings("ignore::DeprecationWarning")  # what napari itself imports warns
    def test_napari_takes_them(self) -> None:
        layers = pytest.importorskip("napari.layers")
        made, given = self.layers()
        image, points, surface = (layers.Layer.create(*one) for one in given)
        assert isinstance(made.segmentation, Segmentation)
        volume = made.segmentation.volume
        np.testing.assert_allclose(image.data_to_world((5, 7, 11))[::-1], volume.to_mm(np.array([[11.0, 7, 5]]))[0])
        assert image.rgb is False
        np.testing.assert_array_equal(surface.vertices[:, ::-1], made.mesh.vertices)
        np.testing.assert_array_equal(surface.faces, made.mesh.faces)
        np.testing.assert_allclose(surface.data_to_world(surface.vertices[3]), surface.vertices[3])
        np.testing.assert_array_equal(points.data[:, ::-1], made.points.positions)

    def test_what_is_not_in_memory_is_left_out(self) -> None:
        head = phantom(SIZE, VOXEL)
        made = reconstruct_once(lambda: (head.volume, None), Settings().replace(lower=head.lower, way="voxels"))
        assert [kind for _, _, kind in made.to_napari_layers()] == ["points", "surface"]
