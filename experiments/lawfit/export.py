"""A fitted law for use without hedgebed: law.json, and law.py with functions that need Python alone.

law.py has the law itself, its parameters, those of the fits that leave out one bed each (for intervals), and the range
of the runs. With several tips and gravities it is the best dimensionless law.
"""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.grains.softening import PACKING
from experiments.runs.types import Json
from rigid.intervals import student
from rigid.result import write_json, write_text

from .data import Data, Foundation
from .dimensionless import CROSSED, CrossedLaw, shape_of, unit_force
from .fit import CONFIDENCE, LawFit
from .laws import Candidate
from .settings import say

__all__ = ["export_cell", "export_crossed"]

_HEAD = '''"""{title}
{about}

Made by hedgebed calibrate; needs Python alone. SI units. The force is that on the tip while it goes in. A call outside
RANGE, that of the fitted runs{of_tip}, warns.
"""

import math
import warnings

NUMBERS = {numbers}{names}
LEFT_OUT = [  # The same by fits without one bed each
    {left_out},
]
STUDENT_T = {t:.6g}  # 90 %, of as many beds
RANGE = {range}
'''

_TAIL = '''

def force({arguments}):
    """Force [N] at a depth [m] of the tip and a speed [m/s] going in."""
    _check({ranges}, {check_depth}, {check_speed})
    return {call}


def force_interval({arguments}):
    """90 % interval of the force [N], over beds."""
    _check({ranges}, {check_depth}, {check_speed})
    return _interval(lambda numbers: {call_of_numbers})


def tangent({arguments_of_load}):
    """K = dF/dz [N/m], C = dF/d(dz/dt) [N s/m] and depth [m] where the law bears a load [N]."""
    _check({ranges}, {check_load}, {check_speed})
    stiffness, damping, depth = _tangent(load, speed, NUMBERS{passed})
    _check({ranges}, {check_depth})
    return stiffness, damping, depth


def tangent_intervals({arguments_of_load}):
    """90 % intervals of K, C and depth of `tangent`, over beds."""
    _check({ranges}, {check_load}, {check_speed})
    depth = _tangent(load, speed, NUMBERS{passed})[2]
    _check({ranges}, {check_depth})
    return [_interval(lambda numbers: _tangent(load, speed, numbers{passed})[k]) for k in range(3)]


def _tangent(load, speed, numbers{parameters}):
    low, high = 1e-9, {deepest:.6g}
    if not {low_call} < load <= {high_call}:
        where = "the surface bears more" if {low_call} >= load else f"no depth down to {{high:g}} m bears it"
        raise ValueError(f"load = {{load:g}} N at speed = {{speed:g}} m/s: {{where}}")
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if {middle_call} >= load else (middle, high)
    z, by, fast = high, 1e-4 * high, 1e-4 * max(speed, 1e-6)
    stiffness = ({above} - {below}) / (2 * by)
    damping = ({faster} - {slower}) / fast
    return stiffness, damping, z


def _interval(of):
    value, others = of(NUMBERS), [of(numbers) for numbers in LEFT_OUT]
    std = math.sqrt((len(others) - 1) / len(others) * sum((other - value) ** 2 for other in others))
    return value - STUDENT_T * std, value + STUDENT_T * std


def _check(ranges, **values):
    for name, value in values.items():
        low, high = ranges[name]
        if not low * (1 - 1e-6) <= value <= high * (1 + 1e-6):
            text = f"{{name}} = {{value:g}} is outside {{low:g}} to {{high:g}}: the law is extrapolated"
            warnings.warn(text, stacklevel=3)
'''

_SCALED = '''

def _shape(tip, x):
    """Area of the tip in the plane of the surface over D^2, at depth x D."""
    if tip == "sphere":
        return math.pi * (x - x * x) if x < 0.5 else 0.25 * math.pi
    if tip.startswith("cone"):
        return math.pi * min(x * math.tan(math.radians(0.5 * float(tip[4:]))), 0.5) ** 2
    return 0.25 * math.pi


def _range(tip):
    if tip not in RANGE:
        raise ValueError(f"tip = {{tip!r}} is not one of {{tuple(RANGE)}}")
    return RANGE[tip]


def _force(depth, speed, p, tip, diameter, gravity):
    x, fr = max(depth, 0.0) / diameter, max(speed, 0.0) / math.sqrt(gravity * diameter)
    if x == 0:
        return 0.0
    area, unit = _shape(tip, x), BULK_DENSITY * gravity * diameter**3
    inertial = fr * GRAIN / diameter / math.sqrt({packing})
    return {formula}
'''
_STATIC = {
    "linear": 'p["k_" + tip] * x', "power": 'p["k_" + tip] * x ** p["n_" + tip]', "area": 'p["k"] * area * x ** p["n"]',
}  # fmt: skip
_RATE = {
    "damper": '({static} + p["c"] * fr)', "inertial": '{static} * (1 + p["a"] * inertial)',
    "square": '({static} + p["b"] * {drag}fr**2)',
    "early": '({static} + p["b"] * {drag}fr**2 * (math.exp(-x / (p["T"] * fr)) if fr > 0 else 0.0))',
}  # fmt: skip


_CHECKS = {"ranges": "RANGE", "check_depth": "depth=depth", "check_load": "load=load", "check_speed": "speed=speed"}
_CHECKS_SCALED = {
    "ranges": "_range(tip)", "check_depth": "depth_over_diameter=depth / diameter",
    "check_load": "load_over_rho_g_d3=load / (BULK_DENSITY * gravity * diameter**3)",
    "check_speed": "froude=speed / math.sqrt(gravity * diameter), diameter=diameter, gravity=gravity",
}  # fmt: skip
"""Numbers that a call compares with its range."""


def export_cell(fitted: LawFit[Candidate], laws: Sequence[Json], folder: Path) -> None:
    """Write law.json and law.py of one tip and gravity: `fitted` is the law, `laws` the entries of all."""
    candidate, data = fitted.candidate, fitted.data
    law, of = candidate.law, data.foundation
    functions = [inspect.getsource(function) for function in (law.loading, law.rate_force)]
    names = [function.__name__ for function in (law.loading, law.rate_force)]
    loading, rate = names
    extra = f"\n\n{functions[0]}" + (f"\n\n{functions[1]}" if rate != loading else "")
    extra += f"\n\ndef _force(depth, speed, p):\n    return {loading}(depth, p) + {rate}(depth, speed, p)\n"
    sets = [tuple(map(float, candidate.numbers(theta))) for theta in (fitted.theta, *fitted.left_out)]
    title = say("export_title", law=candidate.name, summary=law.summary, f=of, mm=1e3 * of.diameter)
    ranges = {"depth": _ends(data, "depth"), "speed": _speeds([data]), "load": _ends(data, "force")}
    text = _python(
        title,
        sets,
        ranges,
        extra,
        parameters=(),
        deepest=10 * float(data.depth.max()),
        names=f"  # {', '.join(law.slots)}",
    )
    about = {"law": candidate.name, "parameters": candidate.values(fitted.theta), "tip": of.tip, "laws": list(laws)}
    _write(folder, text, about | _of_foundation(of), ranges)


def export_crossed(fitted: LawFit[CrossedLaw], laws: Sequence[Json], cells: Mapping[str, Data], folder: Path) -> None:
    """Write law.json and law.py of all tips and gravities: `fitted` is the law, `laws` the entries of all."""
    law, datas = fitted.candidate, list(cells.values())
    of = datas[0].foundation
    static, rate = CROSSED[law.name]
    if static == "si":
        formula = 'p["stiffness"] * depth' + (' + p["damping"] * max(speed, 0.0)' if law.with_rate else "")
    else:
        drag = "area * " if static == "area" else ""
        formula = "unit * " + (
            _RATE[rate].format(static=_STATIC[static], drag=drag) if law.with_rate else _STATIC[static]
        )
    tips = tuple(dict.fromkeys(shape_of(data.foundation) for data in datas))
    density = sum(data.foundation.bulk_density for data in datas) / len(datas)
    constants = f"\nBULK_DENSITY = {density:.6g}  # kg/m3, of the beds\nGRAIN = {of.grain:.6g}  # m\n"
    sets = [dict(zip(law.free, theta.tolist(), strict=True)) for theta in (fitted.theta, *fitted.left_out)]
    ranges = {tip: _ranges([data for data in datas if shape_of(data.foundation) == tip]) for tip in tips}
    widest = max(data.foundation.diameter for data in datas)
    title = say("export_title_crossed", law=law.name, f=of, tips=", ".join(tips))
    extra = constants + _SCALED.format(formula=formula, packing=PACKING)
    text = _python(title, sets, ranges, extra, parameters=("tip", "diameter", "gravity"), deepest=10 * widest)
    about = {"law": law.name, "parameters": sets[0], "tips": tips, "laws": list(laws)}
    _write(folder, text, about | _of_foundation(of) | {"bulk_density": density}, ranges)


def _python(
    title: str,
    sets: Sequence[Any],
    ranges: Mapping[str, Any],
    extra: str,
    *,
    parameters: Sequence[str],
    deepest: float,
    names: str = "",
) -> str:
    """The text of law.py; `sets`: the numbers of the law, and those without each bed; `names`: what the numbers are."""
    passed = "".join(f", {name}" for name in parameters)

    def call(depth: str, speed: str, numbers: str = "numbers") -> str:
        return f"_force({depth}, {speed}, {numbers}{passed})"

    t = student(len(sets) - 2, CONFIDENCE)
    first, _, about = title.partition("\n")
    head = _HEAD.format(
        title=first, about=about, numbers=repr(sets[0]), names=names, left_out=",\n    ".join(map(repr, sets[1:])), t=t,
        range=repr(dict(ranges)), of_tip=" with a tip of this shape" if parameters else "",
    )  # fmt: skip
    tail = _TAIL.format(
        arguments=f"depth, speed=0.0{passed}", arguments_of_load=f"load, speed=0.0{passed}",
        passed=passed, **(_CHECKS_SCALED if parameters else _CHECKS),
        call=call("depth", "speed", "NUMBERS"), call_of_numbers=call("depth", "speed"), parameters=passed,
        deepest=deepest, low_call=call("low", "speed"), high_call=call("high", "speed"),
        middle_call=call("middle", "speed"), above=call("z + by", "speed"), below=call("z - by", "speed"),
        faster=call("z", "speed + fast"), slower=call("z", "speed"),
    )  # fmt: skip
    if parameters:  # they have no default, so they come before the speed
        tail = tail.replace(f"speed=0.0{passed}", f"{passed[2:]}, speed=0.0")
    return head + extra + tail


def _write(folder: Path, text: str, about: Json, ranges: Mapping[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "law.py", text)
    write_json(folder / "law.json", {"format": "hedgebed-law/1", **about, "range": ranges})


def _of_foundation(of: Foundation) -> Json:
    names = ("material", "diameter", "gravity", "grain", "bulk_density", "surface_friction")
    return {name: getattr(of, name) for name in names}


def _ends(data: Data, name: str) -> tuple[float, float]:
    return 0.0, float(getattr(data, name).max())


def _speeds(datas: Sequence[Data], unit: Callable[[Foundation], float] = lambda of: 1.0) -> tuple[float, float]:
    """Least and largest speed that was fitted, over `unit`; a drop has every speed down to 0."""
    found = [run.speed / unit(data.foundation) for data in datas for run in data.runs]
    drops = any(run.kind == "drop" for data in datas for run in data.runs)
    return 0.0 if drops else min(found), max(found)


def _ranges(datas: Sequence[Data]) -> Json:
    """Range of the runs of one shape: of numbers without dimensions, and of diameter and gravity."""
    foundations = [data.foundation for data in datas]
    return {
        "depth_over_diameter": (0.0, max(_ends(data, "depth")[1] / data.foundation.diameter for data in datas)),
        "froude": _speeds(datas, lambda of: math.sqrt(of.gravity * of.diameter)),
        "load_over_rho_g_d3": (0.0, max(_ends(data, "force")[1] / unit_force(data.foundation) for data in datas)),
        "diameter": (min(of.diameter for of in foundations), max(of.diameter for of in foundations)),
        "gravity": (min(of.gravity for of in foundations), max(of.gravity for of in foundations)),
    }
