"""Made-up campaigns of a laboratory's rig for `hedgebed bench diagnose --kind rig`.

A second generator beside `penetration`, unlike it in all that a person can do otherwise: how the drive moves,
how often a test is repeated, what the sensors do wrong, and the laws (`rig_bed`). Nulls and
effects alike get, by chance, nuisances that are no effect: beds that differ, zeros that are off, a sensor louder than
stated.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.campaign import Campaign, Recording
from experiments.runs.types import Json

from .penetration import EFFECTS as PLAIN
from .penetration import Hidden, correlated, draw_kind, tables_of
from .rig_bed import LAWS, Bed, Law, Path, draw_law, drive, drop, push

__all__ = ["EFFECTS", "NUISANCES", "OUTSIDE", "make_rig"]

Array = NDArray[np.float64]
Random = np.random.Generator
_Columns = dict[str, Array]
NUISANCES = {"bed": 0.2, "force-zero": 0.2, "depth-zero": 0.15, "loud": 0.2}
"""How often what is wrong beside: K (and C) differ from trial to trial, zeros of pushes, noise 1.3 times as loud."""
SIZES = (0.012, 0.02, 0.032)  # diameters [m]; numbers of a bed are those of the middle one

_LOUD = 1.3
_MOST_ROWS = 1200
EFFECTS = (*PLAIN, "relaxation")
OUTSIDE = ("collapse", "magnet", "cell-drift", "ringing", "rate", "wrong-mass")

_WRONG_MASS = 0.06
_HALVINGS = 9
_ONE_CURVE = {"depth-hardening", "layering"}
"""Two names for one curve of force over depth: no data could tell the two together from either alone."""


@dataclass(frozen=True)
class Trial:
    """What is done once, and what is this trial's own: factors on K and C, zeros [N, m], a moment of its way."""

    driven: bool
    speed: float
    size: float  # diameter [m]
    factor_k: float = 1.0
    factor_c: float = 1.0
    force_zero: float = 0.0
    depth_zero: float = 0.0
    event: float = 0.0
    path: Path | None = None
    rate: float = 1000.0


@dataclass(frozen=True)
class Rig:
    """What is true of the rig and its bed, and what is believed of them."""

    k: float
    c: float
    depth: float
    mass: float
    true_mass: float
    gravity: float
    believed: tuple[float, float]
    doubt: tuple[float, float]
    power: float  # K and C go with this power of the diameter
    noise: dict[str, float]  # of depth [m], force [N], accel [m/s2], as stated
    louder: dict[str, float]
    persistence: dict[str, float]
    steps: dict[str, float]  # of readings that are quantised, 0 for those that are not
    jitter: float  # of the times, in rows
    gaps: bool
    only_depth: bool  # whether the accelerometer was not fitted
    small_units: bool
    wandering: dict[str, float]  # standard deviations of the nuisances from trial to trial
    drop_time: float
    flight: bool  # whether drops are recorded from before they touch
    trials: tuple[Trial, ...]


def draw_rig(random: Random, effects: tuple[str, ...], outside: str | None, wanted: int | None) -> tuple[Rig, Json]:
    """A rig, its bed and its trials, and the design in words and numbers."""

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    def chance(share: float) -> bool:
        return bool(random.random() < share)

    k, depth, gravity = math.exp(between(math.log(300), math.log(4000))), between(0.01, 0.03), 9.80665
    mass = min(between(0.15, 0.8), 0.5 * k * depth / gravity)
    c = between(0.05, 0.3) * 2 * math.sqrt(k * mass)
    wandering = dict.fromkeys(NUISANCES, 0.0)
    sizes_of = {"bed": (0.01, 0.05), "force-zero": (0.3, 1.5), "depth-zero": (0.3, 1.0), "loud": (_LOUD, _LOUD)}
    for name, share in NUISANCES.items():
        size = between(*sizes_of[name])
        wandering[name] = size if chance(share) else 0.0
    if outside == "wrong-mass":
        wandering["bed"] = 0.0  # to a drop K/m and C/m are all: where K differs anyway, no data could tell m
    sizes = int(random.choice([1, 1, 1, 2, 3]))
    diameters = [SIZES[1]] if sizes == 1 else list(SIZES[:sizes])
    speeds = np.exp(np.linspace(math.log(between(0.001, 0.01)), math.log(between(0.06, 0.2)), 4 if chance(0.5) else 3))
    free = sizes > 1 or chance(0.2)
    doubt = (2.0, 2.0) if free else (0.1, 0.2)
    believed = (
        (k * math.exp(random.normal(0, 0.5)), c * math.exp(random.normal(0, 0.5))) if free
        else (k / max(1 + 0.1 * random.standard_normal(), 0.7), c / max(1 + 0.2 * random.standard_normal(), 0.4))
    )  # fmt: skip
    must_return = bool({"plastic-sinkage", "adhesion", "shaft-friction", "relaxation"} & set(effects))
    style = {
        "returns": must_return or chance(0.8), "above": 0.0 if chance(0.25) else between(0.001, 0.01),
        "hold": 0.0 if chance(0.25) else between(0.05, 1.0), "ramp": between(0.005, 0.05), "eased": chance(0.5),
        "back": 1.0 if chance(0.6) else between(0.3, 0.9), "out": between(0.5, 2.0) if chance(0.3) else 1.0,
        "rest": between(0.1, 0.4), "rate": float(random.choice([100.0, 200.0, 250.0, 500.0])),
        "shallower": between(0.6, 0.9) if chance(0.25) else 1.0,
    }  # fmt: skip
    alike = int(random.choice([1, 1, 2, 3]))
    drops = int(random.integers(2, 7)) if outside == "wrong-mass" or chance(0.45) else 0
    conditions = [(float(speed), size) for speed in speeds for size in diameters]
    while len(conditions) * alike > 15 and len(conditions) > 4:
        conditions.pop(int(random.integers(1, len(conditions) - 1)))
    alike = max(1, min(alike, 15 // len(conditions)))
    plan = [one for one in conditions for _ in range(alike)]
    if wanted:
        drops = min(drops, wanted // 2)
        plan = [plan[index % len(plan)] for index in range(wanted - drops)]
    while len(plan) + drops < 6:
        plan.append(conditions[len(plan) % len(conditions)])
    trials = [Trial(True, round(speed, 5), size) for speed, size in plan]
    fall = np.linspace(between(0.3, 0.5), between(0.7, 1.0), max(2, drops // min(alike, 2)))
    heights = np.minimum(fall * depth * math.sqrt(k / mass), 1.2)
    trials += [Trial(False, round(float(heights[n % len(heights)]), 4), diameters[-1]) for n in range(drops)]
    noise = {"depth": 10 ** between(math.log10(2e-5), -4.0), "force": k * depth * 10 ** between(-2.6, -1.8),
             "accel": 10 ** between(-1.3, -0.5)}  # fmt: skip
    coarse, power, loud = chance(0.2), between(1.0, 2.0), wandering["loud"] or 1.0
    which = str(random.choice(["force", "depth", "all"]))
    louder = dict.fromkeys(("depth", "force", "accel"), 1.0)
    louder |= dict.fromkeys({"force": ("force", "accel"), "depth": ("depth",)}.get(which, louder), loud)
    force, of_depth = between(0.3, 0.8) * chance(0.25), between(0.3, 0.7) * chance(0.2)
    rig = Rig(
        k=k, c=c, depth=depth, mass=mass, true_mass=mass, gravity=gravity, believed=believed, doubt=doubt,
        power=power, noise=noise, louder=louder, persistence={"force": force, "accel": force, "depth": of_depth},
        steps={name: std * between(0.4, 1.2) * coarse for name, std in noise.items()},
        jitter=between(0.05, 0.15) if chance(0.15) else 0.0, gaps=chance(0.2), only_depth=chance(0.2),
        small_units=chance(0.3), wandering=wandering, drop_time=between(0.08, 0.25),
        flight=outside != "magnet", trials=(),
    )  # fmt: skip
    both = chance(0.6)  # whether C differs with K
    made = tuple(_own(random, rig, trial, style, both=both) for trial in trials)
    if rig.only_depth:
        style["only depth"] = True
    words = {"replicates": alike, "speeds": speeds.round(5).tolist(), "diameters": diameters, "drops": drops}
    return replace(rig, trials=made), {"design": words | style, "sensors": {
        "coarse": coarse, "persistence": rig.persistence, "jitter": rig.jitter, "gaps": rig.gaps,
        "small units": rig.small_units, "noise": noise}}  # fmt: skip


def _own(random: Random, rig: Rig, trial: Trial, style: Json, *, both: bool) -> Trial:
    """The trial with what is its own, and its path."""
    bed, (f, g, h) = rig.wandering["bed"], random.standard_normal(3)
    luck, shallow = random.random(), random.random() < 0.4
    trial = replace(trial, factor_k=1 + bed * float(f), factor_c=1 + bed * float(f) * both)
    if not trial.driven:
        return trial
    depth = rig.depth * (style["shallower"] if shallow else 1.0)
    way, out = depth + style["above"], trial.speed * style["out"]
    segments = [(0.0, style["rest"]), (trial.speed, way / trial.speed), (0.0, style["hold"])]
    if style["returns"]:
        segments += [(-out, style["back"] * way / out), (0.0, 0.1)]
    total = sum(lasts for _, lasts in segments)
    rate = min(max(style["rate"], min(500.0, 40 * trial.speed / depth)), _MOST_ROWS / total)
    step = 1.0 / (rate * max(1, math.ceil(3000 / (rate * total))))
    path = drive(segments, -style["above"], style["ramp"], eased=style["eased"], step=step)
    late = path.stops if luck < 0.5 else luck * total
    return replace(
        trial, path=path, rate=rate, event=late, force_zero=rig.wandering["force-zero"] * rig.noise["force"] * float(g),
        depth_zero=rig.wandering["depth-zero"] * rig.noise["depth"] * float(h),
    )  # fmt: skip


def make_rig(
    seed: int, *, kind: str | None = None, strength: float | None = None, trials: int | None = None,
    law: str | None = None,
) -> tuple[Campaign, Hidden]:  # fmt: skip
    """A campaign, its columns in the units of its files (some in mm and ms: write it, and read it), and what is hidden.

    `kind`: None draws one; else ``null``, an effect's id, ``pair`` or one of `OUTSIDE`. `strength`: the signature aimed
    at, over the noise. `trials`: how many; None draws 6 to 21. `law`: the kind of the effect's law (`LAWS`).

    The signature is the root mean square of what the effect changes over the noise. It leaves out what K, C and the
    nuisances that are there may explain within their standard deviations. `Hidden.extra["left"]` has for each trial the
    chi-square, with the stated noise, that motion and forces themselves leave of the recording, and the number of
    readings: zeros, jitter and noise louder than stated are in it, and no law can leave less.
    """
    random = np.random.default_rng((seed, 20))
    kind = kind or draw_kind(random, EFFECTS, OUTSIDE, nulls=0.22)
    if kind not in ("null", "pair", *EFFECTS, *OUTSIDE):
        raise ValueError(f"kind = {kind!r}: null, pair, {', '.join((*EFFECTS, *OUTSIDE))} was expected")
    strength = strength if strength is not None else float(np.exp(random.uniform(math.log(0.7), math.log(50.0))))
    effects = (kind,) if kind in EFFECTS else ()
    while kind == "pair" and (not effects or set(effects) == _ONE_CURVE):
        effects = tuple(str(e) for e in random.choice(EFFECTS, 2, replace=False))
    outside = kind if kind in OUTSIDE else None
    rig, design = draw_rig(random, effects, outside, trials)
    names = [*effects, *([outside] if outside in LAWS else [])]
    laws = [draw_law(random, name, rig.depth, law if name == kind else None) for name in names]
    clean = [_moved(rig, trial) for trial in rig.trials]
    made, amplitude, measure = clean, 0.0, 0.0
    if outside == "wrong-mass":
        rig = replace(rig, true_mass=rig.mass * (1.0 + float(random.choice([-1, 1])) * _WRONG_MASS))
        made = [_moved(rig, trial) for trial in rig.trials]
    elif laws:
        amplitude = _amplitude(rig, laws, clean, strength)
        made = [_moved(rig, trial, laws, amplitude) for trial in rig.trials]
    if made is not clean:
        slopes = [_slopes(rig, *pair) for pair in zip(rig.trials, clean, strict=True)]
        measure = _signature(rig, list(zip(rig.trials, clean, made, slopes, strict=True)))
    campaign, left = _record(random, rig, made)
    parameters = {f"{own.name}.{key}": value for own in laws for key, value in own.numbers.items()}
    coloured = rig.persistence["force"] > 0.0
    extra = design | {
        "laws": {own.name: own.kind for own in laws}, "nuisances": rig.wandering, "louder": rig.louder,
        "k": rig.k, "c": rig.c, "drawn": [[t.factor_k, t.factor_c, t.force_zero, t.depth_zero] for t in rig.trials],
        "left": left,
    }  # fmt: skip
    return campaign, Hidden(effects, outside, parameters | {"amplitude": amplitude}, measure, coloured,
                            len(clean), rig.persistence["depth"], extra)  # fmt: skip


def _moved(rig: Rig, trial: Trial, laws: Sequence[Law] = (), amplitude: float = 0.0, k: float = 1.0, c: float = 1.0
           ) -> _Columns:  # fmt: skip
    """A trial without noise, zeros or rows, K and C times `k` and `c`: time, depth, and force or acceleration."""
    size = trial.size / SIZES[1]
    grown = size**rig.power
    bed = Bed(
        rig.k * grown * trial.factor_k * k, rig.c * grown * trial.factor_c * c, laws, amplitude,
        full=rig.k * rig.depth, size=size, event=trial.event,
    )  # fmt: skip
    if trial.path is not None:
        return {"time": trial.path.time, "depth": trial.path.depth, "other": push(bed, trial.path)}
    return drop(bed, mass=rig.true_mass, gravity=rig.gravity, speed=trial.speed, duration=rig.drop_time,
                rate=trial.rate)  # fmt: skip


def _amplitude(rig: Rig, laws: Sequence[Law], clean: Sequence[_Columns], strength: float) -> float:
    """The amplitude with the signature aimed at, by halving its logarithm: one trial of each condition is looked at."""
    first: dict[tuple[bool, float, float], int] = {}
    for index, trial in enumerate(rig.trials):
        first.setdefault((trial.driven, trial.speed, trial.size), index)
    few = [(rig.trials[index], clean[index]) for index in sorted(first.values())]
    known = [(*pair, _slopes(rig, *pair)) for pair in few]
    low, high = math.log(1e-4), math.log(30.0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        made = [(trial, one, _moved(rig, trial, laws, math.exp(middle)), slopes) for trial, one, slopes in known]
        low, high = (middle, high) if _signature(rig, made) < strength else (low, middle)
    return math.exp(0.5 * (low + high))


def _noise(rig: Rig, trial: Trial) -> dict[str, float]:
    """Of the columns that tell something. Where a push's depth is wrong by its noise, its force is by a tenth of K
    times that, for a path is smooth."""
    true = {name: std * rig.louder[name] for name, std in rig.noise.items()}
    if trial.driven:
        return {"other": math.hypot(true["force"], 0.1 * rig.k * (trial.size / SIZES[1]) ** rig.power * true["depth"])}
    return {"depth": true["depth"]} | ({} if rig.only_depth else {"other": true["accel"]})


def _over_noise(rig: Rig, trial: Trial, columns: _Columns) -> Array:
    """Those columns over their noise, one after the other, of some 400 rows each."""
    every = max(1, len(columns["other"]) // 400)
    return np.concatenate([columns[name][::every] / std for name, std in _noise(rig, trial).items()])


def _slopes(rig: Rig, trial: Trial, clean: _Columns) -> dict[str, Array]:
    """What one standard deviation of all that is uncertain changes, over the noise; a * is this trial's own."""
    raw: dict[str, _Columns] = {}
    if trial.path is not None:
        inside, grown = clean["depth"] > 0, (trial.size / SIZES[1]) ** rig.power
        damper = np.maximum(trial.path.speed, 0.0) * inside
        damper *= rig.c * grown * trial.factor_c
        raw = {"k": {"other": clean["other"] - damper}, "c": {"other": damper}}
    for what in ("k", "c") if trial.path is None else ():
        nudged = _moved(replace(rig, true_mass=rig.mass), trial, **{what: 1.01})
        raw[what] = {name: (nudged[name] - clean[name]) / 0.01 for name in ("depth", "other")}
    wandering, found = rig.wandering, {}
    for (what, columns), doubt in zip(raw.items(), rig.doubt, strict=True):
        slope = _over_noise(rig, trial, columns)
        found[f"{what} {trial.size}"] = doubt * slope
        found[f"{what} *"] = wandering["bed"] * (what == "k" or trial.factor_c != 1.0) * slope
    if trial.path is not None:
        force = {"other": np.full(len(inside), wandering["force-zero"] * rig.noise["force"])}
        depth = {"other": inside * (rig.k * grown) * wandering["depth-zero"] * rig.noise["depth"]}
        found |= {"force *": _over_noise(rig, trial, force), "depth *": _over_noise(rig, trial, depth)}
    return {name: slope for name, slope in found.items() if slope.any()}


def _signature(rig: Rig, trials: Sequence[tuple[Trial, _Columns, _Columns, dict[str, Array]]]) -> float:
    """sqrt(d' S^-1 d / n): d the change over the noise, S = 1 + X X' with the slopes X of all that is uncertain to
    first order, times its standard deviations (S^-1 by Woodbury's identity)."""
    changes = [
        _over_noise(rig, trial, {name: made[name] - clean[name] for name in ("depth", "other")})
        for trial, clean, made, _ in trials
    ]
    d = np.concatenate(changes)
    columns: dict[str, Array] = {}
    start = 0
    for number, (change, (*_, slopes)) in enumerate(zip(changes, trials, strict=True)):
        for name, slope in slopes.items():
            column = columns.setdefault(name.replace("*", f"of {number}"), np.zeros(len(d)))
            column[start : start + len(slope)] = slope
        start += len(change)
    x = np.column_stack(list(columns.values()))
    explained = x.T @ d
    left = float(d @ d) - float(explained @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, explained))
    return math.sqrt(max(left, 0.0) / len(d))


def _record(random: Random, rig: Rig, made: Sequence[_Columns]) -> tuple[Campaign, list[tuple[float, int]]]:
    """The campaign, and what the truth leaves of each trial."""
    trials, recordings, left = [], {}, []
    for number, (trial, data) in enumerate(zip(rig.trials, made, strict=True), 1):
        name = f"{'p' if trial.driven else 'd'}{number:02d}"
        trials.append({"id": name, "mode": "driven" if trial.driven else "drop", "gravity": rig.gravity,
                       "speed": trial.speed, "diameter": trial.size, "data": f"{name}.csv"})  # fmt: skip
        recordings[name, "data"] = _read_off(random, rig, trial, data, gaps=rig.gaps and number % 2 == 0)
        left.append(_left(rig, trial, data, recordings[name, "data"]))
    shape = str(random.choice(["sphere", "flat", "cone"]))
    spike = {"mass": rig.mass, "diameter": SIZES[1], "tip": shape} | ({"cone_angle": 60.0} if shape == "cone" else {})
    return Campaign(tables_of("a rig", spike, rig.believed, rig.doubt, rig.noise, trials), recordings), left


def _left(rig: Rig, trial: Trial, data: _Columns, read: Recording) -> tuple[float, int]:
    """Chi-square of the readings that count (force; of a drop depth and acceleration) about the truth at the times that
    stand beside them, with the stated noise, and how many they are."""
    time = read["t_ms"] / 1e3 if rig.small_units else read["t_s"]
    total, count = 0.0, 0
    for name, usual, small, factor in (
        ("depth", "depth_m", "depth_mm", 1e-3),
        ("force", "force_N", "force_mN", 1e-3),
        ("accel", "accel_m_s2", "accel_g", 9.80665),
    ):
        label = small if rig.small_units else usual
        if label not in read.columns or (name == "depth" and trial.driven):
            continue
        value, column = read[label] * (factor if rig.small_units else 1.0), data.get(name, data["other"])
        off = (value - np.interp(time, data["time"], column))[time >= 0.0] / rig.noise[name]
        off = off[np.isfinite(off)]
        total, count = total + float(off @ off), count + len(off)
    return total, count


def _read_off(random: Random, rig: Rig, trial: Trial, data: _Columns, *, gaps: bool) -> Recording:
    """What the sensors make of it, in the columns and units of the file."""
    end = float(data["time"][-1])
    time = np.arange(0.0, end, 1 / trial.rate)
    when = np.clip(time + rig.jitter / trial.rate * random.standard_normal(len(time)), 0.0, end)
    what = "force" if trial.driven else "accel"
    depth, other = np.interp(when, data["time"], data["depth"]), np.interp(when, data["time"], data["other"])
    if not trial.driven and rig.flight:
        flight = np.arange(-int(random.integers(0, 20)), 0) / trial.rate  # rows before it touches
        time = np.concatenate([flight, time])
        depth = np.concatenate([trial.speed * flight + 0.5 * rig.gravity * flight**2, depth])
        other = np.concatenate([np.full(len(flight), rig.gravity), other])
    read = {}
    for name, true, zero in (("depth", depth, trial.depth_zero), (what, other, trial.force_zero)):
        noise = correlated(random.standard_normal(len(true)), rig.persistence[name])
        value, step = true + zero + rig.noise[name] * rig.louder[name] * noise, rig.steps[name]
        read[name] = np.round(value / step) * step if step else value
    if gaps:
        first = int(0.35 * len(time))
        read[what][first : first + max(6, len(time) // 25)] = np.nan
        read["depth"][random.random(len(time)) < 0.02] = np.nan
    if rig.only_depth and not trial.driven:
        read[what][:] = np.nan
    if rig.small_units:
        name, factor = ("force_mN", 1e3) if trial.driven else ("accel_g", 1 / 9.80665)
        return Recording({"t_ms": 1e3 * time, "depth_mm": 1e3 * read["depth"], name: factor * read[what]})
    return Recording({"t_s": time, "depth_m": read["depth"], "force_N" if trial.driven else "accel_m_s2": read[what]})
