"""The one place that names Numba's options, and that keeps its cache in order."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

import numba
import platformdirs
from numba.core import config

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

SOURCES = sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.rglob("*.py")))).hexdigest()[:12]
"""What the kernels are: Numba looks at a kernel's own file only, not at the kernels that it calls."""
CACHE = Path(platformdirs.user_cache_dir("tomomesh")) / f"kernels-numba-{numba.__version__}-{SOURCES}"


def kernel(signature: str) -> Callable[[Kernel], Kernel]:
    """Compile a function for one signature, without the interpreter's lock and from a private cache.

    A broken cache is deleted and written anew; where none can be written the kernel is compiled every time.
    """

    def compile_once(function: Kernel) -> Kernel:
        try:
            return _cached(signature, function)
        except Exception:  # numba and pickle let anything through when a cache file is broken or unwritable
            shutil.rmtree(CACHE, ignore_errors=True)
        try:
            return _cached(signature, function)
        except Exception:  # still no usable cache: a real fault in the function is raised below
            return _compiled(signature, function, cache=False)

    return compile_once


def _cached(signature: str, function: Kernel) -> Kernel:
    """Compile with our own cache directory, and give the caller's setting back afterwards."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(CACHE)
    try:
        return _compiled(signature, function, cache=True)
    finally:
        config.CACHE_DIR = before


def _compiled(signature: str, function: Kernel, *, cache: bool) -> Kernel:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", numba.NumbaWarning)
        compiled: Kernel = numba.njit(signature, cache=cache, nogil=True, error_model="numpy")(function)
    return compiled
