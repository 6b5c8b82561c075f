"""What campaign.toml leaves out and what follows from that: speeds of pushes, and uncertainties."""

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, Recording

from .pushes import down
from .words import Finding, say

__all__ = ["find_unstated"]

_FEWEST = 12  # rows of a push that show its speed
_ENDS = (0.2, 0.8)  # shares of the depth between which the speed is measured
_STEADY = 0.02  # share of the depth that a push of constant speed may depart from a straight line
_SAME = 1.1  # ratio up to which two speeds are one


def find_unstated(campaign: Campaign) -> list[Finding]:
    """A finding for pushes of different speeds of which none is stated, and one for uncertainties that are missing."""
    return [Finding(trial="", what=what) for what in (_speeds(campaign), _uncertainty(campaign)) if what]


def _uncertainty(campaign: Campaign) -> str:
    """That numbers without an uncertainty count as exact; empty where all are stated."""
    tables = campaign.tables
    if isinstance(tables, PenetrationCampaign):
        surface, stated = tables.surface, tables.uncertainty.model_fields_set
        values = {"stiffness": f"{surface.stiffness:g} N/m", "damping": f"{surface.damping:g} N s/m"}
        exact = [f"{name} = {value}" for name, value in values.items() if name not in stated]
        return say("exact", exact=" and ".join(exact)) if exact else ""
    return "" if "uncertainty" in tables.model_fields_set else say("all_exact")


def _speeds(campaign: Campaign) -> str:
    """The speeds that pushes without a stated one show, where they differ; empty where there is nothing to state."""
    tables = campaign.tables
    if not isinstance(tables, PenetrationCampaign):
        return ""
    shown: dict[str, float] = {}
    for trial in tables.trial:
        data = campaign.recording(trial.id, "data")
        if trial.mode != "driven" or trial.speed is not None or data is None:
            continue
        if (speed := _steady_speed(data)) is not None:
            shown[trial.id] = speed
    ordered = sorted(shown, key=lambda id: shown[id])
    groups: list[list[str]] = []
    for id in ordered:
        if groups and shown[id] <= _SAME * shown[groups[-1][0]]:
            groups[-1].append(id)
        else:
            groups.append([id])
    if len(groups) < 2:
        return ""
    listed = "; ".join(
        f"{float(np.median([shown[id] for id in group])):.2g} m/s for {', '.join(sorted(group))}" for group in groups
    )
    return say("speeds_unstated", count=len(shown), listed=listed)


def _steady_speed(data: Recording) -> float | None:
    """Speed of a push during loading [m/s]; None where it is not constant, or too few rows show it."""
    found = down(data, fewest=_FEWEST)
    if found is None:
        return None
    time, depth, _ = found
    deepest = float(depth.max())
    middle = (depth > _ENDS[0] * deepest) & (depth < _ENDS[1] * deepest)
    if middle.sum() < _FEWEST or np.ptp(time[middle]) <= 0:
        return None
    line = np.polynomial.Polynomial.fit(time[middle], depth[middle], 1)
    rest = depth[middle] - line(time[middle])
    speed = float(line.deriv()(0.0))
    return speed if speed > 0 and float(np.sqrt(np.mean(rest**2))) < _STEADY * deepest else None
