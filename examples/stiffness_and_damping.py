"""Find K and C of the spring-damper that imitates a bed of sand best, with their spread over beds."""

import sys
from pathlib import Path

from experiments import penetrate

SMALL = {
    "seeds": (1,), "speeds": (0.2, 0.4), "depth": 0.004, "bed_size": (0.036, 0.036, 0.02), "grain": 0.004,
    "tip_diameter": 0.008, "drop_speeds": (0.15,), "frame_count": 0, "allow_coarse": True, "max_overlap": 0.1,
    "drop_time": 0.05, "load": 0.05,
}  # fmt: skip
settings = penetrate.Settings(**SMALL) if "--small" in sys.argv else penetrate.Settings(frame_count=0)
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples")

result = penetrate.run(settings, out / "stiffness")
quantities = result["quantities"]
for name, letter in (("stiffness", "K"), ("damping", "C")):
    found = quantities[name]
    spread = "one bed" if found["std"] is None else f"+- {found['std']:.3g} between beds"
    print(f"{letter} = {found['value']:.3g} {found['unit']} ({spread})")
print(f"the whole story: {out / 'stiffness' / 'report.html'}")

assert result["status"] == "done", "nothing went wrong"
assert quantities["stiffness"]["value"] > 0, "the deeper, the harder"
