"""What the kernels share: the terms' functions, the numbers that are known when they are compiled, small functions."""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
import linecache
import math
from types import SimpleNamespace
from typing import Any

from ..model import assemble, parameter_names
from ..terms import STATE_FIELDS, Term
from .columns import FIXED_NUMBERS

__all__ = ["make_parts"]

_SHARED = (
    "vertical", "tip_radius", "torque_factor", "inertia", "applied", "dry_friction", "inner_start", "inner",
    "crater_of", "contact", "arms", "divide", "MEMORY", "SHEDS", "HOLDS", "DRY", "INNER", "BETA", "HALF", "TURN_COS",
    "TURN_SIN", "TWICE_COS", "TWICE_SIN", "DIAGONAL", "NAN", "NEAR", "LAW", "LAW_SIZE", "load_parameters",
    "small_sine", "small_cosine", "state_of", "trial_state", "count",
)  # fmt: skip


def make_parts(terms: tuple[Term, ...], ground: str, count: int) -> SimpleNamespace:
    """For these effects on this ground, for platforms with `count` rows of spikes."""
    import taichi as ti

    model = assemble(terms, ground, taichi=True)
    names = parameter_names(terms)
    State = ti.types.struct(**dict.fromkeys(STATE_FIELDS, ti.f64))
    Parameters = ti.types.struct(**dict.fromkeys(names, ti.f64))
    LAW = len(FIXED_NUMBERS)
    LAW_SIZE = len(model.law.slots)
    load_parameters = _loader(names, Parameters, LAW + LAW_SIZE)
    vertical, tip_radius, torque_factor = model.vertical, model.tip_radius, model.torque_factor
    inertia, applied, dry_friction = model.inertia, model.applied, model.dry_friction
    inner_start, inner = model.inner_start, model.inner
    crater_of, contact, arms, divide = model.crater, model.contact, model.contact_arms, model.divide_mass
    MEMORY = model.has_memory
    SHEDS = model.law.has_memory or model.has("crater", "unload")
    HOLDS = model.has("hold", "rate_pull")
    DRY = model.has("vertical_friction", "rotation_friction")
    INNER = model.has("inner_mass")
    BETA = 2 * math.pi / count
    HALF = math.pi / count
    TURN_COS = [math.cos(k * BETA) for k in (-1, 0, 1)]
    TURN_SIN = [math.sin(k * BETA) for k in (-1, 0, 1)]
    TWICE_COS, TWICE_SIN = math.cos(2 * BETA), math.sin(2 * BETA)
    DIAGONAL = not model.has("mass", "up")  # then the mass matrix is the base model's, constant and diagonal
    SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(8)]
    COSINE = [(-1) ** k / math.factorial(2 * k) for k in range(9)]
    NAN = math.nan
    NEAR = 1e-12  # of a bound: less is rounding

    @ti.func
    def small_sine(a):
        b = a * a
        value = SINE[7]
        for k in ti.static(range(6, -1, -1)):
            value = value * b + SINE[k]
        return value * a

    @ti.func
    def small_cosine(a):
        b = a * a
        value = COSINE[8]
        for k in ti.static(range(7, -1, -1)):
            value = value * b + COSINE[k]
        return value

    @ti.func
    def state_of(touch, stick):
        state = 3
        if touch != 0:
            state = 2
            if stick != 0:
                state = 1
                if (stick & (stick - 1)) != 0:
                    state = 0
        return state

    @ti.func
    def trial_state(numbers: ti.template(), i):
        s = State(time=0.0)
        s.inner_mode = 1.0
        s.mass = numbers[i, 0]
        s.inertia = numbers[i, 1]
        s.length = numbers[i, 2]
        s.stance = numbers[i, 3]
        s.counterweight = numbers[i, 4]
        s.gravity = numbers[i, 5]
        s.weight = numbers[i, 6]
        return s

    own = locals()
    return SimpleNamespace(**{name: own[name] for name in _SHARED})


def _loader(names: tuple[str, ...], kind: Any, first: int) -> Any:
    """A Taichi function that reads the effects' parameters of trial i."""
    import taichi as ti

    fields = ", ".join(f"{name}=numbers[i, {first + k}]" for k, name in enumerate(names))
    text = f"def load(numbers: ti.template(), i):\n    return Parameters({fields})\n"
    file = f"<parameters {' '.join(names)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    scope: dict[str, Any] = {"ti": ti, "Parameters": kind}
    exec(compile(text, file, "exec"), scope)
    return ti.func(scope["load"])
