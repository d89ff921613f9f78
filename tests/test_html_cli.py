"""--html on every command that has it: a page beside the result, refused before any work where it cannot be."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest

from batches import ball, batch
from conftest import sphere
from html_pages import Apart, require_self_contained
from test_show import round_mesh
from tomomesh import TriMesh, io
from tomomesh.cli import main
from tomomesh.html.document import MOST

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

LARGEST = 3_000_000
"""Bytes of the demonstration's page."""


def page_at(path: Path) -> Apart:
    return require_self_contained(path.read_text(encoding="utf-8"))


def shown(found: Apart) -> list[str]:
    """Return what the pictures of a page show."""
    return [attrs["alt"] or "" for tag, attrs in found.elements if tag == "img"]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "s.nii"
    nibabel.save(nibabel.Nifti1Image(ball(24), np.eye(4)), path)
    return path


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "m&amp;<b>.ply"
    io.write_mesh(round_mesh(), path)
    return path


@pytest.mark.parametrize("way", ["ring", "contours", "paper"])
def test_a_page_shows_how_a_slice_was_learned(study: Path, tmp_path: Path, way: str) -> None:
    pages = []
    for name in ("a.html", "b.html"):
        words = ["reconstruct", str(study), "--way", way, "-o", str(tmp_path / "m.stl"), "--html", str(tmp_path / name)]
        assert main([*words, "--allow-far", "--quiet"]) == 0
        pages.append(page_at(tmp_path / name))
    assert any("while it is trained" in one for one in shown(pages[0]))
    assert [one for one in pages[0].elements if one[0] == "img"] == [
        one for one in pages[1].elements if one[0] == "img"
    ]


def test_the_demonstration_has_a_page_of_three_megabytes_at_most(tmp_path: Path) -> None:
    assert main(["demo", "-o", str(tmp_path / "d"), "--html", str(tmp_path / "page.html"), "--quiet"]) == 0
    assert not (tmp_path / "d" / "report.html").exists()
    assert (tmp_path / "page.html").stat().st_size <= LARGEST
    found = page_at(tmp_path / "page.html")
    told = " ".join(shown(found))
    for word in ("shaded", "outline of the mesh", "while it is trained", "came to rest", "The points"):
        assert word in told
    assert [tag for tag, attrs in found.elements if attrs.get("class") == "histogram"] == ["svg"]
    report = json.loads((tmp_path / "d" / "report.json").read_text())
    assert f"{report['quality']['area_mm2']:.6g}" in found.text
    assert "truth     error: mean" in found.text


class TestReconstruct:
    def test_the_same_command_gives_the_same_page(self, study: Path, tmp_path: Path) -> None:
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--html", str(tmp_path / "m.html"), "--quiet"]
        pages = []
        for _ in range(2):
            assert main(line) == 0
            pages.append((tmp_path / "m.html").read_bytes())
        assert pages[0] == pages[1]
        found = page_at(tmp_path / "m.html")
        assert f"--html {tmp_path / 'm.html'}" in found.text

    def test_the_mesh_is_that_without_a_page(self, study: Path, tmp_path: Path) -> None:
        meshes = []
        for more in ([], ["--html", str(tmp_path / "m.html")]):
            assert main(["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--quiet", *more]) == 0
            meshes.append((tmp_path / "m.ply").read_bytes())
        assert meshes[0] == meshes[1]

    def test_labels_have_no_histogram(self, study: Path, tmp_path: Path) -> None:
        page = tmp_path / "l.html"
        labels = tmp_path / "l.nii"
        nibabel.save(nibabel.Nifti1Image((ball(24) > 0).astype(np.uint8), np.eye(4)), labels)
        line = ["reconstruct", str(labels), "--select", "1", "-o", str(tmp_path / "m.ply"), "--quiet"]
        assert main([*line, "--html", str(page)]) == 0
        assert "svg" not in {tag for tag, _ in page_at(page).elements}

    @pytest.mark.parametrize(("name", "code", "words"), [("p.txt", 2, "no writer"), ("none/p.html", 8, "is missing")])
    def test_what_cannot_be_is_refused_before_any_work(
        self, study: Path, tmp_path: Path, capsys: CaptureFixture[str], name: str, code: int, words: str
    ) -> None:
        before = sorted(tmp_path.iterdir())
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--html", str(tmp_path / name)]
        assert main(line) == code
        assert words in capsys.readouterr().err
        assert sorted(tmp_path.iterdir()) == before

    def test_no_input_is_overwritten(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = tmp_path / "m.html"
        path.write_text("a mesh")
        assert main(["check", str(path), "--html", str(path)]) == 2
        assert "the output is the input" in capsys.readouterr().err
        assert path.read_text() == "a mesh"

    def test_slabs_have_none(self, study: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--html", str(tmp_path / "m.html")]
        assert main([*line, "--slab", "8"]) == 2
        assert "--html" in capsys.readouterr().err


class TestOfAMesh:
    def test_check_shows_where_it_is_open(self, tmp_path: Path) -> None:
        whole, path, page = round_mesh(), tmp_path / "m.ply", tmp_path / "m.html"
        io.write_mesh(TriMesh(whole.vertices, whole.faces[3:]), path)
        assert main(["check", str(path), "--html", str(page), "--print", "--json"]) == 0
        found = page_at(page)
        assert "Not good to use" in found.text
        assert "it cannot be printed" in found.text
        assert any(attrs.get("class") == "fly" for _, attrs in found.elements)

    def test_a_name_is_only_a_name(self, mesh: Path, tmp_path: Path) -> None:
        assert main(["check", str(mesh), "--html", str(tmp_path / "p.html"), "--json"]) == 0
        found = page_at(tmp_path / "p.html")
        assert found.text.count(mesh.name) >= 3
        assert "b" not in {tag for tag, _ in found.elements}

    def test_print_shows_the_part(self, mesh: Path, tmp_path: Path) -> None:
        page = tmp_path / "p.html"
        assert main(["print", str(mesh), "-o", str(tmp_path / "p.stl"), "--html", str(page), "--quiet"]) == 0
        assert "it can be printed" in page_at(page).text

    def test_surface_tells_of_its_cloud(self, tmp_path: Path) -> None:
        np.savetxt(tmp_path / "c.xyz", sphere(1500, 30.0))
        page = tmp_path / "c.html"
        assert (
            main(["surface", str(tmp_path / "c.xyz"), "-o", str(tmp_path / "c.ply"), "--html", str(page), "--quiet"])
            == 0
        )
        found = page_at(page)
        assert "Good to use" in found.text
        assert "as in the points" in found.text

    def test_a_large_mesh_is_decimated_and_says_so(self, tmp_path: Path) -> None:
        page, path = tmp_path / "g.html", tmp_path / "g.ply"
        steps = np.arange(180)
        x, y = np.meshgrid(steps, steps, indexing="ij")
        corner = (steps[:-1, None] * len(steps) + steps[:-1]).reshape(-1, 1)
        faces = (corner + np.array([0, len(steps), 1, 1, len(steps), len(steps) + 1])).reshape(-1, 3)
        io.write_mesh(TriMesh(np.stack([x, y, np.sin(x / 9)], axis=-1).reshape(-1, 3), faces), path)
        assert main(["check", str(path), "--html", str(page), "--json"]) == 0
        few, whole = re.findall(r"([\d,]+) faces stand for the ([\d,]+)", page_at(page).text)[0]
        assert int(few.replace(",", "")) <= MOST < int(whole.replace(",", "")) == len(faces)


class TestMany:
    @pytest.fixture
    def folder(self, tmp_path: Path, study: Path) -> Path:
        folder = tmp_path / "in"
        folder.mkdir()
        (folder / "broken.nii").write_bytes(study.read_bytes()[:400])
        study.rename(folder / "a b.nii")
        return folder

    def test_each_has_a_page_and_the_index_leads_to_it(self, folder: Path, tmp_path: Path) -> None:
        for page in (tmp_path / "out" / "index.html", tmp_path / "index.html"):
            assert batch(folder, "out", "--html", str(page), "--quiet") == 10
            found = page_at(page)
            (link,) = [attrs["href"] or "" for tag, attrs in found.elements if tag == "a"]
            page_at(page.parent / link)
            assert "1 of 2 were made, 1 failed" in found.text

    def test_what_was_finished_without_a_page_gets_one(self, folder: Path, tmp_path: Path) -> None:
        assert batch(folder, "out", "--quiet") == 10
        assert not (tmp_path / "out" / "a_b.html").exists()
        assert batch(folder, "out", "--html", str(tmp_path / "i.html"), "--quiet") == 10
        first = (tmp_path / "out" / "a_b.html").stat().st_mtime_ns
        assert batch(folder, "out", "--html", str(tmp_path / "i.html"), "--quiet") == 10
        assert (tmp_path / "out" / "a_b.html").stat().st_mtime_ns == first

    def test_the_index_takes_no_study_s_name(self, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        assert batch(folder, "out", "--html", str(tmp_path / "out" / "a_b.html")) == 2
        assert "a study's own page" in capsys.readouterr().err
        assert not (tmp_path / "out").exists()

    def test_every_label_has_a_page(self, tmp_path: Path) -> None:
        labels = np.where(np.indices((20, 20, 40))[2] < 20, 1, 2) * np.tile(ball(20) > 0, (1, 1, 2))
        nibabel.save(nibabel.Nifti1Image(labels.astype(np.uint8), np.eye(4)), tmp_path / "l.nii")
        line = ["reconstruct", str(tmp_path / "l.nii"), "--each-label", "-o", str(tmp_path / "out"), "--quiet"]
        assert main([*line, "--html", str(tmp_path / "out" / "index.html")]) == 0
        links = [attrs["href"] for tag, attrs in page_at(tmp_path / "out" / "index.html").elements if tag == "a"]
        assert links == ["label-0001.html", "label-0002.html"]
        for link in links:
            assert len(shown(page_at(tmp_path / "out" / str(link)))) > 3
