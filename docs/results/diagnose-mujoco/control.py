"""Counted campaigns once more, moved by MuJoCo or by the base model, with mu_d stated lower: what causes a mistake?

    python docs/results/diagnose-mujoco/control.py 2027015:base:1 2027015:mujoco:0.95 >> control.jsonl

An argument is the seed of a counted campaign, what moves it (`mujoco`, or `base`: benchmarks/second without its
structure) and a factor on the stated mu_d. Plan, sensors and hidden numbers are the campaign's own; noise is another.
`left_by_truth`: of a campaign with nothing hidden, or a camera's scale, what the true numbers leave a sample in each
trial.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.second import motion as second
from benchmarks.second.campaigns import campaign_of
from benchmarks.second.drawing import draw_case
from benchmarks.second.sensing import record
from benchmarks.soft import tumble
from experiments.campaign import write_campaign
from experiments.diagnose.experiment import diagnose_campaign
from experiments.diagnose.tumble.problem import make_problem

CASES = sorted(Path(__file__).parent.glob("tumble-*/cases.jsonl"))
BY_MUJOCO = tumble.move


def by_base(numbers, duration, **_):
    """The motion of the planar model. Raises ValueError for a number that the second simulator does not have."""
    if unknown := set(numbers) - set(second.COLUMNS):
        raise ValueError(f"the second simulator has no {', '.join(sorted(unknown))}")
    time, motions = tumble.move_base_model([numbers], duration)
    return time, motions[0][:, :7]


def again(case, mover, share):
    """The record of one campaign made and diagnosed once more."""
    told = case["case"]
    random = np.random.default_rng((told["seed"], 51))
    draw_case(random, told["kind"], told.get("strength"), None, effects=tumble.EFFECTS, outside=tumble.OUTSIDE)
    plan = tumble._near(random, told["trials"], tumble.CONTACT)[0]
    tumble.move = {"mujoco": BY_MUJOCO, "base": by_base}[mover]
    readings = tumble._Bench(plan, tumble.CONTACT).measure([case["hidden"]["settings"]])[0]
    tumble.move = BY_MUJOCO
    made = record(random, plan, readings, title="soft")
    made.tables["surface"]["mu_d"] *= share
    with tempfile.TemporaryDirectory() as folder:
        found = diagnose_campaign(write_campaign(Path(folder) / "campaign", campaign_of(made)))
    fitted = found.base_parameters(found.best)
    row = {
        "seed": told["seed"], "mover": mover, "mu_d_share": share, "hidden": case["truth"] or case["outside"],
        "verdict": found.verdict, "effects": list(found.effects), "alternatives": list(found.alternatives),
        "before": {"fit": found.before.fit, "held_out": found.before.held_out},
        "after": {"fit": found.after.fit, "held_out": found.after.held_out},
        "mu_s": fitted["mu_s"]["value"], "mu_d": fitted["mu_d"]["value"], "mu_true": plan.true["mu_s"],
    }  # fmt: skip
    if told["kind"] in ("null", "camera-scale"):
        ids = [trial["id"] for trial in made.tables["trial"]]
        gravity = {f"gravity_sim[{id}]": trial["gravity_sim"] * float(factor)
                   for id, trial, factor in zip(ids, plan.trials, plan.gravity_factor, strict=True)}  # fmt: skip
        problem = make_problem(campaign_of(made))
        forms = [form for form in problem.forms if form.id == "camera-scale:same in x and y"][: len(case["truth"])]
        scale = {"camera-scale.scale_change": case["hidden"]["settings"]["scale"]} if forms else {}
        left = problem.evaluate([dict(plan.true) | gravity | scale], forms, ids)[0]
        row["left_by_truth"] = [float(np.mean(rows**2)) for rows in left.values()]
    return row


if __name__ == "__main__":
    lines = [line for path in CASES for line in path.read_text(encoding="utf-8").splitlines()]
    cases = {case["case"]["seed"]: case for case in map(json.loads, lines)}
    for argument in sys.argv[1:]:
        seed, mover, share = argument.split(":")
        print(json.dumps(again(cases[int(seed)], mover, float(share))), flush=True)
