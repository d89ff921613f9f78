"""Several bodies in one stack: each found with its own heights and slice distance, whatever lies beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from structure_sets import circle as polygon
from structure_sets import keyhole, sphere, torus, written
from tomomesh.contours.slices import find_slices
from tomomesh.contours.stack import contour_surface
from tomomesh.errors import GeometryError, UsageError
from tomomesh.io import read_points
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.mesh import TriMesh
from tomomesh.pipeline import reconstruct_points
from tomomesh.settings import CloudSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

PLACES = ((0, 0), (90, 0), (0, 90))


def circle(x: float, y: float, radius: float, height: float) -> Floats:
    turn = np.linspace(0, 2 * np.pi, max(round(2 * np.pi * radius), 12), endpoint=False)
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), np.full(len(turn), height)])


def raised(ring: Floats, z: float, x: float = 0.0) -> Floats:
    moved: Floats = ring + np.array([x, 0.0, z])
    return moved


def widths(kind: str, radius: float, z: float) -> list[float]:
    return {
        "ball": [float(np.sqrt(max(radius**2 - z * z, 0)))],
        "cylinder": [0.6 * radius],
        "cone": [(radius - z) / 2],
        "tube": [0.8 * radius, 0.4 * radius],
    }[kind]


def cut(kind: str, x: float, y: float, radius: float, heights: Floats) -> list[list[Floats]]:
    """Return the rings of a body about (x, y, 0) on slices."""
    slices = [
        [circle(x, y, width, z) for width in widths(kind, radius, z) if width > 0.2 * radius] for z in heights.tolist()
    ]
    return [rings for rings in slices if rings]


@st.composite
def bodies(draw: st.DrawFn) -> tuple[Floats, int, int]:
    """Draw bodies side by side, each with its own slice distance, offset and jitter; some with another inside."""
    rng = np.random.default_rng(draw(seeds))
    kinds = draw(st.lists(st.sampled_from(["ball", "cylinder", "cone", "tube"]), min_size=1, max_size=3))
    jitter, noise = draw(st.sampled_from([0.0, 0.01, 0.04])), draw(st.sampled_from([0.0, 0.1]))
    found, pieces = [], len(kinds)
    for (x, y), kind in zip(PLACES, kinds, strict=False):
        radius, step = rng.uniform(22, 30), rng.uniform(3.5, 6)
        slices = cut(kind, x, y, radius, np.arange(-radius + rng.uniform(0, step), radius, step))
        found += [raised(ring, rng.uniform(-jitter, jitter) * step) for rings in slices for ring in rings]
        if kind == "tube" and draw(st.booleans()):
            pieces += 1
            found += [
                ring for rings in cut("ball", x, y, 7, np.arange(-6 + rng.uniform(0, 2), 6, 2.5)) for ring in rings
            ]
    points = np.concatenate(found)
    return points + rng.normal(0, noise, points.shape), pieces, kinds.count("tube")


@law(25)
@given(bodies(), seeds)
def test_bodies_are_found_with_their_volume(drawn: tuple[Floats, int, int], seed: int) -> None:
    points, pieces, genus = drawn
    slices = find_slices(np.random.default_rng(seed).permutation(points))
    assert slices is not None
    made = contour_surface(
        points[np.random.default_rng(seed).permutation(len(points))], slices, edge=size(slices.spacing, 2.5)
    )
    check_promise(made.mesh, cavities=made.boundary.cavities)
    # a cap is flat to the last bit, and faces that touch at a corner alone are then told by rounding
    assert not self_intersections(TriMesh(np.round(made.mesh.vertices, 9), made.mesh.faces)).any()
    assert (topology(made.mesh).components, topology(made.mesh).genus) == (pieces, genus)
    assert len(made.stack.frusta) == pieces
    assert made.mesh.face_volumes.sum() == pytest.approx(made.stack.frusta.sum(), rel=size(0.02, 0.06))


def two_balls(apart: float, step: float = 6.0) -> Floats:
    heights = np.arange(-21.5, 25, step)
    rings = [ring for x, z in ((0, 0.0), (60, apart)) for rings in cut("ball", x, 0, 25, heights) for ring in rings]
    high = np.repeat([0.0, apart], len(rings) // 2)
    return np.concatenate([raised(ring, z) for ring, z in zip(rings, high, strict=True)])


class TestCloudFiles:
    """From a file of positions alone."""

    @pytest.mark.parametrize("apart", [0.0, 0.3, 0.5, 0.7, 1.0, 3.0])
    def test_two_balls_whose_planes_lie_apart(self, tmp_path: Path, apart: float) -> None:
        np.savetxt(tmp_path / "two.xyz", np.random.default_rng(1).permutation(two_balls(apart)), fmt="%.4f")
        found = reconstruct_points(read_points(tmp_path / "two.xyz"))
        quality, stack = found.report["quality"], found.report["stack"]
        assert found.report["way"]["name"] == "stack"
        assert (quality["components"], quality["genus"], quality["self_intersections"]) == (2, 0, 0)
        assert (stack["bodies"], stack["contours"], stack["on_one_slice"], stack["points_left_out"]) == (2, 16, 0, 0)
        assert stack["volume_over_frusta"] == pytest.approx(1, abs=0.02)
        assert quality["volume_mm3"] == pytest.approx(2 * 4 / 3 * np.pi * 25**3, rel=0.01)
        assert found.report["warnings"] == []

    def test_strays_and_lone_contours_are_told(self) -> None:
        lone = [circle(0, 70, 8, 3.0), circle(60, 70, 9, -3.3)]
        points = np.concatenate([two_balls(0.5), *lone, [[30.0, 30.0, 1.7]]])
        found = reconstruct_points(points)
        assert found.report["quality"]["components"] == 4
        assert (found.report["stack"]["on_one_slice"], found.report["stack"]["points_left_out"]) == (2, 1)
        told = " / ".join(found.report["warnings"])
        assert "2 contour(s) go on in no other slice, and are made a slice distance thick: at " in told
        assert "; 0, 70, 3" in told
        assert "60, 70, -3.3" in told
        assert "1 point(s) are on no contour of 6 points or more" in told

    def test_a_shell_in_a_shell(self) -> None:
        outer = [(r, z) for z in np.arange(-38, 39, 4.0) for r in (40, 34)]
        inner = [(r, z) for z in np.arange(-21.5, 22, 3.0) for r in (22, 16)]
        rings = [circle(0, 0, np.sqrt(r * r - z * z), z) for r, z in outer + inner if abs(z) < r]
        found = reconstruct_points(np.concatenate(rings))
        assert found.report["stack"]["bodies"] == 2
        assert (found.report["quality"]["components"], found.report["surface"]["cavities"]) == (4, 2)
        true = 4 / 3 * np.pi * (40**3 - 34**3 + 22**3 - 16**3)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(true, rel=0.03)


def of_structures(folder: Path, structures: dict[str, Any], wanted: str | None = None) -> Surface:
    points = read_points(written(structures, folder / "plan.dcm"), settings=CloudSettings(structure=wanted))
    found = reconstruct_points(points)
    assert found.report["quality"]["sound"]
    assert found.report["quality"]["self_intersections"] == 0
    return found


def ball_of(radius: float) -> float:
    return 4 / 3 * np.pi * radius**3


EVEN = sphere(20, 2.5)
THREE = [n for n in range(16) if n not in (6, 7, 8)]
"""A ball without three slices in its middle."""


class TestStructures:
    """From a structure set."""

    @pytest.mark.parametrize(
        ("contours", "pieces", "true"),
        [
            (sphere(20, 6) + sphere(20, 6, (60, 0, 0.5)), 2, 2 * ball_of(20)),
            (sphere(10, 2.5) + sphere(10, 2.5, (0, 0, 60)), 2, 2 * ball_of(10)),
            (sphere(10, 2.5) + sphere(10, 2.5, (30, 0, 60)), 2, 2 * ball_of(10)),
            (sphere(10, 2.5) + sphere(10, 2.5, (14, 0, 25)), 2, 2 * ball_of(10)),
            ([ring for z in (0, 40, 100) for ring in sphere(8, 2.5, (0, 0, z))], 3, 3 * ball_of(8)),
            ([EVEN[n] for n in range(16) if n != 7], 1, ball_of(20)),
            ([EVEN[n] for n in THREE], 1, ball_of(20)),
            (EVEN[::2], 1, ball_of(20)),
            ([EVEN[n] for n in range(16) if n < 8 or n % 2 == 0], 1, ball_of(20)),
            (
                sphere(20, 2) + sphere(20, 5, (60, 0, 0.3)) + sphere(12, 3, (0, 60, 0.1)),
                3,
                2 * ball_of(20) + ball_of(12),
            ),
        ],
    )
    def test_bodies_of_one_structure(self, tmp_path: Path, contours: Any, pieces: int, true: float) -> None:
        found = of_structures(tmp_path, {"one": contours})
        assert (found.report["quality"]["components"], found.report["quality"]["genus"]) == (pieces, 0)
        assert found.report["stack"]["bodies"] == pieces
        assert found.report["quality"]["volume_mm3"] == pytest.approx(true, rel=0.02)

    @pytest.mark.parametrize("gap", [5, 7.5, 10, 12.5, 30, 200, 2000])
    @pytest.mark.parametrize("aside", [0, 6, 14])
    def test_balls_end_as_round_as_they_are(self, tmp_path: Path, gap: float, aside: float) -> None:
        two = sphere(10, 2.5) + sphere(10, 2.5, (aside, 0, 17.5 + gap))
        found = of_structures(tmp_path, {"two": two})
        assert (found.report["quality"]["components"], found.report["warnings"]) == (2, [])
        assert found.report["stack"]["slices"] == 16
        assert found.report["quality"]["volume_mm3"] == pytest.approx(2 * ball_of(10), rel=0.02)

    @pytest.mark.parametrize("gone", [1, 2])
    def test_a_neck_without_slices_stays_a_neck(self, tmp_path: Path, gone: int) -> None:
        heights = 2.5 * np.arange(-4, 10)
        peanut = [polygon(np.sqrt(100 - min(z * z, (z - 15) ** 2)), z) for z in heights if abs(z - 7.5) < 17.5]
        thin = [polygon(max(4.0, np.sqrt(max(100 - z * z, 0.0))), z) for z in 2.5 * np.arange(-3, 12)]
        for whole, cut in ((peanut, 6), (thin, 7)):
            del whole[cut : cut + gone]
            found = of_structures(tmp_path, {"one": whole})
            assert found.report["quality"]["components"] == 1

    @pytest.mark.parametrize("up", [1, -1])
    @pytest.mark.parametrize(("legs", "runs"), [(2, 1), (2, 2), (3, 1)])  # up to three slices without a leg
    def test_legs_that_are_drawn_in_turns_join_their_trunk(self, tmp_path: Path, legs: int, runs: int, up: int) -> None:
        apart, step, below = 15.0, 2.5, 12
        places = apart * (np.arange(legs) - (legs - 1) / 2)
        drawn = [polygon(6.0, step * k, center=(places[k // runs % legs], 0)) for k in range(below)]
        trunk = apart * (legs - 1) / 2 + 6
        drawn += [polygon(trunk, step * k) for k in range(below, below + 8)]
        found = of_structures(tmp_path, {"trousers": [ring * [1, 1, up] for ring in drawn]})
        assert (found.report["quality"]["components"], found.report["quality"]["genus"]) == (1, 0)
        cylinders = np.pi * step * (8 * trunk**2 + below * legs * 36)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(cylinders, rel=0.08)

    def test_two_that_become_one_become_two_in_turns(self, tmp_path: Path) -> None:
        side = [(-1) ** k * 10.0 for k in range(8)]
        drawn = [
            polygon(7.0, 2.5 * k, center=(x, 0)) for k, x in zip([*range(8), *range(13, 21)], 2 * side, strict=True)
        ]
        drawn += [polygon(15.0, 2.5 * k) for k in range(8, 13)]
        found = of_structures(tmp_path, {"one": drawn})
        assert (found.report["quality"]["components"], found.report["quality"]["genus"]) == (1, 0)

    @pytest.mark.parametrize("off", [0.0005, 0.002, 0.01, 0.05])
    def test_heights_that_jitter(self, tmp_path: Path, off: float) -> None:
        rng = np.random.default_rng(3)
        tube = [polygon(r, 3.0 * k + rng.uniform(-off, off), 120) for k in range(12) for r in (20, 12)]
        found = of_structures(tmp_path, {"tube": tube})
        assert (found.report["quality"]["components"], found.report["quality"]["genus"]) == (1, 1)
        assert (found.report["stack"]["slices"], len(found.mesh.faces) < 100_000) == (12, True)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(np.pi * (400 - 144) * 36, rel=0.01)
        balls = [raised(ring, rng.uniform(-off, off), x) for x in (-30, 0, 30) for ring in sphere(10, 2.5)]
        three = of_structures(tmp_path, {"balls": balls})
        assert three.report["quality"]["components"] == 3
        assert three.report["quality"]["volume_mm3"] == pytest.approx(3 * ball_of(10), rel=0.02)

    def test_a_slit_whose_banks_lie_apart(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(0)
        joined = [keyhole(outer, inner) for outer, inner in torus()]
        moved = [one + rng.uniform(-0.02, 0.02, (len(one), 1)) * [1, 1, 0] for one in joined]
        found = of_structures(tmp_path, {"torus": moved})
        assert (found.report["quality"]["components"], found.report["quality"]["genus"]) == (1, 1)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(2 * np.pi**2 * 20 * 64, rel=0.02)

    def test_open_contours_whose_ends_meet_are_closed(self, tmp_path: Path) -> None:
        line: Any = ("OPEN_PLANAR", EVEN[0][:36])
        mixed: Any = [("OPEN_PLANAR", ring) if n % 2 else ring for n, ring in enumerate(EVEN)]
        found = of_structures(tmp_path, {"ball": [*mixed, line]})
        assert found.report["quality"]["volume_mm3"] == pytest.approx(ball_of(20), rel=0.01)
        notes = found.report["points"]["notes"]
        assert notes[1:] == [
            "open contours whose ends meet, taken as closed: 8",
            "contours that are not closed, left out: 1 OPEN_PLANAR",
        ]

    def test_closing_points_and_directions_change_nothing(self, tmp_path: Path) -> None:
        plain = of_structures(tmp_path, {"ball": EVEN}).mesh
        closed = of_structures(tmp_path, {"ball": [np.concatenate([ring, ring[:1]]) for ring in EVEN]}).mesh
        turned = of_structures(tmp_path, {"ball": [ring[::-1] if n % 2 else ring for n, ring in enumerate(EVEN)]}).mesh
        for other in (closed, turned):
            assert other.face_volumes.sum() == pytest.approx(plain.face_volumes.sum(), rel=1e-4)

    def test_three_axes_are_a_cloud(self, tmp_path: Path) -> None:
        axial = sphere(20, 10)
        crossed = [ring[:, order] for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]) for ring in axial]
        found = of_structures(tmp_path, {"ball": crossed})
        assert found.report["way"]["name"] == "cloud"
        assert "in planes of 3 directions" in found.report["points"]["notes"][0]
        assert found.report["quality"]["volume_mm3"] == pytest.approx(ball_of(20), rel=0.03)


class TestSeveralStructures:
    """Each closed by itself, and what they have in common once."""

    @pytest.mark.parametrize("wanted", ["all", "1,2", "A, B", "B,1,1"])
    def test_side_by_side(self, tmp_path: Path, wanted: str) -> None:
        found = of_structures(tmp_path, {"A": sphere(20, 6), "B": sphere(20, 6, (60, 0, 0.5))}, wanted)
        assert found.report["quality"]["components"] == 2
        assert found.report["quality"]["volume_mm3"] == pytest.approx(2 * ball_of(20), rel=0.02)
        assert len(found.report["points"]["notes"]) == 2

    def test_one_within_the_other_is_no_hole(self, tmp_path: Path) -> None:
        found = of_structures(tmp_path, {"A": sphere(20, 2.5), "B": sphere(10, 2.5)}, "all")
        assert (found.report["quality"]["components"], found.report["surface"]["cavities"]) == (1, 0)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(ball_of(20), rel=0.01)

    def test_two_that_overlap_are_one(self, tmp_path: Path) -> None:
        found = of_structures(tmp_path, {"A": sphere(20, 2.5), "B": sphere(20, 2.5, (15, 0, 0.7))}, "all")
        lens = np.pi * (2 * 20 - 15) ** 2 * (15**2 + 4 * 15 * 20) / (12 * 15)
        assert found.report["quality"]["components"] == 1
        assert found.report["quality"]["volume_mm3"] == pytest.approx(2 * ball_of(20) - lens, rel=0.02)

    def test_names_that_are_not_there(self, tmp_path: Path) -> None:
        plan = written({"A": EVEN, "B": EVEN}, tmp_path / "plan.dcm")
        with pytest.raises(UsageError, match="no such structure"):
            read_points(plan, settings=CloudSettings(structure="1,7"))
        with pytest.raises(GeometryError, match=r"--structure N,M or --structure all"):
            read_points(plan)
