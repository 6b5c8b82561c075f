"""Where a surface law has the signs of the paper's Figure 8 on granular ground: motors upwards, brakes downwards.

`python docs/results/paper-region/search.py` from the root, with the repository on PYTHONPATH: 15 s of one core. It
writes motors.csv and brakes.csv beside itself, one line for each ground with its launch angles, and prints what holds
where. `... search.py counts` only prints. `... search.py step` prints what half the time step changes.
"""

import csv
import itertools
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from rigid import Effect, Trial, simulate_batch
from rigid.model.trial import Ground

HERE = Path(__file__).parent
EARTH = 9.80665  # Of the grains, also in the rig [m/s2]
MASS = 5.3  # Of the platform [kg]
GRAIN_DENSITY = 2650.0  # Quartz sand [kg/m3]
SPIKES = 2  # Of a row
RIGS = (0.0085, 0.015)
TURNS = {"0.125": 0.125, "0.22": 0.22, "brake": 6.0}  # [N m]
OVER: dict[str, tuple[float, ...]] = {
    "friction_angle": (25.0, 29.0, 33.0, 37.0, 41.0),  # Of the grains; 41 is near the law's bound [degrees]
    "tip": (12.0, 16.0, 20.0, 24.0, 30.0),  # Diameter [mm]
    "packing": (0.53, 0.63),  # Packing fraction
    "rebound": (0.02, 0.05, 0.2),  # Share of the deepest depth that springs back
    "slip_sinkage": (0.0, 0.25, 0.5, 0.75, 0.9),  # Share of a tip's depth that gives way under a long slide
    "rise": (0.0, 0.1, 0.25, 0.5),  # Time constant of a motor's torque [s]
    "start": (0.25, 0.5, 1.0, 1.5),  # Depth of the tips as a brake begins, over that at rest
}
STEP = 5e-4  # [s]
ALONG = 0.5  # As `hedgebed paper`: so far below 0 an angle counts as downwards [degrees]
NEAR = (17.5, 27.5)  # What the paper states of most low torques, 22.5 degrees, and its measure of agreement

Row = dict[str, float]


def trial(turn: str, rig: float, ground: Row) -> Trial:
    """One trial on `rft` with slip-sinkage and the ploughing of Broms' short pile, both rows of two tips.

    Ploughing: k = 1.5 K_p rho g d of a tip (rigid/terms/contact/ploughing.py), so it follows the grains and the tip.
    """
    phi, tip = math.radians(ground["friction_angle"]), 1e-3 * ground["tip"]
    density, gravity = ground["packing"] * GRAIN_DENSITY, rig * EARTH
    passive = (1 + math.sin(phi)) / (1 - math.sin(phi))
    law = {"bulk_density": density, "friction": math.tan(phi), "radius": tip / 2, "rebound": ground["rebound"]}
    effects = (
        Effect(id="slip-sinkage", parameters={"share": ground["slip_sinkage"]}),
        Effect(id="ploughing", parameters={"strength": SPIKES * 1.5 * passive * density * EARTH * tip}),
        Effect(id="torque-rise", parameters={"rise": ground.get("rise", 0.0)}),
    )
    brake: dict[str, Any] = {"actuator": "brake", "wheel_speed_0": 300.0} if turn == "brake" else {}
    return Trial(
        mass=MASS, gravity_sim=gravity, counterweight=MASS * (EARTH - gravity) / (EARTH + gravity),
        torque=TURNS[turn], mu_s=math.tan(phi), effects=effects, **brake,
        ground=Ground(name="rft", parameters=law, spikes_per_row=SPIKES),
    )  # fmt: skip


def combined(*names: str) -> list[Row]:
    """All combinations of these keys of `OVER`."""
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*(OVER[name] for name in names))]


GROUND = ("friction_angle", "tip", "packing", "rebound", "slip_sinkage")
MOTORS = ("0.125", "0.22")


def launch(turn: str, rig: float, grounds: list[Row], *, start: float = 1.0, step: float = STEP) -> list[float]:
    """Launch angles [degrees]; nan where the centre does not get 10 mm away. `step`: of time [s]."""
    batch = simulate_batch(
        [trial(turn, rig, ground) for ground in grounds], duration=1.0 if turn == "brake" else 3.0, time_step=step,
        threads=1, start_depth=start,
    )  # fmt: skip
    return [round(math.degrees(angle), 1) for angle in batch.trajectory_angle]


def search() -> None:
    """Write motors.csv, by the rise of the torque, and brakes.csv, by the depth at the start."""
    motors = combined(*GROUND, "rise")
    for turn, rig in itertools.product(MOTORS, RIGS):
        for ground, angle in zip(motors, launch(turn, rig, motors.copy()), strict=True):
            ground[f"{turn}@{rig}"] = angle
    brakes = combined(*GROUND, "start")
    for rig, start in itertools.product(RIGS, OVER["start"]):
        chosen = [ground for ground in brakes if ground["start"] == start]
        for ground, angle in zip(chosen, launch("brake", rig, chosen, start=start), strict=True):
            ground[f"brake@{rig}"] = angle
    for name, rows in (("motors", motors), ("brakes", brakes)):
        with (HERE / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows({key: f"{value:g}" for key, value in row.items()} for row in rows)


def kept(name: str) -> list[Row]:
    """The lines of motors.csv or brakes.csv."""
    with (HERE / f"{name}.csv").open(encoding="utf-8") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def joined() -> list[Row]:
    """Each line of motors.csv with each start of the brake on the same ground."""
    brakes: dict[tuple[float, ...], list[Row]] = {}
    for row in kept("brakes"):
        brakes.setdefault(tuple(row[name] for name in GROUND), []).append(row)
    return [motor | brake for motor in kept("motors") for brake in brakes[tuple(motor[name] for name in GROUND)]]


def met(row: Row, rigs: Iterable[float] = RIGS) -> bool:
    """Whether all motors leave upwards and all brakes downwards; a motor that does not leave counts as not met."""
    return all(row[f"brake@{rig}"] < -ALONG and all(row[f"{m}@{rig}"] > ALONG for m in MOTORS) for rig in rigs)


def counts() -> None:
    """Print how many grounds have the signs, by each number, and those nearest to the paper's 22.5 degrees."""
    rows = joined()
    found = [row for row in rows if met(row)]
    print(f"{len(rows)} grounds; signs at 0.0085 g: {sum(met(row, RIGS[:1]) for row in rows)}; at both: {len(found)}")
    for name, values in OVER.items():
        by = {value: [met(row) for row in rows if row[name] == value] for value in values}
        print(f"| {name} | {', '.join(f'{value:g}: {sum(of) / len(of):.1%}' for value, of in by.items())} |")
    plain = [row for row in found if row["rise"] == 0 and row["start"] == 1]
    print(f"with a step of the torque and from rest: {len(plain)}")
    for name in GROUND:
        print(f"| {name} | {', '.join(f'{v:g}: {sum(row[name] == v for row in plain)}' for v in OVER[name])} |")
    near = [sum(NEAR[0] <= row[f"{m}@{rig}"] <= NEAR[1] for m in MOTORS for rig in RIGS) for row in found]
    print("motors near 22.5 degrees, of 4:", {count: near.count(count) for count in sorted(set(near))})


def halved() -> None:
    """Print what half the time step changes, on every 29th ground."""
    for turn, rig in itertools.product(TURNS, RIGS):
        some = combined(*GROUND)[::29]
        angles = (launch(turn, rig, some, step=step) for step in (STEP, STEP / 2))
        apart = [abs(one - other) for one, other in zip(*angles, strict=True)]
        print(turn, rig, f"median {np.nanmedian(apart):.2f}, largest {np.nanmax(apart):.1f} degrees of {len(some)}")


def main() -> None:
    """What the command line asks for."""
    if sys.argv[1:] == ["step"]:
        halved()
        return
    if sys.argv[1:] != ["counts"]:
        search()
    counts()


if __name__ == "__main__":
    main()
