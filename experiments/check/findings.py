"""What is implausible about a campaign, as findings that name their trial; and sensors noisier than stated."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, TumbleCampaign
from experiments.campaign.tables import PenetrationTrial, TumbleTrial

from .pushes import depth_zeros, force_units, penetration_oddities
from .shifted import shifted_depths
from .tumbles import tumble_oddities
from .units import noise_unit, push_units
from .words import Finding, row_noise, say, times, unit_words

__all__ = ["find_implausible", "loud_sensors", "missing_sensors", "said_once", "without_companions"]

_MANY = 4  # trials of which the same is reported once
_NOISY, _QUIET = 2.0, 0.1  # times the stated noise; coloured noise has less from row to row, but not so little
_NAMED = ("looks like", "would say so")  # words of a finding that names a unit
_FOLLOWS = ("by a jump that no motion makes", "jumps so often", "what [sensors.", "its zero is to be taken off")
"""Words of findings that follow from such a unit."""
_UNITS = ("is force_N in", "is depth_m in", "is t_s in", "is x_m in", "is y_m in", "looks like")
"""Words that ask for a unit."""
_ZERO_OFF, _SETS_IN = "subtract its zero", "the force sets in at"  # words of a zero that is off
_OFF_SCALE = "in other units (N/mm, g)"  # words of a force that is out of all proportion
_TOGETHER = (frozenset(("x", "y", "theta")), frozenset(("gyro", "ax", "ay")), frozenset(("wheel",)),
             frozenset(("depth",)), frozenset(("force",)), frozenset(("accel",)))  # fmt: skip
"""Channels of one sensor."""
_TURNING = (frozenset(("theta", "gyro")), frozenset(("x", "y")), *_TOGETHER[2:])
"""Channels of which a unit is named once."""


class _Scatter(NamedTuple):
    """Scatter of a column from row to row."""

    ratio: float  # over the noise that is stated, which is > 0
    stated: float  # in the column's unit


def find_implausible(campaign: Campaign) -> list[Finding]:
    """What is implausible, a sentence each, trial after trial, what is alike in many of them once."""
    return said_once(_each_implausible(campaign))


def without_companions(campaign: Campaign, found: Sequence[Finding]) -> list[Finding]:
    """`found` without what follows from a unit that is named: a marker "lost", a zero "off", a noisier sensor. A column
    in degrees under a heading in radians jumps and scatters 57 times as much as is stated: reported once."""
    named = [f for f in _each_implausible(campaign) if f.channel and any(words in f.what for words in _NAMED)]

    def follows(finding: Finding) -> bool:
        if not any(words in finding.what for words in _FOLLOWS) or any(words in finding.what for words in _NAMED):
            return False
        channel = finding.channel or ""
        return any(
            any(cause.channel in sensor and channel in sensor for sensor in _TOGETHER)
            or (channel == "theta" and "theta_rad looks like" in cause.what)
            for cause in named
            if finding.trial in ("", cause.trial)
        )

    return [finding for finding in found if not follows(finding)]


def _each_implausible(campaign: Campaign) -> list[Finding]:
    """What is implausible, trial after trial."""
    tables = campaign.tables
    found: list[Finding] = []
    for trial in tables.trial:
        if isinstance(tables, PenetrationCampaign):
            assert isinstance(trial, PenetrationTrial)
            recording = campaign.recording(trial.id, "data")
            odd = [] if recording is None else list(penetration_oddities(tables, trial, recording))
        else:
            assert isinstance(trial, TumbleTrial)
            odd = list(tumble_oddities(campaign, tables, trial))
        found += [
            Finding(
                trial=trial.id, channel=channel, what=f"trial {trial.id}: {what}", doubt=True, maybe_effect=maybe_effect
            )
            for channel, what, maybe_effect in odd
        ]
    if not any(finding.channel == "depth" for finding in found):  # in mm, or counted upwards, it begins anywhere
        found += [
            Finding(trial=trial, channel="depth", what=f"trial {trial}: {what}" if trial else what, doubt=True)
            for trial, what in depth_zeros(campaign)
        ]
        known = {finding.trial for finding in found if finding.channel == "depth"}
        found += [
            Finding(trial=trial, channel="depth", what=f"trial {trial}: {what}", doubt=True)
            for trial, what in shifted_depths(campaign) if trial not in known and "" not in known
        ]  # fmt: skip
        units = [Finding(trial="", channel="force", what=what, doubt=True) for what in force_units(campaign)]
        if units:  # more than that the force is off scale
            found = [f for f in found if f.channel != "force" or _OFF_SCALE not in f.what] + units
    if not any(finding.channel == "force" and _ZERO_OFF not in finding.what for finding in found):
        found += [
            Finding(trial=trial, channel=channel, what=f"trial {trial}: {what}" if trial else what, doubt=True)
            for trial, channel, what in push_units(campaign)
        ]
    return _without_zeros([*found, *_units_by_noise(campaign, found)])


def _units_by_noise(campaign: Campaign, found: Sequence[Finding]) -> list[Finding]:
    """Columns whose scatter over the stated noise is the factor of another unit; none for which something that is
    named already may be the cause."""
    named = {f.channel for f in found if any(words in f.what for words in (*_NAMED, *_UNITS))}
    return [
        Finding(trial="", channel=_channel(column), what=_unit_sentence(name, column, scatter), doubt=True)
        for (name, column), scatter in _scatters(campaign).items()
        if noise_unit(column, scatter.ratio) is not None
        and not any(_channel(column) in sensor and named & sensor for sensor in _TURNING)
    ]


def _unit_sentence(name: str, column: str, scatter: _Scatter) -> str:
    return say(
        "sensor_in_a_unit", column=column, scatter=scatter.ratio * scatter.stated, ratio=times(scatter.ratio),
        name=name, question=noise_unit(column, scatter.ratio),
    )  # fmt: skip


def _without_zeros(found: Sequence[Finding]) -> list[Finding]:
    """Without zeros that are off, of channels that may be in another unit."""
    units = [f for f in found if any(words in f.what for words in (*_NAMED, *_UNITS))]

    def follows(finding: Finding) -> bool:
        channel = "force" if _SETS_IN in finding.what else finding.channel if _ZERO_OFF in finding.what else None
        return any(unit.channel == channel and unit.trial in ("", finding.trial) for unit in units)

    return [finding for finding in found if not follows(finding)]


def said_once(found: Sequence[Finding]) -> list[Finding]:
    """The findings, what is odd alike in many trials once, for the first of these."""
    alike: dict[tuple[str | None, str], list[Finding]] = {}
    for finding in found:
        pattern = re.sub(r"[-+.0-9e]*[0-9]", "#", finding.what.removeprefix(f"trial {finding.trial}: "))
        alike.setdefault((finding.channel, pattern), []).append(finding)
    merged = []
    for first, *more in alike.values():
        if len(more) < _MANY - 1:
            merged += [first, *more]
            continue
        others = ", ".join(
            [*(finding.trial for finding in more[: _MANY - 1]), *(["..."] if len(more) >= _MANY else [])]
        )
        merged.append(replace(first, what=f"{first.what} (and alike in {len(more)} more: {others})"))
    return merged


def loud_sensors(campaign: Campaign) -> list[Finding]:
    """Sensors whose readings scatter from row to row by far more, or far less, than the stated noise. The scatter is
    that of fourth differences, of which a smooth motion leaves little. It is the median of a trial, so that touches do
    not count, and the median over the trials. Grains that jam and yield make the force do the same."""
    found = []
    for (name, column), scatter in _scatters(campaign).items():
        ratio, stated = scatter.ratio, scatter.stated
        if noise_unit(column, ratio) is not None:
            continue  # reported as a unit
        if ratio > _NOISY:
            words = f"{column} scatters from row to row by {ratio * stated:.2g}, {times(ratio)} what "
            cause = f"[sensors.{name}] states: a noisier sensor, or a motion as fast as the sampling"
            found.append(Finding(trial="", channel=_channel(column), what=words + cause))
        elif ratio < _QUIET and name != "depth":  # a driven depth is smooth, and only its smoothing needs its noise
            unit = unit_words(1 / ratio) if ratio > 0 else None
            words = say(
                "quiet_sensor", name=name, std=stated, column=column, ratio=times(1 / ratio),
                unit=unit or "stated too large, or smoothed when it was recorded",
            )  # fmt: skip
            found.append(Finding(trial="", channel=_channel(column), what=words))
    return found


def _scatters(campaign: Campaign) -> dict[tuple[str, str], _Scatter]:
    """(key of [sensors], column) -> how its readings scatter; by the method of `loud_sensors`."""
    tables = campaign.tables
    ratios: dict[tuple[str, str], list[float]] = {}
    stated: dict[tuple[str, str], float] = {}
    for trial in tables.trial:
        for sensor in trial.files:
            recording = campaign.recording(trial.id, sensor)
            if recording is None:
                continue
            for column, name, std in _noises(tables, trial, sensor):
                known = recording[column][np.isfinite(recording[column])]
                # None of too few, and of readings that are held or coarsely rounded.
                if std > 0 and len(known) >= 40 and np.mean(np.diff(known) == 0) <= 0.2:
                    ratios.setdefault((name, column), []).append(row_noise(known) / std)
                    stated[name, column] = std
    return {key: _Scatter(float(np.median(own)), stated[key]) for key, own in ratios.items()}


def _channel(column: str) -> str:
    """``theta`` for ``theta_rad``, ``wheel`` for ``omega_rad_s``."""
    name = column.split("_")[0]
    return "wheel" if name == "omega" else name


def _noises(
    tables: TumbleCampaign | PenetrationCampaign, trial: TumbleTrial | PenetrationTrial, sensor: str
) -> Iterator[tuple[str, str, float]]:
    """(column, key of [sensors], std as stated)."""
    if isinstance(trial, PenetrationTrial):
        for (quantity, unit), name in zip(trial.columns(sensor)[1:], trial.needed, strict=True):
            table = getattr(tables.sensors, name)
            if table is not None:
                yield f"{quantity}_{unit}", name, table.std[0]
        return
    for (quantity, unit), std in zip(trial.columns(sensor)[1:], getattr(tables.sensors, sensor).std, strict=True):
        yield f"{quantity}_{unit}", sensor, std


def missing_sensors(campaign: Campaign) -> list[Finding]:
    """Sensors of a tumble that all trials, or some, do not have."""
    tables = campaign.tables
    if not isinstance(tables, TumbleCampaign):
        return []
    found = []
    for sensor in ("pose", "imu", "wheel"):
        without = [trial.id for trial in tables.trial if sensor not in trial.files]
        if len(without) == len(tables.trial):
            what = f"no trial has a recording of {sensor}: what only it measures stays unknown"
            found.append(Finding(trial="", what=what))
        else:
            found += [Finding(trial=id, what=f"trial {id} has no recording of {sensor}, others have") for id in without]
    return found
