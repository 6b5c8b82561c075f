"""Campaigns: measured or made-up trials in a folder, and the models fitted to them.

`Settings`, `check`, `run` and `resume` are those of `hedgebed campaign`; they are loaded when they are first used.

Imports `experiments.runs`, `rigid`.
"""

from experiments.runs.registry import face

from .files import Campaign, read_campaign, read_model, write_campaign, write_model
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
    "read_campaign",
    "read_model",
    "resume",
    "run",
    "write_campaign",
    "write_model",
]

__getattr__ = face("campaign")
