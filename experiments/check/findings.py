"""What is implausible about a campaign, as findings that name their trial; and sensors louder than stated."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from experiments.campaign import Campaign, PenetrationCampaign, TumbleCampaign
from experiments.campaign.tables import PenetrationTrial, TumbleTrial

from .force_units import force_units
from .penetration import penetration_oddities
from .tumble import tumble_oddities
from .words import Array, Finding, say, times, unit_words
from .zeros import depth_zeros

__all__ = ["find_implausible", "loud_sensors", "missing_sensors", "said_once", "without_companions"]

_MANY = 4  # trials of which the same is said once
_LOUD = 2.0  # times the stated noise from which on a sensor is called louder
_QUIET = 0.1  # and quieter: coloured noise has less of it from row to row than in all, but not so little
_NAMED = ("looks like", "would say so")  # words of a finding that names a unit
_FOLLOWS = ("by a jump that no motion makes", "jumps so often", "what [sensors.", "its zero is to be taken off")
"""Words of findings that a named cause makes of itself."""
_OFF_SCALE = "in other units (N/mm, g)"  # words of a force that is out of all proportion
_TOGETHER = (frozenset(("x", "y", "theta")), frozenset(("gyro", "ax", "ay")), frozenset(("wheel",)),
             frozenset(("depth",)), frozenset(("force",)), frozenset(("accel",)))  # fmt: skip
"""Channels of one sensor."""


def find_implausible(campaign: Campaign) -> list[Finding]:
    """What cannot be as it stands, a sentence each, trial after trial, what is alike in many of them once."""
    return said_once(_each_implausible(campaign))


def without_companions(campaign: Campaign, found: Sequence[Finding]) -> list[Finding]:
    """`found` without what a cause that is named makes of itself: a marker "lost", a zero "off", a "louder" sensor.

    A column in degrees under a heading in radians jumps and scatters 57 times as much as is stated: said once.
    """
    named = [f for f in _each_implausible(campaign) if f.channel and any(words in f.what for words in _NAMED)]

    def follows(finding: Finding) -> bool:
        if not any(words in finding.what for words in _FOLLOWS) or any(words in finding.what for words in _NAMED):
            return False
        channel = finding.channel or ""
        for cause in named:
            mine = finding.trial in ("", cause.trial)
            alike = any(cause.channel in sensor and channel in sensor for sensor in _TOGETHER)
            if mine and (alike or (channel == "theta" and "theta_rad looks like" in cause.what)):
                return True
        return False

    return [finding for finding in found if not follows(finding)]


def _each_implausible(campaign: Campaign) -> list[Finding]:
    """What cannot be, trial after trial."""
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
            Finding(trial=trial.id, channel=channel, what=f"trial {trial.id}: {what}", doubt=True)
            for channel, what in odd
        ]
    if not any(finding.channel == "depth" for finding in found):  # in mm, or counted upwards, it begins anywhere
        found += [
            Finding(trial=trial, channel="depth", what=f"trial {trial}: {what}" if trial else what, doubt=True)
            for trial, what in depth_zeros(campaign)
        ]
        units = [Finding(trial="", channel="force", what=what, doubt=True) for what in force_units(campaign)]
        if units:  # which says more than that it is off
            found = [f for f in found if f.channel != "force" or _OFF_SCALE not in f.what] + units
    return found


def said_once(found: Sequence[Finding]) -> list[Finding]:
    """What is odd alike in many trials is said once, of the first."""
    alike: dict[tuple[str | None, str], list[Finding]] = {}
    for finding in found:
        pattern = re.sub(r"[-+.0-9e]*[0-9]", "#", finding.what.removeprefix(f"trial {finding.trial}: "))
        alike.setdefault((finding.channel, pattern), []).append(finding)
    merged = []
    for several in alike.values():
        first = several[0]
        if len(several) < _MANY:
            merged += several
            continue
        others = ", ".join(finding.trial for finding in several[1:_MANY]) + (", ..." if len(several) > _MANY else "")
        merged.append(replace(first, what=f"{first.what} (and alike in {len(several) - 1} more: {others})"))
    return merged


def loud_sensors(campaign: Campaign) -> list[Finding]:
    """Sensors whose readings scatter from row to row by far more, or far less, than the noise that is stated.

    Fourth differences, of which a smooth motion leaves little; the median of a trial, so that touches do not count; the
    median over the trials. A bed whose grains jam and give way makes the force do the same, and the sentence says so.
    """
    tables = campaign.tables
    ratios: dict[tuple[str, str], list[float]] = {}
    stated: dict[tuple[str, str], float] = {}
    for trial in tables.trial:
        for sensor in trial.files:
            recording = campaign.recording(trial.id, sensor)
            if recording is None:
                continue
            for column, name, std in _noises(tables, trial, sensor):
                scatter = _scatter(recording[column])
                if scatter is not None and std > 0:
                    ratios.setdefault((name, column), []).append(scatter / std)
                    stated[name, column] = std
    found = []
    for (name, column), own in ratios.items():
        ratio = float(np.median(own))
        if ratio > _LOUD:
            words = f"{column} scatters from row to row by {ratio * stated[name, column]:.2g}, {times(ratio)} what "
            cause = f"[sensors.{name}] states: a louder sensor, or something that moves as fast as it is read"
            found.append(Finding(trial="", channel=_channel(column), what=words + cause))
        elif ratio < _QUIET and name != "depth":  # a driven depth is smooth, and only its smoothing asks for its noise
            unit = unit_words(1 / ratio) if ratio > 0 else None
            words = say(
                "quiet_sensor", name=name, std=stated[name, column], column=column, ratio=times(1 / ratio),
                unit=unit or "stated too large, or smoothed when it was recorded",
            )  # fmt: skip
            found.append(Finding(trial="", channel=_channel(column), what=words))
    return found


def _channel(column: str) -> str:
    """``theta`` for ``theta_rad``, ``wheel`` for ``omega_rad_s``."""
    name = column.split("_")[0]
    return "wheel" if name == "omega" else name


def _noises(
    tables: TumbleCampaign | PenetrationCampaign, trial: TumbleTrial | PenetrationTrial, sensor: str
) -> Iterator[tuple[str, str, float]]:
    """(column, key of [sensors], std as stated)."""
    if isinstance(trial, PenetrationTrial):
        pairs = [("depth_m", "depth"), ("force_N", "force") if trial.mode == "driven" else ("accel_m_s2", "accel")]
        for column, name in pairs:
            table = getattr(tables.sensors, name)
            if table is not None:
                yield column, name, table.std[0]
        return
    for (quantity, unit), std in zip(trial.columns(sensor)[1:], getattr(tables.sensors, sensor).std, strict=True):
        yield f"{quantity}_{unit}", sensor, std


def _scatter(values: Array) -> float | None:
    """Noise of neighbouring readings; None of too few, and of readings that are held or coarsely rounded."""
    known = values[np.isfinite(values)]
    if len(known) < 40 or np.mean(np.diff(known) == 0) > 0.2:
        return None
    return float(np.median(np.abs(np.diff(known, 4)))) / 0.6745 / math.sqrt(70)


def missing_sensors(campaign: Campaign) -> list[Finding]:
    """Sensors of a tumble that no trial has, or some have not."""
    tables = campaign.tables
    if not isinstance(tables, TumbleCampaign):
        return []
    found = []
    for sensor in ("pose", "imu", "wheel"):
        without = [trial.id for trial in tables.trial if sensor not in trial.files]
        if len(without) == len(tables.trial):
            found.append(
                Finding(trial="", what=f"no trial has a recording of {sensor}: what only it tells stays unknown")
            )
        else:
            found += [Finding(trial=id, what=f"trial {id} has no recording of {sensor}, others have") for id in without]
    return found
