"""``make gpu``: refused by name where no GPU is; the sweep's worker does the race's work, here on the CPU."""

import json
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import gpu
from benchmarks.race.grains import Grains
from benchmarks.sweep import table, worker

PERIOD = 0.0264


def layer():
    """36 grains on the floor, with gaps."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(6), np.arange(6)))
    places = np.column_stack([(i + 0.5) * PERIOD / 6, (j + 0.5) * PERIOD / 6, np.full(36, 0.002)])
    return Grains(places, np.full(36, 0.002), (PERIOD, PERIOD))


def no_gpu(*_, **__):
    raise FileNotFoundError("nvidia-smi")


def test_without_a_gpu_it_is_refused_by_name_and_nothing_runs(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(subprocess, "run", no_gpu)
    assert gpu.main([str(tmp_path / "out")]) == 2
    assert "arch = 'cuda'" in capsys.readouterr().err and not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [["one", "two"], ["--fast"]])
def test_a_word_that_it_does_not_know_is_refused(arguments, capsys):
    assert gpu.main(arguments) == 2
    assert "make gpu" in capsys.readouterr().err


def test_a_bed_side_by_side_is_itself_in_every_copy():
    one = layer()
    many = worker.side_by_side(one, 3, 2)
    assert many.count == 6 * one.count and many.period == (3 * PERIOD, 2 * PERIOD)
    back = many.positions.reshape(6, one.count, 3) - one.positions
    assert np.allclose(back[..., :2] / PERIOD, np.round(back[..., :2] / PERIOD)) and not back[..., 2].any()
    assert len({tuple(row) for row in np.round(back[:, 0, :2] / PERIOD).astype(int).tolist()}) == 6


@pytest.mark.parametrize("ended", [True, False])
def test_tests_are_counted_with_the_names_of_those_that_failed_also_where_their_time_ends(tmp_path, ended):
    """The log of real tests, whole and cut before its last lines."""
    (tmp_path / "test_four.py").write_text(
        "import pytest\ndef test_good(): pass\n@pytest.mark.parametrize('k', ['a b'])\ndef test_bad(k): assert 0\n"
        "@pytest.mark.skip\ndef test_left_out(): pass\n@pytest.fixture\ndef broken(): raise ValueError\n"
        "def test_not_begun(broken): pass\n"
    )
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-v",
        "-n",
        "1",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        ".",
        "test_four.py",
    ]
    log = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True).stdout
    found = gpu._counts(log if ended else log[: log.index("= ERRORS =")])
    assert {name.partition("::")[2] for name in found.pop("failures")} == {"test_bad[a b]", "test_not_begun"}
    assert found == {"passed": 1, "failed": 2, "skipped": 1, "ended": ended}
    assert gpu._counts("")["failed"] == 1


@pytest.mark.long
def test_a_row_of_the_sweep_goes_into_the_table(tmp_path):
    row = worker.measure(layer(), arch="cpu", steps=20, precision="float64", rolling=True, warm=10)
    assert row["speed"] == pytest.approx(36 * 20 / row["wall_s"]) and row["packing"] > 0.1
    assert row["touching"] == 0 and row["bytes_per_grain"] > 300  # grains have gaps and only touch the floor
    bench = {
        "date": "today", "version": "1", "commit": "abc", "command": "make gpu", "rows": [row], "remarks": ["one"],
        "gpu": {"name": "card", "driver": "5"}, "machine": {"cores": 2, "taichi": "taichi 1"},
        "tests": {"passed": 3, "failed": 1, "skipped": 1, "wall_s": 2.0, "failures": ["a.py::b"], "ended": False},
    }  # fmt: skip
    file, page = tmp_path / "bench.json", tmp_path / "page.md"
    file.write_text(json.dumps(bench), encoding="utf-8")
    page.write_text(f"before\n{table.MARKS[0]}\nold\n{table.MARKS[1]}\nafter\n", encoding="utf-8")
    assert table.main([str(file), str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "old" not in text and text.startswith("before") and text.endswith("after\n")
    cells = next(line for line in text.splitlines() if line.startswith("| 36 |")).split(" | ")
    assert cells[1:3] == ["float64", "yes"] and "3 passed" in text and "- one" in text
    assert "Failed: `a.py::b`." in text and "time ended" in text
