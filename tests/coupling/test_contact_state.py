"""Pivot, slip, hop from forces, by the rules stated in coupling.contact_state."""

import numpy as np
import pytest

from coupling.contact_state import CREEP, TOUCH_SHARE, ContactReader, changes_of, in_a_line, state_of


def read(normal, along, slip, *, steps=10, reader=None):
    reader = reader or ContactReader(2, weight=1.0, mu_d=0.3, macro_step=1e-3)
    for _ in range(steps):
        state = reader.see(np.array(normal), np.array(along), np.array(slip))
    return state


RULES = pytest.mark.parametrize(
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


@RULES
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


# In space -------------------------------------------------------------------------------------------------------------

FEET = 0.1 * np.array([[1.0, 1.0, -1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, -1.0]])
"""Two rows of two, the second of each row beside the first."""


def read_in_space(normal, force, velocity, *, places=FEET):
    reader = ContactReader(len(places), weight=1.0, mu_d=0.3, macro_step=1e-3, places=places)
    for _ in range(10):
        state = reader.see(np.array(normal), np.array(force), np.array(velocity))
    return state


@RULES
@pytest.mark.parametrize("heading", [0.0, 0.7, 2.5])
def test_in_space_two_rows_of_two_spikes_are_in_the_states_of_the_plane_whatever_way_it_moves(
    normal, along, slip, state, heading
):
    """A row's load and force are shared by its two spikes; forces and slips along a horizontal direction."""
    way = np.array([[np.cos(heading)], [np.sin(heading)]])
    halves = [0.5 * np.tile(values, 2) for values in (normal, along)]
    # 1 % of the weight is of a row in the plane, of a spike in space.
    bare = [np.where(np.abs(half) < TOUCH_SHARE, 0.0, half) for half in halves]
    assert read_in_space(bare[0], way * bare[1], way * np.tile(slip, 2)) == state


def test_in_space_friction_across_the_slip_holds_and_friction_against_it_slides():
    one = ([0.5, 0.0, 0.0, 0.0],)
    none = np.zeros(3)

    def along(x, y):
        return np.array([[x, *none], [y, *none]])

    assert read_in_space(*one, along(-0.16, 0.0), along(0.01, 0.0)) == "slip"
    assert read_in_space(*one, along(0.0, -0.16), along(0.01, 0.0)) == "pivot"
    assert read_in_space(*one, along(-0.12, -0.12), along(0.01, 0.0)) == "slip"  # |F| = 0.17 N, part of it against u
    assert read_in_space(*one, along(-0.1, -0.1), along(0.01, 0.0)) == "pivot"  # |F| = 0.14, below 0.3 x 0.5
    assert read_in_space(*one, along(-0.16, 0.0), along(0.6 * CREEP, 0.9 * CREEP)) == "slip"  # |u| = 1.08 CREEP


def test_it_pivots_about_spikes_in_a_line_and_stands_on_three_that_are_not():
    still = np.zeros((2, 4))
    assert read_in_space([0.3, 0.0, 0.3, 0.0], still, still) == "pivot"  # a row
    assert read_in_space([0.3, 0.0, 0.0, 0.3], still, still) == "pivot"  # a diagonal
    assert read_in_space([0.3, 0.3, 0.3, 0.0], still, still) == "stand"
    row = np.array([[0.1, y, -0.1] for y in (-0.1, 0.0, 0.05, 0.1)])
    assert read_in_space([0.2, 0.2, 0.2, 0.2], still, still, places=row) == "pivot"
    assert in_a_line(row, 1e-9) and not in_a_line(row + [[0, 0, 0], [0.01, 0, 0], [0, 0, 0], [0, 0, 0]], 1e-3)


def test_changes_are_told_with_time_and_angle_the_first_included():
    found = changes_of([0.0, 0.1, 0.2, 0.3], ["stand", "stand", "hop", "stand"], [0.0, 1.0, 2.0, 3.0])
    assert found == ((0.0, "stand", 0.0), (0.2, "hop", 2.0), (0.3, "stand", 3.0))
