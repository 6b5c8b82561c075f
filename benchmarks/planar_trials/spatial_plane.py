"""Figure of docs/platform.md: `python -m benchmarks.planar_trials.spatial_plane docs`.

One trial by the planar and by the spatial model, through what `rigid` offers, and how far they are apart.
"""

import sys
from pathlib import Path

import numpy as np

import rigid
from vis.page.plots import BED, DOTTED, GREY, INK, MODEL, handle, legend_above, sheet, styled, title_above

DURATION, TOLERANCE = 2.5, 1e-9
_PLANAR = {"color": MODEL, "lw": 4.0, "alpha": 0.45}
_SPATIAL = {"color": BED, "lw": 1.2}
_APART = ({"color": BED}, {"color": "#009E73", "ls": (0, (4, 1.6))}, {"color": INK, "ls": (0, (6, 1.5, 1, 1.5))},
          {"color": GREY, "ls": DOTTED})  # fmt: skip
_LEAST = 1e-18
"""A smaller difference is drawn here."""


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
        "θ [rad]": np.abs(space.turn - flat.theta),
        "out of the plane [m] (0)": np.abs(space.position[:, 1]),
    }
    with styled():
        drawing, axes = sheet(3, 2, 4.8, sharex=True)
        left, right = axes[:, 0], axes[:, 1]
        for axis, label, one, other in (
            (left[0], "x [mm]", 1e3 * flat.x, 1e3 * space.position[:, 0]),
            (left[1], "y [mm]", 1e3 * flat.y, 1e3 * space.position[:, 2]),
            (left[2], "θ [degrees]", np.degrees(flat.theta), np.degrees(space.turn)),
        ):
            axis.plot(flat.time, one, **_PLANAR)
            axis.plot(flat.time, other, **_SPATIAL)
            axis.set(ylabel=label)
        for spare in right[1:]:
            spare.remove()
        whole = drawing.add_subplot(axes[0, 1].get_gridspec()[:, 1])
        right[0].remove()
        for (name, values), style in zip(apart.items(), _APART, strict=True):
            whole.semilogy(flat.time, np.maximum(values, _LEAST), label=name, lw=1.3, **style)
        whole.set(xlabel="time [s]", ylabel="difference [m] or [rad]", ylim=(0.3 * _LEAST, 1e-7))
        whole.legend(loc="center right", bbox_to_anchor=(1.0, 0.3), ncols=2)
        left[2].set_xlabel("time [s]")
        legend_above(drawing, [handle("planar", **_PLANAR), handle("spatial", **_SPATIAL)], 2)
        words = "One trial in the plane and in space, on the spring-damper of brick: 0.0085 g, 0.22 N m for 0.5 s"
        title_above(drawing, words)
        drawing.savefig(path, dpi=126)
    return ", ".join(f"{name} {values.max():.1e}" for name, values in apart.items())


if __name__ == "__main__":
    print(draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs") / "images" / "spatial-plane.png"))
