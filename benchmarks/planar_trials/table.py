"""Tables and figures of docs/planar.md and its notebook: `python -m benchmarks.planar_trials.table docs`.

One table has both integrators and the batch on the paper's cases (two gravities, three torques, steel and brick).
Others have the error at the end of a tumble over the step, and the list of effects. Writes between the marks of
docs/planar.md and docs/notes/planar.md, and docs/images/planar-*.png.
"""

import math
import sys
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from rigid import EFFECTS, Trial, simulate, simulate_batch
from rigid.planar.dynamics import System
from rigid.planar.located import integrate
from vis.page.plots import BED, INK, MODEL, STATES, handle, legend_above, sheet, styled, title_above
from vis.page.states import legend_of_states, panels, state_runs

GRAVITY, MASS = 9.80665, 5.3
MARKS = "<!-- planar {0}: begin -->", "<!-- planar {0}: end -->"
SURFACES = {"steel": 0.25, "brick": 0.5}
TORQUES = (0.125, 0.22, 6.0)
WHEEL_SPEED = 300.0  # of the brake trials [rad/s]: ours, the paper gives none
DURATION = 2.0
NAMES = ("x", "y", "theta", "vx", "vy", "omega")
_SHOWN = 45.0
"""End of the figure of states [degrees]."""
_INTEGRATORS = (
    ("the paper's step, order 1", MODEL, "s", 1e-3),
    ("the batch, order 2", BED, "o", 1e-3),
    ("located, order 5 (over its longest step)", INK, "^", 8e-3),
)
"""Name, colour, mark and longest step [s]."""


def case(level: float, torque: float, mu_s: float) -> Trial:
    """The platform in the rig, at `level` g."""
    gravity_sim = level * GRAVITY
    brake = torque == 6.0
    return Trial(
        gravity_sim=gravity_sim, counterweight=MASS * (GRAVITY - gravity_sim) / (GRAVITY + gravity_sim), torque=torque,
        mu_s=mu_s, actuator="brake" if brake else "motor", wheel_speed_0=WHEEL_SPEED if brake else 0.0,
    )  # fmt: skip


def _each(values: Iterable[float | None], form: str, scale: float = 1.0) -> str:
    return " / ".join("-" if value is None or math.isnan(value) else format(scale * value, form) for value in values)


def table() -> str:
    """The Markdown table."""
    columns = ("case", "trajectory angle [deg]", "largest speed [m/s]", "largest spin [rad/s]", "hop at [deg]",
               "energy residual")  # fmt: skip
    lines = [f"| {' | '.join(columns)} |", "|---|---|---|---|---|---|"]
    for level, (surface, mu_s), torque in product((0.0085, 0.015), SURFACES.items(), TORQUES):
        trial = case(level, torque, mu_s)
        runs = [simulate(trial, duration=DURATION, method=method) for method in ("located", "paper")]
        many = simulate_batch([trial], duration=DURATION)
        angles = [*(run.trajectory_angle for run in runs), float(many.trajectory_angle[0])]
        speeds = [*(run.max_speed for run in runs), float(many.max_speed[0])]
        spins = [*(run.max_angular_velocity for run in runs), float(many.max_angular_velocity[0])]
        hops = [*(run.transition_angle("hop") for run in runs), float(many.transition_angles["hop"][0])]
        cells = (
            f"{level:g} g, {surface}, {torque:g} N m", _each(angles, ".2f", 180 / math.pi), _each(speeds, ".4f"),
            _each(spins, ".3f"), _each(hops, ".2f", 180 / math.pi),
            " / ".join(f"{run.energy_residual:.0e}" for run in runs),
        )  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def effects() -> str:
    """The names of the effects."""
    return ", ".join(f"`{term.id}`" for term in EFFECTS.values()) + "."


def details() -> str:
    """The list of effects in Markdown, whole: what each acts on, what its parameters mean, source and limits."""
    lines = ["| effect | what it is | acts on | parameters | source | limits |", "|---|---|---|---|---|---|"]
    for term in EFFECTS.values():
        own = "; ".join(f"`{p.name}` [{p.unit}] = {p.default:g}: {p.summary}" for p in term.parameters)
        lines.append(f"| `{term.id}` | {term.summary} | {term.acts} | {own} | {term.source} | {term.limits} |")
    return "\n".join(line.replace("|u|", "abs(u)") for line in lines)


def _final(trial: Trial, duration: float, longest: float, tolerance: float) -> np.ndarray:
    ends: list[list[float]] = []
    keep = lambda begin, end, z, at, modes: ends.append(z)  # noqa: E731
    integrate(System(trial), duration=duration, tolerance=tolerance, longest=longest, on_step=keep)
    return np.array(ends[-1][:6])


def draw_orders(path: Path) -> None:
    """Error at the end of a tumble over the step, three integrators, two trials with events."""
    trials = (
        ("brick, 0.0085 g, 0.125 N m (motor), 0.4 s:\nslips, sticks, a row lifts off", case(0.0085, 0.125, 0.5), 0.4),
        ("steel, 0.0085 g, 6 N m (brake), 0.1 s:\nslips, the wheel stops, hops", case(0.0085, 6.0, 0.25), 0.1),
    )
    with styled():
        drawing, (axes,) = sheet(1, 2, 4.0, sharey=True)
        for axis, trial in zip(axes, trials, strict=True):
            _draw_orders_of(axis, *trial)
        axes[0].set_ylabel("largest error of x, y, θ and rates [SI]")
        legend_above(drawing, [handle(label, colour, marker=marker) for label, colour, marker, _ in _INTEGRATORS], 3)
        title_above(drawing, "Error at the end of a tumble over the step, on the spring-damper")
        drawing.savefig(path, dpi=126)


def _draw_orders_of(axis: Any, title: str, trial: Trial, duration: float) -> None:
    exact = _final(trial, duration, 5e-3, 1e-13)
    halved = 0.5 ** np.arange(5)
    runs = [simulate(trial, duration=duration, method="paper", time_step=float(h)) for h in 1e-3 * halved]
    batches = [simulate_batch([trial], duration=duration, time_step=float(h)).final for h in 1e-3 * halved]
    located = [_final(trial, duration, float(h), 1e3) for h in 8e-3 * halved]
    found = (
        [[getattr(run, name)[-1] for name in NAMES] for run in runs],
        [[final[name][0] for name in NAMES] for final in batches],
        located,
    )
    for (_, colour, marker, longest), ends in zip(_INTEGRATORS, found, strict=True):
        error = np.abs(np.array(ends) - exact).max(axis=1)
        axis.loglog(longest * halved, error, color=colour, marker=marker)
    axis.set(xlabel="step [s]", title=title)


def draw_states(path: Path) -> None:
    """State over theta, as the paper's Figure 6 has it, for steel and brick at 0.0085 g."""
    with styled():
        drawing, axes = panels(2, 2.7)
        drawing.subplots_adjust(top=0.76, bottom=0.2, left=0.15, wspace=0.08)
        seen: set[str] = set()
        for axis, (surface, mu_s) in zip(axes, SURFACES.items(), strict=True):
            for place, torque in enumerate(TORQUES):
                run = simulate(case(0.0085, torque, mu_s), duration=DURATION)
                theta, names = np.degrees(run.theta), np.array(run.state_names)
                for low, high, name in state_runs(names):
                    ends = theta[low], theta[min(high, len(theta) - 1)]
                    if max(ends) > 0 and min(ends) < _SHOWN:
                        seen.add(name)
                        axis.barh(place, ends[1] - ends[0], left=ends[0], height=0.62, color=STATES[name])
            axis.set(title=f"{surface}, 0.0085 g, first {DURATION:g} s", xlabel="θ [degrees]", xlim=(0, _SHOWN))
            axis.grid(False, axis="y")
            axis.invert_yaxis()
            axis.set_yticks(range(len(TORQUES)), ["0.125 N m (motor)", "0.22 N m (motor)", "6 N m (brake)"])
        axes[1].tick_params(labelleft=False)
        legend_of_states(drawing, np.array(sorted(seen)))
        title_above(drawing, "States of a tumble over its angle, on the spring-damper")
        drawing.savefig(path, dpi=126)


def draw(docs: Path) -> None:
    """Both figures into the documentation in `docs`."""
    draw_orders(docs / "images" / "planar-orders.png")
    draw_states(docs / "images" / "planar-states.png")


def main(folder: str) -> None:
    """Write the table and the figures into the documentation in `folder`."""
    docs = Path(folder)
    draw(docs)
    for page, parts in (
        (docs / "planar.md", {"effects": effects()}),
        (docs / "notes" / "planar.md", {"cases": table(), "effects": details()}),
    ):
        text = page.read_text(encoding="utf-8")
        for name, part in parts.items():
            begin, end = (mark.format(name) for mark in MARKS)
            before, rest = text.split(begin)
            text = f"{before}{begin}\n{part}\n{end}{rest.split(end)[1]}"
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "docs")
