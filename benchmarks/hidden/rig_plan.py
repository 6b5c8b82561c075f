"""What is done on the made-up rig of `hidden_rig`: bed, drive, conditions, and what its sensors do wrong."""

import math
from dataclasses import dataclass, replace

import numpy as np

from experiments.runs.types import Json

from .rig_bed import Path, drive

__all__ = ["NUISANCES", "SIZES", "Rig", "Trial", "draw_rig"]

Random = np.random.Generator
NUISANCES = {"bed": 0.2, "force-zero": 0.2, "depth-zero": 0.15, "loud": 0.2}
"""How often what is wrong beside: K (and C) differ from trial to trial, zeros of pushes, noise 1.3 times as loud."""
SIZES = (0.012, 0.02, 0.032)
"""Diameters [m]; numbers of a bed are those of the middle one."""

_LOUD = 1.3
_MOST_ROWS = 1200


@dataclass(frozen=True)
class Trial:
    """What is done once, and what is this trial's own: factors on K and C, zeros [N, m], a moment of its way."""

    driven: bool
    speed: float
    size: float
    """Diameter [m]"""
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
    power: float
    """K and C go with this power of the diameter."""
    noise: dict[str, float]
    """Of depth [m], force [N], accel [m/s2], as stated."""
    louder: dict[str, float]
    persistence: dict[str, float]
    steps: dict[str, float]
    """Of readings that are quantised, 0 for those that are not."""
    jitter: float
    """Of the times, in rows."""
    gaps: bool
    only_depth: bool
    """Whether the accelerometer was not fitted."""
    small_units: bool
    wandering: dict[str, float]
    """Standard deviations of the nuisances from trial to trial."""
    drop_time: float
    flight: bool
    """Whether drops are recorded from before they touch."""
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
    must_return = bool({"plastic-sinkage", "adhesion", "shaft-friction"} & set(effects)) or outside == "relaxation"
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
    coarse = chance(0.2)
    rig = Rig(
        k=k, c=c, depth=depth, mass=mass, true_mass=mass, gravity=gravity, believed=believed, doubt=doubt,
        power=between(1.0, 2.0), noise=noise, louder=_louder(random, wandering["loud"]),
        persistence=_persistence(random), steps={name: std * between(0.4, 1.2) * coarse for name, std in noise.items()},
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


def _louder(random: Random, loud: float) -> dict[str, float]:
    which = str(random.choice(["force", "depth", "all"]))
    return {name: loud if loud and which in (name, "all", "force" if name == "accel" else "") else 1.0
            for name in ("depth", "force", "accel")}  # fmt: skip


def _persistence(random: Random) -> dict[str, float]:
    force = float(random.uniform(0.3, 0.8)) * bool(random.random() < 0.25)
    depth = float(random.uniform(0.3, 0.7)) * bool(random.random() < 0.2)
    return {"force": force, "accel": force, "depth": depth}


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
