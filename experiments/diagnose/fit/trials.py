"""What the statistics know of a trial: its conditions, its samples, and a further trial that was not made."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["Planned", "Samples", "TrialInfo"]


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

    time: NDArray[np.float64]  # on the trial's clock [s]
    channel: NDArray[np.str_]  # ``x y theta gyro ax ay wheel depth force accel``
    std: NDArray[np.float64]
    """Of the sensor as campaign.toml states it, in the channel's unit (of a driven force at the base model's fit,
    the smoothed depth's error included)."""


@dataclass(frozen=True)
class Planned:
    """A trial that was not made, and how well it would separate two models."""

    settings: Mapping[str, float]  # name with its unit -> value
    what: str  # the trial in words
    nats: float  # evidence to be expected
    tried: int  # trials of the search
    apart: Mapping[str, float] | None = None
    """Where the two predictions differ most over their errors: ``depth_m``, ``speed_m_s`` (negative on the way back),
    ``one_N`` and ``other_N`` with ``one_std_N`` and ``other_std_N``, and ``noise_N`` of one reading. ``one_rests_N``:
    the part of that error that rests on the scatter of the campaign's beds. ``one_beds_N``: standard deviation by other
    beds; ``one_peak_N``: the peak force, with the same. `planned_pushes` adds the beds to the errors and their
    ``one_freedom``; ``model_std_N``, the error of their difference by both models, ``scatter_N``, of a reading in
    another bed, the parts ``model_rests_N`` and ``scatter_rests_N`` of both, and the ``freedom`` of the scatter."""
    compared: tuple["Planned", ...] = field(default=(), repr=False)  # all of the search
