"""What a penetration leaves behind: one row per macro step, and the numbers read off it."""

import itertools
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dem.shown import html_of
from hedgebed_renamed import renamed
from rigid.result import Result, quantities_of, toml_value, write_text
from rigid.series import read_series, write_series
from rigid.version import __version__

__all__ = ["PHASES", "Penetration"]

PHASES = ("free", "in", "rest", "out")
COLUMNS = ("t_s", "depth_m", "velocity_m_s", "force_N", "phase")
FACTS = ("kind", "macro_step", "ended", "settings")
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Penetration:
    """One run of a spike into a ground. Each row is one macro step: its mean force at its middle.

    Depth and velocity are positive downwards, force is the ground's on the spike, positive upwards.
    """

    kind: str  # "driven", "drop" or "set_down"
    time: Array  # Middle of each macro step [s], shape [n]; 0 where the tip meets the undisturbed surface
    depth: Array  # Depth of the tip at the middle of the step [m], shape [n]
    velocity: Array  # Velocity held during the step [m/s], shape [n]
    force: Array  # Mean force during the step [N], shape [n]
    phase: NDArray[np.str_]  # "free", "in", "rest" or "out", shape [n]
    macro_step: float  # Length of a macro step [s]
    ended: str = "done"
    """Why it ended.

    "done": a driven run came to the end of its way. "rest": a drop or set-down came to rest. "stopped": a drop was
    still bobbing `after_stop` after its first stop. "max_depth": it reached the largest depth allowed. "max_time": its
    time was over. "unfinished": these are the rows of a run under way.
    """
    settings: dict[str, Any] = field(default_factory=dict)
    """What was asked for: speed, depth, load, mass and so on, SI units."""

    @property
    def loading(self) -> NDArray[np.bool_]:
        """Rows of the first loading, shape [n]: the spike is in the ground and goes down, up to its first stop."""
        inside = self.phase == "in"
        if not inside.any():
            return inside
        first = int(np.argmax(inside))
        rest = np.flatnonzero(~inside[first:])
        last = first + int(rest[0]) if rest.size else len(inside)
        rows = np.zeros(len(inside), dtype=bool)
        rows[first:last] = True
        return rows

    way_in = renamed("way_in", "loading")

    @property
    def work_in(self) -> float:
        """Work of the spike on the ground while going down [J]."""
        down = self.velocity > 0
        return float(np.sum(self.force[down] * self.velocity[down]) * self.macro_step)

    @property
    def work_out(self) -> float:
        """Work of the ground on the spike while going up [J]."""
        up = self.velocity < 0
        return float(-np.sum(self.force[up] * self.velocity[up]) * self.macro_step)

    @property
    def peak_force(self) -> float:
        """Largest force of one macro step [N]."""
        return float(self.force.max()) if self.force.size else 0.0

    @property
    def max_depth(self) -> float:
        """Largest depth [m]."""
        return float(self.depth.max()) if self.depth.size else 0.0

    @property
    def final_depth(self) -> float:
        """Depth at the end [m]."""
        return float(self.depth[-1]) if self.depth.size else 0.0

    @property
    def resting_depth(self) -> float | None:
        """Depth at which it came to rest [m]; None where it did not (`ended` is not "rest")."""
        return self.final_depth if self.ended == "rest" else None

    @property
    def stop_time(self) -> float | None:
        """Time from the surface to the first stop [s]; None where it never stopped."""
        rows = np.flatnonzero(self.loading)
        if not rows.size or rows[-1] + 1 >= len(self.time):
            return None
        return float(self.time[rows[-1]] + 0.5 * self.macro_step)

    def columns(self) -> dict[str, NDArray[Any]]:
        """The rows as columns of a table, names with units, shapes [n]."""
        return dict(zip(COLUMNS, (self.time, self.depth, self.velocity, self.force, self.phase), strict=True))

    def facts(self) -> dict[str, Any]:
        """What is not in the rows: kind, macro_step, ended, settings."""
        return {name: getattr(self, name) for name in FACTS}

    @classmethod
    def from_columns(cls, columns: Mapping[str, NDArray[Any]], facts: Mapping[str, Any]) -> "Penetration":
        """The run that `columns` and `facts` came from, to the bit; what else `facts` holds is left out."""
        time, depth, velocity, force, phase = (columns[name] for name in COLUMNS)
        known = {name: facts[name] for name in FACTS if name in facts}
        return cls(time=time, depth=depth, velocity=velocity, force=force, phase=phase, **known)

    def write_csv(self, path: str | Path) -> None:
        """Write the rows with every digit, so that they read back bitwise the same."""
        write_series(path, self.columns(), line_end="\r\n")

    @classmethod
    def read_csv(cls, path: str | Path, *, kind: str, macro_step: float, **more: Any) -> "Penetration":
        """Read what `write_csv` wrote; `kind`, `macro_step` and the rest are not in the file."""
        columns = read_series(path)
        columns["phase"] = columns["phase"].astype("U4")
        return cls.from_columns(columns, {"kind": kind, "macro_step": macro_step, **more})

    def quantities(self) -> dict[str, dict[str, Any]]:
        """The numbers a person would quote, as in result.json: name -> value, std (unknown), unit."""
        values: dict[str, tuple[float | None, str, str]] = {
            "peak_force": (self.peak_force, "N", ""), "max_depth": (self.max_depth, "m", ""),
            "work_in": (self.work_in, "J", ""), "work_out": (self.work_out, "J", ""),
        }  # fmt: skip
        if self.ended == "rest":
            values["final_depth"] = (self.final_depth, "m", "")
            if self.kind == "set_down":
                values["sinkage"] = (self.final_depth, "m", "")
        if self.kind == "drop" and self.stop_time is not None:
            values["stop_time"] = (self.stop_time, "s", "")
        return quantities_of(values, std=None)

    def _repr_html_(self) -> str | None:
        """What a notebook shows for a run that is the last line of a cell."""
        return html_of("run", self)

    def save(self, folder: str | Path) -> Path:
        """Write a run folder: run.toml, result.json and the series; returns it (`vis.write_report` makes the report).

        What was computed is not lost to a name: where the folder is in use, the next free one of folder-2, folder-3
        and so on is taken, with a warning.
        """
        wanted = folder = Path(folder)
        for number in itertools.count(2):
            if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
                break
            folder = wanted.with_name(f"{wanted.name}-{number}")
        if folder != wanted:
            warnings.warn(f"{str(wanted)!r} is in use: the run is in {str(folder)!r}", stacklevel=2)
        write_text(folder / "run.toml", self._toml())
        series, settings = f"series/{self.kind}.csv", self.settings
        self.write_csv(folder / series)
        run = {
            "id": self.kind, "kind": self.kind, "speed": settings.get("speed"), "series": series, "ended": self.ended,
            "quantities": self.quantities(),
        }  # fmt: skip
        Result.make(
            self.kind, title=f"A {self.kind.replace('_', ' ')} spike",
            status="stopped" if self.ended == "unfinished" else "done", quantities=self.quantities(), runs=[run],
            bed=settings.get("ground_settings", {}), spike=settings.get("spike", {}),
            warnings=[REMARKS[self.ended]] if self.ended in REMARKS else [],
        ).write(folder)  # fmt: skip
        return folder

    def _toml(self) -> str:
        tables = {key: value for key, value in self.settings.items() if isinstance(value, dict)}
        plain = {key: value for key, value in self.settings.items() if key not in tables}
        lines = [f"# A {self.kind.replace('_', ' ')} spike: what was run, SI units."]
        facts = {"experiment": self.kind, "version": __version__, "ended": self.ended, "macro_step": self.macro_step}
        lines += _toml_lines(facts | plain)
        for name, table in tables.items():
            lines += ["", f"[{'bed' if name == 'ground_settings' else name}]", *_toml_lines(table)]
        return "\n".join(lines) + "\n"


REMARKS = {
    "max_time": "its time was over before it had come to rest",
    "max_depth": "it reached the largest depth allowed and was ended there",
    "stopped": "it was still bobbing when it was ended",
    "unfinished": "these are the rows of a run under way",
}
"""What a result warns of, by how the run ended."""
UNITS = {
    "macro_step": "s", "speed": "m/s", "start_depth": "m", "depth": "m", "hold": "s", "retreat_speed": "m/s",
    "mass": "kg", "load": "N", "rest_time": "s", "rest_tolerance": "1", "after_stop": "s", "max_time": "s",
    "lowering_speed": "m/s", "diameter": "m", "shaft_diameter": "m", "length": "m", "cone_angle": "degrees",
    "size": "m", "surface": "m", "time_step": "s", "gravity": "m/s2", "packing_fraction": "1", "stiffness": "N/m",
    "damping": "N s/m", "centre": "m", "grain": "m", "young": "Pa",
}  # fmt: skip
"""Units of what run.toml holds."""


def _toml_lines(values: dict[str, Any]) -> list[str]:
    """One line each, with its unit; what is not set is left out."""
    units = {key: f"  # {UNITS[key]}" if key in UNITS else "" for key in values}
    return [f"{key} = {toml_value(value)}{units[key]}" for key, value in values.items() if value is not None]
