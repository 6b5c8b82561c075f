"""Hop theory: how a platform leaves the ground under its flywheel, and how far it flies.

Launch. The platform turns about the row of tips ahead of it, on rigid ground. beta is the angle between the vertical
and the line from there to the centre (pi/8 at rest). omega is the clockwise turning rate; x points forward, y up. M is
the inertia in y (m free, m + m_b in a rig); s = sin beta, c = cos beta. While the tips stick

    (J + m l^2 c^2 + M l^2 s^2) omega' = tau - W l s + (M - m) l^2 s c omega^2

and while they slide back under F = mu_d N

    (J + M l^2 s (s + mu_d c)) omega' = tau - l (s + mu_d c) (W - M l c omega^2)

with N = W + M y'', y'' = l (s omega' - c omega^2). The platform leaves where N comes to 0. A compliant ground launches
more steeply where tips hold, and faster where they slide.

Limit. This is the planar model (Reid and others, i-SAIRAS 2014, from its energies) for K to infinity with a C that
leaves no rebound, with one exception. Under a sudden torque the model's tips slide first: the friction that holds them
is needed at once, and the force of a spring, however stiff, takes time. Where mu_d < m c / (M s) they never stick
again, also where mu_s is enough to hold them here. Rigid bodies have both motions as solutions. `launch` takes the one
that sticks; with mu_s = mu_d it has the other, the model's limit. Under a torque that rises slowly the model's tips can
hold too.

Angles. In a sudden launch the ground gives one impulse within its cone of friction. So a launch whose tips do not slide
cannot be flatter than pi/2 - atan(mu_s). This friction-cone condition is ours. It is not compared with the hop angles
of Koenig, Pavone, Castillo-Rogez and Nesnas (ICRA 2014), whose formulas we have not read (docs/platform.md).

Flight. On a flat ground a parabola, on a round body of radius R and surface gravity g an ellipse about its centre.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from rigid.checks import Coulomb, check_above_zero, check_friction, check_not_negative
from rigid.checks.unfit import UnfitSettingsError

__all__ = [
    "Flight", "Launch", "Tumbler", "brake_launch", "escape_speed", "flight", "impulsive_launch", "launch",
    "launch_speed_for", "least_viable_angle",
]  # fmt: skip

PHASES = 60  # A launch with more changes between stick and slip than this fails
_LARGEST = 1e100
"""Torque from which a launch is not followed [N m]: squares of its rates overflow, and the integrator may never end."""


@dataclass(frozen=True, kw_only=True)
class Tumbler(Coulomb):
    """The numbers of the planar model that a launch depends on. Raises ValueError for those that cannot be.

    ``lean``: without it a platform of eight rows is meant (Hedgehog), 22.5 degrees, whatever its mass and length. Of
    another one give ``platform.stance().lean``; of a cube it is 45 degrees. A `Launch` states which was taken.
    """

    mass: float  # m [kg]
    inertia: float  # J, without J_w [kg m2]
    spike_length: float  # l [m]
    lean: float = math.pi / 8  # Angle from the vertical of the line from the tips ahead to the centre, at rest [rad]
    gravity: float = 0.0  # The weight on the ground over `mass_y` [m/s2]: g_sim in a rig
    mu_s: float = math.inf  # Coefficient of static friction [1]; infinite: the tips never slide
    mu_d: float | None = None  # Coefficient of sliding friction [1]; None: half of mu_s
    counterweight: float = 0.0  # m_b of a rig [kg]

    def __post_init__(self) -> None:
        check_above_zero(mass=self.mass, inertia=self.inertia, spike_length=self.spike_length)
        check_not_negative(gravity=self.gravity, counterweight=self.counterweight)
        if not 0 < self.lean < math.pi / 2:
            raise ValueError(f"lean is {self.lean}: it must be between 0 and pi / 2")
        check_friction(self.mu_s, self.mu_d, endless=True)

    @property
    def mass_y(self) -> float:
        """M: the inertia in y [kg]."""
        return self.mass + self.counterweight

    @property
    def weight(self) -> float:
        """W on the ground [N]."""
        return self.mass_y * self.gravity

    @property
    def tipping_torque(self) -> float:
        """Least torque that tips it from rest [N m]: W l sin(lean)."""
        return self.weight * self.spike_length * math.sin(self.lean)

    @property
    def slip_torque(self) -> float:
        """Least torque that makes it slip at rest if it is there at once [N m]: mu_s W (J + m h^2) / (m h).

        h = l cos(lean), the height of the centre.
        """
        h = self.spike_length * math.cos(self.lean)
        return self.mu_s * self.weight * (self.inertia + self.mass * h * h) / (self.mass * h)


@dataclass(frozen=True, kw_only=True)
class Launch:
    """How a platform has left the ground."""

    speed: float  # Of the centre [m/s]
    angle: float  # Of the velocity from the horizontal, forward and up positive [rad]
    spin: float  # Turning rate [rad/s], clockwise positive
    slid: bool  # Whether the tips slid when it left
    rotation: float = 0.0  # How far it had turned [rad]
    time: float = 0.0  # How long after the start of the torque [s]
    lean: float | None = None  # That of the `Tumbler` [rad]; None where another model launched it


@dataclass(frozen=True, kw_only=True)
class Flight:
    """One ballistic flight from ground to ground of the same height."""

    distance: float  # Along the ground [m]
    time: float  # [s]
    height: float  # Of the peak above launch [m]


def least_viable_angle(mu_s: float, *, mass: float = 1.0, counterweight: float = 0.0) -> float:
    """The flattest sudden launch without sliding [rad]: tan(angle) = m / (M mu_s), pi/2 - atan(mu_s) without a rig."""
    return math.atan2(mass, (mass + counterweight) * mu_s)


def impulsive_launch(tumbler: Tumbler, momentum: float) -> Launch:
    """Launch by an angular `momentum` H [N m s] given at once, against which weight and turning do not count.

    Sticking omega = H / (J + m l^2 cos^2 g0 + M l^2 sin^2 g0), launch at g0 = lean; sliding
    omega = H / (J + M l^2 sin g0 (sin g0 + mu_d cos g0)), launch at tan = m / (M mu_d) (docs/planar.md, closed forms).
    """
    check_above_zero("N m s", momentum=momentum)
    m, my, length, j = tumbler.mass, tumbler.mass_y, tumbler.spike_length, tumbler.inertia
    s, c = math.sin(tumbler.lean), math.cos(tumbler.lean)
    if m * c <= tumbler.mu_s * my * s * (1 + 1e-12):
        spin = momentum / (j + m * (length * c) ** 2 + my * (length * s) ** 2)
        return Launch(speed=length * spin, angle=tumbler.lean, spin=spin, slid=False, lean=tumbler.lean)
    mu = tumbler.sliding_friction
    spin = momentum / (j + my * length**2 * s * (s + mu * c))
    up = length * spin * s
    along = mu * my * up / m
    return Launch(speed=math.hypot(up, along), angle=math.atan2(up, along), spin=spin, slid=True, lean=tumbler.lean)


def launch(tumbler: Tumbler, torque: float, until: float = math.inf) -> Launch | None:
    """Launch under a constant `torque` [N m] on the platform from rest up to `until` [s] and none after.

    None where it does not leave the ground before the next tips come down: it tumbles, falls back, or does not tip at
    all. After a brake it tumbles if M l cos(beta) omega^2 stays below W, as in a rig, where W is large. Compliant
    ground may then still throw it: its springs return energy. Raises ValueError for a torque or a time of 0 or less.
    Raises RuntimeError where sliding on rigid ground has no solution because friction is too high (above about 2, in a
    rig). Raises UnfitSettingsError for too large a torque.
    """
    check_above_zero(torque=torque, **({"until": until} if until != math.inf else {}))
    if torque <= tumbler.tipping_torque:
        return None
    if torque >= _LARGEST:
        raise UnfitSettingsError(
            f"a torque of {torque:g} N m: the motion cannot be followed; expected less than {_LARGEST:g}"
        )
    contact = _Contact(tumbler)
    time, state, driven = 0.0, np.array([tumbler.lean, 0.0, 0.0]), torque
    mode = contact.mode(state, driven)
    for _ in range(PHASES):
        if mode is None:
            return contact.launched(state, time)
        end = until if time < until else math.inf
        time, state, why = contact.run(state, driven, mode, time, end)
        if why == "lift":
            return contact.launched(state, time)
        if why == "down":
            return None
        if why == "breaks loose":
            mode = 1 if contact.rates(state, driven, 0)[2] > 0 else -1
            continue
        if why == "torque ends":
            driven = 0.0
        mode = contact.mode(state, driven)
    raise RuntimeError(f"a launch under {torque:g} N m goes to and fro between stick and slip and does not end")


def brake_launch(tumbler: Tumbler, momentum: float, torque: float) -> Launch | None:
    """Launch by a brake that takes a wheel of angular `momentum` [N m s] to rest with the constant `torque` [N m]."""
    return launch(tumbler, torque, momentum / torque)


class _Contact:
    """The equations of motion about the tips, state (beta, omega, speed in x), all relative to one platform."""

    def __init__(self, tumbler: Tumbler) -> None:
        self.t = tumbler

    def rates(self, state: np.ndarray, torque: float, mode: int) -> tuple[float, float, float]:
        """omega', N and F; `mode` 0 sticks, +1 slides back (friction forward), -1 slides forward."""
        t, (beta, omega) = self.t, state[:2]
        s, c, length = math.sin(beta), math.cos(beta), t.spike_length
        if mode == 0:
            lever = t.inertia + t.mass * (length * c) ** 2 + t.mass_y * (length * s) ** 2
            turn = (torque - t.weight * length * s + (t.mass_y - t.mass) * length**2 * s * c * omega**2) / lever
            force = t.mass * length * (c * turn + s * omega**2)
        else:
            arm = s + mode * t.sliding_friction * c
            lever = t.inertia + t.mass_y * length**2 * s * arm
            if lever <= 0:
                raise RuntimeError(
                    f"mu_d = {t.sliding_friction:g}: tips that slide {math.degrees(beta):.3g} degrees from the "
                    f"vertical jam; with rigid ground and this much friction their motion has no solution (Painleve)"
                )
            turn = (torque - length * arm * (t.weight - t.mass_y * length * c * omega**2)) / lever
            force = math.nan
        normal = t.weight + t.mass_y * length * (s * turn - c * omega**2)
        return turn, normal, mode * t.sliding_friction * normal if mode else force

    def slip(self, state: np.ndarray) -> float:
        """Speed of the tips along the ground [m/s]."""
        return float(state[2] - self.t.spike_length * math.cos(state[0]) * state[1])

    def mode(self, state: np.ndarray, torque: float) -> int | None:
        """How it goes on; None where nothing holds it down."""
        slip = self.slip(state)
        if abs(slip) > 1e-9 * self.t.spike_length * abs(state[1]):
            mode = 1 if slip < 0 else -1
            return mode if self.rates(state, torque, mode)[1] > 0 else None
        _, normal, force = self.rates(state, torque, 0)
        if normal > 0 and abs(force) <= self.t.mu_s * normal:
            return 0
        if not math.isfinite(self.t.mu_s):
            return None
        mode = 1 if force > 0 else -1
        return mode if self.rates(state, torque, mode)[1] > 0 else None

    def run(
        self, state: np.ndarray, torque: float, mode: int, start: float, end: float
    ) -> tuple[float, np.ndarray, str]:
        """Integrate one phase; returns time, state and what ended it."""
        least = 1e-11 * self.t.spike_length * max(abs(float(state[1])), 1e-6)  # slip that is round-off [m/s]

        def slope(_: float, y: np.ndarray) -> list[float]:
            turn, _, force = self.rates(y, torque, mode)
            return [-y[1], turn, force / self.t.mass]

        def change(_: float, y: np.ndarray) -> float:
            if mode:
                return mode * self.slip(y) - least
            _, normal, force = self.rates(y, torque, 0)
            return abs(force) - self.t.mu_s * normal

        events: list[Callable[[float, np.ndarray], float]] = [
            lambda _, y: self.rates(y, torque, mode)[1],  # nothing holds it down
            lambda _, y: y[0] + self.t.lean,  # the next tips are at the ground
            lambda _, y: self.t.lean * (1 + 1e-9) - y[0],  # it has fallen back onto those behind
            *([change] if mode or math.isfinite(self.t.mu_s) else []),
        ]
        for event in events:
            vars(event).update(terminal=True, direction=1 if event is change else -1)  # as scipy has it
        stop = end if math.isfinite(end) else start + self._long(torque)
        solved: Any = solve_ivp(slope, (start, stop), state, "DOP853", events=events, rtol=1e-10, atol=1e-13)
        at, y = float(solved.t[-1]), solved.y[:, -1]
        if mode == 0:
            y[2] = self.t.spike_length * math.cos(y[0]) * y[1]
        if solved.status < 0:
            raise UnfitSettingsError(
                f"a torque of {torque:g} N m: the motion cannot be followed beyond {at:.3g} s ({solved.message})"
            )
        if solved.status == 0:
            return at, y, "torque ends" if math.isfinite(end) else "down"
        which = next(k for k, times in enumerate(solved.t_events) if len(times))
        if which == 3 and mode:  # it may stick again: nothing is left of the slip
            y[2] = self.t.spike_length * math.cos(y[0]) * y[1]
        return at, y, ("lift", "down", "down", "slip ends" if mode else "breaks loose")[which]

    def launched(self, state: np.ndarray, time: float) -> Launch:
        """The launch in this state."""
        t, (beta, omega, along) = self.t, (float(value) for value in state)
        up = t.spike_length * math.sin(beta) * omega
        slid = abs(self.slip(state)) > 1e-9 * t.spike_length * abs(omega)
        return Launch(
            speed=math.hypot(up, along), angle=math.atan2(up, along), spin=omega, slid=slid, rotation=t.lean - beta,
            time=time, lean=t.lean,
        )  # fmt: skip

    def _long(self, torque: float) -> float:
        """Longer than any launch takes [s]: it falls, or is driven, over the top within this."""
        t = self.t
        lever = t.inertia + t.mass_y * t.spike_length**2
        slow = [lever / (t.weight * t.spike_length)] if t.weight > 0 else []
        slow += [lever / torque] if torque > 0 else []
        return 200.0 * math.sqrt(max(slow)) if slow else math.inf


def escape_speed(gravity: float, radius: float) -> float:
    """sqrt(2 g R) [m/s] at the surface of a round body.

    >>> print(f"{escape_speed(gravity=1e-3, radius=300):.3f} m/s")
    0.775 m/s
    """
    return math.sqrt(2 * gravity * radius)


def flight(speed: float, angle: float, *, gravity: float, radius: float | None = None) -> Flight | None:
    """Flight launched at `speed` [m/s] and `angle` from the horizontal [rad]; None where it does not come down.

    On a flat ground v^2 sin(2 angle) / g. On a body of `radius` R [m], with q = v^2 / (g R), it lands at the angle
    2 atan2(q sin cos, 1 - q cos^2) around the body, after Kepler's time; from q = 2 on it escapes. Raises ValueError
    for a gravity or radius of 0 or less, or an angle not between 0 and pi.

    >>> hop = flight(0.07, math.radians(45), gravity=1e-3)
    >>> print(f"{hop.distance:.2f} m in {hop.time:.0f} s")
    4.90 m in 99 s
    """
    _check_ballistics(gravity, radius)
    if not 0 <= angle <= math.pi:
        raise ValueError(f"angle is {angle}: a hop goes up, between 0 and pi")
    s, c = math.sin(angle), math.cos(angle)
    if radius is None:
        time = 2 * speed * s / gravity
        return Flight(distance=speed * c * time, time=time, height=(speed * s) ** 2 / (2 * gravity))
    q = speed**2 / (gravity * radius)
    if q >= 2:
        return None
    axis = radius / (2 - q)
    eccentric = math.sqrt(max(0.0, 1 - q * (2 - q) * c * c))
    e_sin, e_cos = s * math.sqrt(q * (2 - q)), 1 - q  # e sin E, -e cos E, E the eccentric anomaly at launch
    half = math.atan2(e_sin, e_cos)  # pi - E
    time = 2 * (half + e_sin) * math.sqrt(axis**3 / (gravity * radius**2))
    around = 2 * math.atan2(q * s * c, 1 - q * c * c)
    # The peak is a (1 + e) - R; written so that small hops keep their digits.
    height = axis * q * (2 - q) * s * s / (eccentric + 1 - q) if q < 0.5 else axis * (eccentric - (1 - q))
    return Flight(distance=radius * around, time=time, height=height)


def launch_speed_for(distance: float, angle: float, *, gravity: float, radius: float | None = None) -> float:
    """Speed [m/s] that a hop over `distance` [m] along the ground takes when launched at `angle` [rad].

    On a round body q = tan(f / 2) / (sin cos + cos^2 tan(f / 2)), f = distance / R. Raises ValueError where the body is
    escaped first, and for a distance of 0 or less.

    >>> print(f"{launch_speed_for(5, math.radians(45), gravity=1e-3):.4f} m/s")
    0.0707 m/s
    """
    _check_ballistics(gravity, radius)
    check_above_zero("m", distance=distance)
    if not 0 < angle < math.pi / 2:
        raise ValueError(f"angle is {angle}: a hop over a distance is launched between 0 and pi / 2")
    s, c = math.sin(angle), math.cos(angle)
    if radius is None:
        return math.sqrt(distance * gravity / (2 * s * c))
    half = 0.5 * distance / radius
    if half >= math.pi:
        raise ValueError(f"distance = {distance:g} m is once around the body ({2 * math.pi * radius:g} m) or more")
    q = math.sin(half) / (s * c * math.cos(half) + c * c * math.sin(half))
    if not 0 < q < 2:
        raise ValueError(
            f"distance = {distance:g} m: at {math.degrees(angle):.3g} degrees the escape speed, "
            f"{escape_speed(gravity, radius):.4g} m/s, is reached first"
        )
    return math.sqrt(q * gravity * radius)


def _check_ballistics(gravity: float, radius: float | None) -> None:
    check_above_zero("m/s2", gravity=gravity)
    if radius is not None:
        check_above_zero("m", radius=radius)
