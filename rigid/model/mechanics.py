"""Geometry of the spikes and the solution for accelerations: plain arithmetic, the same source for Python and Taichi.

Spike n touches at the lowest point of its tip, which is h below and d behind the platform's centre. With r the radius
of the tip's ball (0: a point) and gamma the spike's angle from the downward vertical,

    h = (l - r) cos gamma + r,  d = (l - r) sin gamma,
    depth = h - y,  rate = -(vy + omega d),  slip = vx - omega h   (slip: the material point's horizontal speed),
    d(slip)/dt = ax - alpha h + omega^2 d,

so a force (F, N) on the tip has the generalised force (F, N, N d - F h). A ball that sticks rolls.
"""

__all__ = ["contact_arms", "divide_mass"]


def contact_arms(cosine, sine, length, radius):
    """h and d [m] of a spike whose angle has this cosine and sine."""
    return (length - radius) * cosine + radius, (length - radius) * sine


def divide_mass(xx, xy, yy, xt, yt, tt, fx, fy, ft):
    """M^-1 f for the symmetric mass matrix, by L D L^T; without off-diagonal entries f / diagonal, to the bit."""
    ax = fx / xx
    ay = fy / yy
    at = ft / tt
    if xy != 0.0 or xt != 0.0 or yt != 0.0:
        a = xy / xx
        b = xt / xx
        d2 = yy - a * xy
        c = (yt - b * xy) / d2
        d3 = tt - b * xt - c * (c * d2)
        g2 = fy - a * fx
        at = (ft - b * fx - c * g2) / d3
        ay = g2 / d2 - c * at
        ax = fx / xx - a * ay - b * at
    return ax, ay, at
