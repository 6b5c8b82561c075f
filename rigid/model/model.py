"""Puts the terms of a model together into a handful of functions, for Python or for Taichi.

The sum over terms is written out as text, once for every set of terms: a line a hook. The hooks themselves are
ordinary functions (`rigid.terms`); Python uses them unchanged. For Taichi each is rebuilt from the same code, with
Taichi's functions in place of those of `math`.

The functions, with `s` the state (`STATE_FIELDS`), `p` the parameters of the effects (`<effect>_<parameter>`) and `q`
the numbers of the ground's law:

- ``vertical(p)``: direction of the vertical; ``tip_radius(p)``; ``torque_factor(p, s)``;
- ``inertia(p, s)``: six entries of the mass matrix;
- ``applied(p, s)``: generalised force of all but contacts and dry friction;
- ``potential(p, s)`` [J], ``losses(p, s)`` [W]: of the same;
- ``dry_friction(p, s)``: bounds on the vertical motion [N] and on the rotation [N m];
- ``inner_start(p, s)``, ``inner(p, s)``: of the coordinate that a term has of its own, where there is one: at rest; its
  inertia, the force on it, and what is positive while its mode holds;
- ``settle[k](p, s, depth, slip, lean, gone)``, ``settled[k](p, s)``, of the k-th term that lets ground give way: how
  fast it does under a tip [m/s], and the share of the whole depth at rest by which it has at the start;
- ``added(p, depth)``: mass of ground that a tip carries along while it sinks [kg], its slope over depth [kg/m];
- ``wall(p)``: slope of a crater's wall, 0 where craters are forgotten;
- ``crater(p)``: share of the deepest depth at which a spike on the way up leaves the ground;
- ``contact(p, s, q, depth, rate, slip, top, held)``: elastic normal force, dissipative normal force, stored energy,
  tangential drag, factors on mu_s and mu_d, load that friction sees beside the normal force.

Geometry: spike n touches at the lowest point of its tip, which is h below and d behind the platform's centre. With r
the radius of the tip's ball (0: a point) and gamma the spike's angle from the downward vertical,

    h = (l - r) cos gamma + r,  d = (l - r) sin gamma,
    depth = h - y,  rate = -(vy + omega d),  slip = vx - omega h   (slip: the material point's horizontal speed),
    d(slip)/dt = ax - alpha h + omega^2 d,

so a force (F, N) on the tip has the generalised force (F, N, N d - F h). A ball that sticks rolls.
"""

import linecache
import re
import types
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rigid.ground.laws import SurfaceLaw, find_law, retreat_share, springback, springback_energy
from rigid.terms import BASE, STATE_FIELDS, Term

__all__ = [
    "Model", "State", "assemble", "contact_arms", "divide_mass", "for_taichi", "make_parameters", "model_source",
    "parameter_names",
]  # fmt: skip

_MATHEMATICS = ("sin", "cos", "tan", "asin", "acos", "atan2", "exp", "log", "sqrt", "tanh", "floor")
"""What `math` and Taichi offer by one name."""


class State:
    """The state `s` for Python: one mutable record, see `STATE_FIELDS`."""

    __slots__ = STATE_FIELDS

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> float: ...
        def __setattr__(self, name: str, value: float) -> None: ...


class Model:
    """The functions of one set of terms (see the module); `terms` are the effects, `law` the ground's."""

    terms: tuple[Term, ...]
    law: SurfaceLaw
    settle: tuple[Callable[..., Any], ...]
    settled: tuple[Callable[..., Any], ...]
    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    def __init__(self, terms: tuple[Term, ...], law: SurfaceLaw, functions: Mapping[str, Any]) -> None:
        self.terms, self.law = terms, law
        vars(self).update(functions)
        self.settle, self.settled = (
            tuple(functions[f"{hook}_{k}"] for k in range(self.settles)) for hook in ("settle", "settled")
        )

    def has(self, *hooks: str) -> bool:
        """Whether any effect has one of these hooks."""
        return any(hook in term.hooks for term in self.terms for hook in hooks)

    def reads(self, *fields: str, but: str = "") -> bool:
        """Whether any effect looks at one of these fields of the state, in any hook but the one called `but`."""
        hooks = [hook for term in self.terms for name, hook in term.hooks.items() if name != but]
        return any(set(fields) & set(hook.__code__.co_names) for hook in hooks)

    @property
    def settles(self) -> int:
        """Number of terms by which the ground under a tip may give way for good; each has a state of its own."""
        return len(_settling(self.terms))

    @property
    def has_memory(self) -> bool:
        """Whether the deepest depth of a spike matters."""
        return self.law.has_memory or self.has("crater", "hold", "unload", "rate_pull")


def parameter_names(terms: Sequence[Term]) -> tuple[str, ...]:
    """The fields of `p`, in order: every parameter of every effect, then those of the springback."""
    own = [f"{_name(term)}_{parameter.name}" for term in terms if not term.sensor for parameter in term.parameters]
    return (*own, "rebound", "loss", "loss_speed")


def _name(term: Term) -> str:
    return "".join(c if c.isalnum() else "_" for c in term.id)


def _calls(terms: Sequence[Term], hook: str, fixed: str) -> list[str]:
    found = []
    for term in terms:
        if hook in term.hooks:
            own = [f"p.{_name(term)}_{argument}" for argument in term.arguments(hook)]
            found.append(f"{_name(term)}__{hook}({', '.join(filter(None, (fixed, *own)))})")
    return found


def _settling(terms: Sequence[Term]) -> list[Term]:
    """The terms by which the ground gives way for good."""
    return [term for term in terms if {"settle", "settled"} & set(term.hooks)]


def _bent_energy(terms: Sequence[Term]) -> list[str]:
    """Lines that integrate the force of unloading: whatever the law and its changes, no closed form holds for all.

    Gauss and Legendre's nodes in u with x = z u^2, so that forces that begin with a power of depth are smooth in u.
    """
    out = ["    stored = 0.0"]
    for node, weight in zip(*np.polynomial.legendre.leggauss(8), strict=True):
        u = 0.5 * (1.0 + node)
        out += [f"    x = {float(u * u)!r} * z", "    part = law_loading(x, q)", "    work = law_loading_work(x, q)"]
        out += [f"    part, work = {call}" for call in _calls(terms, "stiffen", "x, part, work")]
        out += [f"    part = {call}" for call in _calls(terms, "unload", "x, top, part")]
        out += [f"    stored = stored + {float(weight * u)!r} * z * part"]
    return out


def _yielding(every: Sequence[Term]) -> list[str]:
    """The functions of ground that gives way, is carried along, and keeps its craters."""
    out = ["def wall(p):", "    slope = 0.0"]
    out += [f"    slope = max(slope, {call})" for call in _calls(every, "wall", "")]
    out += ["    return slope\n"]
    terms = _settling(every)
    for k, term in enumerate(terms):
        (speed,) = _calls([term], "settle", "s, depth, slip, lean, gone") or ["0.0"]
        out += [f"def settle_{k}(p, s, depth, slip, lean, gone):", f"    return {speed}\n"]
    # At rest each has given way by its share r of what the others leave: by r / (1 - r) of what the law reads.
    out += ["def over_read(p, s):", "    more = 0.0"]
    for call in _calls(every, "settled", "s"):
        out += [f"    share = {call}", "    more = more + share / (1.0 - share)"]
    out += ["    return more\n"]
    for k, term in enumerate(terms):
        (share,) = _calls([term], "settled", "s") or ["0.0"]
        out += [f"def settled_{k}(p, s):", f"    share = {share}"]
        out += ["    return share / (1.0 - share) / (1.0 + over_read(p, s))\n"]
    out += ["def settled_share(p, s):", "    more = over_read(p, s)", "    return more / (1.0 + more)\n"]
    out += ["def added(p, depth):", "    mass = 0.0", "    slope = 0.0"]
    for call in _calls(every, "added_mass", "depth"):
        out += [f"    more, steeper = {call}", "    mass = mass + more", "    slope = slope + steeper"]
    return [*out, "    return mass, slope\n"]


def model_source(terms: Sequence[Term], law: SurfaceLaw) -> str:
    """The text of the functions for these effects and this law."""
    every = (*BASE, *terms)
    out: list[str] = []

    def sums(name: str, hook: str, targets: tuple[str, ...]) -> None:
        out.append(f"def {name}(p, s):")
        out.extend(f"    {target} = 0.0" for target in targets)
        parts = tuple(f"{target}_" for target in targets)
        for call in _calls(every, hook, "s"):
            out.append(f"    {', '.join(parts)} = {call}")
            out.extend(f"    {target} = {target} + {part}" for target, part in zip(targets, parts, strict=True))
        out.append(f"    return {', '.join(targets)}\n")

    out += ["def vertical(p):", "    x = 0.0", "    y = 1.0"]
    out += [f"    x, y = {call}" for call in _calls(every, "up", "")]
    out += ["    return x, y\n", "def tip_radius(p):", "    radius = 0.0"]
    out += [f"    radius = radius + {call}" for call in _calls(every, "tip_radius", "")]
    out += ["    return radius\n", "def torque_factor(p, s):", "    factor = 1.0"]
    out += [f"    factor = factor * {call}" for call in _calls(every, "torque_factor", "s")]
    out += ["    return factor\n"]
    sums("inertia", "mass", ("xx", "xy", "yy", "xt", "yt", "tt"))
    sums("applied", "force", ("x", "y", "turn"))
    sums("potential", "potential", ("energy",))
    sums("losses", "loss", ("power",))
    out += ["def dry_friction(p, s):", "    vertical = 0.0", "    rotation = 0.0"]
    out += [f"    vertical = vertical + {call}" for call in _calls(every, "vertical_friction", "s")]
    out += [f"    rotation = rotation + {call}" for call in _calls(every, "rotation_friction", "s")]
    out += ["    return vertical, rotation\n", "def inner_start(p, s):", "    at = 0.0"]
    out += [f"    at = {call}" for call in _calls(every, "inner_start", "s")]
    out += ["    return at\n", "def inner(p, s):", "    mass = 0.0", "    force = 0.0", "    holds = 1.0"]
    for hook in ("mass", "force", "holds"):
        out += [f"    {hook} = {call}" for call in _calls(every, f"inner_{hook}", "s")]
    out += ["    return mass, force, holds\n", "def plastic_share(p):", "    left = 1.0"]
    out += [f"    left = left * (1.0 - {call})" for call in _calls(every, "crater", "")]
    out += ["    return 1.0 - left\n", "def hollow(p):", "    open = 0.0"]
    out += [f"    open = max(open, {call})" for call in _calls(every, "hollow", "")]
    out += ["    return open\n", "def crater(p):", "    f = plastic_share(p)"]
    if law.has_memory:
        out += ["    f = f + (1.0 - f) * (1.0 - p.rebound)"]
    out += ["    if hollow(p) > 0.0:", "        f = 0.0", "    return f\n"]
    out += _yielding(every)
    out += ["def contact(p, s, q, depth, rate, slip, top, held):", "    whole = depth + s.given_way"]
    if _calls(every, "crater", ""):
        out += ["    f = plastic_share(p)", "    z = (depth - f * top) / (1.0 - f)", "    left = 1.0 - f"]
        out += ["    damped = z", "    if hollow(p) > 0.0:", "        z = max(z, 0.0)", "        damped = depth"]
    else:
        out += ["    z = depth", "    damped = z"]
    at = "top" if law.has_memory else "z"
    out += [f"    elastic = law_loading({at}, q)", f"    stored = law_loading_work({at}, q)"]
    out += [f"    elastic, stored = {call}" for call in _calls(every, "stiffen", f"{at}, elastic, stored")]
    if law.has_memory:
        out += ["    stored = law_springback_energy(z, top, p.rebound, elastic)"]
        out += ["    elastic = elastic * law_springback(z, top, p.rebound)"]
        out += ["    retreat = elastic * (law_retreat_share(rate, p.loss, p.loss_speed) - 1.0)"]
    if _calls(every, "unload", "") and not law.has_memory:
        out += _bent_energy(every)
        out += [f"    elastic = {call}" for call in _calls(every, "unload", "z, top, elastic")]
    if _calls(every, "crater", ""):
        out += ["    stored = left * stored"]
    for call in _calls(every, "hold", "s, depth, held"):
        out += [f"    pull, work = {call}", "    elastic = elastic - pull", "    stored = stored + work"]
    out += ["    lost = law_rate_force(damped, rate, q)" + (" + retreat" if law.has_memory else "")]
    out += [f"    lost = lost + {call}" for call in _calls(every, "rate_force", "s, whole, rate")]
    out += [f"    lost = lost + {call}" for call in _calls(every, "rate_pull", "s, depth, rate, held")]
    out += ["    side = 0.0"]
    out += [f"    side = side + {call}" for call in _calls(every, "side_force", "s, whole, slip")]
    out += ["    factor_s = 1.0", "    factor_d = 1.0"]
    for call in _calls(every, "friction_factor", "s, slip"):
        out += [f"    more_s, more_d = {call}", "    factor_s = factor_s * more_s", "    factor_d = factor_d * more_d"]
    out += ["    grip = 0.0"]
    out += [f"    grip = grip + {call}" for call in _calls(every, "grip", "s, depth, held")]
    out += ["    return elastic, lost, stored, side, factor_s, factor_d, grip\n"]
    return "\n".join(out)


def _hooks(terms: Sequence[Term], law: SurfaceLaw) -> dict[str, Callable[..., Any]]:
    own = {f"{_name(term)}__{hook}": function for term in (*BASE, *terms) for hook, function in term.hooks.items()}
    return own | {
        "law_loading": law.loading,
        "law_loading_work": law.loading_work,
        "law_rate_force": law.rate_force,
        "law_springback": springback,
        "law_springback_energy": springback_energy,
        "law_retreat_share": retreat_share,
        "contact_arms": contact_arms,
        "divide_mass": divide_mass,
    }


@lru_cache(maxsize=256)
def assemble(terms: tuple[Term, ...], ground: str, *, taichi: bool = False) -> Model:
    """The model of these effects on the ground called `ground`, for Python or for Taichi.

    Raises ValueError for two effects that each have a coordinate of their own.
    """
    law, terms = find_law(ground), tuple(term for term in terms if not term.sensor)
    inner = [term.id for term in terms if "inner_mass" in term.hooks]
    if len(inner) > 1:
        raise ValueError(f"effects {' and '.join(map(repr, inner))} each have a coordinate of their own: one at most")
    text = model_source(terms, law)
    written = re.findall(r"^def (\w+)", text, re.MULTILINE)
    file = f"<planar model {ground} {'+'.join(term.id for term in terms) or 'base'} {id(terms):x} {taichi}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # where Taichi reads it
    functions: dict[str, Any] = dict(_hooks(terms, law))
    if taichi:
        functions = {name: for_taichi(function) for name, function in functions.items()}
    exec(compile(text, file, "exec"), functions)
    if taichi:
        from hedgebed_taichi import ti

        for name in written:  # in the order in which they call each other
            functions[name] = ti.func(functions[name])
    shown = (*written, "contact_arms", "divide_mass")
    return Model(terms, law, {name: functions[name] for name in shown})


def for_taichi(function: Callable[..., Any]) -> Any:
    """`function`, compiled by Taichi from its source, with Taichi's mathematics; functions of other modules too."""
    from hedgebed_taichi import ti

    code, around = function.__code__, function.__globals__
    names = {name: getattr(ti, name) for name in _MATHEMATICS if name in code.co_names}
    for name, other in ((name, around.get(name)) for name in code.co_names):
        if isinstance(other, types.FunctionType) and other.__globals__ is not around:
            names[name] = for_taichi(other)
    twin = types.FunctionType(code, around | names, function.__name__, function.__defaults__)
    twin.__module__ = function.__module__
    return ti.func(twin)


def make_parameters(terms: Sequence[Term]) -> type:
    """The class of `p` for Python: a record with the fields of `parameter_names`."""
    return type("Parameters", (), {"__slots__": parameter_names(terms)})


def contact_arms(cosine, sine, length, radius):
    """h and d [m] of a spike whose angle has this cosine and sine."""
    return (length - radius) * cosine + radius, (length - radius) * sine


def divide_mass(xx, xy, yy, xt, yt, tt, fx, fy, ft):
    """M^-1 f for the symmetric mass matrix, by L D L^T; without off-diagonal entries f / diagonal, to the bit."""
    ax = fx / xx
    ay = fy / yy
    at = ft / tt
    if xy != 0.0 or xt != 0.0 or yt != 0.0:
        a = xy / xx
        b = xt / xx
        d2 = yy - a * xy
        c = (yt - b * xy) / d2
        d3 = tt - b * xt - c * (c * d2)
        g2 = fy - a * fx
        at = (ft - b * fx - c * g2) / d3
        ay = g2 / d2 - c * at
        ax = fx / xx - a * ay - b * at
    return ax, ay, at
