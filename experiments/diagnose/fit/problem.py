"""What the statistics of `hedgebed diagnose` ask of a kind of trial: the interface between them and the physics.

The core (`fitting`, `gate`, `evidence`, `search`) knows nothing of spikes, platforms or sensors. A `Problem` holds the
measured data of one campaign and a model with named parameters, and answers with *whitened residuals*:
(measured - model) / std, one number per valid sample, unit variance and no correlation where the model is right. Data
enter a residual linearly, which the gate's bootstrap uses: data made up at values v0 have the residuals
r(v) - r(v0) + noise.

Names of values: a base parameter by its own name (``stiffness``), a nuisance of a trial as ``gravity_sim[001]``, an
effect's as ``pendulum.curvature``. Units are SI. A parameter that is not among the values given has its `value`.

Where times may jitter (`jitter`), a kind of trial has `clocks` (channels whose times come from one clock), `readings`
(what the model reads so many seconds later) and `shake` (takes jitter into the whitening) as well. Where replicates may
wander apart (`unrest`), it has `calm`, and `calmed` once that was called.

A kind of trial is a class with these members (no base class to inherit), made by a function
``make_problem(campaign: Campaign) -> Problem`` in ``experiments/diagnose/<kind>_problem.py``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Finding", "Form", "Parameter", "Problem", "Samples", "TrialInfo", "Values"]

Array = NDArray[np.float64]
Values = Mapping[str, float]
"""Name of a parameter -> value."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number that a fit may change."""

    name: str
    """As in `Values`; of a nuisance ``kind[trial]``, of an effect ``effect.name``."""
    unit: str
    value: float
    """Where fits begin, and the middle of the prior. Of an effect's amplitude: 0."""
    std: float = math.inf
    """Gaussian prior, one sigma; infinite for none. A parameter that is exact is no Parameter."""
    scale: float
    """A size typical of a change that can be seen (above 0): the step of finite differences is 1e-4 of it, unless
    `step` says otherwise, and fits work in units of it."""
    lowest: float = -math.inf
    highest: float = math.inf
    trial: str | None = None
    """Id of the one trial that it touches; None for a shared parameter."""
    kind: str = ""
    """Of a nuisance: what it is in every trial (``gravity_sim``). Nuisances of one kind are changed in all trials at
    once when a Jacobian is made, since none touches another's trial."""
    step: float | None = None
    """Step of finite differences, in units of the parameter; for models whose contacts make small steps rough."""
    least: float | None = None
    """Of what may differ between replicates: the std below which it says nothing; None: the problem's own."""


@dataclass(frozen=True, kw_only=True)
class Form:
    """One functional form of one effect. With its `amplitude` at 0 it changes nothing."""

    effect: str
    """Id of the effect, as in docs/diagnose.md: ``depth-hardening``."""
    name: str
    """Of the form: ``power``. Unique within the effect."""
    parameters: tuple[Parameter, ...]
    """Shared ones (``trial`` None) or a trial's own; names begin with ``<effect>.``."""
    amplitude: str
    """Name of the parameter that at 0 is the base model."""
    starts: tuple[Values, ...] = ()
    """Values of the form's parameters to begin fits from, amplitudes that can be seen, other signs and lengths among
    them; every one is tried. Empty: 1 and, where the bounds allow, -1 scale of the amplitude."""
    redefines: tuple[str, ...] = ()
    """Base parameters that mean another thing beside this form (a straight spring's slope is not that of a bent one
    at its beginning): what was stated of them is no measure of it."""
    linear: bool = False
    """Whether the residuals are close to linear in all of the form's parameters (then one start does)."""

    @property
    def id(self) -> str:
        """``effect:name``"""
        return f"{self.effect}:{self.name}"


@dataclass(frozen=True, kw_only=True)
class TrialInfo:
    """What the core must know of a trial."""

    id: str
    condition: tuple[object, ...]
    """Trials of one condition are replicates. What is sorted next to one another is alike."""
    settings: Mapping[str, float] = field(default_factory=dict)
    """Numbers by which a person localises: ``torque_N_m``, ``gravity_m_s2``, ``speed_m_s``, ``diameter_m``."""


@dataclass(frozen=True, kw_only=True)
class Samples:
    """The valid samples of a trial, in the order of its residuals; shapes [sample_count].

    A channel's samples lie together and in the order of their times.
    """

    time: Array
    """On the trial's clock [s]."""
    channel: NDArray[np.str_]
    """``x y theta gyro ax ay wheel depth force accel``"""
    std: Array
    """Of the sensor as campaign.toml states it, in the channel's unit (of a driven force at the base model's fit,
    the smoothed depth's error included)."""
    block: Array | None = None
    """Which samples share noise that is not white: equal numbers. None: time and channel say it all."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something wrong with the data that was found, and what was done."""

    trial: str
    what: str
    """One plain sentence, which also says what was done: set aside, modelled, or kept."""
    channel: str | None = None
    from_s: float | None = None
    to_s: float | None = None
    set_aside: bool = False
    doubt: bool = False
    """Whether a person has to put it right before a name can be trusted: a unit, a sign, a zero, a clock."""


class Problem(Protocol):
    """One campaign as the statistics see it."""

    @property
    def kind(self) -> str:
        """``penetration`` or ``tumble``."""

    @property
    def whole(self) -> str:
        """All that takes part in a trial, as in "what comes back is in ..."."""

    @property
    def trials(self) -> tuple[TrialInfo, ...]:
        """The trials that can be used, in the campaign's order."""

    @property
    def base(self) -> tuple[Parameter, ...]:
        """Parameters of the base model: shared ones (from [uncertainty]) and each trial's nuisances."""

    @property
    def forms(self) -> tuple[Form, ...]:
        """The library: every effect that this campaign could show, each in one or several forms."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found wrong with the data when it was read."""

    @property
    def design(self) -> str:
        """Digest of what decides the gate: sampling, conditions, noise, priors; not of the measured numbers."""

    def samples(self, trial: str) -> Samples:
        """The valid samples of a trial."""

    def evaluate(
        self, points: Sequence[Values], forms: Sequence[Form], trials: Sequence[str]
    ) -> list[dict[str, Array]]:
        """For each point the whitened residuals of each trial, shape [sample_count], for the base model plus `forms`.

        All points at once, so that a batched model can take them together. Always finite: where the model cannot be
        integrated, residuals are 1e3. The whitening must not depend on the values (between calls of `rewhiten`).
        """

    def rewhiten(self, values: Values, forms: Sequence[Form]) -> None:
        """Take the whitening at these values from now on. Does nothing where it does not depend on them."""

    def chi_square(self, values: Values, forms: Sequence[Form], trial: str) -> tuple[float, int]:
        """Sum of squared residuals with the std that docs/diagnose.md says for `gap`; number of samples."""

    def noise(self, random: np.random.Generator, trial: str) -> Array:
        """A draw of the whitened residuals of a right model, shape [sample_count]; mostly standard normal."""

    def phases(self, values: Values, forms: Sequence[Form], trial: str) -> NDArray[np.str_]:
        """The state at each sample: stand, pivot, slip, hop; for penetration free, in, rest, out."""

    def reported(self, values: Values, form: Form) -> dict[str, tuple[float, str]]:
        """What diagnosis.json says of a form: name -> (value, unit), under the fixed names where there are such.

        A smooth function of the form's parameters: the core carries uncertainties through it by differences.
        """

    def latent(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, Array]:
        """Columns of latent.csv: ``t_s`` first, then ``latent_...`` (the force, torque or error of a sensor that the
        model lacks, by time), then what it might depend on (``depth_m``, ``velocity_m_s``, ...); all of one shape."""

    def compare(self, values: Values, forms: Sequence[Form], trial: str) -> dict[str, dict[str, Array]]:
        """Channel -> {"t_s", "measured", "model"} for plots, at the samples; units those of the channel."""

    def write_model(self, path: str, values: Values, forms: Sequence[Form]) -> None:
        """model.toml: the tables with the fitted values, and [[effect]] tables."""

    def next_experiment(self, first: Form, second: Form, values: Values) -> str:
        """One sentence: the trial or bench measurement that would tell the two apart."""
