"""The numbers of a tumble on grains beside those of the spring-damper, and in words which way each went."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vis.page.numbers import short
from vis.page.sentences import label_of

__all__ = ["HEAD", "beside_rows", "beside_words"]

Quantities = Mapping[str, Mapping[str, Any]]
HEAD = ("", "grains", "spring-damper")
_ROWS = (
    ("trajectory_angle", "trajectory angle", 180 / math.pi, "°"),
    ("max_speed", "largest speed", 1.0, " m/s"),
    ("max_angular_velocity", "largest dθ/dt", 1.0, " rad/s"),
    ("transition_angle_slip", label_of("transition_angle_slip"), 180 / math.pi, "°"),
    ("transition_angle_hop", label_of("transition_angle_hop"), 180 / math.pi, "°"),
    ("sinkage_start", "sinkage as the torque begins", 1e3, " mm"),
    ("sinkage_largest", "sinkage of the deepest row", 1e3, " mm"),
)


def beside_rows(own: Quantities, beside: Quantities) -> list[tuple[str, str, str]]:
    """What the number is, on grains, on the spring-damper: of the quantities of a result, as words."""
    rows = []
    for name, label, scale, unit in _ROWS:
        values = [side.get(name, {}).get("value") for side in (own, beside)]
        cells = ["–" if value is None else f"{short(scale * value, 3)}{unit}" for value in values]
        rows.append((label, cells[0], cells[1]))
    return rows


def beside_words(own: Quantities, beside: Quantities) -> str:
    """Whether the platform went up or down in its first 10 mm, and on the spring-damper, in a sentence."""
    angles = [side["trajectory_angle"]["value"] for side in (own, beside)]
    words = [None if angle is None else _way(float(angle)) for angle in angles]
    if words[0] is None and words[1] is None:
        return "It does not get 10 mm away in this time, nor does it on the spring-damper."
    if words[0] is None:
        return f"It does not get 10 mm away in this time; on the spring-damper it goes {words[1]}."
    if words[1] is None:
        return f"It goes {words[0]}; on the spring-damper it does not get 10 mm away in this time."
    same = words[0].split()[0] == words[1].split()[0]
    return f"It goes {words[0]}; on the spring-damper {'it goes' if same else 'it would go'} {words[1]}."


def _way(angle: float) -> str:
    """A trajectory angle [rad] in words: up, down or level, and the degrees."""
    degrees = math.degrees(angle)
    signed = f"{degrees:+.1f}".replace("-", "−")
    if signed[1:] == "0.0":
        return "level (0.0 degrees)"
    return f"{'up' if degrees > 0 else 'down'} ({signed} degrees)"
