"""What keeps a bed from draining is named by its real cause: grains that bridge the slot, or a pit that is full."""

from types import SimpleNamespace

import numpy as np
import pytest

from dem.engine.values import BedFailure
from dem.measure.repose import _refuse_blocked

GRAIN, SLOT, PLATE = 0.004, 0.024, 0.128


def bed_of(heights):
    """Grains one above the other at these heights [m] in the middle of the slot, in a bed of 0.32 m."""
    position = np.array([[0.0, 0.01, z] for z in heights])
    return SimpleNamespace(grains=lambda: SimpleNamespace(position=position), size=(0.32, 0.024), grain_count=9499)


@pytest.mark.parametrize(
    ("heights", "cause"),
    [((0.002, 0.009, 0.14, 0.2), "bridge the slot of 0.024 m"), ((0.002, 0.06, 0.115, 0.13), "0.12 m deep, is full")],
)
def test_a_blocked_slot_is_refused_by_its_real_cause(heights, cause):
    with pytest.raises(BedFailure, match=cause):
        _refuse_blocked(bed_of(heights), GRAIN, SLOT, PLATE, 126)


def test_a_slot_that_has_drained_is_accepted():
    _refuse_blocked(bed_of((0.002, 0.05)), GRAIN, SLOT, PLATE, 126)
