"""``hedgebed bench feet``: how many feet a second a surface law is computed for in MuJoCo's own loop.

`coupling.robot.FootForces` is called as MuJoCo calls it, with every foot in contact: robots of one foot and of six. A
foot has one point in contact (ball, ellipsoid, capsule on its end) or two (capsule and cylinder that lie). A box has 4
of 8, a cylinder on its end and a mesh have 8. The points of the irregular mesh have no symmetry. It goes in and slides.
Besides every law with its defaults: the law of sand of each foot (`law_of_run`), and the same with loss as the foot
retreats in its crater. A kept ground.toml of `hedgebed calibrate` is timed too. Several rounds by processor time; the
median counts. For quick trials, in the environment: HEDGEBED_BENCH_CALLS, HEDGEBED_BENCH_ROUNDS.
"""

import statistics
import time
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from benchmarks.race.machine import begin_timing, column_table, environment_numbers, wide_console
from coupling.robot import FootForces, find_feet
from experiments.robot.own_loop import law_of_run
from experiments.runs.types import Json
from rigid.ground.laws import GROUNDS

__all__ = ["run"]

SOLE, LOSS = "sole on sand", "sole on sand, loss = 1, retreats"
FILE = "ground.toml of sand"
KEPT = Path(__file__).resolve().parents[1] / "docs/results/tumble-laws/power-irreversible-1mm.toml"
LAWS = (*GROUNDS, SOLE, LOSS, FILE)
COUNTS = (1, 6)  # Feet of the robots
WANTED = 100_000  # Evaluations of one foot a second that control asks for
SHAPES = {
    "ball": 'type="sphere" size="0.01"',
    "box": 'type="box" size="0.01 0.01 0.01"',
    "cylinder on its end": 'type="cylinder" size="0.01 0.01"',
    "cylinder that lies": 'type="cylinder" size="0.01 0.01" euler="90 0 0"',
    "capsule on its end": 'type="capsule" size="0.005 0.005"',
    "capsule that lies": 'type="capsule" size="0.01 0.01" euler="90 0 0"',
    "ellipsoid": 'type="ellipsoid" size="0.02 0.015 0.01"',
    "mesh with a round sole": 'type="mesh" mesh="sole"',
    "mesh with an irregular sole": 'type="mesh" mesh="irregular"',
}
_ANGLES = {
    "sole": tuple(2 * np.pi / 32 * np.arange(32)),
    "irregular": (0.0, 0.7, 1.3, 2.5, 3.4, 4.0, 4.8, 5.9),
}  # Of the corners of soles
_BODY = '<body pos="{x} 0 0.0099"><freejoint/><geom name="foot_{k}" {shape} mass="0.1"/></body>'


def _robot(shape: str, count: int) -> tuple[Any, Any]:
    """Model and data of `count` feet of a shape, 0.1 mm deep, that go in and slide: all terms are computed."""
    bodies = "".join(_BODY.format(x=0.1 * k, k=k, shape=SHAPES[shape]) for k in range(count))
    meshes = ""
    for name, angles in _ANGLES.items():
        ring = 0.01 * np.column_stack([np.cos(angles), np.sin(angles), np.ones(len(angles))])
        corners = " ".join(f"{x:.9g}" for x in np.concatenate([ring, ring * (1, 1, -1)]).ravel())
        meshes += f'<mesh name="{name}" vertex="{corners}"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{meshes}</asset><worldbody>{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    data.qvel[:] = np.tile([0.1, 0.02, -0.1, 0.0, 0.0, 0.0], count)
    mujoco.mj_forward(model, data)
    return model, data


def _forces(model: Any, data: Any, law: str) -> FootForces:
    """The callback of a law, or of the law of sand of each foot, at the depth and time of `data`."""
    feet, names = find_feet(model, data, ["foot_*"]), ["foot_*"]
    if law in GROUNDS:
        return FootForces(model, data, feet, law=law, parameters=GROUNDS[law].values({}))
    if law == FILE:
        return FootForces(model, data, feet, **law_of_run(model, names, surface="sand", ground=str(KEPT)).law)
    if law == SOLE:
        return FootForces(model, data, feet, **law_of_run(model, names, surface="sand").law)
    forces = FootForces(
        model, data, feet, **law_of_run(model, names, surface="sand", ground_parameters=("loss=1",)).law
    )
    forces(model, data)
    data.qpos[2::7] += 1e-6  # 1 % of its depth: its springback is not at its end
    data.qvel[2::6] *= -1.0
    data.time += model.opt.timestep
    mujoco.mj_forward(model, data)
    return forces


def run(out: Path, *, progress: Any) -> Json:
    """Time the callback; show the table; return what goes into bench.json. Nothing is written to `out`."""
    (calls,), (rounds,) = environment_numbers("CALLS", (20_000,)), environment_numbers("ROUNDS", (5,))
    bench, remarks = begin_timing("feet")
    for remark in remarks:
        progress.message(remark)
    bench |= {
        "unit": "feet a second of processor time",
        "calls": calls,
        "wanted": WANTED,
        "cases": [],
    }
    progress.plan({"feet": 1.0})
    progress.stage("feet", total=float(len(SHAPES) * len(LAWS) * len(COUNTS)))
    for shape, law, count in product(SHAPES, LAWS, COUNTS):
        model, data = _robot(shape, count)
        forces = _forces(model, data, law)
        made, speeds = max(1, calls // count), []
        for _ in range(rounds):
            begin = time.process_time()
            for _ in range(made):
                forces(model, data)
            speeds.append(made * count / (time.process_time() - begin))
        case = {"shape": shape, "law": law, "feet": count, "per_s": statistics.median(speeds), "rounds": speeds}
        bench["cases"].append(case)
        progress.update(float(len(bench["cases"])))
    progress.close()
    table = column_table(
        ("shape", "law", "feet", "feet/s", "slowest - fastest"), title="feet: a surface law in MuJoCo's loop"
    )
    for case in bench["cases"]:
        spread = f"{min(case['rounds']):,.0f} - {max(case['rounds']):,.0f}"
        table.add_row(case["shape"], case["law"], str(case["feet"]), f"{case['per_s']:,.0f}", spread)
    wide_console().print(table)
    return bench
