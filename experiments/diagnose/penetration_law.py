"""The force of a bed on a spike that goes straight down, with every effect of the library, compiled by Taichi.

Base: F = K z + C max(0, v) for depth z > 0, and 0 above; v = dz/dt, downwards positive; F positive upwards. A drop
obeys m z'' = m g - F. Each effect adds to the loading curve h(z), which is K z in the base model, to what is left of it
when the spike comes back (`top` is the deepest depth since it last entered, `deepest` the deepest ever), or to what
depends on the rate. At amplitude 0 an effect changes nothing. `SLOTS` names the numbers of a lane; D is `reference`, a
depth typical of the campaign, so that amplitudes of one effect's forms compare.

A drop is integrated by the classical Runge-Kutta method, each step cut where the spike turns, leaves or comes back
(found by halving), since friction and damper jump there. At a turning point the forces of both directions are tried:
where neither moves the spike, it rests for good.

Friction that is mobilised over a way (`shaft_held`) is a share w of its bound, dw = (sign(dz) - w) |dz| / reach (Dahl,
A solid friction model, TOR-0158(3107-18)-1, Aerospace Corp., 1968, with exponent 1): it stays while the spike is held.
From where the way last turned on, w is an exponential of the depth.
"""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
import linecache
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid.model import _for_taichi as for_taichi
from rigid.runtime import ensure
from rigid.terms import STATE_FIELDS, Term

from .own import OwnEffect

__all__ = ["PHASES", "SLOTS", "fall", "push", "slot_table"]

SLOTS = (
    "mass", "gravity", "stiffness", "damping", "reference", "speed_scale", "radius_depth",
    "hardening_power", "hardening_quadratic", "hardening_cubic", "hardening_exponential",
    "hardening_early", "hardening_reach", "hardening_level", "hardening_sharpness",
    "hardening_steeper", "hardening_locking",
    "layer_depth", "layer_width", "layer_slope", "layer_step", "layer_factor", "layer_bump",
    "crater_share", "crater_bend", "crater_open", "unload_stiffness",
    "drag", "drag_onset", "drag_reach", "drag_sharpness", "drag_deep", "drag_both", "drag_tip",
    "shaft", "shaft_deep", "shaft_power", "shaft_viscous", "shaft_slow", "shaft_speed",
    "shaft_held", "shaft_reach", "shaft_growth", "shaft_onset", "shaft_sharpness", "shaft_rise",
    "pull", "pull_reach", "pull_deep", "pull_growth", "pull_ever", "pull_short", "pull_viscous",
    "pull_sharpness", "pull_fade", "pull_fade_sharpness", "pull_out", "pull_let",
    "shift_depth", "shift_row", "shift_speed",
)  # fmt: skip
"""Numbers of a lane, in order. `radius_depth`: depth at which the tip is wholly in; `speed_scale`: below it the
direction of a driven spike is not certain; shifts: added to a driven spike's path, for derivatives (`shift_row`: to the
depth of each row alone, all that came before it as it was)."""
PHASES = ("free", "in", "rest", "out")

_SLOT = {name: place for place, name in enumerate(SLOTS)}
_NEVER_ZERO = {"reference": 0.01, "speed_scale": 1e-4, "radius_depth": 1e-4, "layer_depth": 0.01, "layer_width": 1e-3,
               "hardening_reach": 1e-3, "drag_reach": 1e-3, "pull_reach": 1e-3, "shaft_speed": 1e-2,
               "shaft_reach": 1e-3}  # fmt: skip
_STEP = 5e-4
"""Longest step of a drop [s]: sqrt(m / K) of a spike on sand is tens of ms, so the error is below 1e-8 of the depth;
`fall` takes shorter ones where a lane is stiffer."""

_SETTLED = 1e-3
"""Speed [m/s] at which a spike that comes back to a surface that bears it stays there: it would hop by 5e-8 m."""


def slot_table(count: int, own: Sequence[OwnEffect] = ()) -> NDArray[np.float64]:
    """Numbers of `count` lanes, shape [count, slot_count]: nothing acts, and no length is zero.

    Behind `SLOTS` stand the parameters of effects from files, in order.
    """
    off = [e.off if p.name == e.amplitude else e.typical[p.name] for e in own for p in e.term.parameters]
    table = np.zeros((count, len(SLOTS) + len(off)))
    table[:, len(SLOTS) :] = off
    for name, value in _NEVER_ZERO.items():
        table[:, _SLOT[name]] = value
    return table


def push(numbers: NDArray[np.float64], lane_path: NDArray[np.int32], starts: NDArray[np.int32],
         depth: NDArray[np.float64], speed: NDArray[np.float64],
         own: tuple[OwnEffect, ...] = ()) -> NDArray[np.float64]:  # fmt: skip
    """Forces [N] of driven spikes along given paths.

    Args:
        numbers: Shape [lane_count, slot_count].
        lane_path: Which path a lane follows, shape [lane_count].
        starts: First row of each path and the row after the last, shape [path_count + 1].
        depth, speed: The paths [m, m/s], one after another.
        own: Effects from files, whose parameters `numbers` holds.

    Returns:
        Shape [lane_count, longest path]; 0 beyond a path's end.
    """
    ensure()
    longest = int(np.diff(starts).max())
    out = np.zeros((len(numbers), longest))
    kernel = _kernels(tuple(effect.term for effect in own))[0]
    kernel(np.ascontiguousarray(numbers), lane_path.astype(np.int32), starts.astype(np.int32), depth, speed, out)
    return out


def fall(numbers: NDArray[np.float64], lane_path: NDArray[np.int32], starts: NDArray[np.int32],
         times: NDArray[np.float64], speeds: NDArray[np.float64],
         own: tuple[OwnEffect, ...] = ()) -> NDArray[np.float64]:  # fmt: skip
    """Motions of dropped spikes, at depth 0 at t = 0.

    Args:
        numbers: Shape [lane_count, slot_count].
        lane_path: Which trial a lane is, shape [lane_count].
        starts: As of `push`.
        times: The trials' sample times [s], rising, one trial after another; before 0 in free flight.
        speeds: Speed at the surface of each trial [m/s].
        own: As of `push`.

    Returns:
        Depth [m], speed [m/s], acceleration [m/s2] and phase (place in `PHASES`), shape [lane_count, longest, 4]. NaN
        depths where a motion leaves all bounds.
    """
    ensure()
    longest = int(np.diff(starts).max())
    out = np.zeros((len(numbers), longest, 4))
    held = np.abs(numbers[:, _SLOT["shaft_held"]]) / numbers[:, _SLOT["shaft_reach"]]
    rate = np.sqrt((np.maximum(numbers[:, _SLOT["stiffness"]], 1e-9) + held) / numbers[:, _SLOT["mass"]])
    rate += np.abs(numbers[:, _SLOT["damping"]]) / numbers[:, _SLOT["mass"]]
    steps = np.minimum(_STEP, 0.05 / rate)
    _kernels(tuple(effect.term for effect in own))[1](
        np.ascontiguousarray(numbers), lane_path.astype(np.int32), starts.astype(np.int32), times, speeds, steps, out
    )
    return out


def _own_functions(own: tuple[Term, ...]) -> tuple[Any, Any]:
    """What effects from files make of the spring's force, and the force that they add, compiled by Taichi.

    The text is written out, a line a hook, as `rigid.model` does it for tumbles.
    """
    import taichi as ti

    names: dict[str, Any] = {"ti": ti}
    spring = ["def own_spring(s, z, spring, n: ti.template(), k):", "    force = spring"]
    force = ["def own_force(s, z, v, most, n: ti.template(), k):", "    total = 0.0"]
    at = len(SLOTS)
    for place, term in enumerate(own):
        column = {p.name: f"n[k, {at + number}]" for number, p in enumerate(term.parameters)}
        at += len(term.parameters)
        for hook, function in term.hooks.items():
            names[f"{hook}_{place}"] = for_taichi(function)
            told = "".join(f", {column[argument]}" for argument in term.arguments(hook))
            if hook == "stiffen":
                spring += [f"    force, work = stiffen_{place}(z, force, 0.0{told})"]
            elif hook == "rate_force":
                force += [f"    total = total + rate_force_{place}(s, z, v{told})"]
            else:
                force += [f"    pull, held = hold_{place}(s, z, most{told})", "    total = total - pull"]
    text = "\n".join([*spring, "    return force\n", *force, "    return total\n"])
    file = f"<effects {'+'.join(term.id for term in own) or 'none'} {id(own):x}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # where Taichi reads it
    exec(compile(text, file, "exec"), names)
    return ti.func(names["own_spring"]), ti.func(names["own_force"])


@lru_cache(maxsize=8)
def _kernels(own: tuple[Term, ...]) -> tuple[Any, Any]:
    import taichi as ti

    State = ti.types.struct(**dict.fromkeys(STATE_FIELDS, ti.f64))
    own_spring, own_force = _own_functions(own)
    OWN, SETTLED = len(own) > 0, _SETTLED
    S = _SLOT  # compile-time constants
    MASS, GRAVITY, STIFFNESS, DAMPING = S["mass"], S["gravity"], S["stiffness"], S["damping"]
    REFERENCE, SPEED_SCALE, RADIUS_DEPTH = S["reference"], S["speed_scale"], S["radius_depth"]
    POWER, QUADRATIC, CUBIC = S["hardening_power"], S["hardening_quadratic"], S["hardening_cubic"]
    EXPONENTIAL, EARLY, EARLY_REACH = S["hardening_exponential"], S["hardening_early"], S["hardening_reach"]
    STEEPER, LOCKING = S["hardening_steeper"], S["hardening_locking"]
    LEVEL, LEVEL_SHARPNESS = S["hardening_level"], S["hardening_sharpness"]
    LAYER_DEPTH, LAYER_WIDTH, LAYER_SLOPE = S["layer_depth"], S["layer_width"], S["layer_slope"]
    LAYER_STEP, LAYER_FACTOR, LAYER_BUMP = S["layer_step"], S["layer_factor"], S["layer_bump"]
    BEND, OPEN = S["crater_bend"], S["crater_open"]
    CRATER, UNLOAD = S["crater_share"], S["unload_stiffness"]
    DRAG, DRAG_DEEP, DRAG_BOTH, DRAG_TIP = S["drag"], S["drag_deep"], S["drag_both"], S["drag_tip"]
    DRAG_ONSET, DRAG_REACH, DRAG_SHARPNESS = S["drag_onset"], S["drag_reach"], S["drag_sharpness"]
    SHAFT, SHAFT_DEEP, SHAFT_POWER, SHAFT_VISCOUS, SHAFT_SLOW, SHAFT_SPEED = (
        S["shaft"], S["shaft_deep"], S["shaft_power"], S["shaft_viscous"], S["shaft_slow"], S["shaft_speed"],
    )  # fmt: skip
    SHAFT_HELD, SHAFT_REACH, SHAFT_GROWTH = S["shaft_held"], S["shaft_reach"], S["shaft_growth"]
    SHAFT_ONSET, SHAFT_SHARPNESS, SHAFT_RISE = S["shaft_onset"], S["shaft_sharpness"], S["shaft_rise"]
    PULL, PULL_REACH, PULL_DEEP, PULL_SHORT, PULL_VISCOUS = (
        S["pull"], S["pull_reach"], S["pull_deep"], S["pull_short"], S["pull_viscous"],
    )  # fmt: skip
    PULL_GROWTH, PULL_EVER, SHARPNESS = S["pull_growth"], S["pull_ever"], S["pull_sharpness"]
    FADE, FADE_SHARPNESS, PULL_OUT = S["pull_fade"], S["pull_fade_sharpness"], S["pull_out"]
    LET = S["pull_let"]
    SHIFT_DEPTH, SHIFT_ROW, SHIFT_SPEED = S["shift_depth"], S["shift_row"], S["shift_speed"]
    Table = ti.types.ndarray(dtype=ti.f64, ndim=2)
    Line = ti.types.ndarray(dtype=ti.f64, ndim=1)
    Whole = ti.types.ndarray(dtype=ti.i32, ndim=1)
    Cube = ti.types.ndarray(dtype=ti.f64, ndim=3)

    @ti.func
    def mobilised(share: ti.f64, sharpness: ti.f64) -> ti.f64:
        """Of a bound, `share` being the way over its reach: 1 - exp(-x), or x / (1 + x^p)^(1/p) of a sharpness p."""
        part = 1.0 - ti.exp(-share)
        if sharpness > 0.0:
            part = share / ti.pow(1.0 + ti.pow(ti.max(share, 1e-12), sharpness), 1.0 / sharpness)
        return part

    @ti.func
    def loading(z: ti.f64, n: ti.template(), k: ti.i32) -> ti.f64:
        depth = ti.max(z, 0.0)
        x = depth / n[k, REFERENCE]
        grown = n[k, STIFFNESS] * depth
        if n[k, POWER] != 0.0:
            grown *= ti.pow(ti.max(x, 1e-9), n[k, POWER])
        if n[k, EXPONENTIAL] != 0.0:
            rise = n[k, EXPONENTIAL] * x
            if ti.abs(rise) > 1e-6:
                grown *= (ti.exp(ti.min(rise, 30.0)) - 1.0) / rise
        if n[k, LEVEL] * x > 1e-6:
            grown *= mobilised(n[k, LEVEL] * x, n[k, LEVEL_SHARPNESS]) / (n[k, LEVEL] * x)
        y = x  # of the quadratic form, with a power of its own
        if n[k, STEEPER] != 0.0:
            y = ti.pow(ti.max(x, 1e-9), 1.0 + n[k, STEEPER])
        grown *= 1.0 + n[k, QUADRATIC] * y + n[k, CUBIC] * x * x
        grown /= ti.max(1.0 - n[k, LOCKING] * x, 0.05)
        if n[k, EARLY] != 0.0:
            grown += n[k, EARLY] * (1.0 - ti.exp(-depth / n[k, EARLY_REACH]))
        away = (depth - n[k, LAYER_DEPTH]) / n[k, LAYER_WIDTH]
        if n[k, LAYER_STEP] != 0.0 or n[k, LAYER_FACTOR] != 0.0:
            inside = 1.0 / (1.0 + ti.exp(ti.min(-away, 60.0)))
            grown *= 1.0 + n[k, LAYER_FACTOR] * inside
            grown += n[k, LAYER_STEP] * inside
        if n[k, LAYER_BUMP] != 0.0:
            grown += n[k, LAYER_BUMP] * ti.exp(-0.5 * away * away)
        if n[k, LAYER_SLOPE] != 0.0:
            width = n[k, LAYER_WIDTH]  # a corner that is rounded over it, and no force at the surface
            corner = ti.log(1.0 + ti.exp(-ti.abs(away))) - ti.log(1.0 + ti.exp(-n[k, LAYER_DEPTH] / width))
            grown += n[k, LAYER_SLOPE] * (ti.max(depth - n[k, LAYER_DEPTH], 0.0) + width * corner)
        return grown if depth > 0.0 else 0.0

    @ti.func
    def taken(z: ti.f64, way: ti.f64, turn_z: ti.f64, turn_w: ti.f64, n: ti.template(), k: ti.i32) -> ti.f64:
        """Share of the friction's bound at z, from `turn_w` at `turn_z` on, where the way last turned."""
        return way + (turn_w - way) * ti.exp(-ti.abs(z - turn_z) / n[k, SHAFT_REACH])

    @ti.func
    def force(
        z: ti.f64, v: ti.f64, way: ti.f64, top: ti.f64, deepest: ti.f64, turn_z: ti.f64, turn_w: ti.f64,
        n: ti.template(), k: ti.i32,
    ) -> ti.f64:  # fmt: skip
        total = 0.0
        if z > 0.0:
            most, ever = ti.max(top, z), ti.max(deepest, z)
            at = z  # where the loading curve is read
            stiff, bent = 0.0, 1.0  # what is taken off it, and by how much it bends
            if n[k, CRATER] > 0.0 and z < ever:
                at = (z - n[k, CRATER] * ever) / (1.0 - n[k, CRATER])
                if n[k, BEND] != 0.0:
                    bent = ti.pow(ti.max(at / ever, 1e-9), n[k, BEND])
            elif n[k, UNLOAD] > 0.0 and z < ever:
                at = ever
                stiff = n[k, STIFFNESS] * (1.0 + n[k, UNLOAD]) * (ever - z)
            spring = ti.max(loading(at, n, k) * bent - stiff, 0.0)
            if ti.static(OWN):
                s = State(mass=n[k, MASS], gravity=n[k, GRAVITY], weight=n[k, MASS] * n[k, GRAVITY], y=-z, vy=-v)
                spring = own_spring(s, z, spring, n, k)
            x, back = z / n[k, REFERENCE], most - z
            total = spring
            sinking = ti.max(v, 0.0)
            rising = ti.max(-v, 0.0)
            total += n[k, DAMPING] * sinking * (1.0 if spring > 0.0 else 1.0 - n[k, OPEN])
            shape = ti.min(z / n[k, RADIUS_DEPTH], 1.0)
            share = n[k, DRAG] + n[k, DRAG_DEEP] * x + n[k, DRAG_TIP] * shape * (2.0 - shape)
            if n[k, DRAG_ONSET] != 0.0:
                share += n[k, DRAG_ONSET] * mobilised(z / n[k, DRAG_REACH], n[k, DRAG_SHARPNESS])
            total += share * sinking * sinking + n[k, DRAG_BOTH] * v * ti.abs(v)
            rub = (n[k, SHAFT] + n[k, SHAFT_DEEP] * x) * way
            if n[k, SHAFT_POWER] != 0.0:
                rub += n[k, SHAFT_POWER] * ti.pow(x, n[k, SHAFT_GROWTH]) * way
            if n[k, SHAFT_SLOW] != 0.0:
                rub += n[k, SHAFT_SLOW] * ti.exp(-ti.abs(v) / n[k, SHAFT_SPEED]) * way
            if n[k, SHAFT_HELD] != 0.0:
                bound = n[k, SHAFT_HELD] * ti.pow(x, n[k, SHAFT_GROWTH])
                rub += bound * taken(z, way, turn_z, turn_w, n, k)
            if n[k, SHAFT_ONSET] > 0.0:
                rub *= mobilised(z / n[k, SHAFT_ONSET], n[k, SHAFT_SHARPNESS])
            if n[k, SHAFT_RISE] > 0.0:
                rub *= ti.tanh(ti.abs(v) / n[k, SHAFT_RISE]) / ti.max(ti.abs(way), 1e-9)  # in place of the direction
            total += rub + n[k, SHAFT_VISCOUS] * v
            pull = 0.0
            if back > 0.0:
                held = back / n[k, PULL_REACH]
                grown = n[k, PULL]
                if n[k, PULL_DEEP] != 0.0:
                    grown += n[k, PULL_DEEP] * ti.pow(most / n[k, REFERENCE], n[k, PULL_GROWTH])
                pull += grown * mobilised(held, n[k, SHARPNESS])
                pull += n[k, PULL_SHORT] * held * ti.exp(1.0 - held)
            if n[k, PULL_EVER] != 0.0 and z < ever:
                part = mobilised((ever - z) / n[k, PULL_REACH], n[k, SHARPNESS])
                pull += n[k, PULL_EVER] * ti.pow(ever / n[k, REFERENCE], n[k, PULL_GROWTH]) * part
            if n[k, FADE] > 0.0:
                pull *= mobilised(z / n[k, FADE], n[k, FADE_SHARPNESS])
            if n[k, LET] > 0.0:
                gone = back if n[k, PULL_EVER] == 0.0 else ever - z
                pull *= ti.exp(-gone / n[k, LET])
            pull *= 1.0 - n[k, PULL_OUT] * ti.max(way, 0.0)
            total -= pull
            total -= n[k, PULL_VISCOUS] * rising
            if ti.static(OWN):
                s = State(mass=n[k, MASS], gravity=n[k, GRAVITY], weight=n[k, MASS] * n[k, GRAVITY], y=-z, vy=-v)
                total += own_force(s, z, v, most, n, k)
        return total

    @ti.kernel
    def push_all(numbers: Table, lane_path: Whole, starts: Whole, depth: Line, speed: Line, out: Table):
        for k in range(numbers.shape[0]):  # type: ignore[attr-defined]
            path = lane_path[k]
            top, deepest = 0.0, 0.0
            before, share = 0.0, 0.0
            for row in range(starts[path], starts[path + 1]):
                z, v = depth[row] + numbers[k, SHIFT_DEPTH], speed[row] + numbers[k, SHIFT_SPEED]
                if z <= 0.0:
                    top, before, share = 0.0, 0.0, 0.0
                else:
                    share = taken(z, 1.0 if z > before else -1.0, before, share, numbers, k)
                    before = z
                top, deepest = ti.max(top, z), ti.max(deepest, z)
                way = ti.tanh(v / numbers[k, SPEED_SCALE])
                here = z + numbers[k, SHIFT_ROW]
                out[k, row - starts[path]] = force(here, v, way, top, deepest, z, share, numbers, k)

    @ti.kernel
    def fall_all(numbers: Table, lane_path: Whole, starts: Whole, times: Line, speeds: Line, steps: Line, out: Cube):
        for k in range(numbers.shape[0]):  # type: ignore[attr-defined]
            path = lane_path[k]
            m, g = numbers[k, MASS], numbers[k, GRAVITY]
            z, v, t, way = 0.0, speeds[path], 0.0, 1.0
            top, deepest = 0.0, 0.0
            turn_z, turn_w = 0.0, 0.0
            inside, resting = 1, 0
            for row in range(starts[path], starts[path + 1]):
                until, at = times[row], row - starts[path]
                if until < 0.0:
                    out[k, at, 0] = speeds[path] * until + 0.5 * g * until * until
                    out[k, at, 1] = speeds[path] + g * until
                    out[k, at, 2] = g
                else:
                    # A step is tried; where something happens within it, halving finds when, and the step ends there.
                    low, high, halvings, turns = 0.0, 0.0, 0, 0
                    while resting == 0 and (halvings > 0 or until - t > 1e-12) and turns < 1000000:
                        turns += 1
                        dt = 0.5 * (low + high)
                        if halvings == 0:
                            dt = ti.min(steps[k], until - t)
                        elif halvings > 40:
                            dt = high
                        # One Runge-Kutta step.
                        zs, vs, z1, v1, share = z, v, z, v, 0.0
                        for stage in range(4):
                            a = g
                            if inside == 1:
                                a = g - force(ti.max(zs, 1e-300), vs, way, top, deepest, turn_z, turn_w, numbers, k) / m
                            weight = dt / 6.0 if stage == 0 or stage == 3 else dt / 3.0
                            z1 += weight * vs
                            v1 += weight * a
                            share = dt if stage == 2 else 0.5 * dt
                            zs, vs = z + share * vs, v + share * a
                        turned = inside == 1 and way * v1 < 0.0 and way * v >= 0.0
                        crossed = (inside == 1 and z1 < 0.0) or (inside == 0 and z1 > 0.0)
                        ended = True
                        if halvings <= 40:
                            if turned or crossed:
                                high, ended = dt, False
                            elif halvings > 0:
                                low, ended = dt, False
                            if not ended:
                                halvings += 1
                        if ended:
                            found = halvings > 40
                            z, v = z1, v1
                            t += dt
                            low, high, halvings = 0.0, 0.0, 0
                            if inside == 1:
                                top, deepest = ti.max(top, z), ti.max(deepest, z)
                            if found and crossed:
                                z = 0.0
                                if inside == 1:
                                    inside, top = 0, 0.0
                                else:
                                    inside, way = 1, 1.0
                                    # On what bears it at the surface it would hop for ever, ever less.
                                    bears = force(1e-300, 0.0, 1.0, 0.0, deepest, 0.0, 0.0, numbers, k)
                                    if v < SETTLED and bears > m * g:
                                        v, resting = 0.0, 1
                                turn_z, turn_w = 0.0, 0.0
                            elif found and turned:
                                v = 0.0
                                turn_z, turn_w = z, taken(z, way, turn_z, turn_w, numbers, k)
                                down, up = 0.0, 0.0
                                for side in range(2):
                                    tried = 1.0 - 2.0 * side
                                    a = g - force(z, 0.0, tried, top, deepest, turn_z, turn_w, numbers, k) / m
                                    if side == 0:
                                        down = a
                                    else:
                                        up = a
                                if down <= 0.0 and up >= 0.0:
                                    resting = 1
                                else:
                                    way = -1.0 if up < 0.0 and (way > 0.0 or down <= 0.0) else 1.0
                            if not (ti.abs(z) < 1e3 and ti.abs(v) < 1e4):
                                resting = 2
                    if resting == 2:
                        out[k, at, 0] = ti.math.nan
                    else:
                        pushed = 0.0
                        if inside == 1 and resting == 0:
                            pushed = force(z, v, way, top, deepest, turn_z, turn_w, numbers, k)
                        out[k, at, 0] = z
                        out[k, at, 1] = v
                        out[k, at, 2] = 0.0 if resting == 1 else g - pushed / m
                        out[k, at, 3] = 2.0 if resting == 1 else (0.0 if inside == 0 else (1.0 if v > 0.0 else 3.0))

    return push_all, fall_all
