"""The master with a body in space: flight, tops, `rigid.spatial.spatial` again on a surface law, grains under it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coupling import BedGround, LawGround, LeftTheBedError, Master, SpatialBody, SpatialRun, spatial_members
from coupling.members import ball_member
from dem import Bed, Material
from rigid.platform.actuation import Flywheel, TorqueHistory
from rigid.platform.files import find_platform
from rigid.platform.platform import Platform
from rigid.platform.solids import box_vertices
from rigid.spatial.quaternions import from_turn, to_matrix
from rigid.spatial.spatial import SpatialTrial, simulate, standing

HEDGEHOG = find_platform("hedgehog")
STIFF = {"stiffness": 7500.0, "damping": 30.0}
FAR = (0.0, 0.0, 5.0)


def stepped(trial, step, duration, *, standing_on=False, **start):
    """A body on the surface law of `trial`, after `duration` [s] in steps of `step` [s], and its master."""
    footing = LawGround.of_spatial(trial)
    body = SpatialBody(trial, **start)
    footing.place(body.pose)
    body.touching = standing_on
    master = Master(body, footing, substeps=round(step / footing.time_step))
    for _ in range(round(duration / step)):
        master.step()
    return body, master


# Flight ---------------------------------------------------------------------------------------------------------------


def test_flight_keeps_momentum_and_angular_momentum_to_round_off_whatever_the_wheels_do():
    wheels = [TorqueHistory.constant(w, t, 0.7) for w, t in zip(HEDGEHOG.wheels, (0.2, -0.15, 0.1), strict=True)]
    platform = replace(HEDGEHOG, inertia=np.diag([0.05, 0.06, 0.07]))
    trial = SpatialTrial(platform=platform, gravity=0.0834, torques=tuple(wheels), torque_in_flight=True)
    body, _ = stepped(trial, 2e-3, 1.0, position=FAR, velocity=(0.1, 0.2, 0.3), angular_velocity=(1.0, -2.0, 0.5))
    fresh = SpatialBody(trial, position=FAR, velocity=(0.1, 0.2, 0.3), angular_velocity=(1.0, -2.0, 0.5))
    assert (body.angular_momentum == fresh.angular_momentum).all()
    fallen = body.momentum - fresh.momentum - trial.weight * body.time
    assert np.abs(fallen).max() < 1e-13 * np.abs(body.momentum).max()
    # The wheels have what their torques gave, and the platform turns the slower or faster for it.
    assert body.wheels == pytest.approx([-0.14, 0.105, -0.07], rel=1e-12)


def test_a_symmetric_top_turns_about_its_angular_momentum_with_an_error_of_second_order():
    """I1 = I2: the axis goes round L at |L| / I1 (Landau and Lifshitz, Mechanics, section 33)."""
    platform = replace(HEDGEHOG, inertia=np.diag([0.05, 0.05, 0.08]))
    trial, spin = SpatialTrial(platform=platform, gravity=0.0), np.array([1.5, 0.0, 3.0])
    about = np.diag(platform.inertia) * spin
    size = float(np.linalg.norm(about))
    expected = to_matrix(from_turn(about / size * (size / 0.05) * 2.0)) @ [0.0, 0.0, 1.0]
    off = []
    for step in (2e-2, 1e-2):
        body, _ = stepped(trial, step, 2.0, position=FAR, angular_velocity=tuple(spin))
        off.append(np.linalg.norm(to_matrix(body.turn)[:, 2] - expected))
    assert off[1] < 1e-3 and off[0] / off[1] == pytest.approx(4.0, rel=0.02)


# On a surface law -----------------------------------------------------------------------------------------------------


def test_a_tumble_in_the_plane_is_that_of_the_events_located_in_time():
    """`rigid.simulate_spatial`, started where it stands: pivot and slip, 0.5 s, second order in the step."""
    motor = TorqueHistory.constant(HEDGEHOG.wheel(), 0.22)
    trial = SpatialTrial(
        platform=HEDGEHOG, gravity=0.0834, counterweight=5.21, mu_s=0.5, ground_parameters=STIFF, torques=(motor,)
    )
    position, quaternion = standing(trial)
    model = simulate(trial, duration=0.5, sample_interval=0.5, tolerance=1e-9)
    off = []
    for step in (1e-3, 5e-4):
        body, _ = stepped(trial, step, 0.5, standing_on=True, position=position, quaternion=quaternion)
        off.append(max(np.abs(body.place - model.position[-1]).max(), np.abs(body.turn - model.quaternion[-1]).max()))
    assert off[1] < 1e-6 and off[0] / off[1] > 3.4
    assert body.wheels[1] == pytest.approx(-0.11, rel=1e-12)


def test_a_landing_on_one_corner_out_of_the_plane_is_that_of_the_located_events_too():
    """It sticks, slides and leaves: events to the step, 1e-5 of a metre and a radian at 0.4 ms."""
    start = {
        "position": (0.0, 0.0, 0.21), "quaternion": tuple(from_turn([0.3, -0.5, 0.2])), "velocity": (0.05, -0.03, -0.1),
        "angular_velocity": (0.5, 0.8, -0.3),
    }  # fmt: skip
    trial = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, mu_s=0.5, ground_parameters=STIFF)
    model = simulate(trial, duration=0.6, sample_interval=0.6, tolerance=1e-9, **start)
    assert max(count for _, count, _ in model.transitions) == 1 and model.transitions[-1][1] == 0
    body, master = stepped(trial, 4e-4, 0.6, **start)
    assert np.abs(body.place - model.position[-1]).max() < 1e-5
    assert np.abs(body.turn - model.quaternion[-1]).max() < 1e-5
    assert np.abs(body.angular_momentum - model.angular_momentum[-1]).max() < 1e-5
    energy = 0.5 * trial.platform.mass * 0.1**2
    assert abs(master.exchange.given - master.exchange.taken) < 1e-3 * energy


@pytest.mark.long
def test_sliding_on_several_tips_comes_to_rest_where_the_located_events_have_it():
    """Level, with a sideways speed and a turn about the vertical: four tips slide, each its own way, and stick."""
    trial = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, mu_s=0.3, ground_parameters=STIFF)
    position, quaternion = standing(trial)
    start = {"position": position, "quaternion": quaternion, "velocity": (0.02, 0.012, 0.0)}
    start["angular_velocity"] = (0.0, 0.0, 0.1)
    model = simulate(trial, duration=2.4, sample_interval=2.4, tolerance=1e-8, **start)
    body, _ = stepped(trial, 1e-3, 2.4, standing_on=True, **start)
    assert model.sticking[-1] >= 2 and len(body.sticking) >= 2
    way = np.linalg.norm(model.position[-1, :2])
    assert way > 0.01
    assert np.linalg.norm(body.place[:2] - model.position[-1, :2]) < 0.02 * way


# On grains ------------------------------------------------------------------------------------------------------------

RADIUS, DENSITY, YOUNG, POISSON = 5e-3, 2500.0, 1e7, 0.25
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3


def ball(mass=MASS):
    """A platform whose mass and inertia are a grain's; what grains touch of it is a ball, given by hand."""
    tips = 0.6 * RADIUS * np.array([[1, 1, -1], [1, -1, -1], [-1, 1, -1], [-1, -1, -1]])
    wheel = Flywheel(inertia=0.04 * mass * RADIUS**2)
    return Platform(
        name="ball", mass=mass, inertia=0.4 * mass * RADIUS**2 * np.eye(3), tips=tips,
        hull_vertices=box_vertices((RADIUS, RADIUS, RADIUS)), wheels=(wheel,),
    )  # fmt: skip


def bed_of(positions, *, velocities=None, restitution=1.0, friction=0.0, gravity=9.81, size=(0.06, 0.06, 0.05)):
    material = Material(
        name="test", density=DENSITY, young=YOUNG, poisson=POISSON, friction=friction, restitution=restitution,
        rolling_friction=0.0, sources={},
    )  # fmt: skip
    return Bed.from_grains(
        material, positions=np.array(positions, dtype=float), radii=np.full(len(positions), RADIUS), size=size,
        height=0.2, gravity=gravity, velocities=velocities, max_overlap=0.1, threads=1,
    )  # fmt: skip


def thrown(bed, *, at, velocity, spin=(0.0, 0.0, 0.0), gravity=9.81, substeps=1, **grain):
    bed.surface = 0.0
    footing = BedGround(bed, [ball_member(RADIUS)], origin=(0.0, 0.0), young=YOUNG, poisson=POISSON, **grain)
    trial = SpatialTrial(platform=ball(), gravity=gravity, mu_s=0.0)
    body = SpatialBody(trial, position=at, velocity=velocity, angular_velocity=spin)
    body.start(bed.time_step)
    return Master(body, footing, substeps=substeps)


def test_a_ball_in_space_through_the_coupling_is_the_same_ball_as_a_grain():
    """Off centre in both directions on a grain on the floor, no friction, no loss, step for step: to round-off."""
    base, at, velocity = (0.03, 0.03, RADIUS), (0.032, 0.0285, 3 * RADIUS + 1e-3), (0.02, 0.03, -0.1)
    grains = bed_of([base, at], velocities=np.array([[0, 0, 0], velocity]))
    master = thrown(bed_of([base]), at=at, velocity=velocity)
    met = 0.0
    for _ in range(360):
        master.step()
        met = max(met, float(master.wrench.force[2]))
    grains.advance(360)
    assert met > 0.2
    assert np.abs(grains.grains().position[1] - master.body.place).max() < 1e-14


@pytest.mark.parametrize(("substeps", "most"), [(1, 5e-13), (2, 1e-5)])
def test_body_and_grains_together_keep_momentum_and_angular_momentum(substeps, most):
    """Thrown into a floating cloud with friction and losses, nothing else near: before and after, about the origin.

    To round-off with one step of the bed a macro step; with more, the held twist leaves an error: 4e-6 with two, 1e-4
    with eight (2026-11-22), half as many as a contact takes.
    """
    cloud = np.array([[0.1, 0.1, 0.1], [0.1, 0.109, 0.103], [0.107, 0.104, 0.108], [0.096, 0.102, 0.1095]])
    size = (0.2, 0.2, 0.2)
    bed = bed_of(cloud, restitution=0.5, friction=0.6, gravity=0.0, size=size)
    spin = (30.0, -50.0, 20.0)
    master = thrown(
        bed, at=(0.09, 0.097, 0.088), velocity=(0.4, 0.3, 0.5), spin=spin, gravity=0.0, friction=0.5, restitution=0.5,
        substeps=substeps,
    )  # fmt: skip

    def both():
        seen, body = bed.grains(), master.body
        momentum = seen.mass[:, None] * seen.velocity
        inertia = 0.4 * seen.mass * seen.radius**2
        about = np.cross(seen.position, momentum).sum(axis=0) + (inertia[:, None] * seen.spin).sum(axis=0)
        return momentum.sum(axis=0) + body.momentum, about + np.cross(body.place, body.momentum) + body.angular_momentum

    linear, angular = both()
    for _ in range(1600 // substeps):
        master.step()
    assert not bed.grains().force.any() and not master.wrench.force.any()  # they have parted
    assert np.abs(bed.grains().spin).max() > 1.0 and master.exchange.taken > 0
    later = both()
    assert np.abs(later[0] - linear).max() < 2e-13 * np.linalg.norm(linear)
    assert np.abs(later[1] - angular).max() < most * np.linalg.norm(angular)


def small_platform():
    """Eight spikes from the corners of a cube of 16 mm, with two wheels."""
    corners = 8e-3 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    wheels = tuple(Flywheel(inertia=2e-7, axis=axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    return Platform(
        name="small", mass=0.02, inertia=2e-6 * np.eye(3), tips=2.2 * corners, hull_vertices=corners, wheels=wheels,
        tip_radius=4e-3,
    )  # fmt: skip


def layer():
    rows = np.arange(12) * 5e-3 + 2.5e-3
    x, y = np.meshgrid(rows, rows, indexing="ij")
    material = Material(
        name="test", density=DENSITY, young=1e6, poisson=POISSON, friction=0.5, restitution=0.3, rolling_friction=0.0,
        sources={},
    )  # fmt: skip
    low = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.5e-3)])
    high = low + [2.5e-3, 2.5e-3, 3.6e-3]
    positions = np.vstack([low, high]) % [0.06, 0.06, 1.0]
    bed = Bed.from_grains(
        material, positions=positions, radii=np.full(len(positions), 2.5e-3), size=(0.06, 0.06, 0.02), height=0.1,
        gravity=9.81, max_overlap=0.2, threads=1,
    )  # fmt: skip
    bed.surface = 8.5e-3
    return bed


def dropped(**options):
    platform = small_platform()
    bed = layer()
    footing = BedGround(bed, spatial_members(platform), origin=(0.03, 0.03), friction=0.5, bounded_across=True)
    motor = TorqueHistory.constant(platform.wheels[1], 2e-3)
    trial = SpatialTrial(platform=platform, gravity=9.81, mu_s=0.5, torques=(motor,))
    return SpatialRun(
        trial, footing, substeps=4, energy_interval=1e-3, quaternion=from_turn([0.1, 0.0, 0.3]), **options
    )


@pytest.mark.long
def test_a_platform_let_fall_askew_on_grains_closes_its_books_and_goes_on_from_its_state_to_the_same_bits():
    start = {"duration": 0.03, "velocity": (0.05, 0.0, -0.1), "angular_velocity": (0.0, 1.0, 2.0)}
    run = dropped(**start)
    while run.time < 0.015:
        run.advance()
    kept = run.state()
    run.run()
    rows, samples = run.columns, run.samples
    assert rows["touching"].max() >= 3 and rows["fy"].any()
    assert run.energy_residual < 1e-4 and run.dissipation_reversal < 1e-6
    assert samples["momentum_error"].max() < 1e-13 * run.trial.platform.mass
    # Forces act half a step of the bed later than their arms are taken: first order in that step.
    assert 0 < samples["angular_momentum_error"].max() < 5e-4 * np.linalg.norm(run._turning)
    assert rows["wheel_y"][-1] < 0 == rows["wheel_x"][-1]
    again = dropped(**start)
    again.restore(kept)
    again.run()
    assert (np.array(again._rows) == np.array(run._rows)).all()


@pytest.mark.long
def test_a_ball_that_rolls_into_grains_keeps_the_angular_momentum_of_all_to_round_off():
    """On a floor, under gravity, through the periodic side: weight, floor and side told apart
    (`dem.engine.dissipation`); n = 1."""
    bed = layer()
    footing = BedGround(bed, [ball_member(RADIUS)], origin=(0.05, 0.03), friction=0.5, bounded=False)
    trial = SpatialTrial(platform=ball(), gravity=9.81, mu_s=0.5)
    run = SpatialRun(
        trial, footing, substeps=1, duration=0.04, energy_interval=2e-3, position=(0.0, 0.0, RADIUS + 1e-4),
        velocity=(0.3, 0.05, -0.2), angular_velocity=(20.0, 60.0, 5.0),
    )  # fmt: skip
    run.run()
    assert run.columns["touching"].any() and run.columns["x"][-1] > 0.01
    given = np.abs(footing.bed.angular_momentum()["bodies"]).max()
    assert given > 1e-6 and run.samples["angular_momentum_error"].max() < 1e-11 * given


@pytest.mark.long
def test_a_hand_sets_it_down_askew_until_the_grains_carry_it():
    run = dropped(duration=1e-3, lowering_speed=0.05)
    run.run()
    rows = run.columns
    weight = run.trial.platform.mass * 9.81
    assert run.placing_steps > 0 and rows["time"][0] == 0.0
    assert rows["fz"][0] == pytest.approx(weight, rel=0.05)
    assert to_matrix([rows[f"q{k}"][0] for k in range(4)])[2, 2] > math.cos(0.2)
    assert rows["sinkage"][0] > 0


@pytest.mark.long
def test_where_it_leaves_the_bed_across_is_said():
    run = dropped(duration=0.2, velocity=(0.0, 0.9, -0.2))
    with pytest.raises(LeftTheBedError, match=r"left of the bed, which is 0.06 m wide"):
        run.run()


# Refusals -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"quaternion": (1.0, 1.0, 0.0, 0.0)}, "quaternion"),
        ({"position": (0.0, 0.0)}, "position"),
        ({"velocity": (0.0, math.nan, 0.0)}, "velocity"),
        ({"lowering_speed": -1.0}, "lowering_speed"),
        ({"lowering_speed": 0.1, "velocity": (0.1, 0.0, 0.0)}, "starts at rest"),
        ({"duration": 0.0}, "duration"),
    ],
)
def test_what_cannot_be_is_refused_by_its_name(change, word):
    trial = SpatialTrial(platform=HEDGEHOG, gravity=0.0834, ground_parameters=STIFF)
    with pytest.raises(ValueError, match=word):
        SpatialRun(trial, LawGround.of_spatial(trial), **({"duration": 0.1} | change))


def test_grains_need_spikes():
    with pytest.raises(ValueError, match="tip_radius of MASCOT"):
        spatial_members(find_platform("mascot"))
