"""A bed of 300 grains in eight chunks that falls onto its floor and a ball: for tests of bits, here and elsewhere.

As a script, in a process of its own:  falling_bed.py WHAT FILE STEPS THREADS [EVERY [COHESION [BODY [sleep]]]]
    fresh   makes the bed, advances it and saves it
    resume  loads the bed and advances it to that many steps in all
Saves every EVERY steps when given, and says the number of steps after each save.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

import engine_pool
import numpy as np
import pytest
import solid_shapes

import dem.engine.engine
from dem import Ball, Bed, Box, Capsule, Cylinder, Material, Mesh, Placed, Polyhedron, Sleep, Tube

GRAINS_PER_CHUNK = 37
STUFF = Material("grain", 2600, 1e7, 0.25, 0.5, 0.6, 0.15)


SPIKE = [Ball(center=(0, 0, 0.004), radius=0.004), Cylinder(0.004, 0.04, 0.004)]


def solids():
    """A turned thing of every shape that a table is needed for, two meshes among them, as wide as the spike."""
    tip = [(0, 0, 0.0), (0.004, 0, 0.006), (-0.004, 0.001, 0.006), (0, -0.004, 0.007), (0.001, 0.004, 0.008)]
    return [
        Polyhedron(tip),
        Mesh(*solid_shapes.finer(*solid_shapes.box((0.006, 0.005, 0.006), (0.0, 0.0, 0.01)))),
        Placed(Capsule((0, 0, 0), (0, 0, 0.006), 0.002), (0.002, 0.0, 0.014), (0.9, 0.3, -0.2, 0.1)),
        Placed(Box((0.003, 0.004, 0.008)), (-0.002, 0.0, 0.02), (0.8, 0.1, 0.5, 0.0)),
        Tube(0.02, 0.04, 0.003, 0.004),
    ]


# Under these many of the grains are slow, fall asleep and wake in mid-fall.
DOZING = {
    "speed": 0.5, "calm": 0.02, "settling": 1.0, "reach": 0.2, "pace": 4, "stretch": 2.0, "spin_stretch": 1.0,
    "own": 2.0, "unbalanced": 3.0, "still": 0.5, "change": 3.0, "waking_speed": 2.0, "every": 8,
}  # fmt: skip


def make(threads=None, precision="float64", cohesion="none", body="spike", sleep=False):
    """The bed at time 0, with a ball-tipped cylinder (or ``solids``) that is pulled through it at a slant; at Bond
    number 1 or 0. Where grains ``sleep`` it keeps a book."""
    dem.engine.engine.GRAINS_PER_CHUNK = GRAINS_PER_CHUNK
    rng = np.random.default_rng(7)
    i = np.arange(300)
    positions = np.column_stack([i % 8, i // 8 % 8, i // 64]) * [0.0044, 0.0044, 0.0042] + [0.001, 0.002, 0.0026]
    positions += rng.uniform(-1, 1, (300, 3)) * 0.00015
    bed = Bed.from_grains(
        replace(STUFF, cohesion=cohesion, surface_energy=0.0 if cohesion == "none" else 0.06),
        positions=positions,
        radii=0.0019 * rng.uniform(0.85, 1.15, 300),
        velocities=rng.normal(0, 0.1, (300, 3)),
        size=(0.035, 0.035, 0.03),
        height=0.2,
        max_overlap=0.1,
        threads=threads,
        precision=precision,
    )
    shape, height = (SPIKE, 0.0228) if body == "spike" else (solids(), 0.0195)
    number = bed.add_body(shape, position=(0.034, 0.018, height))
    bed.move_body(number, velocity=(0.05, 0.02, -0.5), spin=(0.0, 0.0, 20.0))
    if sleep:
        bed.let_sleep(Sleep(**DOZING))
        bed.track_contact_work()
    return bed


def digest(bed) -> str:
    """Of everything that the next step depends on, and of what users read."""
    total = hashlib.sha256()
    for name, array in sorted((bed.state() | bed.grains().as_dict()).items()):
        total.update(name.encode() + np.ascontiguousarray(array).tobytes())
    for body in (0, 1):
        for array in bed.reaction(body):
            total.update(array.tobytes())
    return total.hexdigest()


def main() -> None:
    what, path, steps, threads = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    every = int(sys.argv[5]) if len(sys.argv) > 5 else steps
    dem.engine.engine.GRAINS_PER_CHUNK = GRAINS_PER_CHUNK
    engine_pool.go_there(pytest.MonkeyPatch())
    cohesion = sys.argv[6] if len(sys.argv) > 6 else "none"
    body = sys.argv[7] if len(sys.argv) > 7 else "spike"
    sleep = len(sys.argv) > 8
    bed = (
        make(threads, cohesion=cohesion, body=body, sleep=sleep) if what == "fresh" else Bed.load(path, threads=threads)
    )
    while bed.steps < steps:
        bed.advance(min(every, steps - bed.steps))
        bed.save(path)
        print(bed.steps, digest(bed), flush=True)


if __name__ == "__main__":
    main()
