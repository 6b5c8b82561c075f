"""The functions of the surface laws: plain arithmetic that is Python and Taichi at once.

Each has no loops, arrays, early returns or calls of another. So the same source runs on numbers and, compiled by the
caller (`ti.func`), on thousands of trials at once. What they mean, and how a force is put together from them, is in
`rigid.ground.laws`; p holds a law's numbers.
"""

__all__ = [
    "springback", "springback_energy", "retreat_share", "spring_damper_loading", "spring_damper_loading_work",
    "spring_damper_rate_force", "spring_damper_rate_work", "power_loading", "power_loading_work",
    "hunt_crossley_rate_force", "hunt_crossley_rate_work", "inertial_rate_force", "inertial_rate_work",
    "bekker_loading", "bekker_loading_work", "no_rate_force", "no_rate_work", "rft_loading", "rft_loading_work",
    "rft_rate_force", "rft_rate_work", "rft_foot_loading", "rft_foot_loading_work", "rft_foot_rate_force",
    "rft_foot_rate_work",
]  # fmt: skip


def springback(depth, top, rebound):
    """Share of the force at the deepest depth `top` that is left at `depth` <= top [1]."""
    share = 1.0
    if depth < top:
        share = max(0.0, 1.0 - (top - depth) / (rebound * top))
    return share


def springback_energy(depth, top, rebound, force_at_top):
    """Energy stored [J] at `depth` when the spike has been at `top`, where the force was `force_at_top` [N]."""
    energy = 0.0
    if top > 0.0:
        share = 1.0
        if depth < top:
            share = max(0.0, 1.0 - (top - depth) / (rebound * top))
        energy = 0.5 * rebound * top * force_at_top * share * share
    return energy


def retreat_share(rate, loss, loss_speed):
    """Share of the springback's force that is left while it retreats: 1 - loss u / (u + loss_speed), u = -rate [1]."""
    share = 1.0
    if rate < 0.0:
        share = 1.0 - loss * rate / (rate - loss_speed)
    return share


def spring_damper_loading(depth, p):
    """K z."""
    z = depth
    if z < 0.0:
        z = 0.0
    return p[0] * z


def spring_damper_loading_work(depth, p):
    """K z^2 / 2."""
    return 0.5 * p[0] * max(depth, 0.0) ** 2


def spring_damper_rate_force(depth, rate, p):
    """C dz/dt while going in."""
    force = 0.0
    inwards = rate
    if inwards < 0.0:
        inwards = 0.0
    if depth > 0.0:
        force = p[1] * inwards
    return force


def spring_damper_rate_work(depth, rate, p):
    """C dz/dt z while going in."""
    return p[1] * max(rate, 0.0) * max(depth, 0.0)


def power_loading(depth, p):
    """K z^n."""
    z = depth
    if z < 0.0:
        z = 0.0
    return p[0] * z ** p[2]


def power_loading_work(depth, p):
    """K z^(n + 1) / (n + 1)."""
    return p[0] * max(depth, 0.0) ** (p[2] + 1.0) / (p[2] + 1.0)


def hunt_crossley_rate_force(depth, rate, p):
    """K z^n (3 / 2) alpha dz/dt, and never more than takes the whole force away."""
    z = depth
    share = 1.5 * p[1] * rate
    if z < 0.0:
        z = 0.0
    if share < -1.0:
        share = -1.0
    return p[0] * z ** p[2] * share


def hunt_crossley_rate_work(depth, rate, p):
    """Integral of the above over depth."""
    return p[0] * max(depth, 0.0) ** (p[2] + 1.0) / (p[2] + 1.0) * max(1.5 * p[1] * rate, -1.0)


def inertial_rate_force(depth, rate, p):
    """b (dz/dt)^2 while going in."""
    force = 0.0
    inwards = rate
    if inwards < 0.0:
        inwards = 0.0
    if depth > 0.0:
        force = p[1] * inwards * inwards
    return force


def inertial_rate_work(depth, rate, p):
    """b (dz/dt)^2 z while going in."""
    return p[1] * max(rate, 0.0) ** 2 * max(depth, 0.0)


def bekker_loading(depth, p):
    """A(z) (k_c / b + k_phi) z^n, A = a (2 s - s^2) up to the depth h of the full section a, with s = z / h."""
    z = depth
    if z < 0.0:
        z = 0.0
    force = p[0] * z ** p[1]
    if z < p[2]:
        s = z / p[2]
        force = force * s * (2.0 - s)
    return force


def bekker_loading_work(depth, p):
    """Integral of the above over depth."""
    z = max(depth, 0.0)
    work = p[0] * p[2] ** (p[1] + 1.0) * (2.0 / (p[1] + 2.0) - 1.0 / (p[1] + 3.0) - 1.0 / (p[1] + 1.0))
    work = work + p[0] * z ** (p[1] + 1.0) / (p[1] + 1.0)
    if z < p[2]:
        work = p[0] * z ** (p[1] + 2.0) / p[2] * (2.0 / (p[1] + 2.0) - z / p[2] / (p[1] + 3.0))
    return work


def no_rate_force(depth, rate, p):
    """0: the force does not know the rate."""
    return 0.0 * depth


no_rate_work = no_rate_force


def rft_loading(depth, p):
    """2 pi R^3 xi_n (sum of b_k s^(k+2), s = z / R <= 1; beyond, level with the slope) + wall of the shaft."""
    s = depth / p[2]
    shaft = 0.0
    if s > 1.0:
        shaft = (s - 1.0) * (p[11] + 0.5 * p[12] * (s - 1.0))
        s = 1.0
    if s < 0.0:
        s = 0.0
    square = s * s
    low = p[3] + s * (p[4] + s * (p[5] + s * p[6]))
    high = p[7] + s * (p[8] + s * (p[9] + s * p[10]))
    return p[0] * (square * (low + square * square * high) + shaft)


def rft_loading_work(depth, p):
    """Integral of the above over depth."""
    z = max(depth, 0.0)
    s = min(z / p[2], 1.0)
    low = p[3] / 3.0 + s * (p[4] / 4.0 + s * (p[5] / 5.0 + s * p[6] / 6.0))
    high = p[7] / 7.0 + s * (p[8] / 8.0 + s * (p[9] / 9.0 + s * p[10] / 10.0))
    above = max(z / p[2] - 1.0, 0.0)
    full = p[3] + p[4] + p[5] + p[6] + p[7] + p[8] + p[9] + p[10]
    work = s * s * s * (low + s * s * s * s * high)
    work = work + above * (full + above * (0.5 * p[11] + p[12] * above / 6.0))
    return work * p[0] * p[2]


def rft_rate_force(depth, rate, p):
    """lambda rho (n.v)^2 over the ball: pi R^2 lambda rho v^2 (1 - (1 - s)^4) / 2 while going in."""
    left = 1.0 - depth / p[2]
    inwards = rate
    if left > 1.0:
        left = 1.0
    if left < 0.0:
        left = 0.0
    if inwards < 0.0:
        inwards = 0.0
    left = left * left
    return p[1] * inwards * inwards * (1.0 - left * left)


def rft_rate_work(depth, rate, p):
    """Integral of the above over depth."""
    s = max(depth, 0.0) / p[2]
    left = 1.0 - min(s, 1.0)
    return p[1] * max(rate, 0.0) ** 2 * p[2] * (s - (1.0 - left * left * left * left * left) / 5.0)


def rft_foot_loading(depth, p):
    """A h xi_n s^e (sum of c_k s^k), s = z / h <= 1; beyond, level with the slope, and the walls."""
    s = depth / p[2]
    above = 0.0
    if s < 0.0:
        s = 0.0
    if s > 1.0:
        above = (s - 1.0) * (p[12] + 0.5 * p[13] * (s - 1.0))
        s = 1.0
    square = s * s
    low = p[4] + s * (p[5] + s * (p[6] + s * p[7]))
    high = p[8] + s * (p[9] + s * (p[10] + s * p[11]))
    return p[0] * (s ** p[3] * (low + square * square * high) + above)


def rft_foot_loading_work(depth, p):
    """Integral of the above over depth."""
    s = max(depth, 0.0) / p[2]
    above = max(s - 1.0, 0.0)
    s = min(s, 1.0)
    e = p[3] + 1.0
    low = p[4] / e + s * (p[5] / (e + 1.0) + s * (p[6] / (e + 2.0) + s * p[7] / (e + 3.0)))
    high = p[8] / (e + 4.0) + s * (p[9] / (e + 5.0) + s * (p[10] / (e + 6.0) + s * p[11] / (e + 7.0)))
    full = p[4] + p[5] + p[6] + p[7] + p[8] + p[9] + p[10] + p[11]
    work = s**e * (low + s * s * s * s * high) + above * (full + above * (0.5 * p[12] + p[13] * above / 6.0))
    return work * p[0] * p[2]


def rft_foot_rate_force(depth, rate, p):
    """A lambda rho v^2 s^(e - 1) (sum of d_k s^k), s = z / h <= 1, while going in."""
    s = depth / p[2]
    force = 0.0
    inwards = rate
    if s > 1.0:
        s = 1.0
    if inwards < 0.0:
        inwards = 0.0
    if depth > 0.0:
        force = p[1] * inwards * inwards * s ** (p[3] - 1.0) * (p[14] + s * (p[15] + s * (p[16] + s * p[17])))
    return force


def rft_foot_rate_work(depth, rate, p):
    """Integral of the above over depth."""
    s = max(depth, 0.0) / p[2]
    above = max(s - 1.0, 0.0)
    s = min(s, 1.0)
    e = p[3]
    work = s**e * (p[14] / e + s * (p[15] / (e + 1.0) + s * (p[16] / (e + 2.0) + s * p[17] / (e + 3.0))))
    return p[1] * max(rate, 0.0) ** 2 * p[2] * (work + above * (p[14] + p[15] + p[16] + p[17]))
