"""What a run of a robot leaves: its frames, its series and its result."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from coupling.robot import BedFeet, RobotRun
from coupling.robot.feet import mesh_of
from coupling.robot.models import actuators_of, joints_of
from dem.prepare.prepare import fingerprint
from experiments.grains import bed_result as grains
from experiments.grains.softening import Softening
from experiments.grains.tracked_frames import PlatformFrames
from experiments.runs.folder import write_series
from experiments.runs.result import Result
from experiments.runs.result import quantities_of as as_quantities
from experiments.runs.types import Json
from rigid.platform.solids import Mesh, merge
from rigid.spatial.quaternions import to_matrix
from vis.page.answer import LIFTED
from vis.page.numbers import foldable, quote
from vis.robot.answer import BALLISTIC

from . import say
from .energy import MOST_RESIDUAL, balance_warning, idle
from .feet import (
    bounce_warning,
    bounce_words,
    buried_words,
    crater_losses,
    feet_quantities,
    feet_reached,
    heights_of,
    too_deep,
    too_fast,
)
from .flight import APART, Flights, at_end, find_flights, launched, pushes_off, rising, stays, to_landing
from .forms import NO_FORMS, Forms
from .joints import beyond_range
from .laws import of_sand
from .plan import RobotPlan
from .pushes import force_of, push_numbers, push_words, swing_warning
from .settings import RobotSettings

__all__ = ["RobotFrames", "conclude", "deepest_at_start", "write_series_of"]

BELOW = 1e-3  # What is no foot and goes deeper than this is worth a warning [m]
UNITS = {
    "time": "t_s", "x": "x_m", "y": "y_m", "z": "z_m", "kinetic_energy": "kinetic_J", "potential_energy": "potential_J",
    "torque_work": "torque_work_J", "actuator_work": "actuator_work_J", "given": "given_J", "taken": "taken_J",
    "fx": "fx_N", "fy": "fy_N", "fz": "fz_N", "touching": "touching", "sinkage": "sinkage_m",
}  # fmt: skip
FOOT = (
    "x_m", "y_m", "z_m", "q0", "q1", "q2", "q3", "fx_N", "fy_N", "fz_N", "mx_N_m", "my_N_m", "mz_N_m", "depth_m",
)  # fmt: skip
"""Of each foot in series/feet.csv, as `RobotRun.feet` has them; `height_m` of its lowest point stands beside them."""

Array = np.ndarray
Number = tuple[float | None, str, str]  # Value, unit and note


class RobotFrames(PlatformFrames[RobotRun]):
    """The feet (``spikes``) and the rest of the robot (``hull``), as frames of platforms call them."""

    name = "robot"

    def body_meshes(self, run: RobotRun) -> dict[str, Mesh]:
        return {}

    def placed(self, run: RobotRun, origin: Array) -> Mapping[str, tuple[Array, Array]]:
        robot = run.robot
        pose = robot.pose
        turns, places = pose.turn.reshape(-1, 4), pose.position.reshape(-1, 3)
        feet = [
            Mesh(origin + places[k] + part.vertices @ to_matrix(turns[k]).T, part.faces)
            for k, foot in enumerate(robot.feet)
            for part in foot.parts
            if len(part.faces)
        ]
        data, others = robot.data, []
        for k in robot.other_geoms:
            vertices, faces = mesh_of(robot.model, k)
            if len(faces):
                matrix = data.geom_xmat[k].reshape(3, 3)
                others.append(Mesh(origin + data.geom_xpos[k] + vertices @ matrix.T, faces))
        found = {name: merge(meshes) for name, meshes in (("spikes", feet), ("hull", others or feet)) if meshes}
        return {name: (mesh.vertices, mesh.faces) for name, mesh in found.items()}

    def values(self, run: RobotRun) -> dict[str, float]:
        """The ground's force on the robot [N]."""
        force = run.feet_now[:, 7:10].sum(axis=0)
        return {f"force_{axis}": float(force[k]) for k, axis in enumerate("xyz")}

    def push(self, values: Mapping[str, float]) -> float:
        """The ground's force on the robot as frames keep it, in single precision: a resumed run reads it from them."""
        return float(np.linalg.norm([np.float32(values[f"force_{axis}"]) for axis in "xyz"]))

    def least_push(self, run: RobotRun) -> float:
        """Half of the robot's weight [N]: the forces of a first touch rise from 0 in many steps."""
        return 0.5 * float(run.robot.mass * run.robot.gravity)

    def row_forces(self, run: RobotRun, origin: Array) -> tuple[Array, dict[str, Array]]:
        """At the lowest point of every foot that is pushed."""
        feet = run.feet_now
        pushed = np.flatnonzero(np.abs(feet[:, 7:10]).max(axis=1) > 0)
        points = []
        for k in pushed:
            low = run.robot.feet[k].bottom(to_matrix(feet[k, 3:7]))
            points.append(origin + feet[k, :3] + np.array([0.0, 0.0, low]))
        fields = {"force": feet[pushed, 7:10], "row": pushed.astype(float)}
        return np.array(points).reshape(-1, 3), fields


def deepest_at_start(run: RobotRun) -> float:
    """Depth of the deepest foot when time begins [m]."""
    return float(run.columns["sinkage"][0])


def write_series_of(run: RobotRun, folder: Path) -> None:
    """trajectory.csv and the series of a run, as far as it has come."""
    rows = run.columns
    write_series(folder / "trajectory.csv", {UNITS[name]: rows[name] for name in ("time", "x", "y", "z", "touching")})
    stored = run.stored_by_row
    named: dict[str, Array] = {UNITS[name]: values for name, values in rows.items()}
    named |= {"stored_J": stored, "dissipated_J": run.dissipated_by_row}
    write_series(folder / "series" / "motion.csv", named)
    feet, heights = run.feet, heights_of(run)
    columns = {"t_s": rows["time"]}
    for k, foot in enumerate(run.robot.feet):
        columns |= {f"{foot.name}_{what}": feet[:, k, n] for n, what in enumerate(FOOT)}
        columns[f"{foot.name}_height_m"] = heights[:, k]
    write_series(folder / "series" / "feet.csv", columns)
    write_series(folder / "series" / "joints.csv", {"t_s": rows["time"]} | joint_columns(run))
    if isinstance(run.ground, BedFeet):
        grains.write_bed_series(folder, run)


def joint_columns(run: RobotRun) -> dict[str, Array]:
    """Position and velocity of every joint, control and force of every actuator."""
    robot, kept = run.robot, run.joints
    found: dict[str, Array] = {}
    for name, kind, at, speed in joints_of(robot.model):
        if kind in ("hinge", "slide"):
            unit = "rad" if kind == "hinge" else "m"
            found |= {f"{name}_{unit}": kept["qpos"][:, at], f"{name}_{unit}_s": kept["qvel"][:, speed]}
            continue
        place = ["x_m", "y_m", "z_m"] if kind == "free" else []
        found |= {f"{name}_{what}": kept["qpos"][:, at + k] for k, what in enumerate([*place, "q0", "q1", "q2", "q3"])}
        rates = [*(f"v{axis}_m_s" for axis in "xyz" if place), *(f"w{axis}_rad_s" for axis in "xyz")]
        found |= {f"{name}_{what}": kept["qvel"][:, speed + k] for k, what in enumerate(rates)}
    for k, name in enumerate(actuators_of(robot.model)):
        found |= {f"{name}_control": kept["ctrl"][:, k], f"{name}_force": kept["actuator_force"][:, k]}
    return found


def conclude(
    settings: RobotSettings,
    plan: RobotPlan,
    run: RobotRun,
    folder: Path,
    *,
    beside: RobotRun | None = None,
    softening: Softening | None = None,
    across: float = 0.0,
    sure: Json | None = None,
    sure_words: str = "",
    forms: Forms = NO_FORMS,
) -> Result:
    """The result, its series written. On grains `beside` is the robot on the default law of the surface.

    `sure`, `sure_words`: what a law leaves open, as `sure_of_law` has it. `forms`: the same robot on the other laws.
    """
    robot, heights = run.robot, heights_of(run)
    flights = find_flights(run, heights)
    write_series_of(run, folder)
    title = say("title", name=robot.name, what=_ground_named(plan), gravity=robot.gravity)
    told = [sure_words] if sure_words else []
    known = [*forms.words[:1], *(told if sure else []), *forms.words[1:]]
    sentences = [*known, *_sentences(run, heights, flights), *([] if sure or forms.words else told), *plan.notes]
    if run.energy_residual > MOST_RESIDUAL:
        title, sentences = say("title_invalid", title=title), [say("invalid"), *sentences]
    warnings = _warnings(settings, plan, run, heights, flights, forms)
    result: Json = {
        "title": title, "status": "done", "quantities": quantities_of(run, heights, flights),
        "departures": {"sentences": sentences},
        "trial": {name: vars(number) for name, number in plan.numbers.items()},
        "surface": plan.surface.name, "ground": "bed" if settings.on_grains else plan.law,
        "duration": settings.duration, "hop": not stays(run, flights), "rising": rising(run, flights),
        **({"sure": sure} if sure else {}), **({"forms": forms.numbers} if forms.numbers else {}),
        "feet": [foot.name for foot in robot.feet], "feet_reached": feet_reached(run, heights),
        "start_height": float(heights[0].min()),
        "warnings": warnings, "macro_step": run.macro_step, "robot_step": robot.step, "steps": run.master.count,
    }  # fmt: skip
    if softening is not None and beside is not None and isinstance(run.ground, BedFeet):
        rows, lifted = beside.columns, heights_of(beside)
        count = int(np.searchsorted(rows["time"], run.time + 0.5 * beside.macro_step))  # of the time on grains
        write_series(
            folder / "series" / f"{settings.default_law}.csv",
            {UNITS[name]: rows[name][:count] for name in ("time", "x", "y", "z", "touching", "fz", "sinkage")},
        )
        bed = run.ground.bed
        result["code"] = fingerprint()
        result["grains"] = grains.bed_numbers(settings, run, bed, softening, in_rig=False) | {
            "mode": say("one_gravity", gravity=plan.numbers["gravity"].value),
            "origin": [float(number) for number in run.ground.origin],
            "beside": quantities_of(beside, lifted, find_flights(beside, lifted)), "beside_law": settings.default_law,
            "beside_duration": beside.time,
        }  # fmt: skip
        sentences.append(say("modulus", young=1e-6 * softening.young, factor=softening.factor))
        sentences += grains.sleep_words(settings, run, bed)
        warnings += [
            grains.reversal_warning(run.dissipation_reversal),
            grains.sides_warning(bed),
            grains.overlap_warning(bed, softening, settings.max_overlap),
            *grains.bed_warnings(bed, plan.surface.name, across=across, foot="foot"),
            say("one_bed"),
        ]
    result["warnings"] = [warning for warning in warnings if warning]
    return Result.make("mujoco", **result)


def _warnings(
    settings: RobotSettings, plan: RobotPlan, run: RobotRun, heights: Array, flights: Flights, forms: Forms
) -> list[str | None]:
    """The warnings of a run on any ground; None for one that does not apply."""
    bounces = bounce_warning(run, crater_losses(run, heights, apart=APART), plan.law)
    warnings: list[str | None] = [
        say("idle", time=run.time) if idle(plan, run) else None,
        *plan.warnings_of_run, balance_warning(settings, run), grains.unsettled_warning(run.master),
        say("unstable", load=run.load, most=run.most_load) if run.load > run.most_load else None,
        *buried_words(run),
        say("went_below", name=run.lowest_other[1], depth=-1e3 * run.lowest_other[0])
        if run.lowest_other[0] < -BELOW and run.lowest_other[1] != run.buried.name else None,
        _cut_off(run, heights, flights) if flights.at_end else None, pushes_off(run, flights),
        *(bounces or swing_warning(run, heights, flights, plan)), *beyond_range(run),
        *(too_deep(run, plan.law) if plan.fitted is None else []),
        *([] if settings.on_grains else too_fast(plan, run, heights, forms.numbers.get("laws", ()))),
    ]  # fmt: skip
    if plan.fitted is not None:
        warnings += [say("beyond_range", sentence=said, file=plan.fitted) for said in _beyond(plan, run)]
    return warnings


def _ground_named(plan: RobotPlan) -> str:
    """The ground, in words; with the material only where the law is of it."""
    if plan.settings.on_grains:
        return f"a bed of {plan.surface.name}{' in LAMMPS' if plan.settings.ground == 'lammps' else ''}"
    if plan.fitted is not None:
        return f"{plan.fitted.material} ({plan.law})"
    if of_sand(plan.settings, plan.surface):
        return f"{plan.surface.name} ({', '.join((plan.law, *plan.settings.ground_parameters))})"
    return f"{plan.surface.name} ({plan.law})" if plan.law == "spring-damper" else say("other_law", law=plan.law)


def _beyond(plan: RobotPlan, run: RobotRun) -> list[str]:
    """A sentence for load and depth outside the range of the law of a file: those of a tip in a similar motion.

    There F / (rho g D^3) and z / D are the same, so that loads go with the cube of the diameter (`rigid.ground.soles`).
    """
    assert plan.fitted is not None
    feet, fitted = run.feet, plan.fitted
    sizes = np.sqrt([sum(plan.scales[part.name] for part in foot.parts) for foot in run.robot.feet])
    load = float((feet[:, :, 9].max(axis=0) / sizes**3).max())
    found = {"load": load, "depth": float((feet[:, :, -1].max(axis=0) / sizes).max())}
    return fitted.beyond(**{name: max(value, fitted.range[name][0]) for name, value in found.items()})


def quantities_of(run: RobotRun, heights: Array, flights: Flights) -> dict[str, Json]:
    """The numbers that every run of a robot has, as result.json holds them; a value is null where there is none.

    `heights`: as of `heights_of`. `flights`: as of `find_flights`.
    """
    rows, balance, touched = run.columns, run.balance_numbers, flights.touched
    found: dict[str, Number] = {
        "displacement_x": (float(rows["x"][-1] - rows["x"][0]), "m", say("displacement")),
        "displacement_y": (float(rows["y"][-1] - rows["y"][0]), "m", "likewise"),
        "displacement_z": (float(rows["z"][-1] - rows["z"][0]), "m", "the same, upwards"),
        "highest": (_highest(run, touched), "m", say("highest")),
        "rise_from_lowest": (_from_lowest(run, flights), "m", say("from_lowest")),
        "first_touch": (None if touched is None else float(rows["time"][touched]), "s", say("first_touch")),
        "flights": (float(len(flights.rows)), "1", say("flights", apart=1e3 * APART)),
        "longest_flight": (flights.longest, "s", say("longest_flight")),
        **({"hop_distance": (_hop_distance(run, flights), "m", say("hop_distance"))} if run.robot.travels else {}),
        "sinkage_largest": (float(rows["sinkage"].max()), "m", "of the lowest point of any foot"),
        "sinkage_end": (float(rows["sinkage"][-1]), "m", "the same, at the end"),
        **feet_quantities(feet_reached(run, heights)),
        "largest_force": (float(force_of(run).max()), "N", say("whole_force")),
        "actuator_work": (float(rows["actuator_work"][-1]), "J", say("actuator_work")),
        "ground_work": (float(rows["taken"][-1]), "J", say("ground_work")),
        "stability": (run.load, "1", say("stability")),
        "energy_residual": (run.energy_residual, "1", say("residual")),
    }
    found |= _ballistic(run, heights, flights, found) | push_numbers(run, flights)
    notes = {"coupling_residual": say("coupling"), "exchange_residual": say("exchange")}
    if isinstance(run.ground, BedFeet):
        notes |= {"dissipation_reversal": say("reversal")}
        if run.robot.floats:
            notes |= {"momentum_residual": say("momentum"), "angular_momentum_residual": say("angular_momentum")}
        notes |= {f"dissipated_{name}": say("by_grains") for name in run.losses}
    found |= {name: (*balance[name], note) for name, note in notes.items()}
    return as_quantities(found, std=None)


def _highest(run: RobotRun, touched: int | None) -> float:
    """Largest height of the centre of mass from row `touched` on, or of all where nothing touches, over its start [m].

    A robot that is dropped is highest at its start: that says nothing of how it moves on the ground.
    """
    z = run.columns["z"]
    return float(z[touched or 0 :].max() - z[0])


def _from_lowest(run: RobotRun, flights: Flights) -> float | None:
    """Largest rise of the centre of mass from any moment to a later one, after the first touch [m]: over a crouch.

    It includes the flight that the end of the run cuts off. None where nothing touches.
    """
    if flights.touched is None:
        return None
    z = run.columns["z"][flights.touched :]
    end = z[-1] + (flights.left.rise if flights.left is not None else 0.0)
    later = np.maximum(np.maximum.accumulate(z[::-1])[::-1], end)
    return float((later - z).max())


def _hop_distance(run: RobotRun, flights: Flights) -> float | None:
    """Way of the centre of mass along the ground in the longest flight [m], with what the end of the run cuts off.

    None where it does not fly.
    """
    place = np.column_stack([run.columns["x"], run.columns["y"]])
    found = []
    for begin, end in flights.rows:
        last = min(end, len(place) - 1)
        left = flights.left if end == len(place) else None
        way = place[last] - place[begin] + (0.0 if left is None else np.array(left.along))
        found.append((run.columns["time"][last] - run.columns["time"][begin] + (left.fall if left else 0.0), way))
    return float(np.hypot(*max(found, key=lambda one: one[0])[1])) if found else None


def _ballistic(run: RobotRun, heights: Array, flights: Flights, found: Mapping[str, Number]) -> dict[str, Number]:
    """The numbers of `BALLISTIC` of a run that ends in a flight; none of another.

    The lowest points of the feet are taken to rise as the centre of mass does.
    """
    if flights.left is None:
        return {}
    rise, fall = flights.left.rise, flights.left.fall
    rows, (begin, end) = run.columns, flights.rows[-1]
    reached = {
        "highest": float(rows["z"][-1] - rows["z"][0]) + rise,
        "longest_flight": (end - begin) * run.macro_step + fall,
        "clearance_largest": float(heights[-1].max()) + rise,
    }
    least = {name: found[name][0] for name in BALLISTIC if name in found}
    least["clearance_largest"] = max(foot["clearance_largest"] for foot in feet_reached(run, heights).values())
    return {
        BALLISTIC[name]: (max(value, least[name] or 0.0), "s" if name == "longest_flight" else "m", say("ballistic"))
        for name, value in reached.items()
    }


def _cut_off(run: RobotRun, heights: Array, flights: Flights) -> str:
    """The warning of a run that ends in a flight, in a sentence."""
    left, landing = flights.left, to_landing(run, heights, flights.left)
    if left is None:
        return say("airborne_for_ever", landing=landing)
    way = "upwards" if left.speed >= 0 else "downwards"
    return say(
        "airborne", speed=abs(left.speed), way=way, so_far=_quoted(_highest(run, flights.touched)), landing=landing
    )


def _quoted(value: float, unit: str = "m") -> str:
    """A number in words as the table of the answer has it."""
    return foldable(quote(value, None, unit, significant=2))


def _sentences(run: RobotRun, heights: Array, flights: Flights) -> list[str]:
    """What happened, in words."""
    rows, flown, touched = run.columns, flights.rows, flights.touched
    if touched is None:
        return [f"{say('touches_nothing')} {to_landing(run, heights, at_end(run, heights))}."]
    way = float(np.hypot(rows["x"][-1] - rows["x"][0], rows["y"][-1] - rows["y"][0]))
    rise = _highest(run, touched)
    lifted = float(heights[0].min())
    start = say("started_above", height=1e3 * lifted) if lifted > LIFTED else ""
    rose = say("rose" if rise >= 0 else "stayed_below", rise=_quoted(abs(rise)), start=start)
    told = launched(run, heights, flown[0][0]) if flown else []
    lowest = say("rose_from_lowest", rise=_quoted(_from_lowest(run, flights) or 0.0))
    told.append(say("went", way=1e3 * way, rose=f"{rose} {lowest}"))
    lost = bounce_words(crater_losses(run, heights, apart=APART))
    stayed = say("still_rises" if rising(run, flights) else "stayed_in_crater" if lost else "stayed")
    longest, cut = _quoted(flights.longest, "s"), say("flew_cut") if flights.at_end else ""
    hop = _hop_distance(run, flights) if run.robot.travels else None
    far = say("hopped", distance=_quoted(hop)) if hop is not None else ""
    flew = say("flew", count=len(flown), apart=1e3 * APART, longest=longest, cut=cut, far=far) if flown else stayed
    told.append(" ".join([flew, *lost]))
    sinkage, time = rows["sinkage"], rows["time"]
    deepest = int(sinkage.argmax())
    told.append(say("sank", depth=1e3 * sinkage[deepest], time=time[deepest], end=1e3 * sinkage[-1]))
    return [*told, *push_words(run, flights)]
