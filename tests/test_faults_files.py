"""What cannot be read is refused by the command line: FAULTS rows 1, 2, 4 to 6, 17, 18, 24, 25 and 34.

Each time one exit code, one line, nothing written, nothing left, nothing changed, and little memory.
"""

from __future__ import annotations

import gzip
import os
import shutil
import sys
import zlib
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest

from doors import ERROR, as_program, contents, reconstructing, refused
from studies import AFFINES, sampled, save, slice_dataset, write_nifti, write_series
from test_io_volume_faults import META, NRRD, meta, nrrd
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

    from _pytest.capture import CaptureFixture

AXIAL, OBLIQUE = AFFINES["axial"], AFFINES["oblique"]
STORED = sampled(AXIAL)


def nifti(folder: Path, edit: Any = None, name: str = "s.nii", stored: Any = STORED) -> Path:
    return write_nifti(folder / name, stored, AXIAL, edit)


def setting(**fields: Any) -> Any:
    """Return an edit of a NIfTI header; ``pixdim_2=0`` sets one entry of a field."""

    def edit(header: Any) -> None:
        for field, value in fields.items():
            name, _, index = field.partition("__")
            if index:
                header[name][int(index)] = value
            else:
                header[name] = value

    return edit


@contextmanager
def another_user() -> Iterator[None]:
    """Root may read everything: then another user tries."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)


class TestPaths:
    """Rows 1, 2 and 34."""

    @pytest.mark.parametrize("name", ["nowhere.nii", "nowhere/deeper.nii", "nowhere"])
    def test_what_is_missing_is_named(self, tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
        assert name in refused(reconstructing(tmp_path / name, tmp_path), 3, tmp_path, capsys)

    def test_an_empty_folder(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        (tmp_path / "empty").mkdir()
        assert "empty" in refused(reconstructing(tmp_path / "empty", tmp_path), 3, tmp_path, capsys)

    @pytest.mark.skipif(not hasattr(os, "seteuid"), reason="there are no permissions here")
    @pytest.mark.parametrize("kind", ["file", "folder"])
    def test_no_permission(self, tmp_path: Path, capsys: CaptureFixture[str], kind: str) -> None:
        study = tmp_path / "s.nii" if kind == "file" else tmp_path
        nifti(tmp_path)
        study.chmod(0)
        reconstruct = import_module("tomomesh.pipeline").reconstruct  # while its files may still be read
        with another_user():
            code = main(["inspect", str(study)])
        study.chmod(0o700)
        assert reconstruct
        assert code == 3
        (said,) = capsys.readouterr().err.splitlines()
        assert ERROR.match(said)
        assert str(study) in said

    def test_a_folder_without_images_counts_the_reasons(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        (tmp_path / "s").mkdir()
        for name in ("a.txt", "b.txt", "c.nii", ".d"):
            (tmp_path / "s" / name).write_text("no image")
        said = refused(reconstructing(tmp_path / "s", tmp_path), 4, tmp_path, capsys)
        assert "0 of 4 files are images" in said
        assert "1 .nii files, 1 hidden, 2 of an unknown kind" in said

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes here")
    @pytest.mark.parametrize("command", ["reconstruct", "surface", "inspect", "check", "network"])
    @pytest.mark.parametrize("kind", ["pipe", "device", "loop", "link to a device"])
    def test_only_files_and_folders_are_opened(
        self, tmp_path: Path, capsys: CaptureFixture[str], command: str, kind: str
    ) -> None:
        """Nothing writes into the pipe, and the device never ends: opening either would hang."""
        suffix = {"surface": ".ply", "check": ".stl", "network": ".png"}.get(command, ".nii")
        path = Path("/dev/zero") if kind == "device" else tmp_path / f"x{suffix}"
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "loop":
            path.symlink_to(path)
        elif kind == "link to a device":
            path.symlink_to("/dev/zero")
        output = {"inspect": [], "check": [], "network": ["-o", str(tmp_path / "n")]}
        line = [command, str(path), *output.get(command, ["-o", str(tmp_path / "m.ply")])]
        code = 3 if (command, kind) == ("network", "loop") else 4
        refused(line, code, tmp_path, capsys)

    @pytest.mark.parametrize("kind", [".nhdr", ".mhd"])
    @pytest.mark.parametrize("named", ["../secret.raw", "/dev/zero", "loop.raw", "out.raw"])
    def test_a_header_that_names_what_is_elsewhere(
        self, tmp_path: Path, capsys: CaptureFixture[str], kind: str, named: str
    ) -> None:
        (tmp_path / "in").mkdir()
        (tmp_path / "secret.raw").write_bytes(STORED.tobytes())
        (tmp_path / "in" / "loop.raw").symlink_to("loop.raw")
        (tmp_path / "in" / "out.raw").symlink_to("../secret.raw")
        header = tmp_path / "in" / f"s{kind}"
        header.write_text(f"{NRRD}data file: {named}\n" if kind == ".nhdr" else f"{META}ElementDataFile = {named}\n")
        said = refused(reconstructing(header, tmp_path), 4, tmp_path, capsys)
        assert str(tmp_path / "secret.raw") not in said


class TestCutOff:
    """Row 4: told with the bytes expected and found, before any are made room for."""

    @pytest.mark.parametrize("keep", [0, 3, 100, 347, 352, 400, -1])
    def test_nifti(self, tmp_path: Path, capsys: CaptureFixture[str], keep: int) -> None:
        path = nifti(tmp_path)
        path.write_bytes(path.read_bytes()[:keep])
        refused(reconstructing(path, tmp_path), 4, tmp_path, capsys)

    @pytest.mark.parametrize("part", [0.1, 0.5, 0.99])
    def test_gzip(self, tmp_path: Path, capsys: CaptureFixture[str], part: float) -> None:
        packed = gzip.compress(nifti(tmp_path).read_bytes())
        (tmp_path / "s.nii.gz").write_bytes(packed[: int(part * len(packed))])
        refused(reconstructing(tmp_path / "s.nii.gz", tmp_path), 4, tmp_path, capsys)

    def test_dicom_names_the_bytes(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        worst = sorted(folder.iterdir())[2]
        worst.write_bytes(worst.read_bytes()[:-20])
        said = refused(reconstructing(folder, tmp_path), 4, tmp_path, capsys)
        assert "106 bytes" in said
        assert "126 bytes" in said

    @pytest.mark.parametrize("name", ["s.nrrd", "s.mha"])
    def test_others(self, tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
        (tmp_path / name).write_bytes((nrrd() if name == "s.nrrd" else meta())[:-7])
        said = refused(reconstructing(tmp_path / name, tmp_path), 4, tmp_path, capsys)
        assert f"{STORED.nbytes - 7} bytes" in said
        assert f"{STORED.nbytes} bytes" in said


HUGE = "32767 32767 32767"
PROMISES: dict[str, Any] = {
    "s.nii": lambda path: nifti(path.parent, setting(dim__1=32767, dim__2=32767, dim__3=32767)),
    "s.nii.gz": lambda path: path.write_bytes(
        gzip.compress(nifti(path.parent, setting(dim__1=32767, dim__2=32767, dim__3=32767)).read_bytes())
    ),
    "s.nrrd": lambda path: path.write_bytes(nrrd(NRRD.replace("9 7 5", HUGE))),
    "gzip.nrrd": lambda path: path.write_bytes(nrrd(NRRD.replace("9 7 5", HUGE).replace("raw", "gzip"))),
    "bzip2.nrrd": lambda path: path.write_bytes(nrrd(NRRD.replace("9 7 5", HUGE).replace("raw", "bzip2"))),
    "s.mha": lambda path: path.write_bytes(meta(META.replace("9 7 5", HUGE))),
    "zlib.mha": lambda path: path.write_bytes(meta(META.replace("9 7 5", HUGE) + "CompressedData = True\n")),
    "s.dcm": lambda path: save(_frames(slice_dataset(STORED[0], AXIAL, 0)), path),
}
"""Files of some kilobytes whose headers promise terabytes."""


def _frames(data: pydicom.Dataset) -> pydicom.Dataset:
    data.Rows = data.Columns = 65535
    return data


class TestBombs:
    """Row 5."""

    @pytest.mark.parametrize("name", PROMISES)
    def test_what_is_promised_beyond_the_memory(
        self, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        monkeypatch.setattr("tomomesh.io.files.limits.physical_memory", lambda: 2**30)
        PROMISES[name](tmp_path / name)
        assert "memory" in refused(reconstructing(tmp_path / name, tmp_path, "--spacing-z", "1"), 7, tmp_path, capsys)

    @pytest.mark.parametrize("name", PROMISES)
    def test_what_the_file_cannot_hold(
        self, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        monkeypatch.setattr("tomomesh.io.files.limits.physical_memory", lambda: 2**50)
        PROMISES[name](tmp_path / name)
        refused(reconstructing(tmp_path / name, tmp_path, "--spacing-z", "1"), 4, tmp_path, capsys)

    def test_a_stream_that_goes_on(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        endless = zlib.compress(bytes(2**27))
        (tmp_path / "s.mha").write_bytes(meta(f"{META}CompressedData = True\n", endless))
        assert "goes on" in refused(reconstructing(tmp_path / "s.mha", tmp_path), 7, tmp_path, capsys)

    @pytest.mark.skipif(sys.platform != "linux", reason="the limit of a process's memory is Linux's")
    def test_a_process_with_little_memory_says_so(self, tmp_path: Path) -> None:
        """A gigabyte of zeros packed to a megabyte: honest, and too much for this process."""
        head = nifti(tmp_path, setting(dim__1=1024, dim__2=1024, dim__3=512)).read_bytes()[:352]
        packer = zlib.compressobj(1, wbits=31)
        packed = packer.compress(head) + b"".join(packer.compress(bytes(2**24)) for _ in range(64)) + packer.flush()
        (tmp_path / "s.nii").unlink()
        (tmp_path / "s.nii.gz").write_bytes(packed)
        before = contents(tmp_path)
        limit = "import resource, tomomesh.cli.commands, tomomesh.pipeline\n"
        limit += "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        limit += "resource.setrlimit(resource.RLIMIT_AS, (used + 2**29, used + 2**29))"
        done = as_program(reconstructing(tmp_path / "s.nii.gz", tmp_path, "--quiet"), before=limit)
        assert done.returncode == 7, done.stderr
        assert "memory" in done.stderr
        assert done.stderr.count("\n") == 1
        assert contents(tmp_path) == before


@pytest.mark.parametrize("depth", [300, 3000])
def test_sequences_in_sequences(tmp_path: Path, capsys: CaptureFixture[str], depth: int) -> None:
    """Row 6."""
    raw = b""
    for _ in range(depth):
        item = b"\xfe\xff\x00\xe0\xff\xff\xff\xff" + raw + b"\xfe\xff\x0d\xe0\x00\x00\x00\x00"
        raw = b"\x40\x00\x30\xa7SQ\x00\x00\xff\xff\xff\xff" + item + b"\xfe\xff\xdd\xe0\x00\x00\x00\x00"
    path = save(slice_dataset(STORED[0], AXIAL, 0), tmp_path / "deep.dcm")
    whole = path.read_bytes()
    place = whole.index(b"\xe0\x7f\x10\x00")
    path.write_bytes(whole[:place] + raw + whole[place:])
    refused(reconstructing(path, tmp_path, "--spacing-z", "1"), 4, tmp_path, capsys)


class TestSpacing:
    """Rows 17, 18 and 24."""

    @pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 1e-30])
    def test_nifti(self, tmp_path: Path, capsys: CaptureFixture[str], value: float) -> None:
        path = nifti(tmp_path, setting(pixdim__2=value))
        assert "pixdim[2]" in refused(reconstructing(path, tmp_path), 5, tmp_path, capsys)

    @pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "1e-30"])
    def test_metaimage(self, tmp_path: Path, capsys: CaptureFixture[str], value: str) -> None:
        (tmp_path / "s.mha").write_bytes(meta(META.replace("0.5 0.7 2", f"0.5 {value} 2")))
        assert "ElementSpacing[1]" in refused(reconstructing(tmp_path / "s.mha", tmp_path), 5, tmp_path, capsys)

    @pytest.mark.parametrize("value", ["0", "nan", "inf", "1e-30"])
    def test_nrrd(self, tmp_path: Path, capsys: CaptureFixture[str], value: str) -> None:
        (tmp_path / "s.nrrd").write_bytes(nrrd(NRRD.replace("(0,0.7,0)", f"(0,{value},0)")))
        refused(reconstructing(tmp_path / "s.nrrd", tmp_path), 5, tmp_path, capsys)

    @pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "1e-30", None])
    def test_dicom(self, tmp_path: Path, capsys: CaptureFixture[str], value: str | None) -> None:
        def edit(data: pydicom.Dataset, k: int) -> None:
            del data.PixelSpacing
            if value is not None:
                data.PixelSpacing = ["0.7", value]

        with pydicom.config.disable_value_validation():
            folder = write_series(tmp_path / "s", STORED, AXIAL, edit)
        assert "PixelSpacing = " in refused(reconstructing(folder, tmp_path), 5, tmp_path, capsys)

    def test_a_singular_affine(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = nifti(tmp_path, setting(srow_x=[1, 1, 0, 0], srow_y=[1, 1, 0, 0], srow_z=[0, 0, 1, 0]))
        assert "singular" in refused(reconstructing(path, tmp_path), 5, tmp_path, capsys)

    @pytest.mark.parametrize("kind", [0, 1, 9999])
    def test_voxels_of_no_kind(self, tmp_path: Path, capsys: CaptureFixture[str], kind: int) -> None:
        """0 is the standard's word for unknown, 1 for single bits."""
        path = nifti(tmp_path, setting(datatype=kind))
        assert f"datatype = {kind}" in refused(reconstructing(path, tmp_path), 4, tmp_path, capsys)

    def test_one_slice_needs_a_distance(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, slices=[0])
        assert "--spacing-z" in refused(reconstructing(folder, tmp_path), 5, tmp_path, capsys)

    def test_more_holes_than_voxels(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        """Row 25."""
        voxels = STORED.astype(np.float32)
        voxels[:3] = np.nan
        path = nifti(tmp_path, stored=voxels)
        assert "NaN or infinite = 189 of 315" in refused(reconstructing(path, tmp_path), 5, tmp_path, capsys)


@pytest.mark.parametrize("slope", ["0", "nan"])
def test_a_scale_that_wipes_out(tmp_path: Path, capsys: CaptureFixture[str], slope: str) -> None:
    """Row 19."""

    def edit(data: pydicom.Dataset, k: int) -> None:
        data.RescaleSlope, data.RescaleIntercept = slope, "0"

    with pydicom.config.disable_value_validation():
        folder = write_series(tmp_path / "s", STORED, AXIAL, edit)
    assert "scale" in refused(reconstructing(folder, tmp_path), 4, tmp_path, capsys)
    shutil.rmtree(folder)
    path = nifti(tmp_path, setting(scl_slope=1.0, scl_inter=np.inf))
    assert "scale" in refused(reconstructing(path, tmp_path), 4, tmp_path, capsys)
