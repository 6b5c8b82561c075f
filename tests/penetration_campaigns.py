"""Campaigns of penetration for tests of diagnose: closed forms of driven trials, drops by scipy's integrator."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.campaign import Campaign, PenetrationCampaign, Recording, write_campaign
from experiments.campaign.digests import DIGESTS
from experiments.diagnose import experiment
from experiments.diagnose.experiment import diagnose_campaign
from experiments.diagnose.settings import DiagnoseSettings

MASS, STIFFNESS, DAMPING, GRAVITY = 0.5, 900.0, 4.0, 9.80665
DEPTH_STD, FORCE_STD, ACCEL_STD = 1e-4, 0.05, 0.1


def driven_trial(force, *, speed, depth=0.02, retreat=False, seed=0, force_std=FORCE_STD):
    """Rows of a spike driven at a constant speed and, if asked, back again: `force(z, v, deepest)` [N]."""
    random = np.random.default_rng(seed)
    total = depth / speed * (1.8 if retreat else 1.0)
    time = np.linspace(0, total, 400)
    going = (time < depth / speed) | (not retreat)
    z = np.where(going, speed * time, 2 * depth - speed * time)
    v = np.where(going, speed, -speed)
    top = np.maximum.accumulate(z)
    values = np.array([force(a, b, c) if a > 0 else 0.0 for a, b, c in zip(z, v, top, strict=True)])
    return Recording({
        "t_s": time, "depth_m": z + DEPTH_STD * random.standard_normal(len(z)),
        "force_N": values + force_std * random.standard_normal(len(z)),
    })  # fmt: skip


def drop_trial(force, *, speed, seed=0):
    """Rows of a drop through `force(z, v)` [N], m z'' = m g - force, for 0.15 s (no rebound above the surface)."""
    random = np.random.default_rng(seed)
    time = np.linspace(0, 0.15, 151)

    def motion(t, y):
        return [y[1], GRAVITY - (force(y[0], y[1]) if y[0] > 0 else 0.0) / MASS]

    solved = solve_ivp(motion, (0, 0.15), [0.0, speed], t_eval=time, rtol=1e-9, atol=1e-11, max_step=2e-4)
    accel = np.array([motion(t, y)[1] for t, y in zip(time, solved.y.T, strict=True)])
    return Recording({
        "t_s": time, "depth_m": solved.y[0] + DEPTH_STD * random.standard_normal(len(time)),
        "accel_m_s2": accel + ACCEL_STD * random.standard_normal(len(time)),
    })  # fmt: skip


def campaign_of(trials, *, stiffness=1.05 * STIFFNESS, damping=0.9 * DAMPING, doubt=(0.1, 0.2), diameter=0.012,
                depth_std=DEPTH_STD):  # fmt: skip
    """A campaign of (id, mode, speed, recording), or of (id, mode, speed, recording, more keys of the trial)."""
    tables, recordings = [], {}
    for name, mode, speed, recording, *more in trials:
        table = {"id": name, "mode": mode, "gravity": GRAVITY, "speed": speed, "data": f"{name}.csv"}
        tables.append(table | (more[0] if more else {}))
        recordings[(name, "data")] = recording
    text = {
        "format": "hedgehog-campaign/1", "kind": "penetration", "name": "made up",
        "spike": {"mass": MASS, "diameter": diameter, "tip": "sphere"},
        "surface": {"kind": "sand", "stiffness": stiffness, "damping": damping},
        "uncertainty": {"stiffness": doubt[0], "damping": doubt[1]},
        "sensors": {"depth": {"std": (depth_std,)}, "force": {"std": (FORCE_STD,)}, "accel": {"std": (ACCEL_STD,)}},
        "trial": tuple(tables),
    }  # fmt: skip
    return Campaign(PenetrationCampaign.model_validate(text), recordings)


def run_and_diagnosis(folder: Path, campaign: Campaign):
    """The result of `hedgebed diagnose` on a campaign, in ``folder / "run"``, and the diagnosis behind it."""
    kept = []

    def keep(*campaign, **options):
        kept.append(diagnose_campaign(*campaign, **options))
        return kept[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(experiment, "diagnose_campaign", keep)
        settings = DiagnoseSettings(campaign=str(saved(folder / "campaign", campaign)))
        return experiment.run(settings, folder / "run"), kept[0]


def on_firm_ground(problem):
    """The problem of pushes whose bed carries from the first touch on, as one knows: its base model is linear."""
    problem.base = tuple(parameter for parameter in problem.base if parameter.name != problem.loose)
    return problem


def saved(folder: Path, campaign: Campaign) -> Path:
    """The campaign as a folder."""
    written = write_campaign(folder, campaign)
    (written / DIGESTS).unlink()  # as one that a person makes, for tests to change
    return written
