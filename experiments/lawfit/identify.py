"""Sentences on which parameters the runs of a fit identify; and what each run contributed."""

import numpy as np

from experiments.grains.similarity import inertial_number
from experiments.runs.types import Json

from .fit import LawFit, solve_law
from .laws import Candidate
from .settings import say

__all__ = ["identified", "influences", "speed_to_add"]

QUASI_STATIC = 0.01
"""Inertial number below which a run counts as quasi-static [1] (GDR MiDi, Eur. Phys. J. E 14 (2004), 341)."""
VISIBLE = 0.2
"""Least share of the rate in the force of a run that is added to identify C [1]."""


def speed_to_add(fitted: LawFit[Candidate]) -> float:
    """Speed of a run that identifies C [m/s]: there the upper end of C's interval gives `VISIBLE` of the mean force.

    It is two to ten times the fastest speed of the runs.
    """
    data, found = fitted.data, fitted.parameter("damping")
    fastest = max(data.speeds)
    wanted = VISIBLE * float(data.force.mean()) / found.high if found.high > 0 else 0.0
    return float(f"{max(2 * fastest, min(wanted, 10 * fastest)):.1g}")


def identified(fitted: LawFit[Candidate]) -> list[str]:
    """Sentences on what these runs do not identify of the spring-damper; none if they identify K and C."""
    data, found, said = fitted.data, fitted.parameter("damping"), []
    foundation = data.foundation
    of = {"gravity": foundation.gravity, "diameter": foundation.diameter, "grain": foundation.grain}
    numbers = [inertial_number(speed, **of) for speed in data.speeds]
    more = speed_to_add(fitted)
    several = [bed for bed in data.beds if len({run.speed for run in data.runs if run.bed == bed}) > 1]
    if max(numbers) < QUASI_STATIC:
        said.append(say("all_slow", fastest=max(data.speeds), number=max(numbers), most=QUASI_STATIC, more=more))
    elif found.low <= 0:
        said.append(say("damping_unsure", found=found, more=more, percent=100 * VISIBLE))
    if len(several) < 2:
        said.append(say("speeds_in_one_bed"))
    stiffness = fitted.parameter("stiffness")
    if stiffness.low <= 0:
        said.append(say("stiffness_unsure", found=stiffness))
    return said


def influences(fitted: LawFit[Candidate]) -> list[Json]:
    """For each run its rms error over its rms force, and K [N/m] and C [N s/m] fitted without it."""
    data, found = fitted.data, []
    error = fitted.predicted - data.force
    for number, run in enumerate(data.runs):
        rows = data.run_of_row == number
        rest = data.only(lambda other, run=run: other is not run)  # type: ignore[misc]
        theta, _ = solve_law(fitted.candidate, rest, fitted.theta, fitted.share)
        found.append({
            "run": run.id, "bed": run.bed, "kind": run.kind, "speed": run.speed,
            "misfit": float(np.sqrt(np.mean(error[rows] ** 2) / np.mean(data.force[rows] ** 2))),
            "stiffness": float(theta[0]), "damping": float(theta[1]),
        })  # fmt: skip
    return found
