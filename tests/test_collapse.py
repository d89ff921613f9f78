"""What the fit must not do to a mesh, and what is done about it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tomomesh import reconstruct_points
from tomomesh.dynamics.collapse import without_collapse
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.mesh import TriMesh


def two_balls() -> TriMesh:
    ball = trimesh.creation.icosphere(2)
    vertices = np.concatenate([ball.vertices, 0.2 * ball.vertices + 5])
    return TriMesh(vertices, np.concatenate([ball.faces, ball.faces + len(ball.vertices)]).astype(np.int64))


class TestWithoutCollapse:
    def test_leaves_a_good_fit_alone(self) -> None:
        mesh = two_balls()
        fitted = mesh.moved(1.1 * mesh.vertices)
        found, collapsed = without_collapse(mesh, fitted)
        assert collapsed == 0
        np.testing.assert_array_equal(found.vertices, fitted.vertices)

    def test_takes_a_component_back_that_turned_inside_out(self) -> None:
        mesh = two_balls()
        half = len(mesh.vertices) // 2
        turned = mesh.vertices.copy()
        turned[half:] = 10 - turned[half:]
        found, collapsed = without_collapse(mesh, mesh.moved(turned))
        assert collapsed == 1
        np.testing.assert_array_equal(found.vertices, mesh.vertices)

    def test_moves_vertices_apart_that_met(self) -> None:
        mesh = two_balls()
        met = mesh.vertices.copy()
        met[mesh.faces[0]] = met[mesh.faces[0, 0]]
        found, collapsed = without_collapse(mesh, mesh.moved(met))
        assert collapsed == 0
        check_promise(found)
        assert len(np.unique(found.vertices.astype(np.float32), axis=0)) == len(found.vertices)


@pytest.mark.parametrize("attraction", ["nearest", "surface"])
def test_scattered_strays_become_neither_surface_nor_a_fault(attraction: str) -> None:
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(6000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    found = reconstruct_points(np.concatenate([ball, rng.uniform(-2, 2, (40, 3))]), attraction=attraction)
    assert topology(found.mesh).sound
    assert found.report["quality"]["sound_after_welding"]
    assert found.report["surface"]["debris"] + found.report["points"].get("strays", 0) > 10
    assert found.report["quality"]["components"] == found.report["surface"]["taken"]
