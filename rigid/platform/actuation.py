"""Flywheels: what a motor and a brake can do to one, over time.

Conventions of the planar model: a torque on the platform is the reaction of a flywheel, whose absolute speed changes as
|d omega_w / dt| = tau / J_w. A motor drives the wheel against the platform's turning sense. It ends when the wheel is
at its limit. A brake stops a wheel that turns with the platform, and ends then.
"""

import math
from dataclasses import dataclass
from typing import Literal

from rigid.checks import check_above_zero

__all__ = ["Flywheel", "TorqueHistory"]


@dataclass(frozen=True, kw_only=True)
class Flywheel:
    """One flywheel with its motor and its brake. Raises ValueError for numbers that none can have."""

    inertia: float  # J_w about its axis [kg m2]
    max_speed: float = math.inf  # Largest speed [rad/s]
    motor_torque: float = math.inf  # What the motor can give at most [N m]
    brake_torque: float = math.inf  # What the brake can give at most [N m]
    brake_time: float | None = None  # What it takes to stop the wheel from any speed [s]; None: it has a torque
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Its axis in the body, of length 1; +y turns the platform towards +x."""

    def __post_init__(self) -> None:
        check_above_zero("kg m2, of a wheel", inertia=self.inertia)
        limits = {key: getattr(self, key) for key in ("max_speed", "motor_torque", "brake_torque")}
        check_above_zero("of a wheel", **{key: value for key, value in limits.items() if value != math.inf})
        if abs(math.hypot(*self.axis) - 1) > 1e-9:
            raise ValueError(f"axis of a wheel is {self.axis}: it must have length 1")


@dataclass(frozen=True, kw_only=True)
class TorqueHistory:
    """Torque on the platform about one wheel's axis, piecewise constant in time, and what the wheel makes of it.

    Raises ValueError for a torque beyond that of motor or brake, and for a brake without a wheel speed. The same is
    raised for a wheel beyond its limit, and for times that do not increase.
    """

    wheel: Flywheel
    pieces: tuple[tuple[float, float], ...]
    """(until [s], torque on the platform [N m]), in the order of time; after the last there is none."""
    actuator: Literal["motor", "brake"] = "motor"
    wheel_speed_0: float = 0.0
    """Speed of the wheel at t = 0 [rad/s]: of a motor against the torque, of a brake along it."""

    def __post_init__(self) -> None:
        if self.actuator not in ("motor", "brake"):
            raise ValueError(f"actuator is {self.actuator!r}: it must be motor or brake")
        most = self.wheel.motor_torque if self.actuator == "motor" else self.wheel.brake_torque
        before = 0.0
        for until, torque in self.pieces:
            if not until > before:
                raise ValueError(f"torque_until is {until}: it must be later than {before} s")
            if not (math.isfinite(torque) and abs(torque) <= most * (1 + 1e-12)):
                raise ValueError(f"torque is {torque} N m: the {self.actuator} gives at most {most:g} N m")
            before = until
        if abs(self.wheel_speed_0) > self.wheel.max_speed:
            raise ValueError(
                f"wheel_speed_0 is {self.wheel_speed_0} rad/s: the wheel turns at {self.wheel.max_speed:g} at most"
            )
        if self.actuator == "brake":
            if not self.wheel_speed_0 > 0:
                raise ValueError(f"wheel_speed_0 is {self.wheel_speed_0}: a brake needs a wheel that turns (rad/s)")
            if any(torque < 0 for _, torque in self.pieces):
                raise ValueError("torque of a brake is negative: it pulls the platform along with the wheel")

    @classmethod
    def constant(
        cls, wheel: Flywheel, torque: float, until: float = math.inf, *,
        actuator: Literal["motor", "brake"] = "motor", wheel_speed_0: float = 0.0,
    ) -> "TorqueHistory":  # fmt: skip
        """A constant `torque` [N m] from t = 0 to `until` [s]."""
        return cls(wheel=wheel, pieces=((until, torque),), actuator=actuator, wheel_speed_0=wheel_speed_0)

    @property
    def spin(self) -> float:
        """Angular momentum of the wheel along the axis at t = 0 [N m s], with the sign it has for the body."""
        return self.wheel.inertia * self.wheel_speed_0 * (1.0 if self.actuator == "brake" else -1.0)

    @property
    def times(self) -> tuple[float, ...]:
        """When the demanded torque changes [s]."""
        return tuple(until for until, _ in self.pieces if math.isfinite(until))

    def demanded(self, time: float) -> float:
        """Torque on the platform that is asked for at `time` [s], whatever the wheel can do [N m]."""
        for until, torque in self.pieces:
            if time < until:
                return torque
        return 0.0

    def limits(self) -> tuple[float, float]:
        """Between which speeds along the axis the wheel may be driven [rad/s]; at the end of them the torque ends.

        The wheel's speed falls by torque * dt / J_w. A brake stops at rest, a motor at the limit of the wheel.
        """
        if self.actuator == "brake":
            return 0.0, self.wheel.max_speed
        return -self.wheel.max_speed, self.wheel.max_speed

    def torque(self, time: float, speed: float) -> float:
        """Torque on the platform [N m] at `time` [s] with the wheel at `speed` along its axis [rad/s]."""
        asked, (low, high) = self.demanded(time), self.limits()
        if (asked > 0 and speed <= low) or (asked < 0 and speed >= high):
            return 0.0
        return asked

    def impulse(self) -> float:
        """All that it gives, contact or not [N m s]: the wheel stops or saturates before the last piece, or not."""
        speed, start = self.spin / self.wheel.inertia, 0.0
        low, high = self.limits()
        first = speed
        for until, torque in self.pieces:
            speed = min(high, max(low, speed - torque * (until - start) / self.wheel.inertia)) if torque else speed
            start = until
        return (first - speed) * self.wheel.inertia
