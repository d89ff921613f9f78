#!/usr/bin/env bash
# niivue takes the colors of a GIFTI surface for numbers on it.
#
# Versions: niivue 0.69.0, nibabel 5.4.2 (numpy 2.4.6), Python 3.11, Node.js 20.
# Input: a surface of four vertices, written by nibabel, with an array of NIFTI_INTENT_RGB_VECTOR (4, 3): red, green,
#   blue and white.
# Behavior: nibabel returns the colors. niivue's reader returns them as scalars, one array of all in the file; what is
#   shown is its first part, a number a vertex in gray: the red, the green and the blue of the first vertex, and the red
#   of the second. No warning.
# Output: the numbers at the four vertices: 1, 0, 0, 0.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
command -v node > /dev/null || exit 3
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check nibabel==5.4.2 numpy==2.4.6 || exit 3
npm install --silent --no-fund --no-audit @niivue/niivue@0.69.0 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import nibabel
import numpy as np
from nibabel.gifti import GiftiDataArray, GiftiImage

print({"nibabel": version("nibabel")})
arrays = [
    GiftiDataArray(100 * np.eye(4, 3, -1, np.float32), "NIFTI_INTENT_POINTSET", "NIFTI_TYPE_FLOAT32"),
    GiftiDataArray(
        np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32), "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32"
    ),
    GiftiDataArray(
        np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], np.float32), "NIFTI_INTENT_RGB_VECTOR",
        "NIFTI_TYPE_FLOAT32",
    ),
]
nibabel.save(GiftiImage(darrays=arrays), "m.surf.gii")
print("nibabel:", nibabel.load("m.surf.gii").agg_data("NIFTI_INTENT_RGB_VECTOR").tolist())
END

cat > read.mjs <<'END'
import { readFileSync } from "node:fs";
globalThis.self = globalThis;
const { NVMesh } = await import("@niivue/niivue");
console.log = () => {};
const gl = new Proxy({}, { get: (_, name) => (name === name.toUpperCase() ? 1 : () => ({})) }); // draws nothing
const mesh = await NVMesh.readMesh(new Uint8Array(readFileSync("m.surf.gii")).buffer, "m.surf.gii", gl);
const [layer] = mesh.layers;
const shown = Array.from(layer.values.slice(0, mesh.pts.length / 3));
console.error(`niivue: ${layer.nFrame4D} frames of numbers, colormap ${layer.colormap}; shown: ${shown}`);
process.exit(layer.nFrame4D === 3 && String(shown) === "1,0,0,0" ? 0 : 1);
END
node read.mjs
