"""The restitution asked for, at any speed: with fine steps and with the bed's own, cut at zero and tensile."""

import math
from functools import partial

import numpy as np

from dem import Bed, Material
from dem.contact.timestep import time_step_for
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, told, worst
from experiments.validate.base.spheres import ALUMINA, RADIUS, SIXTEEN, row_of_grains

from .law_alone import staggered_rebound
from .words import say

__all__ = ["CASES", "FINE_STEP", "RESTITUTIONS", "SPEEDS", "rebound"]

SPEEDS = np.geomspace(0.05, 5.0, SIXTEEN)
RESTITUTIONS = (0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
FINE_STEP = 2e-8
"""A 300th of T3's contact time [s]."""
_CONTACT_TIME = 6.105e-6  # of T3's alumina sphere at 3.9 m/s [s]
_FINE_BAND, _OWN_BAND = 1e-3, 0.015
_PHASES, _LOW = 8, 0.2


def rebound(restitution: float, tensile: bool, step: float | None = None, *, phase: float = 0.0) -> np.ndarray:
    """Rebound over approach speed of an alumina sphere on the floor, at sixteen speeds, shape [16].

    ``step``: [s]; the bed's own when None. ``phase``: where in a step the contact begins, 0 to 1.
    """
    positions, radii, options = row_of_grains(tensile=tensile)
    stuff = Material("t3", friction=0.3, restitution=restitution, **ALUMINA)
    taken = time_step_for(stuff, diameter=2 * RADIUS, max_overlap=0.004, wanted=step)
    positions[:, 2] += phase * taken * SPEEDS
    bed = Bed.from_grains(
        stuff, positions=positions, radii=radii, velocities=np.outer(-SPEEDS, [0.0, 0.0, 1.0]), max_overlap=0.004,
        time_step=step, **options,
    )  # fmt: skip
    longest = _CONTACT_TIME * (3.9 / SPEEDS[0]) ** 0.2  # t_c goes with v^(-1/5)
    bed.advance(math.ceil((4 if restitution < 0.5 else 2) * longest / bed.time_step))
    grains = bed.grains()
    if not (grains.position[:, 2] > RADIUS).all() or np.abs(grains.velocity[:, :2]).max() > 0:
        raise RuntimeError("a grain has not left the floor, or left it sideways")
    return grains.velocity[:, 2] / SPEEDS


def _fine(tensile: bool, tell: Tell) -> Outcome:
    rows, curves = [], []
    for asked in told(RESTITUTIONS, tell):
        found = rebound(asked, tensile, FINE_STEP)
        about = f"worst of 16 speeds, {asked} asked for"
        rows.append(Comparison(about, "1", asked, worst(found, asked), _FINE_BAND, False))
        curves.append(Curve(f"{asked:g}", SPEEDS, found - asked))
    plot = Plot("Rebound less what was asked for", "speed [m/s]", "difference [1]", curves, log="x")
    return Outcome(rows, [plot])


def _own_step(tell: Tell) -> Outcome:
    """With the step that the bed takes by itself, wherever in a step the contact begins, and the scheme alone."""
    rows, curves, means, highest, lowest = [], [], [], 0.0, 0.0
    for done, asked in enumerate(RESTITUTIONS, 1):
        found = np.array([rebound(asked, False, phase=phase) for phase in np.arange(_PHASES) / _PHASES]) - asked
        about = f"worst of 16 speeds, 8 phases, {asked} asked for"
        rows.append(Comparison(about, "1", asked, asked + worst(found, 0.0), _OWN_BAND, False))
        curves.append(Curve(f"{asked:g}", np.tile(SPEEDS, _PHASES), found.ravel()))
        means.append(f"{found.mean():+.4f} at {asked:g}")
        highest, lowest = max(highest, found.max()), min(lowest, found.min())
        tell(0.5 * done / len(RESTITUTIONS))
    counts, phase = np.array([10, 14, 20, 40, 80, 160]), (np.arange(100) + 0.5) / 100
    schemes = {"half-step velocity": {"synchronised": False, "first_touch": False}, "as the bed has it": {}}
    errors = {label: np.empty((2, len(counts))) for label in schemes}
    for done, count in enumerate(counts):
        for label, options in schemes.items():
            off = staggered_rebound(_LOW, count, phase, **options) - _LOW
            errors[label][:, done] = abs(off.mean()), np.abs(off).max()
        tell(0.5 + 0.5 * (done + 1) / len(counts))
    old, new = errors.values()
    remarks = [
        say("own_step", lowest=lowest, highest=highest, means=", ".join(means)),
        say("scheme_alone", asked=_LOW, mean=new[0, 1], most=new[1, 1], old_mean=old[0, 1], old_most=old[1, 1]),
    ]
    own = "Rebound less what was asked for, the bed's own step"
    alone = f"The scheme alone, e = {_LOW:g}: largest error over the phases"
    lines = [Curve(label, counts, found[1]) for label, found in errors.items()]
    plots = [
        Plot(own, "speed [m/s]", "difference [1]", curves, "x"),
        Plot(alone, "steps in a contact", "error of the restitution [1]", lines, "xy"),
    ]
    return Outcome(rows, plots, remarks)


CASES = {
    "t3-restitution": partial(_fine, False),
    "restitution-tensile": partial(_fine, True),
    "restitution-own-step": _own_step,
}
