"""Made-up campaigns of tumbles with something hidden in them, for `hedgebed bench diagnose`.

Nothing here is shared with the code that diagnoses. The motions come from `hidden_tumble_motion`, the sensors are read
off them here. Every effect has another functional form than the library's where it can have one. What is hidden comes
back beside the campaign, not in it: `hidden_suite.write_suite` puts campaigns and answers into two folders.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from experiments.campaign import Campaign, Recording, TumbleCampaign
from experiments.runs.types import Json

from .penetration import correlated, draw_hidden

__all__ = ["EFFECTS", "OUTSIDE", "HiddenTumble", "make_hidden_tumble"]

Random = np.random.Generator
EFFECTS = (
    "wheel-vibration", "pendulum", "com-offset", "slope", "tip-radius", "rig-friction", "pulley-inertia", "torque-fade",
    "inertial-drag", "depth-hardening", "plastic-sinkage", "adhesion", "rate-friction", "umbilical", "bearing-drag",
    "clock-offset", "camera-scale",
)  # fmt: skip
OUTSIDE = ("floor-vibration", "magnet", "loose-mass", "shock", "unbalance", "wind")
_RIG = ("pendulum", "rig-friction", "pulley-inertia")
_STIFF, _GRAVEL, _SAND = (1.5e4, 60.0), (3e3, 25.0), (500.0, 8.0)  # K [N/m] and C [N s/m]
_SURFACES = {"steel": (*_STIFF, 0.25), "brick": (*_STIFF, 0.5), "gravel": (*_GRAVEL, 0.55), "sand": (*_SAND, 0.6)}
_PRIORS = ("mass", "inertia", "stiffness", "damping", "mu_s", "mu_d")
_GRAVITY = 9.80665
_Numbers = Mapping[str, float]
_Form = tuple[dict[str, float], dict[str, float], float, float]
_CHANNELS = ("x", "y", "theta", "gyro", "ax", "ay", "wheel")
_COARSE = 5e-5  # step while an amplitude is looked for [s]
_TRIES = 9  # of amplitudes
_DRIFT = 0.1  # of a clock that runs wrong as well: share of its offset that is added in a second [1/s]
_VIEW = 0.2  # from the middle of the camera's view, where its scale has changed by all of `scale_bend` [m]


@dataclass(frozen=True)
class HiddenTumble:
    """What is true of a campaign: no effect and nothing outside for a null."""

    effects: tuple[str, ...]
    outside: str | None
    parameters: dict[str, float]  # those with fixed names (docs/diagnose.md), "<effect>.<name>"
    settings: dict[str, float]  # all numbers of what is hidden, by `tumble_motion.COLUMNS`
    signature: float
    """Root mean square of what it changes in the channel that it changes most, over the noise, after the change that
    the uncertain numbers explain, to first order and within their uncertainties, is taken out."""
    coloured: bool
    trials: int
    true: dict[str, float] = field(default_factory=dict)  # the true values of the uncertain numbers

    @property
    def kind(self) -> str:
        """null, one effect's id, what is outside, or the ids of a pair with + between."""
        return self.outside or "+".join(self.effects) or "null"


@dataclass(frozen=True)
class _Plan:
    """What is done and believed."""

    stated: dict[str, float]
    sigma: dict[str, float]
    sigma_gravity: float
    surface: str
    rig: bool
    trials: tuple[Json, ...]
    duration: float
    std: dict[str, float]
    window: float
    rates: tuple[float, float, float]
    lead: float


def make_hidden_tumble(
    seed: int, *, kind: str | None = None, strength: float | None = None, trials: int | None = None
) -> tuple[Campaign, HiddenTumble]:
    """A campaign and what is hidden in it.

    `seed` fixes everything. `kind`: "null", an effect's id, "pair" or one of `OUTSIDE`; None draws one: a null in one
    of four, outside in one of six, a pair in one of twelve. `strength`: the signature aimed at, over the noise; None
    draws one from 0.5 (not to be seen) to 50 (plain). `trials`: how many; None draws 6 to 24. Raises ValueError for a
    kind there is not.
    """
    random = np.random.default_rng(seed)
    kind, strength, effects, outside = draw_hidden(random, kind, strength, EFFECTS, OUTSIDE, (0.5, 50.0))
    if kind not in ("null", "pair", *EFFECTS, *OUTSIDE):
        raise ValueError(f"kind = {kind!r}: null, pair, an effect or one of {', '.join(OUTSIDE)} was expected")
    plan = _plan(random, rig=bool(set(_RIG) & set(effects)), count=trials)
    true = {
        n: v * (1 + plan.sigma[n] * float(np.clip(random.standard_normal(), -2.5, 2.5))) for n, v in plan.stated.items()
    }
    true["mu_d"] = min(true["mu_d"], true["mu_s"])
    gravity = 1 + plan.sigma_gravity * np.clip(random.standard_normal(len(plan.trials)), -2.5, 2.5)
    forms = [_form(random, name, plan) for name in (*effects, *((outside,) if outside else ()))]
    settings: dict[str, float] = {}
    signature = 0.0
    if forms:
        seen = _Signature(plan, true, gravity)
        settings = _merged(forms, [_amplitude(seen, form, strength) for form in forms])
        signature = seen.of(settings)
    readings = _measure(plan, true, gravity, settings)
    coloured = bool(random.random() < 0.25)
    campaign = _record(random, plan, readings, coloured, _wires(np.random.default_rng((seed, 1)), plan, settings))
    told = HiddenTumble(
        effects, outside, _parameters(effects, settings), settings, signature, coloured, len(plan.trials),
        true | {f"gravity[{k + 1:03d}]": float(g) for k, g in enumerate(gravity)},
    )  # fmt: skip
    return campaign, told


def _plan(random: Random, *, rig: bool, count: int | None) -> _Plan:
    rig = rig or bool(random.random() < 0.8)
    surface = list(_SURFACES)[int(random.choice(4, p=(0.3, 0.35, 0.2, 0.15)))]
    stiffness, damping, mu = _SURFACES[surface]
    stated = {"mass": 5.3, "inertia": 0.06, "stiffness": stiffness, "damping": damping, "mu_s": mu, "mu_d": mu / 2}
    stated = {name: round(value * float(random.uniform(0.9, 1.1)), 4) for name, value in stated.items()}
    sigma = {"mass": 0.002, "inertia": 0.03, "stiffness": 0.1, "damping": 0.2, "mu_s": 0.05, "mu_d": 0.05}
    gravities = (
        (0.0834, 0.147) if rig else tuple(float(v) for v in random.choice((0.02, 0.05, 0.1, 0.15), 2, replace=False))
    )
    motors = [float(v) for v in random.choice((0.125, 0.16, 0.22, 0.3), 2, replace=False)]
    brakes = [float(v) for v in random.choice((2.0, 4.0, 6.0), 1)]
    spin = float(random.choice((200.0, 300.0, 450.0)))
    conditions = [(g, t, "motor", 0.0) for g in gravities for t in motors]
    conditions += [(g, t, "brake", spin) for g in gravities for t in brakes]
    drawn = int(random.choice((6, 8, 8, 8, 12, 16, 24)))
    count = count or drawn
    until = float(random.choice((10.0, 10.0, 0.8)))
    trials = [
        {"gravity_sim": g, "torque": torque, "actuator": actuator, "wheel_speed_0": speed, "torque_until": until,
         "counterweight": round(stated["mass"] * (_GRAVITY - g) / (_GRAVITY + g), 4) if rig else 0.0}
        for g, torque, actuator, speed in (conditions[k % len(conditions)] for k in range(count))
    ]  # fmt: skip
    noise = float(random.choice((0.7, 1.0, 1.5)))
    std = {"x": 5e-4, "y": 5e-4, "theta": 3e-3, "gyro": 0.01, "ax": 0.02, "ay": 0.02, "wheel": 0.5}
    return _Plan(
        stated, sigma, 0.02, surface, rig, tuple(trials), float(random.choice((1.5, 2.0, 2.5))),
        {name: round(value * noise, 6) for name, value in std.items()}, float(random.choice((0.004, 0.004, 0.0))),
        (120.0, 100.0, 600.0), 0.2,
    )  # fmt: skip


def _form(random: Random, name: str, plan: _Plan) -> _Form:
    """What grows with the amplitude (per unit), what does not, a typical amplitude, and the largest one."""
    weight = (plan.stated["mass"] + plan.trials[0]["counterweight"]) * plan.trials[0]["gravity_sim"]
    sinkage = 0.5 * weight / plan.stated["stiffness"]
    sign = float(random.choice((-1.0, 1.0)))
    pick = int(random.integers(3))
    turn = float(random.uniform(0, 2 * math.pi))
    if name == "wheel-vibration":
        speed = float(random.uniform(100, 300))
        return {"vibration_share": 1.0}, {"vibration_speed": speed, "vibration_power": 1.0 + pick % 2}, 0.1, 0.9
    if name == "torque-fade":
        key, usual, most = (("fade_speed", 2e-4, 0.01), ("fade_speed_square", 5e-4, 0.004), ("fade_time", 0.05, 2.0))[
            pick
        ]
        return {key: 1.0}, {}, usual, most
    if name == "inertial-drag":
        side = 0.3 if pick else 0.0
        return {"drag_normal": 1.0, "drag_side": side}, {"drag_power": 1.8}, 5.0, 400.0
    if name == "depth-hardening":
        return {"harden_bend": (-1.0 if pick == 2 else 1.0) / sinkage}, {}, 0.1, 4.0
    if name == "rate-friction":
        return {"rate_change": sign}, {"rate_speed": float(random.uniform(0.03, 0.2))}, 0.2, 0.8 if sign < 0 else 2.0
    if name == "umbilical":
        key = ("cable_spring", "cable_cubic", "cable_drag")[pick]
        return {key: 1.0}, {}, 0.01 * weight, 0.3 * weight
    table: dict[str, _Form] = {
        "pendulum": ({"wire_curvature": 1.0}, {}, 0.3, 1.5),
        "com-offset": ({"offset_x": math.cos(turn), "offset_y": math.sin(turn)}, {}, 3e-4, 5e-3 if plan.rig else 0.02),
        "slope": ({"slope": sign}, {}, 3e-3, 0.1),
        "tip-radius": ({"ball": 1.0}, {}, 4e-3, 0.03),
        "rig-friction": ({"rig_dry": 1.0, "rig_viscous": 0.4}, {}, 0.02 * weight, 0.4 * weight),
        "pulley-inertia": ({"pulley_mass": 1.0}, {}, 0.2, 5.0),
        "plastic-sinkage": ({"plastic": 1.0}, {}, 0.3, 0.9),
        "adhesion": ({"adhesion": 1.0}, {"adhesion_reach": 0.7 * sinkage}, 0.05 * weight, 2.0 * weight),
        "bearing-drag": ({"bearing_dry": 1.0}, {"bearing_stribeck": 0.2}, 0.01 * weight, 0.1 * weight),
        "clock-offset": ({"clock": sign, "clock_drift": _DRIFT * sign if pick == 2 else 0.0}, {}, 4e-3, 0.1),
        "camera-scale": ({"scale": sign, "scale_bend": 0.3 * sign if pick == 2 else 0.0}, {}, 0.01, 0.2),
        "floor-vibration": ({("floor_x", "floor_y")[pick % 2]: 1.0},
                            {"floor_rate": float(random.uniform(6, 20))}, 1e-5, 2e-3),
        "magnet": ({"magnet": weight}, {"magnet_x": float(random.uniform(0.03, 0.1))}, 0.1, 5.0),
        "loose-mass": ({"loose_mass": 1.0}, {"loose_rate": float(random.uniform(3, 9))}, 0.05, 0.8),
        "shock": ({"shock_x": 0.3, "shock_y": 0.3, "shock_turn": 0.05},
                  {"shock_time": float(random.uniform(0.3, 1.0))}, 0.03, 3.0),
        "unbalance": ({"unbalance": 1.0}, {}, 0.05, 2.0),
        "wind": ({"wind": sign * weight}, {"wind_from": float(random.uniform(0.1, 0.5)), "wind_to": 1.0}, 0.02, 0.5),
    }  # fmt: skip
    return table[name]


def _merged(forms: Sequence[_Form], amplitudes: Sequence[float]) -> dict[str, float]:
    settings: dict[str, float] = {}
    for (grows, stays, _, _), amplitude in zip(forms, amplitudes, strict=True):
        settings |= {name: value * amplitude for name, value in grows.items()} | stays
    return settings


class _Signature:
    """What a change leaves of itself: see `HiddenTumble.signature`."""

    def __init__(self, plan: _Plan, true: _Numbers, gravity: np.ndarray) -> None:
        self._plan, self._true, self._gravity = plan, true, gravity
        clean, step = _measure(plan, true, gravity, {}, _COARSE), 0.1
        self._base = self._stacked(clean)
        self._channel = np.repeat(
            *np.array([(k, len(one[name])) for one in clean for k, name in enumerate(_CHANNELS)]).T
        )

        def slope(true: _Numbers, gravity: np.ndarray) -> np.ndarray:
            return (self._stacked(_measure(plan, true, gravity, {}, _COARSE)) - self._base) / step

        rows = [slope({**true, name: true[name] * (1 + step * plan.sigma[name])}, gravity) for name in _PRIORS]
        by_gravity = slope(true, gravity * (1 + step * plan.sigma_gravity))
        edges = np.cumsum([0, *(sum(len(one[name]) for name in _CHANNELS) for one in clean)])
        for low, high in pairwise(edges):  # a trial's gravity changes that trial
            own = np.zeros(len(self._base))
            own[low:high] = by_gravity[low:high]
            rows.append(own)
        self._matrix = np.array(rows)
        self._normal = self._matrix @ self._matrix.T + np.eye(len(rows))

    def of(self, settings: _Numbers) -> float:
        """With these numbers of what is hidden."""
        made = _measure(self._plan, self._true, self._gravity, settings, _COARSE)
        change = self._stacked(made) - self._base
        rest = change - np.linalg.solve(self._normal, self._matrix @ change) @ self._matrix
        return max(float(np.sqrt(np.mean(rest[self._channel == k] ** 2))) for k in range(len(_CHANNELS)))

    def _stacked(self, readings: list[Any]) -> np.ndarray:
        return np.concatenate([one[name] / self._plan.std[name] for one in readings for name in _CHANNELS])


def _amplitude(seen: _Signature, form: Any, strength: float) -> float:
    """The amplitude whose signature comes nearest to `strength`.

    A signature may jump with the amplitude, where a trial takes another branch of sticking and slipping: then one side
    of the jump is as near as it gets.
    """
    _, _, amplitude, most = form
    below, above = 0.0, math.inf
    found: list[tuple[float, float]] = []
    for _ in range(_TRIES):
        signature = max(seen.of(_merged([form], [amplitude])), 1e-9)
        found.append((abs(math.log(signature / strength)), amplitude))
        if found[-1][0] < 0.2 or (amplitude == most and signature < strength):
            break
        below, above = (amplitude, above) if signature < strength else (below, amplitude)
        step = amplitude * float(np.clip(strength / signature, 0.05, 20.0))
        amplitude = step if below < step < above else math.sqrt(max(below, 1e-3 * above) * above)
        amplitude = min(amplitude, most)
    return min(found)[1]


def _parameters(effects: Sequence[str], settings: _Numbers) -> dict[str, float]:
    """Those that docs/diagnose.md names."""
    named = {
        "pendulum": {"pendulum.length": lambda s: 1 / s["wire_curvature"]},
        "com-offset": {"com-offset.x": lambda s: s["offset_x"], "com-offset.y": lambda s: s["offset_y"]},
        "slope": {"slope.angle": lambda s: s["slope"]},
        "tip-radius": {"tip-radius.radius": lambda s: s["ball"]},
        "pulley-inertia": {"pulley-inertia.mass": lambda s: s["pulley_mass"]},
        "rig-friction": {"rig-friction.force": lambda s: s["rig_dry"]},
        "bearing-drag": {"bearing-drag.torque": lambda s: s["bearing_dry"]},
        "clock-offset": {"clock-offset.offset": lambda s: s["clock"] + s.get("clock_drift", 0.0)},  # after a second
        "camera-scale": {"camera-scale.scale": lambda s: 1 + s["scale"]},
    }
    return {name: float(of(settings)) for effect in effects for name, of in named.get(effect, {}).items()}


def _measure(
    plan: _Plan, true: _Numbers, gravity: np.ndarray, settings: _Numbers, step: float | None = None
) -> list[dict[str, np.ndarray]]:
    """What the sensors read without noise, one table a trial: by channel, with `<sensor>_t` for the times."""
    from .tumble_motion import COLUMNS, STEP, move  # loads Taichi

    rows, pulls = [], []
    for trial, factor in zip(plan.trials, gravity, strict=True):
        g = trial["gravity_sim"] * float(factor)
        pulls.append(_GRAVITY if plan.rig else g)
        given = {**true, **trial, **settings, "length": 0.2, "gravity_sim": g, "gravity_at_mass": pulls[-1],
                 "wheel_inertia": 1.2e-3, "wheel_sign": 1.0 if trial["actuator"] == "motor" else -1.0}  # fmt: skip
        rows.append([given.get(name, 0.0) for name in COLUMNS])
    time, motions = move(np.array(rows), plan.duration + 0.15, step=step or STEP)
    return [_read(plan, time, motion, pull, settings) for motion, pull in zip(motions, pulls, strict=True)]


def _read(plan: _Plan, time: np.ndarray, motion: np.ndarray, pull: float, settings: _Numbers) -> dict[str, np.ndarray]:
    camera, imu, wheel = (
        np.arange(math.ceil(-plan.lead * rate), math.floor(plan.duration * rate) + 1) / rate for rate in plan.rates
    )
    true = imu - settings.get("clock", 0.0) - settings.get("clock_drift", 0.0) * imu
    lean = settings.get("slope", 0.0)
    x, y, theta, vx, vy, omega, spin = motion[:, :7].T
    dt = time[1] - time[0]
    before = np.arange(math.floor(-(plan.lead + 0.3) / dt), 0) * dt
    whole = np.concatenate([before, time])
    still = np.zeros(len(before))
    # Specific force in body axes at the middle of every row, summed so that a mean over a window is a difference.
    ax, ay = np.diff(np.concatenate([still, vx])) / dt, np.diff(np.concatenate([still, vy])) / dt
    angle = np.concatenate([still + theta[0], theta])
    angle = 0.5 * (angle[1:] + angle[:-1])
    ax, ay = ax + pull * math.sin(lean), ay + pull * math.cos(lean)
    body_x, body_y = ax * np.cos(angle) - ay * np.sin(angle), ax * np.sin(angle) + ay * np.cos(angle)
    window = max(plan.window, dt)
    found = {"camera_t": camera, "imu_t": imu, "wheel_t": wheel}
    for name, value in (("ax", body_x), ("ay", body_y)):
        summed = np.concatenate([[0.0], np.cumsum(value) * dt])
        late, early = (np.interp(true + half, whole, summed) for half in (window / 2, -window / 2))
        found[name] = (late - early) / window
    seen_x, seen_y = np.interp(camera, time, x), np.interp(camera, time, y)
    away = (seen_x**2 + (seen_y - y[0]) ** 2) / _VIEW**2
    scale = 1 + settings.get("scale", 0.0) + settings.get("scale_bend", 0.0) * away
    return found | {
        "x": scale * seen_x, "y": scale * seen_y, "theta": np.interp(camera, time, theta),
        "gyro": np.interp(true, whole, np.concatenate([still, omega])), "wheel": np.abs(np.interp(wheel, time, spin)),
    }  # fmt: skip


def _wires(random: Random, plan: _Plan, settings: _Numbers) -> float | None:
    """Length of the wires [m], stated in half of the rig's campaigns: that says nothing of a pendulum."""
    stated = bool(random.random() < 0.5)
    if not plan.rig or not stated:
        return None
    curvature = settings.get("wire_curvature", 0.0)
    length = (1 + 0.01 * random.standard_normal()) / curvature if curvature > 0 else random.uniform(1.5, 3.0)
    return round(float(length), 3)


def _record(
    random: Random, plan: _Plan, readings: list[dict[str, np.ndarray]], coloured: bool, wires: float | None
) -> Campaign:
    persistence = float(random.uniform(0.2, 0.6)) if coloured else 0.0

    def noisy(value: np.ndarray, std: float) -> np.ndarray:
        return value + std * correlated(random.standard_normal(len(value)), persistence)

    recordings = {}
    sensors = {
        "pose": ("camera_t", {"x_m": "x", "y_m": "y", "theta_rad": "theta"}),
        "imu": ("imu_t", {"gyro_rad_s": "gyro", "ax_m_s2": "ax", "ay_m_s2": "ay"}),
        "wheel": ("wheel_t", {"omega_rad_s": "wheel"}),
    }
    for number, one in enumerate(readings, 1):
        zero = {channel: float(random.uniform(-2.5, 2.5)) * plan.std[channel] for channel in ("x", "y", "theta")}
        taken = {channel: noisy(one[channel] + zero.get(channel, 0.0), plan.std[channel]) for channel in _CHANNELS}
        for sensor, (time, columns) in sensors.items():
            read = {"t_s": one[time]} | {label: taken[channel] for label, channel in columns.items()}
            recordings[f"{number:03d}", sensor] = Recording(read)
    return Campaign(_tables(plan, wires), recordings)


def _tables(plan: _Plan, wires: float | None) -> TumbleCampaign:
    stated, std = plan.stated, plan.std
    trials = []
    for number, trial in enumerate(plan.trials, 1):
        id = f"{number:03d}"
        told = {key: value for key, value in trial.items() if key != "counterweight" or plan.rig}
        trials.append({"id": id, **told, "pose": f"{id}-pose.csv", "imu": f"{id}-imu.csv", "wheel": f"{id}-wheel.csv"})
    tables: Json = {
        "format": "hedgehog-campaign/1", "kind": "tumble", "name": "made up",
        "platform": {"mass": stated["mass"], "inertia": stated["inertia"], "spike_length": 0.2},
        "wheel": {"inertia": 1.2e-3},
        "surface": {"kind": plan.surface, "granular": plan.surface in ("sand", "gravel"),
                    **{key: stated[key] for key in ("stiffness", "damping", "mu_s", "mu_d")}},
        "uncertainty": plan.sigma | {"gravity_sim": plan.sigma_gravity},
        "sensors": {"pose": {"std": (std["x"], std["y"], std["theta"])},
                    "imu": {"std": (std["gyro"], std["ax"], std["ay"]), "window": plan.window},
                    "wheel": {"std": (std["wheel"],)}},
        "trial": tuple(trials),
    }  # fmt: skip
    if plan.rig:
        tables["rig"] = {"counterweight": plan.trials[0]["counterweight"], "gravity": _GRAVITY}
        tables["rig"] |= {} if wires is None else {"wire_length": wires}
    return TumbleCampaign(**tables)
