"""Follows the Hedgehog of this folder's run with hedgebed's own body in space, on the same bed from the same place.

`python docs/results/mujoco-hedgehog/against_spatial.py` reads run.toml and result.json here and writes spatial.json.
The bed is made again, or read from the cache.
"""

import json
import tomllib
from pathlib import Path

import numpy as np

from coupling import BedGround, SpatialRun, spatial_members
from experiments.grains.softening import run_limit
from experiments.robot.on_grains import RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings
from experiments.runs.progress import make_progress
from rigid import find_platform
from rigid.series import read_series
from rigid.spatial.spatial import SpatialTrial

HERE = Path(__file__).parent


def main() -> None:
    """Compute, compare, write."""
    settings = RobotSettings(**tomllib.loads((HERE / "run.toml").read_text(encoding="utf-8"))["settings"])
    theirs = read_series(HERE / "trajectory.csv")
    plan = plan_robot(settings)
    on_bed, robot = RobotOnBed(settings, plan), plan.robot()
    with make_progress(quiet=True) as progress:
        bed = on_bed.bed(on_bed.softening(), progress)
    bed.max_overlap, bed.overlap_limit = 0.0, run_limit(settings.max_overlap)  # as in the run
    platform = find_platform("hedgehog")
    ground = BedGround(
        bed, spatial_members(platform), friction=settings.spike_friction, restitution=settings.spike_restitution,
        bounded_across=True, touch=1e-3 * on_bed.weight, **on_bed.layout(bed),
    )  # fmt: skip
    place, rates = robot.data.qpos, robot.data.qvel
    run = SpatialRun(
        SpatialTrial(platform=platform, gravity=settings.gravity), ground, duration=settings.duration,
        position=place[:3].tolist(), velocity=rates[:3].tolist(), angular_velocity=rates[3:6].tolist(),
        substeps=settings.substeps,
    )  # fmt: skip
    ours = run.run()
    apart = {
        axis: float(np.abs(ours[axis] - np.interp(ours["time"], theirs["t_s"], theirs[f"{axis}_m"])).max())
        for axis in "xyz"
    }
    found = {
        "largest_difference_m": apart,
        "end_mujoco_m": [float(theirs[f"{axis}_m"][-1]) for axis in "xyz"],
        "end_spatial_m": [float(ours[axis][-1]) for axis in "xyz"],
        "largest_force_spatial_N": float(np.linalg.norm([ours["fx"], ours["fy"], ours["fz"]], axis=0).max()),
        "energy_residual_spatial": run.energy_residual,
        "sinkage_largest_spatial_m": float(ours["sinkage"].max()),
        "grains": len(bed.grains(contacts=False).radius),
    }
    (HERE / "spatial.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
