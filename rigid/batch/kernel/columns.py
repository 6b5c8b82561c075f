"""What the numbers, the summary and the series of the batched integrator hold, column by column."""

__all__ = ["CHANNELS", "FIXED_NUMBERS", "SUMMARY"]

FIXED_NUMBERS = (
    "mass", "inertia", "length", "stance", "counterweight", "gravity", "weight", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d",
)  # fmt: skip
"""The first columns of the trials' numbers; those of the ground's law and of the effects follow."""
SUMMARY = (
    "trajectory_angle", "max_speed", "max_angular_velocity", "stand", "pivot", "slip", "hop", "status",
    "x", "y", "theta", "vx", "vy", "omega", "wheel_speed", "splits", "longest_step",
)  # fmt: skip
"""Columns of the summary: launch, largest speeds, theta on entering each state first (NaN: never), status, end, and the
longest step [s] for the coordinate that a term has of its own (NaN: there is none).

Status: 0 done, 1 too deep, 2 no longer finite, 3 cannot stand, 4 the step is too long for a term's own coordinate."""
CHANNELS = ("x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "wheel_speed", "state")  # Channels of the series
