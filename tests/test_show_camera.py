"""The camera's laws, and what it sees of faces."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from test_show import box, round_mesh
from tomomesh.show.camera import KEY_LIGHT, Camera, brightness, normals, painted

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


class TestPainting:
    @given(cameras)
    def test_keeps_only_what_faces_the_viewer(self, camera: Camera) -> None:
        mesh = trimesh.creation.icosphere(subdivisions=1)
        order = painted(camera.project(np.asarray(mesh.triangles)))
        toward = np.asarray(mesh.face_normals) @ camera.rotation[2]
        assert set(order) >= set(np.flatnonzero(toward > 1e-9))
        assert not set(order) & set(np.flatnonzero(toward < -1e-9))

    @given(cameras)
    def test_goes_from_back_to_front(self, camera: Camera) -> None:
        seen = camera.project(np.asarray(trimesh.creation.torus(3, 1, 12, 8).triangles))
        assert (np.diff(seen[painted(seen), :, 2].mean(axis=1)) >= 0).all()

    def test_has_equal_fronts_and_backs(self) -> None:
        seen = Camera().project(BALL.corners)
        a, b = (seen[:, n, :2] - seen[:, 0, :2] for n in (1, 2))
        signed = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        front = painted(seen)
        assert signed[front].sum() == pytest.approx(0.5 * np.abs(signed).sum())

    def test_normals_are_the_judges(self) -> None:
        judge = trimesh.Trimesh(BALL.vertices, BALL.faces, process=False)
        np.testing.assert_allclose(normals(BALL.corners), judge.face_normals, atol=1e-12)
        outward = CUBE.vertices[CUBE.quads].mean(axis=1) - 0.5
        np.testing.assert_allclose(normals(CUBE.vertices[CUBE.quads]), 2 * outward)

    def test_leaves_out_faces_without_area(self) -> None:
        assert not len(painted(np.zeros((2, 3, 3))))

    def test_light_is_brightest_toward_the_lamp(self) -> None:
        light = brightness(BALL.vertex_normals)
        assert light.min() >= 0
        assert light.max() <= 1
        key = KEY_LIGHT / np.linalg.norm(KEY_LIGHT)
        assert BALL.vertex_normals[light.argmax()] @ key > 0.8
