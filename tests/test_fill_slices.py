"""Label maps of which some slices alone are labelled: recognised, told, and filled to one solid of the right volume."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import ndimage

from studies import write_nifti
from tomomesh import compare_with_study, reconstruct
from tomomesh.cli import main
from tomomesh.errors import EmptyError, UsageError
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.model.volume import Volume
from tomomesh.segmentation.contours.labelled import filled_slices, gaps_in

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

SIZE = 64
K, J, X = np.indices((SIZE,) * 3) - 31.3
SPACING = np.diag([0.7, 0.7, 1.0, 1.0])


def rod(start: Any, stop: Any, radius: float) -> NDArray[np.bool_]:
    """Return the voxels within a distance of a line."""
    first, way = np.array(start, float), np.subtract(stop, start, dtype=float)
    place = np.stack([X, J, K], axis=-1) - first
    along = np.clip(place @ way / (way @ way), 0, 1)
    inside: NDArray[np.bool_] = np.linalg.norm(place - along[..., None] * way, axis=-1) <= radius
    return inside


BODIES = {
    "ball": (X**2 + J**2 + K**2 <= 22**2, 8),
    "ellipsoid": ((X / 26) ** 2 + (J / 12) ** 2 + (K / 24) ** 2 <= 1, 8),
    "lying torus": ((np.hypot(X, J) - 18) ** 2 + K**2 <= 7**2, 4),
    "standing torus": ((np.hypot(X, K) - 18) ** 2 + J**2 <= 7**2, 4),
    "slanted rod": (rod((-18, 0, -22), (18, 5, 22), 8), 8),
    "fork": (rod((0, 0, -24), (0, 0, 0), 8) | rod((0, 0, 0), (16, 0, 22), 7) | rod((0, 0, 0), (-16, 0, 22), 7), 8),
    "hollow ball": ((X**2 + J**2 + K**2 <= 24**2) & (X**2 + J**2 + K**2 > 14**2), 4),
}
"""Bodies, and the widest step of the labelled slices at which they are judged: at 8, more than the radius of its
tube, the standing torus has -5.6 to 4.0 %."""


def thinned(body: NDArray[np.bool_], step: int, first: int = 0, axis: int = 0) -> NDArray[np.bool_]:
    kept = np.zeros_like(body)
    np.moveaxis(kept, axis, 0)[first::step] = np.moveaxis(body, axis, 0)[first::step]
    return kept


def volume_of(mask: NDArray[np.bool_], affine: NDArray[np.float64] = SPACING) -> Volume:
    return Volume.from_stored(mask.astype(np.uint8), affine)


class TestSolid:
    @pytest.mark.parametrize("step", [2, 4, 8])
    @pytest.mark.parametrize("half", [0, 1])
    @pytest.mark.parametrize("name", BODIES)
    def test_its_volume_is_within_three_percent(self, name: str, step: int, half: int) -> None:
        body, widest = BODIES[name]
        if step > widest:
            pytest.skip("too few slices show what it is")
        sparse = thinned(body, step, half * step // 2)
        filled, told = filled_slices(sparse, volume_of(sparse))
        inside = filled.voxels > 0
        assert inside.sum() == pytest.approx(body.sum(), rel=0.03)
        assert 2 * (inside & body).sum() / (inside.sum() + body.sum()) > 0.9
        assert told.startswith(f"{np.ptp(np.flatnonzero(sparse.any((1, 2)))) + 1 - sparse.any((1, 2)).sum()} slices")

    @pytest.mark.parametrize("step", [3, 4, 6])
    def test_a_last_slice_of_one_pixel_makes_no_bulge(self, step: int) -> None:
        k, j, i = np.indices((30, 30, 30)) - 15
        body = k**2 + j**2 + i**2 <= 12**2  # its poles, a pixel each, lie on labelled slices
        sparse = thinned(body, step, 3)
        areas = np.count_nonzero(filled_slices(sparse, volume_of(sparse))[0].voxels > 0, axis=(1, 2))
        assert (np.diff(areas[: 15 + 1]) >= 0).all()
        assert (np.diff(areas[15:]) <= 0).all()
        assert areas.sum() == pytest.approx(body.sum(), rel=0.03)

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_slices_lie_across_any_axis(self, axis: int) -> None:
        body = BODIES["ball"][0]
        sparse = thinned(body, 4, 2, axis)
        found = gaps_in(RunMask.of([sparse]))
        assert found is not None
        assert found.axis == axis
        filled, _ = filled_slices(sparse, volume_of(sparse, np.diag([1.0, 1.0, 1.0, 1.0])))
        assert (filled.voxels > 0).sum() == pytest.approx(body.sum(), rel=0.01)

    @pytest.mark.parametrize("step", [2, 3, 5])
    @pytest.mark.parametrize("spacing", [(1, 1, 1), (0.7, 0.7, 2.0), (0.5, 0.8, 1.0)])
    @pytest.mark.parametrize("name", [*BODIES, "pole", "one pixel", "two pixels", "fin"])
    def test_what_was_drawn_stays(self, name: str, spacing: tuple[float, float, float], step: int) -> None:
        k, j, i = np.indices((SIZE,) * 3) - 31
        thin = {
            "pole": k**2 + j**2 + i**2 <= 15**2,
            "one pixel": (j == 3) & (i == -4) & (np.abs(k) <= 15),
            "two pixels": (j == 3) & (np.abs(i - 0.5) < 1) & (np.abs(k) <= 15),
            "fin": (j == 0) & (np.abs(i) <= 9) & (np.abs(k) <= 15),
        }
        body = thin[name] if name in thin else BODIES[name][0]
        sparse = thinned(body, step, 1)
        filled, _ = filled_slices(sparse, volume_of(sparse, np.diag([*spacing, 1.0])))
        drawn = sparse.any(axis=(1, 2))
        np.testing.assert_array_equal(filled.voxels[drawn] > 0, sparse[drawn])
        first, last = np.flatnonzero(drawn)[[0, -1]]
        assert (filled.voxels[first : last + 1] > 0).any(axis=(1, 2)).all()
        if name in thin:
            assert ndimage.label(filled.voxels > 0)[1] == 1

    @pytest.mark.parametrize(("name", "genus"), [("ball", 0), ("fork", 0), ("standing torus", 1)])
    def test_the_mesh_is_one_smooth_solid(self, name: str, genus: int) -> None:
        body = BODIES[name][0]
        sparse = thinned(body, 4)
        report = reconstruct(volume_of(sparse), select=(1,), fill_slices=True).report
        quality = report["quality"]
        assert (quality["closed"], quality["components"], quality["genus"]) == (True, 1, genus)
        assert quality["volume_mm3"] == pytest.approx(body.sum() * 0.49, rel=0.03)
        assert any("they were interpolated" in note for note in report["study"]["notes"])

    def test_uneven_slices_are_enough(self) -> None:
        body = BODIES["ball"][0]
        sparse = np.zeros_like(body)
        chosen = [11, 15, 17, 24, 31, 36, 44, 49]
        sparse[chosen] = body[chosen]
        filled, _ = filled_slices(sparse, volume_of(sparse))
        assert (filled.voxels > 0).sum() == pytest.approx(body.sum(), rel=0.03)

    def test_a_gap_in_a_whole_stack_is_closed(self) -> None:
        body = BODIES["ball"][0]
        sparse = body.copy()
        sparse[28:32] = False
        assert gaps_in(RunMask.of([sparse]))
        filled, _ = filled_slices(sparse, volume_of(sparse))
        assert (filled.voxels > 0).sum() == pytest.approx(body.sum(), rel=0.01)


def ball_at(x: float, z: float = 0.0, radius: float = 11.0) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (X - x) ** 2 + J**2 + (K - z) ** 2 <= radius**2
    return inside


class TestSeveralBodies:
    """Each is filled between its own slices, wherever those of the others lie."""

    @pytest.mark.parametrize("axis", [0, 1])
    @pytest.mark.parametrize(
        ("steps", "first"), [((4, 4), (0, 2)), ((4, 8), (0, 2)), ((3, 5), (1, 0)), ((8, 1), (0, 0)), ((4, 4), (1, 1))]
    )
    def test_side_by_side(self, steps: tuple[int, int], first: tuple[int, int], axis: int) -> None:
        one, other = ball_at(-14), ball_at(15)
        sparse = thinned(one, steps[0], first[0], axis) | thinned(other, steps[1], first[1], axis)
        filled, told = filled_slices(sparse, volume_of(sparse, np.diag([1.0, 1.0, 1.0, 1.0])))
        inside = filled.voxels > 0
        assert ndimage.label(inside)[1] == 2
        for body, half in ((one, slice(None, 32)), (other, slice(32, None))):
            assert inside[:, :, half].sum() == pytest.approx(body.sum(), rel=0.04)
        assert ("slices", "rows")[axis] in told

    @pytest.mark.parametrize("apart", [26, 32, 40])
    def test_over_each_other(self, apart: int) -> None:
        both = ball_at(0, -apart / 2, 9.0) | ball_at(0, apart / 2, 9.0)
        sparse = thinned(both, 3)
        inside = filled_slices(sparse, volume_of(sparse, np.diag([1.0, 1.0, 1.0, 1.0])))[0].voxels > 0
        assert ndimage.label(inside)[1] == 2
        assert inside.sum() == pytest.approx(both.sum(), rel=0.04)

    def test_legs_in_turns_join_their_trunk(self) -> None:
        left, right = rod((0, 0, 0), (-16, 0, 24), 7), rod((0, 0, 0), (16, 0, 24), 7)
        trunk = rod((0, 0, -24), (0, 0, 0), 9)
        sparse = thinned(left, 8, 3) | thinned(right, 8, 7) | thinned(trunk, 4, 3)
        inside = filled_slices(sparse, volume_of(sparse, np.diag([1.0, 1.0, 1.0, 1.0])))[0].voxels > 0
        assert ndimage.label(inside)[1] == 1
        assert inside.sum() == pytest.approx((left | right | trunk).sum(), rel=0.05)


class TestRecognised:
    def test_whole_bodies_and_two_that_taper_are_no_gaps(self) -> None:
        for body, _ in BODIES.values():
            assert gaps_in(RunMask.of([body])) is None
        two = (X**2 + J**2 + (np.abs(K) - 16) ** 2) <= 13**2
        assert not two.any(axis=(1, 2)).all()
        assert gaps_in(RunMask.of([two])) is None

    def test_an_empty_mask_has_none(self) -> None:
        assert gaps_in(RunMask.none((4, 5, 6))) is None

    def test_it_is_told_and_the_option_named(self) -> None:
        sparse = thinned(BODIES["ball"][0], 8)
        notes = reconstruct(volume_of(sparse), select=(1,)).report["study"]["notes"]
        assert any("28 slices are empty between 5" in note and "--fill-slices" in note for note in notes)

    def test_without_gaps_and_on_one_slice_it_is_refused(self) -> None:
        body = BODIES["ball"][0]
        with pytest.raises(UsageError, match="no slice without labels"):
            reconstruct(volume_of(body), select=(1,), fill_slices=True)
        with pytest.raises((UsageError, EmptyError)):
            reconstruct(volume_of(thinned(body, 40, 31)), select=(1,), fill_slices=True)
        with pytest.raises(UsageError, match="--select"):
            reconstruct(volume_of(body), fill_slices=True, lower=0.5)

    def test_a_comparison_tells_of_them_too(self) -> None:
        body = BODIES["ball"][0]
        mesh = reconstruct(volume_of(body), select=(1,)).mesh
        sparse = volume_of(thinned(body, 8))
        missed = compare_with_study(mesh, sparse, select=(1,))
        filled = compare_with_study(mesh, sparse, select=(1,), fill_slices=True)
        assert any("--fill-slices interpolates them" in note for note in missed["notes"])
        assert any("they were interpolated" in note for note in filled["notes"])
        assert missed["dice"] < 0.3 < 0.95 < filled["dice"]

    def test_the_command_line_has_it(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        write_nifti(tmp_path / "l.nii", thinned(BODIES["ball"][0], 4).astype(np.uint8), SPACING)
        line = ["reconstruct", "--labels-in", str(tmp_path / "l.nii"), "--select", "1", "-o", str(tmp_path / "m.ply")]
        assert main([*line, "--fill-slices"]) == 0
        assert "they were interpolated" in capsys.readouterr().out
