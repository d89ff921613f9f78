"""Several contours in a slice, the whole way: two bones, two sides of a shell, holes; their report."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from studies import affine_of, rotation
from tomomesh import reconstruct, reconstruct_points, segment
from tomomesh.contours.known import known_slices
from tomomesh.contours.rings import nested
from tomomesh.errors import EmptyError
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.contours import SIDES
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import RING, SIDE, TRACK
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

SPACING = (1.0, 1.0, 3.0)
SHAPE = (16, 64, 72)


def places(shape: tuple[int, int, int] = SHAPE, spacing: tuple[float, float, float] = SPACING) -> list[Floats]:
    """Return z, y, x of every voxel, about the middle."""
    axes = [(np.arange(n) - (n - 1) / 2) * s for n, s in zip(shape, spacing[::-1], strict=True)]
    return list(np.meshgrid(*axes, indexing="ij"))


def study(mask: NDArray[np.bool_], affine: Floats | None = None) -> Volume:
    return Volume.from_stored(mask.astype(np.int16) * 100, np.diag([*SPACING, 1.0]) if affine is None else affine)


def shell(outer: float = 22.0, inner: float = 14.0) -> NDArray[np.bool_]:
    away = np.sqrt(sum(axis**2 for axis in places()))
    return np.asarray((away <= outer) & (away > inner))


def legs() -> NDArray[np.bool_]:
    """Two legs that lean together and merge above."""
    z, y, x = places()
    aside = np.maximum(16 - 0.55 * (z + 22), 0)
    return np.asarray((x - aside) ** 2 + y**2 < 9**2) | np.asarray((x + aside) ** 2 + y**2 < 9**2)


def torus(axis: int) -> NDArray[np.bool_]:
    """A torus about a patient axis."""
    z, y, x = places((26, 72, 72), (1.0, 1.0, 2.0))
    across = [(y, z, x), (x, z, y), (x, y, z)][axis]
    return np.asarray((np.hypot(across[0], across[1]) - 16) ** 2 + across[2] ** 2 < 6.5**2)


def judged(found: Surface) -> TriMesh:
    """Return the mesh, with the strongest judges' leave."""
    check_promise(found.mesh, cavities=found.report["surface"]["cavities"])
    assert found.report["quality"]["self_intersections"] == 0
    welded = trimesh.Trimesh(found.mesh.vertices.astype(np.float32), found.mesh.faces, process=True)
    assert welded.is_watertight
    assert welded.is_winding_consistent
    assert 0.8 < found.report["quality"]["volume_over_rings"] < 1.25
    return found.mesh


class TestShapes:
    """Pieces, handles, volumes and distances."""

    @pytest.mark.parametrize("kind", ["walls", "loops"])
    def test_a_hollow_shell_has_two_surfaces(self, kind: str) -> None:
        found = reconstruct(study(shell()), contours=kind, neurons=120)
        mesh = judged(found)
        assert topology(mesh, cavities=1).components == 2
        assert found.report["surface"]["cavities"] == 1
        away = np.sqrt((mesh.vertices - study(shell()).to_mm(np.array([[35.5, 31.5, 7.5]]))) ** 2 @ np.ones(3))
        off = np.minimum(np.abs(away - 22), np.abs(away - 14))
        level = np.abs(mesh.vertices[:, 2] - 22.5) < 10
        assert off[level].mean() < 0.3
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (22**3 - 14**3), rel=0.06)

    def test_two_legs_merge(self) -> None:
        found = reconstruct(study(legs()), contours="components")
        quality = found.report["quality"]
        judged(found)
        assert (quality["components"], quality["genus"]) == (1, 0)
        assert quality["volume_mm3"] == pytest.approx(3 * legs().sum(), rel=0.06)
        assert found.report["rings"]["merges"] == 1
        assert found.report["rings"]["tracks"] == 2
        assert found.report["rings"]["bridged_gaps"] == []

    def test_one_ring_over_two_legs_is_warned_of(self) -> None:
        apart = legs()[:4]
        warned = reconstruct(study(apart), way="ring", allow_leaks=True).report["warnings"]
        assert any("--contours components" in warning for warning in warned)
        two = reconstruct(study(apart), contours="components")
        assert (two.report["quality"]["components"], two.report["quality"]["genus"]) == (2, 0)
        assert not any("--contours" in warning for warning in two.report["warnings"])
        judged(two)

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_a_torus_has_one_hole_whichever_way_it_is_cut(self, axis: int) -> None:
        found = reconstruct(study(torus(axis), np.diag([1.0, 1.0, 2.0, 1.0])), contours="loops", neurons=120)
        judged(found)
        quality = found.report["quality"]
        assert (quality["components"], quality["genus"]) == (1, 1)
        assert quality["volume_mm3"] == pytest.approx(2 * np.pi**2 * 16 * 6.5**2, rel=0.08)

    def test_an_oblique_and_sheared_study_gives_the_moved_surface(self) -> None:
        straight = reconstruct(study(legs()), contours="loops")
        oblique = affine_of(rotation(0.2, -0.3, 0.4), SPACING, (7.0, -20.0, 100.0))
        moved = reconstruct(study(legs(), oblique), contours="loops")
        judged(moved)
        carried = straight.mesh.vertices / SPACING @ oblique[:3, :3].T + oblique[:3, 3]
        assert compare(TriMesh(carried, straight.mesh.faces), moved.mesh)["p95_mm"] < 0.3
        tilted = np.diag([*SPACING, 1.0])
        tilted[1, 2] = 1.5
        sheared = reconstruct(study(legs(), tilted), contours="loops")
        judged(sheared)
        assert sheared.report["quality"]["volume_mm3"] == pytest.approx(
            straight.report["quality"]["volume_mm3"], rel=0.03
        )
        upright = sheared.mesh.vertices - sheared.mesh.vertices[:, 2:] * np.array([0, 0.5, 0])
        assert distance_to_surface(upright, straight.mesh).mean() < 0.5

    def test_threads_change_no_byte(self) -> None:
        one, two = (reconstruct(study(legs()), contours="loops", threads=threads) for threads in (1, 2))
        assert one.mesh.vertices.tobytes() == two.mesh.vertices.tobytes()
        assert one.mesh.faces.tobytes() == two.mesh.faces.tobytes()
        assert one.points.positions.tobytes() == two.points.positions.tobytes()

    def test_one_slice_encloses_no_volume(self) -> None:
        mask = legs()
        mask[1:] = False
        with pytest.raises(EmptyError, match="one slice"):
            reconstruct(study(mask), contours="loops")

    def test_gaps_are_named(self) -> None:
        _, y, x = places()
        wall = np.abs(np.hypot(x, y) - 20) < 2.5
        wall &= np.abs(np.arctan2(y, x)) > 0.4
        found = reconstruct(study(wall), contours="components", neurons=80, allow_far=True)
        gaps = found.report["rings"]["bridged_gaps"]
        assert [gap["slice"] for gap in gaps] == list(range(16))
        assert {gap["ring"] for gap in gaps} == {0}
        assert all(10 < gap["length_mm"] < 20 and gap["over_median"] > 4 for gap in gaps)
        assert found.report["points"]["bridged_gaps"] >= 16
        judged(found)


class TestPoints:
    """Points that know their slice, ring, side and track."""

    def test_they_say_where_they_come_from(self) -> None:
        found = segment(study(shell()), contours="loops")
        rings = {(one.slice, one.ring): one for one in found.source.contours}
        points = found.points
        for (k, n), one in rings.items():
            own = (points.slices == k) & (points.attributes[RING] == n)
            assert own.sum() == len(one)
            assert set(points.attributes[SIDE][own]) == {one.side}
            assert set(points.attributes[TRACK][own]) == {one.track}
            indices = np.column_stack([one.codebook, np.full(len(one), k)])
            np.testing.assert_allclose(points.positions[own], found.volume.to_mm(indices))

    @pytest.mark.parametrize("suffix", [".ply", ".csv"])
    def test_a_file_of_them_gives_the_same_surface(self, tmp_path: Path, suffix: str) -> None:
        from tomomesh.io import read_points, write_points

        points = segment(study(legs()), contours="loops").points
        write_points(points, tmp_path / f"points{suffix}")
        one, two = (reconstruct_points(p, cell_mm=1.0) for p in (points, read_points(tmp_path / f"points{suffix}")))
        assert one.mesh.faces.tobytes() == two.mesh.faces.tobytes()
        assert one.report["stack"]["contours"] == len(np.unique(100 * points.slices + points.attributes[RING]))

    def test_planes_are_those_of_the_study(self) -> None:
        found = segment(study(legs(), affine_of(rotation(0.5, 0.1, -0.2), SPACING)), contours="components")
        slices = known_slices(found.points)
        assert slices is not None
        np.testing.assert_allclose(np.diff(slices.heights), 3, atol=1e-9)
        assert sum(map(len, slices.rings)) == len(found.source)


class TestNesting:
    """Which closed curves bound the inside."""

    def curve(self, radius: float, x: float = 0.0, *, hole: bool = False) -> Floats:
        turn = 2 * np.pi * np.arange(40) / 40 * (-1 if hole else 1)
        return np.column_stack([x + radius * np.cos(turn), radius * np.sin(turn)])

    def test_holes_and_what_lies_in_them_count_by_turns(self) -> None:
        found = nested([self.curve(30), self.curve(20, hole=True), self.curve(10), self.curve(5, hole=True)])
        assert len(found.rings) == 4
        assert found.parts == [0, 0, 2, 2]

    def test_an_outline_in_another_counts_for_nothing(self) -> None:
        found = nested([self.curve(10), self.curve(30), self.curve(5, 60)])
        assert found.parts == [1, 2]
        np.testing.assert_array_equal(found.rings[0], np.arange(40, 80))

    def test_a_hole_in_nothing_is_none(self) -> None:
        assert nested([self.curve(10, hole=True)]).rings == []


class TestReport:
    def test_every_key_is_documented(self) -> None:
        from pathlib import Path

        page = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
        report = reconstruct(study(shell()), contours="loops").report
        for section in ("networks", "rings", "points", "surface", "fit", "voxels"):
            for key in report[section]:
                assert f"`{section}.{key}`" in page or f"| `{key}` |" in page, f"{section}.{key}"

    def test_each_contour_has_its_measures(self) -> None:
        rings = reconstruct(study(shell()), contours="walls", neurons=120).report["rings"]
        assert {len(column) for column in rings["each"].values()} == {rings["count"]}
        assert set(rings["each"]["side"]) == {SIDES[2], SIDES[3]}
        assert max(rings["each"]["evenness"]) < 0.05
        assert json.loads(json.dumps(rings)) == rings

    def test_one_ring_is_measured_too(self) -> None:
        rings = reconstruct(study(shell()), way="ring").report["rings"]
        assert (rings["kind"], rings["count"], rings["tracks"]) == ("one", 14, 1)
        assert rings["self_crossings"] == 0

    def test_crossing_contours_are_warned_of(self) -> None:
        _, y, x = places()
        wall = np.abs(np.hypot(x, y) - 22 - 4 * np.cos(7 * np.arctan2(y, x))) < 1.0
        warned = reconstruct(study(wall), contours="walls", neurons=24, allow_far=True).report
        assert (warned["rings"]["crossings"] > 0) == any("cross each other" in text for text in warned["warnings"])
