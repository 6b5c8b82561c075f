"""Drive a spike into sand whose grains are in LAMMPS, a program of its own, beside the same bed in this process."""

import sys

import numpy as np

from coupling import drive
from coupling.lammps import LammpsBed, LammpsGround, LammpsMissingError, find_lammps
from dem import Bed
from rigid import Spike

small = "--small" in sys.argv
size, grain, ranks = ((0.032, 0.032, 0.02), 0.004, 1) if small else ((0.048, 0.048, 0.04), 0.0024, 2)
spike, depth = Spike(diameter=0.008), 0.002 if small else 0.006
forces = []
try:
    find_lammps()
    bed = Bed.prepare("sand", size=size, grain=grain, gravity=9.81, seed=1, young=3e7)
    grains = LammpsBed(bed, ranks=ranks)
    print(f"{grains}: at rest after {grains.settle():.3g} s, with the springs of {grains.springs} contacts")
    for ground in (bed, LammpsGround(grains, spike)):
        run = drive(spike, into=ground, speed=0.2, depth=depth, hold=0.0, retreat=False)
        forces.append(float(np.mean(run.force[run.depth > 0.5 * depth])))
        print(f"{ground}: mean force over the lower half {forces[-1]:.3g} N")
    grains.close()
except LammpsMissingError as missing:
    print(missing)

assert not forces or 0.3 < forces[1] / forces[0] < 3, "both push back alike"
