"""Which package the bed's kernels are compiled by, and that what is compiled is kept."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import hedgebed_taichi
from dem.engine import runtime

CPUINFO = "processor\t: 0\nvendor_id\t: {}\ncpu family\t: {}\nmodel\t\t: 2\n"


@pytest.mark.parametrize(
    ("vendor", "family", "installed", "expected"),
    [
        ("AuthenticAMD", 26, True, "quadrants"),
        ("AuthenticAMD", 26, False, "taichi"),
        ("AuthenticAMD", 25, True, "taichi"),
        ("GenuineIntel", 6, True, "taichi"),
    ],
)
def test_the_fork_is_taken_where_taichis_compiler_does_not_know_the_processor(
    vendor, family, installed, expected, tmp_path, monkeypatch
):
    said = tmp_path / "cpuinfo"
    said.write_text(CPUINFO.format(vendor, family))
    monkeypatch.setattr(hedgebed_taichi, "_PROCESSOR", said)
    monkeypatch.setattr(hedgebed_taichi, "find_spec", lambda name: installed or None)
    monkeypatch.delenv("HEDGEBED_TAICHI", raising=False)
    assert hedgebed_taichi.chosen.__wrapped__() == expected
    monkeypatch.setattr(hedgebed_taichi, "_PROCESSOR", tmp_path / "missing")  # not Linux
    assert hedgebed_taichi.chosen.__wrapped__() == "taichi"


@pytest.mark.long
def test_a_script_leaves_its_kernels_in_taichis_cache(tmp_path):
    """However it imports the bed: the order in which its modules end once decided."""
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np\n"
        "from dem import SAND, Bed\n"
        "grain = {'positions': np.full((1, 3), 0.01), 'radii': np.full(1, 0.002)}\n"
        "bed = Bed.from_grains(SAND, size=(0.02, 0.02, 0.02), **grain)\n"
    )
    environment = os.environ | {
        "TI_OFFLINE_CACHE_FILE_PATH": str(tmp_path),
        "QD_OFFLINE_CACHE_FILE_PATH": str(tmp_path),
    }
    environment["PYTHONPATH"] = str(Path(hedgebed_taichi.__file__).parent)
    subprocess.run([sys.executable, str(script)], env=environment, check=True)
    assert len([path for path in tmp_path.rglob("*") if path.is_file() and path != script]) > 5


def test_compiled_kernels_are_kept_beyond_the_hundred_megabytes_of_taichi():
    runtime.start(threads=1)
    kept = hedgebed_taichi.ti.lang.impl.current_cfg().offline_cache_max_size_of_files
    assert kept == hedgebed_taichi.KEPT_KERNELS > 1e8


# Kernels with nothing, with a dataclass of arrays, and with a member that is an array; how often each was read.
READINGS = """
import dataclasses
import sys
from hedgebed_taichi import ti

ti.init(arch=ti.cpu, cpu_max_num_threads=1, offline_cache=False)
kernels, readings = sys.modules["quadrants.lang.kernel"].Kernel, []
read = kernels.get_tree_and_ctx
kernels.get_tree_and_ctx = lambda self, **options: (readings.append(self.func.__name__), read(self, **options))[1]


@dataclasses.dataclass(frozen=True)
class Pair:
    used: ti.types.NDArray[ti.f64, 1]
    unused: ti.types.NDArray[ti.f64, 1]


@ti.data_oriented
class Holder:
    def __init__(self):
        self.unused, self.used, self.field = ti.ndarray(ti.f64, 3), ti.ndarray(ti.f64, 3), ti.field(ti.f64, 3)
        self.used.fill(2.0)

    @ti.kernel
    def held(self) -> ti.f64:
        return self.used[1] + self.field[1]


class Free:
    def __init__(self):
        self.field = ti.field(ti.f64, 3)


Free = ti.data_oriented(Free)


@ti.func
def twice(pair: Pair):
    return 2.0 * pair.used[1]


@ti.kernel
def given(pair: Pair) -> ti.f64:
    return twice(pair)


@ti.kernel
def plain(free: ti.template(), y: ti.f64) -> ti.f64:
    return free.field[1] + y


pair = Pair(used=ti.ndarray(ti.f64, 3), unused=ti.ndarray(ti.f64, 3))
pair.used.fill(3.0)
print(plain(Free(), 1.0), given(pair), Holder().held(), *(readings.count(name) for name in ("plain", "given", "held")))
"""


@pytest.mark.skipif(not find_spec("quadrants"), reason="quadrants is not installed: pip install 'hedgebed[quadrants]'")
def test_the_fork_reads_a_kernel_twice_only_where_it_has_to(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(READINGS)
    environment = os.environ | {
        "HEDGEBED_TAICHI": "quadrants",
        "PYTHONPATH": str(Path(hedgebed_taichi.__file__).parent),
    }
    said = subprocess.run([sys.executable, str(script)], env=environment, check=True, capture_output=True, text=True)
    assert said.stdout.splitlines()[-1].split() == ["1.0", "6.0", "2.0", "1", "2", "2"]
