"""The camera's laws, and what it sees of faces."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from test_show import box, round_mesh
from tomomesh.show.camera import KEY_LIGHT, Camera, brightness, normals

BALL, CUBE = round_mesh(), box()
cameras = st.builds(Camera, st.floats(-180, 180), st.floats(-89, 89))


class TestCamera:
    @given(cameras)
    def test_turns_without_stretching(self, camera: Camera) -> None:
        np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12)
        assert math.isclose(np.linalg.det(camera.rotation), 1.0)

    @given(cameras, st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))
    def test_keeps_lengths_across_the_view(self, camera: Camera, depth: float, turn: float) -> None:
        across = math.cos(turn) * camera.rotation[0] + math.sin(turn) * camera.rotation[1]
        ends = camera.project(np.array([[0.0, 0, 0], 7 * across]) + depth * camera.rotation[2])
        assert math.isclose(math.hypot(*(ends[1] - ends[0])[:2]), 7, abs_tol=1e-9)

    @given(cameras)
    def test_has_z_up(self, camera: Camera) -> None:
        right, up, _ = camera.project(np.array([0.0, 0.0, 1.0]))
        assert abs(right) < 1e-12
        assert up > 0

    def test_looks_at_the_face(self) -> None:
        in_front = Camera(0, 0).project(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
        np.testing.assert_allclose(in_front, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)

    def test_goes_to_the_patients_left(self) -> None:
        assert Camera(90, 0).project(np.array([1.0, 0, 0]))[2] == pytest.approx(1)


class TestLight:
    def test_normals_are_the_judges(self) -> None:
        judge = trimesh.Trimesh(BALL.vertices, BALL.faces, process=False)
        np.testing.assert_allclose(normals(BALL.vertices, BALL.faces), judge.face_normals, atol=1e-12)
        outward = CUBE.vertices[CUBE.quads].mean(axis=1) - 0.5
        np.testing.assert_allclose(normals(CUBE.vertices, CUBE.quads), 2 * outward)

    @pytest.mark.parametrize("size", [1e-150, 1e150])
    def test_normals_of_any_size_are_those_of_size_one(self, size: float) -> None:
        one, other = (normals(each * BALL.vertices, BALL.faces) for each in (1.0, size))
        np.testing.assert_allclose(other, one, atol=1e-9)

    def test_faces_without_area_have_no_normal(self) -> None:
        np.testing.assert_array_equal(normals(np.zeros((3, 3)), np.array([[0, 1, 2]])), 0)

    def test_light_is_brightest_toward_the_lamp(self) -> None:
        light = brightness(BALL.vertex_normals)
        assert light.min() >= 0
        assert light.max() <= 1
        key = KEY_LIGHT / np.linalg.norm(KEY_LIGHT)
        assert BALL.vertex_normals[light.argmax()] @ key > 0.8
