"""Readings of diagnose-grains beside the spring-damper and the named effect: draws docs/images/diagnose-grains-law.png.

`python docs/results/grains_law.py` from the root of a checkout computes both laws, a minute of processor time. The
spring-damper has K and C as they were fitted without the effect: `base`, `before` of diagnosis.json.
"""

import json
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.cli.main import main as hedgebed
from vis.diagnose.figures import BASE, trials_of
from vis.page.folder import Run, RunFolder, Series, read_columns, read_folder
from vis.page.plots import styled, title_above
from vis.penetrate.report import draw_amended

HERE = Path(__file__).parent
READINGS = HERE / "diagnose-grains"


def readings(file: str) -> Series:
    """One recording; what it does not have, such as the force of a drop, is not a number."""
    columns, _ = read_columns(READINGS / file)
    absent = np.full(len(columns["t_s"]), np.nan)
    force = columns.get("force_N", absent)
    return Series(columns["t_s"], columns["depth_m"], absent, force, np.full(len(absent), "", dtype="<U4"))


def beside(run: RunFolder) -> RunFolder:
    """The laws' runs, each with the readings of all beds that did the same."""
    trials = tomllib.loads((READINGS / "campaign.toml").read_text(encoding="utf-8"))["trial"]
    runs = []
    for law in run.runs:
        same = law.id.partition("-")[2]
        beds = [trial for trial in trials if trial["id"].partition("-")[2] == same]
        runs += [replace(law, bed=readings(beds[0]["data"]))]
        runs += [
            Run(bed["id"], law.kind, seed, law.speed, readings(bed["data"]), None, {}, law.amended)
            for seed, bed in enumerate(beds[1:], 2)
        ]
    return replace(run, runs=runs)


def laws(folder: Path) -> RunFolder:
    """Pushes, drops and a set-down on both laws, in `folder`."""
    found = json.loads((READINGS / "diagnosis.json").read_text(encoding="utf-8"))["base"]["before"]
    fitted = ", ".join(f"{name} = {found[name]['value']}" for name in ("stiffness", "damping"))
    text = (READINGS / "model.toml").read_text(encoding="utf-8")
    model, run = folder / "model.toml", folder / "run"
    note = f'[notes]\n"fitted_without_effects" = {{"0.012" = {{{fitted}}}}}\n'
    model.write_text(text.replace("[notes]\n", note), encoding="utf-8")
    command = ["penetrate", "--ground", "spring-damper", "--model", str(model), "--seeds", "1", "--out", str(run)]
    command += ["--speeds", "0.1", "0.2", "0.4", "--drop-speeds", "0.1", "0.15", "0.2"]
    if hedgebed(command):
        raise SystemExit("hedgebed penetrate failed")
    return read_folder(run)


def main() -> None:
    """Compute the laws and draw the picture."""
    with tempfile.TemporaryDirectory() as folder, styled():
        drawing = draw_amended(beside(laws(Path(folder))), base=BASE)  # the colour of the base model in a diagnosis
        assert drawing is not None
        title_above(drawing, trials_of(READINGS))
        drawing.savefig(HERE.parent / "images" / "diagnose-grains-law.png", dpi=130)


if __name__ == "__main__":
    main()
