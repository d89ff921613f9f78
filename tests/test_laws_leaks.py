"""Shells that leak: holes, sheets, what has two sides, and what lies in cavities."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, size, solids, sphere
from shells import CLOSINGS, DEBRIS, LEAKING, RADIUS, SURE, TIGHT, Twin, mesh_of, sphere_with_hole
from tomomesh import reconstruct_points
from tomomesh.cuberille.closing import close_shell
from tomomesh.cuberille.leak_test import close_leaks
from tomomesh.errors import GeometryError
from tomomesh.measure.topology import topology

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.leak_test import LeakTest

    Cells = NDArray[np.int64]
    Solid = NDArray[np.bool_]


def sheet(wide: int, thick: int = 1) -> Cells:
    return np.argwhere(np.ones((wide, wide, thick), bool))


def ball(center: tuple[int, int, int], radius: float, hollow: float = 0.0) -> Cells:
    """Return the cells of a ball, or of a hollow ball."""
    cells = np.argwhere(np.ones([2 * int(radius) + 3] * 3, bool)) - int(radius) - 1
    far = np.linalg.norm(cells, axis=1)
    return np.asarray(cells[(far <= radius) & (far >= hollow)] + center)


def enclosed(tested: LeakTest) -> int:
    """Return the largest volume of the surfaces, cubes."""
    return int(tested.faces.volumes.max())


class TestHole:
    @pytest.mark.parametrize("width", [4, 6])
    def test_leaks_where_the_closing_is_too_small(self, width: int) -> None:
        tested = close_leaks(sphere_with_hole(width), [width // 2 - 1])
        assert not tested.tight
        assert tested.two_sided < 0.2
        assert enclosed(tested) < 0.5 * enclosed(close_leaks(sphere_with_hole(0), [0]))

    @pytest.mark.parametrize("width", [4, 6])
    def test_is_closed_where_the_closing_is_large_enough(self, width: int) -> None:
        tested = close_leaks(sphere_with_hole(width), [width // 2])
        assert tested.tight
        assert tested.two_sided > 0.9
        assert enclosed(tested) == pytest.approx(enclosed(close_leaks(sphere_with_hole(0), [0])), rel=0.03)

    @pytest.mark.parametrize("width", [0, 2, 4, 6])
    def test_is_closed_by_the_fewest_cubes_that_do(self, width: int) -> None:
        tested = close_leaks(sphere_with_hole(width))
        assert tested.tight
        assert tested.shell.closing == next(
            n for n in CLOSINGS if close_leaks(sphere_with_hole(width), [n]).two_sided >= SURE
        )
        assert abs(tested.shell.closing - width / 2) <= 1
        found = topology(mesh_of(tested.faces))
        assert (found.sound, found.components, found.genus) == (True, 1, 0)

    def test_of_a_closed_shell_needs_no_closing(self) -> None:
        tested = close_leaks(sphere_with_hole(0))
        assert tested.shell.closing == tested.shell.added == 0
        assert tested.two_sided == 1

    @pytest.mark.parametrize("steps", [1, size(3, 2)])
    def test_adds_nothing_outside_but_at_the_hole(self, steps: int) -> None:
        shell = close_shell(sphere_with_hole(2 * steps), steps)
        added = shell.blocks.cells(shell.solid & ~shell.occupied)
        near = np.hypot(added[:, 0], added[:, 1]) < steps + 2
        outer = np.linalg.norm(added, axis=1) > RADIUS + 0.9
        assert (near & (added[:, 2] > 0))[outer].all()


class TestTwoSides:
    @pytest.mark.parametrize("thick", [1, 2])
    def test_a_sheet_is_never_tight(self, thick: int) -> None:
        cells = sheet(size(25, 12), thick)
        tested = close_leaks(cells)
        assert not tested.tight
        assert (tested.two_sided, tested.shell.closing) == (0.0, LEAKING)
        assert tested.faces.volumes.tolist() == [len(cells)]
        assert not any(close_leaks(cells, [steps]).tight for steps in CLOSINGS[: size(9, 3)])

    def test_a_sheet_is_closed_by_0_to_8_in_turn(self) -> None:
        told: list[tuple[str, int, int]] = []
        close_leaks(sheet(5), progress=lambda *done: told.append(done))
        assert told == [("closing", tried, len(CLOSINGS)) for tried in [*CLOSINGS, len(CLOSINGS)]]

    def test_a_tube_without_ends_is_never_tight_while_its_ends_are_open(self) -> None:
        wide = size(12, 7)
        cells = np.argwhere(np.ones([2 * wide + 7] * 3, bool)) - wide - 3
        tube = cells[np.abs(np.hypot(cells[:, 0], cells[:, 1]) - wide) < 0.8]
        assert not close_leaks(tube, [wide // 2 - 1]).tight

    @pytest.mark.parametrize("cells", [sheet(size(25, 12), 5), ball((0, 0, 0), 5)])
    def test_a_slab_or_a_solid_is_never_tight(self, cells: Cells) -> None:
        """Points of a surface leave its inside empty; what they fill is noise about a sheet, or a point."""
        assert not close_leaks(cells, CLOSINGS[: size(9, 3)]).tight

    def test_the_worst_of_two_surfaces_counts_and_debris_does_not(self) -> None:
        whole, apart = sphere_with_hole(0), 5 * RADIUS
        both = close_leaks(np.concatenate([whole, sheet(RADIUS + 1) + apart]), [0])
        assert not both.tight
        assert sorted(both.faces.two_sided) == [0, 1]
        assert both.faces.worth_keeping().all()
        littered = close_leaks(np.concatenate([whole, np.full((1, 3), apart)]))
        assert littered.tight
        assert littered.faces.debris.sum() == 1
        assert littered.faces.only(littered.faces.worth_keeping()).volumes.tolist() == [enclosed(littered)]

    def test_crumbs_alone_are_no_debris(self) -> None:
        cells = 9 * np.argwhere(np.ones((3, 3, 3), bool))
        assert not close_leaks(cells, [0]).faces.debris.any()

    @law(40)
    @given(solid=solids(8), steps=st.integers(0, 2))
    def test_share_is_that_of_the_cubes_behind_the_faces(self, solid: Solid, steps: int) -> None:
        tested = close_leaks(np.argwhere(solid), [steps])
        twin = Twin(solid, steps)
        behind = tested.faces.cells + twin.pad
        told, there = (grid[tuple(behind.T)] for grid in (twin.witnesses, twin.occupied))
        faces = [tested.faces.face_labels == n for n in range(tested.faces.count)]
        shares = np.array([told[own].sum() / max(there[own].sum(), 1) for own in faces])
        np.testing.assert_allclose(tested.faces.two_sided, shares)
        crumbs = (np.array([own.mean() for own in faces]) < DEBRIS) & (shares == 0)
        assert tested.two_sided == pytest.approx(shares[~crumbs | crumbs.all()].min())
        assert tested.tight == (tested.two_sided >= TIGHT)


def with_fin(radius: int, reach: float) -> Cells:
    """Return a hollow ball in a flat ring that begins at its equator, as wide as `reach` radii."""
    wide = round(reach * radius)
    line = np.arange(-wide, wide + 1)
    flat = np.stack(np.meshgrid(line, line, [0], indexing="ij"), axis=-1).reshape(-1, 3)
    far = np.linalg.norm(flat, axis=1)
    return np.unique(np.concatenate([sphere_with_hole(0, radius), flat[(far >= radius) & (far <= wide)]]), axis=0)


class TestThreshold:
    """A ball with a fin: the wider the fin, the smaller the share of its cubes that tell of an inside."""

    @law(40)
    @given(radius=st.integers(6, size(12, 7)), reach=st.floats(1.0, 4.0))
    def test_is_a_share_of_45_percent(self, radius: int, reach: float) -> None:
        cells = with_fin(radius, reach)
        solid = np.zeros(cells.max(axis=0) - cells.min(axis=0) + 1, bool)
        solid[tuple((cells - cells.min(axis=0)).T)] = True
        tested, twin = close_leaks(cells, [0]), Twin(solid, 0)
        behind = tested.faces.cells - cells.min(axis=0) + twin.pad
        share = twin.witnesses[tuple(behind.T)].sum() / twin.occupied[tuple(behind.T)].sum()
        assert tested.two_sided == pytest.approx(share)
        assert tested.tight == (share >= TIGHT)

    @pytest.mark.parametrize(("reach", "low", "high", "tight"), [(2.0, 0.5, 0.6, True), (3.0, 0.25, 0.4, False)])
    def test_lies_between_a_narrow_fin_and_a_wide_one(self, reach: float, low: float, high: float, tight: bool) -> None:
        tested = close_leaks(with_fin(10, reach), [0])
        assert low < tested.two_sided < high
        assert tested.tight == tight

    @pytest.mark.parametrize(("reach", "closing"), [(1.6, 2), (1.9, 4), (2.6, 4)][: size(3, 1)])
    def test_wider_closings_are_tried_until_80_percent_tell_of_an_inside(self, reach: float, closing: int) -> None:
        """At 1.6 radii the shares are .72, .76, .82, .88, .90; elsewhere .74 and .48 at most, closed by 4 cubes."""
        cells = with_fin(10, reach)
        shares = [close_leaks(cells, [n]).two_sided for n in CLOSINGS]
        assert shares[0] < shares[1] < SURE
        first = next((n for n, share in enumerate(shares) if share >= SURE), int(np.argmax(shares)))
        tested = close_leaks(cells)
        assert tested.shell.closing == first == closing
        assert tested.two_sided == shares[closing] > TIGHT

    @pytest.mark.parametrize("wide", range(1, 12))
    def test_a_plate_of_under_5_percent_of_the_faces_is_debris(self, wide: int) -> None:
        """A larger one is a surface that leaks: from .3 to 11 % of the faces of a ball and a plate."""
        whole, faces = sphere_with_hole(0, 10), 2 * wide**2 + 4 * wide
        tested = close_leaks(np.concatenate([whole, sheet(wide) + 50]), [0])
        share = faces / len(tested.faces.quads)
        assert sorted(tested.faces.sizes) == [faces, len(close_leaks(whole, [0]).faces.quads)]
        assert tested.faces.debris.any() == (share < DEBRIS)
        assert tested.tight == (share < DEBRIS)

    @pytest.mark.skipif(size(0, 1) == 1, reason="two clouds, minutes each without the compiler")
    @pytest.mark.parametrize(("reach", "refused"), [(1.25, False), (3.2, True)])
    def test_refuses_a_cloud_with_a_wide_fin_and_takes_one_with_a_narrow_fin(self, reach: float, refused: bool) -> None:
        rng = np.random.default_rng(0)
        flat = rng.uniform(-reach, reach, (round(4 * reach**2 * 640), 2)) * 10
        far = np.hypot(*flat.T)
        fin = np.column_stack([flat, np.zeros(len(flat))])[(far > 10) & (far < 10 * reach)]
        cloud = np.concatenate([sphere(4000), fin])
        with pytest.raises(GeometryError, match="leaks") if refused else nullcontext():
            reconstruct_points(cloud)


class TestCavities:
    """Objects in cavities of objects: left out, or taken as faces that look inward and outward by turns."""

    def test_linings_of_a_shell_are_no_surfaces(self) -> None:
        for cavities in (False, True):
            assert close_leaks(ball((0, 0, 0), 9, 7.5), cavities=cavities).faces.count == 1

    @pytest.mark.parametrize("center", [(0, 0, 0), (2, 0, 0), (-2, 1, -1)])
    def test_hold_a_ball_that_is_taken_where_asked(self, center: tuple[int, int, int]) -> None:
        cells = np.concatenate([ball((0, 0, 0), 12, 11), ball(center, 5, 4)])
        outer, both = close_leaks(cells), close_leaks(cells, cavities=True)
        assert outer.faces.volumes.tolist() == [enclosed(close_leaks(ball((0, 0, 0), 12, 11)))]
        assert both.faces.volumes.tolist() == [enclosed(outer), -enclosed(close_leaks(ball(center, 5, 4)))]
        assert both.faces.inward.tolist() == [False, True]

    def test_may_hold_others(self) -> None:
        shells = [ball((0, 0, 0), far, far - 1) for far in (15, 10, 5)]
        found = close_leaks(np.concatenate(shells), cavities=True).faces
        alone = [enclosed(close_leaks(shell)) for shell in shells]
        assert found.volumes.tolist() == [alone[0], -alone[1], alone[2]]
        assert found.inward.tolist() == [False, True, False]
        assert topology(mesh_of(found)).components == 3

    @pytest.mark.skipif(size(0, 1) == 1, reason="too wide for kernels in plain Python")
    def test_hold_what_floats_far_from_their_lining(self) -> None:
        far, small = ball((0, 0, 0), 90, 89), ball((3, -2, 1), 4, 3)
        outer, both = (close_leaks(np.concatenate([far, small]), cavities=cavities).faces for cavities in (False, True))
        assert outer.count == 1
        assert both.volumes.tolist() == [enclosed(close_leaks(far)), -enclosed(close_leaks(small))]

    def test_that_hold_a_sheet_hold_nothing(self) -> None:
        cells = np.concatenate([ball((0, 0, 0), 12, 11), sheet(7) - [3, 3, 0]])
        assert close_leaks(cells, cavities=True).faces.count == 1

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_are_told_from_space_between_objects(self, axis: int) -> None:
        centers = np.zeros((3, 3), int)
        centers[:, axis] += [0, 14, 28]
        left, middle, right = (tuple(c) for c in centers.tolist())
        cells = np.concatenate([ball(left, 8, 7), ball(left, 3, 2), ball(middle, 4, 3), ball(right, 8, 7)])
        assert close_leaks(cells, [0]).faces.count == 3
        assert sorted(close_leaks(cells, [0], cavities=True).faces.inward) == [False, False, False, True]

    def test_are_not_the_hole_of_a_ring(self) -> None:
        cells = np.argwhere(np.ones((31, 31, 9), bool)) - [15, 15, 4]
        ring = cells[np.abs(np.hypot(np.hypot(cells[:, 0], cells[:, 1]) - 11, cells[:, 2]) - 3) <= 0.6]
        assert not close_leaks(np.concatenate([ring, ball((0, 0, 0), 4, 3)]), cavities=True).faces.inward.any()
