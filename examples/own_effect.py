"""Hide an effect of your own in made-up pushes, offer it as a candidate from a file, and see it named."""

import json
import sys
from math import exp
from pathlib import Path

import numpy as np

from experiments import diagnose
from experiments import terms as folder_of_effects

CAMPAIGN = """
format = "hedgehog-campaign/1"
kind = "penetration"
name = "mud"
spike = {mass = 0.5, diameter = 0.012, tip = "sphere"}
surface = {kind = "sand", stiffness = 900.0, damping = 4.0}
uncertainty = {stiffness = 0.1, damping = 0.2}
sensors = {depth = {std = [1e-4]}, force = {std = [0.05]}}
"""
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples") / "own-effect"
pushes, noise = out / "campaign", np.random.default_rng(1)
pushes.mkdir(parents=True)
for number, speed in enumerate((0.01, 0.1, 0.03, 0.01)):  # mud resists by 1.5 N (1 - exp(-v / 0.03 m/s))
    time = np.linspace(0.0, 0.02 / speed, 400)
    force = 900.0 * speed * time + 4.0 * speed + 1.5 * (1.0 - exp(-speed / 0.03)) + 0.05 * noise.standard_normal(400)
    rows = np.column_stack([time, speed * time + 1e-4 * noise.standard_normal(400), force])
    np.savetxt(pushes / f"{number}.csv", rows, delimiter=",", header="t_s,depth_m,force_N", comments="")
    CAMPAIGN += f'[[trial]]\nid = "{number}"\nmode = "driven"\ngravity = 9.81\nspeed = {speed}\ndata = "{number}.csv"\n'
(pushes / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")

mud = Path(folder_of_effects.__file__).parent / "sticky_mud.py"  # the effect: equation, parameters, words, in one file
diagnose.run(diagnose.Settings(campaign=str(pushes), effect_file=(str(mud),)), out / "diagnosis")
diagnosis = json.loads((out / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))
print(diagnosis["verdict"], [effect["id"] for effect in diagnosis["effects"]])

assert [effect["id"] for effect in diagnosis["effects"]] == ["sticky-mud"], "the hidden effect is named, and no other"
