"""Which package the bed's kernels are compiled by, and that what is compiled is kept."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import hedgebed_taichi

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
