"""`hedgebed campaign check`: is a campaign fit to be diagnosed, and what is in it?

What cannot be read is refused, all of it at once, by file, line and key. What can be read but is odd becomes a finding,
without a model: sensors that are missing, gaps, a marker that jumped, a clock that jumped, a trial at odds with its
replicates. `hedgebed diagnose` finds the same and sets it aside.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from experiments.campaign import Campaign, PenetrationCampaign, Recording, keep_digests, read_campaign
from experiments.campaign.tables import PenetrationTrial
from experiments.check import (
    find_implausible,
    find_unstated,
    loud_sensors,
    missing_sensors,
    said_once,
    template_warning,
    without_companions,
)
from experiments.check.replicas import condition_words, odd_replicates
from experiments.grains.spells import spells
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantity
from experiments.runs.types import Json
from experiments.runs.whole_runs import computed_run

from .fit.problem import Finding
from .fit.trials import TrialInfo
from .noise.replicates import has_replicates
from .report.sentences import findings_in_words, say
from .settings import CheckSettings

__all__ = ["check", "find_faults", "resume", "run", "unnamed_files"]

_LONG = 10.0  # a step of the time this many times the usual one is a gap
_LISTED = 4  # files that are listed by name


def check(settings: CheckSettings) -> None:
    """Raise ValueError, one sentence a line, for all that is wrong with the campaign."""
    read_campaign(settings.campaign)


def find_faults(campaign: Campaign) -> list[Finding]:
    """What is odd about the recordings, each in a plain sentence that names its trial. Raises ValueError where no
    diagnosis could be made: a sensor stated to have no noise, no trial that can be used."""
    return _all_faults(campaign, _read(campaign)[1])


def _all_faults(campaign: Campaign, found: Sequence[Finding]) -> list[Finding]:
    """The same; `found`: what diagnose finds when it reads the recordings."""
    jumped = {finding.trial for finding in found if _jumps(finding)}
    odd = [finding for finding in odd_replicates(campaign) if finding.trial not in jumped]
    told = [
        *missing_sensors(campaign),
        *find_unstated(campaign),
        *find_implausible(campaign),
        *found,
        *odd,
        *loud_sensors(campaign),
    ]
    return without_companions(campaign, told)


def _jumps(finding: Finding) -> bool:
    return "jumps" in finding.what or "by a jump" in finding.what


def unnamed_files(folder: Path, campaign: Campaign) -> list[Finding]:
    """Recordings in the folder that no trial names: a trial forgotten, or what is left of a template."""
    trials: Sequence[Any] = campaign.tables.trial
    named = {(folder / file).resolve() for trial in trials for file in trial.files.values()}
    left = [str(path.relative_to(folder)) for path in sorted(folder.rglob("*.csv")) if path.resolve() not in named]
    if not left:
        return []
    shown = ", ".join(left[:_LISTED]) + (f" and {len(left) - _LISTED} more" if len(left) > _LISTED else "")
    return [Finding(trial="", what=f"{shown}: in the folder, but no trial names {'it' if len(left) == 1 else 'them'}")]


def _read(campaign: Campaign) -> tuple[Sequence[TrialInfo], list[Finding]]:
    """The trials that diagnose would use, each with its condition by the rule of diagnose, and what it finds when it
    reads the recordings."""
    with threadpool_limits(1):  # matrices are small
        if isinstance(campaign.tables, PenetrationCampaign):
            from experiments.diagnose.push.data import prepare

            prepared, found = prepare(campaign)
            return [trial.info for trial in prepared], list(found)
        from experiments.diagnose.tumble.checks import checked
        from experiments.diagnose.tumble.data import trial_infos, tumble_data

        data, odd = checked(tumble_data(campaign))
        return trial_infos(data), findings_in_words(odd)


def _compute(settings: CheckSettings, folder: RunFolder, progress: Progress) -> Result:
    campaign = read_campaign(settings.campaign)
    progress.stage("check", total=1.0)
    infos, read = _read(campaign)
    home = campaign.folder or Path(settings.campaign)
    findings = [*unnamed_files(home, campaign), *_all_faults(campaign, read)]
    recordings = []
    trials: Sequence[Any] = campaign.tables.trial
    for number, trial in enumerate(trials, 1):
        for sensor in trial.files:
            recording = campaign.recordings[trial.id, sensor]
            series = folder.write_series(f"{number:03d}-{sensor}", recording.columns)
            recordings.append({"trial": trial.id, "sensor": sensor, "series": series} | _facts(recording))
    if settings.keep_digests:
        keep_digests(home, campaign)
    return _result(campaign, recordings, findings, infos)


def _facts(recording: Recording) -> Json:
    """Rows, rate [Hz], first and last time [s], and gaps (from, to) [s]: long steps, and stretches of empty cells."""
    time = recording.time
    steps = np.diff(time)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = [(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(steps > _LONG * usual)] if usual > 0 else []
    empty = np.zeros(len(time), dtype=bool)
    for values in [values for name, values in recording.columns.items() if name != "t_s"]:
        empty |= np.isnan(values)
    gaps += [(float(time[low]), float(time[high - 1])) for low, high in spells(empty)]
    rate = 1 / usual if usual > 0 else None
    ends = {"from_s": float(time[0]), "to_s": float(time[-1])}
    return {"rows": len(time), "rate": rate, **ends, "empty_rows": int(empty.sum()), "gaps": sorted(gaps)}


def _words(campaign: Campaign, conditions: Mapping[str, tuple[object, ...]]) -> dict[str, str]:
    """The condition of each trial in words; with the depth, or the duration, where the rest does not separate them."""
    words = {trial.id: condition_words(campaign.tables, trial) for trial in campaign.tables.trial}
    groups: dict[tuple[object, ...], list[str]] = {}
    for id, condition in conditions.items():
        groups.setdefault(condition, []).append(id)
    shared = Counter(words[ids[0]] for ids in groups.values())
    modes = {id: words[id].split()[0] for id in words}  # driven, drop; motor, brake
    sized = {modes[ids[0]] for ids in groups.values() if shared[words[ids[0]]] > 1}
    for ids in groups.values():
        if modes[ids[0]] in sized:
            size = _size_words([campaign.recordings[key] for key in campaign.recordings if key[0] in ids])
            words |= {id: f"{words[id]}, {size}" for id in ids}
    return words


def _size_words(recordings: Sequence[Recording]) -> str:
    """How deep the recorded trials of one condition go, or how long they last; the median."""
    depths = [1e3 * float(np.nanmax(r["depth_m"])) for r in recordings if "depth_m" in r.columns]
    if depths:
        depth = float(np.median(depths))
        return f"{depth:.2g} mm deep" if depth < 99.5 else f"{depth:.0f} mm deep"
    return f"{np.median([float(np.ptp(recording.time)) for recording in recordings]):.3g} s long"


def _result(
    campaign: Campaign, recordings: list[Json], findings: list[Finding], infos: Sequence[TrialInfo]
) -> Result:  # fmt: skip
    tables = campaign.tables
    listed: Sequence[Any] = tables.trial
    conditions = {trial.id: (trial.id,) for trial in listed} | {info.id: info.condition for info in infos}
    alike, words = Counter(conditions.values()), _words(campaign, conditions)
    said = [] if has_replicates(infos) else [say(f"no_replicates_{tables.kind}")]
    trials = []
    for trial in listed:
        own = [entry for entry in recordings if entry["trial"] == trial.id]
        mine = [finding for finding in findings if finding.trial == trial.id]
        trials.append({
            "id": trial.id,
            "kind": trial.mode if isinstance(trial, PenetrationTrial) else "tumble",
            "condition": words[trial.id],
            "sensors": ", ".join(
                f"{entry['sensor'] if tables.kind == 'tumble' else ', '.join(trial.needed)} {_rate(entry['rate'])}"
                for entry in own
            ),
            "from_s": min(entry["from_s"] for entry in own),
            "to_s": max(entry["to_s"] for entry in own),
            "gaps": sum(len(entry["gaps"]) for entry in own),
            "jumps": sum(map(_jumps, mine)),
            "findings": len(mine),
            "alike": alike[conditions[trial.id]],
        })  # fmt: skip
    head = ["trial", "condition", "sensors [Hz]", "from, to [s]", "gaps", "jumps", "found", "alike"]
    rows = [
        [t["id"], t["condition"], t["sensors"], f"{t['from_s']:.4g}, {t['to_s']:.4g}", t["gaps"] or "-",
         t["jumps"] or "-", t["findings"] or "-", t["alike"]]
        for t in trials
    ]  # fmt: skip
    count = len(trials)
    facts = ("trial", "what", "channel", "from_s", "to_s")
    return Result.make(
        "campaign check",
        title=f"{tables.name}: {count} trial{'s' if count > 1 else ''}, "
        + (f"{len(findings)} found" if findings else "nothing found"),
        kind=tables.kind,
        quantities={
            "trial_count": quantity(count, "1"),
            "condition_count": quantity(len(alike), "1", "trials of one condition are replicates"),
            "row_count": quantity(sum(entry["rows"] for entry in recordings), "1", "of all recordings together"),
            "finding_count": quantity(len(findings), "1", "diagnose sets aside or models what it can"),
        },
        tables=[{"title": "", "head": head, "rows": rows}],
        departures={"sentences": said}, trials=trials, recordings=recordings,
        findings=[{name: vars(f)[name] for name in facts} for f in findings],
        warnings=[*filter(None, [template_warning(campaign)]), *(finding.what for finding in said_once(findings))],
    )  # fmt: skip


def _rate(rate: float | None) -> str:
    return "?" if rate is None else f"{rate:.3g}" if rate < 100 else f"{rate:.0f}"


run, resume = computed_run("campaign check", CheckSettings, _compute, check=check)
