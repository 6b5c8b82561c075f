"""Rows of fields that have room for many more: the same as of the whole field."""

import numpy as np
import pytest

from dem.engine import runtime
from dem.engine.energy import _twice
from dem.engine.rows import Zeroes, take_rows
from hedgebed_taichi import ti


@pytest.fixture(scope="module")
def started():
    return runtime.start(arch="cpu", threads=None, precision="float64")


@pytest.mark.parametrize("width", [None, 3])
@pytest.mark.parametrize("parts", [None, 2])
@pytest.mark.parametrize("kind", [ti.i32, ti.f64, ti.f32])
def test_rows_taken_are_those_of_the_whole_field(started, width, parts, kind):
    shape = 50 if parts is None else (parts, 50)
    field = ti.field(kind, shape) if width is None else ti.Vector.field(width, kind, shape)
    numbers = np.random.default_rng(3).integers(-9, 9, field.to_numpy().shape) / (1 if kind == ti.i32 else 7)
    field.from_numpy(numbers.astype(field.to_numpy().dtype))
    rows = np.array([49, 0, 7, 7])
    for chosen in (rows, rows[:0]):
        for part in [None] if parts is None else range(parts):
            whole = field.to_numpy() if part is None else field.to_numpy()[part]
            found = take_rows(field, chosen, part=part)
            assert found.dtype == whole.dtype and np.array_equal(found, whole[chosen])


def test_several_fields_are_set_to_zero_at_once_numbers_that_are_none_included(started):
    fields = ti.field(ti.f64, ()), ti.Vector.field(3, ti.f32, (4, 2)), ti.field(ti.i32, 5)
    for field, value in zip(fields, (np.nan, np.inf, 3), strict=True):
        field.fill(value)
    Zeroes(*fields).put()
    assert [field.to_numpy().any() for field in fields] == [False] * 3


def test_contacts_kept_by_both_sleepers_are_those_met_twice():
    """What halves a contact's energy where both of its grains keep it."""
    keys = np.random.default_rng(5).permutation(np.concatenate([np.arange(40), np.arange(15), [99]]))
    counts = {key: int((keys == key).sum()) for key in keys}
    assert np.array_equal(_twice(keys), [counts[key] == 2 for key in keys])
    assert _twice(keys[:0]).size == 0
