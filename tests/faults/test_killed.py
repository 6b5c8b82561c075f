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


def begun(tokens, cache, log):
    """The command in a process of its own; what it says goes to the file `log`."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "HEDGEBED_CACHE": str(cache)}
    command = [sys.executable, "-m", "hedgebed", *map(str, tokens), "--quiet"]
    with log.open("w") as file:
        return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=file)


def files(folder):
    """What a run says: its numbers, series and tables."""
    paths = [path for path in folder.rglob("*") if path.suffix in (".csv", ".nc") or path.name == "result.json"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_killed_at_random_moments_ends_in_the_same_bits(name, tmp_path):
    """A run that comes to its end between two kills is compared, and the next begins."""
    chance, tokens, log = random.Random(name), EXPERIMENTS[name], tmp_path / "log"
    started = time.monotonic()
    assert begun([*tokens, "--out", tmp_path / "whole"], tmp_path / "cache", log).wait() == 0, log.read_text()
    lasts, whole, killed, turn = time.monotonic() - started, files(tmp_path / "whole"), 0, 0
    assert "result.json" in whole
    ended = True
    while killed < KILLS or not ended:
        if ended:
            turn += 1
            out, cache = tmp_path / f"broken{turn}", tmp_path / f"cache{turn}"
        process = begun(["resume", out] if (out / "run.toml").exists() else [*tokens, "--out", out], cache, log)
        try:
            status = process.wait(timeout=chance.uniform(0.0, lasts) if killed < KILLS else None)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed, ended = killed + 1, False
        else:
            ended = True
            assert status == 0, log.read_text()
            assert files(out) == whole
