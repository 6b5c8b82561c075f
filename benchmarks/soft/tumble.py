"""Campaigns of tumbles in MuJoCo: plain tables and columns, and the answer.

The motion is MuJoCo's (`motion`). Sensors, clocks, noise and the weighing of a change are those of `benchmarks.second`.
Nothing here comes from `rigid` or `coupling`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

import benchmarks.second.motion as second
from benchmarks.second.campaigns import campaign_of
from benchmarks.second.drawing import Made, Numbers, Secret, draw_case, draw_names
from benchmarks.second.sensing import (
    SIGMA_GRAVITY,
    Plan,
    Readings,
    Weighing,
    draw_conditions,
    draw_sensors,
    draw_true,
    read,
    record,
    weigh,
)
from benchmarks.second.tumble import secret_of
from experiments.campaign import Campaign

from .forms import EFFECTS, OUTSIDE, SENSED, draw_form
from .motion import CONTACT, Contact, move

__all__ = ["EFFECTS", "OUTSIDE", "make", "make_soft"]

Random = np.random.Generator
_SURFACES = {"steel": (1.5e4, 4.0, 0.25), "brick": (1.5e4, 4.0, 0.5), "gravel": (3e3, 1.5, 0.55),
             "sand": (600.0, 0.6, 0.6)}  # fmt: skip
"""K [N/m], C [N s/m] and friction; C is small, because MuJoCo's damper acts on the way out too."""
_DURATION = 1.0  # of a trial; MuJoCo parts from the base model at later contacts [s]
_STRUCTURE, _DRAWS = 0.45, 10  # the most that a plan may part from the base model, and plans that are drawn for it
_SPAN = 1000.0  # from the least amplitude to the largest
_TRIES, _NEAR = 7, 1.1  # amplitudes that are tried, and a ratio of signatures that will do


def make(**case: Any) -> tuple[Campaign, Secret]:
    """The campaign of a case, and what is hidden in it."""
    made, secret = make_soft(**case)
    return campaign_of(made), secret


def make_soft(
    seed: int, *, kind: str | None = None, strength: float | None = None, trials: int | None = None,
    contact: Contact = CONTACT,
) -> tuple[Made, Secret]:  # fmt: skip
    """A campaign's tables and columns, and what is hidden in it.

    `kind`: ``null``, ``pair``, an effect or one of `OUTSIDE`; None draws an effect. `strength`: the signature that is
    asked for. Raises ValueError for a kind that there is not.
    """
    random = np.random.default_rng((seed, 51))
    kind, strength, _ = draw_case(random, kind, strength, None, effects=EFFECTS, outside=OUTSIDE)
    plan, bench, (clean, weighing), structure = _near(random, trials, contact)
    names = draw_names(random, kind, EFFECTS)
    forms = [_form(random, plan, name) for name in names if kind != "null"]
    chosen = [_at_strength(form, bench, weighing, strength) for form in forms]
    settings = {name: value for numbers, _ in chosen for name, value in numbers.items()}
    made = bench.measure([settings])[0] if chosen else clean
    secret = secret_of(
        plan, () if kind in ("null", *OUTSIDE) else names, chosen, settings, outside=kind if kind in OUTSIDE else None,
        structure=structure, mujoco=version("mujoco"),
    )  # fmt: skip
    return record(random, plan, made, title="soft"), secret


def _near(
    random: Random, trials: int | None, contact: Contact
) -> tuple[Plan, "_Bench", tuple[Readings, Weighing], float]:
    """A plan whose motions stay near the base model's, as `benchmarks.second` has its own; what weighs a change; the
    distance, root mean square over the noise after what the uncertain numbers and the camera's zeros explain is out.

    On the edge between one contact and another a touch of softness changes all that follows.
    """
    found = []
    for _ in range(_DRAWS):
        plan = _draw_plan(random, trials)
        bench = _Bench(plan, contact)
        weighing = weigh(plan, bench.measure)
        found.append((plan, bench, weighing, weighing[1].whole(_of_base_model(plan))))
        if found[-1][-1] <= _STRUCTURE:
            break
    return min(found, key=lambda one: one[-1])


def _of_base_model(plan: Plan) -> Readings:
    """Readings of the planar model without its structure, as the second simulator moves it."""
    lanes, pulls = [], []
    for trial, factor in zip(plan.trials, plan.gravity_factor, strict=True):
        pulls.append(trial["gravity_sim"] * float(factor))
        lanes.append({**plan.true, **trial, "gravity_sim": pulls[-1],
                      "wheel_sign": 1.0 if trial["actuator"] == "motor" else -1.0})  # fmt: skip
    time, motions = move_base_model(lanes, plan.duration + 0.2)
    return [read(plan, time, motion, pull, {}) for motion, pull in zip(motions, pulls, strict=True)]


def move_base_model(lanes: Sequence[Mapping[str, Any]], duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and the motions of the planar model by the second simulator, without its structure, of each lane."""
    rigid = {"length": 0.2, "wheel_inertia": 1.2e-3, "shear_stiffness": 1e6, "shear_damping": 1e3}
    given = [{**rigid, **lane, "gravity_local": lane["gravity_sim"]} for lane in lanes]
    return second.move(np.array([[float(one.get(name, 0.0)) for name in second.COLUMNS] for one in given]), duration)


class _Bench:
    """Readings without noise of a plan's trials; a motion that is known is not computed again."""

    def __init__(self, plan: Plan, contact: Contact) -> None:
        self._plan, self._contact, self._known = plan, contact, {}

    def measure(self, several: Sequence[Mapping[str, float]]) -> list[Readings]:
        """Readings for each of several settings."""
        return [[self._trial(n, settings) for n in range(len(self._plan.trials))] for settings in several]

    def _trial(self, number: int, settings: Mapping[str, float]) -> dict[str, np.ndarray]:
        plan, trial = self._plan, self._plan.trials[number]
        g = trial["gravity_sim"] * float(plan.gravity_factor[number]) * settings.get("gravity_factor", 1.0)
        moving = {name: value for name, value in settings.items() if name not in (*SENSED, "gravity_factor", "mu_d")}
        sign = 1.0 if trial["actuator"] == "motor" else -1.0
        given = {name: value for name, value in trial.items() if name != "actuator"}
        numbers = {**plan.true, **given, **moving, "gravity_sim": g, "wheel_sign": sign}
        key = (number, *sorted(numbers.items()))
        if key not in self._known:
            self._known[key] = move(numbers, plan.duration + 0.2, contact=self._contact)
        return read(plan, *self._known[key], g, settings)


def _at_strength(
    at: Callable[[float], Numbers], bench: _Bench, weighing: Weighing, strength: float
) -> tuple[Numbers, float]:
    """The numbers of an effect whose signature is near `strength`, and that signature; it grows with the amplitude."""
    amplitude, found = _SPAN**-0.5, []
    for _ in range(_TRIES):
        numbers = at(amplitude)
        seen = max(weighing.most(bench.measure([numbers])[0]), 1e-9)
        found.append((abs(math.log(seen / strength)), numbers, seen))
        if found[-1][0] < math.log(_NEAR):
            break
        amplitude = min(max(amplitude * min(max(strength / seen, 0.1), 10.0), 1.0 / _SPAN), 1.0)
    return min(found, key=lambda one: one[0])[1:]


def _draw_plan(random: Random, trials: int | None) -> Plan:
    surface = str(random.choice(list(_SURFACES)))
    k, c, mu = _SURFACES[surface]
    stated = {"mass": 5.3, "inertia": 0.06, "stiffness": k, "damping": c, "mu_s": mu}
    stated = {name: round(value * float(random.uniform(0.9, 1.1)), 4) for name, value in stated.items()}
    true = draw_true(random, stated)
    for own in (stated, true):  # MuJoCo has one coefficient of friction
        own["mu_d"] = own["mu_s"]
    conditions = draw_conditions(random)
    count = trials or 6
    until = float(random.choice((10.0, 0.8)))
    own_trials = tuple(
        {"gravity_sim": g, "torque": torque, "actuator": actuator, "wheel_speed_0": speed, "torque_until": until}
        for g, torque, actuator, speed in (conditions[n % len(conditions)] for n in range(count))
    )
    loud = float(random.choice((0.7, 1.0, 1.5)))
    return Plan(
        False, surface, stated, true, 1 + SIGMA_GRAVITY * np.clip(random.standard_normal(count), -2.5, 2.5),
        own_trials, _DURATION, *draw_sensors(random, loud),
    )  # fmt: skip


def _form(random: Random, plan: Plan, name: str) -> Callable[[float], Numbers]:
    weight = min(plan.true["mass"] * t["gravity_sim"] for t in plan.trials)
    motors = [t for t in plan.trials if t["actuator"] == "motor"]
    least = min(t["torque"] for t in motors)
    return draw_form(
        random, name, weight=weight, sinkage=0.5 * weight / plan.true["stiffness"], torque=least,
        spin=max(least / 1.2e-3, 50.0),
    )  # fmt: skip
