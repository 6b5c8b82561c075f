"""The numbers of one made-up tumble, in the order of the integrator's table."""

__all__ = ["COLUMNS"]

COLUMNS = (
    "mass", "inertia", "length", "counterweight", "gravity_sim", "gravity_at_mass", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d", "stiffness", "damping",
    # what the base model leaves out; all zero: nothing
    "vibration_share", "vibration_speed", "vibration_power",
    "wire_curvature", "offset_x", "offset_y", "slope", "slope_bend", "ball", "pulley_mass",
    "rig_dry", "rig_viscous", "bearing_dry", "bearing_stribeck",
    "fade_speed", "fade_speed_square", "fade_time",
    "drag_normal", "drag_side", "drag_power", "harden_bend", "harden_power",
    "plastic", "adhesion", "adhesion_reach", "rate_change", "rate_speed", "cable_spring", "cable_cubic", "cable_drag",
    # outside the library
    "floor_x", "floor_y", "floor_rate", "magnet", "magnet_x", "loose_mass", "loose_rate", "shock_x", "shock_y",
    "shock_turn", "shock_time", "unbalance", "wind", "wind_from", "wind_to",
)  # fmt: skip
"""Numbers of one trial, SI units, in the order of the kernel's table."""
