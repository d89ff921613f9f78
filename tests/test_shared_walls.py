"""The walls between all labels of a map as one net: neighbors share every triangle, and no two meshes overlap."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from label_walls import AFFINE, boundaries, label_maps, labelled, triangles, walls_of
from tomomesh import Volume, reconstruct, reconstruct_labels
from tomomesh.errors import EmptyError
from tomomesh.isosurface.rings import Rings
from tomomesh.isosurface.walls.block import LabelBlock
from tomomesh.isosurface.walls.net import net_between
from tomomesh.isosurface.well_composed import JOINING, cells_where
from tomomesh.measure.intersections import CrossingFaces
from tomomesh.measure.topology import check_promise

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Solid = Callable[[Any], Any]


class TestComposed:
    @law(100)
    @given(label_maps())
    def test_no_label_touches_itself_along_an_edge_or_at_a_corner_alone(self, voxels: NDArray[Any]) -> None:
        block = LabelBlock.of(labelled(voxels))
        for index in range(1, len(block.numbers) + 1):
            assert not len(cells_where(block.labels == index, JOINING > 0)[0])

    @law(100)
    @given(label_maps())
    def test_what_is_told_to_be_given_is_what_was(self, voxels: NDArray[Any]) -> None:
        found = labelled(voxels)
        block = LabelBlock.of(found)
        before = np.append(0, block.numbers)[block.labels]
        before.reshape(-1)[block.given] = np.append(0, block.numbers)[block.before]
        low = block.low[::-1] + 1
        box = tuple(slice(at, at + size - 2) for at, size in zip(low, before.shape, strict=True))
        np.testing.assert_array_equal(before[1:-1, 1:-1, 1:-1], found.volume.voxels[box])
        assert np.count_nonzero(found.volume.voxels) == np.count_nonzero(before)
        assert (block.labels.reshape(-1)[block.given] != block.before).all()

    @law(60)
    @given(label_maps(), st.sampled_from([(0,), (1,), (2,), (0, 1, 2)]))
    def test_mirrored_maps_have_mirrored_labels(self, voxels: NDArray[Any], axes: tuple[int, ...]) -> None:
        one, other = (LabelBlock.of(labelled(side, np.eye(4))).labels for side in (voxels, np.flip(voxels, axes)))
        np.testing.assert_array_equal(np.flip(one, axes), other)

    def test_a_map_without_contacts_stays_as_it_is(self) -> None:
        voxels = np.repeat(np.repeat(np.arange(1, 9).reshape(2, 2, 2), 3, axis=0), 2, axis=2)
        assert not len(LabelBlock.of(labelled(voxels)).given)

    def test_a_label_may_lose_all_of_its_voxels(self) -> None:
        crossed = np.array([[[1, 2], [3, 1]]])
        found = reconstruct_labels(Volume.from_stored(crossed, np.eye(4)), shared_walls=True)
        with pytest.raises(EmptyError, match="nothing is left of the label"):
            found[1]
        assert found[2].report["walls"]["gained"] + found[3].report["walls"]["gained"] == 2


def squares_by_definition(labels: NDArray[np.uint16]) -> dict[tuple[int, ...], tuple[int, int]]:
    """Return each pair of neighboring voxels (x, y, z twice) of different labels, the larger first, and the labels."""
    found = {}
    for z, y, x in np.ndindex(labels.shape):
        for axis in range(3):
            other = [x, y, z]
            other[axis] += 1
            if other[axis] < labels.shape[2 - axis]:
                one, two = int(labels[z, y, x]), int(labels[other[2], other[1], other[0]])
                if one != two:
                    pair = ((x, y, z), tuple(other)) if one > two else (tuple(other), (x, y, z))
                    found[*pair[0], *pair[1]] = (max(one, two), min(one, two))
    return found


class TestNet:
    @law(40)
    @given(label_maps())
    def test_squares_are_those_of_the_definition(self, voxels: NDArray[Any]) -> None:
        block = LabelBlock.of(labelled(voxels))
        net = net_between(block)
        voxel = net.inner - block.low
        rows = zip(np.hstack([voxel, voxel + net.steps]).tolist(), net.labels.tolist(), strict=True)
        assert {tuple(pair): tuple(labels) for pair, labels in rows} == squares_by_definition(block.labels)
        middles = net.low[net.quads].mean(axis=1) + 0.5
        np.testing.assert_array_equal(middles, net.inner + 0.5 * net.steps)
        corners = net.low[net.quads]
        turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        np.testing.assert_array_equal(turn, net.steps)

    @law(40)
    @given(label_maps())
    def test_vertices_feel_their_wall_and_those_where_walls_meet_their_curve(self, voxels: NDArray[Any]) -> None:
        net = net_between(LabelBlock.of(labelled(voxels)))
        around: dict[int, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
        opposite: dict[int, list[int]] = defaultdict(list)
        for number, square in enumerate(net.quads.tolist()):
            for side in range(4):
                here, there = square[side], square[(side + 1) % 4]
                around[here][there].append(number)
                around[there][here].append(number)
                opposite[here].append(square[(side + 2) % 4])
        rings = Rings.of(net, 0)
        for v, sides in around.items():
            curve = [other for other, squares in sides.items() if len(squares) > 2]
            felt = curve or [*sides]
            assert sorted(set(rings.beside[v].tolist()) - {v}) == sorted(felt)
            assert round(1 / rings.shares[v]) == len(felt)
            across = set(rings.aslant[v].tolist()) - {v}
            assert across == (set() if curve else set(opposite[v]))

    @law(40)
    @given(label_maps())
    def test_beyond_a_side_lies_the_other_square_of_the_wall(self, voxels: NDArray[Any]) -> None:
        net = net_between(LabelBlock.of(labelled(voxels)))
        sides = defaultdict(list)
        for number, square in enumerate(net.quads.tolist()):
            for side in range(4):
                sides[frozenset((square[side], square[(side + 1) % 4]))].append(4 * number + side)
        for places in sides.values():
            for place in places:
                (other,) = [one for one in places if one != place] if len(places) == 2 else [-1]
                assert net.twins.reshape(-1)[place] == other


class TestMeshes:
    @law(60)
    @given(label_maps())
    def test_each_is_closed_manifold_outward_and_crosses_nothing(self, voxels: NDArray[Any]) -> None:
        walls = walls_of(voxels)
        for one in boundaries(walls).values():
            check_promise(one.made.mesh, cavities=one.cavities)
        assert not CrossingFaces()(walls.mesh).any()

    @law(60)
    @given(label_maps())
    def test_each_wall_is_in_two_meshes_turned_over(self, voxels: NDArray[Any]) -> None:
        walls = walls_of(voxels)
        found = {number: Counter(triangles(one.made.mesh)) for number, one in boundaries(walls).items()}
        turned = {number: Counter(one[:1] + one[:0:-1] for one in each) for number, each in found.items()}
        for number, one in boundaries(walls).items():
            shared = Counter[Any]()
            for other in found:
                common = found[number] & turned[other]
                assert common.total() == 0 or other != number
                shared += common
            assert max(shared.values(), default=1) == 1
            of_fours = Counter(triangles(one.made.mesh)).total() - 2 * len(one.net.quads)
            inner = int(np.count_nonzero(one.beyond))
            assert 2 * inner <= shared.total() <= 2 * inner + of_fours
        every = sum(found.values(), Counter())
        assert every.total() == sum(len(one.made.mesh.faces) for one in boundaries(walls).values())
        assert max(every.values()) == 1

    @law(60)
    @given(label_maps())
    def test_volumes_sum_up_to_that_of_all_together(self, voxels: NDArray[Any]) -> None:
        walls = walls_of(voxels)
        parts = sum(one.made.mesh.face_volumes.sum() for one in boundaries(walls).values())
        outer = np.repeat(walls.net.labels[:, 1] == 0, 2)
        fours = np.repeat(walls.net.labels[walls.fours, 1] == 0, 2)
        whole = walls.mesh.face_volumes[np.concatenate([outer, fours])].sum()
        assert parts == pytest.approx(whole, rel=1e-12)

    @law(40)
    @given(label_maps())
    def test_the_exact_volume_in_voxels_is_that_of_the_labels(self, voxels: NDArray[Any]) -> None:
        walls = walls_of(voxels)
        counts = np.bincount(walls.block.labels.ravel(), minlength=len(walls.block.numbers) + 1)
        for number, one in boundaries(walls).items():
            assert one.volumes.sum() == counts[walls.block.index(number)]

    @law(60)
    @given(label_maps(), st.sampled_from([1, 5]))
    def test_a_label_by_itself_is_the_net_around_its_voxels(self, voxels: NDArray[Any], number: int) -> None:
        """To the byte the mesh of `--way voxels` with neither specks left out nor triangles made even."""
        block = LabelBlock.of(labelled((voxels == voxels[0, 0, 0]).astype(np.uint8)))
        volume = Volume.from_stored(block.labels * number, AFFINE)  # in background: else it would be no mask alone
        one = reconstruct(volume, select=(number,), way="voxels", keep="all", remesh=False, divide=False)
        other = reconstruct_labels(volume, shared_walls=True)[number]
        for name in ("mesh", "smoothed"):
            before, after = getattr(one, name), getattr(other, name)
            assert before.vertices.tobytes() == after.vertices.tobytes()
            assert before.faces.tobytes() == after.faces.tobytes()
        np.testing.assert_array_equal(one.points.positions, other.points.positions)
        np.testing.assert_array_equal(one.points.kinds, other.points.kinds)
        assert one.cavities == other.cavities
        assert one.report["quality"] == other.report["quality"]

    @law(20)
    @given(label_maps(), st.integers(2, 5))
    def test_neither_threads_nor_the_labels_asked_for_change_a_byte(self, voxels: NDArray[Any], threads: int) -> None:
        volume = Volume.from_stored(voxels, AFFINE)
        some = reconstruct_labels(volume, shared_walls=True, threads=threads, select=(int(abs(voxels[0, 0, 0])),))
        every = reconstruct_labels(volume, shared_walls=True, threads=1)
        for number in some:
            if walls_of(voxels).of(number) is not None:
                assert some[number].mesh.vertices.tobytes() == every[number].mesh.vertices.tobytes()
                assert some[number].mesh.faces.tobytes() == every[number].mesh.faces.tobytes()

    @law(30)
    @given(label_maps(), st.sampled_from([0, 1, 2]))
    def test_mirrored_maps_have_mirrored_vertices(self, voxels: NDArray[Any], axis: int) -> None:
        one, other = (walls_of(side, np.eye(4)) for side in (voxels, np.flip(voxels, axis)))
        found = other.fit.positions.copy()
        found[:, 2 - axis] = voxels.shape[axis] - 1 - found[:, 2 - axis]
        first, second = (np.array(sorted(map(tuple, np.round(each, 9)))) for each in (one.fit.positions, found))
        np.testing.assert_allclose(first, second, atol=1e-8)
