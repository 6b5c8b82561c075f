"""The beds and motions of `hidden_rig`: laws of several kinds an effect, a drive's path, drops by small steps.

Nothing here is shared with the code that diagnoses, nor are the laws those of `hidden_penetration`. SI throughout.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["LAWS", "Bed", "Law", "Path", "draw_law", "drive", "drop", "push"]

Array = NDArray[np.float64]

LAWS: dict[str, tuple[str, ...]] = {
    "inertial-drag": ("constant", "onset", "power"),
    "depth-hardening": ("power", "hyperbola", "bilinear"),
    "plastic-sinkage": ("straight", "bent"),
    "adhesion": ("short", "fading", "deepest", "long"),
    "shaft-friction": ("corner", "exponential", "depth", "mobilised", "stribeck"),
    "layering": ("slope", "step", "crust"),
    "relaxation": ("maxwell",),
    "collapse": ("sawtooth",),
    "magnet": ("distance",),
    "cell-drift": ("warming",),
    "ringing": ("frame",),
    "rate": ("power",),
}
"""What a law may be, by what it stands for; the last six are in no library."""

_STEP = 1.25e-5  # s, of a drop
_CREEP = 2e-4  # m/s below which the direction of a drive is not certain to friction that is not mobilised over a way
_STEEPEST = 0.9  # share of the depth of locking from which a hyperbola goes on straight


@dataclass(frozen=True)
class Law:
    """One law without its amplitude: what it stands for, its kind, and its lengths [m], speeds [m/s], times [s]."""

    name: str
    kind: str
    numbers: Mapping[str, float] = field(default_factory=dict)


def draw_law(random: np.random.Generator, name: str, depth: float, kind: str | None = None) -> Law:
    """A law of `name` for pushes to `depth` [m], of `kind` or one at random."""

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    def evenly(low: float, high: float) -> float:
        return math.exp(between(math.log(low), math.log(high)))

    def reach() -> dict[str, float]:
        ends = {"short": (5e-5, 5e-4), "fading": (3e-4, 1.5e-3), "deepest": (3e-4, 2e-3)}
        return {name: between(*pair) for name, pair in ends.items()} | {"long": between(0.3, 0.6) * depth}

    kind = kind or str(random.choice(LAWS[name]))
    draws: dict[str, Callable[[], dict[str, float]]] = {
        "inertial-drag": lambda: {"onset": between(0.1, 0.5) * depth},
        "depth-hardening": lambda: {
            "reference": between(0.4, 0.8) * depth,
            "softer": float(random.random() < 0.35),
            "corner": between(0.0, 0.1) * depth,
            "width": between(0.3, 0.5) * depth,
        },
        "plastic-sinkage": lambda: {"bend": between(1.3, 2.2)},
        "adhesion": lambda: {"reach": reach()[kind], "fade": between(1e-3, 4e-3)},
        "shaft-friction": lambda: {
            "onset": min(evenly(3e-4, 5e-3), 0.5 * depth),
            "reach": between(1e-4, 5e-4),
            "more": between(0.3, 1.0),
            "speed": evenly(0.005, 0.02),
            "grows": float(random.random() < 0.4),
        },
        "layering": lambda: {
            "at": between(0.3, 0.7) * depth,
            "sign": float(random.choice([-0.5, 1.0])),
            "width": between(2e-4, 8e-4),
            "crust": between(0.1, 0.3) * depth,
            "fall": between(0.05, 0.15) * depth,
        },
        "relaxation": lambda: {"time": evenly(0.05, 1.0)},
        "collapse": lambda: {"period": between(0.12, 0.35) * depth},
        "magnet": lambda: {"at": depth + between(0.005, 0.03), "scale": between(0.008, 0.02)},
        "cell-drift": lambda: {"time": between(0.5, 3.0)},
        "ringing": lambda: {"time": between(0.05, 0.15), "rate": 2 * math.pi * between(12.0, 40.0)},
        "rate": lambda: {"speed": 0.05, "power": between(0.25, 0.35)},
    }
    return Law(name, kind, {"depth": depth} | draws[name]())


class Bed:
    """The bed's force on a spike, upwards, with what it remembers; one object a trial.

    `k`: stiffness [N/m]. `c`: damping on the way in [N s/m]. `laws`: what it does beside, all with the same
    `amplitude`, 0 for nothing. `full`: force to which an amplitude of 1 refers [N], of the middle diameter. `size`:
    diameter over the middle one: sections go with its square, shafts with itself. `event`: of the blow [s].
    """

    def __init__(
        self, k: float, c: float, laws: Sequence[Law] = (), amplitude: float = 0.0, *, full: float = 1.0,
        size: float = 1.0, event: float = 0.0,
    ) -> None:  # fmt: skip
        self.k, self.c, self.event = k, c, event
        self.top = self.deepest = 0.0  # since it last came in; ever
        self.curves: list[Callable[[float], float]] = []
        self.pushes: list[Callable[[float, float, float], float]] = []  # depth, speed, duration of the step
        self.fields: list[Callable[[float, float], float]] = []  # depth, time; above the surface, too
        self.crater: Callable[[float], float] | None = None
        self.bound: Callable[[float, float], float] | None = None  # of friction, at depth and speed
        self.reach = 0.0  # over which friction is mobilised
        self.gripped = self.strained = 0.0
        for law in laws:
            if amplitude:
                self._add(law, amplitude, full, size)

    def force(self, z: float, v: float, t: float, h: float, way: float) -> float:
        """At depth z, speed v, time t, after a step of h; `way` is the direction for friction without a reach."""
        total = sum(acts(z, t) for acts in self.fields)
        if z <= 0.0:
            self.top = self.gripped = self.strained = 0.0
            return total
        self.top, self.deepest = max(self.top, z), max(self.deepest, z)
        spring = self.curve(z) if self.crater is None or z >= self.deepest else self.crater(z)
        if spring > 0.0 or self.crater is None:  # an open crater touches nothing
            total += spring + self.c * max(v, 0.0)
        for acts in self.pushes:
            total += acts(z, v, h)
        if self.bound is None:
            return total
        bound = self.bound(z, abs(v))
        if not self.reach:
            return total + bound * way
        self.gripped = min(max(self.gripped + bound / self.reach * v * h, -bound), bound)
        return total + self.gripped

    def curve(self, z: float) -> float:
        """Loading curve."""
        return self.k * z + sum(acts(z) for acts in self.curves)

    def holds(self, z: float, t: float, weight: float) -> bool:
        """Whether dry friction keeps a spike of this weight [N] where it has stopped."""
        if self.bound is None or self.reach or z <= 0.0:
            return False
        return abs(weight - self.force(z, 0.0, t, 0.0, 0.0)) <= self.bound(z, 0.0)

    def _add(self, law: Law, a: float, full: float, size: float) -> None:
        n, depth, k, most = law.numbers, law.numbers["depth"], self.k, a * full
        if law.name == "inertial-drag":
            self.pushes.append(_drag(law, most * size**2))
        elif law.name == "depth-hardening":
            self.curves.append(_hardening(law, a, k))
        elif law.name == "layering":
            self.curves.append(_layer(law, a, k))
        elif law.name == "plastic-sinkage":
            self.crater = self._unloading(1.0 + a, 1.0 + (n["bend"] - 1.0) * a / (1.0 + a) * (law.kind == "bent"))
        elif law.name == "adhesion":
            self.pushes.append(self._pull(law, most * size**2))
        elif law.name == "shaft-friction":
            self.bound = _friction(law, most * size)
            self.reach = n["reach"] if law.kind == "mobilised" else 0.0
        elif law.name == "relaxation":
            self.pushes.append(self._maxwell(a * k, n["time"]))
        elif law.name == "collapse":
            top = most * size**2
            self.pushes.append(  # no bed pulls a spike in
                lambda z, v, h: max(
                    top * ((z / n["period"]) % 1.0 - 0.5) * min(1.0, z / 2e-3) * (v > 0.0), -0.9 * k * z
                )
            )
        elif law.name == "magnet":
            self.fields.append(lambda z, t: most / (1.0 + max(n["at"] - z, 0.0) / n["scale"]) ** 2)
        elif law.name == "cell-drift":
            self.fields.append(lambda z, t: most * (1.0 - math.exp(-t / n["time"])))
        elif law.name == "ringing":
            since = lambda t: max(t - self.event, 0.0)  # noqa: E731
            self.fields.append(lambda z, t: most * math.exp(-since(t) / n["time"]) * math.sin(n["rate"] * since(t)))
        elif law.name == "rate":
            self.pushes.append(lambda z, v, h: a * k * z * (max(v, 0.0) / n["speed"]) ** n["power"])
        else:
            raise ValueError(f"law = {law.name!r}: one of {', '.join(LAWS)} was expected, for pushes to {depth:g} m")

    def _unloading(self, steeper: float, bend: float) -> Callable[[float], float]:
        """Down and up again along a line `steeper` times as steep as K, or bent to where that ends."""

        def crater(z: float) -> float:
            share = 1.0 - steeper * (1.0 - z / self.deepest)
            line = self.curve(self.deepest) * share**bend if share > 0.0 else 0.0
            return float(min(line, self.curve(z)))  # it gives back no more than it took

        return crater

    def _pull(self, law: Law, most: float) -> Callable[[float, float, float], float]:
        n = law.numbers

        def pull(z: float, v: float, h: float) -> float:
            back = (self.top - z) / n["reach"]
            if back <= 0.0:
                return 0.0
            if law.kind == "short":
                return -most * min(1.0, back)
            if law.kind == "fading":
                return -most * (1.0 - math.exp(-back)) * (1.0 - math.exp(-z / n["fade"]))
            if law.kind == "deepest":
                return -most * self.top / n["depth"] * (1.0 - math.exp(-back))
            return -most * math.tanh(back)

        return pull

    def _maxwell(self, stiffness: float, time: float) -> Callable[[float, float, float], float]:
        """A spring in series with a dashpot, beside K; together they never pull."""

        def branch(z: float, v: float, h: float) -> float:
            kept = math.exp(-h / time)
            self.strained = self.strained * kept + stiffness * time * v * (1.0 - kept)
            return max(self.strained, -self.k * z)

        return branch


def _drag(law: Law, most: float) -> Callable[[float, float, float], float]:
    """`most` [N] at 0.1 m/s."""
    power = 1.8 if law.kind == "power" else 2.0
    onset = law.numbers["onset"] if law.kind == "onset" else 0.0
    grown = (lambda z: 1.0 - math.exp(-z / onset)) if onset else (lambda z: 1.0)
    return lambda z, v, h: most * (max(v, 0.0) / 0.1) ** power * grown(z)


def _hardening(law: Law, a: float, k: float) -> Callable[[float], float]:
    """What is added to K z."""
    n, depth = law.numbers, law.numbers["depth"]
    if law.kind == "power":
        power = 1.0 - 0.4 * math.tanh(a) if n["softer"] else 1.0 + 0.8 * math.tanh(a)
        return lambda z: k * n["reference"] * (z / n["reference"]) ** power - k * z
    if law.kind == "hyperbola":
        locking = depth / (0.8 * math.tanh(a))

        def locked(z: float) -> float:
            x, rest = min(z / locking, _STEEPEST), max(z / locking - _STEEPEST, 0.0)
            return float(k * locking * (x / (1.0 - x) + rest / (1.0 - _STEEPEST) ** 2) - k * z)

        return locked
    at, width = n["corner"], n["width"]
    start = math.hypot(at, width) - at
    rise = -0.7 * math.tanh(a) if n["softer"] else a
    return lambda z: 0.5 * rise * k * (math.hypot(z - at, width) + z - at - start)


def _layer(law: Law, a: float, k: float) -> Callable[[float], float]:
    """What is added to K z; as much is always left that the bed does not pull the spike in."""
    n, depth, at = law.numbers, law.numbers["depth"], law.numbers["at"]
    if law.kind == "slope":
        slope = max(n["sign"] * a, -0.8) * k
        return lambda z: slope * max(z - at, 0.0)
    if law.kind == "step":
        step = max(n["sign"] * a, -0.8 * at / depth) * k * depth
        return lambda z: step * 0.5 * (1.0 + math.tanh((z - at) / n["width"]))
    most, until, fall = a * k * depth, n["crust"], n["fall"]
    return lambda z: most * (z / until if z < until else 0.2 + 0.8 * math.exp(-(z - until) / fall))


def _friction(law: Law, most: float) -> Callable[[float, float], float]:
    n, onset = law.numbers, law.numbers["onset"]
    if law.kind == "depth" or (law.kind == "mobilised" and n["grows"]):
        return lambda z, speed: most * z / n["depth"]
    if law.kind == "exponential":
        return lambda z, speed: most * (1.0 - math.exp(-z / onset))
    if law.kind == "stribeck":
        return lambda z, speed: most * min(1.0, z / onset) * (1.0 + n["more"] * math.exp(-speed / n["speed"]))
    return lambda z, speed: most * min(1.0, z / onset)


@dataclass(frozen=True)
class Path:
    """What a drive does, in steps finer than the rows: time [s], depth [m], speed [m/s], each of shape [step_count]."""

    time: Array
    depth: Array
    speed: Array
    stops: float  # when the way in ends [s]


def drive(segments: Sequence[tuple[float, float]], start: float, ramp: float, *, eased: bool, step: float) -> Path:
    """Speeds [m/s] and how long each lasts [s], one after the other from the depth `start` [m].

    A change of speed takes `ramp` [s], or what the shorter neighbour allows, about the moment at which it would jump:
    by a cosine where `eased`, else at one acceleration.
    """
    segments = [(speed, lasts) for speed, lasts in segments if lasts > 0.0]
    time = np.arange(0.0, sum(lasts for _, lasts in segments), step)
    speed = np.full(len(time), segments[0][0])
    edge, stops = 0.0, float(time[-1])
    for (before, lasted), (after, lasts) in pairwise(segments):
        edge += lasted
        width = max(min(ramp, 0.8 * lasted, 0.8 * lasts), 1e-9)
        share = np.clip((time - edge) / width + 0.5, 0.0, 1.0)
        speed += (after - before) * (0.5 - 0.5 * np.cos(np.pi * share) if eased else share)
        if before > 0.0 >= after:
            stops = edge
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * step])
    return Path(time, start + way, speed, stops)


def push(bed: Bed, path: Path) -> Array:
    """The bed's force along a path [N], shape [step_count]."""
    step = float(path.time[1] - path.time[0])
    way = np.tanh(path.speed / _CREEP)
    rows = zip(path.depth.tolist(), path.speed.tolist(), path.time.tolist(), way.tolist(), strict=True)
    return np.array([bed.force(z, v, t, step, w) for z, v, t, w in rows])


def drop(bed: Bed, *, mass: float, gravity: float, speed: float, duration: float, rate: float) -> dict[str, Any]:
    """A body that touches the bed at t = 0 with `speed` [m/s]: time, depth and acceleration at `rate` [Hz].

    Half a step's way, a step's change of speed, half a step's way: of second order, the speed within the step foretold.
    """
    every = max(1, round(1.0 / (rate * _STEP)))
    h = 1.0 / (rate * every)
    rows = int(duration * rate)
    z, v, a, t, still = 0.0, speed, gravity, 0.0, False
    depth, accel = np.empty((2, rows))
    for row in range(rows):
        depth[row] = z
        inside = max(z, 1e-12) if row == 0 else z  # it has just touched
        accel[row] = 0.0 if still else gravity - bed.force(inside, v, t, 0.0, math.copysign(1.0, v)) / mass
        for _ in range(0 if still else every):
            half = z + 0.5 * h * v
            a = gravity - bed.force(half, v + 0.5 * h * a, t + 0.5 * h, h, math.copysign(1.0, v)) / mass
            before, v = v, v + h * a
            z = half + 0.5 * h * v
            t += h
            if before * v <= 0.0 and bed.holds(z, t, mass * gravity):
                still = True
                break
    return {"time": np.arange(rows) / rate, "depth": depth, "other": accel}
