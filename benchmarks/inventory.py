"""What becomes of every study and label map in ../shared/data: read or refused, as it should be, and at what cost."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from bench import SHARED
from tomomesh.errors import TomomeshError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

DATA = SHARED / "data"
VOLUMES = (".nii", ".nii.gz", ".nrrd", ".mha", ".mhd", ".dcm", ".png")
SLICES = (".dcm", ".png", ".tif")
BROKEN, GEOMETRY, TOO_LARGE = 4, 5, 7

REFUSED = {
    "dcm_qa_ct/In/GE": GEOMETRY,
    "derived/mixed_multi_series": GEOMETRY,
    "dicom2nifti/failing/sliceincrement/001": GEOMETRY,
    "dicom2nifti/failing/sliceorientation/001": GEOMETRY,
    "malformed/bad_datatype.nii.gz": BROKEN,
    "malformed/corrupt_gzip_crc.nii.gz": BROKEN,
    "malformed/dim_huge_bomb.nii.gz": TOO_LARGE,
    "malformed/dim_zero.nii.gz": BROKEN,
    "malformed/empty.nii.gz": BROKEN,
    "malformed/missing_raw.mhd": BROKEN,
    "malformed/no_ipp.dcm": GEOMETRY,
    "malformed/no_pixelspacing.dcm": GEOMETRY,
    "malformed/pixdim_zero.nii.gz": GEOMETRY,
    "malformed/sizes_mismatch.nrrd": BROKEN,
    "malformed/text_named.dcm": BROKEN,
    "malformed/truncated.mha": BROKEN,
    "malformed/truncated.png": BROKEN,
    "malformed/truncated_data.nii": BROKEN,
    "malformed/truncated_header.dcm": BROKEN,
}
"""Exit codes of what must be refused; everything else must be read."""

FLAGS: dict[str, dict[str, Any]] = {
    "derived/dev54_t1/png": {"spacing": (0.9375, 0.9375, 2.695)},
    "derived/dev54_t1/tif": {"spacing": (0.9375, 0.9375, 2.695)},
    "dcm_qa_ct/In/GE": {"resample_slices": True},
    "derived/mixed_multi_series": {"series": 2},
    "dicom2nifti/failing/sliceincrement/001": {"fill_gaps": True},
    "dicom2nifti/failing/sliceorientation/001": {"series": 1},
    "malformed/no_ipp.dcm": {"spacing_z": 1.0},
    "malformed/no_pixelspacing.dcm": {"spacing": (1.0, 1.0, 1.0)},
}
"""What a study needs, or what its refusal names."""


@dataclass(frozen=True)
class Outcome:
    """What became of a study."""

    code: int
    told: str
    bytes: int
    seconds: float
    mib: int


def main() -> None:
    print("| study | flags | what happened | exit | s | peak MiB | times the voxels | verdict |")
    print("|---|---|---|---|---|---|---|---|")
    lost = sum(_row(path, {}) for path in studies())
    lost += sum(_row(DATA / name, flags) for name, flags in FLAGS.items())
    print(f"\n{lost} not as it should be")


def studies() -> Iterator[Path]:
    """Yield every folder of slices, and every single volume."""
    for folder in sorted(path for path in DATA.rglob("*") if path.is_dir()):
        files = sorted(path for path in folder.iterdir() if path.is_file())
        sliced = [path for path in files if path.suffix in SLICES or path.name.startswith("CT.")]
        single = folder.name == "malformed" or len(sliced) == 1
        if sliced and not single:
            yield folder
        yield from (path for path in files if path.name.endswith(VOLUMES) and (single or path not in sliced))


def _row(path: Path, flags: dict[str, Any]) -> bool:
    """Print what became of a study; return whether it is not what should have."""
    name = str(path.relative_to(DATA))
    found = _read(path, flags)
    expected = 0 if flags else GEOMETRY if name in FLAGS and name not in REFUSED else REFUSED.get(name, 0)
    times = f"{found.mib * 2**20 / found.bytes:.1f}" if found.bytes > 2**24 else ""
    given = " ".join(f"--{key.replace('_', '-')}" for key in flags)
    verdict = "passed" if found.code == expected else "LOST"
    cost = f"{found.seconds:.2f} | {found.mib} | {times}"
    print(f"| {name} | {given} | {found.told} | {found.code} | {cost} | {verdict} |", flush=True)
    return found.code != expected


def _read(path: Path, flags: dict[str, Any]) -> Outcome:
    """Have a process of its own read the study, so that the peak of its memory is the study's."""
    call = [sys.executable, __file__, str(path), json.dumps(flags)]
    child = subprocess.run(call, capture_output=True, text=True, check=False)
    if child.returncode:
        return Outcome(child.returncode, child.stderr.strip().splitlines()[-1], 0, 0.0, 0)
    return Outcome(**json.loads(child.stdout))


def probe(path: str, flags: dict[str, Any]) -> Outcome:
    """Read a study, once the libraries are there."""
    for library in ("numpy", "scipy.ndimage", "pydicom", "nibabel", "PIL.Image"):
        import_module(library)
    before, start = _peak(), time.perf_counter()
    try:
        volume = read_volume(path, settings=ReadSettings(**flags))
        told, code, size = repr(volume).removeprefix("Volume(").removesuffix(")"), 0, volume.voxels.nbytes
    except TomomeshError as fault:
        told, code, size = str(fault).split(". ")[0], fault.exit_code, 0
    return Outcome(code, told, size, time.perf_counter() - start, _peak() - before)


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(asdict(probe(sys.argv[1], json.loads(sys.argv[2])))))
    else:
        main()
