"""Known biases (limits.toml): the lists of docs/limits.md, and what a report says of its kind of run.

`python -m vis.page.limits docs/limits.md` puts the lists between the marks of that page.
"""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .marks import insert

__all__ = [
    "KINDS", "Bias", "Limit", "all_limits", "bias_of", "kind_of", "known_errors", "limits_lines", "limits_words",
    "put_lines",
]  # fmt: skip

KINDS = (
    "spike on grains", "platform on grains", "robot on grains", "robot on a law", "bed", "planar model", "diagnosis",
)  # fmt: skip
"""Kinds of runs that limits concern."""
ERRORS = ("chance", "grain size", "bed")
"""Columns of errors in the table of a run on grains, as a bias names them."""
_MARKS = ("<!-- limits: begin -->", "<!-- limits: end -->")
_GROUPS = {
    True: "What fails",
    False: "What is biased, left out or not measured",
}


@dataclass(frozen=True, kw_only=True)
class Bias:
    """A limit's size for one number of a trial, as the table of a report has it."""

    number: str  # Of result.json
    cell: str  # How far it is off, and from what; after `real` only from what
    surface: str | tuple[str, ...]
    actuator: str
    column: str = "bias"  # Of the table: "bias" of a trial on the spring-damper, one of `ERRORS` of one on grains
    real: tuple[float, float] | None = None  # The number among real grains and its half interval [degrees or mm]
    torque: float | None = None  # [N m]; None: of any
    gravity_sim: float | None = None  # [m/s2]; None: of any
    stiffness: float | None = None  # Of the surface [N/m]: `sand` of before 2026-11-26 had another; None: of any
    duration: float | None = None  # [s]; None: of any

    def concerns(self, result: Mapping[str, Any], number: str) -> bool:
        """Whether it is of this `number` of this result, whose model has no further terms."""
        trial = result.get("trial") or {}
        for name in ("torque", "gravity_sim", "stiffness"):
            wanted = getattr(self, name)
            found = (trial.get(name) or {}).get("value")
            if wanted is not None and (found is None or not math.isclose(found, wanted, rel_tol=0.01)):
                return False
        if self.duration is not None and not math.isclose(result.get("duration") or 0.0, self.duration, rel_tol=0.1):
            return False
        surfaces = (self.surface,) if isinstance(self.surface, str) else self.surface
        names = (number, result.get("actuator"), result.get("ground"))
        ground = "spring-damper" if self.column == "bias" else "bed"
        alike = names == (self.number, self.actuator, ground) and result.get("surface") in surfaces
        return alike and not result.get("effects")

    def shown(self, entry: Mapping[str, Any]) -> str:
        """The cell beside this number of result.json: with `real`, how far it is from that."""
        if self.real is None:
            return self.cell
        factor, unit = (180 / math.pi, "°") if entry["unit"] == "rad" else (1e3, "\N{NO-BREAK SPACE}mm")
        off = f"{factor * entry['value'] - self.real[0]:+.0f}".replace("-", "\N{MINUS SIGN}")
        return f"{off} ± {self.real[1]:.0f}{unit} {self.cell}"


@dataclass(frozen=True, kw_only=True)
class Limit:
    """One bias."""

    what: str
    size: str  # How large, and which way
    source: str  # A page of docs, with its heading
    runs: tuple[str, ...]  # Kinds of runs that it concerns
    fails: bool = False  # Whether something measured or published is missed
    case: tuple[str, ...] = ()  # Rows of docs/validation.md that fail by it
    said: str = ""  # What reports say of it, size and direction included; "": nothing
    bias: tuple[Bias, ...] = ()  # Its size in the table of a report


@cache
def all_limits() -> tuple[Limit, ...]:
    """Every limit, failures first. Raises ValueError for an entry of the file that cannot be."""
    file = Path(__file__).with_name("limits.toml")
    found = []
    for entry in tomllib.loads(file.read_text(encoding="utf-8"))["limit"]:
        given = dict(entry) | {
            "source": entry["from"],
            "runs": tuple(entry["runs"]),
            "case": tuple(entry.get("case", ())),
            "bias": tuple(Bias(**one) for one in entry.get("bias", ())),
        }
        del given["from"]
        limit = Limit(**given)
        if unknown := set(limit.runs) - set(KINDS):
            raise ValueError(f"limits.toml: {limit.what!r}: runs holds {sorted(unknown)}; there is {', '.join(KINDS)}")
        found.append(limit)
    return tuple(sorted(found, key=lambda limit: not limit.fails))


def kind_of(result: Mapping[str, Any]) -> str | None:
    """The kind of run that a result.json is of; None where no limit concerns it."""
    experiment = str(result.get("experiment") or "")
    on_grains = result.get("ground") == "bed" or "grains" in result
    if experiment.startswith("tumble"):
        return "platform on grains" if on_grains else "planar model"
    if experiment == "mujoco":
        if on_grains:
            return "robot on grains"
        return None if result.get("surface") in ("steel", "brick") else "robot on a law"
    if experiment in ("hop", "paper", "campaign"):
        return "planar model"
    if experiment.startswith("bed"):
        return "bed"
    if experiment == "diagnose":
        return "diagnosis"
    law_alone = result.get("ground", "bed") != "bed"
    return "spike on grains" if experiment in ("penetrate", "") and not law_alone else None


def limits_words(result: Mapping[str, Any]) -> list[str]:
    """What the report of this result says of the limits of its kind of run, size and direction included."""
    kind = kind_of(result)
    return [limit.said for limit in all_limits() if kind in limit.runs and limit.said]


def bias_of(result: Mapping[str, Any], number: str) -> str:
    """The known bias of a number of a trial on a law, as a cell of a table; "" where none is known."""
    return _known(result, number, "bias")


def known_errors(result: Mapping[str, Any], number: str) -> tuple[str, ...]:
    """The `ERRORS` of a number of a trial on grains as far as limits have them; "" for one that none has."""
    return tuple(_known(result, number, column) for column in ERRORS)


def _known(result: Mapping[str, Any], number: str, column: str) -> str:
    kind = kind_of(result)
    known = (bias for limit in all_limits() if kind in limit.runs for bias in limit.bias if bias.column == column)
    return next((bias.shown(result["quantities"][number]) for bias in known if bias.concerns(result, number)), "")


def limits_lines(limits: Sequence[Limit]) -> list[str]:
    """The lines of the lists of docs/limits.md, one for each group: what, which runs, how large, from which page."""
    lines = []
    for fails, heading in _GROUPS.items():
        lines += [f"### {heading}", ""]
        for limit in limits:
            if limit.fails == fails:
                page, _, heading = limit.source.partition("#")
                link = f"[{page}]({limit.source})"
                runs = ", ".join(kind.removesuffix(" on grains") for kind in limit.runs)
                lines.append(f"- **{limit.what}** ({runs}): {limit.size} {link}")
        lines.append("")
    return lines


def put_lines(page: Path) -> None:
    """Write the lists anew between the marks of `page`. Raises ValueError where the marks are not there."""
    lines = "\n".join(limits_lines(all_limits()))
    text = insert(page.read_text(encoding="utf-8"), lines, _MARKS, page=str(page))
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    put_lines(Path(sys.argv[1]))
