"""How far a platform of your own hops over the speed of its wheel, whose brake takes 0.1 s: rigid ground and brick."""

import sys
from pathlib import Path

from experiments import hop

platform = "cubli"  # or the path of your platform file
speeds = (100.0, 200.0) if "--small" in sys.argv else (50.0, 100.0, 150.0, 200.0, 250.0)  # [rad/s]
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples/hop_of_own_platform")

reached = []
for speed in speeds:
    settings = hop.Settings(platform=platform, gravity=0.0057, surface="brick", wheel_speed_0=speed, brake_time=0.1)
    numbers = hop.run(settings, out / f"{speed:g}")["quantities"]
    reached.append(numbers["distance"]["value"])
    print(f"{speed:g} rad/s: {reached[-1]:.3g} m rigid, {numbers['model_distance']['value']:.3g} m from brick")

assert reached == sorted(reached), "a faster wheel goes farther"
