"""The master on grains: a body is a grain, Hertz, books with the grains in them, order in H, refusals, restart."""

import math
from dataclasses import replace

import numpy as np
import pytest

from coupling import MOST_REVERSAL, BedGround, CoupledTumble, LeftTheBedError, Master, PlanarBody, platform_members
from coupling.members import ball_member
from coupling.poses import Pose
from dem import Bed, Material
from rigid import Trial

RADIUS, DENSITY, YOUNG, POISSON = 5e-3, 2500.0, 1e7, 0.25
SIZE = (0.06, 0.06, 0.05)
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])


def stuff(*, restitution=1.0, friction=0.0):
    return Material(
        name="test", density=DENSITY, young=YOUNG, poisson=POISSON, friction=friction, restitution=restitution,
        rolling_friction=0.0, sources={},
    )  # fmt: skip


def bed_of(positions, *, velocities=None, material=None, radii=None, gravity=9.81):
    positions = np.array(positions, dtype=float)
    radii = np.full(len(positions), RADIUS) if radii is None else np.array(radii)
    return Bed.from_grains(
        material or stuff(), positions=positions, radii=radii, size=SIZE, height=0.2, gravity=gravity,
        velocities=velocities, max_overlap=0.1, threads=1,
    )  # fmt: skip


def ball_on(bed, *, x, z, speed=0.0, substeps=1, share=1.0, **options):
    """A ball of the grains' own size and stuff, of `share` of their mass, moving at `speed` downwards; its master."""
    bed.surface = 0.0
    footing = BedGround(bed, [ball_member(RADIUS)], origin=(0.0, 0.03), young=YOUNG, poisson=POISSON)
    inertia = 0.4 * share * MASS * RADIUS**2
    trial = Trial(
        mass=share * MASS, inertia=inertia, spike_length=RADIUS, wheel_inertia=0.1 * inertia, gravity_sim=9.81, mu_s=0.0
    )
    body = PlanarBody(trial, x=x, z=z)
    # A body's rates belong to a time half a step later than its place, as a grain's half a step earlier.
    body.rates = np.array([0.0, -speed - 0.5 * 9.81 * bed.time_step, 0.0])
    return Master(body, footing, substeps=substeps, **options)


BASE = [[0.03, 0.03, RADIUS]]
START = (0.032, 3 * RADIUS + 1e-3)


@pytest.mark.long
def test_a_ball_through_the_coupling_is_the_same_ball_as_a_grain():
    """Dropped off centre on a grain that lies on the floor, no friction, no loss, step for step: to round-off.

    With losses it is not: a grain takes a body for infinitely heavy, so the dashpot sees another reduced mass.
    """
    speed, met = 0.1, 0.0
    moving = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -speed]])
    grains = bed_of([*BASE, (START[0], 0.03, START[1])], velocities=moving)
    master = ball_on(bed_of(BASE), x=START[0], z=START[1], speed=speed)
    for _ in range(6):
        grains.advance(60)
        for _ in range(60):
            master.step()
            met = max(met, float(master.wrench.force[2]))
        seen = grains.grains()
        assert np.abs(seen.position[1, [0, 2]] - master.body.place[:2]).max() < 1e-14
    assert met > 0.2  # they did collide
    assert np.abs(seen.position[0] - master.ground.bed.grains().position[0]).max() < 1e-14


def test_the_books_close_with_the_grains_energies_in_them():
    """The same drop, lossless: nothing is dissipated, so body and grains together keep what they had."""
    master = ball_on(bed_of(BASE), x=START[0], z=START[1], speed=0.1)
    body, footing = master.body, master.ground
    master.step()
    rows = []
    for step in range(360):
        if step % 8 == 0:
            own = body.kinetic_energy(footing.lag) + body.potential_energy
            rows.append([own, sum(footing.energies().values()), *master.exchanged()])
            momentum = footing.momentum()[[0, 2]] + MASS * body.rates[:2] - [0.0, -MASS * 9.81 * body.time]
            rows[-1].extend(momentum)
        master.step()
    own, grains, given, taken, along, up = np.array(rows).T
    scale = 0.5 * MASS * 0.1**2
    assert taken.max() > 0.3 * scale
    left = (taken - taken[0]) - (grains - grains[0])
    assert abs(left[-1]) < MOST_REVERSAL * scale  # what that bound is read off
    assert np.ptp(own + grains) < 0.02 * scale  # the grains' own integrator, at 15 steps a contact
    assert np.ptp(own + taken) < 0.02 * scale and np.ptp(grains - taken) < 0.03 * scale
    # Within a contact the two are off by what half a step of it does; after it they are the same.
    assert np.abs(given - taken).max() < 0.01 * scale and abs(given[-1] - taken[-1]) < 1e-12 * scale
    assert max(np.ptp(along), np.ptp(up)) < 1e-13 * MASS


@pytest.mark.long
def test_the_result_converges_at_least_as_the_square_of_the_macro_step():
    """2 and 4 grain steps a macro step against 1: errors of H^2 - dt^2 stand as 16 - 1 to 4 - 1."""
    ends = []
    for substeps in (1, 2, 4):
        master = ball_on(bed_of(BASE), x=START[0], z=START[1], speed=0.1, substeps=substeps)
        for _ in range(320 // substeps):
            master.step()
        ends.append(master.body.place[:2])
    once, twice = (np.linalg.norm(ends[k] - ends[0]) for k in (1, 2))
    assert twice / once > 4.0
    assert once < 1e-5


@pytest.mark.long
def test_a_light_ball_on_a_grain_needs_iterated_steps_which_go_on_from_a_checkpoint_to_the_same_bits():
    """A tenth of the grain's mass, 8 of the bed's steps in one: its rebound is that of step by step, momentum kept."""

    def let_fall(substeps, iterations, until=320):
        master = ball_on(
            bed_of(BASE), x=START[0], z=START[1], speed=0.1, substeps=substeps, share=0.1, iterations=iterations
        )
        for _ in range(until // substeps):
            master.step()
        return master

    def total(master):
        """Momentum of ball and grain, the weight of the ball taken off [N s]."""
        own = 0.1 * MASS * (master.body.rates[:2] + [0.0, 9.81 * master.body.time])
        return master.ground.momentum()[[0, 2]] + own

    fine, explicit, iterated = let_fall(1, 1), let_fall(8, 1), let_fall(8, 30)
    away = [np.linalg.norm(master.body.rates[:2] - fine.body.rates[:2]) for master in (explicit, iterated)]
    assert away[1] < 1e-3 < 0.03 < away[0]  # of 0.1 m/s
    assert iterated.exchange.unsettled == 0 < iterated.exchange.repeats
    assert np.abs(total(iterated) - total(let_fall(8, 30, until=8))).max() < 1e-13 * MASS
    kept = let_fall(8, 30, until=200).state()
    again = let_fall(8, 30, until=8)
    again.restore(kept)
    for _ in range(15):
        again.step()
    assert (again.body.place == iterated.body.place).all() and again.exchange == iterated.exchange


def test_a_body_set_on_one_big_sphere_reproduces_hertz():
    """At rest, two contacts in a row: delta = (3 F / 4 E* sqrt(R*))^(2/3), R* = R/2 of the balls, R on the floor."""
    bed = bed_of(BASE, material=stuff(restitution=0.3, friction=0.5))
    master = ball_on(bed, x=0.03, z=2.99 * RADIUS)
    body = master.body
    body.begin_placement(0.01)
    for _ in range(1500):
        master.step()
    weight = body.trial.weight
    grain = MASS * 9.81

    def overlap(force, radius, young):
        return (0.75 * force / (young * math.sqrt(radius))) ** (2 / 3)

    plane = YOUNG / (1 - POISSON**2)
    expected = 3 * RADIUS - overlap(weight, RADIUS / 2, plane / 2) - overlap(weight + grain, RADIUS, plane)
    sunk = 3 * RADIUS - expected
    assert float(master.wrench.force[2]) == pytest.approx(weight, rel=1e-3)
    assert float(body.place[1]) == pytest.approx(expected, abs=2e-3 * sunk)


# A small platform on a layer of large grains --------------------------------------------------------------------------


def layer(*, restitution=0.3):
    """Grains of 6 mm in two layers, at rest but for what they still have to sink."""
    d = 6e-3
    rows, columns = 20, 6
    low = [((i + 0.5) * d, (j + 0.5) * d, 0.5 * d) for i in range(rows) for j in range(columns)]
    high = [((i + 1.0) * d, (j + 1.0) * d, 0.5 * d + d * math.sqrt(0.5)) for i in range(rows) for j in range(columns)]
    bed = Bed.from_grains(
        stuff(restitution=restitution, friction=0.5), positions=np.array(low + high),
        radii=np.full(2 * rows * columns, 0.5 * d), size=(rows * d, columns * d, 0.03), height=0.3, max_overlap=0.1,
        threads=1,
    )  # fmt: skip
    bed.advance(1500)
    bed.surface = float((bed.grains().position[:, 2] + 0.5 * d).max())
    return bed


SMALL = {
    "mass": 0.3, "inertia": 2e-4, "spike_length": 0.04, "wheel_inertia": 1e-5, "mu_s": 0.5, "counterweight": 0.28,
    "gravity_sim": 0.3,
}  # fmt: skip


def small(bed, *, torque=0.0, start=0.06, duration=0.05, substeps=8, **options):
    trial = Trial(**SMALL, torque=torque)
    members = platform_members(spike_length=0.04, count=8, diameter=8e-3, clear=0.015, hull_radius=0.02, width=0.036)
    footing = BedGround(bed, members, origin=(start, 0.018), copies=2.0, touch=1e-3 * trial.weight, friction=0.5)
    return CoupledTumble(
        trial, footing, duration=duration, substeps=substeps, tip_radius=4e-3,
        **({"lowering_speed": 0.04, "energy_interval": 0.01} | options),
    )  # fmt: skip


@pytest.mark.slow
def test_a_platform_set_down_on_grains_carries_its_weight_and_stays():
    run = small(layer(), duration=0.06)
    found = run.run()
    assert set(run.states[10:]) == {"stand"}
    assert run.feet[:, 0].sum(axis=1)[5:].mean() == pytest.approx(run.trial.weight, rel=0.01)
    assert np.hypot(np.ptp(found.x), np.ptp(found.y)) < 2e-6 and np.ptp(found.theta) < 2e-4
    assert found.energy_residual < 1e-6


@pytest.mark.long
def test_a_tumble_on_grains_closes_its_books_and_goes_on_from_a_checkpoint_to_the_same_bits(tmp_path):
    """A torque well above the least that tips (W l sin(pi / 8)); the grains' momentum and the body's to round-off."""
    torque = 4 * 0.58 * 0.3 * 0.04 * math.sin(math.pi / 8)
    bed = layer()
    kept = bed.state()
    run = small(bed, torque=torque, duration=0.1)
    while run.time < 0.04 or not run.placed:
        run.advance()
    np.savez(tmp_path / "state.npz", **run.state())
    found = run.run()
    assert found.theta[-1] > 0.05 and np.ptp(found.theta) > 0.05 and set(run.states) & {"pivot", "slip"}
    assert found.energy_residual < 1e-5
    lost = run.losses
    assert all(lost[name][-1] > 0.1 * run.dissipated[-1] for name in ("damping", "friction"))
    assert np.abs(run.balance_gap).max() < 0.01 * run.dissipated[-1]
    assert (np.diff(found.dissipated).min()) > -0.01 * found.torque_work[-1]
    assert run.dissipation_reversal < 0.01 * MOST_REVERSAL
    assert run.samples["momentum_error"].max() < 1e-12
    wheel = run.trial.wheel_inertia * run.body.wheel_speed
    assert run.samples["angular_momentum_error"].max() < 1e-5 * wheel
    bed.restore(kept)
    other = small(bed, torque=torque, duration=0.1)
    with np.load(tmp_path / "state.npz") as state:
        other.restore(dict(state))
    again = other.run()
    for name in ("x", "y", "theta", "omega", "stored_energy", "dissipated", "state", "energy_residual"):
        assert np.array_equal(getattr(found, name), getattr(again, name)), name
    assert np.array_equal(run.losses["friction"], other.losses["friction"])


@pytest.mark.long
def test_the_residual_of_the_exchange_with_grains_falls_as_the_square_of_the_macro_step():
    """A tumble over the layer, from where the hand lets go: 16 of the bed's steps in one against 4."""
    torque = 4 * 0.58 * 0.3 * 0.04 * math.sin(math.pi / 8)
    bed = layer()
    kept, gaps = bed.state(), []
    for substeps in (16, 4):
        bed.restore(kept)
        run = small(bed, torque=torque, duration=0.06, substeps=substeps)
        found = run.run()
        assert found.energy_residual < 1e-4
        gaps.append(abs(run.master.exchange.given - run.master.exchange.taken))
    assert math.log(gaps[0] / gaps[1], 4) > 1.5


def test_a_start_in_overlap_is_refused_with_the_height_that_would_do():
    bed = layer()
    kept = bed.state()
    with pytest.raises(
        ValueError, match=r"height of 0.036 m, starts in overlap with a grain: spike [07] by .* m higher"
    ) as refused:
        small(bed, height=0.036)
    bed.restore(kept)  # without the bodies of the one that was refused
    small(bed, height=0.036 + float(str(refused.value).split("start it ")[1].split(" m ")[0]))


def test_a_platform_that_comes_down_beyond_the_bed_says_so():
    """Put so near the end that the leading spike stands beyond it."""
    run = small(layer(), start=0.108)
    with pytest.raises(LeftTheBedError, match=r"spike 7 came down .* m ahead of the bed, which is 0.12 m long"):
        run.run()
    assert "master.count" in run.state()


@pytest.mark.long
def test_the_spring_in_the_books_is_the_one_felt_all_over_a_spike_and_no_grain_gets_behind_its_shaft():
    """One grain at a time on the ball, the shaft, its flat upper end and that end's edge; lossless, so force = spring.

    Under a hull the shaft's upper end lies within it.
    """
    clear, radius, deep = 0.015, 4e-3, 2e-5
    rod = platform_members(spike_length=0.04, count=8, diameter=2 * radius, clear=clear)[0]
    rod = replace(rod, at=np.zeros(3), turn=NO_TURN)
    up, reach, edge = clear - radius, RADIUS - deep, math.sqrt(0.5)
    places = {
        "ball": (edge * (radius + reach), -edge * (radius + reach)), "shaft": (radius + reach, 0.5 * up),
        "end": (0.5 * radius, up + reach), "edge": (radius + edge * reach, up + edge * reach),
    }  # fmt: skip
    for where, (aside, high) in places.items():
        bed = bed_of([(0.03 + aside, 0.03, 0.05 + high)], gravity=0.0)
        bed.surface = 0.05
        away = SIZE[0] if where == "end" else 0.0  # the bed is periodic, and so one place is another
        footing = BedGround(bed, [rod], origin=(0.03 + away, 0.03), begin=away, young=YOUNG, poisson=POISSON)
        pose = Pose(np.zeros(3), NO_TURN)
        felt = footing.step(pose.position, np.zeros(3), bed.time_step, turn=pose.turn).force
        pushes = footing.pushes()[1]
        assert np.linalg.norm(felt) > 1e-3
        assert pushes.sum(axis=0) == pytest.approx(felt, rel=1e-3, abs=1e-9), where
        held = footing.energies()["normal"]
        assert held == pytest.approx(0.4 * deep * np.linalg.norm(felt), rel=1e-2), where
    *spikes, hull = platform_members(
        spike_length=0.2, count=8, diameter=0.012, clear=0.04, hull_radius=0.14, width=0.036
    )
    for spike in spikes:
        end = np.linalg.norm(spike.at) - spike.length  # from the axis, on the spike's own line
        assert math.hypot(end, spike.radius) < hull.radius


def test_members_that_share_a_body_of_the_bed_lie_opposite():
    members = platform_members(spike_length=0.2, count=8, diameter=0.012, clear=0.04)
    for member in members:
        other = members[(member.row + 4) % 8]
        assert member.slot == other.slot
        assert member.at == pytest.approx(-other.at)
    # The lowest point of row 7 leads, that of row 0 trails; both r below the end of the rod.
    assert members[7].at[0] > 0 > members[0].at[0]
    with pytest.raises(ValueError, match="spike_diameter"):
        platform_members(spike_length=0.2, count=8, diameter=0.05, clear=0.04)


def test_a_step_must_be_a_whole_number_of_the_beds():
    bed = bed_of(BASE)
    bed.surface = 0.0
    footing = BedGround(bed, [ball_member(RADIUS)], origin=(0.03, 0.03))
    pose = Pose(np.array([0.0, 0.0, 0.05]), NO_TURN)
    with pytest.raises(ValueError, match="whole multiple"):
        footing.step(pose.position, np.zeros(3), 1.5 * bed.time_step)
    free = footing.step(pose.position, np.zeros(3), 2 * bed.time_step)
    assert not free.contacts and not free.force.any() and not free.torque.any()
