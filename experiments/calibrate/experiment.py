"""`hedgebed bed calibrate target.toml`: grain parameters from bulk figures.

1. A few points of the parameters' box are simulated (`calibrate.tests`), every test kept as it ends.
2. A response surface with its uncertainty is fitted to each figure (`calibrate.fit`). The next point is where it
   informs the fit most, until enough is known or `most_points` are done.
3. The parameters found, to three digits, are simulated anew with other seeds, and the surfaces are fitted again with
   these points. Where a figure is off by more than half its tolerance, they are found and checked once more. The better
   check stands beside what was wanted; figures that are compared only are measured then.

Why this and no optimiser of a library: docs/materials.md.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from dem import BedFailure
from dem.grains.materials import Material
from dem.grains.sizes import Uniform
from dem.measure import cutting
from dem.measure.repose import check_width
from dem.prepare.prepare import check_options, fingerprint
from dem.prepare.recipe import check_stages, parse_stage
from experiments.grains.bed_progress import Stages
from experiments.grains.kept_material import BASE_COPY, keep_material
from experiments.runs.folder import RunFolder, write_text
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.stopping import held_back
from experiments.runs.whole_runs import publish, whole_run

from .fit import Response, Wanted, design, find_best, next_point
from .result import Simulated, calibration_result, material_toml
from .settings import CalibrateSettings, Target, material_at, say
from .tests import STRIP, SampleTest, figures_of, laboratory_figure, run_test, tests_for

__all__ = ["check", "fingerprint", "resume", "run"]

_LEAST_HEAP = 20.0
"""Depth of a drained bed to which parameters are fitted, at least [mean diameters]: on its rough plate one of eight
stands 6 degrees steeper than the friction angle of its grains (docs/materials.md)."""
_SEEDS = 1000
"""Between the seeds of two points: samples of one seed would be strong, or weak, all alike."""


def check(settings: CalibrateSettings) -> None:
    """Raise ValueError for ranges with which no material can be, and a bed that cannot be drained or cut as asked."""
    drained = [target for target in settings.wanted.values() if target.state == "drained"]
    if drained:
        length, _, depth = (settings.grain * side for side in settings.repose_size)
        try:
            check_width(length, slot=None, grain=settings.grain, depth=depth)
        except ValueError as error:
            raise ValueError(f"repose_size, times grain: {error}") from None
    if any(target.fit for target in drained) and settings.repose_size[2] < _LEAST_HEAP:
        raise ValueError(say("shallow_heap", s=settings, name=drained[0].name, least=_LEAST_HEAP))
    if any(target.state == "cut" for target in settings.wanted.values()):
        _check_cut(settings)
    for end in (0, 1):
        material_at(settings, {key: pair[end] for key, pair in settings.free.items()})


def _check_cut(settings: CalibrateSettings) -> None:
    """Raise ValueError for a bed in which no faces can be cut."""
    size = [settings.grain * side for side in settings.cut_size]
    try:
        check_options(size, settings.grain, settings.gravity, settings.seed, 0.05)
        cutting.check_width(STRIP * settings.grain, width=size[0], height=size[2], grain=settings.grain)
    except ValueError as error:
        raise ValueError(f"cut_size, times grain: {error}") from None
    if settings.cut_stages[-1:] != ("level",):
        raise ValueError(f"cut_stages = {' '.join(settings.cut_stages)}: 'level' must be the last")
    sizes, sticks = Uniform(settings.grain, settings.spread), settings.base.cohesion != "none"
    try:
        stages = [parse_stage(stage) for stage in settings.cut_stages]
        check_stages(stages, size=size, grain=settings.grain, sizes=sizes, cohesive=sticks)
    except ValueError as error:
        raise ValueError(f"cut_stages: {error}") from None


@dataclass
class _Work:
    """What is done so far."""

    settings: CalibrateSettings
    folder: RunFolder
    progress: Progress
    asked_to_stop: Callable[[], bool]
    targets: list[Target]
    done: Simulated = field(default_factory=Simulated)

    def tell(self, done: float) -> None:
        """`done` of the stage. Raises KeyboardInterrupt if asked to stop."""
        Stages(self.progress, self.asked_to_stop).update(done)

    def simulate(
        self, label: str, values: dict[str, float], targets: list[Target], *, seed: int, begin: float
    ) -> dict[str, tuple[float, float]]:
        """The figures of one set of parameters and one seed, each test carried out or found; kept as they end."""
        stuff = material_at(self.settings, values)
        runs: dict[SampleTest, Mapping[str, Any]] = {}
        tests = tests_for(self.settings, targets, seed=seed)
        for k, test in enumerate(tests):
            name = f"{label}-{test.name}"
            kept = self.folder.done_data(name) if self.folder.is_done(name) else None
            if kept is None or kept["values"] != values:
                try:
                    tell = lambda share, k=k: self.tell(begin + (k + share) / len(tests))  # noqa: E731
                    summary, series = run_test(stuff, test, self.settings, tell=tell)
                except BedFailure as failure:
                    raise RuntimeError(f"{_said(values)}, {test.name}: {failure.reason}") from failure
                self.folder.write_series(name, series)
                kept = {"values": values, "summary": summary}
                self.folder.mark_done(name, kept)
            runs[test] = kept["summary"]
            about = {"test": name, "state": test.state, "pressure": test.pressure, "seed": test.seed}
            self.done.tests.append(about | kept["summary"] | {"values": values, "series": f"series/{name}.csv"})
        return figures_of(targets, runs)

    def explore(self, values: np.ndarray) -> None:
        """One more point, by as many samples as the settings say."""
        at = {key: float(f"{value:.6g}") for key, value in zip(self.settings.free, values, strict=True)}
        fitted = [target for target in self.targets if target.fit]
        point, first = self.explored, self.settings.seed + _SEEDS * self.explored
        for seed in range(first, first + self.settings.samples):
            begin = float(len(self.done.points))
            found = self.simulate(f"point-{point + 1:02d}", at, fitted, seed=seed, begin=begin)
            self.done.points.append(at)
            self.done.figures.append(found)
            self.progress.message(f"{_said(at)}: " + ", ".join(f"{n} {v:.3g}" for n, (v, _) in found.items()))

    def check(self, turn: int, values: dict[str, float], targets: list[Target]) -> dict[str, tuple[float, float]]:
        """The parameters found, with the seeds of the check, whose tests the surfaces learn from as well."""
        seeds = self.settings.check_seeds
        checked = [
            self.simulate(f"check-{turn + 1}", values, targets, seed=seed, begin=float(turn * len(seeds) + k))
            for k, seed in enumerate(seeds)
        ]
        for found in checked:
            self.done.points.append(values)
            self.done.figures.append({target.name: found[target.name] for target in self.targets if target.fit})
        return {target.name: _mean([found[target.name] for found in checked]) for target in targets}

    @property
    def explored(self) -> int:
        """How many points were explored, before the check."""
        return len(self.done.points) // self.settings.samples

    @property
    def x(self) -> np.ndarray:
        """What was simulated, in units, shape [n, parameter_count]."""
        return np.array([list(point.values()) for point in self.done.points])

    def responses(self) -> dict[str, Response]:
        """The surfaces through what is known."""
        low, high = np.array(list(self.settings.free.values())).T
        scaled = (self.x - low) / (high - low)
        fitted = [target.name for target in self.targets if target.fit]
        known = {name: np.array([found[name] for found in self.done.figures]) for name in fitted}
        return {name: Response(scaled, *pairs.T.copy()) for name, pairs in known.items()}


def _said(values: Mapping[str, float]) -> str:
    return ", ".join(f"{key} = {value:.4g}" for key, value in values.items())


def _carry_out(settings: CalibrateSettings, folder: RunFolder, progress: Progress) -> Result:
    targets = list(settings.wanted.values())
    wanted = {target.name: Wanted(target.value, target.tolerance) for target in targets if target.fit}
    simulated = [target for target in targets if target.state]
    beds = [target for target in targets if not target.state]
    with folder.lock(), held_back() as asked_to_stop:
        material = keep_material(settings.material, folder.path, copy=BASE_COPY)
        settings = settings.model_copy(update={"material": material})
        work = _Work(settings, folder, progress, asked_to_stop, targets)
        each = len(tests_for(settings, [t for t in targets if t.fit], seed=0))
        checks = settings.checks * len(settings.check_seeds) * len(tests_for(settings, simulated, seed=0))
        progress.plan(
            {
                "explore": each * settings.most_points * settings.samples,
                "check": checks,
                **{t.name: 10.0 for t in beds},
            },
            seconds={"report": 10.0},
        )
        progress.stage("explore", total=float(settings.most_points * settings.samples))
        for values in design(settings.free, settings.points, seed=settings.seed):
            work.explore(values)
        while work.explored < settings.most_points:
            further = next_point(work.responses(), wanted, settings.free, work.x, enough=settings.enough)
            if further is None:
                break
            work.explore(further)
        responses = work.responses()
        fit = find_best(responses, wanted, settings.free)
        progress.stage("check", total=float(settings.checks * len(settings.check_seeds)))
        rounds: list[tuple[float, dict[str, float], dict[str, tuple[float, float | None] | None]]] = []
        while len(rounds) < settings.checks:
            best = {key: float(f"{value:.3g}") for key, value in zip(settings.free, fit.best, strict=True)}
            found = work.check(len(rounds), best, simulated)
            responses = work.responses()
            fit = find_best(responses, wanted, settings.free)
            off = {name: abs(found[name][0] - one.value) / one.tolerance for name, one in wanted.items()}
            rounds.append((sum(value**2 for value in off.values()), best, dict(found)))
            if max(off.values()) <= 0.5 or fit.at_edge:
                break
        _, best, measured = min(rounds, key=lambda one: one[0])
        stuff = material_at(settings, best)
        measured |= {target.name: _of_bed(work, target, stuff) for target in beds}
        done = replace(work.done, measured=measured)
        result = calibration_result(settings, done, fit, responses, best, stuff, folder)
        write_text(folder.path / "material.toml", material_toml(stuff, settings, fit, result["figures"]))
        return publish(folder, result, progress)


def _mean(values: list[tuple[float, float]]) -> tuple[float, float]:
    """Mean over seeds and its standard error: of their scatter, and no less than those of the tests themselves."""
    count, found = len(values), np.array([value for value, _ in values])
    scatter = float(found.std(ddof=1)) / math.sqrt(count) if count > 1 else 0.0
    return float(found.mean()), max(math.sqrt(sum(error**2 for _, error in values)) / count, scatter)


class _Hidden(Stages):
    """The stages of a bed as one stage of the calibration: not shown, but stopped where asked to."""

    def stage(self, name: str, total: float | None = None) -> None:
        """The next stage of the bed."""

    def update(self, done: float) -> None:
        if self.asked_to_stop():
            raise KeyboardInterrupt


def _of_bed(work: _Work, target: Target, stuff: Material) -> tuple[float, float | None] | None:
    """A figure of a laboratory bed, without a standard error; None, with a message, where the bed cannot be made."""
    # Packing and bulk density are those of one bed.
    about = f"bed-{target.figure.replace('bulk_density', 'packing')}"
    share = stuff.density if target.figure.startswith("bulk_density") else 1.0
    numbers = {f.name: getattr(stuff, f.name) for f in fields(stuff) if f.name not in ("name", "sources")}
    work.progress.stage(target.name, total=1.0)
    kept = work.folder.done_data(about) if work.folder.is_done(about) else None
    if kept is None or kept["material"] != numbers:
        hidden = _Hidden(work.progress, work.asked_to_stop)
        name, seed = about.removeprefix("bed-"), work.settings.check_seeds[0]
        kept = {"material": numbers, "value": None, "error": None, "reason": ""}
        try:
            kept["value"] = laboratory_figure(name, stuff, work.settings, seed=seed, progress=hidden)
        except (BedFailure, ValueError) as failure:
            kept["reason"] = str(failure)
        work.folder.mark_done(about, kept)
    if kept["value"] is None:
        work.progress.message(f"{target.name} could not be simulated: {kept['reason']}")
        return None
    return share * kept["value"], None


run, resume = whole_run("bed calibrate", CalibrateSettings, _carry_out, check=check, material_copy=BASE_COPY)
