"""Settings of `hedgebed fmu`: the platform, its ground and its start; the importing program may change most of them."""

from typing import Self

from pydantic import Field, FiniteFloat, model_validator

from experiments.platform.settings import Assignments, NotNegative, PlatformSettings, Positive
from rigid.checks import nearest
from rigid.ground.laws import GROUNDS
from rigid.ground_file import is_ground_file

from . import say

__all__ = ["OUTPUTS", "FmuSettings"]

OUTPUTS = {
    "x": ("m", "Position of the centre along the surface"),
    "z": ("m", "Height of the centre over the undisturbed surface"),
    "theta": ("rad", "Angle of the platform, clockwise"),
    "vx": ("m/s", "Velocity along the surface"),
    "vz": ("m/s", "Velocity upwards"),
    "omega": ("rad/s", "Angular velocity of the platform, clockwise"),
    "wheel_speed": ("rad/s", "Speed of the wheel; a positive torque of the motor increases it"),
    "force_x": ("N", "Force of the ground along the surface, mean of the last inner step"),
    "force_z": ("N", "Force of the ground upwards, likewise"),
    "moment": ("N.m", "Moment of the ground about the centre, clockwise, likewise"),
    "depth": ("m", "Depth of the lowest tip"),
    "kinetic_energy": ("J", "Of platform and counterweight, without the wheel's spin"),
    "potential_energy": ("J", "Weight times height of the centre"),
    "torque_work": ("J", "Work of motor and brake on the platform"),
    "ground_work": ("J", "Work on the ground"),
    "ground_energy": ("J", "Stored in the ground's springs"),
    "energy_residual": ("J", "Torque work less ground work and less the increase of both energies"),
}
"""Unit and meaning of each output of the FMU, by name; beside them stands `normal_force` of each row of spikes [N]."""


class FmuSettings(PlatformSettings):
    """A platform on spikes, in the plane, for another simulation program."""

    ground: str = "spring-damper"
    """Law of the force of the ground: spring-damper, hunt-crossley, power, katsuragi-durian, bekker or rft, or the
    file of one (ground.toml, as hedgebed calibrate writes it)."""
    ground_parameters: Assignments = ()
    """Parameters of a law other than the spring-damper, for one spike, as name=value in SI units."""

    rig: Positive | None = None
    """Simulated gravity of the offloading rig, in g [9.80665 m/s2]; 0.0085 if neither rig nor gravity is given."""
    gravity: Positive | None = Field(None, description="Gravity of a free platform, without a rig [m/s2].")

    height: NotNegative | None = None
    """Height of the centre over the surface at the start [m]; if not given, the platform rests on two rows of
    spikes."""
    x_start: FiniteFloat = Field(0.0, description="Position along the surface at the start [m].")
    theta_start: FiniteFloat = Field(0.0, description="Angle at the start, clockwise [rad]; needs height.")
    vx_start: FiniteFloat = Field(0.0, description="Velocity along the surface at the start [m/s].")
    vz_start: FiniteFloat = Field(0.0, description="Velocity upwards at the start [m/s]; needs height.")
    omega_start: FiniteFloat = Field(0.0, description="Angular velocity at the start, clockwise [rad/s].")
    wheel_speed_start: FiniteFloat = 0.0
    """Speed of the wheel at the start [rad/s]; a positive torque of the motor increases it. A brake on a wheel with a
    negative speed turns the platform clockwise."""
    torque_in_flight: bool = False
    """Whether motor and brake act in flight too. Without it they act while a spike touches, as in hedgebed tumble."""

    longest_step: float = Field(4e-4, gt=0, le=1e-3)
    """Longest step inside the FMU [s]; a communication step is divided into equal steps that are no longer."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for finding in (self._of_ground(), self._of_gravity(), self._of_start()):
            if finding:
                raise ValueError(finding)
        return self

    def _of_ground(self) -> str | None:
        own = self.stiffness is not None or self.damping is not None
        if is_ground_file(self.ground):
            return say("of_a_file", s=self) if own or self.ground_parameters else None
        if self.ground not in GROUNDS:
            return say("no_ground", s=self, known=nearest(self.ground, GROUNDS))
        if self.ground == "spring-damper":
            return say("no_parameters", given=" ".join(self.ground_parameters)) if self.ground_parameters else None
        return say("of_the_spring", s=self) if own else None

    def _of_gravity(self) -> str | None:
        return say("gravity_and_rig", s=self) if self.gravity is not None and self.rig is not None else None

    def _of_start(self) -> str | None:
        if self.height is not None:
            return None
        moved = [name for name in ("theta_start", "vz_start") if getattr(self, name)]
        return say("needs_height", name=moved[0], value=getattr(self, moved[0])) if moved else None
