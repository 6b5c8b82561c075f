"""Settings of `hedgebed compare`."""

from typing import Literal

from pydantic import Field

from experiments.runs.strict import StrictSettings
from vis.page.sentences import Sentences

__all__ = ["CompareSettings"]

say = Sentences(__package__)


class CompareSettings(StrictSettings):
    """Two finished runs side by side: numbers with their differences, curves, pictures."""

    runs: tuple[str, str]
    """Folders of two finished runs of one kind: tumble, tumble spatial, mujoco or penetrate."""
    colour: Literal["displacement", "speed", "force", "coordination"] = "displacement"
    """Quantity that colours the grains in pictures."""
    pictures: bool = Field(True, description="Draw pictures and film of the runs side by side (not of penetrate).")
