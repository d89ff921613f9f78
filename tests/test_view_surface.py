"""What is made in the page is what the command line makes: the very bytes."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from conftest import sphere
from pages import ENDLESS, Page, served
from studies import write_nifti
from test_show import round_mesh
from tomomesh import TriMesh, phantom, read_mesh
from tomomesh.cli import main
from tomomesh.measure.section import section
from tomomesh.view import coloring, surfaces
from tomomesh.view.opened import Opened
from tomomesh.view.session import Session

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tomomesh.progress import Progress

HEAD = phantom((14, 40, 40), (6.0, 6.0, 11.0))


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "head.nii"
    write_nifti(path, np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    return path


@pytest.fixture(scope="module")
def page(study: Path) -> Iterator[Page]:
    with served(study, "--lower", str(HEAD.lower)) as page:
        page.enter()
        page.ready()
        yield page


@pytest.fixture(scope="module")
def made(page: Page) -> Page:
    page.state("/api/choose", {"neurons": 40, "upper": 255.0})
    first, second = page.state("/api/reconstruct", {}), page.state("/api/reconstruct", {})
    assert first["job"]["job"] == second["job"]["job"]  # a second click is no second run
    assert page.ready()["made"] == {"reconstruct": True}
    return page


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".vtp"])
def test_the_saved_mesh_is_the_command_lines(made: Page, tmp_path: Path, suffix: str) -> None:
    status, headers, data = made.ask(f"/save/mesh{suffix}")
    assert status == 200
    assert headers["content-disposition"] == f'attachment; filename="mesh{suffix}"'
    words = shlex.split(made.state()["command"])[1:]
    words[words.index("-o") + 1] = str(tmp_path / f"mesh{suffix}")
    assert main([*words, "--quiet"]) == 0
    assert (tmp_path / f"mesh{suffix}").read_bytes() == data


def test_points_mask_and_settings_are_the_command_lines(made: Page, tmp_path: Path) -> None:
    words = shlex.split(made.state()["command"])[1:]
    words[words.index("-o") + 1] = str(tmp_path / "mesh.ply")
    names = {"points.ply": "--points", "mask.nii.gz": "--mask-out", "labels.nii.gz": "--labels"}
    wanted = [word for name, option in names.items() for word in (option, str(tmp_path / name))]
    assert main([*words, *wanted, "--save-settings", str(tmp_path / "settings.toml"), "--quiet"]) == 0
    for name in (*names, "settings.toml"):
        assert made.ask(f"/save/{name}")[2] == (tmp_path / name).read_bytes(), name


def test_the_report_leads_to_its_stages(made: Page) -> None:
    assert made.state("/api/report")["report"]["quality"]["closed"] is True
    stages = made.state("/api/stages")["stages"]
    assert [one["name"] for one in stages] == ["points", "cubes", "cuberille", "triangulated", "smoothed", "fitted"]
    for stage in stages:
        status, _, data = made.ask(f"/mesh/{stage['name']}")
        assert status == 200
        length = int.from_bytes(data[:4], "little")
        header = json.loads(data[4 : 4 + length])
        times = {"cubes": 12, "cuberille": 2}.get(stage["name"], 1)
        assert times * stage["faces"] == header["vertices" if stage["name"] == "points" else "faces"]


@pytest.mark.parametrize("color", ["distance", "thickness", "filled"])
def test_colors_are_numbers_at_the_vertices(made: Page, color: str) -> None:
    status, _, data = made.ask(f"/mesh/fitted?color={color}")
    assert status == 200
    header = json.loads(data[4 : 4 + int.from_bytes(data[:4], "little")])
    values = np.frombuffer(data[-4 * header["vertices"] :], "<f4")
    assert header["values"][0]["name"] == color
    known = values[np.isfinite(values)]
    assert len(known) > 0.5 * len(values)
    assert known.min() >= 0


@pytest.mark.parametrize(("plane", "axis"), [("axial", 2), ("coronal", 1), ("sagittal", 0)])
def test_the_outline_lies_where_the_plane_cuts_the_mesh(made: Page, tmp_path: Path, plane: str, axis: int) -> None:
    k = HEAD.volume.shape[::-1][axis] // 2
    _, headers, data = made.ask(f"/outline/{plane}/{k}")
    ends = np.frombuffer(data, "<f4").reshape([*map(int, headers["x-shape"].split(","))])
    path = tmp_path / "mesh.ply"
    path.write_bytes(made.ask("/save/mesh.ply")[2])
    mesh = read_mesh(path)
    across = [n for n in range(3) if n != axis]
    places = HEAD.volume.to_indices(mesh.vertices)[:, [*across, axis]]
    np.testing.assert_allclose(ends, section(mesh.moved(places), float(k)), atol=1e-3)
    where = made.state(f"/api/place/{plane}/{k}")
    index = np.full(3, 3.0)
    index[axis] = k
    place = HEAD.volume.affine[:3, :3] @ index + HEAD.volume.affine[:3, 3]
    assert np.dot(where["normal"], place) == pytest.approx(where["offset"])


def test_what_there_is_not(made: Page) -> None:
    for path in ("/mesh/none", "/save/mesh.exe", "/save/../x", "/outline/oblique/3", "/mesh/fitted?color=none"):
        assert made.ask(path)[0] in (400, 404)


def test_what_colors_is_measured_beside_the_page(made: Page) -> None:
    made.state("/api/color", {"color": "thickness"})
    made.ready()
    assert made.state("/api/color", {"color": "thickness"}) == {"ready": True}
    assert made.ask("/api/color", {"color": "none"})[0] == 200  # it fails as work does, beside the page
    assert "no such colors" in made.ready()["failed"]["error"]


def test_measuring_can_be_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(Opened("mesh", ("ball.ply",), mesh=round_mesh()))

    def endless(mesh: TriMesh, *, progress: Progress) -> None:
        while True:
            progress("walls", 0, 1)

    monkeypatch.setattr(coloring, "walls_of", endless)
    assert surfaces._color(session, {"color": "thickness"}) == {"ready": False, "job": 1}
    job = session.jobs.now
    assert job is not None
    session.jobs.stop()
    assert job.thread is not None
    job.thread.join()
    assert session.jobs.now is None
    assert not coloring.is_measured(session, surfaces.mesh_of(session), "thickness")


def test_stopped_work_leaves_nothing(study: Path) -> None:
    with served(study, "--lower", str(HEAD.lower), *ENDLESS) as page:
        page.enter()
        page.ready()
        page.state("/api/reconstruct", {})
        page.state("/api/cancel", {})
        assert "reconstruct" not in page.ready()["made"]
        assert page.ask("/api/report")[0] == 400


def test_a_broken_study_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "broken.nii").write_bytes(b"no study" * 99)
    with served(tmp_path / "broken.nii") as page:
        page.enter()
        while page.state()["job"] is not None:
            pass
        state = page.state()
        assert state["opened"]["ready"] is False
        assert "broken.nii" in state["opened"]["refused"]
        assert state["opened"]["refused"].count("\n") == 0
        assert page.ask("/api/reconstruct", {})[0] == 400


def test_a_surface_that_fails_says_what_helps(tmp_path: Path) -> None:
    """And goes on saying so to a page that comes later; what helps is a choice like others."""
    points = sphere(1500)
    np.savetxt(tmp_path / "half.xyz", points[points[:, 2] > 0])
    with served(tmp_path / "half.xyz") as page:
        page.enter()
        page.ready()
        page.state("/api/reconstruct", {})
        failed = page.ready()["failed"]
        assert (failed["event"], failed["name"]) == ("failed", "reconstruct")
        assert failed["flags"] == ["--fill-holes", "--open", "--allow-leaks"]
        [[place, _]] = failed["places"]
        assert np.linalg.norm(place) < 0.05 * np.linalg.norm(points[0])  # the middle of the hemisphere's rim
        page.state("/api/choose", {"fill_holes": True})
        page.state("/api/reconstruct", {})
        assert page.ready()["failed"] is None
        assert page.state("/api/report")["report"]["quality"]["closed"] is True
