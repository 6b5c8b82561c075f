"""A diagnosis as files: diagnosis.json, model.toml, latent.csv, and the series and tables that the report is made of.

```
diagnosis.json       the contract (diagnosis.schema.json beside this file), and how sure, in `evidence` and `gate`
model.toml           the model with what was added: `hedgebed tumble --model` and `penetrate --model` run it
latent.csv           where the verdict is unknown: the missing force, row by row
evidence.csv         every candidate: its score, and the chi-square a sample that it leaves beyond what noise makes
series/<trial>.<channel>.csv    t_s,measured,before,after,std,std_after,phase (as the gap takes it), scatter, depth_m
```
"""

import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from experiments.campaign.tables import ERRORS_NOTE, OTHERS_NOTE, PEAKS_NOTE, SCATTER_NOTE
from experiments.diagnose.core.deciding import shares_left
from experiments.diagnose.core.effect_texts import SYMBOLS, equations_of, form_meaning, with_comments
from experiments.diagnose.core.near import Near, near_models, nearest_each
from experiments.diagnose.core.outcome import Diagnosis, Estimated
from experiments.diagnose.core.rivals import LEAD, Rival
from experiments.diagnose.core.same_in_all import same_in_all_beds
from experiments.diagnose.core.scatter_gap import scatter_std
from experiments.diagnose.core.stated import beside_stated
from experiments.diagnose.core.too_noisy import noise_found
from experiments.diagnose.fit.evidence import excess, held_out_fit
from experiments.diagnose.fit.fitting import Fit, fit
from experiments.diagnose.fit.gaps import si_unit_of, unit_of
from experiments.diagnose.fit.localise import phases_of
from experiments.diagnose.fit.problem import Array, Form, Values
from experiments.diagnose.noise.replicates import has_replicates
from experiments.diagnose.noise.spectrum import line_rows
from experiments.runs.folder import write_json, write_series, write_text
from experiments.runs.types import Json

from .gaps import Gaps
from .sentences import candidate_rows

__all__ = ["document", "write_diagnosis"]

COUNTS = tomllib.loads(Path(__file__).with_name("counts.toml").read_text(encoding="utf-8"))
_BESIDE = 2  # readings to either side of the deepest one, with which its force is averaged
_SAME = 1 - 1e-9  # share of the largest force from which on one is as large
_ROUNDS = 8  # of refits without one of the effects
_SIGNALS = ("force", "accel", "ax", "ay")  # channels that read 0 where nothing pushes: a change is a share of these


def document(found: Diagnosis, near: Sequence[Near] | None = None) -> dict[str, Any]:
    """diagnosis.json. `near`: the nearest other answers, where they are known already."""
    effects = [{"id": effect, "parameters": _numbers(found.parameters(effect))} for effect in found.effects]
    settings = {trial.id: dict(trial.settings) for trial in found.problem.trials}
    diagnosis: dict[str, Any] = {
        "format": "hedgehog-diagnosis/1",
        "verdict": found.verdict,
        "effects": effects,
        "alternatives": list(found.alternatives) if found.verdict == "ambiguous" else [],
        "where": [{**asdict(p), "settings": settings[p.trial]} for p in found.where],
        "gap": {"before": asdict(found.before), "after": asdict(found.after), "held_out_trials": list(found.held_out)},
    }  # fmt: skip
    if (weighed := found.gap_with_scatter) is not None:
        stages = {"before": weighed.before, "after": weighed.after, "after_std": weighed.after_std}
        diagnosis["gap_with_scatter"] = {
            stage: {"fit": fitted, "held_out": held_out} for stage, (fitted, held_out) in stages.items()
        } | {"freedom": weighed.freedom, "trials": {"fit": len(found.fitted), "held_out": len(found.held_out)}}
    if rule := found.allowed_by:
        diagnosis["allowed_by"] = rule
        if rule == "form" and found.choice is not None:
            diagnosis["shares_left"] = shares_left(found.choice, found.held_out)
    if found.verdict == "unknown":
        diagnosis["leading"] = _leading(found)
        diagnosis["left"] = [asdict(p) for p in found.left]
        words, shares = found.dependence
        diagnosis["latent"] = {"file": "latent.csv", "depends_on": words, "explained": shares,
                          "lines": line_rows(found.lines)}  # fmt: skip
    if noise := noise_found(found):
        diagnosis["noise_found"] = {
            name: {"stated": one.stated, "found": one.found, "unit": si_unit_of(name)} for name, one in noise.items()
        }
    diagnosis["kind"] = found.problem.kind
    if count := COUNTS.get(found.problem.counted_as):
        pairs = COUNTS["pairs"][found.problem.counted_as]
        diagnosis["counted"] = {"of": found.problem.counted_as, **count, "pairs": pairs}
        if soft := COUNTS["mujoco"].get(found.problem.counted_as):
            soft_pairs = COUNTS["mujoco"]["pairs"][found.problem.counted_as]
            diagnosis["counted"]["mujoco"] = {**soft, "pairs": soft_pairs}
    if (depth := found.problem.typical_depth) is not None:
        diagnosis["typical_depth_m"] = depth
    if covered := dict(found.problem.covered):
        diagnosis["covered"] = covered
    if (near_answer := found.nearest_answer) is not None and found.choice is not None:
        behind = found.choice.best.score - near_answer.score
        diagnosis["nearest_answer"] = {"effects": list(found.ordered(near_answer)), "evidence_behind": behind}
    diagnosis["nearest_each"] = [
        {"effect": one.effect, "instead": list(found.ordered(one.hypothesis)), "evidence_behind": one.behind,
         "left_out_behind": one.behind_left_out, "needed": one.needed}
        for one in (nearest_each(found) if near is None else near)
    ]  # fmt: skip
    diagnosis["base"] = {"before": _base(found, found.base), "after": _base(found, found.best)}
    diagnosis["same_in_all_beds"] = [asdict(one) for one in same_in_all_beds(found)]
    diagnosis["stated"] = [one.as_json() for one in beside_stated(found)]
    gates = {"before": found.gate_before, "after": found.gate_after, "held_out": found.gate_held_out}
    diagnosis["gate"] = {stage: asdict(gate) for stage, gate in gates.items() if gate is not None}
    bounds = {"before": found.bounds_before, "after": found.bounds_after}
    diagnosis["at_bounds"] = {stage: [asdict(bound) for bound in met] for stage, met in bounds.items()}
    diagnosis["evidence"] = _evidence(found)
    diagnosis["evidence_base"] = _evidence_base(found)
    diagnosis["sizes"] = _sizes(found)
    diagnosis["remarks"], diagnosis["facts"] = list(found.remarks), list(found.facts)
    diagnosis["equations"] = _equations(found)
    diagnosis["symbols"] = SYMBOLS if found.problem.kind == "penetration" and found.forms else ""
    diagnosis["equivalence"] = _equivalence(found)
    diagnosis["candidates"] = candidate_rows(diagnosis)
    diagnosis["forms"] = _forms(diagnosis["candidates"])
    diagnosis["forms_tried"] = _forms(diagnosis["evidence"])
    diagnosis["noise"] = _noise(found)
    diagnosis["model_std"] = dict(found.model_std)
    diagnosis["has_replicates"] = has_replicates(found.problem.trials)
    diagnosis["findings"] = [asdict(finding) for finding in found.findings]
    diagnosis["next_experiment"] = found.next_experiment
    if (plan := found.planned) is not None:
        diagnosis["planned"] = {**plan.settings, "expected_nats": plan.nats, "tried": plan.tried}
        if plan.apart is not None:
            diagnosis["planned"]["apart"] = dict(plan.apart)
    return diagnosis


def _numbers(found: Mapping[str, Estimated]) -> dict[str, Any]:
    """An effect's numbers by the contract, where `std` is a number: of one that the trials do not determine it is the
    number's own size, and `determined` is false."""
    return {
        name: {**told, "std": abs(told["value"]), "determined": False} if told["std"] is None else dict(told)
        for name, told in found.items()
    }


def _base(found: Diagnosis, one: Fit) -> dict[str, Any]:
    """The base model's numbers in one of the fits; what the trials leave open has no standard error."""
    numbers: dict[str, Any] = {
        name: {**told, "std": None} if name in found.undetermined else dict(told)
        for name, told in found.base_parameters(one).items()
    }
    if one is found.best and found.undetermined:
        bounds = found.problem.at_most(found.best.values, found.forms, (*found.fitted, *found.held_out))
        for name in found.undetermined:
            if name in numbers and name in bounds:
                numbers[name]["at_most"] = bounds[name]
    return numbers


def _forms(candidates: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """What each form of these candidates is, by its id; without forms of effects of one's own."""
    ids: dict[str, str] = {}
    for row in candidates:
        effect = ""
        for part in str(row["candidate"]).split(" + "):  # an effect with two forms is named once
            effect, form = part.split(":", 1) if ":" in part else (effect, part)
            if words := form_meaning(f"{effect}:{form}"):
                ids[f"{effect}:{form}"] = words
    return ids


def _equivalence(found: Diagnosis) -> list[dict[str, Any]]:
    """The first effect against the nearest others: evidence, signatures and cross-validation."""
    if not found.equivalence:
        return []
    first = found.best.model.forms[0]
    mine = found.predicted
    rows = [{"effect": found.effects[0], "left_out": None if mine is None else mine.per_sample}]
    for rival in found.equivalence:
        form = next(f for f in rival.hypothesis.forms if f.effect == rival.effect)
        rows.append({
            "effect": rival.effect, "told_apart": _told_apart(rival) and rival.effect not in found.alternatives,
            "evidence_behind": rival.behind, "lead": rival.lead, "same_meaning": rival.is_the_same,
            "left_out_behind": rival.behind_left_out,
            "left_out": None if rival.predicted is None else rival.predicted.per_sample,
            "angle_deg": rival.angle, "distance": rival.distance, "expected": rival.expected,
            "what_would_tell": found.problem.next_experiment(first, form, found.best.values),
        })  # fmt: skip
    return rows


def _told_apart(rival: Rival) -> bool:
    """Whether these trials distinguish a rival from the first effect, by the rule of the verdict."""
    return not rival.same and rival.lead >= LEAD


def _sizes(found: Diagnosis) -> list[dict[str, Any]]:
    """How large each effect is, the largest first: what the measured signal would miss without it, all else refitted.

    The signature is the root mean square of the change over the sensors' noise, as the hidden suite has it
    (docs/diagnose.md). Of the channel in which it is plainest: the change's root mean square and largest size in
    `unit`, and its share of what the channel reads. `own_force`, of pushes: the effect's own share of the force where
    it is largest, all other numbers of the best model kept.
    """
    sizes = []
    for effect in found.effects:
        rest, values = tuple(form for form in found.forms if form.effect != effect), found.base_values
        if rest:
            model = found.best.model.with_forms(rest)
            values = held_out_fit(model, found.held_out, fit(model, found.best.values, rounds=_ROUNDS).values)
        sizes.append({"effect": effect, **_size(found, values, rest), "own_force": _own_force(found, rest)})
    return sorted(sizes, key=lambda size: -size["signature"])


def _own_force(found: Diagnosis, rest: tuple[Form, ...]) -> dict[str, Any] | None:
    """The largest force of an effect [N] in the pushes, the depth [m] and the force of the whole model [N] there, and
    the trial; `rest`: the other forms. None without pushes."""
    most: dict[str, Any] | None = None
    for trial in (*found.fitted, *found.held_out):
        whole = found.problem.compare(found.best_values, found.forms, trial).get("force", {})
        if "depth_m" not in whole or not len(whole["depth_m"]):
            continue
        own = whole["model"] - found.problem.compare(found.best_values, rest, trial)["force"]["model"]
        sizes = np.abs(np.nan_to_num(own))
        place = int(np.argmax(sizes > _SAME * sizes.max()))  # on a stiffer way back all rows may have the largest
        if most is None or _SAME * abs(own[place]) > abs(most["force_N"]):
            most = {"trial": trial, "depth_m": float(whole["depth_m"][place]), "force_N": float(own[place]),
                    "of_N": float(whole["model"][place])}  # fmt: skip
    return most


def _size(found: Diagnosis, values: Values, rest: tuple[Form, ...]) -> dict[str, Any]:
    problem = found.problem
    whole: dict[str, list[float]] = {}
    for trial in (*found.fitted, *found.held_out):
        before, after = problem.compare(values, rest, trial), problem.compare(found.best_values, found.forms, trial)
        stds = problem.sensor_std(found.best_values, found.forms, trial)
        for name, columns in after.items():
            change = columns["model"] - before[name]["model"]
            good = np.isfinite(change) & np.isfinite(stds[name])
            if not good.any():
                continue
            sums = whole.setdefault(name, [0.0] * 5)
            change = change[good]
            sums[0] += len(change)
            sums[1] += float(np.sum((change / stds[name][good]) ** 2))
            sums[2] += float(np.sum(change**2))
            sums[3] = max(sums[3], float(np.abs(change).max()))
            sums[4] += float(np.sum(columns["measured"][good] ** 2))
    if not whole:
        return {"signature": 0.0, "channel": None, "unit": None, "rms": None, "most": None, "share": None}
    channel = max(whole, key=lambda name: whole[name][1] / whole[name][0])
    count, _, squares, most, signal = whole[channel]
    unit, factor = unit_of(channel)
    rms = math.sqrt(squares / count)
    return {
        "signature": math.sqrt(sum(own[1] for own in whole.values()) / sum(own[0] for own in whole.values())),
        "channel": channel, "unit": unit, "rms": factor * rms, "most": factor * most,
        "share": math.sqrt(squares / signal) if channel in _SIGNALS and signal > 0 else None,
    }  # fmt: skip


def write_diagnosis(folder: Path, found: Diagnosis) -> dict[str, Any]:
    """Write all files into `folder` and return diagnosis.json."""
    problem, near = found.problem, nearest_each(found)
    diagnosis = document(found, near)
    if found.verdict == "unknown":
        write_series(folder / "latent.csv", found.latent())
    diagnosis["near_models"] = _write_near_models(folder, found, near)
    notes: dict[str, Json] = {}
    used, aside = {*found.fitted, *found.held_out}, []
    modelled = {trial.id: problem.compare(found.best_values, found.forms, trial.id) for trial in problem.trials}
    if (ratios := peak_ratios([modelled[id] for id in (*found.fitted, *found.held_out)])) is not None:
        diagnosis["peaks"] = notes[PEAKS_NOTE] = ratios
    if others := [one["file"] for one in diagnosis["near_models"]]:
        notes[OTHERS_NOTE] = {"files": others}
    diagnosis["errors"] = _write_model(folder / "model.toml", found, notes)
    if rows := diagnosis["evidence"]:
        write_series(folder / "evidence.csv", {
            "candidate": [r["candidate"] for r in rows], "effects": [" + ".join(r["effects"]) for r in rows],
            "score": [r["score"] for r in rows], "excess_per_sample": [r["left"] for r in rows],
        })  # fmt: skip
    gaps = Gaps()
    for trial in problem.trials:
        before, after = problem.compare(found.base_values, (), trial.id), modelled[trial.id]
        samples = problem.samples(trial.id)
        phases = phases_of(problem, found.base_values, (), trial.id)
        wide = scatter_std(problem, found.model_std, found.best_values, found.forms, trial.id)
        std = problem.sensor_std(found.base_values, (), trial.id)
        std_after = problem.sensor_std(found.best_values, found.forms, trial.id)
        for channel, columns in before.items():
            if not len(columns["t_s"]):  # a sensor that recorded nothing
                continue
            own = samples.channel == channel
            columns = {"t_s": columns["t_s"], "measured": columns["measured"], "before": columns["model"],
                       "after": after[channel]["model"]}  # fmt: skip
            if len(columns["t_s"]) == int(own.sum()):
                columns |= {"std": std[channel], "std_after": std_after[channel], "phase": phases[own]}
                if found.model_std:
                    columns["scatter"] = wide[channel]
                rest, rest_after = (columns["measured"] - columns[stage] for stage in ("before", "after"))
                if trial.id in used:
                    gaps.add(
                        trial.id, channel, columns["t_s"], rest, rest_after, std[channel], std_after[channel],
                        phases=phases[own], settings=trial.settings, held_out=trial.id in found.held_out,
                    )  # fmt: skip
                else:
                    aside.append(_set_aside(trial.id, channel, rest, rest_after))
            if "depth_m" in before[channel]:
                columns["depth_m"] = before[channel]["depth_m"]
            write_series(folder / "series" / f"{trial.id}.{channel}.csv", columns)
    diagnosis["by_phase"], diagnosis["by_channel"] = gaps.by_phase, gaps.by_channel
    diagnosis["by_condition"], diagnosis["parted"] = gaps.by_condition, gaps.parted
    diagnosis["residue"], diagnosis["set_aside"] = gaps.residue, aside
    write_json(folder / "diagnosis.json", diagnosis)
    return diagnosis


def peak_ratios(trials: Iterable[Mapping[str, Mapping[str, Array]]]) -> Json | None:
    """Force at the deepest reading of each push, measured over modelled: mean, standard deviation, lowest, highest and
    the number of `trials`, as `Problem.compare` has them. None for fewer than three pushes."""
    ratios = []
    for channels in trials:
        force = channels.get("force", {})
        if "depth_m" not in force or not np.isfinite(force["depth_m"]).any():
            continue
        near = slice(max((place := int(np.nanargmax(force["depth_m"]))) - _BESIDE, 0), place + _BESIDE + 1)
        measured, modelled = (float(np.nanmean(force[name][near])) for name in ("measured", "model"))
        if measured > 0 and modelled > 0:
            ratios.append(measured / modelled)
    if len(ratios) < 3:
        return None
    return {"mean": float(np.mean(ratios)), "std": float(np.std(ratios, ddof=1)), "lowest": min(ratios),
            "highest": max(ratios), "trials": len(ratios)}  # fmt: skip


def _write_model(path: Path, found: Diagnosis, notes: Mapping[str, Json] | None = None) -> Json:
    """Write the best model with its equations in comments, and return the errors of its numbers.

    `notes`: further ones of a model of pushes, by name.
    """
    errors = found.joint_errors()
    noted: dict[str, Json] = {ERRORS_NOTE: errors} if errors else {}
    if found.problem.kind == "penetration":
        noted |= notes or {}
        if (scatter := found.known_scatter) is not None:
            noted[SCATTER_NOTE] = scatter
    found.problem.write_model(str(path), found.best_values, found.forms, found.base_values, noted)
    text = with_comments(path.read_text(encoding="utf-8"), _equations(found), found.problem.kind)
    write_text(path, text)
    return errors


def _write_near_models(folder: Path, found: Diagnosis, near: Sequence[Near]) -> list[Json]:
    """Write the models of other answers within the margin, and return their effects, forms and files. A model of the
    same effects has its forms in the name of its file."""
    listed = []
    for other in near_models(found, near):
        effects = other.effects
        forms = sorted((form.id for form in other.forms), key=lambda id: effects.index(id.partition(":")[0]))
        same = set(effects) == set(found.effects)
        file = f"model-{'-and-'.join(map(_as_file, forms) if same else effects)}.toml"
        _write_model(folder / file, other)
        listed.append({"effects": list(effects), "forms": forms, "file": file})
    return listed


def _as_file(form: str) -> str:
    """A form's id as part of a file's name."""
    return re.sub("[^a-z0-9]+", "-", form.lower()).strip("-")


def _equations(found: Diagnosis) -> list[Json]:
    return equations_of(
        found.problem.kind, found.forms,
        lambda form: {name: unit for name, (_, unit) in found.problem.reported(found.best_values, form).items()},
    )  # fmt: skip


def _set_aside(trial: str, channel: str, before: Array, after: Array) -> dict[str, Any]:
    """One channel of a trial that took no part: its readings, and measured less modelled of both models, root mean
    square in `unit`, over those readings that a model has."""
    unit, factor = unit_of(channel)
    rms = [factor * math.sqrt(float(np.nanmean(rest**2))) if np.isfinite(rest).any() else None
           for rest in (before, after)]  # fmt: skip
    return {"trial": trial, "channel": channel, "unit": unit, "samples": len(before), "rms_before": rms[0],
            "rms_after": rms[1]}  # fmt: skip


def _noise(found: Diagnosis) -> dict[str, dict[str, float]]:
    """Of the channels whose noise is not as stated: its size over the stated one, how it persists, and its clock."""
    noise = {c.channel: {"std": c.std, "persistence": c.persistence} for c in found.colours.values()}
    for jitter in found.jitters:
        for channel in jitter.channels:
            noise.setdefault(channel, {"std": 1.0, "persistence": 0.0})["time_jitter_s"] = jitter.std
    return noise


def _evidence(found: Diagnosis) -> list[dict[str, Any]]:
    """Every candidate that was tried, the likeliest first; scores relative to the base model [nats]."""
    if found.choice is None:
        return []
    zero, whole = found.choice.base.score, _beyond_noise(found.choice.base.fit)
    seen: dict[tuple[str, ...], dict[str, Any]] = {}
    for one in found.choice.table:
        ids, left = [form.id for form in one.forms], _beyond_noise(one.fit)
        key = tuple(sorted(ids))  # in whatever order they were added
        row = {"candidate": " + ".join(ids), "effects": list(one.effects), "score": one.score - zero, "left": left,
               "closes": 1 - left / whole if whole > 0 else None}  # fmt: skip
        if key not in seen or row["score"] > seen[key]["score"]:
            seen[key] = row
    return sorted(seen.values(), key=lambda row: -row["score"])


def _beyond_noise(found: Fit) -> float:
    """Chi-square a sample beyond the noise that a fit leaves of the fitted trials."""
    return float(excess(found) / found.count)


def _evidence_base(found: Diagnosis) -> dict[str, Any]:
    """What the base model leaves in the same units, and whether the wander of replicates counted as noise."""
    if found.choice is None:
        return {}
    base = found.choice.base.fit
    return {"left": _beyond_noise(base), "with_scatter": bool(base.model.problem.calmed)}


def _leading(found: Diagnosis) -> dict[str, Any]:
    """The candidate that explains most of something unknown: what it closes, and how sure it is."""
    if found.choice is None or not found.choice.best.effects:
        return {"effects": [], "certain": [], "nearest": None}
    rivals = found.choice.rivals
    near = min(rivals, key=lambda rival: rival.lead) if rivals else None
    return {
        "effects": list(found.choice.best.effects), "certain": list(found.effects),
        "parameters": {effect: found.parameters(effect) for effect in found.choice.best.effects},
        "nearest": None if near is None else {
            "effect": near.effect, "evidence_behind": near.behind, "left_out_behind": near.behind_left_out,
            "angle_deg": near.angle, "told_apart": _told_apart(near)},
    }  # fmt: skip
