"""How a platform stands before the torque starts, and when it rests later.

Standing is static equilibrium on spikes 0 and n - 1, x = 0. On level ground with the mass on the shaft theta is 0. Each
row then carries W / 2 (for the spring-damper at a depth of W / 2K). Elsewhere the rows carry different loads, so the
platform leans by their difference in depth. Newton's method then finds y and theta from the balance of forces along the
normal and of moments.

At rest nothing moves and nothing will before the torque changes. `at_rest`: no speed at all, and no force left but
rounding. `comes_to_rest`: what still moves is less than the integrator's own error, and would not gather speed, since
the equilibrium is near and stable. Without the second a platform that its torque has shaken would be followed for ever,
while it swings by less than an atom's width.
"""

from collections.abc import Callable

import numpy as np

from rigid.model.trial import Trial

from .dynamics import INNER, INNER_SPEED, LOST, OMEGA, THETA, VX, VY, WHEEL, Modes, System, X, Y

__all__ = ["at_rest", "comes_to_rest", "inner_slopes", "leaning", "resting", "standing", "stiffness_at_rest"]

_CLOSE = 1e-13  # of the weight, and of weight x length
_EPS = 2.0**-52
_REST = 1e-11  # accelerations below this share of g_sim (for the rotation g_sim / l) are rounding
_BRIM = 1e-6  # forces above their bound by less than this share hold: dry friction often ends a motion at its bound
_STILL = 1e-12  # lengths of a spike a second: ground that gives way more slowly is at rest
_SLOW = 1e3  # accelerations above so many tolerances of g_sim are no rest, whatever the springs


def standing(system: System) -> tuple[list[float], Modes]:
    """State vector and modes at rest. Raises ValueError where the platform cannot stand: it would tip over or slide."""
    trial, s = system.trial, system.s
    modes = Modes(touching=[0, trial.spike_count - 1], slip=[0] * trial.spike_count, top=[0.0] * trial.spike_count)
    modes.torque_over = True
    share = 0.5 * trial.weight * s.up_y
    if share <= 0:
        raise ValueError("slope.angle leaves no weight on the surface")
    z = [0.0] * system.size
    z[WHEEL] = trial.wheel_speed_0
    _sink(system, z, s.stance, share)
    if system.radius:
        _sink(system, z, system.arms(0, z)[0], share)
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
    # In a small body's gravity the sinkage is a few rounding steps of a height of 0.2 m.
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


def leaning(system: System, lean: float) -> tuple[list[float], Modes]:
    """State vector and modes of a platform held at rest, turned by `lean` [rad] onto its leading row, when the torque
    begins: that row carries the whole weight, no other touches. Raises ValueError for a lean at which another does."""
    z, modes = standing(system)
    front = system.trial.spike_count - 1
    z[THETA] = lean
    _sink(system, z, system.arms(front, z)[0], system.trial.weight)
    depths = [system.depth(n, z) for n in range(front)]
    if not (lean > 0 and max(depths) < 0):
        deeper = max(depths) * 1e6
        raise ValueError(
            f"lean = {lean:g} rad does not lift the other rows: one would be {deeper:.3g} um deep; use more, at "
            f"most pi / {system.trial.spike_count}"
        )
    modes.touching = [front]
    modes.top = [*([0.0] * front), system.depth(front, z)]
    modes.held = list(modes.top)
    return z, modes


def _sink(system: System, z: list[float], over: float, load: float) -> None:
    """Put the platform so deep that a row whose arm is `over` [m] carries `load` [N], and the ground's givings way."""
    z[Y] = over - _sinkage(system, load) / (1.0 - system.settled_share)
    _give_way(system, z)


def _give_way(system: System, z: list[float]) -> None:
    """What the ground has given way under a platform at rest: a share of each tip's depth."""
    for n in range(system.trial.spike_count):
        for k, share in zip(system.settling(n), system.settled_shares, strict=True):
            z[k] = share * max(system.arms(n, z)[0] - z[Y], 0.0)


def _why_not(system: System, what: str) -> str:
    given = {effect.id: effect.values for effect in system.trial.effects}
    effects = ", ".join(f"{id}.{name} = {value:g}" for id, own in given.items() for name, value in own.items())
    surface = system.trial.surface
    units = {parameter.name: f" {parameter.unit}" for parameter in surface.law.parameters if parameter.unit != "1"}
    ground = ", ".join(
        f"{slot} = {value:.4g}{units.get(slot, '')}" for slot, value in zip(surface.law.slots, system.q, strict=False)
    )
    limit = f"; {_offset_that_tips(system.trial)}" if "com-offset" in given else ""
    return f"it cannot stand: {what} ({effects or 'no effects'}; a row on {surface.name}: {ground}){limit}"


def _offset_that_tips(trial: Trial) -> str:
    """How far the centre of mass may be ahead of the shaft or behind it: m g x = W l sin(pi / n) empties a row."""
    limit = trial.tipping_torque / (trial.mass * trial.pull_at_mass)
    return f"on level ground com-offset.x may be up to {1e3 * limit:.3g} mm, W l sin(pi / {trial.spike_count}) / (m g)"


def _sinkage(system: System, load: float) -> float:
    """Depth [m] at which one row carries `load` [N]."""
    system._set(0.0, [0.0] * 11)
    system.s.given_way = 0.0

    def force(depth: float) -> float:
        return float(system.model.contact(system.p, system.s, system.q, depth, 0.0, 0.0, depth, depth)[0])

    low, high = 0.0, 1e-6
    while force(high) < load:
        low, high = high, 2 * high
        if high > system.trial.spike_length:
            trial = system.trial
            weighs = f"mass = {trial.mass:g} kg" + (f" and {trial.counterweight:.4g} kg" if trial.counterweight else "")
            weighs += f" under gravity_sim = {trial.gravity_sim:.3g} m/s2"
            what = f"the ground does not carry {load:.3g} N a row ({weighs}) down to its spike_length, "
            what += f"{trial.spike_length:g} m"
            raise ValueError(_why_not(system, what))
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
    _give_way(system, z)
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
    retreat = p.loss / p.loss_speed * force(depth, 0.0, 0.0)
    return max(loading, unloading), max(retreat, (force(depth, speed, 0.0) - force(depth, 0.0, 0.0)) / speed)


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


def _may_rest(system: System, modes: Modes) -> bool:
    """Whether everything that touches sticks, and what holds now will hold later."""
    if not modes.touching or any(modes.slip[n] != 0 for n in modes.touching):
        return False
    if system.model.reads("time", but="torque_factor"):
        return False
    if any(contact.settling > _STILL * system.s.length for contact in system.contacts):
        return False
    return modes.torque_over or not system.model.reads("time", "wheel_speed")


def at_rest(system: System, z: list[float], modes: Modes, rate: list[float]) -> bool:
    """Whether everything is at rest and stays so: no speed, everything sticks, and no force is left but rounding."""
    if z[VX] != 0.0 or z[VY] != 0.0 or z[OMEGA] != 0.0 or rate[LOST] != 0.0 or not _may_rest(system, modes):
        return False
    if system.inner and z[INNER_SPEED] != 0.0:
        return False
    trial = system.trial
    shallow = min(max(system.depth(n, z), _EPS * trial.spike_length) for n in modes.touching)
    small = max(_REST, 8 * _EPS * trial.spike_length / shallow) * trial.gravity_sim
    return _largest(system, rate) <= small


def _largest(system: System, rate: list[float]) -> float:
    """The largest acceleration [m/s2]."""
    inner = abs(rate[INNER_SPEED]) if system.inner else 0.0
    return max(abs(rate[VX]), abs(rate[VY]), abs(rate[OMEGA]) * system.s.length, inner)


def comes_to_rest(
    system: System, time: float, z: list[float], modes: Modes, scale: list[float], tolerance: float
) -> bool:
    """Whether what moves in `z` is below the tolerance and stays so; then its speeds are taken out, and count as lost.

    `scale`: what the tolerance is relative to. Speeds within the tolerance; at zero speed, so without what the dampers
    hold up, the equilibrium no further than the tolerance, and stable: the accelerations' slopes over the coordinates
    that are free (the height, the angle with x rolling along, a term's own) have negative eigenvalues only. Dry
    frictions hold. Leaves the evaluation of the system at `z`.
    """
    speeds = (VX, VY, OMEGA, INNER_SPEED) if system.inner else (VX, VY, OMEGA)
    if any(abs(z[i]) > tolerance * scale[i] for i in speeds) or len(modes.touching) < 2 or not _may_rest(system, modes):
        return False
    still = list(z)
    for i in speeds:
        still[i] = 0.0
    holding = modes.copy()
    holding.dry = [0, 0]
    rate = system.derivative(time, still, holding)
    near = _largest(system, rate) <= _SLOW * tolerance * system.trial.gravity_sim
    forces, bounds = (system.stick_force, *system.dry_forces), (system.stick_bound, *system.dry_bounds)
    held = all(abs(force) <= bound * (1 + _BRIM) for force, bound in zip(forces, bounds, strict=True))
    if near and held and _is_stable(system, time, still, holding, rate, scale, tolerance):
        still[LOST] += system.energy(time, z, modes)[0]
        z[:] = still
        modes.dry = [0, 0]
        system.derivative(time, z, modes)
        return True
    system.derivative(time, z, modes)
    return False


def _is_stable(
    system: System, time: float, z: list[float], modes: Modes, rate: list[float], scale: list[float], tolerance: float
) -> bool:
    """Whether a stable equilibrium lies within the tolerance of `z`, where nothing moves."""
    free = [Y, THETA, INNER] if system.inner else [Y, THETA]
    if system.dry_bounds[0] > 0:
        if system.s.up_x != 0.0:
            return False
        free.remove(Y)
    if system.dry_bounds[1] > 0:
        free.remove(THETA)
    if not free:
        return True
    follows = {Y: VY, THETA: OMEGA, INNER: INNER_SPEED}
    total = sum(contact.load for contact in system.contacts)
    if total <= 0:
        return False
    mean_h = sum(contact.load * contact.h for contact in system.contacts) / total
    shallow = min(contact.depth for contact in system.contacts)
    if shallow <= 0:
        return False
    slopes = np.empty((len(free), len(free)))
    for k, i in enumerate(free):
        step = 1e-3 * shallow / (system.s.length if i == THETA else 1.0)
        sides = []
        for way in (step, -step):
            moved = list(z)
            moved[i] += way
            if i == THETA:
                moved[X] += mean_h * way
            found = system.derivative(time, moved, modes)
            sides.append([found[follows[j]] for j in free])
        slopes[:, k] = (np.array(sides[0]) - np.array(sides[1])) / (2 * step)
    values = np.linalg.eigvals(slopes)
    if not (np.isfinite(values).all() and (values.real < 0).all()):
        return False
    away = np.linalg.solve(slopes, [rate[follows[j]] for j in free])
    return bool((np.abs(away) <= tolerance * np.array([scale[i] for i in free])).all())


def resting(time: float, z: list[float], rate: list[float]) -> Callable[[float], list[float]]:
    """z of a platform that rests from `time` [s] on: only the wheel still changes its speed."""

    def at(t: float) -> list[float]:
        then = list(z)
        then[WHEEL] += (t - time) * rate[WHEEL]
        return then

    return at
