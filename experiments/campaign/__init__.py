"""Campaigns: measured or made-up trials in a folder, and the models fitted to them (docs/campaigns.md)."""

from .files import Campaign, read_campaign, read_model, write_campaign, write_model
from .recording import Recording
from .tables import EffectTable, PenetrationCampaign, PenetrationModel, TumbleCampaign, TumbleModel

__all__ = [
    "Campaign",
    "EffectTable",
    "PenetrationCampaign",
    "PenetrationModel",
    "Recording",
    "TumbleCampaign",
    "TumbleModel",
    "read_campaign",
    "read_model",
    "write_campaign",
    "write_model",
]
