"""The same physics written plainly: every pair and every periodic image looked at, in numpy, with a dict of histories.

An oracle for the engine's lists, chunks, images and history, and for its arithmetic: it shares no code with it.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.optimize import brentq


class NaiveBed:
    """Grains in a box periodic in x and y, over a floor at z = 0, with at most one moving ball among them.

    ``ball``: dict of position, radius, velocity, spin. Damping factors are given, not computed.
    """

    def __init__(self, material, positions, radii, velocities, spins, period, gravity, dt, damping, ball=None):
        self.stuff, self.r, self.period, self.g, self.dt, self.damping = material, radii, period, gravity, dt, damping
        self.x, self.ball = positions.copy(), None
        self.m = material.density * 4 / 3 * math.pi * radii**3
        self.inertia = 0.4 * self.m * radii**2
        self.history: dict = {}
        self.v, self.w = velocities.copy(), spins.copy()
        self.push(0.0)
        self.v -= 0.5 * dt * self.f / self.m[:, None]
        self.w -= 0.5 * dt * self.t / self.inertia[:, None]
        if ball is not None:  # like a body that is added to a bed: forces anew, with the velocities half a step behind
            self.ball = ball | {"velocity": np.zeros(3), "spin": np.zeros(3)}
            self.push(0.0)
            self.ball = ball

    def contact(self, key, n, v_n, v_t, spin, overlap, radius, mass, rigid, dt):
        """Force, and turning torque, on the first of the pair; the law as ``dem.contact.law``'s docstring states it.

        ``v_n``, ``v_t``: how fast it moved away and slid half a step before.
        """
        s = self.stuff
        share = 1 if rigid else 2
        young = s.young / (1 - s.poisson**2) / share
        shear = s.young / (2 * (2 - s.poisson) * (1 + s.poisson)) / share
        a, spring, pull, more = attraction(s, young, radius, overlap)
        s_n, s_t = 2 * young * a, 8 * shear * a
        u, q, before = self.history.get(key, (np.zeros(3), np.zeros(3), None))
        damping = self.damping * math.sqrt(mass * s_n)
        new = before is None
        old_v, old_f = (v_n, 0.0) if new or dt == 0 else before
        if new and s.cohesion != "jkr" and overlap < -1.001 * v_n * dt:
            share = overlap / (-v_n * dt)
            damping *= (share + 0.5) ** 1.25 / 1.25 / share**0.25
        # The force that the velocity at its own time makes: F = spring - damping (v + half of the last change of v +
        # half a kick by what F is more than it was).
        rate = v_n + 0.5 * (v_n - old_v) - 0.5 * dt * old_f / mass
        normal = (spring - damping * rate) / (1 + 0.5 * dt * damping / mass)
        normal = max(-pull, normal)
        f_n = normal + more * pull  # what presses the surfaces together
        u = u - (u @ n) * n + v_t * dt
        u, f_t = capped(s_t, self.damping * math.sqrt(s_t / s_n) * math.sqrt(mass * s_n), u, v_t, s.friction * f_n)
        q = q + spin * dt
        inertia = 0.4 * mass * radius**2
        k = s_t * radius**2
        roll, rolling = capped(
            k, 0.6 * math.sqrt(inertia * k), q - (q @ n) * n, spin - (spin @ n) * n, s.rolling_friction * radius * f_n
        )
        k = s_t * a * a / 2
        bound = 3 * math.pi / 16 * s.friction * a * f_n
        twist, twisting = capped(k, 0.6 * math.sqrt(inertia * k), (q @ n) * n, (spin @ n) * n, bound)
        if dt > 0:
            before = (v_n, normal)
        self.new[key] = (u, roll + twist, before)
        return normal * n + f_t, rolling + twisting

    def reach(self, radius, rigid):
        """Where a JKR pair parts: d(a) = a^2 / R - sqrt(2 pi w a / E) is least at a^3 = pi w R^2 / 8 E."""
        s = self.stuff
        if s.cohesion != "jkr":
            return 0.0
        young = s.young / (1 - s.poisson**2) / (1 if rigid else 2)
        a = (math.pi * 2 * s.surface_energy * radius**2 / (8 * young)) ** (1 / 3)
        return 3 * a**2 / radius

    def push(self, dt):
        n = len(self.r)
        self.new = {}
        self.f = self.m[:, None] * self.g
        self.t = np.zeros((n, 3))
        for i, j in itertools.combinations(range(n), 2):
            for a, b in itertools.product((-1, 0, 1), repeat=2):
                d = self.x[i] - self.x[j] + [a * self.period[0], b * self.period[1], 0.0]
                length = np.linalg.norm(d)
                overlap = self.r[i] + self.r[j] - length
                if overlap > -self.reach(self.r[i] * self.r[j] / (self.r[i] + self.r[j]), False):
                    normal = d / length
                    arm_i, arm_j = self.r[i] - overlap / 2, self.r[j] - overlap / 2
                    v = self.v[i] - self.v[j]
                    middle, v_n, back = halfway(d, v, normal, dt)
                    arms = (arm_i - back / 2) * self.w[i] + (arm_j - back / 2) * self.w[j]
                    along = v - v_n * normal
                    v_t = along + v_n * (normal - middle) - np.cross(arms, normal)
                    radius = self.r[i] * self.r[j] / (self.r[i] + self.r[j])
                    mass = self.m[i] * self.m[j] / (self.m[i] + self.m[j])
                    spin = self.w[i] - self.w[j]
                    f, turn = self.contact((i, j), normal, v_n, v_t, spin, overlap, radius, mass, False, dt)
                    self.f[i] += f
                    self.f[j] -= f
                    self.t[i] += np.cross(-arm_i * normal, f) + turn
                    self.t[j] += np.cross(arm_j * normal, -f) - turn
        self.on_ball, self.torque_on_ball, self.on_floor = np.zeros(3), np.zeros(3), np.zeros(3)
        for i in range(n):
            self.meet_floor(i, dt)
            if self.ball is not None:
                self.meet_ball(i, dt)
        self.history = self.new

    def meet_floor(self, i, dt):
        normal, overlap = np.array([0.0, 0.0, 1.0]), self.r[i] - self.x[i, 2]
        if overlap > -self.reach(self.r[i], True):
            arm = self.r[i] - overlap
            v_n = self.v[i, 2]
            v = self.v[i] - np.cross((arm - 0.5 * dt * v_n) * self.w[i], normal)
            f, turn = self.contact(
                (i, "floor"), normal, v_n, v - v_n * normal, self.w[i], overlap, self.r[i], self.m[i], True, dt
            )
            self.f[i] += f
            self.t[i] += np.cross(-arm * normal, f) + turn
            self.on_floor -= f

    def meet_ball(self, i, dt):
        ball = self.ball
        for a, b in itertools.product((-2, -1, 0, 1, 2), repeat=2):
            d = self.x[i] - ball["position"] + [a * self.period[0], b * self.period[1], 0.0]
            length = np.linalg.norm(d)
            overlap = self.r[i] + ball["radius"] - length
            if overlap > -self.reach(self.r[i] * ball["radius"] / (self.r[i] + ball["radius"]), True):
                normal, arm = d / length, self.r[i] - overlap
                lever = ball["radius"] * normal
                v = self.v[i] - ball["velocity"]  # from centre to centre
                middle, v_n, back = halfway(d, v, normal, dt)
                v = v - np.cross((arm - back) * self.w[i], middle)
                v = v - np.cross(ball["spin"], d - 0.5 * dt * (self.v[i] - ball["velocity"]) - (arm - back) * middle)
                radius = self.r[i] * ball["radius"] / (self.r[i] + ball["radius"])
                spin = self.w[i] - ball["spin"]
                v_t = v - (v @ normal) / (middle @ normal) * middle
                f, turn = self.contact((i, "ball"), normal, v_n, v_t, spin, overlap, radius, self.m[i], True, dt)
                self.f[i] += f
                self.t[i] += np.cross(-arm * normal, f) + turn
                self.on_ball -= f
                self.torque_on_ball -= np.cross(lever, f) + turn

    def advance(self, steps):
        for _ in range(steps):
            self.v += self.dt * self.f / self.m[:, None]
            self.w += self.dt * self.t / self.inertia[:, None]
            self.x += self.dt * self.v
            if self.ball is not None:
                self.ball["position"] = self.ball["position"] + self.dt * self.ball["velocity"]
            self.push(self.dt)


def attraction(material, young, radius, overlap):
    """Contact radius, force at rest, pull-off force, and how many of these go into the load of friction's bound."""
    w = 2 * material.surface_energy
    if material.cohesion == "jkr":
        least = (math.pi * w * radius**2 / (8 * young)) ** (1 / 3)
        most = least + 2 * math.sqrt(radius * abs(overlap)) + 20 * least
        a = brentq(
            lambda a: a**2 / radius - math.sqrt(2 * math.pi * w * a / young) - overlap,
            least,
            most,
            xtol=1e-18,
            rtol=1e-15,
        )
        return (
            a,
            4 * young * a**3 / (3 * radius) - math.sqrt(8 * math.pi * w * young * a**3),
            1.5 * math.pi * w * radius,
            2,
        )
    a = math.sqrt(radius * overlap)
    pull = 2 * math.pi * w * radius
    return a, 4 / 3 * young * a * overlap - pull, pull, 1


def halfway(d, v, n, dt):
    """The normal half a step before, to second order; the rate of the distance; its change since."""
    v_n = v @ n
    return n - 0.5 * dt * (v - v_n * n) / np.linalg.norm(d), v_n, 0.5 * dt * v_n


def capped(stiffness, damping, stretch, rate, bound):
    """A spring that slides at a bound, a dashpot while it does not: the spring's stretch afterwards, and the force."""
    pull = stiffness * np.linalg.norm(stretch)
    if pull > bound:
        stretch = stretch * (bound / pull)
        return stretch, -stiffness * stretch
    force = -(stiffness * stretch + damping * rate)
    return stretch, force * min(1.0, bound / max(np.linalg.norm(force), 1e-300))
