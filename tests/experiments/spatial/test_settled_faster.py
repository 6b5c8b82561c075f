"""`tumble spatial` on a bed that is prepared in a larger gravity than that of the run, and the cost that it states."""

import numpy as np
import pytest
from golden import golden
from pydantic import ValidationError
from spatial_runs import CUBE, small_bed

from experiments.grains.on_bed import PACE, PlatformOnBed
from experiments.runs.progress import Progress
from experiments.spatial.on_grains import SpatialOnBed
from experiments.spatial.settings import SpatialSettings
from experiments.spatial.trial import plan_spatial

OWN = {"surface": "sand", "ground": "bed", "platform": str(CUBE), "duration": 0.05, "bed_size": (0.14, 0.14, 0.05)}


def on_bed(**given):
    settings = SpatialSettings(**OWN, **given)
    return SpatialOnBed(settings, plan_spatial(settings))


def test_the_cost_is_stated_before_the_bed_and_less_is_prepared_in_more_gravity(monkeypatch):
    monkeypatch.setattr(SpatialOnBed, "pace", None)
    same, lowered = on_bed(gravity=0.1, grain=0.003), on_bed(gravity=0.1, settle_gravity=9.81, grain=0.003)
    assert list(lowered.costs) == ["bed", "lower gravity", "tumble"] and list(same.costs) == ["bed", "tumble"]
    assert lowered.costs["bed"] == pytest.approx(same.costs["bed"] * np.sqrt(0.1 / 9.81))
    assert same.minutes["tumble"] == pytest.approx(
        same.grain_count() * same.costs["tumble"] / same.time_step() / (60e6 * PACE)
    )
    golden("tumble/spatial_work", [same._work(), lowered._work()])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ground": "spring-damper", "gravity": 0.1}, "belongs to ground = 'bed'"),
        ({}, "without a rig"),
        ({"gravity": 12.0}, "is below gravity = 12"),
    ],
)
def test_a_gravity_to_settle_in_that_cannot_be_is_refused(given, said):
    with pytest.raises(ValidationError, match=said):
        SpatialSettings(**{"surface": "sand", "ground": "bed", **given}, settle_gravity=9.81)


def test_the_bed_comes_to_the_gravity_of_the_run(monkeypatch):
    monkeypatch.setattr(PlatformOnBed, "prepare", small_bed)
    run = on_bed(gravity=0.3, settle_gravity=1.0, grain=0.006)
    bed = run.prepare(run.softening(), Progress())
    assert -float(bed.gravity[2]) == pytest.approx(0.3)
    assert bed.floor_force == pytest.approx(bed.weight, rel=0.1)
