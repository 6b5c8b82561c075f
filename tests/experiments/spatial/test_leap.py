"""The hop of a platform in space: its launch, and the parabola over level ground."""

import json
import math

import numpy as np
import pytest

from experiments.cli.main import DONE, main
from experiments.spatial.leap import leap_of


def test_the_longest_flight_that_begins_upwards_counts_and_what_falls_at_the_start_does_not():
    """v = (0.3, 0.4, 0.5) m/s: distance 2 v_h v_z / g, height v_z^2 / 2 g."""
    touching = [0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1]
    velocity = np.zeros((11, 3))
    velocity[5] = velocity[0] = 1.0, 0.0, 1.0
    velocity[7:10] = 0.3, 0.4, 0.5
    found = {name: value for name, (value, _, _) in leap_of(touching, velocity, gravity=2.0, lasting=1).items()}
    assert found["hop_distance"] == pytest.approx(2 * 0.5 * 0.5 / 2.0) and found["hop_height"] == pytest.approx(1 / 16)
    assert found["hop_angle"] == pytest.approx(math.pi / 4)
    for none in (np.ones(11), np.zeros(11)):
        assert leap_of(none, velocity, gravity=2.0, lasting=1)["hop_distance"][0] is None


def test_a_braked_platform_in_space_hops_as_far_as_in_the_plane(tmp_path):
    """The same brake as `hop --wheel-speed-0 68.2 --gravity 1e-3`, 4.99 m on brick; here K and C of a tip."""
    words = ["--gravity", "1e-3", "--actuator", "brake", "--torque", "0", "6", "0", "--wheel-speed-0", "0", "68.2", "0"]
    run = ["tumble", "spatial", *words, "--duration", "0.2", "--frame-count", "0", "--quiet", "--out"]
    assert main([*run, str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    value = {name: entry["value"] for name, entry in result["quantities"].items()}
    assert value["hop_distance"] == pytest.approx(4.99, rel=0.02) and value["hop_velocity_y"] == pytest.approx(0)
    assert math.degrees(value["hop_angle"]) == pytest.approx(76, abs=0.3)
