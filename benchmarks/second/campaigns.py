"""Campaigns of the second simulator as `hedgebed bench diagnose` takes them, one entry of `KINDS` a kind."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from experiments.campaign import Campaign, PenetrationCampaign, Recording, TumbleCampaign

from . import forms, push, tumble
from .drawing import Made, Secret

__all__ = ["KINDS", "Kind", "campaign_of"]


@dataclass(frozen=True)
class Kind:
    """Names of what can be hidden in one kind of campaign, and what makes it."""

    EFFECTS: tuple[str, ...]
    OUTSIDE: tuple[str, ...]
    maker: Callable[..., tuple[Made, Secret]]

    def make(self, **case: Any) -> tuple[Campaign, Secret]:
        """The campaign of a case, and what is hidden in it."""
        made, secret = self.maker(**case)
        return campaign_of(made), secret


def campaign_of(made: Made) -> Campaign:
    """The campaign as the format's own classes. Raises ValueError where its tables are not valid."""
    tables = TumbleCampaign if made.tables["kind"] == "tumble" else PenetrationCampaign
    return Campaign(
        tables.model_validate(made.tables), {key: Recording(dict(columns)) for key, columns in made.columns.items()}
    )


KINDS: Mapping[str, Kind] = {
    "second-push": Kind(push.EFFECTS, push.OUTSIDE, push.make_push),
    "second-rig": Kind(forms.RIG, forms.OUTSIDE, partial(tumble.make_tumble, rig=True)),
    "second-tumble": Kind(forms.FREE, forms.OUTSIDE, partial(tumble.make_tumble, rig=False)),
}
"""Pushes and drops, tumbles in the rig, and tumbles of a free platform."""
