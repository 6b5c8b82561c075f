"""A state held where the bed lies: taken back to the bit, with the book of losses, in a CPU's layout and in a GPU's.

Of a bed whose grains sleep `test_sleep` shows it.
"""

import pytest

from dem import Sleep
from experiments.validate.base import cloud


def made(layout, engines):
    """The cloud and its ball after fifty steps."""
    if layout == "grain chunks":
        engines.overrides = {"gpu": True, "neighbours_per_grain": 30.0, "near_per_grain": 2.0}
    bed = cloud.make(ball=True)
    bed.track_contact_work()
    bed.advance(50)
    return bed


def bits(bed):
    return {name: values.tobytes() for name, values in bed.state().items()} | {"computed": bed.grain_steps}


@pytest.mark.long
@pytest.mark.parametrize("layout", ["chunks", "grain chunks"])
def test_a_bed_goes_on_from_what_it_held_to_the_same_bits_as_often_as_one_likes(layout, engines):
    bed = made(layout, engines)
    held, then = bed.checkpoint(), bits(bed)
    lists = bed.list_count
    bed.advance(200)
    after, push = bits(bed), bed.reactions()
    assert bed.list_count > lists and after != then  # new lists in between
    for _ in range(2):
        bed.rollback(held)
        assert bits(bed) == then
        bed.advance(200)
        assert bits(bed) == after and (bed.reactions() == push).all()


@pytest.mark.long
@pytest.mark.cpu_only("sleep")
def test_only_the_last_state_held_is_taken_back_and_none_across_a_change_of_sleep_or_book(engines):
    bed = made("chunks", engines)
    first, second = bed.checkpoint(), bed.checkpoint()
    with pytest.raises(ValueError, match="only the last one that was held can be taken back"):
        bed.rollback(first)
    bed.rollback(second)
    bed.let_sleep()
    with pytest.raises(ValueError, match="only the last one that was held can be taken back"):
        bed.rollback(second)


@pytest.mark.long
@pytest.mark.parametrize("changed", ["gravity", pytest.param("rules", marks=pytest.mark.cpu_only("sleep"))])
def test_a_state_held_under_another_gravity_or_other_rules_of_sleep_is_not_taken_back(changed, engines):
    bed = made("chunks", engines)
    if changed == "rules":
        bed.let_sleep()
    held = bed.checkpoint()
    if changed == "gravity":
        bed.set_gravity(1.62)
    else:
        bed.wake()
        bed.let_sleep(Sleep(calm=5.0, pace=7, every=7))
    with pytest.raises(ValueError, match="gravity or the rules of sleep are others by now"):
        bed.rollback(held)
