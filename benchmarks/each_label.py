"""One pass over a label map against a run a label: CPU seconds, and the same bytes.

    python benchmarks/each_label.py [--side 256] [--labels 100] [--alone 100]

The map is made here: balls about random places, cut where they meet. Both are the command line, reading and writing
included, and Python's start and imports in each; the kernels are compiled before.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

MARK = 0.1
"""Most of the CPU time of a run a label that one pass may take."""
RADIUS = 0.06
"""Of a ball, in sides of the map: at 256^3 and 1 mm a hundred of them are 1.5 l, as the parts of a brain are."""


def label_map(side: int, count: int) -> np.ndarray:
    """Return balls about random places, (side, side, side), where they meet each voxel that of the nearest."""
    places = np.random.default_rng(1).uniform(0, side, (count, 3))
    tree, rows = cKDTree(places), np.indices((side, side)).reshape(2, -1).T
    found = np.zeros((side, side, side), np.uint16)
    for k in range(side):
        away, nearest = tree.query(np.column_stack([np.full(len(rows), k), rows]))
        found[k] = np.where(away < RADIUS * side, nearest + 1, 0).reshape(side, side)
    return found


def spent(*options: str) -> float:
    """Return the CPU seconds of a command."""
    before = os.times()
    subprocess.run([sys.executable, "-m", "tomomesh", "reconstruct", *options, "--quiet"], check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def measured(folder: Path, side: int, count: int, alone: int) -> tuple[float, float, int, int]:
    """Return the CPU seconds of one pass and of a run a label, of how many labels, and in how many bytes differ."""
    import nibabel

    study = folder / "labels.nii.gz"
    voxels = label_map(side, count)
    nibabel.save(nibabel.Nifti1Image(voxels, np.diag([0.9, 0.9, 0.9, 1.0])), study)
    numbers = [number for number in np.unique(voxels).tolist() if number]
    spent(str(study), "--select", str(numbers[0]), "-o", str(folder / "first.stl"))
    every = spent(str(study), "--each-label", "-o", str(folder / "every"))
    each, other, taken = 0.0, 0, numbers[:: max(1, len(numbers) // alone)]
    for number in taken:
        each += spent(str(study), "--select", str(number), "-o", str(folder / "alone.stl"))
        other += (folder / "alone.stl").read_bytes() != (folder / "every" / f"label-{number:04d}.stl").read_bytes()
    return every, each * len(numbers) / len(taken), len(numbers), other


def main() -> None:
    """Measure, and say whether the mark is met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--labels", type=int, default=100)
    parser.add_argument("--alone", type=int, default=100, help="labels that are run alone; the others count as these")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        every, each, count, other = measured(Path(folder), asked.side, asked.labels, asked.alone)
    print(f"{count} labels at {asked.side}^3: one pass {every:.1f} s, a run a label {each:.1f} s of CPU time")
    print(f"share {every / each:.3f}, mark {MARK}: {'passed' if every <= MARK * each else 'LOST'}")
    print(f"meshes whose bytes differ: {other}, mark 0: {'LOST' if other else 'passed'}")


if __name__ == "__main__":
    main()
