"""Nothing that a study says of a patient leaves it: not in words, not in files, not in their names."""

from __future__ import annotations

import ast
import io
import logging
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest
from PIL import Image
from pydicom.datadict import dictionary_VR, keyword_dict

from doors import contents
from studies import as_ct, write_series
from test_faults_studies import AFFINE, ball
from tomomesh.cli import main
from tomomesh.errors import FormatError
from tomomesh.io import read_points, read_volume

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture
    from pydicom import Dataset

CANARY = "Canary"
HOSTILE = f"{CANARY}\x1b[31m^/../{CANARY}\x00\n:;|"
TEXTS = {"AE": 16, "LO": 64, "LT": 90, "PN": 64, "SH": 16, "ST": 90, "UC": 90, "UT": 90}
"""Value representations that are text, and how long their values may be."""
READ = (
    "SeriesDescription",
    "ImageType",
    "Modality",
    "PhotometricInterpretation",
    "SeriesInstanceUID",
    "SOPInstanceUID",
)
COMMANDS = {
    "reconstruct": [
        "-o", "m{}.stl", "--points", "p.ply", "--labels", "l.nii.gz", "--report", "r.json", "--save-settings", "s.toml",
        "--figures", "f", "--html", "h.html", "--json",
    ],
    "segment": ["-o", "p{}.ply", "--report", "r.json", "--figures", "f", "--json"],
    "inspect": ["--json"],
}  # fmt: skip


def with_canaries(data: Dataset, k: int) -> None:
    """Put a canary into every tag of the dictionary that holds text, and into private ones."""
    as_ct(data, k)
    for keyword, tag in keyword_dict.items():
        kind = dictionary_VR(tag) if keyword and keyword not in READ else ""
        if kind in TEXTS and tag >> 16 > 0x0008:
            data.add_new(tag, kind, HOSTILE[: TEXTS[kind]])
    for keyword in ("PatientName", "PatientID", "InstitutionName", "StudyDescription", "SeriesDescription"):
        setattr(data, keyword, HOSTILE[:60])
    data.PatientBirthDate, data.AccessionNumber = "19010101", HOSTILE[:16]
    block = data.private_block(0x0011, CANARY, create=True)
    block.add_new(1, "LT", HOSTILE)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pydicom.config.disable_value_validation():
        folder = write_series(tmp_path_factory.mktemp("in") / "s", ball(AFFINE), AFFINE, with_canaries)
    assert HOSTILE[:20].encode() in next(folder.iterdir()).read_bytes()
    return folder


def betrayed(told: bytes) -> bool:
    """Whether the canary, or the patient's birthday, is in some bytes, or in what is packed in them."""
    plain = [told]
    if told[:2] == b"\x1f\x8b":
        plain.append(zlib.decompress(told, 31))
    if told[:4] == b"\x89PNG":
        plain += [repr(Image.open(io.BytesIO(told)).info).encode()]
    return any(word in one for one in plain for word in (CANARY.encode(), b"19010101"))


def run(line: list[str], capsys: CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> tuple[int, str]:
    with caplog.at_level(logging.DEBUG):
        code = main(line)
    heard = capsys.readouterr()
    return code, heard.out + heard.err + caplog.text


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("shown", ["--json", ""])
def test_no_output_names_the_patient(
    study: Path, tmp_path: Path, capsys: CaptureFixture[str], caplog: pytest.LogCaptureFixture, command: str, shown: str
) -> None:
    options = [word.format("") for word in COMMANDS[command] if word != "--json"]
    outputs = [str(tmp_path / word) if "." in word or word == "f" else word for word in options]
    window = [] if command == "inspect" else ["--lower", "50"]
    code, told = run([command, str(study), *outputs, *window, *([shown] if shown else [])], capsys, caplog)
    assert code == 0, told
    assert not betrayed(told.encode())
    assert "\x1b" not in told
    assert "\0" not in told
    for name, found in contents(tmp_path).items():
        assert not betrayed(name.encode())
        assert not isinstance(found, tuple) or not betrayed(found[0])


def _no_pixels(data: Dataset) -> None:
    del data.PixelData


def _other_size(data: Dataset) -> None:
    data.Rows = 999


def _other_axes(data: Dataset) -> None:
    data.ImageOrientationPatient = [0, 1, 0, 0, 0, -1]


def _text_for_a_number(data: Dataset) -> None:
    data.add_new(0x00280030, "LO", HOSTILE[:60])


def _a_name_for_a_position(data: Dataset) -> None:
    data.add_new(0x00200032, "LO", HOSTILE[:60])


def _a_name_for_a_count(data: Dataset) -> None:
    data.add_new(0x00280008, "LO", HOSTILE[:60])


def _a_name_for_a_color(data: Dataset) -> None:
    data.PhotometricInterpretation = "PALETTE COLOR"


def _a_name_for_a_type(data: Dataset) -> None:
    data.ImageType = [CANARY, CANARY]
    data.ImagePositionPatient = [-3, 11, 42]


FAILURES = (
    _no_pixels, _other_size, _other_axes, _text_for_a_number, _a_name_for_a_position, _a_name_for_a_count,
    _a_name_for_a_color, _a_name_for_a_type,
)  # fmt: skip


@pytest.mark.parametrize("fault", FAILURES)
def test_no_error_names_the_patient(
    study: Path, tmp_path: Path, capsys: CaptureFixture[str], caplog: pytest.LogCaptureFixture, fault: Any
) -> None:
    with pydicom.config.disable_value_validation():
        for number, path in enumerate(sorted(study.iterdir())):
            data = pydicom.dcmread(path)
            if number == 3:
                fault(data)
            data.save_as(tmp_path / path.name, enforce_file_format=True)
    for command in ("inspect", "reconstruct"):
        output = [] if command == "inspect" else ["-o", str(tmp_path / "m.ply")]
        code, told = run([command, str(tmp_path), *output], capsys, caplog)
        assert code in (4, 5) or (command == "inspect" and "refused   exit " in told), told
        assert not betrayed(told.replace(str(tmp_path), "").encode())
        assert "\x1b" not in told


def test_truncated_anywhere_no_log_names_the_patient(
    study: Path, tmp_path: Path, capsys: CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    whole = next(study.iterdir()).read_bytes()
    for keep in range(300, len(whole), len(whole) // 40):
        (tmp_path / "x.dcm").write_bytes(whole[:keep])
        _, told = run(["inspect", str(tmp_path / "x.dcm")], capsys, caplog)
        assert not betrayed(told.encode())


SOURCES = sorted((Path(__file__).parents[1] / "src" / "tomomesh").rglob("*.py"))
FORBIDDEN = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.stem)
def test_no_file_can_run_as_code(source: Path) -> None:
    """No pickle, no eval, no shell, no other door by which bytes become a program."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [one.name for one in node.names]
            assert not {name.partition(".")[0] for name in names} & FORBIDDEN
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "compile", "os.system", "os.popen", "yaml.load")
            given = {word.arg: word.value for word in node.keywords}
            for word in ("allow_pickle", "shell"):
                assert word not in given or ast.unparse(given[word]) == "False"
            if called in ("np.load", "numpy.load", "np.save", "np.savez", "np.savez_compressed"):
                assert "allow_pickle" in given, f"{source.name} line {node.lineno}"


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_arrays_of_objects_are_never_unpacked(tmp_path: Path, suffix: str) -> None:
    class Bomb:
        def __reduce__(self) -> Any:
            return Path.touch, (tmp_path / "ran",)

    bomb = np.empty(3, object)
    bomb[:] = [Bomb()] * 3
    path = tmp_path / f"b{suffix}"
    np.save(path, bomb, allow_pickle=True) if suffix == ".npy" else np.savez(path, points=bomb)
    for read in (read_points, read_volume) if suffix == ".npy" else (read_points,):
        with pytest.raises(FormatError):
            read(path)
    assert not (tmp_path / "ran").exists()
