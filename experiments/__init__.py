"""Settings, runs, results, diagnosis, and the command line over them.

Each experiment is a package: after ``from experiments import penetrate``,
``penetrate.run(penetrate.Settings(...), folder)`` writes a run folder and returns its result;
``penetrate.resume(folder)`` finishes a run that was stopped.

Imports `coupling`, `dem`, `rigid`, `vis`.
"""

import hedgebed_renamed  # noqa: F401  (old names of modules)
from experiments.runs.progress import make_progress

__all__ = [
    "bed",
    "calibrate",
    "campaign",
    "compare",
    "diagnose",
    "hop",
    "make_progress",
    "paper",
    "penetrate",
    "spatial",
    "tumble",
    "validate",
]
