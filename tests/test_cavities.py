"""Pieces and cavities of a mesh are told apart, and a place is found in every cavity, as finite elements need it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from scipy import ndimage

from conftest import composed, cuberille_of, law, solids
from tomomesh import TriMesh, assess
from tomomesh.cli import main
from tomomesh.measure.winding import linings, places_in_cavities, winding_number

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray


def joined(*parts: trimesh.Trimesh) -> TriMesh:
    found = trimesh.util.concatenate(parts)
    return TriMesh(np.array(found.vertices), np.array(found.faces, np.int64))


def ball(radius: float, center: tuple[float, ...] = (0, 0, 0), *, inward: bool = False) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(2, radius=radius)
    made.apply_translation(center)
    if inward:
        made.invert()
    return made


def enclosed(solid: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """Number the empty cells that the outside does not reach, by what they hang together in."""
    found, count = ndimage.label(np.pad(~solid, 1, constant_values=True))
    inner = np.where(found == found[0, 0, 0], 0, found)[1:-1, 1:-1, 1:-1]
    return inner, count - 1


class TestPlaces:
    @law(80)
    @given(solid=solids(7))
    def test_each_cavity_of_a_cuberille_has_one(self, solid: NDArray[np.bool_]) -> None:
        solid = composed(np.pad(solid, 1, constant_values=True) if solid.mean() > 0.5 else solid)
        cavities, count = enclosed(solid)
        places = places_in_cavities(cuberille_of(solid).triangulated())
        inside = [cavities[tuple(np.floor(place).astype(int))] for place in places]
        assert sorted(inside) == sorted({*cavities.ravel()} - {0})
        assert len(places) == count

    def test_a_cavity_with_an_island_in_it(self) -> None:
        """The middle of the cavity is solid; the place is not."""
        mesh = joined(ball(10), ball(8, inward=True), ball(6), ball(3, inward=True))
        places = places_in_cavities(mesh)
        away = np.sort(np.linalg.norm(places, axis=1))
        assert len(places) == linings(mesh) == 2
        assert away[0] < 3
        assert 6 < away[1] < 8
        for place in places:
            assert winding_number(mesh, place) == pytest.approx(0, abs=1e-9)

    @pytest.mark.parametrize("shift", [0.0, 5e6])
    def test_a_flat_cavity_and_a_far_one(self, shift: float) -> None:
        flat = trimesh.creation.box((8, 8, 0.001))
        flat.invert()
        mesh = joined(trimesh.creation.box((10, 10, 10)), flat)
        (place,) = places_in_cavities(mesh.moved(mesh.vertices + shift))
        assert np.abs(place - shift)[2] < 0.0005
        assert np.abs(place - shift)[:2].max() < 4


class TestReport:
    def test_pieces_and_cavities_are_told_apart(self) -> None:
        mesh = joined(ball(10), ball(2, (5, 0, 0), inward=True), ball(2, (-5, 0, 0), inward=True), ball(3, (20, 0, 0)))
        found = assess(mesh, cavities=2)
        assert (found["components"], found["pieces"], found["cavities"]) == (4, 2, 2)
        assert sorted(round(place[0] / 5) for place in found["cavity_places_mm"]) == [-1, 1]

    def test_a_piece_that_faces_inward_is_no_cavity(self) -> None:
        mesh = joined(ball(10), ball(2, (5, 0, 0), inward=True), ball(3, (20, 0, 0), inward=True))
        found = assess(mesh, cavities=linings(mesh))
        assert (found["pieces"], found["cavities"], found["inward_components"]) == (2, 1, 1)
        ((x, y, z),) = found["cavity_places_mm"]
        assert np.linalg.norm([x - 5, y, z]) < 2

    def test_a_mesh_without_cavities(self) -> None:
        found = assess(joined(ball(1)))
        assert (found["pieces"], found["cavities"], found["cavity_places_mm"]) == (1, 0, [])

    def test_check_says_it(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        mesh = joined(ball(10), ball(2, inward=True))
        trimesh.Trimesh(mesh.vertices, mesh.faces).export(tmp_path / "m.stl")
        assert main(["check", str(tmp_path / "m.stl")]) == 0
        assert "1 piece(s) with 1 cavity(ies), Euler number 4" in capsys.readouterr().out
        assert main(["check", str(tmp_path / "m.stl"), "--json"]) == 0
        told: dict[str, Any] = json.loads(capsys.readouterr().out)
        assert np.linalg.norm(told["cavity_places_mm"][0]) < 2
