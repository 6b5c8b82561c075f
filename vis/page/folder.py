"""A run folder as vis reads it (docs/architecture.md): whatever is there, and a plain word for whatever is not."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid import series

__all__ = [
    "PHASES", "PYTHON_RUNS", "Run", "RunFolder", "Series", "Setting", "from_python", "read_columns", "read_folder",
    "read_series", "surface_words",
]  # fmt: skip

PHASES = ("free", "in", "rest", "out")
#: Experiment of a run that a script has saved -> the function of `coupling` that made it.
PYTHON_RUNS = {"driven": "drive", "drop": "drop", "set_down": "set_down"}
_VALUE = re.compile(r"""((?:"[^"]*"?|'[^']*'?|[^"'#])*)(?:#(.*))?""")
"""A value of a TOML file in its written form, and the comment behind it."""
_COLUMNS = ("t_s", "depth_m", "velocity_m_s", "force_N", "phase")


@dataclass(frozen=True)
class Series:
    """One penetration. All arrays have shape (n,); force is the ground's on the spike, positive upwards.

    ``time``: Time [s]. ``depth``: Depth of the tip [m], positive downwards. ``velocity``: Downward velocity [m/s].
    ``force``: Force [N]. ``phase``: One of `PHASES` per row.
    """

    time: NDArray[np.float64]
    depth: NDArray[np.float64]
    velocity: NDArray[np.float64]
    force: NDArray[np.float64]
    phase: NDArray[np.str_]

    def part(self, *phases: str) -> Series:
        """The rows in these phases."""
        return self.where(np.isin(self.phase, phases))

    def where(self, keep: NDArray[np.bool_]) -> Series:
        """The rows that are kept, shape (n,)."""
        return Series(**{name: values[keep] for name, values in vars(self).items()})

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Run:
    """One run of the result: its id, kind ("driven", "drop", "set_down"), seed, speed [m/s], and both series."""

    id: str
    kind: str
    seed: int | None
    speed: float | None
    bed: Series | None
    model: Series | None
    quantities: dict[str, Any] = field(default_factory=dict)
    amended: Series | None = None
    """The same run on the law of a model, with the effects that the spring-damper omits."""


@dataclass(frozen=True)
class Setting:
    """A line of run.toml: table ("" at the top), key, value as written, the comment (meaning, unit) above or behind."""

    table: str
    key: str
    value: str
    comment: str


@dataclass(frozen=True)
class RunFolder:
    """What a run folder holds.

    ``path``: The folder. ``result``: result.json, `{}` where it is missing or unreadable. ``runs``: Its runs with their
    series. ``settings``: The lines of run.toml in order. ``missing``: Sentences on what is missing or unreadable.
    ``status``: "done", "stopped", "failed", "running" or "unknown". ``reason``: Why a run stopped or failed.
    """

    path: Path
    result: dict[str, Any]
    runs: list[Run]
    settings: list[Setting]
    missing: list[str]
    status: str = "unknown"
    reason: str = ""

    @property
    def surface(self) -> str:
        """The bed, as the title of a picture has it: material and gravity, as far as result.json has them."""
        return surface_words(self.result)

    def of_kind(self, kind: str) -> list[Run]:
        """The runs of a kind, by speed and seed."""
        chosen = [run for run in self.runs if run.kind == kind]
        return sorted(chosen, key=lambda run: (run.speed or 0.0, run.seed or 0))

    def speeds(self, kind: str) -> list[float]:
        """The speeds [m/s] at which a kind was run, increasing."""
        return sorted({run.speed for run in self.runs if run.kind == kind and run.speed is not None})


def surface_words(result: Mapping[str, Any]) -> str:
    """Material and gravity of the bed of a result, as far as it has them; empty where it has no bed."""
    bed = result.get("bed")
    if not isinstance(bed, dict):
        return ""
    gravity, material = bed.get("gravity"), bed.get("material")
    gravity = gravity.get("value") if isinstance(gravity, dict) else gravity
    material = material.get("name") if isinstance(material, dict) else material
    known = [material] if isinstance(material, str) else []
    return ", ".join([*known, f"{gravity:.3g} m/s²"] if isinstance(gravity, int | float) else known)


def read_folder(folder: str | Path) -> RunFolder:
    """Read a run folder; nothing in it is required.

    Raises FileNotFoundError: there is no such folder.
    """
    path = Path(folder)
    if not path.is_dir():
        raise FileNotFoundError(f"{path} is no folder")
    missing: list[str] = []
    result = _read_result(path / "result.json", missing)
    runs = []
    listed = result.get("runs")
    for entry in listed if isinstance(listed, list) else []:
        if not isinstance(entry, dict):
            continue
        name = str(entry.get("id", "unnamed"))
        bed = model = amended = None
        if result.get("ground", "bed") == "bed":
            bed = _try_series(path, entry.get("series"), f"run {name}: the bed's series", missing)
        if "model_series" in entry or result.get("experiment") not in PYTHON_RUNS:
            model = _try_series(path, entry.get("model_series"), f"run {name}: the spring-damper's series", missing)
        if "amended_series" in entry:
            law = f"run {name}: the series of the model's law"
            amended = _try_series(path, entry["amended_series"], law, missing)
        speed, seed = entry.get("speed"), entry.get("seed")
        seed = int(seed) if isinstance(seed, int | float) else None
        speed = float(speed) if isinstance(speed, int | float) else None
        numbers = dict(entry.get("quantities") or {})
        runs.append(Run(name, str(entry.get("kind", "")), seed, speed, bed, model, numbers, amended))
    if result and not runs:
        missing.append("result.json lists no runs.")
    status, reason = _read_status(path / "status.json")
    if result.get("status"):
        status = str(result["status"])
    return RunFolder(path, result, runs, _read_settings(path / "run.toml", missing), missing, status, reason)


def from_python(run: RunFolder) -> bool:
    """Whether it is one run that a script has saved, beside which there is no spring-damper."""
    return run.result.get("experiment") in PYTHON_RUNS


def read_series(path: str | Path) -> Series:
    """Read one series file.

    Raises FileNotFoundError: there is no such file. ValueError: a column is missing, a number cannot be read, or it has
    no rows.
    """
    columns = series.read_series(path, text=("phase",))
    if absent := [name for name in _COLUMNS if name not in columns]:
        raise ValueError(f"{path} has no column {', '.join(absent)}")
    if not len(columns["t_s"]):
        raise ValueError(f"{path} has no rows")
    time, depth, velocity, force = (columns[name].astype(float) for name in _COLUMNS[:4])
    return Series(time, depth, velocity, force, columns["phase"])


def read_columns(path: Path) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.str_]]:
    """The columns of a CSV file that are numbers, by name, and its column ``state`` (empty where it has none)."""
    columns = series.read_series(path, text=("state",))
    states = columns.pop("state", np.array([], dtype=str))
    return {name: values.astype(float) for name, values in columns.items()}, states


def _read_result(path: Path, missing: list[str]) -> dict[str, Any]:
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(result, dict):
            return result
        missing.append("result.json holds no object.")
    except FileNotFoundError:
        missing.append("result.json is missing: the run stopped before it had a result.")
    except (OSError, ValueError) as error:
        missing.append(f"result.json cannot be read: {error}.")
    return {}


def _read_status(path: Path) -> tuple[str, str]:
    try:
        status = json.loads(path.read_text(encoding="utf-8"))
        return str(status["status"]), str(status.get("reason") or "")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "unknown", ""


def _try_series(folder: Path, name: Any, what: str, missing: list[str]) -> Series | None:
    if not name:
        missing.append(f"{what} is not given.")
        return None
    try:
        return read_series(folder / str(name))
    except FileNotFoundError:
        missing.append(f"{what} ({name}) is missing.")
    except (OSError, ValueError) as error:
        missing.append(f"{what} cannot be read: {error}.")
    return None


def _read_settings(path: Path, missing: list[str]) -> list[Setting]:
    try:
        text = path.read_text(encoding="utf-8")
        tomllib.loads(text)
    except FileNotFoundError:
        missing.append("run.toml is missing: the settings are not known.")
        return []
    except (OSError, ValueError) as error:
        missing.append(f"run.toml cannot be read: {error}.")
        return []
    settings: list[Setting] = []
    table, above = "", list[str]()
    for line in text.splitlines():
        if absent := re.match(r"\s*#\s*([A-Za-z0-9_.-]+) is not set\s*$", line):
            settings.append(Setting(table, absent.group(1), "not set", " ".join(above)))
            above = []
        elif line.lstrip().startswith("#"):
            above.append(line.lstrip("# ").rstrip())
        elif header := re.match(r"\s*\[+([^\]]+)\]+\s*(#.*)?$", line):
            table, above = header.group(1).strip(), []
        elif pair := re.match(r"\s*([A-Za-z0-9_.\"'-]+)\s*=\s*(.*)", line):
            parts = _VALUE.fullmatch(pair.group(2))
            value, comment = (part.strip() for part in (parts.groups("") if parts else (pair.group(2), "")))
            if not table:
                above = []  # what stands there is about the file
            settings.append(Setting(table, pair.group(1).strip("\"'"), value, " ".join([*above, comment]).strip()))
            above = []
        else:
            above = []
    return settings
