"""Made-up campaigns of penetration with something hidden in them, for `hedgebed bench diagnose`.

Nothing here is shared with the code that diagnoses: the motions come from a leapfrog of very small steps, and every
effect has another functional form than the library's. What is hidden comes back beside the campaign, not in it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, Recording
from experiments.runs.types import Json

__all__ = ["EFFECTS", "OUTSIDE", "Hidden", "correlated", "draw_hidden", "draw_kind", "make_hidden", "tables_of"]

Random = np.random.Generator
Names = Sequence[str]
EFFECTS = ("inertial-drag", "depth-hardening", "plastic-sinkage", "adhesion", "shaft-friction", "layering")
OUTSIDE = ("floor-vibration", "loose-mass", "shock", "load-cell-drift", "sloshing")
_STEP = 5e-6
_COLOURED_DEPTH = 0.25  # share of the campaigns whose depth sensor's noise is correlated from row to row

_Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Hidden:
    """What is true of a campaign: nothing for a null."""

    effects: tuple[str, ...]
    outside: str | None
    parameters: dict[str, float]
    signature: float  # root mean square of what the effect changes, after K and C are fitted to it, over the noise
    coloured: bool  # whether the noise of force and acceleration is correlated from row to row
    trials: int = 0
    depth_persistence: float = 0.0  # correlation of the depth's noise from row to row: 0 for white noise
    extra: Json = field(default_factory=dict)


class _Law:
    """The bed's force, with its memory; one object a trial."""

    def __init__(self, k: float, c: float, size: float, settings: dict[str, float]) -> None:
        self.k, self.c, self.size, self.s = k, c, size, settings
        self.top = 0.0

    def __call__(self, z: float, v: float, t: float, way: float) -> float:
        s, force = self.s, 0.0
        ground = s.get("vibration", 0.0) * math.sin(s.get("vibration_rate", 1.0) * t + s.get("vibration_phase", 0.0))
        z = z - ground
        if z > 0.0:
            self.top = max(self.top, z)
            force = self.spring(z)
            if s.get("plastic", 0.0) > 0.0 and z < self.top:
                left = s["plastic"] * self.top
                share = (z - left) / (self.top - left)
                force = self.spring(self.top) * max(share, 0.0) ** s["plastic_bend"]
            force += self.c * max(v, 0.0)
            if "drag" in s:
                force += s["drag"] * self.size**2 * max(v, 0.0) ** 2 * z / (z + s["drag_onset"])
            if "shaft" in s:
                stribeck = 1.0 + 0.3 * math.exp(-abs(v) / s["shaft_speed"])
                force += self.size * s["shaft"] * (0.4 + 0.6 * z / s["depth"]) * stribeck * way
            if "pull" in s and z < self.top:
                back = (self.top - z) / s["pull_reach"]
                force -= s["pull"] * self.size**2 * math.sqrt(self.top / s["depth"]) * math.tanh(back)
        if "slosh" in s:
            force += s["slosh"] * math.sin(s["slosh_rate"] * t) * math.exp(-t / s["slosh_time"])
        return force

    def spring(self, z: float) -> float:
        """Loading curve."""
        s, force = self.s, self.k * z
        if "hardening" in s:
            x = z / s["depth"]
            steep = s["hardening"] * x + 1e-9
            force *= 1.0 + s["hardening"] * x * x / (0.3 + x) if s["hardening_kind"] < 0.5 else math.sinh(steep) / steep
        if "layer" in s:
            z1, w = s["layer_depth"], s["layer_width"]
            if s["layer_kind"] < 0.5:  # another stiffness below
                inside = w * math.log1p(math.exp(min((z - z1) / w, 500.0))) if (z - z1) / w < 500 else z - z1
                force += s["layer"] * self.k * inside
            else:  # a crust that is punched
                force += s["layer"] * self.k * s["depth"] * 0.5 * (1.0 + math.tanh((z - z1) / w))
        return force


def make_hidden(
    seed: int, *, kind: str | None = None, strength: float | None = None, trials: int | None = None
) -> tuple[Campaign, Hidden]:
    """A campaign and what is hidden in it.

    `kind`: None draws one: a null (one in four), an effect, a pair, or what no library has (one in six). Else it is
    ``null``, an effect's id, ``pair`` or one of `OUTSIDE`. `strength`: the signature aimed at, over the noise.
    `trials`: how many; None draws 6 to 24.
    """
    random = np.random.default_rng(seed)
    kind, strength, effects, outside = draw_hidden(random, kind, strength, EFFECTS, OUTSIDE, (0.4, 40.0))
    plan = _plan(
        random, retreat=bool({"plastic-sinkage", "adhesion", "shaft-friction"} & set(effects)),
        drops=outside in ("loose-mass",), faster=bool({"inertial-drag"} & set(effects)), wanted=trials,
    )  # fmt: skip
    coloured = random.random() < 0.3
    clean = [_trial(plan, k, {}) for k in range(len(plan["trials"]))]
    made, measure = clean, 0.0
    settings: dict[str, float] = {}
    if kind != "null":
        shape = _shape(random, plan, effects, outside)
        low, high = math.log(1e-4), math.log(30.0)
        few = {k: clean[k] for k in range(0, len(clean), max(1, len(clean) // 4))}
        for _ in range(9):  # amplitude by halving: the signature grows with it
            amplitude = math.exp(0.5 * (low + high))
            settings = shape(amplitude)
            measure = _signature(plan, few, [_trial(plan, k, settings) for k in few])
            low, high = (math.log(amplitude), high) if measure < strength else (low, math.log(amplitude))
        made = [_trial(plan, k, settings) for k in range(len(clean))]
        measure = _signature(plan, dict(enumerate(clean)), made)
    # Drawn apart, so that a seed goes on making the same campaign but for this.
    apart = np.random.default_rng((seed, 1))
    persistence = float(apart.uniform(0.3, 0.8)) if apart.random() < _COLOURED_DEPTH else 0.0
    campaign = _record(random, plan, made, coloured, persistence)
    return campaign, Hidden(effects, outside, settings, measure, coloured, len(clean), persistence)


def draw_kind(random: Random, effects: Names, outside: Names, *, nulls: float = 0.25) -> str:
    """Nothing in a share `nulls`, something outside the library in 17 %, a pair in 8 %, else an effect."""
    draw = random.random()
    if draw < nulls:
        return "null"
    if draw < nulls + 0.17:
        return str(random.choice(outside))
    return "pair" if draw < nulls + 0.25 else str(random.choice(effects))


def draw_hidden(
    random: Random, kind: str | None, strength: float | None, effects: Names, outside: Names, between: Sequence[float]
) -> tuple[str, float, tuple[str, ...], str | None]:
    """Kind, strength, the effects and what is outside: as given, or drawn; strengths evenly in their logarithm."""
    kind = kind or draw_kind(random, effects, outside)
    low, high = (math.log(end) for end in between)
    strength = strength if strength is not None else float(np.exp(random.uniform(low, high)))
    own = (kind,) if kind in effects else ()
    if kind == "pair":
        own = tuple(str(e) for e in random.choice(effects, 2, replace=False))
    return kind, strength, own, kind if kind in outside else None


def _plan(random: Random, *, retreat: bool, drops: bool, faster: bool, wanted: int | None) -> Json:
    """What is done: trials, the true K, C, what is believed of them, noise."""
    k, mass = float(np.exp(random.uniform(math.log(300), math.log(4000)))), float(random.uniform(0.2, 1.0))
    c = float(random.uniform(0.05, 0.3)) * 2 * math.sqrt(k * mass)
    several = random.random() < 0.25  # diameters: one K and C each, of which little is known
    free = several or random.random() < 0.2
    doubt_k, doubt_c = (2.0, 2.0) if free else (0.1, 0.2)
    believed_k = k / (1 + (0.1 * random.standard_normal())) if not free else k * float(np.exp(random.normal(0, 0.5)))
    believed_c = c / max(1 + 0.2 * random.standard_normal(), 0.3)
    style = random.choice(["driven", "drop", "both"])
    style = "both" if drops or (faster and style == "driven") else style
    returns = retreat or random.random() < 0.6
    depth = float(random.uniform(0.012, 0.03))
    drawn = int(random.choice([6, 8, 8, 10, 12, 16, 24]))
    count = wanted or drawn
    speeds = np.exp(np.sort(random.uniform(math.log(0.003), math.log(0.2), random.integers(2, 5))))
    drops_at = np.sort(random.uniform(0.1, 1.2, random.integers(2, 5)))
    gravities = [9.80665] if random.random() < 0.6 else [9.80665, 1.62]
    diameters = [0.008, 0.016] if several else [0.012]
    trials = []
    for index in range(count):
        driven = bool(style == "driven" or (style == "both" and index % 2 == 0))
        options = speeds if driven else drops_at
        trials.append({
            "driven": driven, "speed": float(options[(index // 2 if style == "both" else index) % len(options)]),
            "gravity": float(gravities[index % len(gravities)]), "diameter": diameters[index // 2 % len(diameters)],
            "shock_time": float(np.random.default_rng(index).uniform(0.15, 0.8)),
        })  # fmt: skip
    return {
        "k": k, "c": c, "mass": mass, "believed_k": believed_k, "believed_c": max(believed_c, 0.01), "doubt_k": doubt_k,
        "doubt_c": doubt_c, "trials": trials, "returns": returns, "depth": depth,
        "noise_depth": float(10 ** random.uniform(-4.3, -3.6)),
        "noise_force": k * depth * float(10 ** random.uniform(-2.6, -1.8)),
        "noise_accel": float(10 ** random.uniform(-1.3, -0.5)),
        "rate": float(random.choice([200.0, 500.0])), "drop_time": 0.35,
    }  # fmt: skip


def _shape(
    random: Random, plan: Json, effects: tuple[str, ...], outside: str | None
) -> Callable[[float], dict[str, float]]:
    """What an amplitude means, relative to the force at full depth."""
    k, depth = plan["k"], plan["depth"]
    full, fastest = k * depth, max(t["speed"] for t in plan["trials"])
    bend, reach = float(random.uniform(1.2, 2.2)), float(random.uniform(0.02, 0.2)) * depth
    layer_at, layer_kind = float(random.uniform(0.3, 0.7)) * depth, float(random.random())
    sign = float(random.choice([-0.5, 1.0]))
    hard_kind, onset = float(random.random()), float(random.uniform(0.1, 0.5)) * depth
    rate, phase = float(random.uniform(30, 200)), float(random.uniform(0, 6))

    def settings(amplitude: float) -> dict[str, float]:
        force = amplitude * full
        # no less than a tenth of the force is left: no bed pulls a spike in
        least = -0.9 if layer_kind < 0.5 else -0.9 * layer_at / depth
        layer = {"layer_depth": layer_at, "layer_width": 0.03 * depth, "layer_kind": layer_kind}
        bent = 1 + (bend - 1) * amplitude / (0.3 + amplitude)
        table = {
            "inertial-drag": {"drag": force / fastest**2, "drag_onset": onset},
            "depth-hardening": {"hardening": amplitude, "hardening_kind": hard_kind},
            "plastic-sinkage": {"plastic": amplitude / (1 + amplitude), "plastic_bend": bent},
            "adhesion": {"pull": force, "pull_reach": reach},
            "shaft-friction": {"shaft": force, "shaft_speed": 0.02},
            "layering": {"layer": max(sign * amplitude, least), **layer},
            "floor-vibration": {"vibration": amplitude * depth * 0.1, "vibration_rate": rate, "vibration_phase": phase},
            "loose-mass": {"loose": amplitude, "loose_rate": rate},
            "shock": {"shock": force, "shock_width": 0.02},
            "load-cell-drift": {"drift": force},
            "sloshing": {"slosh": force, "slosh_rate": rate, "slosh_time": 1.0},
        }
        chosen = [table[name] for name in (*effects, *([outside] if outside else []))]
        return {"depth": depth} | {key: value for own in chosen for key, value in own.items()}

    return settings


def _trial(plan: Json, index: int, s: dict[str, float]) -> _Columns:
    """A trial without noise: time, depth, and force or acceleration."""
    this = plan["trials"][index]
    size = this["diameter"] / 0.012
    law = _Law(plan["k"] * size, plan["c"] * size, size, s)
    return (_driven if this["driven"] else _drop)(plan, this, law, s)


def _driven(plan: Json, this: Json, law: _Law, s: dict[str, float]) -> _Columns:
    depth, speed = plan["depth"], this["speed"]
    going = depth / speed
    total = going * (1.9 if plan["returns"] else 1.0)
    time = np.arange(0, total, 1 / min(max(plan["rate"], 300 / total), 900 / total))
    ease = 0.05 * going  # it turns smoothly

    def moves(at: np.ndarray) -> np.ndarray:
        there = at < going - ease if plan["returns"] else np.full(len(at), True)
        return np.where(there, speed, np.clip(-(at - going) / ease, -1, 1) * speed)

    velocity, fine = moves(time), np.linspace(0, total, 4000)
    moving = moves(fine)
    path = np.concatenate([[0], np.cumsum(0.5 * (moving[1:] + moving[:-1]) * np.diff(fine))])
    z = np.interp(time, fine, path)
    rows = zip(z.tolist(), velocity.tolist(), time.tolist(), strict=True)
    values = np.array([law(depth_now, v, t, math.tanh(v / (0.02 * speed))) for depth_now, v, t in rows])
    if "shock" in s:
        values = values + s["shock"] * np.exp(-0.5 * ((time / total - this["shock_time"]) / s["shock_width"]) ** 2)
    values = values + s.get("drift", 0.0) * (time / total) ** 1.5
    return {"time": time, "depth": z, "other": values}


def _drop(plan: Json, this: Json, law: _Law, s: dict[str, float]) -> _Columns:
    m, g, dt, rate = plan["mass"], this["gravity"], _STEP, plan["rate"] * 2
    time = np.arange(0, plan["drop_time"], 1 / rate)
    every = round(1 / rate / dt)
    z, v, a, t, stuck = 0.0, this["speed"], g, 0.0, False
    loose, inner, inner_v = s.get("loose", 0.0) * 0.3, 0.0, 0.0
    depth, acceleration = np.empty((2, len(time)))
    for row in range(len(time)):
        depth[row], acceleration[row] = z, a
        for _ in range(every):
            half = v + 0.5 * dt * a
            new = z + dt * half if not stuck else z
            total = m * g - law(new, half if not stuck else 0.0, t + dt, math.copysign(1.0, half))
            if "shock" in s:
                late = (t / plan["drop_time"] - this["shock_time"]) / s["shock_width"]
                total += s["shock"] * math.exp(-0.5 * late**2)
            if loose > 0:
                inner_a = -(s["loose_rate"] ** 2) * inner - a
                inner_v += dt * inner_a
                inner += dt * inner_v
                total += loose * m * s["loose_rate"] ** 2 * inner
            drift = s.get("drift", 0.0) / m * (t / plan["drop_time"]) ** 1.5
            if "shaft" in s and new > 0.0 and abs(half) < 2e-3:
                stuck = m * g - law(new, 0.0, t, 1.0) <= 0.0 <= m * g - law(new, 0.0, t, -1.0)
            z, a = new, 0.0 if stuck else total / m
            v = 0.0 if stuck else half + 0.5 * dt * a
            t += dt
        if drift:
            acceleration[row] += drift
    return {"time": time, "depth": depth, "other": acceleration}


def _signature(plan: Json, clean: dict[int, _Columns], made: list[_Columns]) -> float:
    """Root mean square of the change over the noise, what a change of K would explain taken out."""
    change, slope = [], []
    for (index, one), other in zip(clean.items(), made, strict=True):
        nudged = _trial({**plan, "k": plan["k"] * 1.01}, index, {})
        noises = {"depth": plan["noise_depth"], "other": plan["noise_accel"]}
        if plan["trials"][index]["driven"]:
            noises = {"other": math.hypot(plan["noise_force"], plan["k"] * plan["noise_depth"] * 0.1)}
        for name, noise in noises.items():
            change.append((other[name] - one[name]) / noise)
            slope.append((nudged[name] - one[name]) / noise)
    d, k = np.concatenate(change), np.concatenate(slope)
    d = d - k * (k @ d) / max(float(k @ k), 1e-12)
    return float(np.sqrt(np.mean(d**2)))


def correlated(white: np.ndarray, persistence: float) -> np.ndarray:
    """White noise made into that of an autoregressive law of order one with unit variance."""
    if persistence:
        for k in range(1, len(white)):
            white[k] = persistence * white[k - 1] + math.sqrt(1 - persistence**2) * white[k]
    return white


def _record(random: Random, plan: Json, made: list[_Columns], coloured: bool, depth_persistence: float) -> Campaign:
    persistence = float(random.uniform(0.3, 0.8)) if coloured else 0.0
    trials, recordings = [], {}
    for index, (this, data) in enumerate(zip(plan["trials"], made, strict=True)):
        name, mode, n = f"{index + 1:03d}", "driven" if this["driven"] else "drop", len(data["time"])
        kept = {key: this[key] for key in ("gravity", "speed", "diameter")}
        trials.append({"id": name, "mode": mode, "data": f"{name}.csv", **kept})
        column, std = ("force_N", plan["noise_force"]) if this["driven"] else ("accel_m_s2", plan["noise_accel"])
        recordings[(name, "data")] = Recording({
            "t_s": data["time"],
            "depth_m": data["depth"] + plan["noise_depth"] * correlated(random.standard_normal(n), depth_persistence),
            column: data["other"] + std * correlated(random.standard_normal(n), persistence),
        })  # fmt: skip
    spike = {"mass": plan["mass"], "diameter": 0.012, "tip": "sphere"}
    noise = {name: plan[f"noise_{name}"] for name in ("depth", "force", "accel")}
    believed, doubt = ((plan[f"{of}_k"], plan[f"{of}_c"]) for of in ("believed", "doubt"))
    return Campaign(tables_of("made up", spike, believed, doubt, noise, trials), recordings)


def tables_of(
    name: str, spike: Json, believed: Sequence[float], doubt: Sequence[float], noise: dict[str, float],
    trials: Sequence[Json],
) -> PenetrationCampaign:  # fmt: skip
    """The tables of a campaign in sand; ``believed``, ``doubt``: of stiffness and damping."""
    return PenetrationCampaign.model_validate({
        "format": "hedgehog-campaign/1", "kind": "penetration", "name": name, "spike": spike,
        "surface": {"kind": "sand", "stiffness": believed[0], "damping": believed[1]},
        "uncertainty": {"stiffness": doubt[0], "damping": doubt[1]},
        "sensors": {sensor: {"std": (std,)} for sensor, std in noise.items()}, "trial": tuple(trials),
    })  # fmt: skip
