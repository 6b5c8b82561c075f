"""A bed says what it is; its grains are a dataclass of arrays; old names warn and do the same."""

import dataclasses

import numpy as np
import pytest

import dem
from experiments.validate.base import cloud


def test_grains_are_a_frozen_dataclass_that_still_answers_by_name():
    bed = cloud.make()
    grains = bed.grains()
    assert isinstance(bed, dem.Bed) and isinstance(grains, dem.Grains)
    with pytest.warns(DeprecationWarning, match=r"use grains\.position"):
        assert np.array_equal(grains["position"], grains.position)
    with pytest.raises(dataclasses.FrozenInstanceError):
        grains.position = None
    assert "coordination" not in bed.grains(contacts=False).as_dict() and len(grains.as_dict()) == 9


def test_a_bed_says_what_it_is():
    bed = cloud.make()
    for part in (str(bed.grain_count), bed.material.name, f"{bed.packing_fraction:.3f}", "m/s2", "time"):
        assert part in repr(bed)


@pytest.mark.long
def test_old_names_of_a_bed_warn_and_do_the_same():
    bed = cloud.make()
    with pytest.warns(DeprecationWarning, match=r"use Bed\.track_contact_work"):
        bed.keep_book()
    with pytest.warns(DeprecationWarning, match=r"use Bed\.contact_work"):
        assert bed.work_taken == bed.contact_work
    with pytest.warns(DeprecationWarning, match=r"use Bed\.checkpoint"):
        kept = bed.hold()
    with pytest.warns(DeprecationWarning, match=r"use Bed\.rollback"):
        bed.take_back(kept)
