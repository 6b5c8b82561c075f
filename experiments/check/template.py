"""Whether a campaign still has recordings of the template that `hedgebed campaign new` writes."""

import numpy as np

from experiments.campaign import Campaign, Recording, read_campaign
from experiments.campaign.files import TEMPLATES

from .words import say

__all__ = ["template_warning"]


def template_warning(campaign: Campaign) -> str | None:
    """The warning that trials have recordings of the template, which are made up; None where all are others.

    A recording is known by its numbers, whatever its file or trial is called.
    """
    template = read_campaign(TEMPLATES / f"template-{campaign.tables.kind}").recordings.values()
    found = [
        trial.id
        for trial in campaign.tables.trial
        if any(_same(campaign.recordings[trial.id, sensor], known) for sensor in trial.files for known in template)
    ]
    if not found:
        return None
    if len(found) == len(campaign.tables.trial):
        return say("all_of_template")
    return say("of_template", trials=", ".join(found), s="s" if len(found) > 1 else "")


def _same(one: Recording, other: Recording) -> bool:
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(one.columns[name], values, equal_nan=True) for name, values in other.columns.items()
    )
