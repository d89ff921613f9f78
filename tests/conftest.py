"""Sizes, the shapes whose truth is known, and a cluster of two processes."""

from __future__ import annotations

import logging
import os
import pkgutil
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

import tomomesh
from tomomesh.cuberille.bitmasks import Blocks
from tomomesh.cuberille.closing import Shell
from tomomesh.cuberille.faces import Faces, exposed_faces
from tomomesh.kernels.compile import COMPILED as COMPILED
from tomomesh.kernels.compile import Kernel
from tomomesh.kernels.native.load import loaded
from tomomesh.model.cubes import keys_of
from tomomesh.model.mesh import QuadMesh

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

Number = TypeVar("Number", int, float)

settings.register_profile(
    "repeatable", deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
settings.load_profile("repeatable")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """Run a single file in this process: its fixtures are made once, and starting others takes longer."""
    return 0 if len(config.args) == 1 and Path(config.args[0].partition("::")[0]).is_file() else None


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels once, before there are several processes that would."""
    if config.getoption("dist", "no") != "no" and not hasattr(config, "workerinput"):
        names = [one.name for one in pkgutil.walk_packages(tomomesh.__path__, "tomomesh.")]
        modules = [import_module(name) for name in names if not name.endswith("__main__")]
        kernels = {one: None for module in modules for one in vars(module).values() if isinstance(one, Kernel)}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(loaded, kernels))


def size(compiled: Number, plain: Number) -> Number:
    """Return the first size for compiled kernels, the second for kernels in plain Python."""
    return compiled if COMPILED else plain


def law(examples: int) -> settings:
    """Try a law on a number of examples."""
    return settings(max_examples=size(examples, max(examples // 5, 3)))


@pytest.fixture
def fewer_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure a surface at fewer places where the kernels do not run as machine code."""
    monkeypatch.setattr("tomomesh.measure.report.SAMPLES", size(20_000, 200))


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """An empty folder for outputs, in which nothing unfinished may be left."""
    made = tmp_path / "out"
    made.mkdir()
    yield made
    assert not [path.name for path in made.iterdir() if path.name.startswith(".")]


seeds = st.integers(0, 2**32 - 1)


@st.composite
def solids(draw: st.DrawFn, widest: int = 6) -> NDArray[np.bool_]:
    """Draw a grid (x, y, z) of cubes, some present, from sparse to crowded."""
    shape = draw(st.tuples(*[st.integers(1, widest)] * 3))
    rng = np.random.default_rng(draw(seeds))
    solid = rng.random(shape) < draw(st.sampled_from([0.08, 0.2, 0.5, 0.8, 0.95]))
    solid[tuple(rng.integers(shape))] = True
    return solid


def keys_in(solid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the rising keys of the cubes in a grid (x, y, z)."""
    return np.sort(keys_of(np.argwhere(solid)))


def contacts(solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which cells of a grid lie in a block where cubes, or gaps, meet only diagonally: looking at every block."""
    padded = np.pad(solid, 1)
    found = np.zeros_like(padded)
    for shape in ((1, 2, 2), (2, 1, 2), (2, 2, 1), (2, 2, 2)):
        blocks = np.lib.stride_tricks.sliding_window_view(padded, shape)
        blocks = blocks.reshape(*blocks.shape[:3], -1)
        for corner in range(blocks.shape[3] // 2):
            two = np.isin(np.arange(blocks.shape[3]), [corner, blocks.shape[3] - 1 - corner])
            bare = (blocks == two).all(axis=3) | (blocks == ~two).all(axis=3)
            for offset in product(*map(range, shape)):
                found[tuple(slice(o, o + n) for o, n in zip(offset, bare.shape, strict=True))] |= bare
    return np.asarray(found[1:-1, 1:-1, 1:-1])


def composed(solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill every block in which cubes, or gaps, meet only diagonally, until there is none."""
    while (contacts(solid) & ~solid).any():
        solid = solid | contacts(solid)
    return solid


def faces_in(solid: NDArray[np.bool_], *, tracking: str = "scan") -> Faces:
    """Return the faces of exactly the cubes in a grid (x, y, z), linings of cavities among them."""
    cells = np.argwhere(solid)
    blocks = Blocks.around(cells, 1)
    bitmask = blocks.bitmask_of(cells)
    shell = Shell(blocks, bitmask, bitmask, bitmask, cells[:0], closing=0, added=0)
    return exposed_faces(shell, tracking=tracking)


def cuberille_of(solid: NDArray[np.bool_]) -> QuadMesh:
    """Return the same as a mesh of unit squares."""
    found = faces_in(solid)
    return QuadMesh(found.corners.astype(float), found.quads.astype(np.int64))


def sphere(count: int, radius: float = 10.0) -> NDArray[np.float64]:
    """Spread points evenly over a sphere (Fibonacci's spiral)."""
    turn = np.arange(count) + 0.5
    z, angle = 1 - 2 * turn / count, np.pi * (3 - np.sqrt(5)) * turn
    flat = np.sqrt(1 - z**2)
    return radius * np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])


def torus(count: int, radius: float = 10.0, tube: float = 4.0) -> NDArray[np.float64]:
    """Spread points evenly over a torus: equal steps along, golden steps around, equal areas."""
    along = 2 * np.pi * (np.arange(count) * ((np.sqrt(5) - 1) / 2) % 1)
    fine = np.linspace(0, 2 * np.pi, 4096)
    area = radius * fine + tube * np.sin(fine)
    around = np.interp((np.arange(count) + 0.5) / count * area[-1], area, fine)
    ring = radius + tube * np.cos(around)
    return np.column_stack([ring * np.cos(along), ring * np.sin(along), tube * np.sin(around)])


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Two worker processes on loopback; one death is enough for Dask to hand a task back."""
    dask = pytest.importorskip("dask", reason="the extra `scale` is not installed")
    distributed = pytest.importorskip("distributed", reason="the extra `scale` is not installed")
    asked = {
        "distributed.scheduler.allowed-failures": 0,
        "distributed.scheduler.worker-saturation": 1.0,
        "temporary-directory": str(tmp_path_factory.mktemp("scratch")),
    }
    with (
        dask.config.set(asked),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", memory_limit=0,
            silence_logs=logging.CRITICAL, dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},
        ) as made,
    ):  # fmt: skip
        yield made


@pytest.fixture
def client(here: Any) -> Iterator[Any]:
    """Hand over who gives tasks to these two."""
    from distributed import Client

    with Client(here, set_as_default=False) as made:
        made.wait_for_workers(2)
        yield made
