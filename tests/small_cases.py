"""Cases on beds so small that a test can afford them, as the text of a case file."""

__all__ = ["CALIBRATE", "GRAINS"]

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
