"""Settings of `hedgebed campaign check`."""

from pydantic import Field

from experiments.runs.strict import StrictSettings

__all__ = ["CheckSettings"]


class CheckSettings(StrictSettings):
    """What is checked."""

    campaign: str = Field(min_length=1, description="Folder of the trials, with campaign.toml.")
