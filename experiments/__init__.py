"""Settings, runs, results, diagnosis, and the command line over them.

Each experiment is a package: after ``from experiments import penetrate``,
``penetrate.run(penetrate.Settings(...), folder)`` writes a run folder and returns its result;
``penetrate.resume(folder)`` finishes a run that was stopped.

Imports `coupling`, `dem`, `rigid`, `vis`.
"""

from typing import Any

import hedgebed_renamed  # noqa: F401  (old names of modules)

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


def __getattr__(name: str) -> Any:
    """`make_progress`, when it is first asked for."""
    if name != "make_progress":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from experiments.runs.progress import make_progress

    return make_progress
