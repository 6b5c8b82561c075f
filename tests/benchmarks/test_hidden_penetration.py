"""The made-up campaigns of penetration: what is true of their sensors."""

import numpy as np

from benchmarks.hidden.penetration import make_hidden


def test_the_depths_noise_is_correlated_from_row_to_row_in_a_quarter_of_all_campaigns_as_it_is_told():
    """Second differences of a motion at constant speed are those of the noise: their correlation at lag one is
    (-4 + 7 a - 4 a^2 + a^3) / (6 - 8 a + 2 a^2) of an autoregressive law of order one."""
    told = []
    for seed in range(40):
        campaign, hidden = make_hidden(seed, kind="null", trials=1)
        a = hidden.depth_persistence
        told.append(a)
        for trial in campaign.tables.trial:
            depth = campaign.recording(trial.id, "data")["depth_m"]
            if trial.mode == "driven":
                second = np.diff(depth, 2)
                seen = float(np.mean(second[1:] * second[:-1]) / np.mean(second**2))
                assert abs(seen - (-4 + 7 * a - 4 * a**2 + a**3) / (6 - 8 * a + 2 * a**2)) < 0.15
    shown = [a for a in told if a]
    assert 0.1 < len(shown) / len(told) < 0.4
    assert min(shown) >= 0.3 and max(shown) <= 0.8
