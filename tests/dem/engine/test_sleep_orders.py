"""Sleepers that lists pass over, whatever is done to the bed between steps and in whatever order.

Lists sort all grains where ``dem.engine.sleep_kernels.Rest.whole`` is 1, and else pass over sleepers behind the last
that
wakes. The same orders of what a bed can be told, drawn by chance, once so and once with all sorted, have the same bits.
"""

import hashlib

import numpy as np
import pytest

import dem.engine.engine
from dem import Ball, Bed, Material, Sleep
from dem.engine.lists import Lists
from dem.engine.sleep import Sleeper

pytestmark = pytest.mark.cpu_only("sleep")

STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.3, 0.1)
D = 4e-3
COLUMNS, ROWS = 90, 4
SEED = 4
ORDERS = {"advance": 8, "move": 8, "keep": 1, "restore": 1, "hold": 4, "take back": 4, "gravity": 1, "save and load": 1}
"""What is done to the bed, and how often, in an order drawn by chance."""


def two_layers():
    """A ball over 720 grains, 0.36 m long, that sleep where nothing reaches them."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    low = np.column_stack([(i + 0.5) * D, (j + 0.5) * D, np.full(i.size, 0.5 * D)])
    high = low + [0.5 * D, 0.5 * D, D * np.sqrt(0.5)]
    bed = Bed.from_grains(
        STUFF, positions=np.concatenate([low, high]), radii=np.full(2 * i.size, 0.5 * D),
        size=(COLUMNS * D, ROWS * D, 0.02), height=0.07, max_overlap=0.2, threads=2,
    )  # fmt: skip
    bed.advance(300, drag_time=2e-3)
    bed.add_body(Ball(radius=5e-3), position=(0.05, 0.008, 0.02))
    bed.let_sleep(Sleep(calm=0.05, settling=1, pace=4, every=8, still=1e-3))
    return bed


def digest(bed):
    found = hashlib.sha256()
    for values in (*bed.grains().as_dict().values(), *bed.state().values(), bed.reactions()):
        found.update(np.asarray(values).tobytes())
    return found.hexdigest()


def tracked(bed, chance, folder):
    """The bed's bits after each order, and how many were awake."""
    ball, kept, held, taken, found = 1, bed.state(), None, 0, []  # the floor is body 0
    for order in chance.permutation([order for order, times in ORDERS.items() for _ in range(times)]):
        x = chance.random(7)
        if order in ("advance", "move"):
            if order == "move":
                place = (x[0] * COLUMNS * D, x[1] * ROWS * D, 0.012 + 0.006 * x[2])
                bed.move_body(ball, position=place, velocity=(10 * (x[3] - 0.5), x[4] - 0.5, -0.1 * x[5]))
            bed.advance(1 + int(x[6] * 150))
        elif order == "keep":
            kept = bed.state()
        elif order == "restore":
            bed.restore(kept)
            held = None
        elif order == "hold":
            held = bed.checkpoint()
        elif order == "take back" and held is not None:
            bed.rollback(held)
            taken += 1
        elif order == "gravity":
            bed.set_gravity(9.81 * (0.5 + x[0]))
            held = None
        elif order == "save and load":
            bed, held = Bed.load(bed.save(folder / "bed.npz"), threads=2), None
        found.append((str(order), bed.awake_count, digest(bed)))
    assert taken > 1
    return found


@pytest.mark.long
def test_orders_drawn_by_chance_have_the_bits_of_sorting_all_grains_every_time(tmp_path, monkeypatch):
    monkeypatch.setattr(dem.engine.engine, "GRAINS_PER_CHUNK", 20)
    sorted_ones, recount, all_of_them = [], Sleeper.recount, False

    def counted(self):
        if all_of_them:
            self.bed.engine.rest.whole[None] = 1
        recount(self)
        sorted_ones.append(int(self.bed.engine.count[Lists.SORTED]) / self.bed.grain_count)

    monkeypatch.setattr(Sleeper, "recount", counted)
    found = tracked(two_layers(), np.random.default_rng(SEED), tmp_path)
    assert min(sorted_ones) < 0.5 and np.mean(np.array(sorted_ones) < 1) > 0.3
    assert min(awake for _, awake, _ in found) < 0.3 * 2 * COLUMNS * ROWS
    sorted_ones.clear()
    all_of_them = True
    plain = tracked(two_layers(), np.random.default_rng(SEED), tmp_path)
    assert set(sorted_ones) == {1.0}
    assert plain == found
