"""Where the states of a paper trial change: the slip that ends in a hop, the first hop, and angles read off Figure 6.

The paper calls transition angles of model and measurement in agreement within five degrees, but prints the measured
ones in a figure only. Whoever has read them off gives them as `SURFACE-TORQUE-STATE=DEGREES`, "brick-0.125-hop=20".
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from vis.page.sentences import Sentences

__all__ = ["HARD", "TRANSITIONS", "hop_words", "measured_angles", "slip_before_hop", "transition_angle"]

say = Sentences(__package__)

HARD = ("steel", "brick")
"""The surfaces of Figures 5 to 7."""
TRANSITIONS = ("slip", "hop")
"""The states of which the angle at entry is compared."""


def slip_before_hop(case: Mapping[str, Any]) -> float | None:
    """Theta [rad] where the slip begins that ends in the first hop; None without a hop or without such a slip.

    A step of the torque shakes the spikes loose for some 50 ms before a pivot holds. So the first slip of all, that of
    `transition_angle_slip`, can be another one.
    """
    states = case["transitions"]
    first = next((k for k, (_, state, _) in enumerate(states) if state == "hop"), None)
    if not first or states[first - 1][1] != "slip":
        return None
    return float(states[first - 1][2])


def transition_angle(case: Mapping[str, Any], state: str) -> float | None:
    """Theta [degrees] of the first hop, or of the slip that ends in it; None where there is none."""
    angle = case["transition_angle_hop"] if state == "hop" else slip_before_hop(case)
    return None if angle is None else math.degrees(angle)


def hop_words(case: Mapping[str, Any]) -> str:
    """Surface, torque, and how long and how high the first hop is, for a reader."""
    where, launch = f"{case['surface']} {case['torque']:g} N m", case["launch"]
    if not launch:
        return f"{where} none"
    least = "" if launch["landed"] else "at least "
    height = 1e3 * launch["height"]
    return say("hops_hop", where=where, least=least, lasts=launch["lasts"], time=launch["time"], height=height)


def measured_angles(
    entries: Sequence[str], *, surfaces: Sequence[str], torques: Sequence[float]
) -> dict[tuple[str, float, str], float]:
    """Angles [degrees] by (surface, torque, state), from `SURFACE-TORQUE-STATE=DEGREES`.

    Raises ValueError, naming the entry and what is allowed, for one of another form, of no such trial, or given twice.
    """
    found: dict[tuple[str, float, str], float] = {}
    for entry in entries:
        name, _, value = entry.partition("=")
        surface, _, rest = name.partition("-")
        torque_text, _, state = rest.rpartition("-")
        try:
            torque, degrees = float(torque_text), float(value)
        except ValueError:
            raise ValueError(say("angles_form", entry=entry)) from None
        known = {"surface": (surface, surfaces), "torque": (torque, torques), "state": (state, TRANSITIONS)}
        for key, (given, allowed) in known.items():
            if given not in allowed:
                there = ", ".join(map(str, allowed))
                raise ValueError(say("angles_of_none", entry=entry, key=key, given=given, allowed=there))
        if not math.isfinite(degrees):
            raise ValueError(say("angles_not_finite", entry=entry))
        if (surface, torque, state) in found:
            raise ValueError(say("angles_twice", name=name))
        found[surface, torque, state] = degrees
    return found
