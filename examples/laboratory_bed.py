"""Prepare a bed as in a laboratory: rain it, compact it by taps, level it; read what every stage left behind."""

import sys
from pathlib import Path

from dem import Bed

small = "--small" in sys.argv
size, grain = ((0.024, 0.024, 0.016), 0.004) if small else ((0.048, 0.048, 0.03), 0.0024)
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples")
out.mkdir(parents=True, exist_ok=True)

prepared = Bed.prepare_as(
    "sand", stages=["rain", "compact:0.58", "level"], size=size, grain=grain, gravity=9.81, seed=1
)
for report in prepared.reports:
    print(f"{report.stage:14} packing fraction {report.packing_fraction:.3f}, surface {1e3 * report.surface:.1f} mm")

prepared.whole.save(out / "bed.npz")  # contacts and their histories included
bed = Bed.load(out / "bed.npz")
grains = bed.grains()  # a frozen dataclass of arrays, in SI units
print(bed, f"highest grain at {1e3 * grains.position[:, 2].max():.1f} mm")

assert bed.grain_count == prepared.whole.grain_count == len(grains.radius), "what was saved is what is loaded"
assert 0.45 < bed.packing_fraction < 0.64, "a packing of spheres"
