"""Give kept results of `penetrate` their 95 % intervals: python docs/results/sure.py FOLDER...

Each FOLDER has the run.toml and result.json of a finished `hedgebed penetrate`. `sure` and `rest`, the depth at rest of
a foot that this bed cannot show, are made again from the numbers that are kept (fits of the beds, moments and peaks of
the runs, depths at rest): no run is repeated. Then delete the line of result.json in cost.json and run digests.py.
"""

import json
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from experiments.penetrate import beds
from experiments.penetrate.fit import Fit, Moments, fit_moments
from experiments.penetrate.rest import answer, how_sure
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import write_json


def kept_findings(settings, result):
    """What `answer` and `how_sure` read of a run, from its result.json."""
    runs = result["runs"]
    moments = {run["id"]: Moments(**run["moments"]) for run in runs if "moments" in run}
    names = ("stiffness", "damping", "stiffness_error", "damping_error")
    own = {
        fit["seed"]: Fit(*(fit[name] for name in names), tuple(fit["runs"]), fit["correlation"])
        for fit in result["fits"]
    }
    # The peak of each push, for the largest force of all.
    peaks = [run["quantities"]["peak_force"]["value"] for run in runs if run["kind"] == "driven"]
    stood = [run["quantities"].get("sinkage", {}).get("value") for run in runs if run["kind"] == "set_down"]
    entries = {
        "driven": [SimpleNamespace(force=np.array(peaks))],
        "set_down": [SimpleNamespace(ended=run["ended"]) for run in runs if run["kind"] == "set_down"],
    }
    return SimpleNamespace(
        settings=settings, fit=fit_moments(moments), seed_fits=own, beds={}, seeds=list(own),
        beds_separate=all(fit.separates for fit in own.values()),
        sinkages=lambda of: stood, of=entries.__getitem__,
    )  # fmt: skip


def add_intervals(folder: Path) -> None:
    """Write `sure` into result.json of `folder`."""
    text = (folder / "run.toml").read_text(encoding="utf-8")
    settings = PenetrateSettings(**tomllib.loads(text)["settings"])
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    findings, material = kept_findings(settings, result), beds.find_material(settings)
    rest = answer(findings, material)
    result["sure"] = how_sure(findings, material, rest)
    if rest is not None:
        result["rest"] = rest
    write_json(folder / "result.json", result)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        add_intervals(Path(name))
