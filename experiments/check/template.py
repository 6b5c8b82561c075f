"""Whether a campaign still has recordings of the template that `hedgebed campaign new` writes."""

import numpy as np

from experiments.campaign import Campaign, Recording, read_campaign
from experiments.campaign.files import TEMPLATES

from .words import say

__all__ = ["template_warning"]


def template_warning(campaign: Campaign) -> str | None:
    """The warning that trials have the synthetic recordings of the template; None where none has.

    A recording is recognised by its numbers, whatever its file or trial is called.
    """
    template = read_campaign(TEMPLATES / f"template-{campaign.tables.kind}").recordings.values()
    of_template = {trial.id: list[bool]() for trial in campaign.tables.trial}
    for (trial, _), recording in campaign.recordings.items():
        of_template[trial].append(any(_same(recording, known) for known in template))
    if all(map(all, of_template.values())):
        return say("all_of_template")
    found = [trial for trial, known in of_template.items() if any(known)]
    return say("of_template", trials=", ".join(found), s="s" if len(found) > 1 else "") if found else None


def _same(one: Recording, other: Recording) -> bool:
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(one.columns[name], values, equal_nan=True) for name, values in other.columns.items()
    )
