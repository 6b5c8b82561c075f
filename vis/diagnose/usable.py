"""Whether a diagnosis has a K to use, which report and sentences put first, and to which depth that K belongs."""

from collections.abc import Mapping
from typing import Any

__all__ = ["gap_in_scatter", "has_numbers_to_use", "secant_depth", "stiffness_words"]

_OF_POWER = "K * z * (z / D)^"  # how an equation begins in which K is F / z at z = D alone


def gap_in_scatter(diagnosis: Mapping[str, Any], part: str, stage: str = "after") -> dict[str, Any]:
    """The gap with the scatter of replicates of a diagnosis as a fitted number: its standard error is a jackknife over
    trials, so it has one degree of freedom less than there are trials. ``part``: "fit" or "held_out"."""
    weighed = diagnosis["gap_with_scatter"]
    trials = weighed.get("trials", {}).get(part)
    freedom = {} if trials is None or trials < 2 else {"freedom": trials - 1}
    return {"value": weighed[stage][part], "std": weighed.get(f"{stage}_std", {}).get(part), "unit": "1", **freedom}


def has_numbers_to_use(diagnosis: Mapping[str, Any]) -> bool:
    """Whether the best model's K describes the ground: of pushes and drops, where the verdict is not unknown, and no
    number of the base model went far from what was stated."""
    far = any(bound["sigmas"] is not None for bound in diagnosis.get("at_bounds", {}).get("after", []))
    return diagnosis.get("kind") == "penetration" and diagnosis["verdict"] != "unknown" and not far


def secant_depth(diagnosis: Mapping[str, Any]) -> float | None:
    """The depth D [m] to which K is a secant, K = F / z at z = D; None where K is the same at every depth or the slope
    at the surface."""
    powers = any(row["equation"].startswith(_OF_POWER) for row in diagnosis.get("equations", []))
    depth: float | None = diagnosis.get("typical_depth_m")
    return depth if powers else None


def stiffness_words(diagnosis: Mapping[str, Any]) -> str:
    """What K is beside the forms of the best model, such as "slope at the surface"; empty beside a straight spring."""
    depth = secant_depth(diagnosis)
    secant = [] if depth is None else [f"F / z at the depth D = {1e3 * depth:.3g} mm"]
    rows = [row for row in diagnosis.get("equations", []) if not row["equation"].startswith(_OF_POWER)]
    return ", ".join([*secant, *(row["stiffness"] for row in rows if "stiffness" in row)])
