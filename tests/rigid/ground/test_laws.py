"""The surface laws against their closed forms: force, work, what is stored, what is lost; in Python and in Taichi."""

import ast
import inspect
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from rigid.ground import law_functions
from rigid.ground.laws import FOOT_LAWS, GROUNDS, find_law, katsuragi_durian

ALL = pytest.mark.parametrize("law", [*GROUNDS.values(), *FOOT_LAWS.values()], ids=lambda law: law.name)
DEPTHS = [1e-5, 3e-4, 2e-3, 0.0059, 0.0061, 0.02]


@pytest.mark.parametrize(
    ("name", "given_", "depth", "rate", "expected"),
    [
        ("spring-damper", {"stiffness": 200.0, "damping": 3.0}, 0.01, 0.5, 200 * 0.01 + 3 * 0.5),
        ("spring-damper", {"stiffness": 200.0, "damping": 3.0}, 0.01, -0.5, 200 * 0.01),
        ("hunt-crossley", {"stiffness": 1e5, "dissipation": 0.3}, 0.004, 0.5, 1e5 * 0.004**1.5 * (1 + 1.5 * 0.3 * 0.5)),
        ("hunt-crossley", {"stiffness": 1e5, "dissipation": 0.3}, 0.004, -5.0, 0.0),
        ("power", {"stiffness": 1e4, "damping": 2.0, "exponent": 1.2}, 0.01, 0.1, 1e4 * 0.01**1.2 + 0.2),
        ("katsuragi-durian", {"stiffness": 30.0, "drag": 0.4}, 0.02, 0.5, 30 * 0.02 + 0.4 * 0.25),
        # A flat end of 20 cm2 on dry sand: Bekker's (k_c / b + k_phi) A z^n.
        ("bekker", {"radius": 0.025, "tip_height": 0.0, "cohesive_modulus": 990.0, "frictional_modulus": 1.528e6,
                    "exponent": 1.1}, 0.01, 0.0, math.pi * 0.025**2 * (990 / 0.025 + 1.528e6) * 0.01**1.1),
        # A ball's section below its equator is pi (2 R z - z^2).
        ("bekker", {"radius": 0.006, "tip_height": 0.006, "cohesive_modulus": 0.0, "frictional_modulus": 1e6,
                    "exponent": 1.0}, 0.003, 0.0, math.pi * (2 * 0.006 * 0.003 - 0.003**2) * 1e6 * 0.003),
    ],
)  # fmt: skip
def test_a_force_is_that_of_the_closed_form(name, given_, depth, rate, expected):
    law = find_law(name)
    assert law.force(depth, rate, law.numbers(given_)) == pytest.approx(expected, rel=1e-12)


@ALL
def test_no_force_above_the_surface_and_none_without_depth(law):
    p = law.numbers({})
    for depth in (-0.01, -1e-12, 0.0):
        assert law.force(depth, 0.3, p) == 0.0
        assert law.stored(depth, p) == 0.0
        assert float(law.rate_force(depth, 0.3, p)) == 0.0


@ALL
@pytest.mark.parametrize("depth", DEPTHS)
def test_work_is_the_integral_of_force(law, depth):
    p = law.numbers({})
    bends = [p[k] for k in law.bends if 0 < p[k] < depth]
    for rate in (-0.7, -0.01, 0.0, 0.02, 0.5):
        for force, work in (
            (lambda z: law.loading(z, p), law.loading_work(depth, p)),
            (lambda z, rate=rate: law.rate_force(z, rate, p), law.rate_work(depth, rate, p)),
        ):
            expected, _ = quad(force, 0, depth, points=bends or None, epsabs=0, epsrel=1e-10, limit=200)
            assert float(work) == pytest.approx(expected, rel=1e-8, abs=1e-16)


@ALL
@settings(max_examples=60, deadline=None)
@given(
    depth=st.floats(1e-6, 0.03), more=st.floats(0, 0.01), rate=st.floats(-2, 2), rebound=st.floats(0.01, 0.5),
    loss=st.floats(0, 1), loss_speed=st.floats(1e-6, 1),
)  # fmt: skip
def test_force_never_pulls_and_never_gives_more_than_was_stored(law, depth, more, rate, rebound, loss, loss_speed):
    """F >= 0, and F dz/dt >= d(stored)/dt, whatever the history."""
    p, top = law.numbers({}), depth + more
    lost = {"loss": (loss, loss_speed)} if law.has_memory else {}
    force = law.force(depth, rate, p, top=top, rebound=rebound, **lost)
    assert force >= 0.0
    step = 1e-7 * depth
    if law.has_memory and rate > 0 and depth >= top - step:  # the deepest depth goes along
        change = law.stored(depth + step, p, rebound=rebound) - law.stored(depth - step, p, rebound=rebound)
    else:
        kept = {"top": top + step, "rebound": rebound}
        force = law.force(depth, rate, p, **kept, **lost)
        change = law.stored(depth + step, p, **kept) - law.stored(depth - step, p, **kept)
    # By the sign of the rate alone: products with a rate of 1e-308 m/s say nothing about the law.
    way, scale = math.copysign(1.0, rate) if rate else 0.0, max(force, law.loading(top, p) / rebound)
    assert force * way >= change / (2 * step) * way - 1e-5 * scale * abs(way)


@ALL
def test_a_laws_force_is_in_proportion_to_the_spikes_side_by_side(law):
    one, two = law.numbers({}), law.numbers({}, count=2)
    for depth, rate in ((0.002, 0.3), (0.012, -0.2), (0.012, 0.0)):
        top = depth * 1.01
        single = law.force(depth, rate, one, top=top, rebound=0.1)
        assert law.force(depth, rate, two, top=top, rebound=0.1) == pytest.approx(2 * single, rel=1e-12)


def test_grains_give_back_the_share_that_rebounds():
    """A linear law driven to z and pulled out: k z^2 / 2 goes in, the share `rebound` of it comes back."""
    law = find_law("katsuragi-durian")
    p, top, rebound = law.numbers({"stiffness": 100.0, "drag": 0.0}), 0.01, 0.2
    out, _ = quad(lambda z: law.force(z, -0.1, p, top=top, rebound=rebound), 0, top, points=[top * (1 - rebound)])
    assert out == pytest.approx(rebound * 0.5 * 100 * top**2, rel=1e-9)
    assert law.stored(top, p, rebound=rebound) == pytest.approx(out, rel=1e-9)
    assert law.force(top * (1 - rebound), -0.1, p, top=top, rebound=rebound) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("law", [law for law in [*GROUNDS.values(), *FOOT_LAWS.values()] if law.has_memory],
                         ids=lambda law: law.name)  # fmt: skip
def test_without_loss_a_law_has_the_same_bits_and_with_it_retreats_with_less_force(law):
    """F (1 - loss u / (u + loss_speed)) at the speed of retreat u; loading and rest are as without."""
    p, kept = law.numbers({}), {"top": 0.01, "rebound": 0.05}
    for rate in (-0.7, -1e-3, 0.0, 0.4):
        plain = law.force(0.0097, rate, p, **kept)
        assert law.force(0.0097, rate, p, **kept, loss=(0.0, 0.1)) == plain > 0.0
        left = 1 - 0.8 * max(-rate, 0.0) / (max(-rate, 0.0) + 0.1)
        assert law.force(0.0097, rate, p, **kept, loss=(0.8, 0.1)) == pytest.approx(left * plain, rel=1e-12)


def test_hunt_crossley_restitution_falls_as_one_less_alpha_v():
    """e = 1 - alpha v for small alpha v, whatever mass and stiffness: m z'' = -F from z = 0 at v."""
    law, alpha, mass = find_law("hunt-crossley"), 0.2, 0.5
    p = law.numbers({"stiffness": 1e5, "dissipation": alpha})
    for speed in (0.05, 0.1, 0.2):
        # dv/dz = -F / (m v) has x^2 = v^2 as function of the stored energy: integrate in time, small steps.
        z, v, dt = 0.0, speed, 2e-6
        while z >= 0.0:
            v -= 0.5 * dt * law.force(z, v, p) / mass
            z += dt * v
            v -= 0.5 * dt * law.force(z, v, p) / mass
        lost = 1 + v / speed
        assert lost == pytest.approx(alpha * speed, rel=2.0 * alpha * speed + 0.01)


def test_katsuragi_durian_scales_as_the_paper_says():
    """Friction as the root of both densities; inertia as that of the grains alone, and as mu."""
    base = {"diameter": 0.025, "projectile_density": 7800.0, "bulk_density": 1500.0, "friction": 0.45, "gravity": 9.81}
    one = katsuragi_durian(**base)
    assert katsuragi_durian(**base | {"projectile_density": 4 * 7800})["stiffness"] == pytest.approx(
        2 * one["stiffness"]
    )
    assert katsuragi_durian(**base | {"bulk_density": 6000.0})["stiffness"] == pytest.approx(2 * one["stiffness"])
    assert katsuragi_durian(**base | {"projectile_density": 4 * 7800})["drag"] == pytest.approx(one["drag"])
    assert katsuragi_durian(**base | {"friction": 0.9})["drag"] == pytest.approx(2 * one["drag"])


# One source in Python and Taichi --------------------------------------------------------------------------------------


def test_the_functions_are_plain_enough_to_be_compiled():
    """No calls but max and min, no loops, one return each: what `ti.func` takes as it stands."""
    for name in law_functions.__all__:
        tree = ast.parse(inspect.getsource(getattr(law_functions, name)))
        assert sum(isinstance(node, ast.Return) for node in ast.walk(tree)) == 1, name
        for node in ast.walk(tree):
            assert not isinstance(node, ast.For | ast.While | ast.IfExp | ast.Tuple), name
            if isinstance(node, ast.Call):
                assert isinstance(node.func, ast.Name) and node.func.id in ("max", "min"), name


@ALL
def test_taichi_and_python_agree_on_the_same_source(law):
    from dem.engine import runtime
    from hedgebed_taichi import ti

    runtime.start(arch="cpu", threads=None, precision="float64")
    p = law.numbers({})
    loading, rate_force, springback = (ti.func(f) for f in (law.loading, law.rate_force, law_functions.springback))
    count, rebound, has_memory = len(p), 0.1, law.has_memory
    Numbers = ti.types.vector(count, ti.f64)
    rows = [
        (z, v, z * (1 + more)) for z in (-0.001, 0.0, *DEPTHS) for v in (-0.3, 0.0, 0.4) for more in (0.0, 0.03, 0.5)
    ]
    z, v, top = (np.array(column) for column in zip(*rows, strict=True))
    force = np.zeros(len(rows))

    @ti.kernel
    def fill(
        z: ti.types.ndarray(), v: ti.types.ndarray(), top: ti.types.ndarray(), force: ti.types.ndarray(), p: Numbers
    ):
        for i in range(z.shape[0]):
            deepest = z[i]
            if ti.static(has_memory):
                deepest = ti.max(top[i], z[i])
            force[i] = loading(deepest, p) * springback(z[i], deepest, rebound) + rate_force(z[i], v[i], p)

    fill(z, v, top, force, Numbers(p))
    expected = [law.force(*row[:2], p, top=row[2], rebound=rebound) for row in rows]
    assert force[z > 0] == pytest.approx(np.array(expected)[z > 0], rel=1e-12, abs=1e-14)
    assert not force[z <= 0].any()


# What cannot be -------------------------------------------------------------------------------------------------------


@ALL
def test_every_parameter_says_what_it_is_and_its_default_will_do(law):
    for parameter in law.parameters:
        assert parameter.unit and parameter.summary and parameter.source
        assert parameter.check(parameter.default, law.name) == parameter.default
    assert len(law.numbers({})) == len(law.slots)


@pytest.mark.parametrize(
    ("name", "given_"),
    [("spring-damper", {"stiffness": -1.0}), ("hunt-crossley", {"dissipation": -0.1}), ("power", {"exponent": 0.0}),
     ("katsuragi-durian", {"drag": math.nan}), ("bekker", {"radius": 0.0}), ("rft", {"friction": 1.5}),
     ("rft", {"rebound": 0.9}), ("bekker", {"stiffness": 3.0}), ("power", {"damping": "3"})],
)  # fmt: skip
def test_a_parameter_that_cannot_be_is_refused_by_name(name, given_):
    with pytest.raises(ValueError, match=next(iter(given_))):
        find_law(name).numbers(given_)


def test_a_law_there_is_not_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match=r"'clay'.*spring-damper.*rft"):
        find_law("clay")
