"""What `hedgebed diagnose` must know of an effect, as plain data: it stands in the effect's file as ``CANDIDATE``.

A candidate has words for reports and, for each kind of trial that can show it, forms: the shapes that nature's law may
come close to. The numbers of a form are fitted in coordinates in which zero is the base model (1 / length of a
pendulum, exponent - 1). `Number.how` says how the parameter of the term follows. A scale such as the reach of adhesion
is fitted as a logarithm about a typical value, with a prior of one factor of e: otherwise a fit without information
about it would not end. A bent form is fitted only after the plain one, from where that ended.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

__all__ = [
    "LAST", "SETS_IN", "Bend", "Candidate", "Form", "Number", "Push", "Starts", "Tumble", "Typical", "amplitude",
    "bent", "between", "fixed", "free", "logarithm", "prior", "shape", "times",
]  # fmt: skip

LAST = 1000  # Rank of an effect that does not mind where it stands
SETS_IN = "y / (1 + y^q)^(1 / q)"  # In an equation: what `mobilised` computes of a share y and a sharpness q
Starts = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Number:
    """One number of a form: a parameter of the term (tumbles) or a slot of the law (pushes), and how it is fitted."""

    name: str
    fitted: str  # Its name while it is fitted, without the effect's
    how: str = "same"
    """Tumbles: ``same``, ``change`` (`typical` + value), ``logarithm`` (`typical` e^value), ``inverse`` (1 / value,
    infinite at 0), ``fixed`` (always `typical`, not fitted). Pushes: see `experiments.diagnose.push.forms.physical`."""
    typical: float = 0.0
    unit: str = "1"
    value: float = 0.0  # Where fits begin, and the middle of the prior
    std: float = math.inf  # Of the prior; infinite for none
    scale: float = 1.0  # A change that can be seen
    step: float = 0.0  # Of finite differences
    lowest: float = -math.inf
    highest: float = math.inf
    sides: tuple[float, ...] = ()  # Of a bend: where fits begin, in `std`


@dataclass(frozen=True)
class Form:
    """One functional form of an effect. The first number is the amplitude: at 0 the form changes nothing."""

    name: str
    numbers: tuple[Number, ...]
    starts: Starts  # Values of the fitted numbers to begin fits from, in their order
    equation: str = ""  # Of pushes; tumbles have one an effect
    needs: str = ""  # Of pushes: ``retreats``, ``speeds`` or ``drops``, what trials must show for it to be a candidate
    form_std: float = 0.0  # How far nature's amplitude may differ from the form's, relative
    redefines: tuple[str, ...] = ()  # Base parameters that mean another thing beside this form
    stiffness: str = ""  # Of pushes: what K is beside this form, where it redefines it
    becomes: tuple[tuple[str, Callable[..., bool]], ...] = ()
    """Of pushes: another effect, and whether the form is that one at these numbers (slots in SI units, by name)."""


@dataclass(frozen=True)
class Bend:
    """More numbers for some forms: nature's law is never quite the library's."""

    name: str  # Of the bent form, with the plain form's for {}
    of: tuple[str, ...]  # Names of the forms that it bends
    numbers: tuple[Number, ...]
    starts: Starts
    equation: str | Callable[[str], str] = ""  # Of pushes: the bent form's, or what becomes of the plain form's


@dataclass(frozen=True, kw_only=True)
class Typical:
    """What is typical of a campaign of tumbles."""

    sinkage: float  # Depth of a row at rest [m]: the reference of hardening and the reach of adhesion are about this
    weight: float  # On the surface [N]: amplitudes of forces are about a hundredth of it
    friction_speed: float = 0.05  # Sliding speed [m/s]
    wheel_speed: float = 100.0  # Speed of the wheel [rad/s]
    lift_speed: float = 2e-3  # Speed of a tip that moves out [m/s]: the depth at rest times the frequency of bouncing

    @property
    def force(self) -> float:
        """A force that can be seen [N]."""
        return 0.02 * self.weight

    @property
    def moment(self) -> float:
        """A torque that can be seen [N m]."""
        return 0.005 * self.weight

    @property
    def depth(self) -> float:
        """The sinkage, never 0 [m]."""
        return max(self.sinkage, 1e-6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tumble:
    """An effect as a candidate of tumbles. Where the term needs the rig, so do its forms."""

    rank: int = LAST  # Place among the candidates
    forms: Callable[[Typical], tuple[Form, ...]]
    bends: tuple[Bend, ...] = ()
    equation: str  # In the names of the term's parameters
    bench: str = ""  # The measurement that shows it beside any other


@dataclass(frozen=True, kw_only=True, eq=False)
class Push:
    """An effect as a candidate of spikes that move straight down, and what it adds to their law.

    `law` has hooks: plain functions like a term's, whose arguments say by their names what they get. These are slots
    of the effect's own, which are numbers of one trial, and the values below; the hooks may call `mobilised`.

    | hook      | values                                        | result                                          |
    |-----------|-----------------------------------------------|-------------------------------------------------|
    | `loading` | grown, depth, x                               | force of the spring of loading [N]              |
    | `unload`  | at, stiff, bent, z, ever, stiffness           | at [m], stiff [N], bent [1]: the spring is then |
    |           |                                               | loading(at) bent - stiff, never below 0         |
    | `damper`  | spring                                        | factor on the damper [1]                        |
    | `force`   | z, v, x, way, share, most, ever, radius_depth | force to add [N]                                |
    | `pull`    | the same                                      | force to subtract [N]                           |
    | `settle`  | gone, z, span                                 | `gone` [m] after `span` [s] more at the depth z |
    | `mass`    | z, x, reference                               | mass [kg] carried along while a drop sinks      |

    `grown`: the force so far; `x` = z / D; `at`: depth at which the loading curve is read; `most` and `ever`: deepest
    depth since it entered, and of all; `way`: direction of the motion, -1 to 1; `share`: of a friction that takes a
    distance to turn round, -1 to 1; `gone`: how far the bed has given way for good by this effect. The loading curve is
    read less deep by the sum over all effects. `z` of `settle`: the depth less what the other effects have given way;
    `radius_depth`: at which the tip is wholly in; `reference`: D. Depths in m, speeds in m/s, downwards.
    """

    rank: int = LAST  # Place among the candidates, and in the law
    forms: tuple[Form, ...]
    bends: tuple[Bend, ...] = ()  # Each may be bent again by those that follow it
    law: Mapping[str, Callable[..., Any]]
    lengths: Mapping[str, float] = field(default_factory=dict)
    """Slots that are never 0, and what they are where the effect is off."""
    turning: tuple[str, str] | None = None
    """Slots of a friction that takes a distance to turn round: its bound and that distance."""
    steep: tuple[tuple[str, ...], str] | None = None
    """Slots of a friction that rises with speed: its parts, of which the sum bounds it [N], and the speed [m/s] over
    which it rises, 0 where it does not."""
    apart: Mapping[str, str] = field(default_factory=dict)  # Another effect -> the experiment that separates the two


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """An effect among the candidates of a diagnosis."""

    meaning: str  # What it is, a clause
    confirm: str  # The measurement that shows it by itself, and what should be seen; {one}, {body}: a spike or a tip
    tumble: Tumble | None = None
    push: Push | None = None


def free(name: str, unit: str, scale: float, lowest: float = -math.inf, highest: float = math.inf, *,
         how: str = "same", typical: float = 0.0, fitted: str = "") -> Number:  # fmt: skip
    """A number without a prior, from 0."""
    fitted = fitted or (f"{name}_change" if how == "change" else name)
    return Number(name=name, fitted=fitted, how=how, typical=typical, unit=unit, scale=scale, step=0.02 * scale,
                  lowest=lowest, highest=highest)  # fmt: skip


def prior(name: str, unit: str, std: float, scale: float, step: float, lowest: float, highest: float, *,
          typical: float | None = None) -> Number:  # fmt: skip
    """A number about 0, or about `typical`, to within `std`."""
    fitted, how = (name, "same") if typical is None else (f"{name}_change", "change")
    return Number(name=name, fitted=fitted, how=how, typical=typical or 0.0, unit=unit, std=std, scale=scale, step=step,
                  lowest=lowest, highest=highest)  # fmt: skip


def logarithm(name: str, typical: float, *, std: float = 1.0, lowest: float = -4.0) -> Number:
    """A scale, as its logarithm over the typical one."""
    return Number(name=name, fitted=f"log_{name}", how="logarithm", typical=typical, std=std, scale=0.5, step=0.02,
                  lowest=lowest, highest=4.0)  # fmt: skip


def fixed(name: str, value: float) -> Number:
    """A parameter of the term that the form sets and no fit changes."""
    return Number(name=name, fitted="", how="fixed", typical=value)


def shape(name: str, typical: float, std: float, lowest: float, highest: float, unit: str = "1", *,
          log: bool = False, sides: tuple[float, ...] = (-0.7, 0.7)) -> Number:  # fmt: skip
    """A number that bends a form, counted from the value that changes nothing; `log`: its logarithm over that."""
    fitted, how = (f"log_{name}", "logarithm") if log else (f"{name}_change", "change")
    return Number(name=name, fitted=fitted, how=how, typical=typical, unit="1" if log else unit, std=std,
                  scale=0.3 * std, step=0.02 * std, lowest=lowest, highest=highest, sides=sides)  # fmt: skip


def bent(word: str, of: str | tuple[str, ...], *numbers: Number) -> Bend:
    """A bend of tumbles, which begins at every combination of its numbers' sides."""
    starts = tuple(product(*(tuple(side * number.std for side in number.sides) for number in numbers)))
    return Bend(f"{{}}, {word}", (of,) if isinstance(of, str) else of, numbers, starts)


def amplitude(slot: str, how: str, std: float, lowest: float, highest: float) -> Number:
    """The first number of a form."""
    return Number(name=slot, fitted=slot, how=how, std=std, scale=max(0.05 * std, 1e-3), step=1e-4, lowest=lowest,
                  highest=highest)  # fmt: skip


def between(slot: str, how: str, low: float, high: float, *, value: float | None = None, std: float = 0.0) -> Number:
    """Another number: about the middle, to within half of the range; of a bend about `value`, to within `std`."""
    if value is None:
        return Number(name=slot, fitted=slot, how=how, value=0.5 * (low + high), std=0.5 * (high - low), scale=0.2,
                      step=1e-3, lowest=low, highest=high)  # fmt: skip
    return Number(name=slot, fitted=slot, how=how, value=value, std=std, scale=0.2 * std, step=1e-3, lowest=low,
                  highest=high)  # fmt: skip


def times(factor: str, *clauses: str, instead: str = "") -> Callable[[str], str]:
    """A function that adds a factor, and the clauses that define it, to a form's equation, `instead` of one clause."""

    def made(text: str) -> str:
        first, *rest = text.replace(instead, "").split(", ") if instead else text.split(", ")
        return ", ".join([f"{first} * {factor}", *clauses, *rest])

    return made
