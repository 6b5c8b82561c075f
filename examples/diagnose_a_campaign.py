"""Diagnose measured pushes of a plate into sand: where the spring-damper fails, and what it omits."""

import json
import sys
from pathlib import Path

from experiments import diagnose

campaign = "template-penetration" if "--small" in sys.argv else "cmu-plate-sinkage"  # both ship
out = Path(sys.argv[sys.argv.index("--out") + 1] if "--out" in sys.argv else "runs/examples") / "diagnosis"

diagnose.run(diagnose.Settings(campaign=campaign), out)
diagnosis = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
print(f"verdict: {diagnosis['verdict']}")
for effect in diagnosis["effects"]:
    sizes = ", ".join(f"{name} = {number['value']:.3g}" for name, number in effect["parameters"].items())
    print(f"  {effect['id']}: {sizes}")
print(f"report: {out / 'report.html'}")

assert diagnosis["verdict"] in ("none", "named", "ambiguous", "unknown"), "one of the four verdicts"
assert (out / "report.html").is_file(), "a report was written"
