"""Campaigns of tumbles by the second simulator, with or without the rig: plain tables and columns, and the answer.

Nothing here comes from `rigid`, `coupling` or `experiments`. Camera, IMU and wheel have clocks and origins of their
own: the camera's scale is about its own origin on the surface, the IMU's first sample falls where its clock puts it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .drawing import Made, Numbers, Secret, Table, at_strength, draw_case, softness_for
from .forms import FREE, NAMED, OUTSIDE, RIG, Form, draw_form
from .motion import COLUMNS, move
from .noise import Noise, draw_noise

__all__ = ["CHANNELS", "make_tumble"]

Array = NDArray[np.float64]
Random = np.random.Generator
Readings = list[dict[str, Array]]
CHANNELS = ("x", "y", "theta", "gyro", "ax", "ay", "wheel")
_G = 9.80665
_LADDER = 9  # amplitudes that are tried
_SPAN = 1000.0  # from the least of them to the largest
_SURFACES = {"steel": (1.5e4, 60.0, 0.25), "brick": (1.5e4, 60.0, 0.5), "gravel": (3e3, 25.0, 0.55),
             "sand": (600.0, 10.0, 0.6)}  # fmt: skip
_SIGMA = {"mass": 0.002, "inertia": 0.03, "stiffness": 0.1, "damping": 0.2, "mu_s": 0.05, "mu_d": 0.05}
_SIGMA_GRAVITY = 0.02
_STIFF = 1e6  # of friction springs that are as good as rigid [N/m]
_LEG_TIME = 2e-3  # damper over stiffness of a leg [s]
_STRUCTURES = np.geomspace(300.0, 3e6, 13)  # stiffnesses of a leg that are tried [N/m]
_NEAR = (0.75, 1.33)  # share of the structure asked for that will do
_REDRAWS = 9
_RATES = {"camera": 120.0, "imu": 100.0, "wheel": 600.0}
_LEAD, _WINDOW = 0.2, 0.004


@dataclass(frozen=True)
class _Plan:
    """What is done and stated."""

    rig: bool
    surface: str
    stated: dict[str, float]
    true: dict[str, float]
    gravity_factor: Array  # of each trial
    trials: tuple[Table, ...]
    duration: float
    std: dict[str, float]
    noise: dict[str, Noise]
    phase: dict[str, float]  # of each sensor's first sample, in samples
    legs: dict[str, float] = field(default_factory=dict)


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
    names = tuple(str(e) for e in random.choice(named, 2, replace=False)) if kind == "pair" else (kind,)
    forms = [_form(random, plan, name) for name in names if kind != "null"]
    clean, weighing = _weighing(plan)

    def signatures(ladder: list[Numbers]) -> list[float]:
        return [weighing.most(readings) for readings in _measure(plan, ladder)]

    chosen = [at_strength(form.at, signatures, strength, span=_SPAN, count=_LADDER) for form in forms]
    settings = {name: value for numbers, _ in chosen for name, value in numbers.items()}
    made = _measure(plan, [settings])[0] if chosen else clean
    outside = kind if kind in OUTSIDE else None
    effects = () if kind == "null" or outside else names
    parameters = {key: float(of(settings)) for name in effects for key, of in NAMED.get(name, {}).items()}
    secret = Secret(
        effects, outside, parameters, min((seen for _, seen in chosen), default=0.0),
        any(noise.kind == "coloured" for noise in plan.noise.values()), len(plan.trials),
        {"structure": reached, "legs": plan.legs, "each": [seen for _, seen in chosen], "settings": settings,
         "surface": plan.surface, "noise": {name: noise.kind for name, noise in plan.noise.items()},
         "base": plan.true},
    )  # fmt: skip
    return _record(random, plan, made), secret


def _draw_plan(random: Random, rig: bool, trials: int | None) -> _Plan:
    surface = str(random.choice(list(_SURFACES)))
    k, c, mu = _SURFACES[surface]
    stated = {"mass": 5.3, "inertia": 0.06, "stiffness": k, "damping": c, "mu_s": mu, "mu_d": 0.5 * mu}
    stated = {name: round(value * float(random.uniform(0.9, 1.1)), 4) for name, value in stated.items()}
    true = {name: value * (1 + _SIGMA[name] * float(np.clip(random.standard_normal(), -2.5, 2.5)))
            for name, value in stated.items()}  # fmt: skip
    gravities = (0.0834, 0.147) if rig else tuple(random.choice((0.03, 0.06, 0.1, 0.15), 2, replace=False).tolist())
    motors = random.choice((0.125, 0.16, 0.22, 0.3), 2, replace=False).tolist()
    brake, spin = float(random.choice((2.0, 4.0, 6.0))), float(random.choice((200.0, 300.0, 400.0)))
    conditions = [(g, t, "motor", 0.0) for g in gravities for t in motors] + [
        (g, brake, "brake", spin) for g in gravities
    ]
    count = trials or int(random.choice((6, 8, 8, 8, 12)))
    until = float(random.choice((10.0, 0.8)))
    own = tuple(
        {"gravity_sim": g, "torque": torque, "actuator": actuator, "wheel_speed_0": speed, "torque_until": until,
         "counterweight": round(stated["mass"] * (_G - g) / (_G + g), 4) if rig else 0.0}
        for g, torque, actuator, speed in (conditions[n % len(conditions)] for n in range(count))
    )  # fmt: skip
    loud = float(random.choice((0.7, 1.0, 1.5)))
    std = {"x": 5e-4, "y": 5e-4, "theta": 3e-3, "gyro": 0.01, "ax": 0.02, "ay": 0.02, "wheel": 0.5}
    return _Plan(
        rig, surface, stated, true, 1 + _SIGMA_GRAVITY * np.clip(random.standard_normal(count), -2.5, 2.5), own,
        float(random.choice((1.5, 2.0))), {name: round(value * loud, 6) for name, value in std.items()},
        {name: draw_noise(random) for name in CHANNELS}, {name: float(random.random()) for name in _RATES},
    )  # fmt: skip


def _form(random: Random, plan: _Plan, name: str) -> Form:
    weight = min((plan.true["mass"] + t["counterweight"]) * t["gravity_sim"] for t in plan.trials)
    moment = max(plan.true["mass"] * (_G if plan.rig else t["gravity_sim"]) for t in plan.trials)
    motors = [t for t in plan.trials if t["actuator"] == "motor"]
    spin = max(min(t["torque"] for t in motors) / 1.2e-3, 50.0)
    return draw_form(
        random, name, weight=weight, sinkage=0.5 * weight / plan.true["stiffness"],
        torque=min(t["torque"] for t in plan.trials), spin=spin, rig=plan.rig, moment=moment,
    )  # fmt: skip


def _with_structure(random: Random, plan: _Plan, size: float) -> tuple[_Plan, float]:
    """The plan with legs and friction springs that change the readings by `size` over the noise, and what they do."""
    softer = float(random.uniform(0.3, 1.0))  # a friction spring over a leg

    def legs(stiffness: float) -> Numbers:
        return {"leg_stiffness": stiffness, "leg_time": _LEG_TIME, "shear_stiffness": softer * stiffness,
                "shear_damping": 2e-3 * softer * stiffness}  # fmt: skip

    _, weighing = _weighing(plan)
    soft_last = _STRUCTURES[::-1]
    sizes = [weighing.whole(readings) for readings in _measure(plan, [legs(k) for k in soft_last.tolist()])]
    plan = replace(plan, legs=legs(softness_for(size, soft_last, sizes, least=1e-4)))
    return plan, weighing.whole(_measure(plan, [{}])[0])


class _Weighing:
    """What a change of the readings leaves beside all that is uncertain, over the noise."""

    def __init__(self, plan: _Plan, clean: Readings, slopes: Sequence[Array], per_trial: Sequence[Array]) -> None:
        self._plan, self._base = plan, _stacked(plan, clean)
        lengths = [[len(one[name]) for name in CHANNELS] for one in clean]
        self._channel = np.concatenate([np.repeat(np.arange(len(CHANNELS)), own) for own in lengths])
        trial = np.repeat(np.arange(len(clean)), [sum(own) for own in lengths])
        rows = list(slopes) + [np.where(trial == n, slope, 0.0) for slope in per_trial for n in range(len(clean))]
        self._poses = [(trial == n) & (self._channel == k) for n in range(len(clean)) for k in range(3)]
        self._matrix = np.array(rows, dtype=float)
        self._normal = self._matrix @ self._matrix.T + np.eye(len(rows))

    def _left(self, readings: Readings) -> Array:
        change = _stacked(self._plan, readings) - self._base
        for pose in self._poses:  # the camera's zeros: within 3 std
            change[pose] -= np.clip(np.mean(change[pose]), -3.0, 3.0)
        return np.asarray(change - np.linalg.solve(self._normal, self._matrix @ change) @ self._matrix)

    def most(self, readings: Readings) -> float:
        """Root mean square in the channel with the largest."""
        rest = self._left(readings)
        return max(float(np.sqrt(np.mean(rest[self._channel == k] ** 2))) for k in range(len(CHANNELS)))

    def whole(self, readings: Readings) -> float:
        """Root mean square over all readings: chi-square a sample rises by its square."""
        return float(np.sqrt(np.mean(self._left(readings) ** 2)))


def _weighing(plan: _Plan) -> tuple[Readings, _Weighing]:
    """Readings with nothing hidden, and what weighs a change of them: slopes by half a standard deviation each."""
    half = 0.5
    nudged = [{name: plan.true[name] * (1 + half * sigma)} for name, sigma in _SIGMA.items()]
    clean, by_gravity, *rest = _measure(plan, [{}, {"gravity_factor": 1 + half * _SIGMA_GRAVITY}, *nudged])
    base = _stacked(plan, clean)
    slopes = [(_stacked(plan, one) - base) / half for one in rest]
    return clean, _Weighing(plan, clean, slopes, [(_stacked(plan, by_gravity) - base) / half])


def _stacked(plan: _Plan, readings: Readings) -> Array:
    return np.concatenate([one[name] / plan.std[name] for one in readings for name in CHANNELS])


def _measure(plan: _Plan, several: Sequence[Mapping[str, float]]) -> list[Readings]:
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
    read = [_read(plan, time, motion, pull, several[n // len(plan.trials)])
            for n, (motion, pull) in enumerate(zip(motions, pulls, strict=True))]  # fmt: skip
    return [read[n : n + len(plan.trials)] for n in range(0, len(read), len(plan.trials))]


def _read(plan: _Plan, time: Array, motion: Array, pull: float, settings: Mapping[str, float]) -> dict[str, Array]:
    """What camera, IMU and wheel read of one motion, each on its own clock; ``<sensor>_t`` [s] beside the channels."""
    stamps = {name: (np.arange(math.ceil(-_LEAD * rate), int(plan.duration * rate)) + plan.phase[name]) / rate
              for name, rate in _RATES.items()}  # fmt: skip
    true = stamps["imu"] - settings.get("clock", 0.0)  # when the IMU's sample was really taken
    x, y, theta, vx, vy, omega, wheel = motion[:, :7].T
    lean, scale = settings.get("slope", 0.0), 1.0 + settings.get("scale", 0.0)

    def at(times: Array, values: Array) -> Array:  # at rest before t = 0
        return np.interp(times, time, values)

    def before(values: Array) -> Array:
        return np.where(true < 0.0, 0.0, np.interp(true, time, values))

    late, early = true + 0.5 * _WINDOW, true - 0.5 * _WINDOW
    speeds = [np.concatenate([[0.0], values]) for values in (vx, vy)]
    whole = np.concatenate([[time[0] - 1e-9], time])
    ax, ay = ((np.interp(late, whole, v) - np.interp(early, whole, v)) / _WINDOW for v in speeds)
    ax, ay, turn = ax + pull * math.sin(lean), ay + pull * math.cos(lean), at(true, theta)
    camera, drift = stamps["camera"], settings.get("drift", 0.0)
    return {
        "camera_t": camera, "imu_t": stamps["imu"], "wheel_t": stamps["wheel"],
        "x": scale * at(camera, x), "y": scale * at(camera, y), "theta": at(camera, theta),
        "gyro": before(omega) + drift * np.maximum(true, 0.0) ** 2,
        "ax": ax * np.cos(turn) - ay * np.sin(turn), "ay": ax * np.sin(turn) + ay * np.cos(turn),
        "wheel": np.abs(at(stamps["wheel"], wheel)),
    }  # fmt: skip


def _record(random: Random, plan: _Plan, readings: Readings) -> Made:
    sensors = {
        "pose": ("camera_t", {"x_m": "x", "y_m": "y", "theta_rad": "theta"}),
        "imu": ("imu_t", {"gyro_rad_s": "gyro", "ax_m_s2": "ax", "ay_m_s2": "ay"}),
        "wheel": ("wheel_t", {"omega_rad_s": "wheel"}),
    }
    columns, trials, std = {}, [], plan.std
    for number, (trial, one) in enumerate(zip(plan.trials, readings, strict=True), 1):
        id = f"{number:03d}"
        zero = {name: float(random.uniform(-2.5, 2.5)) * std[name] for name in ("x", "y", "theta")}
        noisy = {name: plan.noise[name].on(one[name] + zero.get(name, 0.0), std[name], random) for name in CHANNELS}
        noisy["wheel"] = np.abs(noisy["wheel"])
        for sensor, (stamp, labels) in sensors.items():
            columns[id, sensor] = {"t_s": one[stamp]} | {label: noisy[name] for label, name in labels.items()}
        stated = {key: value for key, value in trial.items() if key != "counterweight" or plan.rig}
        trials.append(
            {"id": id, **stated, "pose": f"{id}-pose.csv", "imu": f"{id}-imu.csv", "wheel": f"{id}-wheel.csv"}
        )
    stated = plan.stated
    tables: Table = {
        "format": "hedgehog-campaign/1", "kind": "tumble", "name": "second",
        "platform": {"mass": stated["mass"], "inertia": stated["inertia"], "spike_length": 0.2},
        "wheel": {"inertia": 1.2e-3},
        "surface": {"kind": plan.surface, "granular": plan.surface in ("sand", "gravel"),
                    **{key: stated[key] for key in ("stiffness", "damping", "mu_s", "mu_d")}},
        "uncertainty": _SIGMA | {"gravity_sim": _SIGMA_GRAVITY},
        "sensors": {"pose": {"std": (std["x"], std["y"], std["theta"])},
                    "imu": {"std": (std["gyro"], std["ax"], std["ay"]), "window": _WINDOW},
                    "wheel": {"std": (std["wheel"],)}},
        "trial": tuple(trials),
    }  # fmt: skip
    if plan.rig:
        tables["rig"] = {"counterweight": plan.trials[0]["counterweight"], "gravity": _G}
    return Made(tables, columns)
