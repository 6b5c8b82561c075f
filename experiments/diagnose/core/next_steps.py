"""What to do next where something is missing that has no name: repeat the worst trial, or, where its replicates are
there already, ask what the missing force goes with.

Replicates answer by themselves what a repeated trial would: what is left of one and comes back in the others is in the
body or in what it stands on; what does not is each trial's own.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from experiments.diagnose.fit.localise import Place
from experiments.diagnose.fit.problem import Array, Form, Problem, Values
from experiments.diagnose.noise.replicates import groups_of

__all__ = ["after_unknown", "common_share"]

_SHARES = np.linspace(0.0, 1.0, 401)  # places along a trial at which replicates are compared
_COMMON, _IN_PART = 0.5, 0.25
"""Shares of what is left from which on it comes back, or does in part."""
_AS_BAD = 0.3  # share of the worst trial's misfit from which on one that has replicates is asked in its place
_MAINLY = 0.5  # share of it from which on a phase holds it
_GOES_WITH = 0.1  # share of the latent force that a column must explain to be followed up

_FOLLOW = {
    "t_s": "run the sensors as long as a trial with nothing moving: a sensor that drifts and a floor that shakes show "
           "there too",
    "depth_m": "go twice as deep once, and once in a bed prepared anew: what belongs to the depth stays at its depth",
    "velocity_m_s": "make the same trial at a third and at three times the speed: see whether it follows",
    "speed_m_s": "make one trial at a speed between those there are: see whether it follows",
    "retreat_m": "stop half-way on the way back for a second and go in again: see whether it comes back along the "
                 "same curve",
    "diameter_m": "make one trial with a diameter between those there are: see with which power it goes",
    "gravity_m_s2": "make one trial at a gravity between those there are: see whether it follows",
    "torque_N_m": "make one trial at a torque between those there are: see whether it follows",
    "x_m": "start one trial 50 mm to the side: what belongs to the place (a magnet, an edge, a wire) stays there",
    "y_m": "raise the surface, or the rig, by 20 mm in one trial: what belongs to the room stays where it was",
    "theta_rad": "start one trial from the next pair of spikes: what belongs to the body turns with it, what belongs "
                 "to the room does not",
    "vx_m_s": "make one trial at half the torque: see whether it follows the speed along the surface",
    "vy_m_s": "make one trial at half the torque: see whether it follows the speed upwards",
    "omega_rad_s": "make one trial at half the torque: see whether it follows the rate of rotation",
    "wheel_rad_s": "hold the platform and run the wheel up: what the wheel does shows in the accelerometers alone",
    "state": "make one trial at another torque: see whether it stays with the phase of the motion",
}  # fmt: skip
"""Column of latent.csv -> the trial that follows it up."""
_FOLLOW_PHASE = {
    "rest": "hold the spike there ten times as long, and come to the hold at a third of the speed: see whether the "
            "force comes back, and whether it goes with the speed before",
    "free": "run once without touching anything: what is there in the air is neither the bed's nor the tip's",
    "out": _FOLLOW["retreat_m"],
    "stand": "record it standing, the wheel at rest and then at speed: what is there without a motion is the sensors' "
             "or the room's",
    "hop": "let the platform turn in the air, held by the rig: what is there without a touch is not the surface's",
}  # fmt: skip
"""Phase of the motion in which most of it lies -> the same."""


def after_unknown(
    problem: Problem, values: Values, forms: Sequence[Form], worst: Sequence[Place], shares: Mapping[str, float],
    *, beside: Sequence[str] = (), is_scatter: bool = False,
) -> str:  # fmt: skip
    """The next experiment, a sentence or two. `worst`: where the model that was found fails; `shares`: what the latent
    force goes with (`localise.depends_on`); `beside`: names that the model has already; `is_scatter`: what replicates
    differ by is all that the model leaves."""
    sums: dict[str, float] = {}
    for place in worst:
        sums[place.trial] = sums.get(place.trial, 0.0) + place.excess
    known = {trial.id: trial for trial in problem.trials}
    trial = max(sums, key=lambda name: sums[name]) if sums else problem.trials[0].id
    groups = groups_of(problem.trials)
    repeated = [id for id in sums if len(groups[known[id].condition]) > 1 and sums[id] > _AS_BAD * sums[trial]]
    trial = max(repeated, key=lambda name: sums[name]) if repeated else trial
    alike = [id for id in groups[known[trial].condition] if id != trial]
    if not alike:
        which = f"trial {trial}, the one with the largest gap," if sums else f"trial {trial}"
        return (
            f"Repeat {which} twice without changing anything: what comes back is in {problem.whole} or in how a sensor "
            f"follows them, what does not is in the room. And {_follow(worst, shares)}."
        )
    share = common_share(problem, values, forms, (trial, *alike))
    others = f"{alike[0]} to {alike[-1]}" if len(alike) > 3 else " and ".join(alike)
    part = "nothing" if share < 0.005 else f"{100 * share:.0f} %"
    measured = f"of what is left of trial {trial}, {part} comes back in its replicates ({others})"
    if is_scatter:
        return (
            f"More replicates, each prepared anew in the same way, its zeros taken each time: {measured}, and the "
            f"model comes as near to a trial as another trial of the same condition does. Only trials that repeat "
            f"better can show more."
        )
    # What comes back at the same time in every trial is no sensor's drift: time stands for where the spike is.
    follow = _follow(worst, {name: part for name, part in shares.items() if name != "t_s" or share < _IN_PART})
    if share >= _COMMON:
        return (
            f"It repeats: {measured}, so that it is in {problem.whole}, or in a sensor that misreads them alike each "
            f"time (one that lags, say). To find what it is, {follow}."
        )
    if share >= _IN_PART:
        return f"It repeats in part: {measured}. Of that part, {follow}; for the rest, see what differs between them."
    alone = (
        "Write down what changes between them (the preparation, the time since then, who moves what, what else runs in "
        f"the room) and hold that still once; and {_FOLLOW['t_s']}."
    )
    if not beside:
        return f"It does not repeat: {measured}, so that it differs from trial to trial. {alone}"
    names = " and ".join(beside)
    return (
        f"What is left beside {names} does not repeat: {measured}, so that it is each trial's own and no second effect "
        f"of {problem.whole}; {names} is what these trials have in common. To see more, make them more alike. {alone}"
    )


def _follow(worst: Sequence[Place], shares: Mapping[str, float]) -> str:
    phases: dict[str, float] = {}
    for place in worst:
        phases[place.phase] = phases.get(place.phase, 0.0) + place.excess
    for phase, excess in phases.items():
        if phase in _FOLLOW_PHASE and excess > _MAINLY * sum(phases.values()):
            return f"since most of it is in phase {phase}, {_FOLLOW_PHASE[phase]}"
    ranked = sorted(((share, name) for name, share in shares.items() if name in _FOLLOW), reverse=True)
    if not ranked or ranked[0][0] < _GOES_WITH:
        return (
            "look for it with another sensor (a second camera, an accelerometer on the floor): nothing that was "
            "recorded goes with it"
        )
    return _FOLLOW[ranked[0][1]]


def common_share(problem: Problem, values: Values, forms: Sequence[Form], trials: Sequence[str]) -> float:
    """Share of what a model leaves of replicates, beyond the sensors, that all of them have in common (0 to 1).

    Residuals over the noise, channel by channel at the same shares of the trials' time; the mean of the products of two
    different trials over the mean of the squares.
    """
    curves: dict[str, list[Array]] = {}
    for trial in trials:
        samples = problem.samples(trial)
        for name, shown in problem.compare(values, forms, trial).items():
            std = samples.std[samples.channel == name]
            rest = (shown["measured"] - shown["model"]) / std if len(std) == len(shown["t_s"]) else np.zeros(0)
            good = np.isfinite(rest)
            if good.sum() > 1:
                time = shown["t_s"][good]
                span = max(float(np.ptp(time)), 1e-300)
                curves.setdefault(name, []).append(np.interp(_SHARES, (time - time[0]) / span, rest[good]))
    both = whole = 0.0
    for own in curves.values():
        if len(own) < 2:
            continue
        together = np.stack(own)
        count = len(own)
        total = float((together**2).sum(axis=0).mean())
        products = float((together.sum(axis=0) ** 2).mean()) - total  # of every pair twice
        both += products / (count - 1)
        whole += max(total - count, 0.0)
    share = both / whole if whole > 0 else 0.0
    return min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
