"""A dense cloud of 64 unlike grains in a box barely wider than the lists need, in touch across every boundary."""

import numpy as np

from dem import Ball, Bed, Material
from experiments.runs.types import Json

STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.6, 0.15)
DIAMETER = 0.004
PERIOD = (0.0154, 0.0154)  # three cells of the largest grain and the widest skin, and a little more
STEP = 2e-6
HEIGHT = 0.08


def initial(seed=3, count=64):
    """Positions, radii, velocities, spins: a jittered lattice with overlaps of up to some per cent, in motion."""
    rng = np.random.default_rng(seed)
    i = np.arange(count)
    lattice = np.column_stack([i % 4, i // 4 % 4, i // 16]) * [0.00385, 0.00385, 0.0038] + [0.0001, 0.0003, 0.0019]
    positions = lattice + rng.uniform(-1, 1, (count, 3)) * [0.0001, 0.0001, 0.0001]
    radii = 0.5 * DIAMETER * (1 + 0.12 * np.random.default_rng(1).uniform(-1, 1, count))
    return positions, radii, rng.normal(0, 0.1, (count, 3)), rng.normal(0, 50, (count, 3))


BALL: Json = {
    "position": (0.0005, 0.0149, 0.0177),
    "radius": 0.003,
    "velocity": (0.05, 0.02, -0.2),
    "spin": (30.0, 0.0, -60.0),
}


def make(*, ball=False, gravity=(0.0, 0.0, -9.81), floor=True, shift=(0.0, 0.0, 0.0), material=STUFF, **options):
    """The cloud as a bed; with ``ball``, body 1 (or 0 without a floor) is a ball across the corner of the box."""
    positions, radii, velocities, spins = initial()
    options = {"height": HEIGHT, "time_step": STEP, "max_overlap": 0.2} | options
    bed = Bed.from_grains(
        material, positions=positions + shift, radii=radii, velocities=velocities, spins=spins, size=(*PERIOD, 0.016),
        gravity=gravity, floor=floor, **options,
    )  # fmt: skip
    if ball:
        body = bed.add_body([Ball(radius=BALL["radius"])], position=np.add(BALL["position"], shift))
        bed.move_body(body, velocity=BALL["velocity"], spin=BALL["spin"])
    return bed
