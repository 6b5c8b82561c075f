"""Let the platform tumble on a bed of grains and on the spring-damper beside it."""

import sys
from pathlib import Path

from experiments import tumble

SMALL = {
    "mass": 0.3, "inertia": 2e-4, "spike_length": 0.04, "wheel_inertia": 1e-5, "rig": 0.03, "torque": 0.01,
    "duration": 0.06, "bed_size": (0.2, 0.036, 0.03), "grain": 0.006, "spike_diameter": 0.008, "spike_clear": 0.015,
    "substeps": 8, "lowering_speed": 0.04, "stiffness": 500.0, "damping": 2.0,
}  # fmt: skip
FULL = {"rig": 0.0085, "torque": 0.22, "sleep": True}
own = SMALL if "--small" in sys.argv else FULL
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples")

settings = tumble.Settings(surface="sand", ground="bed", frame_count=0, **own)
result = tumble.run(settings, out / "tumble")
for name, found in result["quantities"].items():
    print(f"{name:32} {found['value']} {found['unit']}")

assert result["status"] == "done", "nothing went wrong"
assert abs(result["quantities"]["energy_residual"]["value"]) < 0.05, "the energy balance closes"
