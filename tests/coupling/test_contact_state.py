"""Pivot, slip, hop from forces, by the rules stated in coupling.contact_state."""

import numpy as np
import pytest

from coupling.contact_state import CREEP, TOUCH_SHARE, ContactReader, state_of


def read(normal, along, slip, *, steps=10, reader=None):
    reader = reader or ContactReader(2, weight=1.0, mu_d=0.3, macro_step=1e-3)
    for _ in range(steps):
        state = reader.see(np.array(normal), np.array(along), np.array(slip))
    return state


@pytest.mark.parametrize(
    ("normal", "along", "slip", "state"),
    [
        ((0.5, 0.5), (0.0, 0.0), (0.0, 0.0), "stand"),
        ((0.5, 0.9 * TOUCH_SHARE), (0.0, 0.0), (0.0, 0.0), "pivot"),
        ((0.5, 0.0), (-0.16, 0.0), (0.01, 0.0), "slip"),
        ((0.5, 0.0), (-0.14, 0.0), (0.01, 0.0), "pivot"),  # friction below mu_d N
        ((0.5, 0.0), (0.16, 0.0), (0.01, 0.0), "pivot"),  # it drives, and does not resist
        ((0.5, 0.0), (-0.16, 0.0), (0.5 * CREEP, 0.0), "pivot"),  # it creeps
        ((0.5, 0.5), (-0.16, 0.0), (0.01, 0.0), "pivot"),
        ((0.0, 0.0), (0.7, 0.0), (-0.1, 0.0), "slip"),  # sand pushes it from behind and nothing bears it
        ((0.0, 0.0), (0.0, 0.0), (0.3, 0.3), "hop"),
    ],
)
def test_the_rules_as_they_are_stated(normal, along, slip, state):
    assert read(normal, along, slip) == state


def test_a_knock_shorter_than_the_window_is_averaged_and_a_change_shows_after_it():
    reader = ContactReader(2, weight=1.0, mu_d=0.3, macro_step=1e-3)
    assert read((0.5, 0.0), (0.0, 0.0), (0.0, 0.0), reader=reader) == "pivot"
    assert read((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), reader=reader, steps=4) == "pivot"
    assert read((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), reader=reader, steps=1) == "hop"
    again = ContactReader(2, weight=1.0, mu_d=0.3, macro_step=1e-3)
    again.restore(reader.state())
    assert read((0.5, 0.0), (0.0, 0.0), (0.0, 0.0), reader=again, steps=1) == "pivot"


def test_names_of_states():
    yes, no = np.array([True, True]), np.array([False, False])
    assert [state_of(no, no), state_of(yes, yes), state_of(yes, no)] == ["hop", "slip", "stand"]
