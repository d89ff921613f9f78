"""Readers of meshes beside slow twins: polygons in text, equal positions, objects within objects."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import FormatError
from tomomesh.io import read_mesh
from tomomesh.io.files.markup import parsed_until, parsed_xml
from tomomesh.io.meshes.cells import weld
from tomomesh.io.meshes.frame import frame_of_file
from tomomesh.io.meshes.obj import read_obj_mesh
from tomomesh.io.meshes.off import read_off
from tomomesh.io.meshes.threemf import CORE
from tomomesh.model.columns import carried

if TYPE_CHECKING:
    from pathlib import Path

POLYGONS = st.lists(st.lists(st.integers(0, 9), min_size=3, max_size=7), min_size=1, max_size=12)


@law(60)
@given(POLYGONS, st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=30, max_size=30), st.booleans())
def test_text_of_polygons_equals_a_slow_twin(polygons: list[list[int]], numbers: list[float], textured: bool) -> None:
    rows = [" ".join(map(repr, numbers[n : n + 3])) for n in range(0, 30, 3)]
    beside = "/{}/1" if textured else ""
    obj = [f"v {row} 1.0" for row in rows]
    obj += ["f " + " ".join(f"{corner + 1}{beside.format(corner + 1)}" for corner in face) for face in polygons]
    off = ["OFF", f"10 {len(polygons)} 0", *rows, *(" ".join(map(str, [len(face), *face, 0.5])) for face in polygons)]
    places, faces = np.reshape(numbers, (10, 3)), [fan for face in polygons for fan in fan_of(face)]
    for read, lines in ((read_obj_mesh, obj), (read_off, off)):
        vertices, found = read("\n".join(lines).encode(), "file")
        np.testing.assert_array_equal(vertices[found], places[faces])


def fan_of(face: list[int]) -> list[list[int]]:
    return [[face[0], face[n], face[n + 1]] for n in range(1, len(face) - 1)]


@law(60)
@given(st.lists(st.tuples(*[st.integers(-1, 1)] * 3), max_size=20))
def test_weld_equals_a_slow_twin(rows: list[tuple[int, int, int]]) -> None:
    signed = np.array(rows, np.float64).reshape(-1, 3) * np.where(np.arange(len(rows)) % 2, -1.0, 1.0)[:, None]
    unique, numbers = weld(np.asfortranarray(signed))
    firsts = dict.fromkeys(map(tuple, signed.tolist()))  # to Python, too, -0 is 0
    assert list(map(tuple, unique.tolist())) == list(firsts)
    np.testing.assert_array_equal(unique[numbers].reshape(-1, 3), signed)
    assert not np.signbit(unique[unique == 0]).any()


def test_3mf_of_objects_within_objects_at_their_places(tmp_path: Path) -> None:
    corner = (
        '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/><vertex z="1" y="0" x="0"/>'
    )
    faces = "".join(
        f'<triangle v3="{c}" v2="{b}" v1="{a}"/>' for a, b, c in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    )
    parts = "".join(f'<component objectid="1" transform="1 0 0 0 1 0 0 0 1 {5 * n} 0 0"/>' for n in range(2))
    (tmp_path / "model").write_text(
        f'<model unit="inch" xmlns="{CORE}"><!-- by hand --><metadata name="Title">a part</metadata><resources>'
        f'<object id="1"><mesh><vertices>{corner}</vertices><triangles>{faces}</triangles></mesh></object>'
        f'<object id="2"><components>{parts}</components></object></resources>'
        '<build><item objectid="2" transform="-1 0 0 0 1 0 0 0 1 0 0 2"/></build></model>'
    )
    with zipfile.ZipFile(tmp_path / "parts.3mf", "w") as archive:
        archive.write(tmp_path / "model", "3D/3dmodel.model")
    mesh = read_mesh(tmp_path / "parts.3mf")
    assert mesh.face_volumes.sum() == pytest.approx(2 / 6)  # a mirror turns the faces
    assert sorted({*mesh.vertices[:, 0].tolist()}) == [-6, -5, -1, 0]
    assert mesh.vertices[:, 2].min() == 2
    assert frame_of_file(tmp_path / "parts.3mf") == {"unit": "in"}


@law(60)
@given(st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), max_size=9), st.integers(0, 2**32 - 1))
def test_carried_equals_a_product_of_matrices(points: list[tuple[float, float, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    places, matrix, shift = np.reshape(points, (-1, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(carried(places, matrix, shift), places @ matrix + shift, rtol=1e-12, atol=1e-8)
    np.testing.assert_array_equal(carried(places, np.eye(3), np.zeros(3)), places)


@pytest.mark.parametrize("number", ["1.0", "1.9", "1e0", "nan", f"{9**30}", f"-{9**30}"])
def test_a_corner_that_is_no_whole_number_is_refused(number: str) -> None:
    corners = "1 0 0\n0 1 0\n0 0 1\n"
    with pytest.raises(FormatError):  # NumPy before 2.4 rounds it
        read_off(f"OFF\n3 1 0\n{corners}3 0 {number} 2\n".encode(), "m.off")
    with pytest.raises(FormatError):
        read_obj_mesh(("v " + corners.replace("\n", "\nv ") + f"0 0 0\nf 1 {number}/2 3\n").encode(), "m.obj")


@pytest.mark.parametrize("code", ["utf-8", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_document_type_is_refused_in_whatever_letters(code: str) -> None:
    text = f'<?xml version="1.0" encoding="{code[:6].rstrip("-")}"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'
    for parsed in (parsed_xml, lambda text, file: parsed_until("a", text, file)):
        with pytest.raises(FormatError, match="document type"):
            parsed(text.encode(code), "m")
