"""A way is a value: one file and one line in the table make it known everywhere."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tomomesh.ways
from studies import write_nifti
from tomomesh import Volume, phantom, reconstruct, segment
from tomomesh.cli import main
from tomomesh.report import AFTER, BEFORE
from tomomesh.settings import Settings, parameters
from tomomesh.ways import WAYS, choose_way, way_of
from tomomesh.ways.way import INPUTS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from _pytest.capture import CaptureFixture

TOY = '''
"""The convex hull of the window."""

import numpy as np
from scipy.spatial import ConvexHull

from tomomesh.model.mesh import QuadMesh, TriMesh
from tomomesh.model.points import PointSet
from tomomesh.results import Segmentation, Surface
from tomomesh.segmentation.sample import Sampling
from tomomesh.stage import Stage
from tomomesh.ways.way import Way, parameters

NONE = np.empty(0)


def segment_toy(kept, settings, progress):
    points = PointSet.from_positions(kept.study.to_mm(np.argwhere(kept.mask)[:, ::-1].astype(float)))
    sampling = Sampling(points, 1.0, 0, NONE, NONE)
    found = Segmentation(kept.study, kept.plane, kept.chosen.runs, kept.mask.astype(np.uint16), points, sampling, None)
    return Stage(found, {"points": {"unit": "mm", "count": len(points), "spacing_mm": 1.0}})


def surface_toy(found, settings, progress):
    hull = ConvexHull(found.points.positions)
    number = np.full(len(found.points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    places = found.points.positions[hull.vertices]
    faces = number[hull.simplices]
    a, b, c = places[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - places.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    mesh = TriMesh(places, faces.astype(np.int64))
    rough = QuadMesh(mesh.vertices, np.empty((0, 4), np.int64))
    stats = {"toy": {"corners": len(places)}}
    return Stage(Surface(found.points, rough, mesh, mesh, np.empty(0, np.int32)), stats, ("the toy fills all bays",))


WAY = Way(
    applies=lambda settings, input: input == "gray" and settings.network.network == "grid",
    because=lambda settings, input: "with the toy",
    reads=parameters("neurons"),
    segment=segment_toy,
    surface=surface_toy,
    of_networks=lambda report: ["toy       no network at all"],
    of_body=lambda report: [f"toy       {report['toy']['corners']} corners"],
    pictures=lambda found: {"points": found.points},
)
'''


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Add a way: one file, one line."""
    (tmp_path / "hull.py").write_text(TOY)
    monkeypatch.setattr(tomomesh.ways, "__path__", [*tomomesh.ways.__path__, str(tmp_path)])
    others = dict(WAYS)
    WAYS.clear()
    WAYS.update({"hull": "a study, as a toy: its convex hull"} | others)
    yield
    WAYS.clear()
    WAYS.update(others)


def ball() -> Volume:
    away = np.sqrt(((np.indices((14, 14, 14)) - 6.5) ** 2).sum(axis=0))
    return Volume.from_stored((100 * np.clip(6 - away, 0, 1)).astype(np.float32), np.eye(4))


@pytest.mark.usefixtures("toy")
class TestToy:
    def test_is_seen_in_help(self, capsys: CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit):
            main(["reconstruct", "--help"])
        assert re.search(r"hull +a study, as a toy: its convex hull", capsys.readouterr().out)

    def test_is_seen_in_report_and_warnings(self) -> None:
        found = reconstruct(ball(), lower=20.0, network="grid", neurons=9, stiffness=0.5, remesh=False)
        assert found.report["way"]["name"] == "hull"
        assert found.report["way"]["because"] == "asked for by --network grid"
        assert found.report["toy"]["corners"] == len(found.mesh.vertices)
        sections = list(found.report)
        assert sections.index("points") < sections.index("toy") < sections.index("quality")
        assert found.report["warnings"][:2] == ["--stiffness has no effect with the toy", "the toy fills all bays"]
        assert found.report["quality"]["sound"]

    def test_is_seen_in_summary_and_pictures(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        study = tmp_path / "ball.nii"
        volume = ball()
        write_nifti(study, volume.voxels, np.eye(4))
        figures = tmp_path / "figures"
        line = ["reconstruct", study, "-o", tmp_path / "hull.stl", "--network", "grid", "--lower", "20"]
        assert main([*map(str, line), "--figures", str(figures)]) == 0
        said = capsys.readouterr().out.splitlines()
        assert "toy       no network at all" in said
        assert [one for one in said if re.fullmatch(r"toy       \d+ corners", one)]
        assert "warning   the toy fills all bays" in said
        names = {path.stem for path in figures.iterdir()}
        assert {"03-relief", "04-window", "07-points", "09-wireframe", "10-shaded"} <= names
        assert not {"05-regions", "06-network", "11-fit"} & names


class TestTable:
    @pytest.mark.parametrize("name", WAYS)
    def test_a_way_reads_parameters_that_there_are(self, name: str) -> None:
        way, choices = way_of(name), {entry.name: entry.metadata["choices"] for _, entry in parameters()}
        assert set(way.reads) <= set(choices)
        for conditions in way.reads.values():
            assert all(set(values) < set(choices[other]) for other, values in conditions.items())
        assert (way.segment is None) == (name in ("filled", "nearest", "stack", "sheet", "cloud"))

    @pytest.mark.parametrize(
        ("input", "changes", "way"),
        [
            ("gray", {}, "rings"),
            ("color", {}, "rings"),
            ("gray", {"network": "grid"}, "networks"),
            ("gray", {"contours": "walls"}, "contours"),
            ("gray", {"network": "none"}, "voxels"),
            ("gray", {"network": "torus"}, "space"),
            ("gray", {"network": "chain", "space": "volume"}, "space"),
            ("gray", {"open": True, "attraction": "nearest"}, "networks"),
            ("cloud", {}, "cloud"),
            ("cloud", {"open": True}, "sheet"),
            ("cloud", {"attraction": "nearest"}, "nearest"),
            ("stack", {}, "stack"),
            ("stack", {"attraction": "nearest"}, "nearest"),
            ("stack", {"network": "none"}, "stack"),
        ],
    )
    def test_the_first_that_applies_is_taken(self, input: str, changes: dict[str, Any], way: str) -> None:
        assert choose_way(Settings().replace(**changes), input) == way

    @pytest.mark.parametrize("input", INPUTS)
    @pytest.mark.parametrize("network", ["ring", "none", "sphere", "grid"])
    def test_there_is_one_for_everything(self, input: str, network: str) -> None:
        assert choose_way(Settings().replace(network=network), input) in WAYS


class TestStages:
    def test_a_segmentation_tells_of_stage_one_alone(self) -> None:
        head = phantom()
        window: dict[str, Any] = {"lower": head.lower, "upper": head.upper}
        alone, whole = segment(head.volume, **window), reconstruct(head.volume, **window)
        assert whole.segmentation is not None
        inner, first = whole.segmentation.report, alone.report
        assert not {"cubes", "surface", "fit", "quality"} & set(inner)
        for told in (inner, first):
            told.pop("timings")
        assert inner == first

    def test_sections_are_ordered_once(self) -> None:
        assert len({*BEFORE, *AFTER}) == len(BEFORE) + len(AFTER)
