"""How a platform stands before the torque starts: static equilibrium on spikes 0 and n - 1, x = 0, at rest.

On level ground with the mass on the shaft theta = 0 and each row carries W / 2 (for the spring-damper at a depth of
W / 2K). Elsewhere the rows carry different loads, so the platform leans by their difference in depth, and y and theta
are found by Newton's method from the balance of forces along the normal and of moments.
"""

from rigid.model.trial import Trial

from .dynamics import INNER, THETA, WHEEL, Modes, System, Y

__all__ = ["inner_slopes", "standing", "stiffness_at_rest"]

_CLOSE = 1e-13  # of the weight, and of weight x length
_EPS = 2.0**-52


def standing(system: System) -> tuple[list[float], Modes]:
    """State vector and modes at rest. Raises ValueError where the platform cannot stand: it would tip over or slide."""
    trial, s = system.trial, system.s
    modes = Modes(touching=[0, trial.spike_count - 1], slip=[0] * trial.spike_count, top=[0.0] * trial.spike_count)
    modes.torque_over = True
    share = 0.5 * trial.weight * s.up_y
    if share <= 0:
        raise ValueError("slope.angle leaves no weight on the surface")
    z = [0.0] * (11 if system.inner else 9)
    z[WHEEL] = trial.wheel_speed_0
    z[Y] = s.stance - _sinkage(system, share)
    if system.radius:
        z[Y] = system.arms(0, z)[0] - _sinkage(system, share)
    scale = (trial.weight, trial.weight * trial.spike_length)
    best: tuple[float, float, float] | None = None
    for _ in range(60):
        ry, rt = _residual(system, z, modes)
        error = max(abs(ry) / scale[0], abs(rt) / scale[1])
        if best is None or error < best[0]:
            best = (error, z[Y], z[THETA])
        elif error <= 100 * _CLOSE:  # it does not get better than this
            break
        if error <= 1e-17:
            break
        depth = min(max(system.depth(n, z), 16 * _EPS * trial.spike_length) for n in modes.touching)
        e = 1e-4 * depth
        columns = []
        for k, step in ((Y, e), (THETA, e / trial.spike_length)):
            ahead, behind = list(z), list(z)
            ahead[k] += step
            behind[k] -= step
            plus, minus = _residual(system, ahead, modes), _residual(system, behind, modes)
            columns.append([(a - b) / (2 * step) for a, b in zip(plus, minus, strict=True)])
        (a, c), (b, d) = columns
        det = a * d - b * c
        if det == 0:
            break
        dy, dt = -(d * ry - b * rt) / det, -(a * rt - c * ry) / det
        most = 0.5 * depth / max(abs(dy) + abs(dt) * trial.spike_length, 1e-300)
        part = 1.0 if error < 1e-3 else min(1.0, max(most, 1e-2))
        z[Y], z[THETA] = z[Y] + part * dy, z[THETA] + part * dt
    assert best is not None
    z[Y], z[THETA] = best[1], best[2]
    # In a small body's gravity the sinkage is a few steps of what a height of 0.2 m can be told by.
    shallow = max(min(system.depth(n, z) for n in modes.touching), _EPS * trial.spike_length)
    if not best[0] <= max(1e-9, 8 * _EPS * trial.spike_length / shallow) or any(
        system.depth(n, z) <= 0 for n in modes.touching
    ):
        raise ValueError(_why_not(system, "the platform tips over before the torque starts"))
    _residual(system, z, modes)
    if abs(system.stick_force) > system.stick_bound:
        raise ValueError(_why_not(system, f"the platform slides before the torque starts: mu_s = {trial.mu_s:g}"))
    for n in range(trial.spike_count):
        if n not in modes.touching and system.depth(n, z) > 0:
            raise ValueError(_why_not(system, "the platform sinks in until a third row of spikes touches"))
    modes.top = [max(system.depth(n, z), 0.0) if n in modes.touching else 0.0 for n in range(trial.spike_count)]
    modes.held = list(modes.top)
    modes.torque_over = False
    return z, modes


def _why_not(system: System, what: str) -> str:
    given = {effect.id: effect.values for effect in system.trial.effects}
    told = ", ".join(f"{id}.{name} = {value:g}" for id, own in given.items() for name, value in own.items())
    ground = ", ".join(f"{value:g}" for value in system.q)
    limit = f"; {_offset_that_tips(system.trial)}" if "com-offset" in given else ""
    return f"it cannot stand: {what} ({told or 'no effects'}; ground {system.trial.surface.name} of {ground}){limit}"


def _offset_that_tips(trial: Trial) -> str:
    """How far the centre of mass may be ahead of the shaft or behind it: m g x = W l sin(pi / n) empties a row."""
    limit = trial.tipping_torque / (trial.mass * trial.pull_at_mass)
    return (
        f"on level ground com-offset.x up to {1e3 * limit:.3g} mm would do, W l sin(pi / {trial.spike_count}) / (m g)"
    )


def _sinkage(system: System, load: float) -> float:
    """Depth [m] at which one row carries `load` [N]."""
    system._set(0.0, [0.0] * 11)

    def force(depth: float) -> float:
        return float(system.model.contact(system.p, system.s, system.q, depth, 0.0, 0.0, depth, depth)[0])

    low, high = 0.0, 1e-6
    while force(high) < load:
        low, high = high, 2 * high
        if high > system.trial.spike_length:
            trial = system.trial
            weighs = f"mass = {trial.mass:g} kg" + (f" and {trial.counterweight:.4g} kg" if trial.counterweight else "")
            weighs += f" under gravity_sim = {trial.gravity_sim:.3g} m/s2"
            said = f"the ground does not carry {load:.3g} N a row ({weighs}) down to its spike_length, "
            said += f"{trial.spike_length:g} m"
            raise ValueError(_why_not(system, said))
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if force(middle) < load else (low, middle)
    # Bisection ends on two neighbours; a spring's answer may be had exactly.
    exact = load / (force(high) / high)
    return exact if force(exact) == load else high


def _residual(system: System, z: list[float], modes: Modes) -> tuple[float, float]:
    """Force along the normal [N] and moment [N m] that are left, friction holding x."""
    modes.top = [max(system.depth(n, z), 0.0) for n in range(system.trial.spike_count)]
    if system.inner:
        z[INNER] = system.inner_at_rest(z)
    has_dry, system.has_dry = system.has_dry, False
    try:
        system.derivative(0.0, z, modes)
    finally:
        system.has_dry = has_dry
    mass = system.model.inertia(system.p, system.s)
    _, xy, yy, xt, yt, tt = mass
    ax, ay, at = system.acceleration
    return xy * ax + yy * ay + yt * at, xt * ax + yt * ay + tt * at


def stiffness_at_rest(system: System) -> tuple[float, float]:
    """Slope of a row's force over depth [N/m] and over rate [N s/m] at the depth that carries half the weight."""
    depth = _sinkage(system, 0.5 * system.trial.weight)
    p, s, q = system.p, system.s, system.q

    def force(z: float, rate: float, top: float) -> float:
        elastic, lost, *_ = system.model.contact(p, s, q, z, rate, 0.0, max(z, top), max(z, top))
        return float(elastic + lost)

    loading = (force(1.01 * depth, 0.0, 0.0) - force(0.99 * depth, 0.0, 0.0)) / (0.02 * depth)
    unloading = (force(depth, 0.0, depth) - force(0.99 * depth, 0.0, depth)) / (0.01 * depth)
    speed = 0.1
    return max(loading, unloading), max(0.0, (force(depth, speed, 0.0) - force(depth, 0.0, 0.0)) / speed)


def inner_slopes(system: System) -> tuple[float, float, float]:
    """Stiffness [N/m], damping [N s/m] and inertia [kg] of the coordinate that a term has of its own, at rest."""
    system._set(0.0, [0.0] * 11)
    s, rest = system.s, system.inner_at_rest([0.0] * 11)

    def force(at: float, speed: float) -> float:
        s.inner, s.inner_speed, s.inner_mode = at, speed, 1.0
        return float(system.model.inner(system.p, s)[1])

    step, speed = 1e-6 * s.length, 1e-3
    still = force(rest, 0.0)
    return (
        (still - force(rest + step, 0.0)) / step,
        (still - force(rest, speed)) / speed,
        float(system.model.inner(system.p, s)[0]),
    )
