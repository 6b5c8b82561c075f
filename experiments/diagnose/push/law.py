"""The force of a bed on a spike that goes straight down, with every effect of the library, compiled by Taichi.

Base: F = K z + C max(0, v) for depth z > 0, and 0 above; v = dz/dt, downwards positive; F positive upwards. A drop
obeys m z'' = m g - F. Each effect adds to one of three parts. The first is the loading curve h(z), which is K z in the
base model. The second is the unloading (`top` is the deepest depth since it last entered, `deepest` the deepest ever).
The third depends on the rate. The effects' own files say how (`rigid.terms.candidate.Push`), and the sum over them is
written out as text. At amplitude 0 an effect changes nothing. `SLOTS` names the numbers of a lane; D is `reference`, a
depth typical of the campaign, so that amplitudes of one effect's forms compare.

A drop is integrated by the classical Runge-Kutta method. Each step is cut where the spike turns, leaves or comes back
(found by halving), since friction and damper jump there. At a turning point the forces of both directions are tried:
where neither moves the spike, it rests for good.

Friction that is mobilised over a way (`Push.turning`) is a share w of its bound, dw = (sign(dz) - w) |dz| / reach. This
is Dahl's law with exponent 1 (A solid friction model, TOR-0158(3107-18)-1, Aerospace Corp., 1968): it stays while the
spike is held. From where the way last turned on, w is an exponential of the depth.
"""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
import inspect
import linecache
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.diagnose.fit.forms import OwnEffect
from rigid.batch.runtime import ensure
from rigid.model.model import for_taichi
from rigid.terms import FIXED_ARGUMENTS, STATE_FIELDS, Term
from rigid.terms.candidate import Push

from .slots import HERE, LIBRARY, PLACES, SLOTS, VALUES, slots_of

__all__ = ["PHASES", "fall", "given_way", "push", "push_each"]

PHASES = ("free", "in", "rest", "out")

_HELD, _REACH = next(effect.turning for effect in LIBRARY if effect.turning is not None)
_STEP, _TURN = 1.25e-3, 0.1
"""Longest step of a drop [s], and over sqrt(m / K), which is tens of ms for a spike on sand. With these what is off
stays below 0.004 of the sensors' noise for every form of the library."""
_STEEP, _RISE = next(effect.steep for effect in LIBRARY if effect.steep is not None)
_SHORTEST = 2e-6
"""Shortest step of a drop for a friction that rises with speed [s]."""

_SETTLED = 1e-3
"""Speed [m/s] at which a spike that comes back to a surface that supports it stays there: it would hop by 5e-8 m."""


def push(numbers: NDArray[np.float64], lane_path: NDArray[np.int32], starts: NDArray[np.int32],
         depth: NDArray[np.float64], speed: NDArray[np.float64], own: tuple[OwnEffect, ...] = (),
         times: NDArray[np.float64] | None = None) -> NDArray[np.float64]:  # fmt: skip
    """Forces [N] of driven spikes along given paths, shape [lane_count, longest path]; 0 beyond a path's end.

    `numbers`: shape [lane_count, slot_count]. `lane_path`: which path a lane follows, shape [lane_count]. `starts`:
    first row of each path and the row after the last, shape [path_count + 1]. `depth`, `speed`: the paths [m, m/s], one
    after another. `own`: effects from files, whose parameters `numbers` holds. `times`: of the paths [s]; without
    them no time passes, so that nothing gives way.
    """
    longest = int(np.diff(starts).max())
    out = np.zeros((len(numbers), longest))
    begins = longest * np.arange(len(numbers))
    _push(numbers, lane_path, starts, depth, speed, own, times, begins, out.reshape(-1))
    return out


def push_each(
    numbers: NDArray[np.float64], starts: NDArray[np.int32], depth: NDArray[np.float64], speed: NDArray[np.float64],
    own: tuple[OwnEffect, ...], times: NDArray[np.float64],
) -> list[NDArray[np.float64]]:  # fmt: skip
    """The same of as many lanes on each path, those of the first path first: of each path forces [N], shape [lane_count
    of the path, its rows]."""
    paths = len(starts) - 1
    count, lengths = len(numbers) // paths, np.diff(starts)
    out = np.empty(count * int(starts[-1]))
    begins = np.repeat(count * starts[:-1].astype(np.int64), count) + np.tile(np.arange(count), paths) * np.repeat(
        lengths, count
    )
    lane_path = np.repeat(np.arange(paths, dtype=np.int32), count)
    _push(numbers, lane_path, starts, depth, speed, own, times, begins, out)
    edges = count * starts.astype(np.int64)
    return [out[edges[p] : edges[p + 1]].reshape(count, -1) for p in range(paths)]


def _push(
    numbers: NDArray[np.float64], lane_path: NDArray[np.int32], starts: NDArray[np.int32], depth: NDArray[np.float64],
    speed: NDArray[np.float64], own: tuple[OwnEffect, ...], times: NDArray[np.float64] | None,
    begins: NDArray[np.int64], out: NDArray[np.float64],
) -> None:  # fmt: skip
    """Put the forces of a lane into `out` from its place in `begins` on."""
    ensure()
    kernel = _kernels(tuple((effect.term, effect.push) for effect in own))[0]
    times = np.zeros(len(depth)) if times is None else times
    followed, first = np.unique(lane_path, return_index=True)
    like = np.zeros(len(starts) - 1, dtype=np.int32)
    like[followed] = first
    scale, shift = (np.repeat(numbers[like, PLACES[name]], np.diff(starts)) for name in ("speed_scale", "shift_speed"))
    ways = np.tanh((speed + shift) / scale)
    lanes = (np.ascontiguousarray(numbers), lane_path.astype(np.int32), starts.astype(np.int32), like, begins)
    kernel(*lanes, times, depth, speed, ways, out)


def fall(numbers: NDArray[np.float64], lane_path: NDArray[np.int32], starts: NDArray[np.int32],
         times: NDArray[np.float64], speeds: NDArray[np.float64],
         own: tuple[OwnEffect, ...] = ()) -> NDArray[np.float64]:  # fmt: skip
    """Motions of dropped spikes, at depth 0 at t = 0: depth [m], NaN where a motion leaves all bounds, speed [m/s],
    acceleration [m/s2] and phase (place in `PHASES`), shape [lane_count, longest, 4].

    `numbers`, `lane_path`, `starts`, `own`: as of `push`. `times`: the trials' sample times [s], rising, one trial
    after another; before 0 in free flight. `speeds`: speed at the surface of each trial [m/s].
    """
    ensure()
    longest = int(np.diff(starts).max())
    out = np.zeros((len(numbers), longest, 4))
    held = np.abs(numbers[:, PLACES[_HELD]]) / numbers[:, PLACES[_REACH]]
    rate = np.sqrt((np.maximum(numbers[:, PLACES["stiffness"]], 1e-9) + held) / numbers[:, PLACES["mass"]])
    rate += np.abs(numbers[:, PLACES["damping"]]) / numbers[:, PLACES["mass"]]
    steps = np.minimum(_STEP, _TURN / rate)
    numbers, steep = _risen(numbers)
    steps = np.minimum(steps, steep)
    _kernels(tuple((effect.term, effect.push) for effect in own))[1](
        np.ascontiguousarray(numbers), lane_path.astype(np.int32), starts.astype(np.int32), times, speeds, steps, out
    )
    return out


def _risen(numbers: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Numbers of lanes as `fall` takes them, and the longest step of each [s], infinite without such a friction.

    Friction f tanh(v / w) brings a mass m to rest over the time m w / f. The Runge-Kutta method is unstable with steps
    of 2.8 of these times; it takes steps of one. Where that is shorter than `_SHORTEST`, w is as large as it resolves:
    there the friction is all but a constant one.
    """
    bound = np.abs(numbers[:, [PLACES[name] for name in _STEEP]]).sum(axis=1)
    speed = numbers[:, PLACES[_RISE]]
    steep = (bound > 0.0) & (speed > 0.0)
    if not steep.any():
        return numbers, np.full(len(numbers), np.inf)
    slowing = bound / numbers[:, PLACES["mass"]]  # [m/s2]
    risen = numbers.copy()
    risen[steep, PLACES[_RISE]] = np.maximum(speed, slowing * _SHORTEST)[steep]
    own = np.divide(risen[:, PLACES[_RISE]], slowing, out=np.full(len(numbers), np.inf), where=steep)
    return risen, own


_Own = tuple[tuple[Term, Push | None], ...]
"""Effects from files: the term, and the law of a push that its file declares in the place of the term's hooks."""


def _parts(own: _Own) -> list[tuple[Mapping[str, Callable[..., Any]], Mapping[str, int]]]:
    """Hooks of every effect, the library's first, and the places in a lane of the numbers that they ask for."""
    at = len(SLOTS)
    parts: list[tuple[Mapping[str, Callable[..., Any]], Mapping[str, int]]]
    parts = [(effect.law, PLACES) for effect in LIBRARY]
    for term, law in own:
        names = tuple(p.name for p in term.parameters) if law is None else slots_of(law)
        functions = term.hooks if law is None else law.law
        parts.append((functions, {name: at + place for place, name in enumerate(names)}))
        at += len(names)
    return parts


def given_way(lane: NDArray[np.float64], gone: NDArray[np.float64] | None, depth: float, span: float,
              own: Sequence[OwnEffect] = ()) -> NDArray[np.float64]:  # fmt: skip
    """How far the bed has given way [m] after `span` [s] more at `depth` [m], by each effect that makes it do so.

    `lane`: its numbers, shape [slot_count]. `gone`: the same before, None: not at all. `own`: effects from files.
    """
    law = [one for one in _parts(tuple((e.term, e.push) for e in own)) if "settle" in one[0]]
    after = np.zeros(len(law)) if gone is None else np.array(gone)
    for k, share in _turns(len(law)):
        hook, columns = law[k][0]["settle"], law[k][1]
        asked = list(inspect.signature(hook).parameters)[len(VALUES["settle"]) :]
        others = float(after.sum() - after[k])
        after[k] = hook(float(after[k]), depth - others, share * span, *(float(lane[columns[name]]) for name in asked))
    return after


def _turns(count: int) -> list[tuple[int, float]]:
    """In which order `count` effects make the bed give way, each with its share of the time: there and back, so that
    what one leaves to the others is right to the second order (Strang's splitting)."""
    there = [(k, 0.5) for k in range(count - 1)]
    return [*there, (count - 1, 1.0), *reversed(there)]


def _compiled(lines: Mapping[str, Sequence[str]], hooks: Mapping[str, Callable[..., Any]], name: str) -> list[Any]:
    """Functions (head -> lines) that call `hooks`, written out as text and compiled by Taichi."""
    from hedgebed_taichi import ti

    names = {"ti": ti} | {key: for_taichi(hook) for key, hook in hooks.items()}
    text = "".join(f"def {head}:\n" + "".join(f"    {line}\n" for line in body) for head, body in lines.items())
    file = f"<effects {name} {id(hooks):x}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # where Taichi reads it
    exec(compile(text, file, "exec"), names)
    return [ti.func(names[head.partition("(")[0]]) for head in lines]


_TERM_LINES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "stiffen": ("own_spring", ("force, work = {}(z, force, 0.0{})",)),
    "rate_force": ("own_force", ("total = total + {}(s, z, v{})",)),
    "hold": ("own_force", ("pull, held = {}(s, z, most{})", "total = total - pull")),
}
"""Hooks of a term that a file has in the place of a law: in which function they are called, and how."""


def _changes(own: _Own) -> tuple[int, list[Any]]:
    """What the effects make of the loading curve, of where it is read on the way back, of the damper and the force;
    what the terms of effects from files make of the spring's force, and the force that they add. Before them: how many
    effects make the bed give way."""
    hooks: dict[str, Callable[..., Any]] = {}
    calls: dict[str, list[str]] = {name: [] for name in (*VALUES, "own_spring", "own_force")}
    settling: list[tuple[str, str]] = []
    for place, (functions, columns) in enumerate(_parts(own)):
        for hook, function in functions.items():
            called, asked = f"{hook}_{place}", list(inspect.signature(function).parameters)
            hooks[called] = function
            if hook in _TERM_LINES:
                where, lines = _TERM_LINES[hook]
                numbers = "".join(f", n[{columns[name]}]" for name in asked[len(FIXED_ARGUMENTS[hook]) :])
                calls[where] += [line.format(called, numbers) for line in lines]
            elif hook == "settle":
                settling.append((called, "".join(f", n[{columns[name]}]" for name in asked[len(VALUES[hook]) :])))
            else:
                arguments = (name if name in VALUES[hook] else f"n[{columns[name]}]" for name in asked)
                calls[hook].append(f"{called}({', '.join(arguments)})")
    for at, share in _turns(len(settling)):
        called, numbers = settling[at]
        others = f"z - (gone.sum() - gone[{at}])"
        calls["settle"].append(f"gone[{at}] = {called}(gone[{at}], {others}, {share} * span{numbers})")
    n = "n: ti.template()"
    return len(settling), _compiled({
        f"loading_changed(before, depth, x, {n})":
            ["grown = before", *(f"grown = {call}" for call in calls["loading"]), "return grown"],
        f"unload_changed(z, ever, stiffness, {n})":
            ["at = z", "stiff = 0.0", "bent = 1.0", *(f"at, stiff, bent = {call}" for call in calls["unload"]),
             "return at, stiff, bent"],
        f"damper_changed(spring, {n})":
            ["factor = 1.0", *(f"factor = factor * {call}" for call in calls["damper"]), "return factor"],
        f"settled(before, z, span, {n})":
            ["gone = before", *calls["settle"], "return gone"],
        f"mass_changed(z, x, reference, {n})":
            ["total = 0.0", *(f"total = total + {call}" for call in calls["mass"]), "return total"],
        f"force_changed(before, {', '.join(HERE)}, {n})":
            ["total = before", *(f"total = total + {call}" for call in calls["force"]),
             *(f"total = total - {call}" for call in calls["pull"]), "return total"],
        f"own_spring(s, z, spring, {n})": ["force = spring", *calls["own_spring"], "return force"],
        f"own_force(s, z, v, most, {n})": ["total = 0.0", *calls["own_force"], "return total"],
    }, hooks, "of the library" + "".join(f"+{term.id}" for term, _ in own))  # fmt: skip


def _functions(own: _Own) -> tuple[int, Any, Any, Any, Any]:
    """How many effects make the bed give way; the force on a spike; the share of its bound that a friction has which
    takes a way to turn round; how far the bed has given way after a time, effect by effect; the mass that a spike
    carries along, over its own."""
    from hedgebed_taichi import ti

    State = ti.types.struct(**dict.fromkeys(STATE_FIELDS, ti.f64))
    settling, (
        loading_changed, unload_changed, damper_changed, settled, mass_changed, force_changed, own_spring, own_force,
    ) = _changes(own)  # fmt: skip
    OWN = any(law is None for _, law in own)
    MASS, GRAVITY, STIFFNESS, DAMPING = (PLACES[name] for name in ("mass", "gravity", "stiffness", "damping"))
    UNLOAD_CHANGE = PLACES["unload_change"]
    REFERENCE, RADIUS_DEPTH, HELD, REACH = (PLACES[name] for name in ("reference", "radius_depth", _HELD, _REACH))

    @ti.func
    def loading(z: ti.f64, n: ti.template()) -> ti.f64:
        depth = ti.max(z, 0.0)
        grown = loading_changed(n[STIFFNESS] * depth, depth, depth / n[REFERENCE], n)
        return grown if depth > 0.0 else 0.0

    @ti.func
    def taken(z: ti.f64, way: ti.f64, turn_z: ti.f64, turn_w: ti.f64, n: ti.template()) -> ti.f64:
        """Share of the friction's bound at z, from `turn_w` at `turn_z` on, where the way last turned."""
        return way + (turn_w - way) * ti.exp(-ti.abs(z - turn_z) / n[REACH])

    @ti.func
    def force(
        z: ti.f64, v: ti.f64, way: ti.f64, top: ti.f64, deepest: ti.f64, turn_z: ti.f64, turn_w: ti.f64,
        gone: ti.f64, n: ti.template(),
    ) -> ti.f64:  # fmt: skip
        total = 0.0
        if z > 0.0:
            most, ever = ti.max(top, z), ti.max(deepest, z)
            # Where the loading curve is read, what is taken off it, and by how much it bends.
            at, stiff, bent = unload_changed(z, ever, n[STIFFNESS] * (1.0 + n[UNLOAD_CHANGE]), n)
            spring = ti.max(loading(at - gone, n) * bent - stiff, 0.0)
            if ti.static(OWN):
                s = State(mass=n[MASS], gravity=n[GRAVITY], weight=n[MASS] * n[GRAVITY], y=-z, vy=-v)
                spring = own_spring(s, z, spring, n)
            total = spring
            total += n[DAMPING] * ti.max(v, 0.0) * damper_changed(spring, n)
            share = 0.0
            if n[HELD] != 0.0:
                share = taken(z, way, turn_z, turn_w, n)
            reference, radius_depth = n[REFERENCE], n[RADIUS_DEPTH]
            total = force_changed(total, z, v, z / reference, way, share, most, ever, reference, radius_depth, n)
            if ti.static(OWN):
                s = State(mass=n[MASS], gravity=n[GRAVITY], weight=n[MASS] * n[GRAVITY], y=-z, vy=-v)
                total += own_force(s, z, v, most, n)
        return total

    @ti.func
    def carried(z: ti.f64, way: ti.f64, n: ti.template()) -> ti.f64:
        more = 0.0
        if way > 0.0:
            more = mass_changed(z, z / n[REFERENCE], n[REFERENCE], n) / n[MASS]
        return more

    return settling, force, taken, settled, carried


@lru_cache(maxsize=8)
def _kernels(own: _Own) -> tuple[Any, Any]:
    from hedgebed_taichi import ti

    settling, force, taken, settled, carried = _functions(own)
    GIVEN_WAY, HELD = PLACES["given_way"], PLACES[_HELD]
    MASS, GRAVITY, SPEED_SCALE, SETTLED = PLACES["mass"], PLACES["gravity"], PLACES["speed_scale"], _SETTLED
    SHIFT_DEPTH, SHIFT_ROW, SHIFT_SPEED = (PLACES[name] for name in ("shift_depth", "shift_row", "shift_speed"))
    COUNT = len(SLOTS) + sum(len(p.parameters) if q is None else len(slots_of(q)) for p, q in own)
    Table = ti.types.ndarray(dtype=ti.f64, ndim=2)
    Line = ti.types.ndarray(dtype=ti.f64, ndim=1)
    Whole, Long = (ti.types.ndarray(dtype=dtype, ndim=1) for dtype in (ti.i32, ti.i64))
    Cube = ti.types.ndarray(dtype=ti.f64, ndim=3)

    @ti.kernel
    def push_all(
        numbers: Table, lane_path: Whole, starts: Whole, like: Whole, begins: Long, times: Line, depth: Line,
        speed: Line, ways: Line, out: Line,
    ):  # fmt: skip
        for k in range(numbers.shape[0]):  # type: ignore[attr-defined]
            path = lane_path[k]
            lane = ti.Vector([numbers[k, i] for i in ti.static(range(COUNT))])
            # `ways` are those of the lane `like[path]`; mostly the path's lanes share them.
            n = like[path]
            same = lane[SPEED_SCALE] == numbers[n, SPEED_SCALE] and lane[SHIFT_SPEED] == numbers[n, SHIFT_SPEED]
            top, deepest = 0.0, 0.0
            before, share = 0.0, 0.0
            gone = ti.Vector([0.0 for _ in ti.static(range(settling))])
            for row in range(starts[path], starts[path + 1]):
                z, v = depth[row] + lane[SHIFT_DEPTH], speed[row] + lane[SHIFT_SPEED]
                if z <= 0.0:
                    top, before, share = 0.0, 0.0, 0.0
                    gone.fill(0.0)
                else:
                    if row > starts[path]:
                        half = 0.5 * (times[row] - times[row - 1])
                        gone = settled(settled(gone, before, half, lane), z, half, lane)
                    if lane[HELD] != 0.0:
                        share = taken(z, 1.0 if z > before else -1.0, before, share, lane)
                    before = z
                top, deepest = ti.max(top, z), ti.max(deepest, z)
                way = ways[row]
                if not same:
                    way = ti.tanh(v / lane[SPEED_SCALE])
                here = z + lane[SHIFT_ROW]
                given = gone.sum() + lane[GIVEN_WAY]
                out[begins[k] + row - starts[path]] = force(here, v, way, top, deepest, z, share, given, lane)

    @ti.kernel
    def fall_all(numbers: Table, lane_path: Whole, starts: Whole, times: Line, speeds: Line, steps: Line, out: Cube):
        for k in range(numbers.shape[0]):  # type: ignore[attr-defined]
            path = lane_path[k]
            lane = ti.Vector([numbers[k, i] for i in ti.static(range(COUNT))])
            m, g = lane[MASS], lane[GRAVITY]
            z, v, t, way = 0.0, speeds[path], 0.0, 1.0
            top, deepest = 0.0, 0.0
            turn_z, turn_w = 0.0, 0.0
            gone = ti.Vector([0.0 for _ in ti.static(range(settling))])
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
                        half = gone  # the bed gives way by half before the step and by half after it
                        if inside == 1:
                            half = settled(gone, z, 0.5 * dt, lane)
                        for stage in range(4):
                            a = g
                            if inside == 1:
                                here = ti.max(zs, 1e-300)
                                given = half.sum() + lane[GIVEN_WAY]
                                a = g - force(here, vs, way, top, deepest, turn_z, turn_w, given, lane) / m
                                a = a / (1.0 + carried(here, way, lane))
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
                                gone = settled(half, ti.max(z, 1e-300), 0.5 * dt, lane)
                                top, deepest = ti.max(top, z), ti.max(deepest, z)
                            if found and crossed:
                                z = 0.0
                                if inside == 1:
                                    inside, top = 0, 0.0
                                    gone.fill(0.0)
                                else:
                                    inside, way = 1, 1.0
                                    # On what supports it at the surface it would hop for ever, ever less.
                                    bears = force(1e-300, 0.0, 1.0, 0.0, deepest, 0.0, 0.0, lane[GIVEN_WAY], lane)
                                    if v < SETTLED and bears > m * g:
                                        v, resting = 0.0, 1
                                turn_z, turn_w = 0.0, 0.0
                            elif found and turned:
                                v = 0.0
                                turn_z, turn_w = z, taken(z, way, turn_z, turn_w, lane)
                                down, up = 0.0, 0.0
                                given = gone.sum() + lane[GIVEN_WAY]
                                for side in range(2):
                                    tried = 1.0 - 2.0 * side
                                    a = g - force(z, 0.0, tried, top, deepest, turn_z, turn_w, given, lane) / m
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
                        pushed, more = 0.0, 0.0
                        if inside == 1 and resting == 0:
                            pushed = force(z, v, way, top, deepest, turn_z, turn_w, gone.sum() + lane[GIVEN_WAY], lane)
                            more = carried(z, way, lane)
                        out[k, at, 0] = z
                        out[k, at, 1] = v
                        out[k, at, 2] = 0.0 if resting == 1 else (g - pushed / m) / (1.0 + more)
                        out[k, at, 3] = 2.0 if resting == 1 else (0.0 if inside == 0 else (1.0 if v > 0.0 else 3.0))

    return push_all, fall_all
