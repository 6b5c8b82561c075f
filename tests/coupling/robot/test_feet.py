"""Feet of a robot: names, refusals, the points of a law, the shapes of grains."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from spatial_runs import ball, grain_bed, model_of

from coupling.robot import BedFeet, LawFeet, MujocoRobot, find_feet, load_model
from coupling.robot.distances import distances
from coupling.robot.feet import mesh_of
from rigid.spatial.quaternions import from_turn, multiply, to_matrix

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

TWO = """<mujoco><asset>
<mesh name="closed" vertex="0 0 0 .02 0 0 0 .02 0 0 0 .02"/></asset><worldbody>
<geom name="ground" type="plane" size="1 1 .1"/><geom name="step" type="box" size=".1 .1 .01" pos="1 0 0"/>
<body name="left" pos="0 0.1 .2"><freejoint/><geom name="left_heel" size=".01" mass="1"/>
<geom name="left_toe" size=".01" pos=".05 0 0" mass="1"/><site name="mark" pos="0 0 -.01"/></body>
<body name="right" pos="0 -.1 .2"><freejoint/><geom name="right_heel" size=".01" mass="1"/>
<geom name="rock" type="mesh" mesh="closed" mass="1"/></body></worldbody></mujoco>"""


def made(names, text=TWO):
    model = model_of(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return find_feet(model, data, names)


def test_geoms_of_one_body_make_one_foot_and_a_pattern_names_several():
    feet = made(["left_*", "right_heel"])
    assert [(foot.name, len(foot.parts)) for foot in feet] == [("left", 2), ("right_heel", 1)]
    # About the centre of mass of the body, half way between its two balls.
    assert feet[0].centres == pytest.approx(np.array([[-0.025, 0, 0], [0.025, 0, 0]]))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["left_heal"], "no geom or site 'left_heal' .did you mean 'left_heel'"),
        (["step"], "'step' does not move"),
        (["ground"], "'ground' does not move"),
        ([], "feet is empty"),
        (["left_heel", "left_toe", "left_heel"], "feet contains 'left_heel' twice"),
        (["nose_*"], "no geom or site 'nose_[*]'"),
    ],
)
def test_a_name_that_is_no_foot_is_refused_with_what_there_is(names, said):
    with pytest.raises(ValueError, match=said):
        made(names)


def test_a_model_without_names_and_a_file_that_is_none_are_refused(tmp_path):
    with pytest.raises(ValueError, match="none of the model's 1 geoms has a name"):
        made(["foot"], "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
    with pytest.raises(ValueError, match="no such file"):
        load_model(tmp_path / "robot.xml")
    (tmp_path / "robot.xml").write_text("<mujoco><nonsense/></mujoco>")
    with pytest.raises(ValueError, match=r"robot.xml.* is no model .*nonsense"):
        load_model(tmp_path / "robot.xml")


def test_without_the_package_it_is_said_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ValueError, match=r"pip install 'hedgebed\[mujoco\]'"):
        MujocoRobot("robot.xml", ["foot"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("integrator='RK4'", "the model's integrator is RK4"),
        ("gravity='1 0 -9.81'", r"gravity is \[1.0, 0.0, -9.81\]"),
    ],
)
def test_a_model_that_cannot_be_stepped_here_is_refused(change, said):
    model = model_of(TWO.replace("<mujoco>", f"<mujoco><option {change}/>"))
    with pytest.raises(ValueError, match=said):
        MujocoRobot(model, ["left_heel"])


def test_the_lowest_point_of_a_ball_an_ellipsoid_and_a_wheel_is_that_of_their_closed_forms():
    """Support of an ellipsoid along n: sqrt(sum (a_i n_i)^2); of a disc of radius r about a: r |n - (n a) a|."""
    matrix = to_matrix(from_turn([0.4, -0.7, 0.2]))
    up = matrix[2]
    (foot,) = MujocoRobot(ball("sphere", "0.05"), "foot").feet
    assert foot.lowest(matrix) == pytest.approx(np.array([[0.0, 0.0, -0.05]]))
    (foot,) = MujocoRobot(ball("ellipsoid", "0.05 0.03 0.02"), "foot").feet
    axes = np.array([0.05, 0.03, 0.02])
    found = foot.lowest(matrix)[0]
    assert found[2] == pytest.approx(-np.linalg.norm(axes * up))
    assert np.linalg.norm((matrix.T @ found) / axes) == pytest.approx(1.0)  # it lies on the surface
    lying = model_of(
        "<mujoco><worldbody><body pos='0 0 1' euler='90 0 0'><freejoint/><geom name='foot' type='cylinder' "
        "size='.05 .02' mass='1'/></body></worldbody></mujoco>"
    )
    (foot,) = MujocoRobot(lying, "foot").feet
    low = foot.lowest(matrix)
    expected = np.sort(matrix[2, 2] * np.array([-0.02, 0.02])) - 0.05 * np.sqrt(1 - up[2] ** 2)
    assert np.sort(low[:, 2]) == pytest.approx(expected)


def test_a_foot_that_stands_has_the_law_once_whatever_its_number_of_points():
    for kind, size, count in (
        ("sphere", "0.05", 1), ("box", "0.05 0.05 0.05", 4), ("cylinder", "0.05 0.05", 8), ("capsule", "0.02 0.03", 1),
        ("lying", "0.05 0.05", 2),
    ):  # fmt: skip
        model = ball("capsule" if kind == "lying" else kind, size)
        if kind == "lying":
            model.qpos0[3:7] = from_turn([0.5 * np.pi, 0.0, 0.0])
        robot = MujocoRobot(model, "foot")
        ground = LawFeet(robot.feet, parameters={"stiffness": 1000.0, "damping": 0.0})
        pose = robot.pose
        sunk = pose.position - [0.0, 0.0, 0.052]
        reaction = ground.step(sunk, np.zeros(3), 1e-3, pose.turn, np.zeros(3))
        assert len(reaction.contacts) == count
        assert reaction.force == pytest.approx([0.0, 0.0, 1000.0 * 0.002])


class NoBed:
    """Refused before anything of a bed is asked for."""


MESH = """<mujoco><asset><mesh name="own" vertex="{}"/></asset><worldbody><body name="foot" pos="0 0 {}"><freejoint/>
<geom name="foot" type="mesh" mesh="own" mass="1"/></body></worldbody></mujoco>"""


def of_mesh(vertices, height):
    """A free body with the convex hull of these points [m] as its geom ``foot``."""
    return model_of(MESH.format(" ".join(map(str, np.ravel(vertices))), height))


def test_a_law_pushes_a_mesh_of_a_box_as_the_box():
    corners = np.array([[x, y, z] for x in (-0.03, 0.03) for y in (-0.02, 0.02) for z in (-0.01, 0.01)])
    forces = []
    for model in (of_mesh(corners, 0.009), ball("box", "0.03 0.02 0.01", height=0.009)):
        robot, still = MujocoRobot(model, "foot"), np.zeros(3)
        ground = LawFeet(robot.feet, parameters={"stiffness": 1000.0, "damping": 0.0})
        for turned in (robot.pose.turn, multiply(from_turn(np.array([0.0, 0.02, 0.0])), robot.pose.turn)):
            forces.append(ground.step(robot.pose.position, still, 1e-6, turned, still))
    assert forces[0].force[2] == pytest.approx(1000.0 * 0.001, rel=1e-5)
    for mesh, box in zip(forces[:2], forces[2:], strict=True):
        assert mesh.force == pytest.approx(box.force, rel=1e-5) and mesh.torque == pytest.approx(box.torque, abs=1e-7)


def test_a_fine_mesh_of_a_ball_stands_on_at_most_64_points_that_are_spread_over_it():
    """64 points on a ball leave gaps of some 0.4 rad, over which its lowest point is up to 1 - cos 0.4 too high.

    It stands on three of them.
    """
    directions = np.random.default_rng(1).normal(size=(600, 3))
    model = of_mesh(0.05 * directions / np.linalg.norm(directions, axis=1)[:, None], 0.1)
    (foot,) = MujocoRobot(model, "foot").feet
    assert foot.centres.shape == (64, 3) and foot.parts[0].share == pytest.approx(1 / 3)
    for turn in np.random.default_rng(2).normal(size=(40, 3)):
        matrix = to_matrix(from_turn(turn))
        assert 0 <= foot.lowest(matrix)[:, 2].min() - foot.bottom(matrix) < 0.05 * (1 - np.cos(0.4))


def test_a_mesh_with_a_round_sole_stands_on_eight_points_of_its_rim():
    angles = 2 * np.pi / 32 * np.arange(32)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.ones(32)])
    (foot,) = MujocoRobot(of_mesh(0.03 * np.concatenate([rim, rim * (1, 1, -1)]), 0.1), "foot").feet
    below = foot.centres[foot.centres[:, 2] < 0]
    assert foot.parts[0].share == 1 / 8 and len(below) == 8 and len(foot.centres) == 8 + 32
    turns = np.sort(np.arctan2(below[:, 1], below[:, 0]))
    assert np.diff(turns).max() < 2 * 2 * np.pi / 8


def test_a_site_has_no_surface_for_grains():
    with pytest.raises(ValueError, match="'mark' is a site"):
        BedFeet(NoBed(), made(["mark"]))


def test_an_open_mesh_becomes_its_convex_hull_and_says_so():
    from coupling.robot.feet import _closed

    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]])  # two sides of six
    vertices, closed, note = _closed("shoe", cube, faces)
    assert len(vertices) == 8 and len(closed) == 12 and "'shoe' is not closed" in note
    (foot,) = made(["rock"])
    assert foot.parts[0].note == "" and len(foot.parts[0].faces) == 4


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "size", "at", "distance"),
    [
        ("sphere", "0.02", (0.03, 0.0, 0.0), 0.01),
        ("capsule", "0.02 0.03", (0.0, 0.0, 0.08), 0.03),
        ("cylinder", "0.02 0.03", (0.03, 0.0, 0.0), 0.01),
        ("box", "0.02 0.03 0.04", (0.0, 0.04, 0.0), 0.01),
        ("ellipsoid", "0.02 0.03 0.04", (0.0, 0.0, 0.06), 0.02),
    ],
)
def test_grains_meet_the_shape_that_the_geom_has(kind, size, at, distance):
    bed = grain_bed()
    robot = MujocoRobot(ball(kind, size), "foot")
    ground = BedFeet(bed, robot.feet, origin=(0.04, 0.04))
    ground.place(robot.pose)
    centre = ground.origin + robot.pose.position
    found, normal, _ = distances(bed, ground.bodies[0], np.array([centre + at]))
    assert found[0] == pytest.approx(distance, abs=2e-5)
    assert normal[0] @ at == pytest.approx(np.linalg.norm(at), rel=1e-6)


def test_the_picture_of_a_geom_is_as_large_as_the_geom():
    for kind, size, volume in (
        ("sphere", "0.05", 4 / 3 * np.pi * 0.05**3),
        ("capsule", "0.05 0.1", 4 / 3 * np.pi * 0.05**3 + np.pi * 0.05**2 * 0.2),
        ("cylinder", "0.05 0.1", np.pi * 0.05**2 * 0.2),
        ("box", "0.05 0.1 0.2", 8 * 0.05 * 0.1 * 0.2),
    ):
        model = ball(kind, size)
        vertices, faces = mesh_of(model, 1)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=0.02)
        assert vertices.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)


def test_the_parts_of_the_hopper_join_wherever_its_knee_is_by_geoms_without_mass_and_contact():
    """Seen along y: heights of trunk, sleeve, shaft, ankle and foot overlap from the lower to the upper stop."""
    model = load_model("hopper")
    data = mujoco.MjData(model)
    assert model.body_mass[1:].tolist() == [1.5, 0.22]
    for name in ("sleeve", "ankle"):
        assert not model.geom(name).contype[0] and not model.geom(name).conaffinity[0]
    for knee in np.linspace(*model.joint("knee").range, 12):
        data.joint("knee").qpos = knee
        mujoco.mj_forward(model, data)
        spans = []
        for name in ("trunk", "sleeve", "shaft", "ankle", "foot"):
            k = model.geom(name).id
            up = data.geom_xpos[k, 2] + mesh_of(model, k)[0] @ data.geom_xmat[k].reshape(3, 3)[2]
            spans.append((up.min(), up.max()))
        assert all(low <= high for (low, _), (_, high) in pairwise(spans))
