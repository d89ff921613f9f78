"""What will not fit into the memory is refused before it is made."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from conftest import sphere
from tomomesh.errors import ResourceError
from tomomesh.pointcloud import forecast
from tomomesh.pointcloud.forecast import free_memory, require_room, require_room_for_points
from tomomesh.pointcloud.samples import Samples

GIB = 2**30


def even(count: int, spacing: float) -> Samples:
    """Samples of which only the spacing matters."""
    none = np.zeros((count, 3))
    return Samples(none, none, np.full(count, spacing), np.zeros(count), np.zeros(count), 0, 1.0)


def system(root: Path, files: dict[str, str]) -> Path:
    """Lay down what a system says of its memory."""
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


class TestFreeMemory:
    def test_the_machine_alone(self, tmp_path: Path) -> None:
        told = {"proc/meminfo": "MemTotal: 16 kB\nMemFree: 2 kB\nMemAvailable:    3145728 kB\n"}
        assert free_memory(system(tmp_path, told)) == 3 * GIB

    def test_the_narrowest_group_above_counts_and_gives_up_its_files(self, tmp_path: Path) -> None:
        told = {
            "proc/meminfo": f"MemAvailable: {2**30} kB\n",
            "proc/self/cgroup": "0::/job/step\n",
            "sys/fs/cgroup/job/step/memory.max": "max\n",
            "sys/fs/cgroup/job/step/memory.current": "5\n",
            "sys/fs/cgroup/job/memory.max": f"{8 * GIB}\n",
            "sys/fs/cgroup/job/memory.current": f"{3 * GIB}\n",
            "sys/fs/cgroup/job/memory.stat": f"anon 7\ninactive_file {GIB}\n",
        }
        assert free_memory(system(tmp_path, told)) == 6 * GIB

    def test_groups_of_the_first_version(self, tmp_path: Path) -> None:
        told = {
            "proc/meminfo": f"MemAvailable: {2**30} kB\n",
            "proc/self/cgroup": "9:name=systemd:/\n4:cpu,memory:/job\n0::/\n",
            "sys/fs/cgroup/memory/memory.limit_in_bytes": "9223372036854771712\n",
            "sys/fs/cgroup/memory/job/memory.limit_in_bytes": f"{4 * GIB}\n",
            "sys/fs/cgroup/memory/job/memory.usage_in_bytes": f"{GIB}\n",
        }
        assert free_memory(system(tmp_path, told)) == 3 * GIB

    def test_without_any_word_it_is_all_that_the_machine_has(self, tmp_path: Path) -> None:
        assert free_memory(tmp_path) > 0

    def test_a_limit_on_addresses(self) -> None:
        resource = pytest.importorskip("resource", reason="there is none here")
        program = (
            "import resource, numpy\n"
            "from tomomesh.pointcloud.forecast import free_memory\n"
            f"resource.setrlimit(resource.RLIMIT_AS, ({64 * GIB}, resource.RLIM_INFINITY))\n"
            "print(free_memory())"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert resource.RLIM_INFINITY
        assert 0 < float(done.stdout) < 64 * GIB


class TestRequireRoom:
    @pytest.fixture
    def small(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(forecast, "free_memory", lambda: float(GIB))

    @pytest.mark.usefixtures("small")
    @pytest.mark.parametrize("cell", [(0.01, 0.01, 0.01), (0.01, 0.02, 0.04), (1e-300, 1e-300, 1e-300)])
    def test_the_smallest_cell_fits_and_is_not_much_too_large(self, cell: tuple[float, float, float]) -> None:
        samples, edges = even(100_000, 0.1), np.array(cell)
        with pytest.raises(ResourceError, match=r"needs .*iB.*at most 1 GiB.*--cell") as caught:
            require_room(100_000, samples, edges)
        found = re.search(r"at least ([-+.e\d]+)\. ", str(caught.value))
        assert found is not None
        least = edges / edges.min() * float(found[1])
        require_room(100_000, samples, least)
        with pytest.raises(ResourceError):
            require_room(100_000, samples, 0.85 * least)

    @pytest.mark.usefixtures("small")
    def test_clouds_too_large_to_settle(self) -> None:
        require_room_for_points(10**6)
        with pytest.raises(ResourceError, match="10000000 points need"):
            require_room_for_points(10**7)
        with pytest.raises(ResourceError):
            require_room(2 * 10**7, even(10, 0.1), np.ones(3))

    def test_usual_clouds_pass(self) -> None:
        points = sphere(1000)
        require_room_for_points(len(points))
        require_room(len(points), even(1000, math.sqrt(4 * math.pi * 100 / 1000)), np.full(3, 1.0))


class TestMeasured:
    """The forecast is above what a run takes, and not far above."""

    @pytest.mark.parametrize("even", [True, False])
    def test_a_run_stays_within_it(self, even: bool) -> None:
        if not Path("/proc/self/status").exists():
            pytest.skip("nothing tells the peak here")
        program = (
            f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
            "import re, pathlib\n"
            "from conftest import sphere\n"
            "from tomomesh import reconstruct_points\n"
            "from tomomesh.pointcloud import forecast as f\n"
            "status = pathlib.Path('/proc/self/status')\n"
            "peak = lambda: 1024 * int(re.search(r'VmHWM:\\s+(\\d+)', status.read_text())[1])\n"
            "reconstruct_points(sphere(1000)); before = peak()\n"
            f"r = reconstruct_points(sphere(40_000), cell_mm=(0.1,), remesh={even}).report\n"
            f"need = f.FACE[{even}] * f.SIDES * 3 * r['quality']['area_mm2'] / 0.01\n"
            "need += (f.SETTLED + f.MEASURED) * 40_000\n"
            "print((peak() - before) / need)"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert 0.3 < float(done.stdout) < 1
