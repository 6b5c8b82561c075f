"""Dosta et al. 2024's penetration: a steel ball of 20 mm at 5 m/s into 25,000 grains of 2 mm, here and in LIGGGHTS.

Both begin when the ball, thrown down at 5 m/s from 60 mm, touches the first grain. They last 3 ms, in which it goes
into the grains by more than its radius. The 100 ms of the paper take an hour on one core. The grains start where the
data have them, without history. The walls are of what the grains are of.
"""

import gzip
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dem import Ball, Bed, Facing, Material
from experiments.validate.base.case import Comparison, Curve, Outcome, Plot, Tell, near_zero, tracked, within
from experiments.validate.base.drops import first_touch
from experiments.validate.base.peers import PEERS, data_file, deck_of, digits, run_peer
from experiments.validate.base.spheres import mass_of, upright_walls

from . import say

__all__ = ["CASES", "Setup", "grains"]

DATA = Path(__file__).parents[1] / "dosta_data" / "25KParticles.txt.gz"
STUFF = Material("dosta", 2500.0, 1e9, 0.2, 0.3, 0.5, tangential="displacement")  # as the codes of the paper
BALL_DENSITY, BALL_YOUNG, BALL_POISSON, BALL_FRICTION, BALL_RESTITUTION = 7200.0, 210e9, 0.2, 0.2, 0.4
BALL_RADIUS, GRAVITY = 0.01, 9.8
SPEED, THROWN_FROM = 5.0, 0.06
WALLS = (-0.049, 0.049, -0.03, 0.03)
FLOOR = -0.0902431
STEP, TIME, EVERY = 1e-6, 0.003, 100  # [s], [s], steps between two looks
TOGETHER = 5  # steps of the grains for one of the ball, which is 3000 times heavier than one of them
LIMIT = 3000.0  # for the other code [s]
MARGIN = 0.004


@dataclass(frozen=True)
class Setup:
    """Grains at rest and the ball that touches the first of them; lengths in metres, in the data's frame."""

    positions: np.ndarray
    radii: np.ndarray
    ball: np.ndarray
    speed: float


def grains() -> tuple[np.ndarray, np.ndarray]:
    """Centres, shape [25000, 3], and radii [m] of the data."""
    with gzip.open(DATA, "rt", encoding="ascii") as file:
        rows = [line.split() for line in file.readlines()[1:]]
    found = np.array([row for row in rows if len(row) == 4], dtype=float)
    return found[:, 1:], found[:, 0]


def ours(case: Setup, tell: Tell) -> np.ndarray:
    """Height [m] and velocity [m/s] of the ball at each look, shape [looks, 2]."""
    shift = np.array([MARGIN - WALLS[0], MARGIN - WALLS[2], -FLOOR])
    width, depth = WALLS[1] - WALLS[0], WALLS[3] - WALLS[2]
    size = (width + 2 * MARGIN, depth + 2 * MARGIN, 0.04)
    like = {"young": STUFF.young, "poisson": STUFF.poisson}
    bed = Bed.from_grains(
        STUFF, positions=case.positions + shift, radii=case.radii, size=size, height=0.4, gravity=GRAVITY,
        time_step=STEP, max_overlap=0.1, floor=Facing(**like), tensile=True,
    )  # fmt: skip
    for _, _, wall, at in upright_walls(width, depth, MARGIN):
        bed.add_body([wall], position=at, **like)
    ball = bed.add_body(
        [Ball(radius=BALL_RADIUS)], position=case.ball + shift, friction=BALL_FRICTION, restitution=BALL_RESTITUTION,
        young=BALL_YOUNG, poisson=BALL_POISSON,
    )  # fmt: skip
    mass = mass_of(BALL_DENSITY, BALL_RADIUS)
    inertia = 0.4 * mass * BALL_RADIUS**2
    velocity, spin = np.array([0.0, 0.0, -case.speed]), np.zeros(3)
    dt = TOGETHER * STEP
    found = [[case.ball[2], velocity[2]]]
    for _ in tracked(range(round(TIME / STEP) // EVERY), tell):
        for _ in range(EVERY // TOGETHER):
            bed.move_body(ball, velocity=velocity.tolist(), spin=spin.tolist())
            bed.advance(TOGETHER)
            force, torque = bed.reaction(ball)
            velocity = velocity + dt * (force / mass + [0.0, 0.0, -GRAVITY])
            spin = spin + dt * torque / inertia
        found.append([bed.body_position(ball)[2] + FLOOR, velocity[2]])
    return np.array(found)


def theirs(case: Setup) -> np.ndarray:
    """The same by LIGGGHTS, in one process. Raises RuntimeError with its last lines where it fails."""
    box = [f"{WALLS[0]:g} {WALLS[1]:g} xlo xhi", f"{WALLS[2]:g} {WALLS[3]:g} ylo yhi", f"{FLOOR:.7f} 0.3 zlo zhi"]
    beads = zip(case.radii, case.positions, strict=True)
    atoms = [f"1 {2 * radius:.10g} {STUFF.density:g} {digits(place)}" for radius, place in beads]
    atoms.append(f"2 {2 * BALL_RADIUS:g} {BALL_DENSITY:g} {digits(case.ball)}")
    speeds = len(case.radii) * ["0 0 0 0 0 0"] + [f"0 0 {-case.speed:.17g} 0 0 0"]
    data = data_file(box, atoms, speeds, types=2)
    blocks = run_peer("liggghts", data, _deck(), "ball.txt", limit=LIMIT).split("ITEM: ATOMS z vz")[1:]
    return np.array([block.splitlines()[1].split() for block in blocks], dtype=float)


def _deck() -> str:
    law = "hertz tangential history"
    planes = zip(("xplane",) * 2 + ("yplane",) * 2 + ("zplane",), (*WALLS, FLOOR), strict=True)

    def pairs(of_grains: float, of_ball: float) -> str:
        return f"peratomtypepair 2 {of_grains:g} {of_ball:g} {of_ball:g} {of_ball:g}"

    lines = [
        f"fix young all property/global youngsModulus peratomtype {STUFF.young:g} {BALL_YOUNG:g}",
        f"fix poisson all property/global poissonsRatio peratomtype {STUFF.poisson:g} {BALL_POISSON:g}",
        f"fix rebound all property/global coefficientRestitution {pairs(STUFF.restitution, BALL_RESTITUTION)}",
        f"fix friction all property/global coefficientFriction {pairs(STUFF.friction, BALL_FRICTION)}",
        f"pair_style gran model {law}",
        "pair_coeff * *",
        *(
            f"fix wall{k} all wall/gran model {law} primitive type 1 {kind} {where:.7f}"
            for k, (kind, where) in enumerate(planes)
        ),
        f"fix weight all gravity {GRAVITY:g} vector 0.0 0.0 -1.0",
        "fix motion all nve/sphere",
        "group ball type 2",
        f"timestep {STEP:g}",
        f"dump now ball custom {EVERY} ball.txt z vz",
        'dump_modify now format "%.17g %.17g"',
        "thermo 1000",
        f"run {round(TIME / STEP)}",
    ]
    return "hard_particles yes\n" + deck_of("liggghts", lines, boundary="f f f", skin="8e-4")


def _compute(tell: Tell) -> Outcome:
    if PEERS["liggghts"].find() is None:
        return PEERS["liggghts"].skipped()
    positions, radii = grains()
    height = first_touch(positions, radii, BALL_RADIUS) + 1e-6
    speed = math.sqrt(SPEED**2 + 2 * GRAVITY * (THROWN_FROM - height))
    case = Setup(positions, radii, np.array([0.0, 0.0, height]), speed)
    there = theirs(case)
    tell(0.5)
    here = ours(case, within(tell, 0.5, 1.0))
    depth, found = case.ball[2] - there[:, 0], case.ball[2] - here[:, 0]
    time, half = 1e3 * STEP * EVERY * np.arange(len(there)), len(there) // 2
    slowed, found_slowed = (_time_to(time, one[:, 1], -0.8 * case.speed) for one in (there, here))
    rows = [
        Comparison(f"depth {time[-1]:g} ms after the first touch", "mm", 1e3 * depth[-1], 1e3 * found[-1], 0.05),
        near_zero("height, largest difference over that depth", np.abs(found - depth).max() / depth[-1], 0.05),
        Comparison("time to 0.8 of the speed", "ms", slowed, found_slowed, 0.05),
        Comparison(f"speed after {time[half]:g} ms", "m/s", -there[half, 1], -here[half, 1], 0.05),
    ]
    curves = [
        Curve("LIGGGHTS", time, 1e3 * (there[:, 0] - case.ball[2]), False),
        Curve("bed", time, 1e3 * (here[:, 0] - case.ball[2])),
    ]
    remark = say("dosta", case=case, ms=1e3 * TIME, us=1e6 * STEP)
    return Outcome(rows, [Plot("Height of the ball", "time since the touch [ms]", "height [mm]", curves)], [remark])


def _time_to(time: np.ndarray, velocity: np.ndarray, wanted: float) -> float:
    """When a velocity that rises reaches a value [ms]; NaN where it does not."""
    if not (velocity > wanted).any():
        return math.nan
    k = int(np.argmax(velocity > wanted))
    share = (wanted - velocity[k - 1]) / (velocity[k] - velocity[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))


CASES = {"dosta": _compute}
