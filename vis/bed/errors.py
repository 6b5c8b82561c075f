"""Errors of `hedgebed bed test` as halves of 95 % intervals, in place of the standard deviations of result.json.

A mean over n runs has Student's t s / sqrt(n). A line through n runs has t with n - 2 degrees of freedom times its
standard error, the 3D-RFT of n beds t with n - 1 times that by the jackknife. What one run knows has 1.96 standard
errors. A critical height between two heights that were tried lies between them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rigid.intervals import NORMAL, half_width, student

__all__ = ["in_95"]

_RUNS = re.compile(r"; std: between (\d+) ")
"""In the note of a mean, how many values it is of; older folders have no other trace of it."""


def in_95(result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The quantities of a test of beds, the std of each replaced by half of its 95 % interval; None where unknown."""
    return {
        name: {**entry, "std": _half(name, entry, result) if entry.get("std") else entry.get("std")}
        for name, entry in result["quantities"].items()
    }


def _half(name: str, entry: Mapping[str, Any], result: Mapping[str, Any]) -> float | None:
    std, runs, test = float(entry["std"]), result["runs"], str(result["experiment"]).rpartition(" ")[2]
    if found := _RUNS.search(str(entry.get("note", ""))):
        return half_width(std, int(found[1]))
    if test == "shear":
        return half_width(std, len(runs)) if name.endswith("_ratio") else student(len(runs) - 2) * std
    if test == "plates":  # ids are those of beds and a number
        return student(len({run["id"].rpartition("-")[0] for run in runs}) - 1) * std
    return std if name == "critical_height" else NORMAL * std
