"""Find the wheel speed for a hop of 5 m on a moon of 300 m radius, and how near that is to escape."""

import math

from rigid import Tumbler, escape_speed, find_platform, flight, impulsive_launch, launch_speed_for

gravity, radius, distance = 1e-3, 300.0, 5.0  # [m/s2], [m], [m]
robot = find_platform("hedgehog")
stance = robot.stance()
tumbler = Tumbler(
    mass=robot.mass, inertia=robot.moment(), spike_length=stance.spike_length, lean=stance.lean, gravity=gravity
)

unit = impulsive_launch(tumbler, 1.0)  # by an angular momentum of 1 N m s: the speed is in proportion to it
speed = launch_speed_for(distance, unit.angle, gravity=gravity, radius=radius)
momentum = speed / unit.speed
hop = flight(speed, unit.angle, gravity=gravity, radius=radius)
wheel = momentum / robot.wheel().inertia
print(f"leaves at {math.degrees(unit.angle):.1f} degrees and {1e3 * speed:.1f} mm/s: wheel at {wheel:.1f} rad/s")
print(f"escape speed {1e3 * escape_speed(gravity, radius):.0f} mm/s")

assert hop is not None and abs(hop.distance - distance) < 1e-6 * distance, "the flight is as long as was asked"
assert speed < 0.5 * escape_speed(gravity, radius), "it comes back"
