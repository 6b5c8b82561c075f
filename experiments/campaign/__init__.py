"""Campaigns: measured or synthetic trials in a folder, and the models fitted to them.

`Settings`, `check`, `run` and `resume` are those of `hedgebed campaign`; calling one imports what computes,
and `Settings` is imported when it is first used.

Imports `experiments.runs`, `rigid`, `vis.page`.
"""

from pydantic import BaseModel

from experiments.runs.registry import EXPERIMENTS, face

from .files import Campaign, keep_digests, read_campaign, read_model, write_campaign, write_model
from .recording import Recording
from .tables import EffectTable, PenetrationCampaign, PenetrationModel, TumbleCampaign, TumbleModel

__all__ = [
    "Campaign",
    "EffectTable",
    "PenetrationCampaign",
    "PenetrationModel",
    "Recording",
    "Settings",
    "TumbleCampaign",
    "TumbleModel",
    "check",
    "keep_digests",
    "read_campaign",
    "read_model",
    "resume",
    "run",
    "write_campaign",
    "write_model",
]

check, resume, run = face("campaign", BaseModel)


def __getattr__(name: str) -> type[BaseModel]:
    """`Settings`, whose package imports this one."""
    if name == "Settings":
        return EXPERIMENTS["campaign"].settings_class()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
