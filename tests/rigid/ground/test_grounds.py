"""The spring-damper, F = K z + C max(0, dz/dt) for z > 0 and 0 above, and every other law as a ground."""

import numpy as np
import pytest

from coupling import drive, drop, set_down
from coupling.ground import Ground
from rigid import Spike, SpringDamper, SurfaceGround
from rigid.ground.laws import GROUNDS, find_law
from rigid.ground.rft import flat_plate, sideways_capacity, stress_gradient, tractions

GROUND = SpringDamper(stiffness=200.0, damping=3.0)


@pytest.mark.parametrize("seed", range(30))
def test_the_mean_over_a_step_is_the_exact_impulse(seed):
    start, sinking, dt = np.random.default_rng(seed).uniform((-0.02, -1.0, 1e-5), (0.02, 1.0, 0.05))
    share = (np.arange(20000) + 0.5) / 20000
    expected = GROUND.force(start + sinking * dt * share, np.full(20000, sinking)).mean()
    reaction = GROUND.step((0.0, 0.0, -start), (0.0, 0.0, -sinking), dt)
    assert reaction.force[2] == pytest.approx(expected, abs=1e-3)
    assert reaction.force[2] >= 0


def test_the_spring_gives_back_what_it_took():
    """Work along the way is K z^2 / 2 up or down, whatever the step."""
    ground = SpringDamper(stiffness=200.0)
    work = sum(ground.step((0, 0, -0.001 * k), (0, 0, -0.1), 0.01).force[2] * 0.001 for k in range(10))
    assert work == pytest.approx(0.5 * 200.0 * 0.01**2, rel=1e-12)


def test_contact_carries_the_coulomb_bound():
    (contact,) = GROUND.step((0.1, 0.2, -0.01), (0, 0, 0), 1e-3).contacts
    assert contact.normal_force == pytest.approx(2.0)
    assert (contact.mu_s, contact.mu_d, contact.tangential_force) == (0.5, 0.25, None)
    assert GROUND.step((0, 0, 0.01), (0, 0, 0), 1e-3).contacts == ()


@pytest.mark.parametrize("given_", [{"stiffness": -1.0}, {"stiffness": 1.0, "damping": -1.0},
                                    {"stiffness": 1.0, "mu_d": 0.9}, {"stiffness": 1.0, "time_step": 0.0}])  # fmt: skip
def test_a_law_that_cannot_be_is_refused_by_name(given_):
    with pytest.raises(ValueError, match=list(given_)[-1]):
        SpringDamper(**given_)


# Every law as a ground ------------------------------------------------------------------------------------------------

ALL = pytest.mark.parametrize("law", GROUNDS)
SPIKE = Spike()
SOFT = {
    "spring-damper": {"stiffness": 300.0, "damping": 3.0},
    "hunt-crossley": {"stiffness": 3000.0},
    "power": {"stiffness": 3000.0, "damping": 3.0},
}


def quadrature(ground, start, rate, dt, count=20001):
    """Mean force along the path, sample by sample, with the memory kept as it goes."""
    law, p, kept = ground._law, ground._numbers, {"rebound": ground._rebound, "loss": ground._loss}
    top, total = ground.deepest, 0.0
    depths = start + rate * dt * (np.arange(count) + 0.5) / count
    top = max(top, start) if law.has_memory else top
    for z in depths:
        top = max(top, z)
        total += law.force(z, rate, p, top=top, **kept)
    return total / count


@ALL
@pytest.mark.parametrize("seed", range(8))
def test_the_mean_over_a_step_of_any_law_is_the_exact_impulse(law, seed):
    random = np.random.default_rng(seed)
    lossy = GROUNDS[law].has_memory and seed % 2
    ground = SurfaceGround(law=law, parameters={"loss": 0.8, "loss_speed": 0.2} if lossy else {})
    if random.random() < 0.7:  # a past
        ground.step((0, 0, 0), (0, 0, -1.0), random.uniform(0.001, 0.012))
    start, rate, dt = random.uniform((-0.004, -1.0, 1e-5), (0.012, 1.0, 0.02))
    expected = quadrature(ground, start, rate, dt)
    force = ground.step((0, 0, -start), (0, 0, -rate), dt).force[2]
    assert force == pytest.approx(expected, rel=2e-3, abs=1e-6)


@ALL
def test_a_cycle_loses_what_is_not_stored_whatever_the_step(law):
    """Work of one way in and back out: in long steps and in short ones the same."""
    works = []
    for count in (1, 7, 500):
        ground, work, dt = SurfaceGround(law=law), 0.0, 0.01 / 0.1 / count
        for rate in (0.1, -0.1):
            for k in range(count):
                depth = 0.1 * dt * k if rate > 0 else 0.01 - 0.1 * dt * k
                work += ground.step((0, 0, -depth), (0, 0, -rate), dt).force[2] * rate * dt
        works.append(work)
        assert work >= -1e-12
    assert works[1:] == pytest.approx(works[:1] * 2, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("law", [name for name in GROUNDS if GROUNDS[name].has_memory])
@pytest.mark.parametrize("speed", [0.01, 0.1, 1.0])
def test_a_cycle_in_the_crater_loses_its_share_of_the_work(law, speed):
    """Up and down below the deepest depth at u: loss u / (u + loss_speed) of what loading again takes."""
    ground = SurfaceGround(law=law, parameters={"loss": 0.9, "loss_speed": 0.1, "rebound": 0.1})
    ground.step((0, 0, 0), (0, 0, -1e-9), 0.01 / 1e-9)
    height, works = 6e-4, []  # Within the 1 mm over which it springs back
    for start, rate in ((0.01, -speed), (0.01 - height, speed)):
        works.append(ground.step((0, 0, -start), (0, 0, -rate), height / speed).force[2] * rate * height / speed)
    inertia = ground._law.rate_work(0.01, speed, ground._numbers)
    inertia -= ground._law.rate_work(0.01 - height, speed, ground._numbers)
    assert sum(works) - inertia == pytest.approx((works[1] - inertia) * 0.9 * speed / (speed + 0.1), rel=1e-9)


@ALL
def test_a_short_step_loses_no_digits(law):
    """The mean over 1e-12 s is the force there, to 1e-9."""
    ground = SurfaceGround(law=law)
    force = ground.step((0, 0, -0.005), (0, 0, -0.1), 1e-12).force[2]
    assert force == pytest.approx(float(ground.force(0.005, 0.1)), rel=1e-9)


@ALL
def test_a_spike_is_driven_dropped_and_set_down_on_any_law(law):
    ground = SurfaceGround(law=law, time_step=1e-5)
    assert isinstance(ground, Ground)
    driven = drive(SPIKE, into=ground, speed=0.1, depth=0.01)
    assert driven.ended == "done"
    assert (driven.force >= 0).all() and driven.force.max() > 0
    dropped = drop(SPIKE, into=SurfaceGround(law=law, time_step=1e-5), speed=0.05, mass=0.1, load=0.2, max_time=0.3)
    inside = dropped.depth > 0
    lost = 0.5 * 0.1 * 0.05**2 + 0.2 * dropped.depth[inside].max()
    assert (dropped.force[inside] * dropped.velocity[inside]).cumsum().max() * dropped.macro_step <= lost * 1.02
    # Soft enough that a spike set down cannot overshoot (overdamped_below): then the law alone carries the load.
    onto = SurfaceGround(law=law, parameters=SOFT.get(law, {}), time_step=2e-5)
    down = set_down(SPIKE, onto=onto, load=0.2, lowering_speed=0.05, max_time=3.0)
    assert down.ended == "rest"
    resting = float(onto.force(down.depth[down.phase == "rest"], 0.0).mean())
    assert resting == pytest.approx(0.2, rel=0.01)


@ALL
def test_a_ground_taken_up_again_gives_the_same_bits(law):
    def walk(ground, path):
        return [ground.step((0, 0, -z), (0, 0, -rate), 1e-3).force[2] for z, rate in path]

    path = [(0.001 * k, 1.0) for k in range(8)] + [(0.008 - 0.0001 * k, -0.1) for k in range(9)]
    first, second = SurfaceGround(law=law), SurfaceGround(law=law)
    walk(first, path[:11])
    second.restore(first.state())
    assert walk(second, path[11:]) == walk(first, path[11:])


def test_grains_forget_once_the_body_has_left():
    ground = SurfaceGround(law="rft")
    ground.step((0, 0, 0), (0, 0, -0.1), 0.1)
    assert ground.deepest == pytest.approx(0.01)
    ground.step((0, 0, -0.01), (0, 0, 0.1), 0.11)
    assert ground.deepest == 0.0


def test_a_law_ground_that_cannot_be_is_refused_by_name():
    with pytest.raises(ValueError, match="clay"):
        SurfaceGround(law="clay")
    with pytest.raises(ValueError, match="exponent"):
        SurfaceGround(law="power", parameters={"exponent": 9.0})
    with pytest.raises(ValueError, match="mu_d"):
        SurfaceGround(law="power", mu_s=0.2, mu_d=0.3)


# 3D-RFT ---------------------------------------------------------------------------------------------------------------


def test_a_flat_plate_going_down_bears_what_the_paper_states():
    """0.876 xi_n depth area, Agarwal et al. 2023, to its last digit."""
    assert flat_plate() == pytest.approx(0.876, abs=0.0005)


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.4, 1.0])
def test_the_rft_law_is_the_surface_integral_of_the_tractions(friction):
    """Against rings of ball and shaft summed one by one; the law's polynomial is good to 0.3 %."""
    radius, gradient = 0.006, stress_gradient(bulk_density=1500.0, friction=0.6, gravity=9.80665)
    law = find_law("rft")
    p = law.numbers({"surface_friction": friction, "radius": radius})
    u = (np.arange(4000) + 0.5) / 4000  # height on the ball over its radius; a ring's area is 2 pi R^2 du
    normals = np.stack([np.sqrt(u * (2 - u)), 0 * u, u - 1], axis=1)
    up = tractions(normals, (0, 0, -1.0), surface_friction=friction)[:, 2]
    wall = tractions([[1.0, 0, 0]], (0, 0, -1.0), surface_friction=friction)[0, 2]
    for depth in (0.001, 0.003, 0.006, 0.012, 0.03):
        ball = (up * np.maximum(depth - radius * u, 0.0)).mean() * 2 * np.pi * radius**2
        shaft = wall * 2 * np.pi * radius * 0.5 * max(depth - radius, 0.0) ** 2
        assert law.force(depth, 0.0, p) == pytest.approx(gradient * (ball + shaft), rel=3e-3)


def test_the_inertia_of_the_grains_is_half_a_discs_for_a_ball():
    """lambda rho v^2 over a lower half: the integral of cos^3 over the ball is pi R^2 / 2, of a disc pi R^2."""
    law = find_law("rft")
    p = law.numbers({"radius": 0.01, "bulk_density": 1600.0, "inertia": 1.1})
    expected = 1.1 * 1600.0 * 0.5**2 * np.pi * 0.01**2 / 2
    assert float(law.rate_force(0.02, 0.5, p)) == pytest.approx(expected, rel=1e-12)


def test_sideways_the_grains_oppose_the_motion_and_more_with_depth():
    grains = {"radius": 0.006, "bulk_density": 1500.0, "friction": 0.6, "surface_friction": 0.4, "gravity": 9.81}
    coarse, fine = (sideways_capacity(0.012, **grains, count=count) for count in (48, 192))
    assert coarse == pytest.approx(fine, rel=2e-3)
    assert fine > 0
    assert sideways_capacity(0.0, **grains) == 0.0
    # Far below the ball the shaft rules: a wall's capacity grows with the square of the depth.
    deep = [sideways_capacity(z, **grains) for z in (0.6, 1.2)]
    assert deep[1] / deep[0] == pytest.approx(4.0, rel=0.05)


def test_a_checkpoint_is_that_of_a_subclass_with_a_state_of_its_own():
    class Counting(SurfaceGround):
        def state(self):
            return super().state() | {"count": 7}

    assert Counting(law="power").checkpoint() == {"count": 7}
    assert GROUNDS["power"].rebound({}) is None and GROUNDS["rft"].rebound({"rebound": 0.1}) == 0.1
