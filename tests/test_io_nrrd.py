"""NRRD: spaces, encodings, data files, and what the header leaves out; pynrrd and SimpleITK as judges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from studies import AFFINES, SHEARED, TURNED, assert_in_place, sampled
from tomomesh.errors import EmptyError, FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings
from writers import assert_agrees, needed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestNrrd:
    def write(self, path: Path, affine: NDArray[np.float64], signs: Any = (1, 1, 1), **fields: Any) -> Path:
        """Write by pynrrd; its arrays are fastest axis first."""
        nrrd = needed("nrrd")
        header = {
            "space": "left-posterior-superior",
            "space directions": (affine[:3, :3] * np.reshape(signs, (3, 1))).T,
            "space origin": affine[:3, 3] * signs,
            **fields,
        }
        nrrd.write(str(path), sampled(affine).T, {key: value for key, value in header.items() if value is not None})
        return path

    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize(
        ("space", "signs"),
        [
            ("left-posterior-superior", (1, 1, 1)), ("LPS", (1, 1, 1)),
            ("right-anterior-superior", (-1, -1, 1)), ("RAS", (-1, -1, 1)),
            ("left-anterior-superior", (1, -1, 1)), ("LAS", (1, -1, 1)),
        ],
    )  # fmt: skip
    def test_every_space_becomes_lps(self, tmp_path: Path, space: str, signs: Any, turn: str) -> None:
        path = self.write(tmp_path / "s.nrrd", TURNED[turn], signs, space=space)
        volume = read_volume(path)
        assert_in_place(volume)
        assert_agrees(volume, needed("SimpleITK").ReadImage(str(path)))

    def test_sheared_axes_stay_sheared(self, tmp_path: Path) -> None:
        volume = read_volume(self.write(tmp_path / "s.nrrd", SHEARED))
        assert_in_place(volume)
        np.testing.assert_allclose(volume.grid.affine, SHEARED, atol=1e-9)

    @pytest.mark.parametrize(
        "units", [["um", "um", "um"], ["mm", "um", "cm"], ["microns", "", "???"], ["in", "m", "nm"]]
    )
    @pytest.mark.parametrize("more", [0, 1])
    def test_spacings_have_a_unit_of_each_axis(self, tmp_path: Path, units: list[str], more: int) -> None:
        size = [
            {"um": 1e-3, "microns": 1e-3, "cm": 10, "in": 25.4, "m": 1e3, "nm": 1e-6}.get(unit, 1) for unit in units
        ]
        spacings = [mm / one for mm, one in zip((0.5, 0.7, 2.0), size, strict=True)]
        header = {"spacings": spacings + [1.0] * more, "units": units + ["s"] * more}
        kinds = {"kinds": ["space"] * 3 + ["time"]} if more else {}
        stored = sampled(np.diag([0.5, 0.7, 2.0, 1.0])).T
        needed("nrrd").write(str(tmp_path / "s.nrrd"), stored[..., None] if more else stored, {**header, **kinds})
        volume = read_volume(tmp_path / "s.nrrd")
        np.testing.assert_allclose(volume.spacing_mm, (0.5, 0.7, 2.0))
        assert_in_place(volume)

    def test_a_unit_that_is_none_of_length_is_refused(self, tmp_path: Path) -> None:
        header = {"spacings": [1.0, 1.0, 1.0], "units": ["mm", "mm", "sec"]}
        needed("nrrd").write(str(tmp_path / "s.nrrd"), sampled(np.eye(4)).T, header)
        with pytest.raises(GeometryError, match="units = mm mm sec"):
            read_volume(tmp_path / "s.nrrd")

    def test_no_directions_at_all_are_a_missing_spacing(self, tmp_path: Path) -> None:
        path = self.write(tmp_path / "s.nrrd", AFFINES["axial"], **{"space directions": None})
        text = path.read_bytes().replace(b"space: ", b"space directions: none none none\nspace: ", 1)
        path.write_bytes(text)
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(path)
        assert read_volume(path, settings=SPACING).spacing_mm == SPACING.spacing

    @pytest.mark.parametrize("encoding", ["raw", "gzip", "bzip2", "ascii"])
    @pytest.mark.parametrize("endian", ["little", "big"])
    @pytest.mark.parametrize("suffix", [".nrrd", ".nhdr"])
    def test_every_encoding(self, tmp_path: Path, encoding: str, endian: str, suffix: str) -> None:
        affine = AFFINES["oblique"]
        self.write(tmp_path / f"s{suffix}", affine, encoding=encoding, endian=endian)
        nrrd = needed("nrrd")
        data, _ = nrrd.read(str(tmp_path / f"s{suffix}"))
        volume = read_volume(tmp_path / f"s{suffix}")
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), data.T)
        assert_in_place(volume)
        assert volume.voxels.dtype.isnative

    def test_voxels_at_the_end_and_behind_lines(self, tmp_path: Path) -> None:
        whole = self.write(tmp_path / "s.nrrd", AFFINES["axial"], encoding="raw").read_bytes()
        head, blank, data = whole.partition(b"\n\n")
        (tmp_path / "end.nrrd").write_bytes(head + b"\nbyte skip: -1" + blank + b"whatever it is" + data)
        (tmp_path / "lines.nrrd").write_bytes(head + b"\nline skip: 2\nbyte skip: 3" + blank + b"a\nb\nxyz" + data)
        for name in ("end", "lines"):
            assert_in_place(read_volume(tmp_path / f"{name}.nrrd"))

    def test_lists_and_patterns_of_data_files(self, tmp_path: Path) -> None:
        affine = AFFINES["oblique"]
        stored = sampled(affine)
        head = self.write(tmp_path / "s.nhdr", affine, encoding="raw").read_bytes().decode()
        head = "\n".join(line for line in head.splitlines() if line and not line.startswith("data file"))
        for k, pixels in enumerate(stored):
            (tmp_path / f"slice{k + 3:02d}.raw").write_bytes(pixels.tobytes())
        names = "\n".join(f"slice{k + 3:02d}.raw" for k in range(len(stored)))
        (tmp_path / "list.nhdr").write_text(f"{head}\ndata file: LIST\n{names}\n")
        (tmp_path / "pattern.nhdr").write_text(f"{head}\ndata file: slice%02d.raw 3 7 1\n")
        for name in ("list", "pattern"):
            assert_in_place(read_volume(tmp_path / f"{name}.nhdr"))

    def test_meters_and_microns_become_millimeters(self, tmp_path: Path) -> None:
        scaled = np.diag([1000, 1000, 1000, 1.0]) @ AFFINES["oblique"]
        nrrd = needed("nrrd")
        header = {
            "space": "LPS", "space directions": scaled[:3, :3].T, "space origin": scaled[:3, 3],
            "space units": ["um", "um", "um"],
        }  # fmt: skip
        nrrd.write(str(tmp_path / "s.nrrd"), sampled(AFFINES["oblique"]).T, header)
        volume = read_volume(tmp_path / "s.nrrd")
        assert_in_place(volume)
        assert "millimeters" in volume.notes[0]

    def test_each_axis_of_the_space_has_its_own_unit(self, tmp_path: Path) -> None:
        scaled = np.diag([1000, 1, 0.1, 1.0]) @ AFFINES["oblique"]
        told = {"space units": ["um", "mm", "cm"]}
        path = self.write(tmp_path / "s.nrrd", scaled, **told)
        volume = read_volume(path)
        np.testing.assert_allclose(volume.grid.affine, AFFINES["oblique"], atol=1e-9)

    def test_spacings_alone_are_taken_and_told(self, tmp_path: Path) -> None:
        path = self.write(
            tmp_path / "s.nrrd", AFFINES["axial"], space=None, **{
                "space directions": None, "space origin": None, "spacings": [0.5, 0.7, 2.0],
            }
        )  # fmt: skip
        volume = read_volume(path)
        np.testing.assert_array_equal(volume.affine, np.diag([0.5, 0.7, 2, 1]))
        assert "no directions" in volume.notes[0]

    def test_without_any_frame_a_spacing_is_asked_for(self, tmp_path: Path) -> None:
        nrrd = needed("nrrd")
        nrrd.write(str(tmp_path / "s.nrrd"), sampled(AFFINES["axial"]).T)
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "s.nrrd")
        assert read_volume(tmp_path / "s.nrrd", settings=SPACING).spacing_mm == SPACING.spacing

    def test_a_list_of_layers_is_no_space(self, tmp_path: Path) -> None:
        nrrd = needed("nrrd")
        stored = sampled(AFFINES["oblique"])
        directions = np.vstack([np.full(3, np.nan), AFFINES["oblique"][:3, :3].T])
        header = {"space": "LPS", "space directions": directions, "space origin": AFFINES["oblique"][:3, 3]}
        nrrd.write(str(tmp_path / "one.nrrd"), stored.T[None], {**header, "kinds": ["list", *["domain"] * 3]})
        assert_in_place(read_volume(tmp_path / "one.nrrd"))
        nrrd.write(str(tmp_path / "two.nrrd"), np.stack([stored.T] * 2), {**header, "kinds": ["list", *["domain"] * 3]})
        with pytest.raises(FormatError, match="several values"):
            read_volume(tmp_path / "two.nrrd")


class TestHex:
    @pytest.mark.parametrize("endian", ["little", "big"])
    @pytest.mark.parametrize("line", [26, 64, 10**6])
    def test_two_digits_a_byte(self, tmp_path: Path, endian: str, line: int) -> None:
        affine = AFFINES["oblique"]
        whole = TestNrrd().write(tmp_path / "s.nrrd", affine, encoding="raw", endian=endian).read_bytes()
        head, _, data = whole.partition(b"\n\n")
        digits = data.hex()
        lines = "\n".join(digits[n : n + line] for n in range(0, len(digits), line))
        (tmp_path / "h.nrrd").write_text(head.decode().replace("encoding: raw", "encoding: hex") + "\n\n" + lines)
        volume = read_volume(tmp_path / "h.nrrd")
        assert_in_place(volume)
        judge, _ = needed("nrrd").read(str(tmp_path / "s.nrrd"))
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), judge.T)

    @pytest.mark.parametrize("digits", ["00" * 10, "0g" * 315 * 2, "0" * 630 * 2 + " 1"])
    def test_too_few_and_no_digits_are_refused(self, tmp_path: Path, digits: str) -> None:
        whole = TestNrrd().write(tmp_path / "s.nrrd", AFFINES["axial"], encoding="raw").read_bytes()
        head = whole.partition(b"\n\n")[0].decode().replace("encoding: raw", "encoding: hex")
        (tmp_path / "h.nrrd").write_text(head + "\n\n" + digits)
        with pytest.raises(FormatError):
            read_volume(tmp_path / "h.nrrd")


BALL = np.linalg.norm(np.indices((12, 12, 12)) - 5.5, axis=0) < 5
CORE = np.linalg.norm(np.indices((12, 12, 12)) - 5.5, axis=0) < 2.5
SHELL = BALL & ~CORE


def layered(path: Path, layers: list[NDArray[Any]], kind: str = "list", last: bool = False, **told: Any) -> Path:
    """Write layers of a segmentation as Slicer does, the layers fastest, or slowest."""
    stored = np.stack(layers, axis=0 if last else -1).astype(np.uint8)
    sizes, directions, kinds = ["12"] * 3, ["(1,0,0)", "(0,1,0)", "(0,0,1)"], ["domain"] * 3
    for words, more in ((sizes, str(len(layers))), (directions, "none"), (kinds, kind)):
        words.insert(3 if last else 0, more)
    lines = [
        "NRRD0004", "type: unsigned char", "dimension: 4", "space: left-posterior-superior",
        f"sizes: {' '.join(sizes)}", f"space directions: {' '.join(directions)}", f"kinds: {' '.join(kinds)}",
        "encoding: raw", "space origin: (0,0,0)", *(f"{key}:={value}" for key, value in told.items()),
    ]  # fmt: skip
    path.write_bytes("\n".join([*lines, "", ""]).encode() + stored.tobytes())
    return path


def segment(number: int, name: str, label: int | None = None, layer: int | None = None) -> dict[str, Any]:
    told = {"Name": name, "LabelValue": label, "Layer": layer, "Extent": "0 11 0 11 0 11"}
    return {f"Segment{number}_{key}": str(value) for key, value in told.items() if value is not None}


class TestSegments:
    """Slicer's layers: each segment by its number, which is its label where that is its own."""

    @pytest.mark.parametrize("last", [False, True])
    @pytest.mark.parametrize(("labels", "numbers"), [((1, 1, 1), (1, 2, 3)), ((7, 3, 300 % 256), (7, 3, 44))])
    def test_overlapping_ones_are_read_one_by_one(
        self, tmp_path: Path, labels: tuple[int, ...], numbers: tuple[int, ...], last: bool
    ) -> None:
        masks, names = [BALL, CORE, SHELL], ["Ball", "Core: inner", "Shell"]
        told = [segment(n, name, labels[n], n) for n, name in enumerate(names)]
        layers = [mask * label for mask, label in zip(masks, labels, strict=True)]
        path = layered(tmp_path / "s.seg.nrrd", layers, last=last, **told[0], **told[1], **told[2])
        for mask, number in zip(masks, numbers, strict=True):
            volume = read_volume(path, select=[number])
            np.testing.assert_array_equal(volume.voxels == number, mask)
            assert f"{numbers[1]} Core: inner" in volume.notes[-1]
        both = read_volume(path, select=[numbers[0], numbers[1]]).voxels
        np.testing.assert_array_equal(both > 0, BALL)
        with pytest.raises(GeometryError, match=r"segments overlap.*Ball.*--select"):
            read_volume(path)
        with pytest.raises(EmptyError, match="no such segment"):
            read_volume(path, select=[99])

    def test_those_that_lie_apart_are_one_label_map(self, tmp_path: Path) -> None:
        told = segment(0, "Core", 1, 0) | segment(1, "Shell", 1, 1)
        volume = read_volume(layered(tmp_path / "s.seg.nrrd", [CORE, SHELL], **told))
        np.testing.assert_array_equal(volume.voxels, CORE + 2 * SHELL)

    def test_two_labels_in_one_of_two_layers(self, tmp_path: Path) -> None:
        told = segment(0, "Core", 1, 0) | segment(1, "Shell", 2, 0) | segment(2, "Ball", 1, 1)
        path = layered(tmp_path / "s.seg.nrrd", [CORE + 2 * SHELL, BALL], **told)
        for number, mask in ((1, CORE), (2, SHELL), (3, BALL)):
            np.testing.assert_array_equal(read_volume(path, select=[number]).voxels == number, mask)

    def test_old_ones_have_a_layer_each_and_do_not_say_so(self, tmp_path: Path) -> None:
        path = layered(tmp_path / "s.seg.nrrd", [BALL, CORE], kind="list", **segment(0, "B"), **segment(1, "C"))
        np.testing.assert_array_equal(read_volume(path, select=[2]).voxels == 2, CORE)

    def test_one_layer_keeps_its_labels_and_names_them(self, tmp_path: Path) -> None:
        told = segment(0, "Core", 5, 0) | segment(1, "Shell", 9, 0)
        volume = read_volume(layered(tmp_path / "s.seg.nrrd", [CORE * 5 + SHELL * 9], **told))
        np.testing.assert_array_equal(volume.voxels, CORE * 5 + SHELL * 9)
        assert volume.notes == ("segments: 5 Core, 9 Shell",)

    @pytest.mark.parametrize("told", [segment(0, "a", 1, 5), {"Segment0_Layer": "x"}, {"Segment0_LabelValue": "-1"}])
    def test_headers_that_lie_are_refused(self, tmp_path: Path, told: dict[str, Any]) -> None:
        with pytest.raises(FormatError):
            read_volume(layered(tmp_path / "s.seg.nrrd", [BALL, CORE], **told))

    @pytest.mark.parametrize("kind", ["list", "vector", "3-vector", "covariant-vector", "point"])
    def test_three_bytes_of_another_kind_are_no_color(self, tmp_path: Path, kind: str) -> None:
        with pytest.raises(FormatError, match=f"several values a voxel.*3 of kind {kind}"):
            read_volume(layered(tmp_path / "s.nrrd", [BALL, CORE, SHELL], kind=kind))

    @pytest.mark.parametrize("kind", ["RGB-color", "3-color", "none", "???"])
    def test_three_bytes_of_a_color_or_of_no_kind_are(self, tmp_path: Path, kind: str) -> None:
        volume = read_volume(layered(tmp_path / "s.nrrd", [BALL, CORE, SHELL], kind=kind))
        np.testing.assert_array_equal(volume.voxels, np.stack([BALL, CORE, SHELL], axis=-1))
