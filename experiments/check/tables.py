"""Numbers of campaign.toml that contradict one another: a simulated gravity that the counterweight does not leave."""

import math
from collections.abc import Iterator

from experiments.campaign import TumbleCampaign
from experiments.campaign.tables import TumbleTrial
from rigid.platform.rig import STANDARD_GRAVITY

from .words import Odd, oddity, say

__all__ = ["gravity_oddities"]

_SIGMAS = 4.0
_LEAST = 0.2
"""Share of the weight within which counterweight and gravity may differ: both are rounded, and gravity_sim rules."""


def gravity_oddities(tables: TumbleCampaign, trial: TumbleTrial) -> Iterator[Odd]:
    """Is (m + m_b) g_sim what (m - m_b) g leaves on the surface, within what is stated and rounding?

    The free-fall acceleration of the pair (`rigid.platform.rig`), which is what a campaign's gravity_sim means,
    whichever reading of a stated gravity made it.
    """
    if tables.rig is None:
        return
    mass, other, local = tables.platform.mass, tables.counterweight_of(trial), tables.rig.gravity
    hung, weight = (mass - other) * local, tables.weight_of(trial)
    doubt = math.hypot(tables.uncertainty.mass * mass * local, tables.uncertainty.gravity_sim * weight)
    if abs(hung - weight) <= max(_SIGMAS * doubt, _LEAST * weight):
        return
    gives = hung / (mass + other)
    words = ""
    if abs(trial.gravity_sim * STANDARD_GRAVITY / gives - 1) < _LEAST:
        words = f"it looks like units of g: {trial.gravity_sim * STANDARD_GRAVITY:.4g} m/s2 would fit"
    elif abs(trial.gravity_sim * mass / hung - 1) < _LEAST:
        words = say("weight_reading")
    yield oddity("gravity", "counterweight", other=other, hung=hung, gives=gives, trial=trial, weight=weight,
                 words=words or "one of the two is another")  # fmt: skip
