"""Parts to print: scaled, cut flat, hollowed, drained; judged by trimesh and manifold3d."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from conftest import COMPILED, sphere
from tomomesh import reconstruct_points
from tomomesh.cli import main
from tomomesh.errors import EmptyError, GeometryError, ResourceError, UsageError
from tomomesh.measure.topology import check_promise, topology
from tomomesh.measure.winding import linings, winding_number
from tomomesh.model.mesh import TriMesh
from tomomesh.printing import solids
from tomomesh.printing.flat_base import direction_of
from tomomesh.printing.part import make_part
from tomomesh.settings import Settings
from tomomesh.settings.printing import SIDES

if TYPE_CHECKING:
    from pathlib import Path

manifold3d = pytest.importorskip("manifold3d", reason="the extra print is not installed")
pytestmark = pytest.mark.skipif(not COMPILED, reason="distances on a grid take minutes without the compiler")


def mesh_of(found: trimesh.Trimesh) -> TriMesh:
    return TriMesh(np.array(found.vertices, np.float64), np.array(found.faces, np.int64))


BALL = mesh_of(trimesh.creation.icosphere(4, 20.0))
RING = mesh_of(trimesh.creation.torus(20.0, 6.0, major_sections=96, minor_sections=48))
BOX = mesh_of(trimesh.creation.box((30, 30, 30)))


def part_of(mesh: TriMesh, **options: Any) -> TriMesh:
    return make_part(mesh, Settings().replace(**options)).mesh


def judged(mesh: TriMesh) -> trimesh.Trimesh:
    """Have others judge that a mesh is a closed, consistent solid, also at 32 bits."""
    check_promise(mesh, cavities=linings(mesh))
    narrow = mesh.vertices.astype(np.float32)
    found = trimesh.Trimesh(narrow, mesh.faces, process=True)
    assert len(found.vertices) == len(mesh.vertices)
    assert found.is_watertight
    assert found.is_winding_consistent
    solid = manifold3d.Manifold(manifold3d.Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))
    assert solid.status() == manifold3d.Error.NoError
    assert solid.volume() == pytest.approx(mesh.face_volumes.sum(), rel=1e-9)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


class TestScale:
    def test_is_exact(self) -> None:
        assert (part_of(BALL, scale=0.5).vertices == 0.5 * BALL.vertices).all()

    def test_a_cloud_in_meters_becomes_millimeters(self) -> None:
        part = make_part(BALL, Settings(), unit="m")
        assert part.per_unit == 1000
        assert (part.mesh.vertices == 1000 * BALL.vertices).all()


class TestBase:
    @pytest.mark.parametrize("down", SIDES)
    def test_lies_in_one_plane_and_lowest(self, down: str) -> None:
        part = part_of(BALL, flat_base=4.0, down=down)
        heights = -(part.vertices @ direction_of(down))
        base = np.abs(heights - heights.min()) < 1e-6
        assert len(np.unique(heights[base])) == 1
        assert heights.min() == pytest.approx(-16, abs=0.05)
        assert base.sum() > 20
        assert judged(part).volume == pytest.approx(4 / 3 * np.pi * 20**3 - np.pi * 16 * (20 - 4 / 3), rel=0.01)

    def test_above_the_top_nothing_is_left(self) -> None:
        with pytest.raises(EmptyError, match=r"less than 40"):
            part_of(BALL, flat_base=40.5)


class TestHollow:
    def test_a_ball_has_its_wall_everywhere(self) -> None:
        wall = 2.0
        part = part_of(BALL, hollow=wall)
        assert judged(part).volume == pytest.approx(BALL.face_volumes.sum() - 4 / 3 * np.pi * 18**3, rel=0.02)
        inner = part.vertices[len(BALL.vertices) :]
        _, distance, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(BALL.vertices, BALL.faces), inner[::40])
        assert distance.min() > 1.95
        assert distance.max() < 2.05

    def test_a_ring_keeps_its_handle_inside_too(self) -> None:
        part = part_of(RING, hollow=2.0)
        expected = RING.face_volumes.sum() - 2 * np.pi**2 * 20 * 4**2
        assert judged(part).volume == pytest.approx(expected, rel=0.02)
        assert topology(part, cavities=1).genus == 2

    def test_the_outer_side_stays_as_it_is(self) -> None:
        part = part_of(BOX, hollow=3.0)
        assert (part.faces[: len(BOX.faces)] == BOX.faces).all()
        assert (part.vertices[: len(BOX.vertices)] == BOX.vertices).all()

    def test_in_a_ball_in_a_ball_only_what_is_solid_is_hollowed(self) -> None:
        room = BALL.moved(0.7 * BALL.vertices)
        shell = TriMesh(
            np.concatenate([BALL.vertices, room.vertices]),
            np.concatenate([BALL.faces, room.faces[:, ::-1] + len(BALL.vertices)]),
        )
        part = part_of(shell, hollow=1.5)
        assert linings(part) == 2
        cut = 4 / 3 * np.pi * (18.5**3 - 15.5**3)
        assert judged(part).volume == pytest.approx(shell.face_volumes.sum() - cut, rel=0.02)

    def test_is_refused_where_there_is_no_room(self) -> None:
        with pytest.raises(EmptyError, match="no room for a cavity") as refused:
            part_of(BALL, hollow=19.9)
        assert refused.value.exit_code == 6

    def test_is_refused_where_the_grid_would_be_too_fine(self) -> None:
        with pytest.raises(ResourceError, match=r"about 0\.2"):
            part_of(BALL, hollow=0.02)

    def test_the_same_bytes_on_any_number_of_threads(self) -> None:
        options = {"hollow": 2.0, "flat_base": 3.0, "drain": 4.0}
        one, many = (part_of(RING, **options, threads=threads) for threads in (1, 4))
        assert one.vertices.tobytes() == many.vertices.tobytes()
        assert one.faces.tobytes() == many.faces.tobytes()


class TestDrain:
    def test_opens_the_cavity_through_its_floor(self) -> None:
        closed = part_of(BOX, hollow=2.0)
        part = part_of(BOX, hollow=2.0, drain=6.0)
        assert linings(part) == 0
        assert topology(part).genus == 0
        hole = 24 * 9 * np.sin(np.pi / 24) * 2.0  # a cylinder of 48 sides through 2 mm
        assert judged(closed).volume - judged(part).volume == pytest.approx(hole, rel=0.02)

    def test_a_hole_as_wide_as_the_part_is_refused(self) -> None:
        with pytest.raises(UsageError, match="too wide for the part"):
            part_of(BOX, hollow=2.0, drain=0.6 * float(np.ptp(BOX.vertices, axis=0).min()))

    def test_does_nothing_where_nothing_is_hollow(self) -> None:
        assert part_of(BOX, drain=3.0).faces.tobytes() == BOX.faces.tobytes()


PLATE = mesh_of(trimesh.creation.box((20, 20, 0.3)).subdivide().subdivide().subdivide())
"""A wall of .3 mm."""
GRAIN = mesh_of(trimesh.creation.icosphere(2, 1.0).apply_translation([0, 0, 25]))


def together(*meshes: TriMesh) -> TriMesh:
    return mesh_of(trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes]))


def verdict_of(mesh: TriMesh, **options: Any) -> dict[str, Any]:
    return make_part(mesh, Settings().replace(**options)).report


class TestCures:
    """Beside each reason stands an option; with it the reason is gone."""

    @pytest.mark.parametrize(
        ("mesh", "reason"),
        [
            (PLATE, "--thicken 0.8"),
            (mesh_of(trimesh.creation.cone(5, 20, sections=64)), "--thicken 0.8"),
            (mesh_of(trimesh.creation.torus(10.0, 0.2, major_sections=96, minor_sections=24)), "--thicken 0.8"),
            (together(BALL, GRAIN), "--one-piece"),
        ],
        ids=["plate", "cone", "wire", "grain"],
    )
    def test_the_option_that_is_named_mends_it(self, mesh: TriMesh, reason: str) -> None:
        told = verdict_of(mesh, print_check=True)
        assert not told["printable"]
        assert [f"({reason})" in why for why in told["reasons"]] == [True]
        name, *value = reason.removeprefix("--").split()
        mended = make_part(mesh, Settings().replace(**{name.replace("-", "_"): float(value[0]) if value else True}))
        judged(mended.mesh)
        assert mended.report["printable"], mended.report["reasons"]

    def test_what_a_cut_leaves_thin_is_thickened_above_the_base(self) -> None:
        """A cap of .4 mm, as the low end of a skull's shell is; and a ball, whose foot is not thin, stays as it was."""
        told = verdict_of(BALL, flat_base=39.6)
        assert [why.rsplit("(")[-1] for why in told["reasons"]] == ["--thicken 0.8)"]
        part = make_part(BALL, Settings().replace(flat_base=39.6, thicken=0.8))
        judged(part.mesh)
        assert part.report["printable"], part.report["reasons"]
        assert part.mesh.vertices[:, 2].min() == pytest.approx(BALL.vertices[:, 2].max() - 0.4, abs=1e-6)
        assert part.report["base_area_mm2"] > told["base_area_mm2"] > 0
        plain, thick = (part_of(BALL, flat_base=1.0, **more) for more in ({}, {"thicken": 0.8}))
        assert plain.vertices.tobytes() == thick.vertices.tobytes()

    def test_what_is_smaller_than_a_wall_cannot_be_printed(self) -> None:
        told = verdict_of(BALL, scale=0.0045)
        assert told["reasons"] == ["0.18 mm long, it is smaller than the printer's thinnest wall (--scale)"]
        assert not told["printable"]
        assert not any("smaller" in note for note in told["notes"])
        assert verdict_of(BALL, scale=0.0045 * 50)["printable"]

    def test_a_plate_grows_on_both_sides_alike(self) -> None:
        low, high = (getattr(part_of(PLATE, thicken=0.8).vertices, end)(axis=0) for end in ("min", "max"))
        np.testing.assert_allclose(low, -high, atol=0.1)
        assert 0.8 <= high[2] - low[2] <= 1.4

    def test_what_is_thick_stays_as_it_is(self) -> None:
        np.testing.assert_array_equal(part_of(BALL, thicken=0.8).vertices, BALL.vertices)

    def test_cavities_are_filled_with_what_floats_in_them(self) -> None:
        nested = together(BALL, turned_over(scaled(BALL, 0.6)), scaled(BALL, 0.3), GRAIN)
        filled = part_of(nested, fill_cavities=True)
        assert topology(filled).components == 2
        judged(filled)
        one = part_of(nested, one_piece=True)
        assert (topology(one, cavities=1).components, linings(one)) == (2, 1)

    def test_the_deepest_place_is_told_of_a_wall_too_thick(self) -> None:
        with pytest.raises(EmptyError, match=r"about (19(\.\d*)?|20) mm from a face"):
            part_of(BALL, hollow=200.0)

    @pytest.mark.parametrize(
        ("options", "note"),
        [
            ({"drain": 2.0}, "no cavity to drain: --hollow makes one"),
            ({"scale": 300.0}, "12 m long, it is larger than printers are"),
            ({"scale": 0.05}, "smaller than a printer resolves"),
        ],
    )
    def test_what_is_likely_not_meant_is_noted_once(self, options: dict[str, Any], note: str) -> None:
        notes = verdict_of(BALL, **options)["notes"]
        assert sum(note in one for one in notes) == 1
        assert not any(note in one for one in verdict_of(BALL, print_check=True)["notes"])


def turned_over(mesh: TriMesh) -> TriMesh:
    return TriMesh(mesh.vertices, mesh.faces[:, ::-1])


def scaled(mesh: TriMesh, factor: float) -> TriMesh:
    return mesh.moved(factor * mesh.vertices)


class TestVerdict:
    def test_a_thick_shell_on_a_flat_base_can_be_printed(self) -> None:
        told = make_part(BOX, Settings().replace(hollow=2.0, drain=6.0)).report
        assert told["printable"]
        assert told["reasons"] == told["notes"] == []
        assert told["thinnest_wall_mm"] == pytest.approx(2, rel=0.01)
        assert told["size_mm"] == [30, 30, 30]
        assert told["base_area_mm2"] == pytest.approx(900 - 28.2, rel=0.001)

    def test_a_thin_wall_cannot(self) -> None:
        told = make_part(BOX, Settings().replace(hollow=1.0, least_wall=1.5)).report
        assert not told["printable"]
        assert told["reasons"][0].startswith("thinnest wall 1 mm at (")
        assert told["thin_wall_share"] > 0.9
        assert "sealed" in told["notes"][0]

    def test_what_floats_cannot(self) -> None:
        both = trimesh.util.concatenate([trimesh.creation.box((9, 9, 9)), trimesh.creation.box((3, 3, 3))])
        above = mesh_of(both)
        above.vertices[8:] += [20, 0, 2]
        told = make_part(above, Settings()).report
        assert (told["pieces"], told["floating_pieces"]) == (2, 1)
        assert told["reasons"] == ["1 of 2 pieces float free of the plate (--one-piece)"]

    def test_overhang_is_what_faces_down_more_than_45_degrees(self) -> None:
        steep, blunt = (mesh_of(trimesh.creation.cone(radius, 20.0, sections=256)) for radius in (19.0, 21.0))
        shares = []
        for cone in (steep, blunt):
            on_tip = TriMesh(-cone.vertices, cone.faces[:, ::-1])
            shares.append(make_part(on_tip, Settings()).report["overhang_share"])
        assert shares[0] == 0
        assert shares[1] == pytest.approx(np.hypot(20, 21) / (np.hypot(20, 21) + 21), rel=1e-3)


class TestRefusals:
    def test_an_open_mesh(self) -> None:
        with pytest.raises(GeometryError, match="boundary_edges = 3"):
            part_of(TriMesh(BOX.vertices, BOX.faces[1:]), scale=2.0)

    def test_a_sheet(self) -> None:
        with pytest.raises(UsageError, match="--open"):
            reconstruct_points(sphere(50), open=True, print_check=True)

    def test_without_the_package_it_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(solids, "find_spec", lambda name: None)
        with pytest.raises(UsageError, match=r"tomomesh\[print\]"):
            part_of(BOX, hollow=2.0)
        assert len(part_of(BOX, scale=2.0).faces) == 12


def test_winding_number_of_a_ball() -> None:
    assert winding_number(BALL, np.array([3.0, 4.0, 12.0])) == pytest.approx(1)
    assert winding_number(BALL, np.array([30.0, 0.0, 0.0])) == pytest.approx(0, abs=1e-12)


class TestCommands:
    def test_print_writes_a_part_and_its_verdict(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        trimesh.Trimesh(BOX.vertices, BOX.faces).export(tmp_path / "box.stl")
        told = ["--hollow", "2", "--drain", "5", "--report", str(tmp_path / "r.json")]
        assert main(["print", str(tmp_path / "box.stl"), "-o", str(tmp_path / "part.stl"), *told]) == 0
        assert "printable yes" in capsys.readouterr().out
        assert json.loads((tmp_path / "r.json").read_text())["print"]["sealed_cavities"] == 0
        assert trimesh.load(tmp_path / "part.stl").is_watertight

    def test_check_tells_whether_a_mesh_can_be_printed(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        trimesh.Trimesh(BOX.vertices, BOX.faces[1:]).export(tmp_path / "open.stl")
        assert main(["check", str(tmp_path / "open.stl"), "--print"]) == 0
        assert "printable no: it is not closed and manifold: 3 boundary edges" in capsys.readouterr().out

    def test_surface_writes_the_part_and_measures_the_surface(self, tmp_path: Path) -> None:
        np.save(tmp_path / "ball.npy", sphere(2000, 10.0))
        report = tmp_path / "r.json"
        options = ["--scale", "2", "--flat-base", "3", "--report", str(report), "--quiet"]
        assert main(["surface", str(tmp_path / "ball.npy"), "-o", str(tmp_path / "ball.ply"), *options]) == 0
        told = json.loads(report.read_text())
        assert told["quality"]["points_to_surface_max_mm"] < 0.2
        assert told["print"]["size_mm"] == pytest.approx([40, 40, 37], abs=0.3)
        written = trimesh.load(tmp_path / "ball.ply")
        assert np.ptp(written.vertices[:, 2]) == pytest.approx(told["print"]["size_mm"][2])

    def test_nothing_is_judged_where_it_was_not_asked_for(self) -> None:
        assert "print" not in reconstruct_points(sphere(500)).report
