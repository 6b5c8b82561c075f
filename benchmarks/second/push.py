"""Campaigns of pushes and drops by the second simulator: plain tables and columns, and the answer.

Nothing here comes from `rigid`, `coupling` or `experiments`. A law is evaluated along a fine path, all trials at once;
drops are stepped by Heun's rule with a fixed step. The structure: the bed's first grains are loose, so that spring and
damper set in over a depth, and the frame between drive and tip is compliant.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from .drawing import Made, Numbers, Secret, Table, at_strength, draw_case, draw_names, softness_for
from .noise import Noise, draw_noise

__all__ = ["EFFECTS", "OUTSIDE", "Law", "fall", "make_push"]

Array = NDArray[np.float64]
Random = np.random.Generator
Columns = list[dict[str, Array]]
EFFECTS = (
    "inertial-drag", "depth-hardening", "plastic-sinkage", "adhesion", "shaft-friction", "layering", "relaxation",
)  # fmt: skip
OUTSIDE = ("jamming", "cell-drift", "ringing")
"""What no library has: a force that goes up and down with depth, a cell that warms up, a frame that rings after each
change of speed."""
_G = 9.80665
_FINE = 3000  # points of a path
_STEP = 1e-4  # of a drop [s]
_PARTS, _TOUCH = 20, 0.005  # of a step, up to this time [s]: a bed sets in over some micrometres
_LADDER, _SPAN = 13, 3000.0
_STRUCTURES = np.geomspace(2e-5, 1.0, 16)  # shares of the softest bed and frame that are tried
_SOFTEST = 5e-3  # depth over which the softest bed sets in [m]
_SWITCHES = ("layer_slope",)  # settings that choose a form and are no sizes
_TRIES = 40  # of a search for the apparent numbers
_STILL, _GAIN = 1e-6, 1e-4
"""Where it has converged, the next step would change K and C by less than this share, and chi-square by less."""


class Law:
    """The bed's force on many spikes at once, with its memory: arrays of shape [lane_count]."""

    def __init__(self, k: Array | float, c: Array | float, depth: float, s: Mapping[str, float]) -> None:
        self.k, self.c, self.depth, self.s = k, c, depth, s
        self.top: Array | float = 0.0
        self.slow: Array | float = 0.0

    def __call__(self, z: Array, v: Array, dt: Array | float) -> Array:
        """Force [N] at depth `z` [m], speed `v` [m/s], a step `dt` [s] after the last."""
        s, deep = self.s, np.maximum(z, 0.0)
        self.top = np.maximum(self.top, deep)
        force = self.spring(deep)
        soft = s.get("soft", 0.0)
        there = 1.0 - np.exp(-deep / soft) if soft > 0.0 else (z >= 0.0).astype(float)
        if "plastic" in s:  # a straight line, steeper than the spring, down from the deepest point
            steeper = self.k / (1.0 - s["plastic"])
            back = self.spring(self.top) - steeper * (self.top - deep)
            force = np.where(deep < self.top, np.maximum(back, 0.0), force)
        force = force + self.c * np.maximum(v, 0.0) * there
        if "drag" in s:
            force = force + s["drag"] * np.maximum(v, 0.0) ** 2 * np.minimum(deep / s["drag_depth"], 1.0)
        if "pull" in s:
            let = np.clip(deep / (0.15 * self.depth), 0.0, 1.0)
            force = force - s["pull"] * let * (1.0 - np.exp((deep - self.top) / s["pull_reach"]))
        if "shaft" in s:
            force = force + s["shaft"] * (deep / self.depth) ** s["shaft_power"] * np.tanh(v / s["shaft_speed"])
        if "jam" in s:
            force = force + s["jam"] * np.sin(2 * np.pi * deep / s["jam_length"]) * deep / self.depth
        if "relax" in s:  # a spring in series with a dashpot, beside the bed; it gives way when it would pull
            stretched = (self.slow + s["relax"] * v * dt * there) * np.exp(-dt / s["relax_time"])
            self.slow = np.maximum(stretched, 0.0)
            force = force + self.slow
        return np.where(z >= 0.0, force, 0.0)  # a drop begins at 0, in touch

    def spring(self, deep: Array | float) -> Array:
        """Loading curve, without damper [N]."""
        s, soft = self.s, self.s.get("soft", 0.0)
        x = np.asarray(deep, dtype=float)
        force = self.k * (x - soft * (1.0 - np.exp(-x / soft)) if soft > 0.0 else x)
        if "harden" in s:
            share = x / self.depth
            grows = share ** s["harden_power"] if s["harden_power"] > 0.0 else 1.0 - np.exp(-3.0 * share)
            force = force * np.maximum(1.0 + s["harden"] * grows, 0.05)
        if "layer" in s:
            y = (x - s["layer_depth"]) / s["layer_width"]
            below = s["layer_width"] * np.logaddexp(0.0, y)
            force = force + s["layer"] * self.k * (
                below if s["layer_slope"] > 0.5 else 0.3 * self.depth * 0.5 * (1.0 + np.tanh(y))
            )
        return np.asarray(force)


@dataclass(frozen=True)
class _Plan:
    k: float
    c: float
    mass: float
    depth: float
    stated: tuple[float, float]
    doubt: tuple[float, float]
    trials: tuple[Table, ...]
    style: dict[str, float]
    std: dict[str, float]
    noise: dict[str, Noise]
    structure: Numbers


def make_push(
    seed: int, *, kind: str | None = None, strength: float | None = None, trials: int | None = None,
    structure: float | None = None,
) -> tuple[Made, Secret]:  # fmt: skip
    """A campaign and what is hidden in it; arguments as of `tumble.make_tumble`, effects `EFFECTS` and `OUTSIDE`.

    Raises ValueError for a kind that there is not.
    """
    random = np.random.default_rng((seed, 26))
    kind, strength, size = draw_case(random, kind, strength, structure, effects=EFFECTS, outside=OUTSIDE)
    names = draw_names(random, kind, EFFECTS)
    plan = _draw_plan(random, names, trials)
    plan, reached = _with_structure(random, plan, size)
    bare, slopes = _slopes(plan)
    forms = [_form(random, plan, name) for name in names if kind != "null"]

    def signatures(ladder: list[Numbers]) -> list[float]:
        return [_left(plan, bare, slopes, _measure(plan, numbers)) for numbers in ladder]

    chosen = [at_strength(form, signatures, strength, span=_SPAN, count=_LADDER) for form in forms]
    settings = {name: value for numbers, _ in chosen for name, value in numbers.items()}
    outside, clean = kind if kind in OUTSIDE else None, _measure(plan, settings)
    secret = Secret(
        () if kind == "null" or outside else names, outside, {}, min((seen for _, seen in chosen), default=0.0),
        any(noise.kind == "coloured" for noise in plan.noise.values()), len(plan.trials),
        {"structure": reached, "legs": plan.structure, "each": [seen for _, seen in chosen], "settings": settings,
         "noise": {name: noise.kind for name, noise in plan.noise.items()},
         "base": {"stiffness": plan.k, "damping": plan.c},
         **({} if outside else _told(plan, settings))},
        {} if outside else {f"{n:03d}": columns for n, columns in enumerate(clean, 1)},
    )  # fmt: skip
    return _record(random, plan, clean), secret


def _draw_plan(random: Random, names: Sequence[str], trials: int | None) -> _Plan:
    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    k, depth = math.exp(between(math.log(400), math.log(4000))), between(0.012, 0.03)
    mass = min(between(0.2, 0.8), 0.4 * k * depth / _G)
    c = between(0.05, 0.3) * 2 * math.sqrt(k * mass)
    free = random.random() < 0.2
    doubt = (2.0, 2.0) if free else (0.1, 0.2)
    stated = (k / (1 + 0.1 * float(np.clip(random.standard_normal(), -2, 2))),
              c / (1 + 0.2 * float(np.clip(random.standard_normal(), -2, 2))))  # fmt: skip
    returns = (
        bool({"plastic-sinkage", "adhesion", "shaft-friction", "relaxation"} & set(names)) or random.random() < 0.7
    )
    speeds = np.geomspace(between(0.004, 0.01), between(0.06, 0.2), int(random.choice((2, 3, 4))))
    count = trials or int(random.choice((6, 8, 8, 9, 12)))
    drops = 0 if random.random() < 0.5 else count // 3
    scatter = between(0.0, 0.02) * bool(random.random() < 0.3)  # of each push's own mean speed, as people push
    fast = between(0.3, 0.5), between(0.7, 1.0)
    pushed = [float(speeds[n % len(speeds)] * (1 + scatter * random.standard_normal())) for n in range(count - drops)]
    own = [{"mode": "driven", "speed": round(speed, 6)} for speed in pushed]
    own += [{"mode": "drop", "speed": round(fast[n % 2] * 0.6 * depth * math.sqrt(k / mass), 5)} for n in range(drops)]
    style = {"returns": float(returns), "above": between(0.0, 0.006), "hold": between(0.1, 0.8),
             "rest": between(0.1, 0.3), "rate": float(random.choice((100.0, 200.0, 400.0))),
             "ramp": between(0.03, 0.12)}  # fmt: skip
    std = {"depth": 10 ** between(math.log10(2e-5), -4.0), "force": k * depth * 10 ** between(-2.6, -1.8),
           "accel": 10 ** between(-1.3, -0.5)}  # fmt: skip
    return _Plan(
        k, c, mass, depth, stated, doubt, tuple(own), style, std, {name: draw_noise(random) for name in std}, {}
    )


def _form(random: Random, plan: _Plan, name: str) -> Callable[[float], Numbers]:
    """The effect `name`, from its amplitude to the numbers of the law; 1 is as large as the spring's force."""
    full, depth = plan.k * plan.depth, plan.depth
    fastest = max(t["speed"] for t in plan.trials)
    sign, second = float(random.choice((-1.0, 1.0))), bool(random.random() < 0.5)
    share = float(random.uniform(0.3, 1.0))
    table: dict[str, Callable[[float], Numbers]] = {
        "inertial-drag": lambda a: {"drag": 3.0 * full * a / fastest**2, "drag_depth": (0.05 + second) * depth},
        "depth-hardening": lambda a: {"harden": (2.0 if sign > 0 else -0.6) * a,
                                      "harden_power": 0.5 + share if second else -1.0},
        "plastic-sinkage": lambda a: {"plastic": 0.97 * a},
        "adhesion": lambda a: {"pull": 0.8 * full * a, "pull_reach": 0.1 * share * depth},
        "shaft-friction": lambda a: {"shaft": full * a, "shaft_power": float(second) * share, "shaft_speed": 1e-3},
        "layering": lambda a: {"layer": (2.0 if sign > 0 else -0.7) * a, "layer_depth": (0.25 + 0.4 * share) * depth,
                               "layer_width": 0.03 * depth, "layer_slope": float(second or sign < 0)},
        "relaxation": lambda a: {"relax": 2.0 * plan.k * a, "relax_time": 0.1 * share},
        "jamming": lambda a: {"jam": 0.6 * full * a, "jam_length": 0.15 * share * depth},
        "cell-drift": lambda a: {"cell_drift": sign * full * a},
        "ringing": lambda a: {"ring": 0.5 * full * a, "ring_rate": 8.0 + 20.0 * share, "ring_time": 0.05 + 0.2 * share},
    }  # fmt: skip
    return table[name]


def _paths(plan: _Plan) -> tuple[Array, Array, Array, Array]:
    """Times, depths, speeds and changes of speed of the driven trials, shape [trial_count, point_count]."""
    style, times, depths, speeds, jolts = plan.style, [], [], [], []
    for trial in plan.trials:
        if trial["mode"] != "driven":
            continue
        v, way = trial["speed"], plan.depth + style["above"]
        parts = [(0.0, style["rest"]), (v, way / v), (0.0, style["hold"])]
        parts += [(-v, 0.9 * way / v), (0.0, 0.1)] if style["returns"] else []
        ends = np.cumsum([0.0, *(lasts for _, lasts in parts)])
        time = np.linspace(0.0, ends[-1], _FINE)
        ramp = style["ramp"] * way / v
        speed, jolt = np.zeros(_FINE), np.zeros(_FINE)
        for (before, _), (after, _), at in zip([(0.0, 0.0), *parts], parts, ends, strict=False):
            u = np.clip((time - at) / ramp + 0.5, 0.0, 1.0)
            speed += (after - before) * u * u * (3.0 - 2.0 * u)  # eased by a smooth step
            jolt += (after - before) / v * np.where(time > at, np.exp(-(time - at)), 0.0)
        z = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])
        times.append(time)
        depths.append(z * way / z.max() - style["above"])
        speeds.append(np.gradient(depths[-1], time))
        jolts.append(jolt)
    return np.array(times), np.array(depths), np.array(speeds), np.array(jolts)


def _measure(plan: _Plan, settings: Mapping[str, float], k: float = 1.0, c: float = 1.0) -> Columns:
    """Time, depth, and force or acceleration of each trial, without noise, K and C times `k` and `c`."""
    s = {**plan.structure, **settings}
    found: Columns = []
    driven = [t for t in plan.trials if t["mode"] == "driven"]
    if driven:
        time, depth, speed, _ = _paths(plan)
        law = Law(plan.k * k, plan.c * c, plan.depth, s)
        steps = time[:, 1] - time[:, 0]
        if "relax" in s:  # point by point: what fades depends on all that was before
            force = np.array([law(z, v, steps) for z, v in zip(depth.T, speed.T, strict=True)]).T
        else:
            law.top = np.maximum.accumulate(np.maximum(depth, 0.0), axis=1)
            force = law(depth, speed, steps[:, None])
        for t, z, f, v, trial in zip(time, depth, force, speed, driven, strict=True):
            f = f + s.get("cell_drift", 0.0) * (1.0 - np.exp(-t / (0.6 * t[-1])))
            if "ring" in s:
                f = f + s["ring"] * _ringing(t, v / trial["speed"], s["ring_rate"], s["ring_time"])
            rows = np.arange(0.0, t[-1], max(1.0 / plan.style["rate"], t[-1] / 1000))
            z = z + f / s["frame"] if s.get("frame") else z  # the depth is read at the drive
            found.append({"t_s": rows, "depth_m": np.interp(rows, t, z), "force_N": np.interp(rows, t, f)})
    return found + _drops(plan, Law(plan.k * k, plan.c * c, plan.depth, s))


def _drops(plan: _Plan, law: Law) -> Columns:
    """Time, depth and acceleration of each drop on this law."""
    speeds = np.array([t["speed"] for t in plan.trials if t["mode"] == "drop"])
    if not len(speeds):
        return []
    t, z, a = fall(law, speeds, plan.mass, _G, 0.25, rate=2 * plan.style["rate"])
    a = a + law.s.get("cell_drift", 0.0) / plan.mass * (1.0 - np.exp(-t / 0.15))[:, None]
    return [{"t_s": t, "depth_m": z[:, n], "accel_m_s2": a[:, n]} for n in range(len(speeds))]


def _told(plan: _Plan, settings: Mapping[str, float]) -> Table:
    """The apparent numbers, or why there are none."""
    try:
        return {"apparent": _apparent(plan, settings)}
    except RuntimeError as error:
        return {"apparent": {}, "apparent_error": str(error)}


def _apparent(plan: _Plan, settings: Mapping[str, float]) -> Numbers:
    """K [N/m] and C [N s/m] that come nearest to the true readings, by least squares over their noise, in a bed without
    loose grains behind a rigid frame.

    Of readings without noise, and with the effect's own form, whose sizes are free too (a weak prior of 100 % holds
    what the readings leave open). A model of another structure cannot give K and C of the ground: with ever more
    readings its fit comes to these numbers (H. White 1982, Econometrica 50, 1-25), if it weights all readings of all
    trials alike. A diagnosis does not: its own limit is that of `experiments.diagnose.push.limit`.

    Raises RuntimeError where the search does not converge.
    """
    true = _measure(plan, settings)
    read = np.concatenate(_over_noise(plan, true))
    sizes = [n for n, v in settings.items() if v and n not in _SWITCHES and (n != "harden_power" or v > 0.0)]

    def away(factors: Array) -> Array:
        own = dict(settings) | {name: settings[name] * factors[2 + n] for n, name in enumerate(sizes)}
        numbers = plan.k * factors[0], plan.c * factors[1], plan.depth, own
        pushes = [_along(Law(*numbers), one) for one in true if "force_N" in one]
        made = np.concatenate(_over_noise(plan, pushes + _drops(plan, Law(*numbers))))
        return np.concatenate([made - read, factors[2:] - 1.0])

    found = _nearest(away, 2 + len(sizes))
    return {"stiffness": float(plan.k * found[0]), "damping": float(plan.c * found[1])}


def _nearest(away: Callable[[Array], Array], count: int, *, tries: int = _TRIES) -> Array:
    """Factors near 1, those of K and C first, with the least sum of squares.

    Raises RuntimeError where `tries` evaluations do not suffice: by the Gauss-Newton step from the last point, which
    is 0 where the gradient is.
    """
    found = least_squares(away, np.ones(count), diff_step=1e-4, ftol=1e-9, xtol=1e-9, gtol=1e-9, max_nfev=tries)
    step = np.linalg.lstsq(found.jac, -found.fun)[0]
    change, gain = float(np.abs(step[:2] / found.x[:2]).max()), float(np.sum((found.jac @ step) ** 2))
    if not (change < _STILL and gain < _GAIN):
        raise RuntimeError(
            f"not converged after {found.nfev} evaluations: the next step changes K or C by {change:.2g} of it, "
            f"chi-square by {gain:.2g}"
        )
    return np.asarray(found.x)


def _along(law: Law, push: Mapping[str, Array]) -> dict[str, Array]:
    """The law's force along a push whose depth is as it was read."""
    rows, read = push["t_s"], push["depth_m"]
    time = np.linspace(rows[0], rows[-1], _FINE) if "relax" in law.s else rows  # as finely as the path itself
    depth = np.interp(time, rows, read)
    speed, steps = np.gradient(depth, time), np.gradient(time)
    if "relax" in law.s:
        force = np.array([law(z, v, dt) for z, v, dt in zip(depth, speed, steps, strict=True)])
        return {"force_N": np.interp(rows, time, force)}
    law.top = np.maximum.accumulate(np.maximum(depth, 0.0))
    return {"force_N": law(depth, speed, steps)}


def _ringing(time: Array, speed: Array, rate: float, lasts: float) -> Array:
    """A damped oscillator that each change of speed sets off, over the change."""
    dt, w = time[1] - time[0], 2 * math.pi * rate
    decay = np.exp((-1.0 / lasts + 1j * w) * dt)
    kicks, state, out = np.diff(speed, prepend=speed[0]), 0j, np.zeros(len(time))
    for n, kick in enumerate(kicks):
        state = state * decay + kick
        out[n] = state.imag
    return out


def fall(
    law: Law, speeds: Array, mass: float, gravity: float, duration: float, *, rate: float
) -> tuple[Array, Array, Array]:
    """Times [s] and, shape [row_count, drop_count], depths [m] and accelerations [m/s2] of drops at `speeds`."""
    every = max(1, round(1.0 / rate / _STEP))
    z, v, times, depths, rates = np.zeros(len(speeds)), speeds.astype(float), [], [], []
    a = np.full(len(speeds), gravity)
    for n in range(round(duration / _STEP) + 1):
        if n % every == 0:
            times.append(n * _STEP)
            depths.append(z.copy())
            rates.append(a.copy())
        parts = _PARTS if n * _STEP < _TOUCH else 1
        step = _STEP / parts
        for _ in range(parts):
            first = gravity - law(z, v, 0.5 * step) / mass
            second = gravity - law(z + step * v, v + step * first, 0.5 * step) / mass
            z = z + step * (v + 0.5 * step * first)
            v = v + 0.5 * step * (first + second)
        a = gravity - law(z, v, 0.0) / mass
    return np.array(times), np.array(depths), np.array(rates)


def _over_noise(plan: _Plan, columns: Columns) -> list[Array]:
    """Readings over their noise, one array a trial; a push's depth is wrong by a tenth of its noise once smoothed."""
    push = math.hypot(plan.std["force"], 0.1 * plan.k * plan.std["depth"])
    return [one["force_N"] / push if "force_N" in one
            else np.concatenate([one["depth_m"] / plan.std["depth"], one["accel_m_s2"] / plan.std["accel"]])
            for one in columns]  # fmt: skip


def _slopes(plan: _Plan) -> tuple[Columns, Array]:
    """Readings with nothing hidden, and what one standard deviation of K and C changes, over the noise."""
    clean = _measure(plan, {})
    base = np.concatenate(_over_noise(plan, clean))
    nudged = (_measure(plan, {}, k=1.02), _measure(plan, {}, c=1.02))
    scale = [doubt / 0.02 for doubt in plan.doubt]
    return clean, np.array(
        [(np.concatenate(_over_noise(plan, one)) - base) * s for one, s in zip(nudged, scale, strict=True)]
    )


def _left(plan: _Plan, clean: Columns, slopes: Array, made: Columns) -> float:
    """Root mean square of a change over the noise, without what K and C explain."""
    change = np.concatenate(_over_noise(plan, made)) - np.concatenate(_over_noise(plan, clean))
    normal = slopes @ slopes.T + np.eye(len(slopes))
    rest = change - np.linalg.solve(normal, slopes @ change) @ slopes
    return float(np.sqrt(np.mean(rest**2)))


def _with_structure(random: Random, plan: _Plan, size: float) -> tuple[_Plan, float]:
    """The plan with a bed and a frame as soft as changes the readings by `size` over the noise, and what they do."""
    frame = float(random.uniform(1.0, 10.0)) * plan.k  # stiffness of the softest frame [N/m]
    clean, slopes = _slopes(plan)

    def soft(share: float) -> Numbers:
        return {"soft": _SOFTEST * share, "frame": frame / share}

    sizes = [_left(plan, clean, slopes, _measure(plan, soft(float(share)))) for share in _STRUCTURES]
    plan = replace(plan, structure=soft(softness_for(size, _STRUCTURES, sizes, least=1e-6)))
    return plan, _left(plan, clean, slopes, _measure(plan, {}))


def _record(random: Random, plan: _Plan, made: Columns) -> Made:
    columns, trials = {}, []
    of = {"depth_m": "depth", "force_N": "force", "accel_m_s2": "accel"}
    for number, (trial, one) in enumerate(zip(plan.trials, made, strict=True), 1):
        id = f"{number:03d}"
        columns[id, "data"] = {
            name: plan.noise[of[name]].on(values, plan.std[of[name]], random) if name in of else values
            for name, values in one.items()
        }
        trials.append({"id": id, "gravity": _G, **trial, "data": f"{id}.csv"})
    tables: Table = {
        "format": "hedgehog-campaign/1", "kind": "penetration", "name": "second",
        "spike": {"mass": plan.mass, "diameter": 0.012, "tip": "sphere"},
        "surface": {"kind": "sand", "granular": True, "stiffness": plan.stated[0], "damping": plan.stated[1]},
        "uncertainty": {"stiffness": plan.doubt[0], "damping": plan.doubt[1]},
        "sensors": {name: {"std": (std,)} for name, std in plan.std.items()},
        "trial": tuple(trials),
    }  # fmt: skip
    return Made(tables, columns)
