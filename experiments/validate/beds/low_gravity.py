"""One ball in like beds from 9.81 down to 1e-5 m/s2: sunk from rest, at one Froude number, dropped as in experiments.

Without cohesion nothing but g gives hard grains a time or a stress. So depth over the ball's diameter D is a function
of v / sqrt(g D) and of ratios of lengths and densities alone. Slonaker & Kamrin 2017 state the same of any body where
grains are a frictional continuum, and there the grains' size has no effect either. The beds are prepared anew at each
gravity with the stiffness, step and criteria of settling that the bed chooses by itself: a constant tuned at 1 g would
show here.
"""

import math
from collections.abc import Sequence

import numpy as np

from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, listed, near_zero, tracked
from experiments.validate.base.drops import BEADS, Drop

from . import say

__all__ = ["CASES", "collapsed", "power_of"]

GRAIN, BALL = 0.02, 0.1  # diameters [m]: five grains across the ball
BOX = (2.5, 2.5, 1.75)  # of the bed, over D + d
STEEL, ALUMINIUM = 8065.0, 2700.0  # density of the ball: Katsuragi & Durian's; Murdoch's, taken as solid [kg/m3]
PLACES = ((0.25, 0.25), (0.75, 0.75), (0.25, 0.75), (0.75, 0.25))  # where it comes down, over the bed's sides
SWEEP = ((9.81, 1), (1e-5, 6))  # gravity [m/s2], seed: the ends of what a bed is for
FROUDE = 2.0
ACROSS: dict[int, tuple[float, tuple[int, ...]]] = {10: (9.81, (8,)), 14: (0.1, (7,))}
"""Grains across a ball, whose beds grow with it: gravity [m/s2] and seeds of the beds. 20 would take 112,000 grains."""
MURDOCH_GRAVITIES = ((1.0, 3), (0.2, 4))
MURDOCH_SPEEDS = (0.05, 0.1, 0.2, 0.4)
SUNDAY_GRAIN, SUNDAY_FROUDE = 0.01, (0.5, 1.0, 2.0, 4.0)  # beads of 1 cm: ten across the ball
SUNDAY_GRAVITIES = ((9.81, 11), (1e-3, 12))  # the ends of the published range [m/s2], seed
SUNDAY_BOX = (2.5, 2.5, 2.1)  # of the bed, over D + d
BAND = 0.1
LONGEST = 8.0  # over sqrt(D / g); one that still creeps then has come as far as it is taken to
MOSTLY = 0.9  # of its depth, for the time it takes


def setting(
    gravity: float, seed: int, at: tuple[float, float], density: float, speed: float, ball: float = BALL
) -> Drop:
    """One drop: SI units, ``at`` over the bed's sides."""
    size = tuple(share * (ball + GRAIN) for share in BOX)
    longest = LONGEST * math.sqrt(ball / gravity)
    return Drop(GRAIN, ball, density, size, gravity, seed, at, speed, longest)  # type: ignore[arg-type]


def power_of(x: Sequence[float], y: Sequence[float] | np.ndarray) -> float:
    """b of the least squares y = a x^b in logarithms [1]."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def collapsed(
    runs: Sequence[dict[str, np.ndarray]], lengths: Sequence[float], times: Sequence[float], count: int = 60
) -> tuple[np.ndarray, np.ndarray]:
    """Depth over length of each run at the same times over its unit: times [count], depths [runs, count].

    A ball that has stopped stays where it is.
    """
    last = max(run["time"][-1] / unit for run, unit in zip(runs, times, strict=True))
    grid = np.linspace(0, last, count)
    each = zip(runs, lengths, times, strict=True)
    return grid, np.array([np.interp(grid, run["time"] / unit, run["depth"] / length) for run, length, unit in each])


def _time_down(run: dict[str, np.ndarray]) -> float:
    """When the ball has gone most of its way [s]."""
    return float(np.interp(MOSTLY * run["depth"][-1], run["depth"], run["time"]))


_ACROSS = " x ".join(f"{share * (BALL + GRAIN) / GRAIN:.3g}" for share in BOX)
_ABOUT = say("beads", beads=BEADS, across=_ACROSS, grain=BALL / GRAIN)


def _name(gravity: float, seed: int) -> str:
    return f"{gravity:g} m/s2, bed {seed}"


def _sweep(speed_over: float) -> list[Drop]:
    return [setting(g, seed, at, STEEL, speed_over * math.sqrt(g * BALL)) for g, seed in SWEEP for at in PLACES]


def _means(values: Sequence[float]) -> list[float]:
    """Of each bed's places."""
    return [float(pair.mean()) for pair in np.asarray(values).reshape(-1, len(PLACES))]


def _sink(tell: Tell) -> Outcome:
    settings = _sweep(0.0)
    runs = [one.run() for one in tracked(settings, tell)]
    depths, times = [float(run["depth"][-1]) for run in runs], [_time_down(run) for run in runs]
    gravities, mean = [one.gravity for one in settings], float(np.mean(depths))
    rows = [
        Comparison(f"final depth over D, {_name(*bed)}", "1", mean / BALL, depth / BALL, BAND)
        for bed, depth in zip(SWEEP, _means(depths), strict=True)
    ]
    about = f"exponent of g in the time to {MOSTLY:g} of the depth"
    rows += [
        near_zero("exponent of g in the final depth", power_of(gravities, depths), 0.01),
        Comparison(about, "1", -0.5, power_of(gravities, times), 0.01, False),
    ]
    spread = np.std(depths, ddof=1) / mean
    curves = [Curve("mean", [min(gravities), max(gravities)], [mean / BALL] * 2, False)]
    curves.append(Curve("bed", gravities, np.array(depths) / BALL))
    plot = Plot("How deep a ball sinks from rest", "gravity [m/s2]", "depth over the ball's diameter [1]", curves, "x")
    remark = say(
        "from_rest", about=_ABOUT, steel=STEEL, spread=100 * spread, longest=LONGEST, count=len(runs),
        creeping=sum(not run["stopped"] for run in runs),
    )  # fmt: skip
    return Outcome(rows, [plot], [remark])


def _one_froude(tell: Tell) -> Outcome:
    settings = _sweep(FROUDE)
    runs = [one.run() for one in tracked(settings, tell)]
    lengths = [one.ball + GRAIN for one in settings]
    units = [math.sqrt(length / one.gravity) for length, one in zip(lengths, settings, strict=True)]
    grid, depths = collapsed(runs, lengths, units)
    beds = depths.reshape(-1, len(PLACES), len(grid)).mean(axis=1)
    mean = beds.mean(axis=0)
    final = float(mean[-1])
    names = [_name(*bed) for bed in SWEEP]
    rows = []
    for name, curve in zip(names, beds, strict=True):
        off = np.abs(curve - mean).max() / final
        rows.append(Comparison(f"final depth over D + d, {name}", "1", final, float(curve[-1]), BAND))
        rows.append(near_zero(f"largest difference over the final depth, {name}", off, BAND))
    curves = [Curve("mean of the sweep", grid, mean, False)]
    curves += [Curve(name, grid, curve) for name, curve in zip(names, beds, strict=True)]
    plot = Plot("One Froude number", "t sqrt(g / (D + d)) [1]", "depth over D + d [1]", curves)
    ends = depths[:, -1]
    remark = say(
        "at_one_froude", about=_ABOUT, froude=FROUDE, beds=len(SWEEP),
        scatter=100 * float(np.std(ends, ddof=1)) / final,
    )  # fmt: skip
    return Outcome(rows, [plot], [remark])


def _size(tell: Tell) -> Outcome:
    # The ball as grains' centres see it, D + d, is what scales (Kumar et al. 2017), and its mass with the cube of that.
    balls = [across * GRAIN for across in ACROSS]
    lengths = [ball + GRAIN for ball in balls]
    settings, units, each = [], [], []
    for (gravity, seeds), ball, length in zip(ACROSS.values(), balls, lengths, strict=True):
        density = STEEL * (length / lengths[0] * balls[0] / ball) ** 3
        speed = FROUDE * math.sqrt(gravity * length * balls[0] / lengths[0])
        drops = [setting(gravity, seed, at, density, speed, ball=ball) for seed in seeds for at in PLACES]
        settings += drops
        each += [length] * len(drops)
        units += [math.sqrt(length / gravity)] * len(drops)
    runs = [one.run() for one in tracked(settings, tell)]
    grid, depths = collapsed(runs, each, units)
    sizes = np.split(depths, np.cumsum([len(seeds) * len(PLACES) for _, seeds in ACROSS.values()])[:-1])
    means = [one.mean(axis=0) for one in sizes]
    names = [f"{across:g} grains across, {gravity:g} m/s2" for across, (gravity, _) in ACROSS.items()]
    largest, final = means[-1], float(means[-1][-1])
    rows = []
    for name, mean in zip(names[:-1], means[:-1], strict=True):
        rows.append(Comparison(f"final depth over D + d, {name}", "1", final, float(mean[-1]), BAND))
        off = float(np.abs(mean - largest).max()) / final
        rows.append(near_zero(f"largest difference over the final depth, {name}", off, BAND))
    curves = [Curve(names[-1], grid, largest, False)]
    curves += [Curve(name, grid, mean) for name, mean in zip(names[:-1], means[:-1], strict=True)]
    spread = [100 * float(one[:, -1].std(ddof=1)) / math.sqrt(len(one)) / float(one[:, -1].mean()) for one in sizes]
    counts = {one.ball: float(run["count"]) for one, run in zip(settings, runs, strict=True)}
    remark = say(
        "larger_ball", beads=BEADS, froude=FROUDE, across=listed(ACROSS, "g"), largest=max(ACROSS), drops=len(sizes[0]),
        beds=len(seeds), spread=listed(spread, ".0f"), counts=listed(counts.values(), ".0f"),
    )  # fmt: skip
    return Outcome(
        rows, [Plot("One Froude number", "t sqrt(g / (D + d)) [1]", "depth over D + d [1]", curves)], [remark]
    )


def _murdoch(tell: Tell) -> Outcome:
    settings = [
        setting(g, seed, at, ALUMINIUM, speed) for g, seed in MURDOCH_GRAVITIES for speed in MURDOCH_SPEEDS
        for at in PLACES
    ]  # fmt: skip
    runs = [one.run() for one in tracked(settings, tell)]
    shape, speeds = (len(MURDOCH_GRAVITIES), len(MURDOCH_SPEEDS)), np.array(MURDOCH_SPEEDS)
    depths = np.array(_means([run["depth"][-1] for run in runs])).reshape(shape)
    times = np.array(_means([_time_down(run) for run in runs])).reshape(shape)
    rows, curves = [], []
    for (g, _), row in zip(MURDOCH_GRAVITIES, depths, strict=True):
        line = np.polyfit(speeds, row, 1)
        left = ((row - np.polyval(line, speeds)) ** 2).sum() / ((row - row.mean()) ** 2).sum()
        rows.append(Comparison(f"R^2 of depth over speed, {g:g} m/s2", "1", 1.0, 1 - float(left), 0.02))
        curves += [Curve(f"line, {g:g} m/s2", speeds, 1e3 * np.polyval(line, speeds), False),
                   Curve(f"bed, {g:g} m/s2", speeds, 1e3 * row)]  # fmt: skip
    logs = np.log([[g] * len(speeds) for g, _ in MURDOCH_GRAVITIES]).ravel(), np.log(np.tile(speeds, shape[0]))
    terms = np.column_stack([np.ones(depths.size), *logs])
    of_depth, of_time = (np.linalg.lstsq(terms, np.log(found).ravel(), rcond=None)[0] for found in (depths, times))
    rows += [
        near_zero("exponent of g in the depth", of_depth[1], 0.1),
        near_zero("exponent of g in the duration", of_time[1], 0.1),
        near_zero("exponent of the speed in the duration", of_time[2], 0.1),
    ]
    remark = say("murdoch", about=_ABOUT, aluminium=ALUMINIUM)
    plot = Plot("A ball of 10 cm in low gravity", "speed [m/s]", "depth [mm]", curves)
    return Outcome(rows, [plot], [remark])


def _sunday(tell: Tell) -> Outcome:
    # Ten grains across: drops of two places and two beds scatter by less than the coarser ones above.
    size = tuple(share * (BALL + SUNDAY_GRAIN) for share in SUNDAY_BOX)
    settings = [
        Drop(
            SUNDAY_GRAIN, BALL, ALUMINIUM, size, g, seed, at, froude * math.sqrt(g * BALL),  # type: ignore[arg-type]
            LONGEST * math.sqrt(BALL / g),
        )
        for froude in SUNDAY_FROUDE for g, seed in SUNDAY_GRAVITIES for at in PLACES[:2]
    ]  # fmt: skip
    runs = [one.run() for one in tracked(settings, tell)]
    shape = (len(SUNDAY_FROUDE), len(SUNDAY_GRAVITIES), 2)
    depths = np.array([run["depth"][-1] / BALL for run in runs]).reshape(shape).mean(axis=2)
    times = [_time_down(run) * math.sqrt(one.gravity / BALL) for run, one in zip(runs, settings, strict=True)]
    lasts = np.array(times).reshape(shape).mean(axis=2)
    rows = []
    for what, found in (("depth over D", depths), ("duration sqrt(g / D)", lasts)):
        about = f"{what} at {SUNDAY_GRAVITIES[1][0]:g} over {SUNDAY_GRAVITIES[0][0]:g} m/s2, Fr"
        rows += [
            Comparison(f"{about} {froude:g}", "1", 1.0, float(low / high), BAND)
            for froude, (high, low) in zip(SUNDAY_FROUDE, found, strict=True)
        ]
    plots = []
    for what, found in (("depth over D [1]", depths), ("duration sqrt(g / D) [1]", lasts)):
        curves = [Curve("mean", SUNDAY_FROUDE, found.mean(axis=1), False)]
        curves += [Curve(f"bed, {g:g} m/s2", SUNDAY_FROUDE, found[:, k]) for k, (g, _) in enumerate(SUNDAY_GRAVITIES)]
        plots.append(Plot("A ball of 10 cm in beads of 1 cm", "v / sqrt(g D) [1]", what, curves))
    growth = [power_of(SUNDAY_FROUDE[a:b], depths.mean(axis=1)[a:b]) for a, b in ((0, 2), (2, 4))]
    remark = say(
        "sunday", grain=1e3 * SUNDAY_GRAIN, count=int(runs[0]["count"]), box=" x ".join(map("{:g}".format, SUNDAY_BOX)),
        aluminium=ALUMINIUM, beads=BEADS, slow=growth[0], fast=growth[1], many=len(runs),
    )  # fmt: skip
    return Outcome(rows, plots, [remark])


CASES = {"sink-from-rest": _sink, "gravity-sweep": _one_froude, "size-collapse": _size, "murdoch": _murdoch,
         "sunday": _sunday}  # fmt: skip
