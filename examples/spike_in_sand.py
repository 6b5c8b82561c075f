"""Drive a spike into sand and print what the sand pushes back with."""

import sys

from coupling import drive
from dem import Bed
from rigid import Spike

small = "--small" in sys.argv
size, grain, diameter = ((0.024, 0.024, 0.02), 0.004, 0.008) if small else ((0.12, 0.12, 0.08), 0.004, 0.024)
bed = Bed.prepare("sand", size=size, grain=grain, gravity=9.81, seed=1, young=3e7)  # for what a spike presses
print(bed)

depth = 0.5 * diameter
run = drive(Spike(diameter=diameter), into=bed, speed=0.1, depth=depth)
for share in (0.25, 0.5, 0.75, 1.0):
    deepest = run.depth <= share * depth
    print(f"{1e3 * share * depth:5.1f} mm deep: {run.force[deepest & run.loading][-1]:.2f} N")
print(f"work in {1e3 * run.work_in:.2f} mJ, out {1e3 * abs(run.work_out):.2f} mJ")

assert abs(run.max_depth - depth) < 0.02 * depth, "the spike went as deep as it was told to"
assert run.work_out < run.work_in, "sand takes energy"
