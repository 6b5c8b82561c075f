"""Figure of docs/platform.md: `python -m benchmarks.planar_trials.spatial_plane docs`.

One trial by the planar and by the spatial model, through what `rigid` offers, and how far they are apart.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

import rigid

matplotlib.use("Agg")
from matplotlib import pyplot as plt

DURATION, TOLERANCE = 2.5, 1e-9


def both(duration: float = DURATION) -> tuple[rigid.Trajectory, rigid.SpatialTrajectory]:
    """0.22 N m for 0.5 s on brick at 0.0085 g in the rig: once with rows of spikes, once with 24 tips in space."""
    hedgehog = rigid.find_platform("hedgehog")
    trial = rigid.Trial(
        spike_length=hedgehog.stance().spike_length, gravity_sim=0.08336, counterweight=5.21, mu_s=0.5, torque=0.22,
        torque_until=0.5,
    )  # fmt: skip
    motor = rigid.TorqueHistory.constant(hedgehog.wheel(), 0.22, until=0.5)
    space = rigid.SpatialTrial(
        platform=hedgehog, gravity=0.08336, counterweight=5.21, mu_s=0.5, torques=(motor,),
        ground_parameters={"stiffness": trial.stiffness / 2, "damping": trial.damping / 2},  # of one tip of a row's two
    )  # fmt: skip
    return (
        rigid.simulate(trial, duration=duration, sample_interval=0.01, tolerance=TOLERANCE),
        rigid.simulate_spatial(space, duration=duration, sample_interval=0.01, tolerance=TOLERANCE),
    )


def draw(path: Path) -> str:
    """Both motions, and their difference; returns a sentence with the largest."""
    flat, space = both()
    apart = {
        "x [m]": np.abs(space.position[:, 0] - flat.x),
        "y [m]": np.abs(space.position[:, 2] - flat.y),
        "theta [rad]": np.abs(space.turn - flat.theta),
        "out of the plane [m]": np.abs(space.position[:, 1]),
    }
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4))
    left.plot(flat.time, 1e3 * flat.x, color="#0072B2", lw=4, alpha=0.4, label="x, planar")
    left.plot(flat.time, 1e3 * space.position[:, 0], color="#0072B2", lw=1, label="x, spatial")
    left.plot(flat.time, np.degrees(flat.theta), color="#D55E00", lw=4, alpha=0.4, label="theta, planar")
    left.plot(flat.time, np.degrees(space.turn), color="#D55E00", lw=1, label="theta, spatial")
    left.set(xlabel="time [s]", ylabel="x [mm], theta [degrees]")
    left.legend(fontsize=8)
    for (name, values), style in zip(apart.items(), ("-", "--", "-.", ":"), strict=True):
        right.semilogy(flat.time, np.maximum(values, 1e-18), style, lw=1.2, label=name)
    right.set(xlabel="time [s]", ylabel="difference")
    right.legend(fontsize=8)
    for axis in (left, right):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return ", ".join(f"{name} {values.max():.1e}" for name, values in apart.items())


if __name__ == "__main__":
    print(draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs") / "images" / "spatial-plane.png"))
