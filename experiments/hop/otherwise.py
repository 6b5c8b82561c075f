"""What the answer of a hop depends on most: the answer again with other friction, inertia or wheel.

All on rigid ground. For a distance the answer is the effort (speed of a braked wheel, torque of a motor), for a given
effort it is the distance.
"""

import math
from dataclasses import replace

from scipy.optimize import brentq

from experiments.runs.types import Json

from .numbers import HopPlan
from .search import Hop, hop_by, means_of
from .settings import HopSettings, say

__all__ = ["FACTORS", "otherwise", "otherwise_words"]

FACTORS = {"mu_s": (0.5, 2.0), "inertia": (0.8, 1.2), "wheel_inertia": (0.8, 1.2)}
"""Number -> by which factors it is moved; with mu_s goes mu_d."""
WIDEST = 16.0
"""The effort is sought up to so many times below and above that of the hop."""
CLOSE = 1e-3
"""How close, as a share, the distance must be met."""


def otherwise(settings: HopSettings, plan: HopPlan, hop: Hop) -> dict[str, Json]:
    """Number -> its factors, and the answer for each; None where there is none."""
    found: dict[str, Json] = {}
    for name, factors in FACTORS.items():
        answers = [_answer(settings, _moved(plan, name, factor), hop) for factor in factors]
        found[name] = {"factors": list(factors), "values": answers, "unit": _unit(settings, plan)}
    return found


def otherwise_words(settings: HopSettings, found: dict[str, Json]) -> str:
    """A sentence on the answers of `otherwise`."""
    spans = [
        say(f"if_{name}", span=_span(entry)) for name, entry in found.items() if None not in entry["values"]
    ]  # fmt: skip
    what = {"distance": "brake_effort" if settings.actuator == "brake" else "motor_effort"}.get(settings.asks_for)
    return say("otherwise", what=say(what or "reach"), spans=", ".join(spans)) if spans else ""


def _span(entry: Json) -> str:
    low, high = sorted(entry["values"])
    return f"{low:.3g} to {high:.3g} {entry['unit']}"


def _unit(settings: HopSettings, plan: HopPlan) -> str:
    if plan.distance is None:
        return "m"
    return "rad/s" if settings.actuator == "brake" else "N m"


def _moved(plan: HopPlan, name: str, factor: float) -> HopPlan:
    if name == "wheel_inertia":
        return replace(plan, wheel=replace(plan.wheel, inertia=factor * plan.wheel.inertia))
    tumbler = plan.tumbler
    if name == "inertia":
        return replace(plan, tumbler=replace(tumbler, inertia=factor * tumbler.inertia))
    mu_s, mu_d = factor * tumbler.mu_s, factor * tumbler.sliding_friction
    return replace(plan, tumbler=replace(tumbler, mu_s=mu_s, mu_d=mu_d))


def _answer(settings: HopSettings, plan: HopPlan, hop: Hop) -> float | None:
    """The distance [m] by the effort of `hop`, or the effort for the distance of the plan."""
    try:
        means = means_of(plan, settings)
        if plan.distance is None:
            there = hop_by(settings, means, hop.effort)
            return there.flight.distance if there is not None and there.flight is not None else None
    except (ValueError, RuntimeError):
        return None
    distance = plan.distance

    def missed(effort: float) -> float:
        there = hop_by(settings, means, effort)
        if there is None:
            return -distance
        return (there.flight.distance if there.flight is not None else 1e3 * distance) - distance

    low = high = hop.effort
    try:
        at_low = at_high = missed(hop.effort)
        while at_low > 0 and low > max(means.least, hop.effort / WIDEST):
            low = max(0.7 * low, means.least)
            at_low = missed(low)
        while at_high < 0 and high < min(means.most, hop.effort * WIDEST):
            high = min(1.4 * high, means.most)
            at_high = missed(high)
        if at_low > 0 or at_high < 0:
            return None
        effort = float(brentq(missed, low, high, rtol=1e-6)) if low < high else hop.effort
        return effort if math.isclose(missed(effort), 0.0, abs_tol=CLOSE * distance) else None
    except (ValueError, RuntimeError):
        return None
