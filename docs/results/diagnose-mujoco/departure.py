"""How far MuJoCo's motions without anything hidden part from the base model, for several contacts.

    python docs/results/diagnose-mujoco/departure.py contacts --out docs/results/diagnose-mujoco/departure.csv
    python docs/results/diagnose-mujoco/departure.py plans --out docs/results/diagnose-mujoco/plans.csv

contacts: a row is one choice. `damper`: C over that of the suite. Readings without noise of 8 plans of 6 trials, seeds
12 to 19, as drawn before the suite looks for plans near the base model; none of them is counted. Distance of a trial:
root mean square over all channels, over the noise, at the true numbers. The base model is that of benchmarks/second
without its structure. `creep_m`: down a slope of 0.1 rad in 1 s, on brick at 0.1 m/s2.

plans: a row is one plan as the suite draws it; `structure` is the distance that is left beside the uncertain numbers
and the camera's zeros.
"""

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.second.sensing import CHANNELS, weigh
from benchmarks.soft import tumble
from benchmarks.soft.motion import CONTACT, Contact, move

CLOCK = dict(zip(CHANNELS, ("camera_t",) * 3 + ("imu_t",) * 3 + ("wheel_t",), strict=True))
CHOICES = (
    (CONTACT, 1.0), (Contact(impedance=0.9), 1.0), (Contact(impedance=0.1), 1.0), (Contact(impedance=0.01), 1.0),
    (Contact(impedance=3e-3), 1.0), (Contact(impedance=3e-4), 1.0), (Contact(impratio=10.0), 1.0),
    (Contact(impratio=1e5), 1.0), (Contact(both_ways=1.0), 1.0), (CONTACT, 10.0), (CONTACT, 3.0), (CONTACT, 0.3),
)  # fmt: skip
COLUMNS = (
    "impedance", "impratio", "both_ways", "damper", "until_s", "median", "share_80", "share_90", "most", "creep_m",
)  # fmt: skip
DURATION = 1.5  # s

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("what", choices=("contacts", "plans"))
parser.add_argument("--out", type=Path, required=True, help="the CSV")


def plans_of(damper):
    """Plans with all dampers times `damper`."""
    drawn = [tumble._draw_plan(np.random.default_rng((seed, 51)), 6) for seed in range(12, 20)]
    return [
        replace(plan, duration=DURATION, true=plan.true | {"damping": damper * plan.true["damping"]}) for plan in drawn
    ]


def distances(plan, contact, until):
    """Of each trial up to a time [s]."""
    found = []
    for here, there in zip(tumble._Bench(plan, contact).measure([{}])[0], tumble._of_base_model(plan), strict=True):
        away = [((here[name] - there[name]) / plan.std[name])[here[CLOCK[name]] < until] for name in CHANNELS]
        found.append(float(np.sqrt(np.mean(np.concatenate(away) ** 2))))
    return found


def creep(contact):
    """Way down a slope [m]."""
    given = {
        "mass": 5.3,
        "inertia": 0.06,
        "stiffness": 1.5e4,
        "damping": 4.0,
        "mu_s": 0.5,
        "gravity_sim": 0.1,
        "slope": 0.1,
    }
    still = {"torque": 0.0, "torque_until": 0.0, "wheel_speed_0": 0.0, "wheel_sign": 1.0}
    return -float(move(given | still, 1.0, contact=contact)[1][-1, 0])


def contacts(rows):
    """Write distances by choice of the contact."""
    rows.writerow(COLUMNS)
    for contact, damper in CHOICES:
        plans = plans_of(damper)
        for until in (0.6, 1.0, 1.5):
            found = [one for plan in plans for one in distances(plan, contact, until)]
            shares = [f"{share:.3g}" for share in np.quantile(found, (0.5, 0.8, 0.9, 1.0))]
            rows.writerow((contact.impedance, contact.impratio, contact.both_ways, damper, until, *shares,
                           f"{creep(contact):.3g}"))  # fmt: skip


def structures(rows):
    """Write what is left of the distance of 36 plans."""
    rows.writerow(("seed", "surface", "structure"))
    for seed in range(101, 113):
        random = np.random.default_rng((seed, 51))
        for _ in range(3):
            plan = tumble._draw_plan(random, 6)
            weighing = weigh(plan, tumble._Bench(plan, CONTACT).measure)[1]
            rows.writerow((seed, plan.surface, f"{weighing.whole(tumble._of_base_model(plan)):.3g}"))


if __name__ == "__main__":
    asked = parser.parse_args()
    with asked.out.open("w", newline="", encoding="utf-8") as file:
        {"contacts": contacts, "plans": structures}[asked.what](csv.writer(file))
