"""What a term of the model is: named, with parameters in units, and a few plain functions ("hooks").

A hook is plain arithmetic on numbers, without loops or early returns. So the same source runs as Python in the accurate
integrator and, compiled by Taichi, in the batch. Mathematical functions are those of `math`, imported by name (`from
math import exp`). A hook may call plain functions of another module (`rigid.terms.curves`), none of its own file. What
its arguments are called says what it gets: first the fixed ones listed below, then the term's own parameters, by name,
in any number.

| hook                 | fixed arguments           | gives                                                        |
|----------------------|---------------------------|--------------------------------------------------------------|
| `up`                 |                           | (x, y) of the vertical in the surface's axes, a unit vector  |
| `tip_radius`         |                           | radius of the balls at the tips [m]                          |
| `mass`               | s                         | xx, xy, yy, x theta, y theta, theta theta of the mass matrix |
| `potential`          | s                         | V [J]                                                        |
| `force`              | s                         | generalised force (x [N], y [N], theta [N m]): everything    |
|                      |                           | but M q'': -dV/dq, terms in the square of speeds, drags      |
| `loss`               | s                         | power [W] that this force dissipates                         |
| `torque_factor`      | s                         | factor on the flywheel's torque [1]                          |
| `vertical_friction`  | s                         | bound [N] of a dry friction on the vertical motion           |
| `rotation_friction`  | s                         | bound [N m] of a dry friction on the rotation                |
| `crater`             |                           | share of the deepest depth that stays [1], 0 to below 1      |
| `hollow`             |                           | 1 where a tip in its crater still touches, unloaded; else 0  |
| `stiffen`            | depth, force, work        | the law's force [N] and work [J] at a new depth, altered     |
| `unload`             | depth, top, force         | that force [N] where the tip has been down to `top`, altered, |
|                      |                           | at `top` itself it is left; not on laws with a memory        |
| `hold`               | s, depth, held            | pull [N], energy stored [J]; held: deepest since it touched   |
| `grip`               | s, depth, held            | load that friction sees beside the normal force [N]          |
| `rate_force`         | s, depth, rate            | normal force [N] that dissipates, by the rate of sinking     |
| `rate_pull`          | s, depth, rate, held      | the same of a term that depends on unloading, too            |
| `side_force`         | s, depth, slip            | tangential force [N] on the tip against its slip speed       |
| `settle`             | s, depth, slip, lean,     | speed at which the ground under a touching tip gives way     |
|                      | gone                      | for good by this term [m/s]; lean: sine of the spike's angle;|
|                      |                           | gone: how far it has given way by this term [m]              |
| `settled`            | s                         | share of that depth at rest by which it has at the start, <1 |
| `added_mass`         | depth                     | mass of ground [kg] that a tip carries along while it sinks, |
|                      |                           | and its slope over depth [kg/m]; depth: since it touched     |
| `wall`               |                           | slope of a crater's wall [1]; 0: a crater is forgotten once  |
|                      |                           | the tip is above the undisturbed surface                     |
| `friction_factor`    | s, slip                   | factors on mu_s and mu_d [1]                                 |
| `inner_mass`         | s                         | inertia of a coordinate of the term's own; 0: it has none    |
| `inner_start`        | s                         | that coordinate in static equilibrium, its force then is 0   |
| `inner_force`        | s                         | force on it: inner_mass d2(inner)/dt2                        |
| `inner_holds`        | s                         | positive as long as the present mode holds, in m or rad      |
| `clock`              | written                   | true time [s] of a time on the IMU's clock                   |
| `lens`               | square                    | x and y as the camera sees them over the true ones [1];      |
|                      |                           | square: of the distance from the start [m2]                  |

`settle` moves the undisturbed surface under one tip. The ground's law, and what stands on it (`crater`, `unload`,
`hold`), read the depth below the surface that is left, depth - s.given_way. `rate_force` and `side_force` get the whole
depth. Each term with `settle` has a state of its own, `gone`, and s.given_way is the sum over these terms. Its `depth`
is the whole depth less what the other terms have given way: with one such term, the whole depth. So each term takes its
share of the force that the others leave. What gives way takes the elastic force's work with it, so it never gives
energy.

The four of `inner` go together and are for a term with something inside that moves: one coordinate `s.inner`, its rate
`s.inner_speed` and one of two modes, `s.inner_mode` = 1 at the start, else 0. It is integrated beside the platform's
motion; `force`, `potential` and `loss` of the same term look at it. Where `inner_holds` passes through zero is an
event: the mode changes there, and only there. At most one term of a model has one.

A sensor's term (`sensor=True`) has `clock` or `lens`, which get numpy arrays and are applied in `rigid.sensors`.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rigid.checks import Parameter, check_parameters

__all__ = ["FIXED_ARGUMENTS", "STATE_FIELDS", "Parameter", "Term"]

FIXED_ARGUMENTS: dict[str, tuple[str, ...]] = {
    "up": (),
    "tip_radius": (),
    "mass": ("s",),
    "potential": ("s",),
    "force": ("s",),
    "loss": ("s",),
    "torque_factor": ("s",),
    "vertical_friction": ("s",),
    "rotation_friction": ("s",),
    "crater": (),
    "hollow": (),
    "stiffen": ("depth", "force", "work"),
    "unload": ("depth", "top", "force"),
    "hold": ("s", "depth", "held"),
    "grip": ("s", "depth", "held"),
    "rate_force": ("s", "depth", "rate"),
    "rate_pull": ("s", "depth", "rate", "held"),
    "side_force": ("s", "depth", "slip"),
    "settle": ("s", "depth", "slip", "lean", "gone"),
    "settled": ("s",),
    "added_mass": ("depth",),
    "wall": (),
    "friction_factor": ("s", "slip"),
    "inner_mass": ("s",),
    "inner_start": ("s",),
    "inner_force": ("s",),
    "inner_holds": ("s",),
    "clock": ("written",),
    "lens": ("square",),
}
"""The hooks and what each gets before its parameters."""

STATE_FIELDS = (
    "time", "x", "y", "theta", "vx", "vy", "omega", "wheel_speed", "cosine", "sine", "up_x", "up_y",
    "mass", "inertia", "length", "stance", "counterweight", "gravity", "weight", "torque",
    "inner", "inner_speed", "inner_mode", "given_way",
)  # fmt: skip
"""What `s` holds, SI units: the state of the platform; cosine and sine of theta; the vertical's direction; then the
trial's own numbers: mass, inertia, spike length, height of the centre over tips that only just touch at theta = 0,
counterweight, gravity that pulls at the centre of mass, weight on the surface, and the torque that acts now; then the
coordinate of a term that has one of its own; last how far the ground under the tip in question has given way [m]."""

INNER_HOOKS = ("inner_mass", "inner_start", "inner_force", "inner_holds")


@dataclass(frozen=True, kw_only=True, eq=False)
class Term:
    """One named term of the model. Raises ValueError for a hook there is not, or one whose arguments do not fit."""

    id: str
    summary: str
    acts: str  # Where it acts, in words
    parameters: tuple[Parameter, ...] = ()
    source: str
    limits: str
    hooks: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    rank: int = 1000  # Place in the sum over terms; those of one rank are summed by their ids
    sensor: bool = False  # Whether it alters a sensor, not the motion
    needs_rig: bool = False  # Whether it has a meaning in the gravity-offloading rig only

    def __post_init__(self) -> None:
        own = {parameter.name for parameter in self.parameters}
        for name, hook in self.hooks.items():
            if name not in FIXED_ARGUMENTS:
                raise ValueError(f"{self.id}: there is no hook {name!r}; there is {', '.join(FIXED_ARGUMENTS)}")
            fixed = FIXED_ARGUMENTS[name]
            arguments = tuple(inspect.signature(hook).parameters)
            if arguments[: len(fixed)] != fixed:
                raise ValueError(f"{self.id}: {name}{arguments} must begin with {fixed}")
            unknown = set(arguments[len(fixed) :]) - own
            if unknown:
                raise ValueError(f"{self.id}: {name} asks for {sorted(unknown)}; its parameters are {sorted(own)}")
        inner = [name for name in INNER_HOOKS if name in self.hooks]
        if inner and len(inner) < len(INNER_HOOKS):
            raise ValueError(f"{self.id}: {', '.join(inner)} without the others of {', '.join(INNER_HOOKS)}")

    @property
    def on_torque_alone(self) -> bool:
        """Whether it acts on the flywheel's torque and on nothing else."""
        return set(self.hooks) == {"torque_factor"}

    def arguments(self, hook: str) -> tuple[str, ...]:
        """Names of the parameters that `hook` takes, in its order."""
        return tuple(inspect.signature(self.hooks[hook]).parameters)[len(FIXED_ARGUMENTS[hook]) :]

    def values(self, given: Mapping[str, Any]) -> dict[str, float]:
        """All parameters, as given or by default. Raises ValueError as `check_parameters`."""
        return check_parameters(self.parameters, given, self.id)
