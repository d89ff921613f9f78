"""NRRD: spaces, encodings, data files, and what the header leaves out; pynrrd and SimpleITK as judges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from studies import AFFINES, SHEARED, TURNED, assert_in_place, sampled
from tomomesh.errors import FormatError, GeometryError
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
