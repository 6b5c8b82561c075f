"""Our bed with single terms of LAMMPS' contact law: which of them changes the force on the spike of `push.py`.

    python docs/results/lammps-push/terms.py --terms rolling-spring --out rolling-spring.csv

`--terms` may name several of:

    sliding         spring and dashpot of friction together are held at mu F_n; where they slide, the spring is the rest
    rolling         the same rule for rolling
    rolling-spring  spring and dashpot of rolling are those of one contact, of overlap `--overlap` (coupling.lammps.law)
    twisting        its bound is 2/3 mu a F_n, its dashpot half of friction's times a^2

Without a name it is our own law. The rules are those of LAMMPS' manual (pair_style granular). Here for sand alone:
rescaled springs, no cohesion, no pull. Bed and spike are those of `push.py --size 0.06 0.12 0.05 --copies 7`.
"""

import argparse
from pathlib import Path
from typing import Any

import push

import dem.engine.pairs
import dem.engine.steps
from coupling.lammps.law import OVERLAP
from dem import Bed
from dem.contact import law
from dem.contact.law import bounded
from hedgebed_taichi import ti

TERMS = ("sliding", "rolling", "rolling-spring", "twisting")
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--terms", nargs="*", choices=TERMS, default=(), help="those of LAMMPS")
parser.add_argument("--overlap", type=float, default=OVERLAP, help="of the contact that rolling-spring takes [d]")
parser.add_argument("--seeds", type=int, nargs="+", default=(1, 2, 3, 4, 5), help="of the beds")
parser.add_argument("--parts", type=int, default=40, help="means of the force, each over 10 steps")
parser.add_argument("--out", type=Path, required=True, help="a CSV of the forces for each seed: OUT-SEED.csv")
Template: Any = ti.template()
SIZE = ("0.06", "0.12", "0.05")


@ti.func
def held_together(stiffness, damping, stretch, rate, bound):
    """Force of spring and dashpot, held at a bound together, and the stretch of the spring that is left."""
    force = -stiffness * stretch - damping * rate
    square = force.norm_sqr()
    slides = square > bound * bound
    force *= ti.select(slides, bound / ti.sqrt(square), bound * 0.0 + 1.0)
    return force, ti.select(slides, -(force + damping * rate) / stiffness, stretch)


@ti.func
def held_apart(stiffness, damping, stretch, rate, bound):
    """The same of our law: the spring alone is held, and the dashpot acts while it sticks."""
    force, share = bounded(stiffness, damping, stretch, rate, bound)
    return force, share * stretch


def patch(terms: tuple[str, ...], radius: float, mass: float) -> None:
    """Put these terms in place of ours. ``radius`` [m], ``mass`` [kg]: of the contact whose rolling spring all have."""
    alike, constant, marshall = "rolling" in terms, "rolling-spring" in terms, "twisting" in terms
    slide = held_together if "sliding" in terms else held_apart
    roll_on = held_together if alike else held_apart
    two_e, eight_g, damp, mu, mu_r, damp_t, damp_r = range(7)

    @ti.func
    def contact_force(
        p: Template, n, v_n, v_t, overlap, r, m, onset, dt, u: Template, tensile: Template, cohesion: Template,
        rescaled: Template, closed, middle, angle,
    ):  # fmt: skip
        a = ti.sqrt(r * ti.max(overlap, 0.0))
        s_n = p[two_e] * a
        root = ti.sqrt(m * s_n)
        spring = (2.0 / 3.0) * s_n * overlap
        c_n = p[damp] * root * onset
        past = ti.select(u.w == 0.0 or dt == 0.0, 0.5 * m * v_n, u.w)
        f_n = ti.max((m * spring - c_n * (1.5 * m * v_n - past)) / (m + 0.5 * dt * c_n), 0.0)
        before = ti.max(overlap - ti.max(closed, 0.0), 0.0)
        grown = (overlap + 3.0 * before) / (3.0 * overlap + before)
        half = (0.5 * dt) * v_t
        stretch = u.xyz + half
        across = stretch - stretch.dot(n) * middle
        stretch = grown * ((1.0 - 0.5 * angle * angle) * across + angle * n.cross(stretch)) + half
        k_t = p[eight_g] * a
        f_t, left = slide(k_t, p[damp_t] * root, stretch, v_t, p[mu] * f_n)
        if dt > 0.0:
            u.xyz = left
            u.w = 0.5 * (m * v_n + dt * f_n)
        return f_n, f_n - spring, f_t, k_t, a, root, f_n, grown

    @ti.func
    def turning_torque(
        p: Template, n, spin, load, k_t, a, r, root, dt, q: Template, rescaled: Template, grown, middle, angle
    ):
        spin_n = spin.dot(n)
        turned = q + (0.5 * dt) * spin
        across = (4.0 - 2.0 * middle.norm_sqr()) * turned.dot(middle)
        twist = across - turned.dot(n)
        turned -= across * middle
        k_r, c_r, rescaling = k_t, p[damp_r] * root, grown
        if ti.static(constant):
            k_r, c_r = p[eight_g] * radius, p[damp_r] * ti.sqrt(mass * p[two_e] * radius)
            rescaling = grown * 0.0 + 1.0
        roll = rescaling * ((1.0 - 0.5 * angle * angle) * (turned + twist * n) + angle * n.cross(turned))
        roll += (0.5 * dt) * (spin - spin_n * n)
        torque, left = roll_on(k_r * r * r, c_r * r * r, roll, spin - spin_n * n, p[mu_r] * r * load)
        k_w = 0.5 * k_t * a * a
        m_n, of_n = k_w * 0.0, twist
        if ti.static(marshall):
            of_n += (0.5 * dt) * spin_n
            c_w, bound = 0.5 * p[damp_t] * root * a * a, (2.0 / 3.0) * p[mu] * a * load
            m_n = -k_w * of_n - c_w * spin_n
            sense = ti.select(spin_n > 0.0, 1.0, -1.0)
            slides = ti.abs(m_n) > bound
            of_n = ti.select(slides, (bound * sense - c_w * spin_n) / k_w, of_n)
            m_n = ti.select(slides, -bound * sense, m_n)
        else:
            of_n = grown * grown * grown * twist + (0.5 * dt) * spin_n
            c_w = 0.7071067811865476 * p[damp_r] * root * r * a
            bound = 0.1875 * ti.math.pi * p[mu] * a * load
            m_n = -k_w * of_n
            slides = ti.abs(m_n) > bound
            most = ti.select(m_n > 0.0, bound, -bound)
            m_n = ti.select(slides, most, ti.min(bound, ti.max(-bound, m_n - c_w * spin_n)))
            of_n = ti.select(slides, -most / k_w, of_n)
        if dt > 0.0:
            q = left + of_n * n
        return torque + m_n * n

    assert law.PAIR_WIDTH == 8, "the order of the pair parameters is another one by now"
    for module in (dem.engine.pairs, dem.engine.steps):
        module.contact_force, module.turning_torque = contact_force, turning_torque


def main() -> None:
    asked = parser.parse_args()
    given = push.parser.parse_args(["--size", *SIZE, "--copies", "7", "--parts", str(asked.parts)])
    given.ranks = ()
    for seed in asked.seeds:
        grains = Bed.prepare(
            "sand", size=tuple(given.size), grain=given.grain, gravity=9.81, seed=seed, threads=1
        ).grains()
        if asked.terms and seed == asked.seeds[0]:
            patch(asked.terms, float(grains.radius.mean()) * asked.overlap**0.5, 0.5 * float(grains.mass.mean()))
        columns, time_step = push.push_all(given, seed)
        push.written(asked.out.with_stem(f"{asked.out.stem}-{seed}"), given, columns, time_step)


if __name__ == "__main__":
    main()
