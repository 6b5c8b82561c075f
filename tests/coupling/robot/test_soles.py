"""The soles of feet, and a law that follows them: a wheel gets another force than a spike."""

import math

import numpy as np
import pytest
from spatial_runs import EXAMPLES, ball

from coupling.robot import FootForces, LawFeet, MujocoRobot, law_under_feet, load_model, sole_of
from coupling.robot.soles import outline
from rigid.ground.laws import find_law
from rigid.ground.rft import flat_plate, stress_gradient
from rigid.ground.rft_foot import FLAT, LYING, ROUND

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

LEVEL = np.eye(3)
ON_SIDE = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


def foot_of(kind, size, quat=None):
    model = ball(kind, size, height=0.5)
    if quat is not None:
        model.qpos0[3:7] = quat
    return MujocoRobot(model, "foot").feet[0]


@pytest.mark.parametrize(
    ("kind", "size", "area", "width", "roundness"),
    [
        ("box", "0.05 0.03 0.01", 0.1 * 0.06, 0.06, FLAT),
        ("cylinder", "0.03 0.01", math.pi * 0.03**2, 0.03, FLAT),
        ("sphere", "0.02", math.pi * 0.02**2, 0.02, ROUND),
        ("ellipsoid", "0.04 0.01 0.03", math.pi * 0.04 * 0.01, 0.02, ROUND),
        ("capsule", "0.01 0.03", math.pi * 0.01**2, 0.01, ROUND),
    ],
)
def test_a_sole_has_the_area_from_above_and_the_width_of_its_kind(kind, size, area, width, roundness):
    (part,) = foot_of(kind, size).parts
    sole = sole_of(part, LEVEL, of=0.012)
    assert sole.area == pytest.approx(area, rel=0.02) and sole.width == pytest.approx(width, rel=0.02)
    assert sole.roundness == roundness
    if roundness == ROUND:
        assert sole.height == pytest.approx({"sphere": 0.02, "ellipsoid": 0.03, "capsule": 0.01}[kind])


def test_a_wheel_lies_with_its_radius_and_the_area_of_its_diameter_times_its_width():
    (part,) = foot_of("cylinder", "0.1 0.03", quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0]).parts
    sole = sole_of(part, ON_SIDE, of=0.012)
    assert sole.roundness == LYING and sole.height == pytest.approx(0.1)
    assert sole.area == pytest.approx(0.2 * 0.06, rel=0.01) and sole.width == pytest.approx(0.06, rel=0.01)


def test_an_outline_of_points_in_a_line_has_no_area():
    assert outline([[0, 0, 0], [1, 0, 0], [2, 0, 1]]) == (0.0, 0.0, 0.0) == outline([[0, 0, 0]])
    area, perimeter, narrow = outline([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 5]])
    assert (area, perimeter, narrow) == pytest.approx((2.0, 6.0, 1.0))


@pytest.mark.parametrize("law", ["spring-damper", "power-irreversible", "katsuragi-durian", "bekker", "rft"])
def test_a_flat_foot_of_five_spikes_across_and_a_wheel_have_more_force_than_a_spike(law):
    """The sum over the points on which a foot stands, one millimetre deep; a wheel has the same force at both ends."""
    values = find_law(law).values({})
    spike = float(find_law(law).force(1e-3, 0.0, find_law(law).numbers({})))
    flat = foot_of("cylinder", "0.03 0.01")
    ground = LawFeet([flat], **law_under_feet([flat], [LEVEL], law, values, of=0.012))
    standing = sum(float(one.force(1e-3, 0.0)) for one in ground.grounds[0][:8])
    assert standing > 4 * spike
    if law == "rft":
        xi = stress_gradient(bulk_density=1500.0, friction=0.6, gravity=9.80665)
        assert standing == pytest.approx(flat_plate() * xi * math.pi * 0.03**2 * 1e-3, rel=0.02)
    wheel = foot_of("cylinder", "0.1 0.03", quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0])
    ground = LawFeet([wheel], **law_under_feet([wheel], [ON_SIDE], law, values, of=0.012))
    ends = [float(one.force(1e-3, 0.0)) for one in ground.grounds[0]]
    assert len(ends) == 2 and ends[0] == ends[1] > 2 * spike


def test_a_site_is_a_spike_under_every_law():
    robot = MujocoRobot(load_model(EXAMPLES / "mujoco-hedgehog" / "hedgehog.xml"), "tip_*", keyframe="tumble")
    (foot,) = robot.feet
    for law in ("katsuragi-durian", "rft"):
        found = find_law(law)
        ground = LawFeet([foot], **law_under_feet([foot], [LEVEL], law, found.values({}), of=0.012))
        for one in (ground.grounds[0][0], ground.grounds[0][-1]):
            assert float(one.force(4e-3, 0.1)) == pytest.approx(found.force(4e-3, 0.1, found.numbers({})), rel=5e-3)


def test_the_callback_has_the_same_force_as_the_ground_of_a_run():
    model = ball("cylinder", "0.03 0.01", height=0.008)
    robot = MujocoRobot(model, "foot")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    options = law_under_feet(robot.feet, [LEVEL], "rft", find_law("rft").values({}), of=0.012)
    data.qfrc_passive[:] = 0.0
    FootForces(model, data, robot.feet, **options)(model, data)
    ground = LawFeet(robot.feet, **options)
    assert data.qfrc_passive[2] == pytest.approx(sum(float(one.force(2e-3, 0.0)) for one in ground.grounds[0][:8]))


def test_parts_that_spring_back_differently_are_refused_in_the_callback():
    robot = MujocoRobot(load_model(EXAMPLES / "mujoco-hedgehog" / "hedgehog.xml"), "tip_*", keyframe="tumble")
    first = robot.feet[0].parts[0].name
    under = {first: find_law("rft").values({"rebound": 0.1})}
    with pytest.raises(ValueError, match=r"rebound, \[0\.05, 0\.1\]"):
        FootForces(robot.model, robot.data, robot.feet, law="rft", parameters=find_law("rft").values({}), under=under)
