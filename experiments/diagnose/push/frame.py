"""The depth of the tip of pushes whose depth is read at a drive, behind a frame of known stiffness."""

from dataclasses import replace

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign
from rigid.checks import check_above_zero

__all__ = ["at_the_tip"]


def at_the_tip(campaign: Campaign, frame_stiffness: float | None) -> Campaign:
    """The campaign with the depth of the tip in its pushes: the depth as read less force / `frame_stiffness`.

    A linear spring k in series between drive and tip. Behind it the ground's spring K and damper C read as
    K / (1 + K / k) and, at a constant speed, C / (1 + K / k)^2, since the tip is also slower than the drive. So pushes
    cannot determine k. Another measurement can, such as a push against a rigid stop. Drops have no drive, so their
    depth stays. A row without a force takes that between its neighbours. The noise of the force over k is not counted.

    Args:
        campaign: trials of kind "penetration".
        frame_stiffness: k [N/m]; None: the campaign is returned unchanged.

    Raises ValueError for a k that is not above 0, and for a campaign without pushes.
    """
    if frame_stiffness is None:
        return campaign
    check_above_zero("N/m", frame_stiffness=frame_stiffness)
    tables = campaign.tables
    pushes = [t for t in tables.trial if t.mode == "driven"] if isinstance(tables, PenetrationCampaign) else []
    if not pushes:
        raise ValueError(
            f"frame_stiffness = {frame_stiffness:g}: {tables.name!r} has no trial with mode = 'driven'; only the "
            "depth of pushes is read behind a frame"
        )
    recordings = dict(campaign.recordings)
    for trial in pushes:
        recording = recordings[trial.id, "data"]
        time, force = recording.time, recording["force_N"]
        known = np.isfinite(force) & np.isfinite(time)
        if known.any():
            bends = np.interp(time, time[known], force[known]) / frame_stiffness
            columns = {**recording.columns, "depth_m": recording["depth_m"] - bends}
            recordings[trial.id, "data"] = replace(recording, columns=columns)
    return replace(campaign, recordings=recordings)
