"""The equation of each form of an effect, in the names of its parameters as diagnosis.json and model.toml have them.

Of penetration an equation that begins with + or - is added to F = K z + C max(v, 0); another one stands for K z.
Clauses after the first define what it uses, or say when it holds. `penetration_law` and `rigid.terms` compute them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .problem import Form

__all__ = ["PENETRATION", "SYMBOLS", "TUMBLE", "equation", "equations_of", "with_comments"]

_TABLE, _WIDE = "[[effect]]\n", 118

_INSIDE = "inside = 1 / (1 + exp(-(z - layer_depth) / layer_width))"
_HELD = "x = r / pull_reach, p = pull_sharpness"
_BACK = "at = (z - crater_share * z_m) / (1 - crater_share)"

PENETRATION = {
    "depth-hardening:power": "K * z * (z / D)^hardening_power",
    "depth-hardening:quadratic": "K * z * (1 + hardening_quadratic * z / D)",
    "depth-hardening:with a power": "K * z * (1 + hardening_quadratic * (z / D)^(1 + hardening_steeper))",
    "depth-hardening:cubic": "K * z * (1 + hardening_cubic * (z / D)^2)",
    "depth-hardening:exponential": "K * z * (exp(h) - 1) / h, h = hardening_exponential * z / D",
    "depth-hardening:locking": "K * z / max(1 - hardening_locking * z / D, 0.05)",
    "depth-hardening:early": "K * z + hardening_early * (1 - exp(-z / hardening_reach))",
    "depth-hardening:levelling off":
        "K * z / (1 + x^hardening_sharpness)^(1 / hardening_sharpness), x = hardening_level * z / D",
    "layering:slope":
        "+ layer_slope * max(z - layer_depth, 0), its corner rounded over layer_width",
    "layering:factor": f"K * z * (1 + layer_factor * inside), {_INSIDE}",
    "layering:step": f"+ layer_step * inside, {_INSIDE}",
    "layering:crust": "+ layer_bump * exp(-((z - layer_depth) / layer_width)^2 / 2)",
    "inertial-drag:square": "+ drag * v^2, while it goes in",
    "inertial-drag:with an onset": "+ drag_onset * (1 - exp(-z / drag_reach)) * v^2, while it goes in",
    "inertial-drag:growing with depth": "+ drag_deep * z / D * v^2, while it goes in",
    "inertial-drag:of the tip": "+ drag_tip * u * (2 - u) * v^2, u = min(z / H, 1), while it goes in",
    "inertial-drag:both ways": "+ drag_both * v * abs(v)",
    "plastic-sinkage:crater": f"K * at, {_BACK}, on the way back, for K z and what changes it; never below 0",
    "plastic-sinkage:curved crater":
        f"K * at * (at / z_m)^crater_bend, {_BACK}, on the way back, for K z and what changes it; never below 0",
    "plastic-sinkage:stiffer unloading":
        "K * z_m - K * (1 + unload_stiffness) * (z_m - z), on the way back; never below 0",
    "adhesion:held": f"- pull * x / (1 + x^p)^(1 / p), {_HELD}",
    "adhesion:held by depth": f"- pull_deep * (z_m / D)^pull_growth * x / (1 + x^p)^(1 / p), {_HELD}",
    "adhesion:held wherever it has been":
        f"- pull_ever * (z_m / D)^pull_growth * x / (1 + x^p)^(1 / p), {_HELD}, also after it was out",
    "adhesion:held and let go": "- pull_short * x * exp(1 - x), x = r / pull_reach",
    "adhesion:viscous": "- pull_viscous * abs(v), on the way out",
    "shaft-friction:constant": "+ shaft * sign(v)",
    "shaft-friction:growing with depth": "+ shaft_deep * z / D * sign(v)",
    "shaft-friction:by a power of depth": "+ shaft_power * (z / D)^shaft_growth * sign(v)",
    "shaft-friction:viscous": "+ shaft_viscous * v",
    "shaft-friction:falling with speed": "+ shaft_slow * exp(-abs(v) / shaft_speed) * sign(v)",
    "shaft-friction:mobilised over a way":
        "+ shaft_held * (z / D)^shaft_growth * w, dw = (sign(dz) - w) * abs(dz) / shaft_reach",
}  # fmt: skip
"""By the id of the form: what it makes of the force F [N] on the spike."""


def _times(text: str, factor: str, *clauses: str) -> str:
    """An equation with one more factor, and the clauses that define it."""
    first, *rest = text.split(", ")
    return ", ".join([f"{first} * {factor}", *clauses, *rest])


_SETS_IN = "y / (1 + y^q)^(1 / q)"
_HELDS = ("held", "held by depth", "held wherever it has been")
_ONSET = " * (1 - exp(-z / drag_reach))"
_BENT: tuple[tuple[str, tuple[str, ...], str, Callable[[str], str]], ...] = (
    ("inertial-drag", ("with an onset",), "as sharp as it is",
     lambda text: _times(text.replace(_ONSET, ""), _SETS_IN, "y = z / drag_reach", "q = drag_sharpness")),
    ("shaft-friction", ("constant", "by a power of depth", "falling with speed", "mobilised over a way"), "setting in",
     lambda text: _times(text, _SETS_IN, "y = z / shaft_onset", "q = shaft_sharpness")),
    ("shaft-friction", ("constant", "growing with depth", "by a power of depth"), "rising with speed",
     lambda text: _times(text, "tanh(abs(v) / shaft_rise)")),
    ("adhesion", _HELDS, "fading towards the surface",
     lambda text: _times(text, _SETS_IN, "y = z / pull_fade", "q = pull_fade_sharpness")),
    ("adhesion", _HELDS, "on the way out", lambda text: text + "; times 1 - pull_out where it sinks again"),
    ("adhesion", _HELDS, "letting go", lambda text: _times(text, "exp(-r / pull_let)")),
    ("plastic-sinkage", ("crater", "curved crater", "stiffer unloading"), "empty",
     lambda text: text + "; where that is 0, C times 1 - crater_open"),
)  # fmt: skip
"""Shapes in the order in which they are laid upon one another: effect, plain forms, name, what becomes of a text."""


def _bend(form: str, plain: str, ways: Sequence[tuple[str, tuple[str, ...], str, Callable[[str], str]]]) -> None:
    for place, (effect, of, name, made) in enumerate(ways):
        if plain in [f"{effect}:{one}" for one in of]:
            PENETRATION[f"{form}, {name}"] = made(PENETRATION[form])
            _bend(f"{form}, {name}", plain, ways[place + 1 :])


for _plain in tuple(PENETRATION):
    _bend(_plain, _plain, _BENT)

TUMBLE = {
    "wheel-vibration": "mu_s and mu_d times 1 - reduction * w^power / (w^power + speed^power), w the wheel's speed",
    "pendulum": "- m_b * g * (x - offset) / length along the surface; with arc = 1 on the arc of that length",
    "com-offset": "the centre of mass at x, y of the body's axes from the shaft: m * g * (its height) in V, and its "
                  "motion about the shaft in T",
    "slope": "gravity and wires along (-sin(angle), -cos(angle)) of the surface's axes",
    "tip-radius": "the lowest point of a ball of that radius touches, its centre l - radius from the platform's",
    "rig-friction": "- force * (1 + excess * exp(-(v / speed)^2)) * sign(v) along the wires, v the vertical speed; "
                    "excess 0 where it is not named",
    "pulley-inertia": "mass * (vertical speed)^2 / 2 in T",
    "torque-fade": "the torque times max(0, 1 - (speed_loss * w)^speed_power - (time_loss * t)^time_power), w the "
                   "wheel's speed; powers that are not named are 1",
    "inertial-drag": "+ normal * rate^power while a tip goes in (power 2 where it is not named), - sideways * u * "
                     "abs(u) while it slides at u",
    "depth-hardening": "the law's force times (z / reference)^(exponent - 1), or times 1 + bend * z (bend below 0: "
                       "over 1 - bend * z)",
    "plastic-sinkage": "on the way back the law's force at (z - share * z_m) / (1 - share), times (that over z_m)^a, "
                       "a = bend * (1 - exp(-20 * share)); z_m the deepest depth since it touched; with open = 1 a "
                       "tip above the bottom of its crater still touches: the torque and the damper act",
    "adhesion": "- force * ((1 - sharpness) * (1 - exp(-x)) + sharpness * tanh(x)), x = (z_m - z) / reach the way "
                "back; friction keeps the share grip of it (both 0 where they are not named); with a speed it "
                "acts while the tip goes out at v, times 1 - exp(-v / speed)",
    "rate-friction": "mu_d times 1 + change * abs(u)^power / (abs(u)^power + speed^power), u the sliding speed, power "
                     "1 where it is not named",
    "umbilical": "a torque - stiffness * a * abs(a)^(spring_power - 1) - drag * omega * abs(omega)^(drag_power - 1), "
                 "a = theta - rest, powers 1 and rest 0 where they are not named",
    "bearing-drag": "a torque - torque * (1 + excess * exp(-(omega / speed)^2)) * sign(omega); excess 0 where it is "
                    "not named",
    "clock-offset": "the IMU's time = (1 + drift) * t + offset",
    "camera-scale": "x and y as seen = (scale + bend * d^2) times the true ones, d the distance from the start",
}  # fmt: skip
"""By the name of the effect, whose forms have parameters of one equation."""

SYMBOLS = (
    "F is the force on the spike [N], z the depth and v the speed, downwards, z_m the deepest depth so far, "
    "r = z_m - z the way back, D the typical depth (`reference` in model.toml), H the height over which the tip "
    "widens, K and C the stiffness and damping after the fit; an equation that begins with + or - is added to "
    "F = K z + C max(v, 0), another one stands for K z; where several do, their factors of K z multiply, and what they "
    "add to K z is added. K is F / z where the factor is 1: for a power of z / D alone at z = D, a secant and not the "
    "stiffness at the surface"
)
"""What the equations of penetration have in common."""


def equation(kind: str, form: Form) -> str:
    """The equation of a form of trials of that kind; empty of an effect from a file."""
    if kind == "penetration":
        return PENETRATION.get(form.id, "")
    return TUMBLE.get(form.effect, "")


def equations_of(kind: str, forms: Sequence[Form], units: Callable[[Form], Mapping[str, str]]) -> list[dict[str, Any]]:
    """``equations`` of diagnosis.json: effect, form, equation and its parameters' units, a row for each ``[[effect]]``
    of model.toml: of penetration one a form, of tumbles one an effect. `units`: of a form, name -> unit."""
    rows: dict[str, dict[str, Any]] = {}
    for form in forms:
        key = form.id if kind == "penetration" else form.effect
        row = rows.setdefault(key, {"effect": form.effect, "form": form.name, "equation": equation(kind, form),
                                    "units": {}})  # fmt: skip
        row["units"] |= dict(units(form))
    return list(rows.values())


def with_comments(model: str, rows: Sequence[Mapping[str, Any]], kind: str) -> str:
    """model.toml with the equation of each ``[[effect]]`` in a comment above it."""
    head, *tables = model.split(_TABLE)
    if len(tables) != len(rows):
        return model
    symbols = textwrap.fill(SYMBOLS, _WIDE, initial_indent="# ", subsequent_indent="# ") + "\n"
    text = head + (symbols if kind == "penetration" and tables else "")
    for table, row in zip(tables, rows, strict=True):
        said = f"{row['effect']} ({row['form']}): {row['equation'] or 'its equation is in its file'}"
        units = ", ".join(f"{name} [{unit}]" for name, unit in row["units"].items())
        text += textwrap.fill(f"{said}; {units}", _WIDE, initial_indent="# ", subsequent_indent="#   ") + "\n"
        text += _TABLE + table
    return text
