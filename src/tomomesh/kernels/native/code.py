"""What is kept of a compiled kernel, and the private cache of it."""

from __future__ import annotations

import json
import os
import platform
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import platformdirs
from llvmlite import binding

OURS = "tomomesh.kernels."
"""Where kernels are whose sources name the cache."""
KERNELS = Path(__file__).parents[1]
DIGEST = 32
"""Bytes of the checksum that a file begins with: broken machine code would end the process."""


@dataclass(frozen=True)
class Code:
    """Machine code of one kernel, with all that it calls.

    Attributes
    ----------
    entry : str
        Name of the function that Python can call.
    environment : str
        Name of the place where the entry expects a pointer to what belongs to this process.
    externals : tuple of str
        What the code calls and does not hold.
    machine : bytes
        An object file.
    """

    entry: str
    environment: str
    externals: tuple[str, ...]
    machine: bytes

    def packed(self) -> bytes:
        """Return it as bytes: a line of JSON, then the machine code, after their checksum."""
        body = json.dumps([self.entry, self.environment, self.externals]).encode() + b"\n" + self.machine
        return sha256(body).digest() + body

    @classmethod
    def unpacked(cls, packed: bytes) -> Code | None:
        """Return what was packed; None if it is no longer whole."""
        digest, body = packed[:DIGEST], packed[DIGEST:]
        if sha256(body).digest() != digest:
            return None
        head, _, machine = body.partition(b"\n")
        entry, environment, externals = json.loads(head)
        return cls(entry, environment, tuple(externals), machine)


@cache
def folder() -> Path:
    """Return the cache of these kernels, on this processor, by this compiler as it is set."""
    made_of = b"".join(path.read_bytes() for path in sorted(KERNELS.rglob("*.py")))
    settings = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    made_by = [version("numba"), version("llvmlite"), sys.version, platform.platform(), binding.get_host_cpu_name()]
    features = binding.get_host_cpu_features().flatten()
    key = sha256(made_of + json.dumps([made_by, features, sorted(settings.items())]).encode()).hexdigest()[:16]
    return Path(platformdirs.user_cache_dir("tomomesh")) / f"kernels-{key}"


def kept(name: str) -> bool:
    """Tell whether the cache has a kernel."""
    return (folder() / name).exists()


def read(name: str) -> Code | None:
    """Return a kernel's code; None where there is none, or none that is whole."""
    try:
        return Code.unpacked((folder() / name).read_bytes())
    except OSError:
        return None


def keep(name: str, code: Code) -> None:
    """Write a kernel's code, whole or not at all; where nothing can be written it is compiled every time."""
    try:
        folder().mkdir(parents=True, exist_ok=True)
        handle, unfinished = tempfile.mkstemp(dir=folder())
        with os.fdopen(handle, "wb") as file:
            file.write(code.packed())
        Path(unfinished).replace(folder() / name)
    except OSError:
        return
