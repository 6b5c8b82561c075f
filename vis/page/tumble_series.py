"""What a tumble's folder holds as columns, and the stretches of its states."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vis.page.style import BED, MODEL

__all__ = ["STATES", "read_columns", "state_runs"]

Array = NDArray[np.float64]

STATES = {"stand": "#a4a4a4", "pivot": BED, "slip": MODEL, "hop": "#882255"}
"""The states in the order of losing hold, with their colours: apart for the colour-blind too (tests/vis/test_style.py),
to whom Okabe and Ito's green is the grey of standing or the blue of pivoting; Tol's wine is neither."""


def read_columns(path: Path) -> tuple[dict[str, Array], NDArray[np.str_]]:
    """The columns of a CSV file that are numbers, by name, and its column ``state`` (empty where it has none)."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    header, body = rows[0], rows[1:]
    kept = [index for index, name in enumerate(header) if name != "state"]
    values = np.array([[row[index] for index in kept] for row in body], dtype=float).reshape(len(body), len(kept))
    states = [row[header.index("state")] for row in body] if "state" in header else []
    return {header[index]: values[:, place] for place, index in enumerate(kept)}, np.array(states, dtype=str)


def state_runs(states: NDArray[np.str_]) -> list[tuple[int, int, str]]:
    """Stretches of one state: (first row, row after the last, state)."""
    if not len(states):
        return []
    edges = [0, *(np.flatnonzero(states[1:] != states[:-1]) + 1).tolist(), len(states)]
    return [(low, high, str(states[low])) for low, high in pairwise(edges)]
