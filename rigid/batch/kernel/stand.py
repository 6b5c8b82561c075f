"""How the platforms of a batch stand before the torque starts, as `rigid.planar.statics` has it for one."""

from types import SimpleNamespace
from typing import Any

__all__ = ["make_stand"]


def make_stand(parts: SimpleNamespace) -> Any:
    """The kernel `stand(numbers, poses)`: y and theta at rest; theta NaN where a platform cannot stand."""
    from hedgebed_taichi import ti

    @ti.kernel
    def stand(numbers: ti.types.ndarray(dtype=ti.f64, ndim=2), poses: ti.types.ndarray(dtype=ti.f64, ndim=2)):
        ti.loop_config(block_dim=4)
        for i in range(numbers.shape[0]):
            s = parts.trial_state(numbers, i)
            p = parts.load_parameters(numbers, i)
            q = ti.Vector([numbers[i, parts.LAW + k] for k in ti.static(range(parts.LAW_SIZE))])
            s.up_x, s.up_y = parts.vertical(p)
            radius = parts.tip_radius(p)
            s.cosine = 1.0
            share = 0.5 * s.weight * s.up_y
            low, high = 0.0, s.length
            for _ in range(200):  # the depth at which a row carries half the weight
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break  # nothing lies between them
                elastic, lost, stored, side, factor_s, factor_d, grip = parts.contact(
                    p, s, q, middle, 0.0, 0.0, middle, middle
                )
                if elastic < share:
                    low = middle
                else:
                    high = middle
            left = 1.0 - parts.settled_share(p, s)  # of the depth: the rest has given way
            y = (s.length - radius) * ti.cos(parts.HALF) + radius - high / left
            theta = 0.0
            depth = high / left
            error = 1e300
            best_y, best_theta, best, friction, bound = y, theta, 1e300, 0.0, 0.0
            sound = high < 0.999 * s.length
            for _ in range(40):  # Newton on the balance of forces along the normal and of moments
                ry = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0])
                rt = ti.Vector([0.0, 0.0, 0.0, 0.0, 0.0])
                e = 1e-4 * ti.max(depth, 1e-9)
                least = 1e300
                for m in range(5):
                    at_y = y + e * (ti.cast(m == 1, ti.i32) - ti.cast(m == 2, ti.i32))
                    at_theta = theta + e / s.length * (ti.cast(m == 3, ti.i32) - ti.cast(m == 4, ti.i32))
                    s.y = at_y
                    s.theta = at_theta
                    s.cosine = ti.cos(at_theta)
                    s.sine = ti.sin(at_theta)
                    if ti.static(parts.INNER):
                        s.inner = parts.inner_start(p, s)
                    fx, fy, ft = parts.applied(p, s)
                    load, mean_h, mu_load = 0.0, 0.0, 0.0
                    for side_of in range(2):
                        angle = at_theta + parts.HALF * (1.0 - 2.0 * side_of)
                        h, d = parts.arms(ti.cos(angle), ti.sin(angle), s.length, radius)
                        z = h - at_y
                        in_z = ti.max(left * z, 1e-300)
                        elastic, lost, stored, side, factor_s, factor_d, grip = parts.contact(
                            p, s, q, in_z, 0.0, 0.0, in_z, in_z
                        )
                        press = ti.max(elastic + grip, 0.0)
                        fy += elastic
                        ft += elastic * d
                        load += press
                        mean_h += press * h
                        mu_load += factor_s * press
                        if m == 0:
                            least = ti.min(least, z)
                    mean_h = mean_h / ti.max(load, 1e-300)
                    ry[m] = fy
                    rt[m] = ft + fx * mean_h
                    if m == 0:
                        friction = ti.abs(fx)
                        bound = numbers[i, 12] * mu_load
                depth = least
                error = ti.max(ti.abs(ry[0]) / s.weight, ti.abs(rt[0]) / (s.weight * s.length))
                if error < best:
                    best, best_y, best_theta = error, y, theta
                    sound = least > 0.0 and friction <= bound
                if error < 1e-16:
                    break
                a = (ry[1] - ry[2]) / (2.0 * e)
                b = (ry[3] - ry[4]) / (2.0 * e) * s.length
                c = (rt[1] - rt[2]) / (2.0 * e)
                d2 = (rt[3] - rt[4]) / (2.0 * e) * s.length
                det = a * d2 - b * c
                if det == 0.0:
                    break
                dy = -(d2 * ry[0] - b * rt[0]) / det
                dt = -(a * rt[0] - c * ry[0]) / det
                part = 1.0
                if error > 1e-3:
                    part = ti.min(1.0, ti.max(0.5 * depth / (ti.abs(dy) + ti.abs(dt) * s.length), 1e-2))
                y += part * dy
                theta += part * dt
            poses[i, 0] = best_y
            poses[i, 1] = best_theta
            if not sound or best > 1e-9:
                poses[i, 1] = parts.NAN

    return stand
