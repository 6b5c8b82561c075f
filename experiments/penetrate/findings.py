"""From finished runs to the result: fits, the same runs on the spring-damper, departures, and facts about the bed.

Spread between seeds is that of the runs which every seed has (same kind, same speed), each seed fitted by itself. The
value is fitted to all runs of all seeds. A quantity that no second seed has gets the std null, one that is exact 0.

Grains stick out of the surface, depth 0, so that some of them carry a spike before it: neither the fit nor the law
include that, and `experiments.penetrate.result` reports how much it is.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from coupling import Penetration
from dem.measure.grading import measure_grading
from experiments.grains.graded import graded_quantities
from experiments.grains.softening import Softening
from experiments.runs.types import Json
from rigid import SpringDamper
from vis.penetrate.errors import in_95

from .fit import Fit, drag_gap, fit_spring_damper, moments_of, spread
from .settings import STANDARD_GRAVITY, PenetrateSettings, say
from .similarity import pace_of
from .units import Unit, make_run

__all__ = [
    "BedFacts", "Findings", "bed_entry", "bed_quantities", "drop_note", "force_gap", "mean_of", "model_run",
    "returned_work",
]  # fmt: skip

Runs = Mapping[str, Penetration]

CREEPS = 0.05
"""Share of load / K that may be missing of the depth at which the law is at rest [1]; at rest it is 0.3 %."""


@dataclass(frozen=True)
class BedFacts:
    """What the result reports about one bed, taken before the first run; SI units."""

    seed: int
    grain_count: int
    packing_fraction: float
    coordination_number: float
    surface: float
    young: float
    time_step: float
    grading: Json | None = None
    """Of a graded bed: what `dem.measure_grading` found."""

    @classmethod
    def of(cls, bed: Any, seed: int, softening: Softening, graded: Any = None) -> Self:
        """The facts of `bed`, whose grains are softened to `softening`; `graded`: the sizes by place, if any."""
        return cls(
            seed=seed, grain_count=int(bed.grain_count), packing_fraction=float(bed.packing_fraction),
            coordination_number=float(bed.coordination_number), surface=float(bed.surface),
            young=float(softening.young), time_step=float(bed.time_step),
            grading=None if graded is None else asdict(measure_grading(bed, graded)),
        )  # fmt: skip


def drop_note(settings: PenetrateSettings) -> str:
    """What a drop is, and what it is not."""
    on_earth = pace_of(settings) == 1.0
    gravity = STANDARD_GRAVITY if on_earth else settings.gravity
    where = "in the laboratory" if on_earth else f"at {settings.gravity:.3g} m/s2"
    return say("drop", s=settings, free=settings.mass * gravity, where=where)


class Findings:
    """All that is read off the finished runs of one experiment.

    `units` and `beds` are the runs and their series in the bed. `fit` is the law fitted to all of them, `seed_fits`
    those of the seeds. `models` (id -> series) are the same runs on the law.
    """

    def __init__(self, settings: PenetrateSettings, units: Sequence[Unit], beds: Runs, time_step: float) -> None:
        self.settings, self.units, self.beds, self.time_step = settings, list(units), dict(beds), time_step
        self.fit: Fit = fit_spring_damper(self.beds)
        self.seed_fits: dict[int, Fit] = self._fit_seeds()
        self.models: dict[str, Penetration] = {
            unit.id: model_run(settings, unit, self.beds[unit.id], self.fit, time_step) for unit in self.units
        }

    def of(self, kind: str, seed: int | None = None) -> list[Penetration]:
        """The bed's runs of a kind, of one seed or of all."""
        return [self.beds[unit.id] for unit in self.units if unit.kind == kind and seed in (None, unit.seed)]

    def shared_conditions(self) -> set[tuple[str, float]]:
        """Kinds and speeds that every seed has."""
        return set.intersection(*({u.condition for u in self.units if u.seed == seed} for seed in self.seeds))

    @property
    def seeds(self) -> list[int]:
        """The seeds in their order."""
        return list(dict.fromkeys(unit.seed for unit in self.units))

    def _fit_seeds(self) -> dict[int, Fit]:
        """Each seed by itself, on the runs that every seed has."""
        shared = self.shared_conditions()
        own = {s: [u for u in self.units if u.seed == s and u.condition in shared] for s in self.seeds}
        fitted = {s: units for s, units in own.items() if any(unit.kind != "set_down" for unit in units)}
        return {s: fit_spring_damper({u.id: self.beds[u.id] for u in units}) for s, units in fitted.items()}

    @property
    def beds_separate(self) -> bool:
        """Whether the runs that all beds have determine K and C of each bed by itself."""
        return bool(self.seed_fits) and all(fit.separates for fit in self.seed_fits.values())

    def quantities(self) -> dict[str, Json]:
        """The headline numbers: name -> value, std between seeds, unit, note."""
        load, drops = self.settings.weight, self.of("drop")
        # K and C of beds that do not separate them differ by how the fit splits one force.
        fits = list(self.seed_fits.values()) if self.beds_separate else []
        sunk, model_sunk = self.sinkages(self.beds), self.law_sinkages()
        shared_runs, driven = self.shared_conditions(), [unit for unit in self.units if unit.kind == "driven"]
        gaps = [
            drag_gap([self.beds[u.id] for u in driven if u.seed == seed and u.condition in shared_runs], self.fit)
            for seed in self.seeds
        ]
        law_sinkages = [load / fit.stiffness if fit.stiffness > 0 else None for fit in fits]
        shared = say("shared_spread" if self.beds_separate or len(self.seeds) == 1 else "not_separated")
        error = say("jackknife")
        return {
            "stiffness": _quantity(self.fit.stiffness, spread([fit.stiffness for fit in fits]), "N/m", shared),
            "damping": _quantity(self.fit.damping, spread([fit.damping for fit in fits]), "N s/m", shared),
            "stiffness_error": _quantity(self.fit.stiffness_error, None, "N/m", error),
            "damping_error": _quantity(self.fit.damping_error, None, "N s/m", error),
            "sinkage_dem": _quantity(mean_of(sunk), spread(sunk), "m", "depth at rest under the load"),
            "sinkage_spring_damper": _quantity(mean_of(model_sunk), spread(law_sinkages), "m", "the same on the law"),
            "drag_gap": _quantity(drag_gap(self.of("driven"), self.fit), spread(gaps), "1", say("drag_gap")),
            **self._work_returned,
            "load": _quantity(load, 0.0, "N", "on the spike, set down and dropped; (m + m_b) g_sim / 4 unless set"),
            **({"drop_mass": _quantity(self.settings.mass, 0.0, "kg", drop_note(self.settings))} if drops else {}),
            **self.standing_stiffness(),
            **self.at_surface(),
        }

    def standing_stiffness(self) -> dict[str, Json]:
        """The stiffness that gives the sinkage at rest, load / sinkage: for a foot that stands."""
        depths = self.sinkages(self.beds)
        own, sunk = [self.settings.weight / depth if depth and depth > 0 else None for depth in depths], mean_of(depths)
        if sunk is None or sunk <= 0:
            return {}
        note = "load over sinkage at rest: the K for a foot that stands under this load"
        return {"stiffness_standing": _quantity(self.settings.weight / sunk, spread(own), "N/m", note)}

    def at_surface(self) -> dict[str, Json]:
        """How far grains stick out under the tip, and what the bed pushes back with at depth 0."""
        forces, heights, reach = [], [], 0.1 * self.settings.grain
        for seed in self.seeds:
            runs = self.of("driven", seed)
            # The last tenth of a grain above depth 0 on the way in.
            near = [(run, (run.depth <= 0) & (run.depth >= -reach) & (run.velocity > 0)) for run in runs]
            forces.append(mean_of([float(run.force[rows].mean()) for run, rows in near if rows.any()]))
            starts = [run.settings.get("start_depth") for run in runs]
            heights.append(mean_of([-start for start in starts if start is not None]))
        return {
            name: _quantity(mean, spread(values), unit, say(name))
            for name, values, unit in (("surface_force", forces, "N"), ("surface_roughness", heights, "m"))
            if (mean := mean_of(values)) is not None
        }

    def deepest(self) -> float:
        """How deep the runs went that were fitted [m]."""
        return max(self.beds[name].max_depth for name in self.fit.runs)

    def sinkages(self, runs: Runs) -> list[float | None]:
        """Depth at rest of every set-down [m]; None where it did not come to rest."""
        return [runs[unit.id].resting_depth for unit in self.units if unit.kind == "set_down"]

    def law_sinkages(self) -> list[float | None]:
        """The same on the law. One that creeps so slowly in its damper that it seems to rest is none: W = K z there."""
        rests = self.settings.weight / self.fit.stiffness if self.fit.stiffness > 0 else math.inf
        return [z if z is not None and z > (1 - CREEPS) * rests else None for z in self.sinkages(self.models)]

    @cached_property
    def _work_returned(self) -> dict[str, Json]:
        """Mean share of the work put in that driven runs return, of the bed and of the law.

        Beds have a spread where all were driven at the same speeds, the laws fitted to each bed always.
        """
        driven = [unit for unit in self.units if unit.kind == "driven"]
        alike = {unit.condition for unit in driven} <= self.shared_conditions()
        own = [mean_of([returned_work(run) for run in self.of("driven", seed)]) for seed in self.seeds]
        laws = [
            mean_of([returned_work(model_run(self.settings, u, self.beds[u.id], fit, self.time_step)) for u in driven])
            for fit in (self.seed_fits.values() if self.beds_separate else ())
        ]
        bed, law = (mean_of([returned_work(runs[unit.id]) for unit in driven]) for runs in (self.beds, self.models))
        note = "work of unloading over work of loading, driven runs"
        return {
            "work_returned_dem": _quantity(bed, spread(own) if alike else None, "1", note),
            "work_returned_spring_damper": _quantity(
                law, spread(laws), "1", "the same on the fitted law; spread: on the laws fitted to each bed"
            ),
        }

    @cached_property
    def in_95(self) -> dict[str, Any]:
        """`quantities` with halves of 95 % intervals in place of standard deviations."""
        entries = {"fits": self.fit_entries(), "runs": self.run_entries({})}
        return in_95({"quantities": self.quantities(), **entries})

    def run_entries(self, notes: Mapping[str, Mapping[str, Any]]) -> list[Json]:
        """The entry "runs": one per run, the model's numbers under model_*; `notes` are what was kept of each."""
        entries = []
        for unit in self.units:
            bed, model = self.beds[unit.id], self.models[unit.id]
            numbers = bed.quantities() | {f"model_{name}": value for name, value in model.quantities().items()}
            note = notes.get(unit.id, {})
            kept = {"ended": bed.ended, "max_overlap": note.get("max_overlap"), "quantities": numbers}
            kept |= {"computed_share": note["computed_share"]} if "computed_share" in note else {}
            files = {"series": f"series/{unit.id}.csv", "model_series": f"series/{unit.id}.model.csv"}
            entries.append({name: getattr(unit, name) for name in ("id", "kind", "seed", "speed")} | files | kept)
            if (moments := moments_of(bed)) is not None:
                entries[-1]["moments"] = asdict(moments)
        return entries

    def fit_entries(self) -> list[Json]:
        """The entry "fits": each seed by itself, on the runs that all seeds have."""
        numbers = ("stiffness", "damping", "stiffness_error", "damping_error", "correlation")
        return [
            {"seed": seed}
            | {name: getattr(fit, name) for name in numbers}
            | {"drag_gap": drag_gap([self.beds[name] for name in fit.runs], fit), "runs": list(fit.runs)}
            | {"separates": fit.separates}
            for seed, fit in self.seed_fits.items()
        ]


def returned_work(run: Penetration) -> float | None:
    """Share of the work of loading that unloading returns [1]; None without such work."""
    return run.work_out / run.work_in if run.work_in > 0 else None


def model_run(settings: PenetrateSettings, unit: Unit, bed: Penetration, fit: Fit, time_step: float) -> Penetration:
    """The run of `unit` on the fitted spring-damper: same start, same steps; a drop lasts as long as in the bed."""
    ground = SpringDamper(stiffness=fit.stiffness, damping=fit.damping, time_step=time_step)
    long = float(bed.time[-1]) + 0.5 * bed.macro_step if len(bed.time) else settings.drop_time
    start = bed.settings.get("start_depth")
    return make_run(settings, unit, ground, start_depth=start, drop_time=max(long, bed.macro_step)).run()


def bed_entry(facts: Sequence[BedFacts], settings: PenetrateSettings, softening: Softening) -> Json:
    """The entry "bed": what was prepared, seed by seed, and how soft it was made."""
    return {
        "material": settings.material,
        "size": list(settings.bed_size),
        **{name: getattr(settings, name) for name in ("grain", "spread", "gravity", "max_overlap")},
        "softening": asdict(softening) | {"factor": softening.factor},
        **({} if settings.graded is None else {"graded": asdict(settings.graded)}),
        "seeds": [asdict(entry) for entry in facts],
    }


def bed_quantities(facts: Sequence[BedFacts], overlap: float | None, made: Mapping[int, float]) -> dict[str, Json]:
    """Numbers of the beds, means over seeds; what is exact gets the std 0, what is unknown null.

    ``made``: seed -> Young's modulus [Pa] of its last runs, for the seeds that runs made stiffer.
    """
    found: dict[str, Json] = {}
    young = [made.get(entry.seed, entry.young) for entry in facts]
    changed = made and f"; made stiffer during the runs: at last {min(young):.3g} to {max(young):.3g} Pa by seed"
    for name, unit, note in (
        ("grain_count", "1", ""),
        ("packing_fraction", "1", "bulk, before the first run"),
        ("coordination_number", "1", "before the first run"),
        ("surface", "m", "height of the undisturbed surface above the floor"),
        ("young", "Pa", f"of the softened grains{changed or ''}"),
        ("time_step", "s", f"of the grains{', before the first run' if made else ''}"),
    ):
        values = young if name == "young" else [float(getattr(entry, name)) for entry in facts]
        alike = all(value == values[0] for value in values)
        mean = values[0] if alike else float(np.mean(values))
        # Young's modulus is exact unless a run changed it; of the rest one bed does not show how much beds differ.
        exact = alike and name == "young" and not made
        found[name] = _quantity(mean, 0.0 if exact else spread(values), unit, note)
    if gradings := [entry.grading for entry in facts if entry.grading is not None]:
        found |= graded_quantities(gradings)
    if overlap is not None:
        found["max_overlap"] = _quantity(overlap, None, "1", "largest overlap of grains in any run, of a diameter")
    return found


def _quantity(value: float | None, std: float | None, unit: str, note: str = "") -> Json:
    entry: Json = {"value": value, "std": std, "unit": unit}
    return entry | {"note": note} if note else entry


def mean_of(values: Sequence[float | None]) -> float | None:
    """Mean of the values that are known; None where none is."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def force_gap(driven: Sequence[str], beds: Runs, others: Runs) -> float | None:
    """Rms difference over the bed's rms force, rows below the surface, every run weighing the same."""
    square = drag = 0.0
    for name in driven:
        bed, other = beds[name], others[name]
        rows = bed.depth > 0
        if rows.any():
            force = np.interp(bed.time, other.time, other.force)  # steps of other seeds' beds differ in the sixth digit
            square += float(np.mean((force[rows] - bed.force[rows]) ** 2))
            drag += float(np.mean(bed.force[rows] ** 2))
    return float(np.sqrt(square / drag)) if drag > 0 else None
