"""`hedgebed compare`: two finished runs in one report, their numbers with differences, what they did over time.

Differences are the second less the first. series/compared.csv holds two tumbles, or two runs of one robot, on one grid
of time. Both tumbles must be in the plane, or both in space; grounds and integrators may differ. Where one lasts
longer, numbers that depend on that are compared over the time that both last; those of each whole run are beside. Of
penetrations numbers are compared.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.grains.settings import OF_THE_MASTER, GrainsSettings, TumbleBedSettings
from experiments.runs.folder import RunFolder, read_series
from experiments.runs.kept_results import PATH_AND_MOTION, require_files
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run
from experiments.spatial.settings import ON_ANY_GROUND
from rigid.intervals import half_of, half_width
from rigid.planar.trajectory import LAUNCH_DISTANCE
from vis.penetrate.errors import in_95

from . import robots as compare_robots
from . import spatial as compare_spatial
from . import tumbles as compare_tumbles
from .robots import MovedRobot
from .settings import CompareSettings, say
from .spatial import QUATERNION, MovedInSpace
from .tumbles import Moved

__all__ = ["ALIKE", "TIMELESS", "check", "numbers_until", "resume", "run", "sinkage_of"]

IN_THE_PLANE, IN_SPACE, ROBOT = "tumble", "tumble spatial", "mujoco"
KINDS = (IN_THE_PLANE, IN_SPACE, ROBOT, "penetrate")
MODULES: dict[str, Any] = {IN_THE_PLANE: compare_tumbles, IN_SPACE: compare_spatial, ROBOT: compare_robots}
"""What is compared over time."""
OF_A_BED: dict[str, tuple[type[GrainsSettings], tuple[str, ...]]] = {
    IN_THE_PLANE: (TumbleBedSettings, OF_THE_MASTER), IN_SPACE: (GrainsSettings, ON_ANY_GROUND),
    ROBOT: (GrainsSettings, (*ON_ANY_GROUND, "threads")),
}  # fmt: skip
"""Settings that are of a bed of grains, and those among them that other grounds take too."""
MOST_RELATIVE = 10.0
"""Difference over the first run's number up to which it is stated as a share of it [1]."""


def check(settings: CompareSettings) -> None:
    """Raise ValueError, naming the folder and what is allowed, for runs that cannot be compared."""
    first, second = (_finished(path) for path in settings.runs)
    if first.path.resolve() == second.path.resolve():
        raise ValueError(say("same_run", runs=settings.runs))
    if {first.command, second.command} == {IN_THE_PLANE, IN_SPACE}:
        raise ValueError(say("plane_and_space", runs=settings.runs, first=first, second=second))
    if first.command != second.command:
        raise ValueError(say("two_kinds", runs=settings.runs, first=first, second=second))
    for one in (first, second):
        one.read_result()
    if first.command == ROBOT:
        compare_robots.check_alike(settings.runs, [one.read_result() for one in (first, second)])
    if first.command in (IN_SPACE, ROBOT):  # an older folder lacks series: said before anything is written
        for one in (first, second):
            MODULES[first.command].read_moved(one.path, one.read_result())


def _finished(path: str) -> RunFolder:
    folder = RunFolder.open(Path(path))
    if folder.command not in KINDS:
        kinds = f"{', '.join(KINDS[:-1])} or {KINDS[-1]}"
        raise ValueError(say("nothing_over_time", path=path, command=folder.command, kinds=kinds))
    if not (folder.path / "result.json").exists():
        raise ValueError(say("no_result", path=path, status=folder.status or "not finished"))
    if folder.command == IN_THE_PLANE:
        require_files(folder, PATH_AND_MOTION, key="runs")
    return folder


def _compute(settings: CompareSettings, folder: RunFolder, progress: Progress) -> Result:
    first, second = (_finished(path) for path in settings.runs)
    results = [one.read_result() for one in (first, second)]
    labels = _labels((first, second), results)
    result: Json = {
        "kind": first.command, "title": f"{labels[0]} and {labels[1]}", "status": "done",
        "runs": [
            {"folder": os.path.relpath(one.path, folder.path), "label": label, "title": str(found.get("title", ""))}
            for one, label, found in zip((first, second), labels, results, strict=True)
        ],
        "quantities": {}, "departures": {"sentences": []},
        "compared": [], "compared_over": None, "differs": _differs(first, second, results),
        "colour": settings.colour, "pictures": settings.pictures and first.command != "penetrate",
        "warnings": _whose(labels, [one["warnings"] for one in results]),
    }  # fmt: skip
    if first.command != "penetrate":
        progress.stage("series", total=1.0)
        _add_motion(result, (first, second), results, labels, folder)
    else:
        result["compared"] = _compared(results)
    result["tables"] = _numbers(result, labels)
    if rows := result.get("rows"):
        shown = [[str(row["row"]), *(f"{1e3 * row[key]:.3g}" for key in ("first", "second"))] for row in rows]
        title = "Largest sinkage of each row of spikes over the common time [mm]"
        result["tables"].append({"title": title, "head": ["row", *labels], "rows": shown})
    if result["differs"]:
        shown = [list(row.values()) for row in result["differs"]]
        head = ["key", *labels, "unit"]
        result["tables"].append({"title": "Settings and numbers that differ", "head": head, "rows": shown})
    return Result.make("compare", **result)


def _relative(first: float, second: float) -> float | None:
    """The difference over the first; None of a first that is next to nothing, of which it says nothing."""
    apart = abs(second - first)
    return (second - first) / abs(first) if first and apart < MOST_RELATIVE * abs(first) else None


def _whose(labels: Sequence[str], said: Sequence[Sequence[str]]) -> list[str]:
    """Warnings of each run, by its label; those of both once."""
    both = [sentence for sentence in said[0] if sentence in said[1]]
    pairs = [(label, sentence) for label, own in zip(labels, said, strict=True) for sentence in own]
    return [
        *(f"both: {sentence}" for sentence in both),
        *(f"{label}: {sentence}" for label, sentence in pairs if sentence not in both),
    ]


def _add_motion(
    result: Json, runs: Sequence[RunFolder], results: list[Json], labels: tuple[str, str], folder: RunFolder
) -> None:
    """series/compared.csv, the gaps between both as quantities, and sentences."""
    module = MODULES[result["kind"]]
    moved = [module.read_moved(one.path, found) for one, found in zip(runs, results, strict=True)]
    whole = [one["quantities"] for one in results]
    if result["kind"] == IN_THE_PLANE:
        whole = [sinkage_of(one) | own for one, own in zip(moved, whole, strict=True)]
    named = [one | {"quantities": own} for one, own in zip(results, whole, strict=True)]
    lasts, parts = [float(one.time[-1]) for one in moved], None
    longer = abs(lasts[0] - lasts[1]) > ALIKE
    if longer:  # compared over the time that both last
        end = min(lasts)
        parts = [numbers_until(end, one, own, run.path) for one, own, run in zip(moved, named, runs, strict=True)]
        result["compared_over"], result["lasts"] = end, lasts
    result["compared"] = _compared(named, parts)
    columns = module.compared_columns(*moved)
    folder.write_series("compared", columns)
    result["series"] = "series/compared.csv"
    if result["kind"] == ROBOT:
        result["feet"] = list(moved[0].names)
    elif result["kind"] == IN_SPACE:
        result["spikes"] = list(dict.fromkeys(spike for one in moved for spike in one.spikes))
    else:
        result["spike_count"] = min(one.count for one in moved)
        result["rows"] = compare_tumbles.row_sinkage(columns, result["spike_count"])
    result["weights"] = [one.weight for one in moved]
    result["quantities"] = module.gaps(columns)
    said = module.told_apart(columns, labels)
    result["departures"]["sentences"] = [*said, say("lasting", lasts=lasts)] if longer else said
    result["warnings"] += _whose(labels, [one.notes for one in moved])


def _labels(folders: tuple[RunFolder, RunFolder], results: list[Json]) -> tuple[str, str]:
    """What to call the two: by their ground where that differs, else by their folders."""
    by_ground = [_ground(one, folder.settings) for one, folder in zip(results, folders, strict=True)]
    paths = [str(one.path) for one in folders]
    choices = (by_ground, [one.path.name or str(one.path) for one in folders], paths)
    first, second = next((words for words in choices if words[0] != words[1]), paths)
    return first, second


def _ground(result: Mapping[str, Any], settings: Mapping[str, Any]) -> str:
    ground = str(result.get("ground", ""))
    elsewhere = " in LAMMPS" if settings.get("ground") == "lammps" else ""
    named = {"bed": f"bed of {result.get('surface', 'grains')}{elsewhere}", "": "bed of grains"}.get(ground, ground)
    return named if result.get("method") != "paper" else f"{named}, the paper's step"


def _compared(results: list[Json], parts: list[dict[str, float | None]] | None = None) -> list[Json]:
    """Every quantity of either, with the difference where both have a value.

    `parts`: those that depend on how long a run lasts, over the time that both last, compared in place of the whole
    runs' own, which are kept as `first_whole` and `second_whole`.
    """
    first, second = (result.get("quantities", {}) for result in results)
    halves, rows = [_halves(result) for result in results], []
    for name in dict.fromkeys([*first, *second]):
        one, other = first.get(name, {}), second.get(name, {})
        whole = [entry.get("value") for entry in (one, other)]
        shared = parts is not None and any(name in part for part in parts)
        values: list[Any] = [part.get(name) for part in parts] if parts is not None and shared else whole
        both = all(isinstance(value, int | float) for value in values)
        spreads = [entry.get("std") for entry in (one, other)]
        row = {
            "name": name, "unit": one.get("unit", other.get("unit", "")), "first": values[0], "second": values[1],
            "difference": values[1] - values[0] if both else None,
            "relative": _relative(*values) if both else None, "first_std": spreads[0], "second_std": spreads[1],
            "first_half": halves[0].get(name), "second_half": halves[1].get(name),
        }  # fmt: skip
        if parts is not None:
            over = "shared time" if shared or name in TIMELESS else "whole runs"
            row |= {"over": over, "first_whole": whole[0], "second_whole": whole[1]}
        rows.append(row)
    return rows


def _halves(result: Json) -> dict[str, float | None]:
    """Half of the 95 % interval of each quantity whose error is known: over beds, or by the parameters of a law."""
    if result.get("experiment") == "penetrate":
        return {name: entry.get("std") for name, entry in in_95(result).items()}
    beds = len(result.get("beds", ()))
    known = {name: entry for name, entry in result.get("quantities", {}).items() if entry.get("std") is not None}
    return {name: half_width(entry["std"], beds) if beds else half_of(entry) for name, entry in known.items()}


def _differs(first: RunFolder, second: RunFolder, results: list[Json]) -> list[Json]:
    """Settings and numbers of the trial in which the two differ: key, both values as they are written."""
    rows = []
    for key in dict.fromkeys([*first.settings, *second.settings]):
        one, other = _used(first, key, results[0]), _used(second, key, results[1])
        if one != other and "" not in (one, other):
            rows.append({"key": key, "first": _written(one), "second": _written(other), "unit": ""})
    trials = [result.get("trial", {}) for result in results]
    known = {row["key"] for row in rows}
    for key in dict.fromkeys([*trials[0], *trials[1]]):
        one, other = (trial.get(key, {}).get("value") for trial in trials)
        if one != other and key not in known:
            unit = trials[0].get(key, trials[1].get(key, {})).get("unit", "")
            rows.append({"key": key, "first": _written(one), "second": _written(other), "unit": unit})
    return rows


def _used(folder: RunFolder, key: str, result: Mapping[str, Any]) -> Any:
    """A setting as it took part in a run; "" where it is of the bed, and there was none."""
    if folder.command == IN_THE_PLANE and key == "method":
        return result["method"]
    bed, others = OF_A_BED.get(folder.command, (None, ()))
    if bed is not None and result["ground"] != "bed" and key in bed.model_fields and key not in others:
        return ""
    return folder.settings.get(key)


def _written(value: Any) -> str:
    if value is None:
        return "not set"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _numbers(result: Json, labels: tuple[str, str]) -> list[Json]:
    """For the terminal: one table, or those of the time that both last and of each run as a whole."""
    rows, end = result["compared"], result["compared_over"]
    less = f"{labels[1]} less {labels[0]}"
    if end is None:
        return [_table(f"Numbers of both, and {less}", labels, rows)]
    lasts = " and ".join(f"{time:.4g}" for time in result["lasts"])
    shared = [row for row in rows if row["over"] == "shared time"]
    whole = [
        row | {"first": row["first_whole"], "second": row["second_whole"]}
        for row in rows
        if (row["first_whole"], row["second_whole"]) != (row["first"], row["second"]) or row["over"] != "shared time"
    ]
    return [
        _table(f"Numbers over the common time, the first {end:.4g} s, and {less}", labels, shared),
        _table(f"Numbers of each run as a whole, over its own {lasts} s", labels, whole, differences=False),
    ]


def _table(title: str, labels: tuple[str, str], rows: list[Json], *, differences: bool = True) -> Json:
    """For the terminal: angles in degrees."""
    shown = []
    for row in rows:
        scale, unit = 1.0, row["unit"] if row["unit"] != "1" else ""
        if unit == "rad":
            scale, unit = 180 / math.pi, "degrees"
        numbers = [_number(row[key], scale, False) for key in ("first", "second")]
        if differences:
            relative = f"{100 * row['relative']:+.3g} %" if row["relative"] is not None else ""
            numbers += [_number(row["difference"], scale, True), relative]
        shown.append([row["name"], *numbers, unit])
    return {"title": title, "head": ["quantity", *labels, *["less", ""] * differences, "unit"], "rows": shown}


def _number(value: Any, scale: float, signed: bool) -> str:
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "-"
    return f"{scale * value:+.4g}" if signed and value else f"{scale * value:.4g}"


Array = NDArray[np.float64]
ALIKE = 2e-3
"""Runs whose ends are no further apart last equally long [s]."""
TIMELESS = ("tipping_torque", "slip_torque", "sinkage_start")
"""Numbers that do not go with how long a run lasts."""
LOST = ("damping", "friction", "rolling")


@dataclass
class _Numbers:
    """What a run's numbers are made of: largest values and final ones over time, events at a time (None: never)."""

    largest: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    final: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    events: dict[str, float | None] = field(default_factory=dict)


def numbers_until(
    end: float, moved: Moved | MovedInSpace | MovedRobot, result: Mapping[str, Any], folder: Path
) -> dict[str, float | None]:
    """Those of the result's quantities that go with how long it lasts, until `end` [s]; all in SI."""
    own = {name: entry.get("value") for name, entry in result.get("quantities", {}).items()}
    counted: dict[str, float] = {}
    if isinstance(moved, MovedRobot):
        largest, final, events, counted = compare_robots.numbers_over_time(moved, end)
        known = _Numbers(largest, final, events)
    else:
        known = _in_space(moved, result) if isinstance(moved, MovedInSpace) else _in_the_plane(moved, result)
    path = folder / "series" / "bed.csv"
    bed = read_series(path) if path.exists() else {}
    lost = {f"dissipated_{name}": f"{name}_lost_J" for name in LOST}
    known.final |= {name: (bed["t_s"], bed[column]) for name, column in lost.items() if column in bed}
    found: dict[str, float | None] = {}
    if float(moved.time[-1]) <= end + ALIKE:
        names = (*known.largest, "time_of_max_speed", *known.final, *known.events, *counted)
        return {name: own[name] for name in names if name in own}
    for name, (time, values) in known.largest.items():
        if name in own:
            within = float(time[int(np.argmax(values))]) <= end
            found[name] = own[name] if within else float(values[time <= end].max())
    if "max_speed" in known.largest and "time_of_max_speed" in own:
        time, values = known.largest["max_speed"]
        at = float(time[int(np.argmax(np.where(time <= end, values, -1.0)))])
        found["time_of_max_speed"] = own["time_of_max_speed"] if found["max_speed"] == own["max_speed"] else at
    found |= {name: float(np.interp(end, *rows)) for name, rows in known.final.items() if name in own}
    for name, when in known.events.items():
        if name in own:
            found[name] = own[name] if when is not None and when <= end else None
    return found | {name: value for name, value in counted.items() if name in own}


def sinkage_of(moved: Moved) -> dict[str, Json]:
    """`sinkage_start` and `sinkage_largest` as a tumble on grains has them, of a run whose result has none."""
    stood, deepest = float(moved.sinkage[0, [0, -1]].mean()), float(moved.sinkage.max())
    of_two = "of the two rows it stands on, mean, when the torque begins"
    return quantities_of({"sinkage_start": (stood, "m", of_two), "sinkage_largest": (deepest, "m", "of any row")})


def _in_the_plane(moved: Moved, result: Mapping[str, Any]) -> _Numbers:
    series, time = moved.series, moved.time
    known = _Numbers()
    known.largest["max_speed"] = time, np.hypot(series["vx_m_s"], series["vy_m_s"])
    known.largest["max_angular_velocity"] = time, np.abs(series["omega_rad_s"])
    known.largest["sinkage_largest"] = time, moved.sinkage.max(axis=1)
    if moved.load is not None:
        known.largest["largest_row_force"] = time, moved.load.max(axis=1)
    away = np.hypot(series["x_m"] - series["x_m"][0], series["y_m"] - series["y_m"][0])
    gone = np.flatnonzero(away >= LAUNCH_DISTANCE)
    known.events["trajectory_angle"] = float(time[gone[0]]) if len(gone) else None
    for state in ("slip", "hop"):
        times = (float(entry["time"]) for entry in result["transitions"] if entry["state"] == state)
        known.events[f"transition_angle_{state}"] = next(times, None)
    return known


def _in_space(moved: MovedInSpace, result: Mapping[str, Any]) -> _Numbers:
    series, time, own = moved.series, moved.time, result["quantities"]
    known = _Numbers()

    def size(columns: Mapping[str, Array], *names: str) -> Array:
        return np.asarray(np.linalg.norm([columns[name] for name in names], axis=0))

    known.largest["max_speed"] = time, size(series, "vx_m_s", "vy_m_s", "vz_m_s")
    known.largest["max_angular_velocity"] = time, size(series, "wx_rad_s", "wy_rad_s", "wz_rad_s")
    known.largest["largest_force"] = moved.motion["t_s"], size(moved.motion, "fx_N", "fy_N", "fz_N")
    if "turn_rad" in series:
        known.largest["largest_turn"] = time, series["turn_rad"]
    feet = moved.feet["t_s"]
    for name, begin in (("sinkage_largest", "sinkage_"), ("largest_spike_force", "normal_")):
        if spikes := [moved.feet[f"{begin}{spike}_{unit}"] for spike in moved.spikes for unit in ("m", "N")
                      if spike != "hull" and f"{begin}{spike}_{unit}" in moved.feet]:  # fmt: skip
            known.largest[name] = feet, np.max(spikes, axis=0)
    for axis in "xyz":
        known.final[f"displacement_{axis}"] = time, series[f"{axis}_m"] - series[f"{axis}_m"][0]
    q = [series[name] for name in QUATERNION]
    up = 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2) / np.sum(np.square(q), axis=0)
    known.final["tilt_end"] = time, np.arccos(np.clip(up, -1.0, 1.0))

    def when(name: str) -> float | None:
        value = own.get(name, {}).get("value")
        return float(value) if isinstance(value, int | float) and math.isfinite(value) else None

    goes_with = {"first_touch": ("impact_speed",), "first_hop": ("restitution",)}
    goes_with |= {f"transition_time_{state}": (f"transition_angle_{state}",) for state in ("slip", "hop")}
    for name, others in goes_with.items():
        known.events |= dict.fromkeys((name, *others), when(name))
    return known


run, resume = computed_run("compare", CompareSettings, _compute, check=check)
