"""The platform on a bed laid out as on a GPU, one grain a chunk: what passes to and from it, and what comes of it."""

import numpy as np
import pytest

from .test_bed_footing import layer, small


def until_it_touches(run):
    """And ten macro steps on."""
    while np.linalg.norm(run.master.wrench.force) < 0.05:
        run.advance()
        assert run.master.count < 2000
    for _ in range(10):
        run.advance()


@pytest.mark.long
def test_nothing_of_the_beds_size_is_read_or_written_in_a_macro_step_in_a_gpus_layout(other_layouts, monkeypatch):
    """One grain a chunk, as on a GPU; explicit and iterated. What passes is counted: poses, reactions, counters."""
    other_layouts.overrides = {"gpu": True}
    run = small(layer(), iterations=2)
    until_it_touches(run)
    passed = []
    for kind in (type(run.ground.bed.engine.id), type(run.ground.bed.engine.position)):  # of numbers, of vectors
        for name in ("to_numpy", "from_numpy"):
            plain = getattr(kind, name)

            def counted(field, *given, plain=plain, **more):
                passed.append(int(np.prod(field.shape)) * getattr(field, "n", 1))
                return plain(field, *given, **more)

            monkeypatch.setattr(kind, name, counted)
    bed = run.ground.bed
    engine = bed.engine
    for name in ("tally", "place_bodies"):
        plain = getattr(engine, name)

        def given_to(*arrays, plain=plain):
            passed.extend(array.size for array in arrays)
            return plain(*arrays)

        monkeypatch.setattr(engine, name, given_to)
    repeats = run.master.exchange.repeats
    assert engine.chunk_count == bed.grain_count == 240
    for _ in range(5):
        run.master.step()
    assert run.master.exchange.repeats > repeats
    assert passed and max(passed) < 6 * bed.grain_count / 4


@pytest.mark.long
def test_reactions_in_a_gpus_layout_are_those_of_a_cpus_to_round_off(other_layouts):
    """A platform that a hand sets down on the layer: force on each of its rows, the floor's, the largest overlap."""
    found = []
    for override in ({}, {"gpu": True}):
        other_layouts.overrides = override
        run = small(layer())
        until_it_touches(run)
        found.append((run.master.count, run.ground.bed.reactions(), run.ground.bed.max_overlap, run.body.place.copy()))
    (count, one, overlap, place), (as_many, other, also, also_place) = found
    assert count == as_many and np.abs(one[1:]).max() > 0.01
    assert np.abs(one - other).max() < 1e-7 * np.abs(one).max()
    assert overlap == pytest.approx(also, rel=1e-7) and np.abs(place - also_place).max() < 1e-12
