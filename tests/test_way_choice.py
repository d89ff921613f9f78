"""The way of a study is chosen from what its slices are, and that is counted right."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import ndimage

from studies import write_nifti
from tomomesh import Settings, Volume, phantom, reconstruct, segment
from tomomesh.cli import main
from tomomesh.errors import UsageError
from tomomesh.segmentation.outlines import DUST, WINDING, Outlines, outlines_of
from tomomesh.settings import OF_STUDIES
from tomomesh.ways.choice import JUMP, NEARLY, against_one_ring, asked_way, chosen_way

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]


def away(x: float = 0.0, y: float = 0.0, size: int = 64) -> NDArray[np.float64]:
    """Return the distance of each pixel of a slice from a place, counted from its middle."""
    row, column = np.indices((size, size)) - (size - 1) / 2
    return np.asarray(np.hypot(column - x, row - y))


def stack(*planes: Mask, times: int = 30) -> Mask:
    return np.repeat(np.stack(planes), times, axis=0)


def ball(radius: float = 26.0, size: int = 64) -> Mask:
    height = np.arange(size)[:, None, None] - (size - 1) / 2
    return np.asarray(away(size=size)[None] ** 2 + height**2 < radius**2)


DISC, BAND = away() < 20, np.abs(away() - 22) < 3
OPENED = BAND & ~((np.abs(np.indices(BAND.shape)[1] - 31.5) < 4) & (np.indices(BAND.shape)[0] < 30))
TWO = (away(-15) < 10) | (away(15) < 10)
NESTED = BAND | (away() < 8)
SHEET = np.abs(np.indices(DISC.shape)[0] - 31.5) < 3
HOLED = DISC & (away(5) > 4)


class TestKnown:
    @pytest.mark.parametrize(
        ("plane", "pieces", "holes", "wall"),
        [
            (DISC, 1, 0, False), (BAND, 1, 1, True), (OPENED, 1, 0, True), (TWO, 2, 0, False), (NESTED, 2, 1, False),
            (SHEET, 1, 0, False), (HOLED, 1, 1, False),
        ],
    )  # fmt: skip
    def test_shapes_have_the_pieces_and_holes_that_they_have(
        self, plane: Mask, pieces: int, holes: int, wall: bool
    ) -> None:
        found = outlines_of(stack(plane))
        assert set(found.pieces) == {pieces}
        assert set(found.holes) == {holes}
        assert found.wall == wall
        assert found.bodies == pieces
        assert found.forks == 0

    def test_a_wall_is_as_thick_as_it_is_and_a_disc_has_its_radius(self) -> None:
        assert outlines_of(stack(BAND), (0.5, 0.5)).thickness_mm == pytest.approx(6 / 2, rel=0.05)
        assert outlines_of(stack(DISC), (2.0, 2.0)).thickness_mm == pytest.approx(20 * 2, rel=0.05)

    def test_one_that_becomes_two_forks_once_and_joins_again(self) -> None:
        found = outlines_of(np.concatenate([stack(DISC, times=3), stack(TWO, times=3), stack(DISC, times=3)]))
        assert found.forks == 2
        assert found.bodies == 1

    def test_an_empty_window_has_nothing(self) -> None:
        found = outlines_of(np.zeros((3, 4, 5), bool))
        assert found.bodies == 0
        assert not found.filled.any()
        assert not found.length.any()


def against(mask: Mask, source: str = "given") -> str:
    return against_one_ring(outlines_of(mask), source)


class TestRules:
    """Each rule by a window that it decides, and by one beside it that it lets pass."""

    def test_one_outline_a_slice_is_one_ring(self) -> None:
        assert against(stack(BAND)) == against(ball()) == against(ball(), "preset") == against(ball(), "otsu") == ""

    @pytest.mark.parametrize("plane", [TWO, NESTED, HOLED])
    def test_several_outlines_are_not(self, plane: Mask) -> None:
        assert against(stack(plane)).endswith("a slice")

    def test_a_few_slices_may_have_several(self) -> None:
        few, more = (np.concatenate([stack(BAND, times=100 - n), stack(NESTED, times=n)]) for n in (5, 6))
        assert NEARLY == 0.95
        assert against(few) == ""
        assert against(more) == "1.06 pieces and 1 hole a slice"

    def test_dust_is_not_seen(self) -> None:
        specks = stack(BAND)
        specks[:, 31:33, 31:33] = True
        assert 4 < DUST * BAND.sum() < 9
        assert against(specks) == ""
        specks[:, 31:34, 31:34] = True
        assert against(specks) == "2 pieces and 1 hole a slice"

    @pytest.mark.parametrize("source", ["given", "otsu", "preset", "labels"])
    def test_a_preset_means_both_sides_of_a_wall_and_labels_every_side(self, source: str) -> None:
        wall, solid = against(stack(BAND), source), against(ball(), source)
        assert bool(wall) == (source in ("preset", "labels"))
        assert bool(solid) == (source == "labels")

    def test_a_wall_goes_around_something_on_most_slices(self) -> None:
        closed, opened = (np.concatenate([stack(BAND, times=n), stack(OPENED, times=30 - n)]) for n in (16, 15))
        assert against(closed) == ""
        assert against(opened) == "thin or bent, and around nothing on most slices"

    def test_a_solid_does_not_wind(self) -> None:
        bay = ball()
        bay[20:44, 31:33, :33] = False
        found = outlines_of(bay)
        assert 0 < found.share(found.round) < NEARLY
        assert "winds" in against(bay)

    def test_an_ellipse_thrice_as_long_as_wide_does_not_wind(self) -> None:
        row, column = np.indices((64, 64)) - 31.5
        found = outlines_of(stack((column / 30) ** 2 + (row / 10) ** 2 < 1))
        assert found.round.all()
        assert found.length[0] > 1.1 * 2 * np.sqrt(np.pi * found.area[0])

    def test_a_solid_does_not_jump_from_slice_to_slice_nor_end_flat(self) -> None:
        cylinders = [stack(DISC, times=count) for count in (51, 49)]
        assert [outlines_of(one).jump > JUMP for one in cylinders] == [False, True]
        assert [bool(against(one)) for one in cylinders] == [False, True]
        chin = np.concatenate([stack(away() < size, times=30) for size in (8, 24, 8)])
        assert "step" in against(chin)

    @pytest.mark.parametrize("source", ["given", "otsu"])
    def test_without_reason_it_is_a_ring_and_with_one_voxels(self, source: str) -> None:
        asked = Settings().network
        assert chosen_way(asked, against(stack(BAND), source)).way == "ring"
        assert chosen_way(asked, against(stack(TWO), source)).way == "voxels"

    @pytest.mark.parametrize("asked", [{"neurons": 80}, {"training": "online"}, {"even": False}, {"trim": 0.0}])
    def test_who_asks_for_networks_gets_networks(self, asked: dict[str, Any]) -> None:
        network = Settings().replace(**asked).network
        assert chosen_way(network, "").way == "ring"
        taken = chosen_way(network, "2 pieces")
        assert taken.way == "contours"
        assert f"--{'no-' * (asked == {'even': False})}{next(iter(asked))} asks" in taken.because

    @pytest.mark.parametrize("asked", [{"seed": 3}, {"slices": "axial"}, {"stiffness": 0.5}, {"cell_mm": (3.0,)}])
    def test_nothing_else_asks_for_them(self, asked: dict[str, Any]) -> None:
        assert chosen_way(Settings().replace(**asked).network, "2 pieces").way == "voxels"


class TestAsked:
    @pytest.mark.parametrize(
        ("asked", "way"),
        [
            ({"network": "none"}, "voxels"), ({"network": "ring"}, "ring"), ({"network": "grid"}, "ring"),
            ({"network": "sphere"}, "sphere"), ({"network": "torus"}, "sphere"), ({"space": "volume"}, "sphere"),
            ({"contours": "one"}, "ring"), ({"contours": "loops"}, "contours"), ({"contours": "walls"}, "contours"),
            ({"network": "ring", "contours": "components"}, "contours"), ({"way": "paper"}, "ring"),
            ({"way": "contours", "network": "ring"}, "contours"), *(({"way": way}, way) for way in OF_STUDIES),
        ],
    )  # fmt: skip
    def test_details_decide_where_they_are_given(self, asked: dict[str, Any], way: str) -> None:
        network = Settings().replace(**asked).network
        taken = asked_way(network)
        assert taken is not None
        assert (taken.way, taken.chosen) == (way, False)
        settled = network.taking(way)
        assert "auto" not in (settled.way, settled.network, settled.contours)
        assert all(getattr(settled, name) == value for name, value in asked.items() if name != "way")

    def test_nothing_is_asked_for_by_default(self) -> None:
        assert asked_way(Settings().network) is None

    @pytest.mark.parametrize(
        "asked",
        [
            {"way": "voxels", "contours": "loops"}, {"way": "ring", "network": "none"},
            {"way": "contours", "contours": "one"}, {"way": "contours", "network": "grid"},
            {"way": "sphere", "contours": "walls"}, {"way": "ring", "space": "volume"},
        ],
    )  # fmt: skip
    def test_a_way_and_details_of_another_are_refused_in_one_line(self, asked: dict[str, Any]) -> None:
        with pytest.raises(UsageError, match="at odds") as fault:
            Settings().replace(**asked)
        assert f"--way = {asked['way']}" in str(fault.value)
        assert "\n" not in str(fault.value)

    def test_paper_is_all_of_the_papers_choices_with_what_is_given_over_them(self, tmp_path: Path) -> None:
        paper = Settings.for_paper()
        assert Settings().replace(way="paper") == Settings.from_dict({"network": {"way": "paper"}}) == paper
        mixed = Settings().replace(way="paper", training="batch", neurons=30)
        assert mixed == paper.replace(training="batch", neurons=30)
        assert mixed.replace(way="paper") == mixed
        assert Settings.from_dict(mixed.to_dict()) == mixed


def study(mask: Mask, spacing: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> Volume:
    return Volume.from_stored(mask.astype(np.uint8), np.diag([*spacing, 1.0]))


def skull() -> Mask:
    """Return a wall between two half balls with openings in it, and two pieces apart inside of it."""
    size = 48
    height = np.arange(size)[:, None, None] - 14.0
    off = np.sqrt(away(size=size)[None] ** 2 + height**2)
    wall = (np.abs(off - 19) < 2.5) & (away(19, 0, size)[None] + np.abs(height - 5) > 5)
    wall &= away(-19, 6, size)[None] + np.abs(height - 9) > 4
    inside = (np.hypot(away(6, 0, size)[None], height - 5) < 3.5) | (
        np.hypot(away(-6, 0, size)[None], height - 5) < 3.5
    )
    return np.asarray((wall | inside)[:36])


class TestEndToEnd:
    def test_the_built_in_head_is_a_ring_on_every_slice(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        head = phantom((27, 128, 128), (1.875, 1.875, 5.4))
        path = tmp_path / "head.nii"
        write_nifti(path, head.volume.voxels, head.volume.affine)
        line = ["reconstruct", str(path), "-o", str(tmp_path / "m.ply"), "--lower", str(head.lower)]
        assert main([*line, "--report", str(tmp_path / "r.json")]) == 0
        told = json.loads((tmp_path / "r.json").read_text())
        assert told["way"]["name"] == "rings"
        assert told["networks"]["trained"] == 27
        assert "way       ring: one outline a slice (--way contours|voxels|sphere|paper for another)" in (
            capsys.readouterr().out.splitlines()
        )

    def test_labels_of_a_wall_with_openings_and_pieces_keep_their_volume(
        self, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        mask, path = skull(), tmp_path / "labels.nii"
        write_nifti(path, 7 * mask.astype(np.uint8), np.diag([1.0, 1.0, 2.0, 1.0]))
        line = ["reconstruct", "--labels-in", str(path), "--select", "7", "-o", str(tmp_path / "m.ply")]
        assert main([*line, "--report", str(tmp_path / "r.json")]) == 0
        told = json.loads((tmp_path / "r.json").read_text())
        assert told["way"]["name"] == "voxels"
        assert told["quality"]["volume_mm3"] == pytest.approx(2 * mask.sum(), rel=0.02)
        assert told["quality"]["components"] == ndimage.label(mask)[1] == 3
        assert set(told["way"]["others"]) == {"ring", "contours", "sphere", "paper"}
        assert not told["way"]["others"]["ring"]["applies"]
        said = [one for one in capsys.readouterr().out.splitlines() if one.startswith("way ")]
        assert said == ["way       voxels: labels are drawn to the voxel (--way contours|sphere for another)"]

    def test_the_library_takes_the_same_way_as_the_command(self, tmp_path: Path) -> None:
        mask = skull()
        path = tmp_path / "s.nii"
        write_nifti(path, mask.astype(np.uint8), np.diag([1.0, 1.0, 2.0, 1.0]))
        assert (
            main(["reconstruct", str(path), "-o", str(tmp_path / "m.ply"), "--report", str(tmp_path / "r.json")]) == 0
        )
        told, found = json.loads((tmp_path / "r.json").read_text())["way"], reconstruct(study(mask)).report["way"]
        assert told == found
        assert found["name"] == "voxels"

    @pytest.mark.parametrize("way", ["contours", "voxels", "sphere"])
    def test_another_way_is_one_option(self, way: str) -> None:
        found = segment(study(ball(20.0, 48)), way=way, neurons=42 if way == "sphere" else None)
        assert found.way == {"sphere": "space"}.get(way, way)
        assert not found.report["way"]["chosen"]
        assert found.report["way"]["because"] == f"asked for by --way {way}"

    def test_settings_of_a_file_choose_like_options(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path, toml = tmp_path / "s.nii", tmp_path / "s.toml"
        write_nifti(path, skull().astype(np.uint8), np.eye(4))
        toml.write_text("[network]\nneurons = 30\n")
        line = ["segment", str(path), "-o", str(tmp_path / "p.ply"), "--settings", str(toml)]
        assert main(line) == 0
        said = capsys.readouterr().out
        assert "--neurons asks for networks" in said
        assert main([*line, "--way", "voxels"]) == 0
        assert "way    " not in capsys.readouterr().out

    def test_paper_is_one_option_or_another(self, tmp_path: Path) -> None:
        path, kept = tmp_path / "s.nii", [tmp_path / "a.toml", tmp_path / "b.toml"]
        write_nifti(path, 100 * stack(BAND, times=4).astype(np.uint8), np.eye(4))
        line = ["segment", str(path), "-o", str(tmp_path / "p.ply"), "--neurons", "20", "--epochs", "2"]
        for option, toml in zip((["--paper"], ["--way", "paper"]), kept, strict=True):
            assert main([*line, *option, "--save-settings", str(toml)]) == 0
        assert kept[0].read_bytes() == kept[1].read_bytes()
        assert 'way = "paper"' in kept[0].read_text()

    def test_each_study_of_a_batch_goes_its_own_way(self, tmp_path: Path) -> None:
        (tmp_path / "in").mkdir()
        for name, mask in (("band", stack(BAND, times=8)), ("skull", skull())):
            write_nifti(tmp_path / "in" / f"{name}.nii", 100 * mask.astype(np.uint8), np.eye(4))
        line = ["reconstruct", str(tmp_path / "in"), "--each", "-o", str(tmp_path / "out"), "--lower", "50"]
        assert main(line) == 0
        told = {
            path.name.split(".")[0]: json.loads(path.read_text())["way"]["name"] for path in tmp_path.rglob("*.json")
        }
        assert told == {"band": "rings", "skull": "voxels"}

    @pytest.mark.parametrize("kind", ["band", "labels", "empty"])
    def test_inspect_tells_the_way_of_the_command_that_it_names(
        self, tmp_path: Path, capsys: CaptureFixture[str], kind: str
    ) -> None:
        path, voxels = (
            tmp_path / "s.nii",
            {"band": stack(BAND, times=8), "labels": skull()}.get(kind, np.zeros((4, 8, 8))),
        )
        levels = np.random.default_rng(0).normal(0, 0.05, voxels.shape) if kind == "band" else 0
        write_nifti(path, (voxels + levels).astype(np.float32 if kind == "band" else np.uint8), np.eye(4))
        assert main(["inspect", str(path), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        if kind == "empty":
            assert found["way"] is None
            return
        assert main(["inspect", str(path)]) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[-2].split()[1] == {"band": "ring:", "labels": "voxels:"}[kind]
        report = tmp_path / "r.json"
        line = said[-1].removeprefix("next").split()[1:]
        assert main([*line[:-1], str(tmp_path / "m.stl"), "--report", str(report)]) == 0
        told = json.loads(report.read_text())["way"]
        assert {key: value for key, value in told.items() if key != "name"} == found["way"]


def test_the_figures_that_steer_are_those_that_are_told() -> None:
    found = segment(study(stack(BAND, times=8)), neurons=20)
    told, seen = found.report["way"], outlines_of(found.mask)
    assert told["pieces"] == 8 == told["holes"] == told["slices"]
    assert told["single_share"] == 1.0 == told["largest_piece_share"] == told["largest_body_share"]
    assert told["wall"]
    assert told["ringed"]
    assert told["thickness_mm"] == seen.thickness_mm == told["thickness_pixels"]
    assert replace(seen, pixel_mm=(2.0, 2.0)).thickness_mm == pytest.approx(4 * seen.thickness_mm)
    assert isinstance(seen, Outlines)
    assert WINDING > 1
