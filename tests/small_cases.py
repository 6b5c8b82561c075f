"""Cases on beds so small that a test can afford them, as the text of a case file."""

__all__ = ["CALIBRATE", "GRAINS", "TUMBLE_ON_GRAINS"]

GRAINS = """
bed_size = [0.03, 0.03, 0.0254]
tip_diameter = 0.0075
shaft_length = 0.03
allow_coarse = true
depth = 0.006
load = 0.1
rest_time = 0.01
checkpoint_interval = 0.5
frame_count = 0
threads = 1
"""
CALIBRATE = (
    GRAINS
    + """
budget = 3600.0
grain = 0.004
seeds = [1, 2]
most_beds = 2
speeds = [0.2, 0.4]
hold = 0.0
drop_speeds = []
young = 2e7
laws = ["spring-damper"]
workers = 1
"""
)
TUMBLE_ON_GRAINS = """
surface = "sand-weak"
ground = "bed"
mass = 0.3
inertia = 2e-4
spike_length = 0.04
spike_diameter = 0.008
spike_clear = 0.015
wheel_inertia = 1e-5
rig = 0.03
torque = 0.01
lowering_speed = 0.04
stiffness = 500.0
damping = 2.0
bed_size = [0.2, 0.036, 0.03]
grain = 0.006
young = 1e7
max_overlap = 0.1
substeps = 8
threads = 1
"""
