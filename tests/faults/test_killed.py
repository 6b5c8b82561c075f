"""Long experiments killed (kill -9) at random moments and resumed: the same bits as of a run left alone.

Slow: `make torture` kills each experiment as often as HEDGEBED_KILLS says.
"""

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
KILLS = int(os.environ.get("HEDGEBED_KILLS", "3"))
GRAINS = ["--grain", "0.0024", "--checkpoint-interval", "0.5", "--frame-count", "0", "--threads", "1"]
EXPERIMENTS = {
    "penetrate": [
        "penetrate", *GRAINS, "--bed-size", "0.03", "0.03", "0.0254", "--tip-diameter", "0.0075", "--allow-coarse",
        "--shaft-length", "0.03", "--seeds", "1", "--speeds", "0.2", "--depth", "0.006", "--hold", "0.005", "--load",
        "0.1", "--mass", "0.05", "--drop-speeds", "0.1", "--after-stop", "0.01", "--rest-time", "0.01",
    ],
    "sweep": [
        "sweep", "--experiment", "tumble", "--fixed", "duration=4", "--over", "torque=0.14:0.2:0.02", "mu_s=[0.4, 0.6]",
        "--workers", "2",
    ],
}  # fmt: skip


def begun(tokens, cache):
    """The command in a process of its own that leads its group."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "HEDGEBED_CACHE": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-m", "hedgebed", *map(str, tokens), "--quiet"], env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def files(folder):
    """What a run says: its numbers, series and tables."""
    paths = [path for path in folder.rglob("*") if path.suffix in (".csv", ".nc") or path.name == "result.json"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths if "checkpoint" not in path.parts}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_killed_at_random_moments_ends_in_the_same_bits(name, tmp_path):
    chance, tokens = random.Random(name), EXPERIMENTS[name]
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    started = time.monotonic()
    process = begun([*tokens, "--out", whole], tmp_path / "cache-of-whole")
    assert process.wait() == 0, process.stderr.read()
    lasts = time.monotonic() - started
    killed = 0
    while killed < KILLS:
        there = (broken / "run.toml").exists()
        process = begun(["resume", broken] if there else [*tokens, "--out", broken], tmp_path / "cache")
        try:
            status = process.wait(timeout=chance.uniform(0.0, lasts))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed += 1
        else:
            assert status == 0, process.stderr.read()
            break
    process = begun(["resume", broken] if (broken / "run.toml").exists() else [*tokens, "--out", broken],
                    tmp_path / "cache")  # fmt: skip
    assert process.wait() == 0, process.stderr.read()
    assert files(broken) == files(whole) and "result.json" in files(whole)
