"""What campaign.toml leaves out is named once, with what to state."""

import numpy as np
import pytest
from golden import golden
from penetration_campaigns import campaign_of, driven_trial, saved

from experiments.campaign import read_campaign
from experiments.check import find_unstated
from experiments.diagnose.inspection import find_faults
from experiments.diagnose.report.gaps import Gaps


def pushes(speeds, **changes):
    """A push at each of `speeds` [m/s] into a straight spring; none states its own."""
    made = [(f"{k}", "driven", None, driven_trial(lambda z, v, top: 900.0 * z, speed=speed))
            for k, speed in enumerate(speeds, 1)]  # fmt: skip
    return campaign_of(made, **changes)


def test_speeds_that_the_depths_show_are_proposed_by_group():
    (finding,) = find_unstated(pushes((0.01, 0.03, 0.01)))
    golden("diagnose/speeds_unstated", finding.what)
    assert finding.what in {found.what for found in find_faults(pushes((0.01, 0.03, 0.01)))}
    assert find_unstated(pushes((0.01, 0.0102))) == []  # one speed is one condition


def test_numbers_without_an_uncertainty_are_named_as_exact(tmp_path):
    folder = saved(tmp_path / "c", pushes((0.01, 0.01)))
    text = (folder / "campaign.toml").read_text()
    kept = [line for line in text.splitlines() if not line.startswith("damping = 0.2")]
    assert len(kept) == len(text.splitlines()) - 1
    (folder / "campaign.toml").write_text("\n".join(kept))
    (finding,) = find_unstated(read_campaign(folder))
    golden("diagnose/exact", finding.what)


def test_noise_that_is_missing_is_one_error_for_all_trials(tmp_path):
    folder = saved(tmp_path / "c", pushes((0.01, 0.01, 0.01)))
    lines = (folder / "campaign.toml").read_text().splitlines()
    at = lines.index("[sensors.depth]")
    (folder / "campaign.toml").write_text("\n".join(lines[:at] + lines[at + 2 :]))
    with pytest.raises(ValueError) as caught:
        read_campaign(folder)
    (said,) = str(caught.value).splitlines()
    golden("diagnose/noise_missing", said.replace(str(folder), "c"))


def test_measured_speeds_that_agree_to_three_digits_are_one_condition():
    gaps, one = Gaps(), np.ones(4)
    for trial, speed in (("1", 0.00999871), ("2", 0.01000093), ("3", 0.0299931)):
        gaps.add(trial, "force", np.arange(4.0), one, one, one, one, phases=np.full(4, "in"),
                 settings={"speed_m_s": speed}, held_out=False)  # fmt: skip
    assert [row["trials"] for row in gaps.by_condition] == [["1", "2"], ["3"]]
