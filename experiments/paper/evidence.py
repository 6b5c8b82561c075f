"""The paper's text as measured data: what the model omits on hard ground, weighed against its rivals.

Eight statements of the text are about the twelve experiments on steel and brick. Each has a probability. The model's
angles are taken to be off by `ERROR` (one standard deviation, the paper's own measure of agreement). One reading in
twenty is taken to be wrong (`WRONG`), independently:

1. of the eight low-torque experiments more than half start within 5 degrees of 22.5, and at most one exceeds that: one
   of the sixteen on all four surfaces does, on hard ground as likely as on grains;
2. the four brakes exceed it;
3. the largest angle on steel at the first gravity is within 5 degrees of 60;
4. under the brake the first slip is at theta = 0, on both surfaces, the first gravity;
5. five of the six experiments there end in a hop;
6. steel at the least torque pivots first;
7. mu_s is what it states for each surface, within its band of 10 %;
8. mu_d is half of mu_s, likewise.

The last two are what the paper put into its simulation. The platform's friction may have been another, so that every
rival is weighed without them too (`apart`).

A rival is one change of the model with one number, at a few values that are as likely as one another. Its evidence is
the mean of its likelihoods: a number that has to be just right pays for that.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from experiments.platform.surfaces import find_surface
from experiments.runs.types import Json
from rigid.model.trial import Effect, Trial

from .claims import AGREEMENT, STATED_ANGLE, first_lasting
from .settings import PaperSettings
from .transitions import HARD, say

__all__ = ["BRAKE_DURATION", "DURATION", "ERROR", "RIVALS", "WRONG", "evidence", "nats", "rival_trials"]

ERROR = 5.0
"""Standard deviation of an angle of the model about a measured one [degrees]."""
WRONG = 0.05
"""Share of readings that say nothing [1]."""
DURATION, BRAKE_DURATION = 4.0, 0.3
"""How long a rival's trials last [s]: until each has come 10 mm, and those of Figure 6 have hopped."""
BAND = 0.1
"""The paper's band on its frictions [1]."""
LARGEST = 60.0
"""The largest angle of Figure 5 [degrees]."""

Change = Callable[[Trial, float], Trial]
Place = tuple[str, float, float]


def _effect(id: str, parameter: str) -> Change:
    def change(trial: Trial, value: float) -> Trial:
        return replace(trial, effects=(Effect(id=id, parameters={parameter: value}),))

    return change


def _times(key: str) -> Change:
    def change(trial: Trial, value: float) -> Trial:
        return replace(trial, **{key: value * getattr(trial, key)})

    return change


def _friction(trial: Trial, value: float) -> Trial:
    return replace(trial, mu_s=value * trial.mu_s, mu_d=value * trial.sliding_friction)


@dataclass(frozen=True)
class Rival:
    """One change of the model, with the values of its one number."""

    id: str
    values: tuple[float, ...]
    change: Change
    brakes: bool = True  # Whether it changes the trials with a brake too


RIVALS = (
    Rival("torque-rise", (0.02, 0.05, 0.1, 0.2, 0.25, 0.3, 0.5), _effect("torque-rise", "rise"), brakes=False),
    Rival("pivot-start", (1e-3,), lambda trial, value: trial),
    Rival("sliding-friction", (0.6, 0.8, 1.0), lambda trial, value: replace(trial, mu_d=value * trial.mu_s)),
    Rival("friction", (0.9, 1.1, 1.5), _friction),
    Rival("wheel-vibration", (0.1, 0.3, 0.6), _effect("wheel-vibration", "reduction")),
    Rival("pendulum", (2.2,), _effect("pendulum", "length")),
    Rival("com-offset", (-5e-4, 5e-4), _effect("com-offset", "x")),
    Rival("tip-radius", (0.006,), _effect("tip-radius", "radius")),
    Rival("inertia", (0.5, 2.0), _times("inertia")),
    Rival("stiffness", (0.1, 10.0), _times("stiffness")),
)
"""Three kinds of explanation: suspicions of the paper (a wheel that shakes, the pendulum, a centre of mass off the
shaft, ball tips); numbers that it does not give; and a torque and a start other than a step on a platform at rest."""


def rival_trials(trial: Trial) -> Iterator[tuple[str, Trial, Mapping[str, Any]]]:
    """What stands in for one trial on hard ground: name, trial, and which rival with which value it is."""
    for rival in RIVALS:
        if trial.actuator == "brake" and not rival.brakes:
            continue
        for value in rival.values:
            varied = {"rival": rival.id, "value": value}
            yield f"{rival.id} {value:g}", rival.change(trial, value), varied


def evidence(settings: PaperSettings, cases: Sequence[Json]) -> Json:
    """What each rival has for it, the step first and the others by their evidence; {} where they are not weighed."""
    if not settings.weighs:
        return {}
    places = list(product(HARD, settings.rigs, (*settings.motor_torques, *settings.brake_torques)))
    nominal = {_place(case): case for case in cases if case["variant"] == "nominal"}
    found: dict[tuple[str, float], dict[Place, Json]] = {}
    for case in cases:
        if case["kind"] == "rivals":
            found.setdefault((case["varied"]["rival"], case["varied"]["value"]), {})[_place(case)] = case
    step = _told(settings, None, {place: nominal[place] for place in places})
    rows = [_row("step", [step])]
    for rival in RIVALS:
        told = [
            _told(settings, value, {place: found[rival.id, value].get(place, nominal[place]) for place in places})
            for value in rival.values
        ]
        rows.append(_row(rival.id, told))
    rows[1:] = sorted(rows[1:], key=lambda row: -row["nats"])
    return {"error": ERROR, "wrong": WRONG, "rivals": rows}


def _row(id: str, told: list[Json]) -> Json:
    """A rival over all of its values."""
    best = max(told, key=lambda entry: float(entry["nats"]))
    return {
        "id": id, "words": say(f"rivals_{id}"), "nats": _mean([entry["nats"] for entry in told]),
        "apart": _mean([entry["nats"] - entry["parts"]["mu_s"] - entry["parts"]["mu_d"] for entry in told]),
        "best": best, "values": told,
    }  # fmt: skip


def _place(case: Mapping[str, Any]) -> Place:
    return case["surface"], case["rig"], case["torque"]


def _mean(values: Sequence[float]) -> float:
    """ln of the mean of what these are the logarithms of."""
    top = max(values)
    return top + math.log(sum(math.exp(value - top) for value in values) / len(values))


def _told(settings: PaperSettings, value: float | None, cases: Mapping[Place, Json]) -> Json:
    """One value of a rival: its likelihood, and the numbers that it hangs on."""
    rig, least = settings.rigs[0], min(settings.motor_torques)
    angles = {place: _degrees(case["trajectory_angle"]) for place, case in cases.items()}
    low = [angle for place, angle in angles.items() if place[2] in settings.motor_torques]
    high = [angle for place, angle in angles.items() if place[2] in settings.brake_torques]
    first = {place: case for place, case in cases.items() if place[1] == rig}
    hops = [case["transition_angle_hop"] is not None for case in first.values()]
    at_once = [
        case["transition_angle_slip"] is not None and math.degrees(case["transition_angle_slip"]) <= AGREEMENT
        for place, case in first.items()
        if place[2] in settings.brake_torques
    ]
    pivots = first_lasting(cases["steel", rig, least]) == "pivot"
    largest = max((angle for place, angle in angles.items() if place[:2] == ("steel", rig) and angle is not None))
    stated = {place: find_surface(place[0]).mu_s for place in cases}
    parts = nats(
        low=low, brakes=high, largest=largest, at_once=at_once, hops=hops, pivots=pivots,
        mu_s=all(_near(case["friction"][0], stated[place]) for place, case in cases.items()),
        mu_d=all(_near(case["friction"][1], 0.5 * case["friction"][0]) for case in cases.values()),
    )  # fmt: skip
    return {
        "value": value, "nats": sum(parts.values()), "parts": parts,
        "near": sum(angle is not None and abs(angle - STATED_ANGLE) <= AGREEMENT for angle in low),
        "above": sum(angle is not None and angle > STATED_ANGLE + AGREEMENT for angle in low),
        "low_torque_angles": low, "largest": largest, "hops": sum(hops), "pivots": pivots,
    }  # fmt: skip


def _degrees(value: float | None) -> float | None:
    return None if value is None else math.degrees(value)


def nats(
    *,
    low: Sequence[float | None],
    brakes: Sequence[float | None],
    largest: float,
    at_once: Sequence[bool],
    hops: Sequence[bool],
    pivots: bool,
    mu_s: bool,
    mu_d: bool,
) -> dict[str, float]:
    """ln of the probability of each statement, for the angles [degrees] and states of the model.

    None among the angles: it never gets 10 mm away, which is neither near 22.5 degrees nor beyond.
    """
    above = [_beyond(angle, STATED_ANGLE + AGREEMENT) for angle in low]
    near = [_within(angle, STATED_ANGLE) for angle in low]
    # Of how many are above and how many near: counts -> probability, an experiment after the other.
    counts = {(0, 0): 1.0}
    for a, n in zip(above, near, strict=True):
        then: dict[tuple[int, int], float] = {}
        for (i, j), p in counts.items():
            for key, share in (((i + 1, j), a), ((i, j + 1), n), ((i, j), max(1.0 - a - n, 0.0))):
                then[key] = then.get(key, 0.0) + share * p
        counts = then
    most = sum(0.5 * p for (i, j), p in counts.items() if i <= 1 and 2 * j > len(low))
    hopped = [1.0]
    for hop in hops:
        p = _yes(hop)
        hopped = [
            (hopped[k] * (1 - p) if k < len(hopped) else 0.0) + (hopped[k - 1] * p if k else 0.0)
            for k in range(len(hopped) + 1)
        ]
    return {
        "low torque": math.log(most),
        "brakes": sum(math.log(_beyond(angle, STATED_ANGLE + AGREEMENT)) for angle in brakes),
        "largest": math.log(_within(largest, LARGEST)),
        "at once": sum(math.log(_yes(slips)) for slips in at_once),
        "hops": math.log(hopped[max(len(hops) - 1, 0)]),
        "pivots": math.log(_yes(pivots)),
        "mu_s": math.log(_yes(mu_s)),
        "mu_d": math.log(_yes(mu_d)),
    }


def _near(value: float, stated: float) -> bool:
    """Whether a friction is within the paper's band of what is stated."""
    return abs(value / stated - 1) <= BAND + 1e-9


def _yes(holds: bool) -> float:
    """Probability that a thing is read to be so."""
    return 1 - WRONG if holds else WRONG


def _below(angle: float, bound: float) -> float:
    return 0.5 * math.erfc((angle - bound) / (ERROR * math.sqrt(2.0)))


def _within(angle: float | None, middle: float) -> float:
    """Probability that an angle is read within `AGREEMENT` of `middle`; a wrong reading is there one time in three."""
    if angle is None:
        return WRONG / 3
    inside = _below(angle, middle + AGREEMENT) - _below(angle, middle - AGREEMENT)
    return (1 - WRONG) * inside + WRONG / 3


def _beyond(angle: float | None, bound: float) -> float:
    """Probability that an angle is read above `bound`; a wrong reading is there one time in three."""
    return WRONG / 3 if angle is None else (1 - WRONG) * (1 - _below(angle, bound)) + WRONG / 3
