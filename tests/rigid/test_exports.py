"""`import rigid`: what it offers, and what it does not load before it is asked for."""

import subprocess
import sys

import pytest

import rigid


@pytest.mark.parametrize("name", rigid.__all__)
def test_every_name_that_is_listed_is_there(name):
    assert getattr(rigid, name) is not None
    assert name in dir(rigid)


def test_a_name_stands_for_the_very_thing_in_its_module():
    from rigid import hop
    from rigid.platform import files as platform_files
    from rigid.platform import platform
    from rigid.spatial import spatial

    assert rigid.Platform is platform.Platform and rigid.find_platform is platform_files.find_platform
    assert rigid.launch is hop.launch and rigid.escape_speed is hop.escape_speed
    assert rigid.simulate_spatial is spatial.simulate and rigid.SpatialTrial is spatial.SpatialTrial
    assert rigid.simulate is not rigid.simulate_spatial


def test_a_name_there_is_not_is_an_attribute_error():
    with pytest.raises(AttributeError, match="simulate_spatially"):
        rigid.simulate_spatially


def test_neither_a_compiler_nor_scipy_nor_pydantic_is_loaded_with_the_package_or_for_a_trial():
    script = (
        "import sys, rigid; rigid.simulate(rigid.Trial(gravity_sim=0.08, torque=0.1), duration=0.01); "
        "print([name for name in ('taichi', 'scipy', 'pydantic', 'rigid.spatial.spatial', 'rigid.hop') if name "
        "in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_platform_is_read_without_scipy():
    script = "import sys, rigid; rigid.find_platform('hedgehog').stance(); print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_space_is_the_plane_when_started_in_it_by_what_the_package_offers():
    """docs/platform.md: the same trial by both, rows of two tips; 1e-6 of l as in test_spatial.py."""
    hedgehog = rigid.find_platform("hedgehog")
    length = hedgehog.stance().spike_length
    flat = rigid.Trial(spike_length=length, gravity_sim=0.0834, counterweight=5.21, mu_s=0.5, torque=0.22)
    motor = rigid.TorqueHistory.constant(hedgehog.wheel(), 0.22)
    space = rigid.SpatialTrial(
        platform=hedgehog, gravity=0.0834, counterweight=5.21, mu_s=0.5, torques=(motor,),
        ground_parameters={"stiffness": flat.stiffness / 2, "damping": flat.damping / 2},
    )  # fmt: skip
    planar = rigid.simulate(flat, duration=0.5, sample_interval=0.05, tolerance=1e-9)
    spatial = rigid.simulate_spatial(space, duration=0.5, sample_interval=0.05, tolerance=1e-9)
    assert abs(spatial.position[:, 0] - planar.x).max() < 1e-6 * length
    assert abs(spatial.position[:, 2] - planar.y).max() < 1e-6 * length
    assert abs(spatial.turn - planar.theta).max() < 2e-6
    assert planar.theta[-1] > 0.05
