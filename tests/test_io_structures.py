"""RT Structure Sets in: contours of known solids come back as those solids."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydicom.dataelem import DataElement, RawDataElement
from pydicom.tag import Tag

from structure_sets import circle, keyhole, sphere, structure_set, torus, written
from studies import rotation, save
from test_cli import fails
from tomomesh.cli import main
from tomomesh.errors import EmptyError, GeometryError, UsageError
from tomomesh.io import read_points
from tomomesh.pipeline import reconstruct_points
from tomomesh.settings import CloudSettings

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

    from structure_sets import Contours, Floats
    from tomomesh.results import Surface

BALL, TORUS = 4 / 3 * np.pi * 20**3, 2 * np.pi**2 * 20 * 8**2
EVEN = sphere(20, 2.5)
CONTOUR_DATA = Tag(0x3006, 0x0050)


def surface_of(folder: Path, contours: Any, kind: str = "CLOSED_PLANAR") -> Surface:
    surface = reconstruct_points(read_points(written({"one": contours}, folder / "plan.dcm", kind)))
    assert surface.report["quality"]["sound"]
    assert surface.report["quality"]["self_intersections"] == 0
    return surface


class TestSpelling:
    """Decimal strings as programs write them."""

    @pytest.mark.parametrize("spelled", [" {:.3f}", "{:.3f} ", "{:+.3f}", "{:.6E}", "{:.3f}\n"])
    @pytest.mark.parametrize("end", ["", "\\", "\0"])
    def test_corners_are_their_numbers(self, tmp_path: Path, spelled: str, end: str) -> None:
        data = structure_set({"one": EVEN})
        for contour in data.ROIContourSequence[0].ContourSequence:
            text = "\\".join(spelled.format(value) for value in contour.ContourData) + end
            packed = text.encode() + b" " * (len(text) % 2)
            contour._dict[CONTOUR_DATA] = RawDataElement(CONTOUR_DATA, "DS", len(packed), packed, 0, False, True)
        found = read_points(save(data, tmp_path / "spelled.dcm"))
        plain = read_points(written({"one": EVEN}, tmp_path / "plain.dcm"))
        np.testing.assert_allclose(found.positions, plain.positions, rtol=0, atol=1e-3)

    @pytest.mark.filterwarnings("ignore:Invalid value for VR CS")
    def test_kinds_in_small_letters_are_kinds(self, tmp_path: Path) -> None:
        found = read_points(written({"one": EVEN}, tmp_path / "small.dcm", "closed_planar"))
        plain = read_points(written({"one": EVEN}, tmp_path / "plain.dcm"))
        np.testing.assert_array_equal(found.positions, plain.positions)

    def test_what_there_is_in_place_of_closed_contours_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(EmptyError, match=f"{len(EVEN)} OPEN_NONPLANAR"):
            read_points(written({"one": EVEN}, tmp_path / "open.dcm", "OPEN_NONPLANAR"))


class TestThickness:
    """One contour alone as a slab, thin or thick beside its width."""

    @pytest.mark.parametrize("thickness", [0.5, 3.0, 30.0, 60.0])
    @pytest.mark.parametrize("name", ["circle", "square", "ring"])
    def test_volume(self, tmp_path: Path, name: str, thickness: float) -> None:
        corners = np.array([[-10.0, -10, 3], [10, -10, 3], [10, 10, 3], [-10, 10, 3]])
        drawn, area = {
            "circle": ([circle(12.0, 3.0)], np.pi * 144),
            "square": ([corners], 400.0),
            "ring": ([circle(12.0, 3.0), circle(6.0, 3.0)], np.pi * 108),
        }[name]
        settings = CloudSettings(thickness=thickness)
        points = read_points(written({"one": drawn}, tmp_path / "plan.dcm"), settings=settings)
        report = reconstruct_points(points, thickness=thickness).report
        assert report["quality"]["volume_mm3"] == pytest.approx(area * thickness, rel=0.04)

    @pytest.mark.parametrize("count", [6, 8, 72])
    def test_few_points_are_enough(self, count: int) -> None:
        turn = 2 * np.pi * np.arange(count) / count
        ring = np.column_stack([10 * np.cos(turn), 10 * np.sin(turn), np.zeros(count)])
        report = reconstruct_points(ring, thickness=40.0).report
        assert report["quality"]["volume_mm3"] == pytest.approx(np.pi * 4000, rel=0.02)


class TestTruth:
    @pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.5, -0.7, 0.3), (np.pi / 2, 0.0, 0.0), (0.0, 1.4, 0.0)])
    def test_a_sphere_in_planes_of_any_direction(self, tmp_path: Path, turn: tuple[float, float, float]) -> None:
        turned, center = rotation(*turn), np.array([100.0, -50.0, 30.0])
        surface = surface_of(tmp_path, [contour @ turned.T + center for contour in EVEN])
        quality, away = surface.report["quality"], surface.mesh.vertices - center
        assert quality["volume_mm3"] == pytest.approx(BALL, rel=0.025)
        assert quality["genus"] == 0
        radius = np.linalg.norm(away, axis=1)
        between = np.abs(away @ turned[:, 2]) < 18
        assert np.abs(radius[between] - 20).max() < surface.report["stack"]["voxel_mm"] / 2
        assert np.abs(away.mean(axis=0)).max() < 0.1

    @pytest.mark.parametrize("kind", ["CLOSED_PLANAR", "CLOSEDPLANAR_XOR", "keyhole"])
    def test_a_torus_keeps_its_hole(self, tmp_path: Path, kind: str) -> None:
        if kind == "keyhole":
            surface = surface_of(tmp_path, [keyhole(outer, inner) for outer, inner in torus()])
        else:
            surface = surface_of(tmp_path, [one for pair in torus() for one in pair], kind)
        quality = surface.report["quality"]
        assert quality["genus"] == 1
        assert quality["components"] == 1
        assert quality["volume_mm3"] == pytest.approx(TORUS, rel=0.025)

    def test_an_upright_torus_branches_and_merges(self, tmp_path: Path) -> None:
        heights = np.arange(-27.0, 28.0, 2.0)
        surface = surface_of(tmp_path, [one for z in heights.tolist() for one in upright_torus(z)])
        assert surface.report["quality"]["genus"] == 1
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(TORUS, rel=0.025)

    def test_two_components_side_by_side(self, tmp_path: Path) -> None:
        surface = surface_of(tmp_path, sphere(12, 2, (-12.5, 0, 0)) + sphere(12, 2, (12.5, 0, 0)))
        assert surface.report["quality"]["components"] == 2
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(2 * BALL * 0.6**3, rel=0.025)

    def test_an_island_within_a_hole(self, tmp_path: Path) -> None:
        rings = [circle(radius, z) for z in np.arange(0.0, 20, 2).tolist() for radius in (30.0, 22.0, 14.0)]
        surface = surface_of(tmp_path, rings)
        assert surface.report["quality"]["components"] == 2
        middle = np.abs(surface.mesh.vertices[:, 2] - 9) < 6
        radius = np.linalg.norm(surface.mesh.vertices[middle, :2], axis=1)
        assert np.abs(radius[:, None] - (30, 22, 14)).min(axis=1).max() < 0.2

    def test_four_corners_are_a_square(self, tmp_path: Path) -> None:
        square = np.array([[-20.0, -10.0], [20, -10], [20, 10], [-20, 10]])
        points = read_points(
            written({"box": [np.column_stack([square, np.full(4, z)]) for z in (0.0, 3, 6, 9, 12)]}, tmp_path / "p.dcm")
        )
        mesh = reconstruct_points(points).mesh
        middle = mesh.vertices[np.abs(mesh.vertices[:, 2] - 6) < 3]
        np.testing.assert_allclose(middle.min(axis=0)[:2], [-20, -10], atol=0.25)
        np.testing.assert_allclose(middle.max(axis=0)[:2], [20, 10], atol=0.25)
        on_side = (np.abs(middle[:, 0]) < 18) & (middle[:, 1] > 0)
        np.testing.assert_allclose(middle[on_side, 1], 10, atol=0.05)

    def test_corners_closer_than_the_slices_can_use_change_nothing(self, tmp_path: Path) -> None:
        fine = [circle(np.sqrt(400 - z * z), z, 1500) for z in np.arange(-18.75, 20, 2.5).tolist()]
        surface = surface_of(tmp_path, fine)
        assert surface.report["stack"]["voxel_mm"] > 0.2
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(BALL, rel=0.025)

    def test_missing_slices_are_bridged_and_told(self, tmp_path: Path) -> None:
        surface = surface_of(tmp_path, [contour for n, contour in enumerate(EVEN) if n not in (5, 6)])
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(BALL, rel=0.025)
        assert surface.report["stack"]["widest_slice_distance_mm"] == pytest.approx(7.5)
        assert any("7.5 apart, 2.5 as a rule" in warning for warning in surface.report["warnings"])


def upright_torus(z: float) -> Contours:
    """Return the contours of a torus about the x axis on a plane: one ring near its ends, two in the middle."""
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    y = np.linspace(-28, 28, 2001)
    inside = 8**2 - (np.sqrt(y**2 + z**2) - 20) ** 2
    found = []
    for run in np.split(np.arange(len(y)), np.flatnonzero(np.diff((inside > 0).astype(int))) + 1):
        if inside[run[0]] > 0 and len(run) > 3:
            low, high = y[run[0]], y[run[-1]]
            across = (low + high) / 2 + (high - low) / 2 * np.cos(angle)
            x = np.sqrt(np.maximum(8**2 - (np.sqrt(across**2 + z**2) - 20) ** 2, 0)) * np.sign(np.sin(angle))
            found.append(np.column_stack([x, across, np.full(len(x), z)])[::6])
    return found


class TestOtherPeoplesFiles:
    def test_pydicoms_own(self) -> None:
        from pydicom.data import get_testdata_file

        points = read_points(str(get_testdata_file("rtstruct.dcm")))
        assert points.notes[0].startswith("structure 1: patient of 3")
        np.testing.assert_array_equal(np.unique(points.positions[:, 2]), [-200, -190, -180])

    @pytest.mark.filterwarnings("ignore::DeprecationWarning")
    def test_rt_utils(self, tmp_path: Path) -> None:
        rt_utils = pytest.importorskip("rt_utils", reason="rt-utils, the independent writer, is not here")
        from segmentations import sources

        k, j, i = np.ogrid[-10:11, -24:25, -24:25]
        ball = (2.0 * k) ** 2 + j**2 + i**2 <= 16**2
        affine = np.diag([1.0, 1.0, 2.0, 1.0])
        affine[:3, 3] = -24, -24, -20
        for n, data in enumerate(sources(ball.shape, affine)):
            save(data, tmp_path / "ct" / f"{n}.dcm")
        made = rt_utils.RTStructBuilder.create_new(dicom_series_path=str(tmp_path / "ct"))
        made.add_roi(mask=ball.transpose(1, 2, 0), name="ball")
        made.save(str(tmp_path / "plan.dcm"))
        points = read_points(tmp_path / "plan.dcm", settings=CloudSettings(skip_flat=True))
        assert any("left out: 2" in note for note in points.notes)  # the poles, one pixel each
        surface = reconstruct_points(points)
        # it draws through the centers of the border's pixels, half a pixel within
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 15.5**3, rel=0.025)
        assert abs(np.linalg.norm(surface.mesh.vertices, axis=1).mean() - 15.5) < 0.1


class TestChoice:
    @pytest.fixture
    def plan(self, tmp_path: Path) -> Path:
        small, large = sphere(9, 2), sphere(12, 2)
        point: Any = ("POINT", np.zeros((1, 3)))
        line: Any = ("OPEN_PLANAR", EVEN[0][:36])
        return written(
            {"Liver": large, "Left\x1b[31m kidney": [*small, point], "Twin": small, "Marker": [point, line],
             "Twin ": large},
            tmp_path / "plan.dcm",
        )  # fmt: skip

    @pytest.mark.parametrize(("wanted", "radius"), [("1", 12), ("Liver", 12), (" 2 ", 9), ("3", 9), ("5", 12)])
    def test_by_number_and_by_name(self, plan: Path, wanted: str, radius: float) -> None:
        points = read_points(plan, settings=CloudSettings(structure=wanted))
        assert np.linalg.norm(points.positions, axis=1).mean() == pytest.approx(radius, rel=0.01)
        assert points.frame == "LPS"

    def test_what_is_not_closed_is_left_out_with_a_note(self, plan: Path) -> None:
        points = read_points(plan, settings=CloudSettings(structure="2"))
        assert points.notes[0] == "structure 2: Left [31m kidney of 5, 9 contours on 9 slices"
        assert points.notes[1].endswith("left out: 1 POINT")

    def test_several_are_told_in_a_table(self, plan: Path) -> None:
        with pytest.raises(GeometryError) as told:
            read_points(plan)
        assert "1: Liver, contours 12, slices 12; 2: Left [31m kidney, contours 9, slices 9" in str(told.value)
        assert "4: Marker, contours 0, slices 0" in str(told.value)
        assert "--structure N" in str(told.value)

    def test_two_of_one_name_must_be_told_apart(self, plan: Path) -> None:
        with pytest.raises(GeometryError, match="several structures could be meant"):
            read_points(plan, settings=CloudSettings(structure="Twin"))

    def test_one_that_is_not_there(self, plan: Path) -> None:
        with pytest.raises(UsageError, match=r"no such structure.*1: Liver"):
            read_points(plan, settings=CloudSettings(structure="Spleen"))

    def test_one_without_closed_contours(self, plan: Path) -> None:
        with pytest.raises(EmptyError, match="no closed contours"):
            read_points(plan, settings=CloudSettings(structure="4"))

    def test_text_is_wanted(self) -> None:
        for wrong in (2, "", "  "):
            with pytest.raises(UsageError, match="--structure"):
                CloudSettings(structure=wrong)  # type: ignore[arg-type]


def text(values: str) -> dict[int, DataElement]:
    """Return contour data as text that need not be numbers."""
    return {0x30060050: DataElement(0x30060050, "LT", values)}


class TestCommandLine:
    def test_a_structure_becomes_a_mesh_in_millimeters(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        plan = written({"Liver \x1b[31m": EVEN, "Other": EVEN[:5]}, tmp_path / "plan.dcm")
        mesh, report = tmp_path / "mesh.ply", tmp_path / "report.json"
        line = ["surface", str(plan), "-o", str(mesh), "--report", str(report)]
        assert "--structure N" in fails(line, 5, capsys)
        assert not mesh.exists()
        assert main([*line, "--structure", "Liver [31m"]) == 0
        assert "structure 1: Liver [31m of 2, 16 contours on 16 slices" in capsys.readouterr().out
        assert b"unit=mm frame=LPS" in mesh.read_bytes()[:200]
        found = json.loads(report.read_text())
        assert found["points"]["frame"] == "LPS"
        assert found["points"]["unit"] == "mm"
        assert found["settings"]["cloud"]["structure"] == "Liver [31m"

    def test_settings_repeat_the_choice(self, tmp_path: Path) -> None:
        plan = written({"A": EVEN, "B": sphere(9, 2)}, tmp_path / "plan.dcm")
        one, two, kept = (tmp_path / name for name in ("one.ply", "two.ply", "kept.toml"))
        line = ["surface", str(plan), "--quiet", "-o"]
        assert main([*line, str(one), "--structure", "2", "--save-settings", str(kept)]) == 0
        assert main([*line, str(two), "--settings", str(kept)]) == 0
        assert one.read_bytes() == two.read_bytes()


def test_contours_of_any_order_and_direction_give_one_mesh(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    turned: list[Floats] = [one[::-1] if rng.random() < 0.5 else one for one in EVEN]
    rng.shuffle(order := np.arange(len(EVEN)))
    one, other = (surface_of(tmp_path, each).mesh for each in (EVEN, [turned[n] for n in order]))
    first, second = (each.face_areas @ each.corners.mean(axis=1) / each.face_areas.sum() for each in (one, other))
    np.testing.assert_allclose(first, second, atol=1e-3)
    assert abs(len(one.faces) - len(other.faces)) < 0.01 * len(one.faces)
