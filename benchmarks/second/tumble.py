"""Campaigns of tumbles by the second simulator, with or without the rig: plain tables and columns, and the answer.

Nothing here comes from `rigid`, `coupling` or `experiments`. The sensors are in `sensing`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .drawing import Made, Numbers, Secret, at_strength, draw_case, draw_names, softness_for
from .forms import FREE, NAMED, OUTSIDE, RIG, Form, draw_form
from .motion import COLUMNS, move
from .sensing import SIGMA_GRAVITY, Plan, Readings, draw_conditions, draw_sensors, draw_true, read, record, weigh

__all__ = ["make_tumble", "secret_of"]

Random = np.random.Generator
_G = 9.80665
_LADDER = 9  # amplitudes that are tried
_SPAN = 1000.0  # from the least of them to the largest
_SURFACES = {"steel": (1.5e4, 60.0, 0.25), "brick": (1.5e4, 60.0, 0.5), "gravel": (3e3, 25.0, 0.55),
             "sand": (600.0, 10.0, 0.6)}  # fmt: skip
_STIFF = 1e6  # of friction springs that are as good as rigid [N/m]
_LEG_TIME = 2e-3  # damper over stiffness of a leg [s]
_STRUCTURES = np.geomspace(300.0, 3e6, 13)  # stiffnesses of a leg that are tried [N/m]
_NEAR = (0.75, 1.33)  # share of the structure asked for that will do
_REDRAWS = 9


def make_tumble(
    seed: int, *, rig: bool, kind: str | None = None, strength: float | None = None, trials: int | None = None,
    structure: float | None = None,
) -> tuple[Made, Secret]:  # fmt: skip
    """A campaign and what is hidden in it.

    `kind`: ``null``, ``pair``, an effect or one of `OUTSIDE`; None draws an effect. `strength`: the signature that is
    asked for. `structure`: how much compliant legs and friction springs change, root mean square over the noise; None
    draws it from 0.05 to 0.45. Raises ValueError for a kind that there is not.
    """
    random = np.random.default_rng((seed, 27 + rig))
    named = RIG if rig else FREE
    kind, strength, size = draw_case(random, kind, strength, structure, effects=named, outside=OUTSIDE)
    plan, reached = _with_structure(random, _draw_plan(random, rig, trials), size)
    for _ in range(_REDRAWS):  # on the edge between sticking and slipping a touch of structure changes all
        if _NEAR[0] < reached / size < _NEAR[1]:
            break
        other = _with_structure(random, _draw_plan(random, rig, trials), size)
        plan, reached = min((plan, reached), other, key=lambda pair: abs(math.log(max(pair[1], 1e-9) / size)))
    names = draw_names(random, kind, named)
    forms = [_form(random, plan, name) for name in names if kind != "null"]
    clean, weighing = weigh(plan, partial(_measure, plan))

    def signatures(ladder: list[Numbers]) -> list[float]:
        return [weighing.most(readings) for readings in _measure(plan, ladder)]

    chosen = [at_strength(form.at, signatures, strength, span=_SPAN, count=_LADDER) for form in forms]
    settings = {name: value for numbers, _ in chosen for name, value in numbers.items()}
    made = _measure(plan, [settings])[0] if chosen else clean
    secret = secret_of(
        plan, () if kind in ("null", *OUTSIDE) else names, chosen, settings, outside=kind if kind in OUTSIDE else None,
        structure=reached, legs=plan.legs,
    )  # fmt: skip
    return record(random, plan, made, title="second"), secret


def secret_of(
    plan: Plan, effects: tuple[str, ...], chosen: Sequence[tuple[Numbers, float]], settings: Numbers,
    *, outside: str | None, **more: Any,
) -> Secret:  # fmt: skip
    """What is hidden in tumbles. `chosen`: numbers and signature of each effect. `more`: of the maker."""
    each = [seen for _, seen in chosen]
    parameters = {key: float(of(settings)) for name in effects for key, of in NAMED.get(name, {}).items()}
    return Secret(
        effects, outside, parameters, min(each, default=0.0),
        any(noise.kind == "coloured" for noise in plan.noise.values()), len(plan.trials),
        {**more, "each": each, "settings": settings, "surface": plan.surface,
         "noise": {name: noise.kind for name, noise in plan.noise.items()}, "base": plan.true},
    )  # fmt: skip


def _draw_plan(random: Random, rig: bool, trials: int | None) -> Plan:
    surface = str(random.choice(list(_SURFACES)))
    k, c, mu = _SURFACES[surface]
    stated = {"mass": 5.3, "inertia": 0.06, "stiffness": k, "damping": c, "mu_s": mu, "mu_d": 0.5 * mu}
    stated = {name: round(value * float(random.uniform(0.9, 1.1)), 4) for name, value in stated.items()}
    true = draw_true(random, stated)
    conditions = draw_conditions(random, (0.0834, 0.147) if rig else None)
    count = trials or int(random.choice((6, 8, 8, 8, 12)))
    until = float(random.choice((10.0, 0.8)))
    own = tuple(
        {"gravity_sim": g, "torque": torque, "actuator": actuator, "wheel_speed_0": speed, "torque_until": until,
         "counterweight": round(stated["mass"] * (_G - g) / (_G + g), 4) if rig else 0.0}
        for g, torque, actuator, speed in (conditions[n % len(conditions)] for n in range(count))
    )  # fmt: skip
    loud = float(random.choice((0.7, 1.0, 1.5)))
    return Plan(
        rig, surface, stated, true, 1 + SIGMA_GRAVITY * np.clip(random.standard_normal(count), -2.5, 2.5), own,
        float(random.choice((1.5, 2.0))), *draw_sensors(random, loud),
    )  # fmt: skip


def _form(random: Random, plan: Plan, name: str) -> Form:
    weight = min((plan.true["mass"] + t["counterweight"]) * t["gravity_sim"] for t in plan.trials)
    moment = max(plan.true["mass"] * (_G if plan.rig else t["gravity_sim"]) for t in plan.trials)
    motors = [t for t in plan.trials if t["actuator"] == "motor"]
    spin = max(min(t["torque"] for t in motors) / 1.2e-3, 50.0)
    return draw_form(
        random, name, weight=weight, sinkage=0.5 * weight / plan.true["stiffness"],
        torque=min(t["torque"] for t in plan.trials), spin=spin, rig=plan.rig, moment=moment,
    )  # fmt: skip


def _with_structure(random: Random, plan: Plan, size: float) -> tuple[Plan, float]:
    """The plan with legs and friction springs that change the readings by `size` over the noise, and what they do."""
    softer = float(random.uniform(0.3, 1.0))  # a friction spring over a leg

    def legs(stiffness: float) -> Numbers:
        return {"leg_stiffness": stiffness, "leg_time": _LEG_TIME, "shear_stiffness": softer * stiffness,
                "shear_damping": 2e-3 * softer * stiffness}  # fmt: skip

    _, weighing = weigh(plan, partial(_measure, plan))
    soft_last = _STRUCTURES[::-1]
    sizes = [weighing.whole(readings) for readings in _measure(plan, [legs(k) for k in soft_last.tolist()])]
    plan = replace(plan, legs=legs(softness_for(size, soft_last, sizes, least=1e-4)))
    return plan, weighing.whole(_measure(plan, [{}])[0])


def _measure(plan: Plan, several: Sequence[Mapping[str, float]]) -> list[Readings]:
    """Readings without noise for each of several settings: all their trials move at once."""
    lanes, pulls = [], []
    for settings in several:
        for trial, factor in zip(plan.trials, plan.gravity_factor, strict=True):
            g = trial["gravity_sim"] * float(factor) * settings.get("gravity_factor", 1.0)
            pulls.append(_G if plan.rig else g)
            given = {"length": 0.2, "wheel_inertia": 1.2e-3, "shear_stiffness": _STIFF, "shear_damping": 1e-3 * _STIFF,
                     **plan.true, **trial, **plan.legs, **settings, "gravity_sim": g, "gravity_local": pulls[-1],
                     "wheel_sign": 1.0 if trial["actuator"] == "motor" else -1.0}  # fmt: skip
            lanes.append([float(given.get(name, 0.0)) for name in COLUMNS])
    time, motions = move(np.array(lanes), plan.duration + 0.2)
    seen = [read(plan, time, motion, pull, several[n // len(plan.trials)])
            for n, (motion, pull) in enumerate(zip(motions, pulls, strict=True))]  # fmt: skip
    return [seen[n : n + len(plan.trials)] for n in range(0, len(seen), len(plan.trials))]
