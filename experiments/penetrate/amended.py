"""The spring-damper with added effects: penetration's model.toml, as `hedgebed diagnose` writes it, on any settings.

Driven spikes follow the path that they are given. Drops are integrated with their touches and turns located
(`experiments.diagnose.push.law`). What is set down is stepped on the law as a ground. The numbers of an effect are
those of the model's diameter. On another one forces on a section scale with its square, forces on a shaft with it,
those of the spring with the model's K.

With a bed, every run of it is made on the law as well. Without one see `experiments.penetrate.on_law`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coupling import Penetration, Run
from experiments.campaign import PenetrationModel, read_model
from experiments.campaign.files import MODEL_COPY
from experiments.campaign.model_errors import ModelErrors, bias_words, errors_of
from experiments.campaign.tables import BASE_NOTE, PEAKS_NOTE, RANGE_NOTE, SCATTER_NOTE, SURFACE_NOTE, EffectTable
from experiments.diagnose.fit.forms import OwnEffect, load_own
from experiments.diagnose.push.forms import push_forms
from experiments.diagnose.push.law import PHASES, fall, given_way, push
from experiments.diagnose.push.slots import SLOTS, slot_places, slot_table
from experiments.runs.folder import RunFolder
from experiments.runs.result import quantities_of
from experiments.runs.types import Json
from rigid import SpringDamper
from rigid.ground.reaction import Reaction

from .findings import force_gap, mean_of, returned_work
from .settings import PenetrateSettings, say
from .units import Unit, make_run

__all__ = [
    "AmendedGround", "AmendedLaw", "amended_numbers", "kept_law", "read_law", "rest_of", "returned_by", "run_beside",
]  # fmt: skip

Array = NDArray[np.float64]

_SLOT = {name: place for place, name in enumerate(SLOTS)}
_POWERS = {"area": 2, "drag": 2, "perimeter": 1, "viscous": 1}
"""With which power of the diameter a number goes, by how it enters the law."""
_SPEED = 1.1
"""Factor beyond the speeds that a model was fitted to from which on it is extrapolated."""
_DEEPER = 1.02
"""Factor beyond the deepest depth of a fit, which is a reading with noise, from which on it is extrapolated."""
_CREEP = 1e-4
"""Below this share of a set-down's lowering speed the direction of the motion is not certain."""


def read_law(path: str | Path, settings: PenetrateSettings) -> "AmendedLaw":
    """The law in the model.toml at `path`, for the spike of `settings`.

    Raises ValueError, naming file and key, for no model of penetration, and for an effect or parameter unknown here.
    """
    path = Path(path)
    model = read_model(path)
    if not isinstance(model, PenetrationModel):
        raise ValueError(f"{path}: kind = {model.kind!r}: 'penetration' was expected")
    forms = push_forms(retreats=True, speeds_differ=True, drops=True)
    numbers = [form.numbers for form in forms] + [bend.numbers for form in forms for bend in form.bends]
    known = {number.name: number.how for several in numbers for number in several}  # how each scales with the diameter
    own: list[OwnEffect] = []
    slots: dict[str, float] = {}
    size = 1.0 if model.spike.diameter is None else settings.tip_diameter / model.spike.diameter
    for number, effect in enumerate(model.effect, 1):
        if effect.file is not None:
            own.append(_own(path, number, effect))
            continue
        for name, value in effect.parameters.items():
            if name not in known and name != "reference":
                place = {"path": path, "number": number, "id": effect.id, "allowed": ", ".join(sorted(known))}
                raise ValueError(say("unknown_number", **place, name=name, value=value))
            slots[name] = value
    springs = tuple(name for name in slots if known.get(name, "").startswith("spring"))
    law = AmendedLaw(settings, model, {}, tuple(own), errors=errors_of(str(path), model), springs=springs)
    try:
        _ = law.surface_depth
    except ValueError as refused:
        raise ValueError(f"{path}: {refused}") from None
    stiffer = law.pair[0] / model.surface.stiffness if model.surface.stiffness > 0 else 1.0
    factors = {name: stiffer if name in springs else size ** _POWERS.get(known.get(name, ""), 0) for name in slots}
    return replace(law, slots={name: value * factors[name] for name, value in slots.items()}, factors=factors)


def _own(path: Path, number: int, effect: EffectTable) -> OwnEffect:
    own = load_own(path.parent / str(effect.file))
    needed = () if own.push is not None else own.term.parameters
    missing = [parameter.name for parameter in needed if parameter.name not in effect.parameters]
    if missing or own.id != effect.id:
        what = f"{missing[0]} is missing" if missing else f"its file is of {own.id!r}"
        raise ValueError(f"{path}: [[effect]] {number} (id {effect.id!r}): {what}")
    return own


def _at(size: float, known: Mapping[float, float]) -> float:
    """A number at a diameter, from those at two or more `known` ones: diameter -> number, rising. Where one of the
    nearest two is 0 there is no power law: the number at the nearer one."""
    sizes = list(known)
    high = min(max(int(np.searchsorted(sizes, size)), 1), len(sizes) - 1)
    near = sizes[high - 1 : high + 1]
    values = [known[one] for one in near]
    if min(values) <= 0:
        return known[min(near, key=lambda one: abs(math.log(one / size)))]
    power = math.log(values[1] / values[0]) / math.log(near[1] / near[0])
    return values[0] * (size / near[0]) ** power


def _range(speeds: Sequence[float]) -> str:
    low, high = min(speeds), max(speeds)
    return f"{low:g}" if math.isclose(low, high) else f"{low:g} to {high:g}"


@dataclass(frozen=True)
class AmendedLaw:
    """K, C and the effects of a model, for the spike of `settings`. Made by `read_law`."""

    settings: PenetrateSettings
    model: PenetrationModel
    slots: Mapping[str, float]  # numbers of the library's effects, of this spike's diameter
    own: tuple[OwnEffect, ...] = ()
    factors: Mapping[str, float] = field(default_factory=dict)  # of `slots` over the file's numbers
    errors: ModelErrors | None = None  # of the file's numbers
    springs: tuple[str, ...] = ()  # of `slots` those that scale with K

    @property
    def effects(self) -> tuple[str, ...]:
        """The names of what was added, each once."""
        return tuple(dict.fromkeys(effect.id for effect in self.model.effect))

    @property
    def words(self) -> str:
        """The same in words."""
        return " and ".join(self.effects) or "nothing added"

    @cached_property
    def by_diameter(self) -> dict[float, tuple[float, float]]:
        """K [N/m] and C [N s/m] of each diameter [m] that was fitted, rising; empty where the model has only one."""
        return self._noted("fitted_by_diameter")

    def _noted(self, name: str) -> dict[float, tuple[float, float]]:
        """K and C by diameter in a note of model.toml."""
        fitted = self.model.notes.get(name)
        if not isinstance(fitted, Mapping):
            return {}
        return {float(size): (float(fitted[size]["stiffness"]), float(fitted[size]["damping"]))
                for size in sorted(fitted, key=float)}  # fmt: skip

    @cached_property
    def pair(self) -> tuple[float, float]:
        """K [N/m] and C [N s/m] of this diameter. A model with several diameters has those that were fitted to it.
        Between and beyond them they follow a power law, a straight line through the nearest two in logarithms. A model
        with one diameter has its own."""
        return self._pair_of(self.by_diameter, (self.model.surface.stiffness, self.model.surface.damping))

    @property
    def has_base(self) -> bool:
        """Whether the file has the base model's own fit, or needs none: it has no effects."""
        return bool(self._noted(BASE_NOTE)) or not self.effects

    @cached_property
    def pair_without_effects(self) -> tuple[float, float]:
        """K [N/m] and C [N s/m] of the base model fitted without the effects, by the rule of `pair`. Of a file that
        does not have them, `pair`: the spring of the effects' model, which is no fit by itself."""
        fitted = self._noted(BASE_NOTE)
        return self._pair_of(fitted, next(iter(fitted.values()), self.pair))

    def _pair_of(self, fitted: Mapping[float, tuple[float, float]], single: tuple[float, float]) -> tuple[float, float]:
        """K and C of this diameter, from those in `fitted`; `single` where there are fewer than two."""
        own = self.settings.tip_diameter
        for size, pair in fitted.items():
            if math.isclose(size, own, rel_tol=1e-6):
                return pair
        if len(fitted) < 2:
            return single
        stiffness, damping = (_at(own, {size: pair[k] for size, pair in fitted.items()}) for k in (0, 1))
        return stiffness, damping

    def warnings(self) -> list[str]:
        """What a reader must know: a spike that is not the model's, and speeds that it was not fitted to."""
        own, spike, sizes = self.settings, self.model.spike, list(self.by_diameter)
        said = []
        fitted = any(math.isclose(size, own.tip_diameter, rel_tol=0.01) for size in (spike.diameter, *sizes) if size)
        if spike.diameter is not None and not fitted:
            of_k = "K and C are those of that tip"
            if len(sizes) > 1:
                between = sizes[0] < own.tip_diameter < sizes[-1]
                of_k = say("k_between" if between else "k_beyond", stiffness=self.pair[0],
                           listed=" and ".join(f"{1e3 * size:g}" for size in sizes))  # fmt: skip
            sizes_mm = {"model_mm": 1e3 * spike.diameter, "own_mm": 1e3 * own.tip_diameter}
            said.append(say("other_tip", **sizes_mm, of_k=of_k, spike=spike))
        if spike.tip != own.tip:
            said.append(f"the model is of a {spike.tip} tip, this one is a {own.tip}; --tip {spike.tip} is its own")
        drops = (*own.drop_speeds, *own.other_drop_speeds)
        if drops and spike.mass is not None and not math.isclose(spike.mass, own.mass, rel_tol=1e-3):
            said.append(say("other_mass", spike=spike, own=own))
        said += self._beyond() + self._off_at_peaks()
        driven, dropped, by_hand = self._speeds
        if by_hand or not (driven or dropped):
            return said
        # A drop has every speed below its own.
        least, most = 0.0 if dropped else min(driven), max(driven + dropped)
        pushes = {*own.speeds, *(own.other_speeds if own.on_grains else ())}  # without a bed those of one seed

        def is_far(speed: float) -> bool:
            return not least / _SPEED <= speed <= most * _SPEED

        if far := sorted(v for v in pushes | {*drops} if is_far(v)):
            said.append(say("extrapolated", s=self, far=", ".join(f"{v:g}" for v in far)))
        if pushes and is_far(own.retreat_speed):
            said.append(say("extrapolated_retreat", s=self, speed=own.retreat_speed))
        if drops and not dropped:
            said.append("the model was fitted to pushes alone: its results for drops are extrapolated")
        return said

    def _beyond(self) -> list[str]:
        """That the pushes go deeper than those of the fit, or come out where none of these did."""
        own, covered = self.settings, self.model.notes.get(RANGE_NOTE)
        if not isinstance(covered, Mapping) or not (own.speeds or own.other_speeds):
            return []
        deepest = float(covered.get("depth_m", math.inf))
        said = (
            [say("deeper", deepest_mm=1e3 * deepest, own_mm=1e3 * own.depth, more=100 * (own.depth / deepest - 1))]
            if own.depth > _DEEPER * deepest
            else []
        )
        return said + ([] if self.saw_withdrawal else [say("way_out_unseen")])

    @cached_property
    def surface_depth(self) -> float:
        """Depth at which the bed begins to carry [m], as it was fitted; 0 of a file that has none.

        Raises ValueError for anything but a depth of 0 or more."""
        note = self.model.notes.get(SURFACE_NOTE, {})
        found = note.get("depth_m", 0.0) if isinstance(note, Mapping) else note
        if not isinstance(found, int | float) or not 0.0 <= found < math.inf:
            raise ValueError(f"[notes] {SURFACE_NOTE} depth_m = {found!r}: 0 or more was expected [m]")
        return float(found)

    @property
    def saw_withdrawal(self) -> bool:
        """Whether a push that the model was fitted to came out again, as far as its file states it."""
        covered = self.model.notes.get(RANGE_NOTE)
        return not isinstance(covered, Mapping) or bool(covered.get("withdrawal", True))

    def _off_at_peaks(self) -> list[str]:
        """That the model was too low or too high at the deepest point of the pushes that it was fitted to."""
        words = bias_words(self.model.notes.get(PEAKS_NOTE))
        return [] if words is None else [say("peaks_off", **words)]

    @property
    def fitted_to(self) -> str:
        """The speeds of the trials that the model was fitted to, in words; empty where the file has none."""
        driven, dropped, by_hand = self._speeds
        parts = [f"pushes at {_range(driven)} m/s"] if driven else []
        parts += ["pushes by hand"] if by_hand else []
        parts += [f"drops at {_range(dropped)} m/s"] if dropped else []
        return " and ".join(parts)

    @property
    def _speeds(self) -> tuple[list[float], list[float], bool]:
        """Of pushes and drops that the model was fitted to [m/s], and whether some pushes have no nominal one."""
        driven = [trial.speed for trial in self.model.trial if trial.mode == "driven"]
        dropped = [trial.speed for trial in self.model.trial if trial.mode == "drop" and trial.speed is not None]
        return [speed for speed in driven if speed], dropped, None in driven or 0.0 in driven

    def plain(self, time_step: float) -> SpringDamper:
        """The spring-damper fitted without the effects, as a ground."""
        stiffness, damping = self.pair_without_effects
        return SpringDamper(stiffness=stiffness, damping=damping, time_step=time_step)

    def numbers(self, *, speed: float = 1.0, creep: float = 0.02) -> Array:
        """One lane of the law, shape [1, slot_count]. Below `creep` times `speed` [m/s] friction lets go."""
        settings, (stiffness, damping) = self.settings, self.pair
        table = slot_table(1, self.own)
        values = {"mass": settings.mass, "gravity": settings.weight / settings.mass, "speed_scale": creep * speed}
        values |= {"stiffness": stiffness, "damping": damping, "given_way": self.surface_depth}
        values["radius_depth"] = max(settings.tip_height, 1e-4 * settings.tip_diameter)
        for name, value in (values | dict(self.slots)).items():
            table[0, _SLOT[name]] = value
        places = slot_places(self.own)
        for effect in self.own:
            (told,) = (table_of.parameters for table_of in self.model.effect if table_of.id == effect.id)
            for name, value in told.items():
                table[0, places[name if effect.push is not None else f"{effect.id}.{name}"]] = value
        return table

    @property
    def own_errors(self) -> ModelErrors | None:
        """The errors of the numbers of this spike; None where the file has none, or K and C are of other tips."""
        sizes = list(self.by_diameter)
        mine = [size for size in sizes if math.isclose(size, self.settings.tip_diameter, rel_tol=1e-6)]
        if self.errors is None or not sizes:
            return self.errors
        return self.errors.at(f"{mine[0]:g}") if mine else None

    @property
    def scatter(self) -> Mapping[str, float] | None:
        """By what the beds differ that the model was fitted to (`SCATTER_NOTE`); None where that is not known."""
        note = self.model.notes.get(SCATTER_NOTE)
        return note if isinstance(note, Mapping) else None

    def run(
        self, unit: Unit, like: Penetration, within: Callable[[Unit, Run], Penetration] | None = None
    ) -> Penetration:
        """The run of `unit` on the law, at the times of `like` (the same run on another ground) and from its start.

        `within` makes a set-down, which has times of its own.
        """
        lane, path = np.zeros(1, np.int32), np.array([0, len(like.time)], dtype=np.int32)
        if unit.kind == "driven":
            numbers = self.numbers(speed=float(np.abs(like.velocity).max()))
            (force,) = push(numbers, lane, path, like.depth, like.velocity, self.own, like.time)
            return replace(like, force=force)
        if unit.kind == "drop":
            numbers = self.numbers(speed=unit.speed)
            (motion,) = fall(numbers, lane, path, like.time, np.array([unit.speed]), self.own)
            depth, velocity, acceleration, phase = motion.T
            carried = like.time < 0  # before the surface it goes at its speed
            return replace(
                like,
                depth=np.where(carried, like.depth, depth),
                velocity=np.where(carried, like.velocity, velocity),
                force=np.where(carried, 0.0, self.settings.weight - self.settings.mass * acceleration),
                phase=np.where(carried, "free", np.array(PHASES)[np.clip(phase.astype(int), 0, 3)]),
            )
        ground = AmendedGround(self, time_step=like.macro_step / self.settings.substeps, speed=unit.speed)
        own = make_run(self.settings, unit, ground, start_depth=like.settings.get("start_depth"))
        return own.run() if within is None else within(unit, own)


class AmendedGround:
    """The law as a *ground* (see `coupling.ground`): it remembers how deep it was since it was entered, and ever.

    A step answers with the force at its middle, exact to the second order of its length. A bed that holds on may pull.
    """

    name = "spring-damper, amended"
    surface, clearance, depth_limit = 0.0, 0.0, math.inf  # the surface is flat, without a floor [m]
    centre = (0.0, 0.0)
    """Where a body is put [m]: the surface is the same everywhere."""

    def __init__(self, law: AmendedLaw, *, time_step: float, speed: float) -> None:
        self.time_step = time_step
        """The step it is to be driven at [s]."""
        self._own = law.own
        self._numbers = law.numbers(speed=speed, creep=_CREEP)
        self._top = self._ever = 0.0
        self._gone = given_way(self._numbers[0], None, 0.0, 0.0, self._own)
        self._loose = law.surface_depth

    def describe(self) -> Json:
        """What it is, in plain numbers."""
        return {name: float(self._numbers[0, place]) for name, place in _SLOT.items() if self._numbers[0, place]}

    def step(self, position: ArrayLike, velocity: ArrayLike, dt: float) -> Reaction:
        """Reaction at the middle of `dt` [s] on a body whose tip starts at `position` [m], at constant `velocity`."""
        start, sinking = self.surface - float(np.asarray(position)[2]), -float(np.asarray(velocity)[2])
        middle, end = start + 0.5 * sinking * dt, start + sinking * dt
        # The way that the law has to know, in four rows: how deep ever, out, how deep since then, and here.
        depth = np.array([self._ever, 0.0, self._top, middle])
        speed = np.array([0.0, 0.0, 0.0, sinking])
        lane, path = np.zeros(1, np.int32), np.array([0, 4], np.int32)
        if middle > 0:
            gone = given_way(self._numbers[0], self._gone, middle, 0.5 * dt, self._own)
            self._numbers[0, _SLOT["given_way"]] = self._loose + gone.sum()
        force = float(push(self._numbers, lane, path, depth, speed, self._own)[0, 3])
        self._top = max(self._top, start, end) if end > 0 else 0.0
        self._ever = max(self._ever, end, 0.0)
        gone = given_way(self._numbers[0], self._gone, middle, dt, self._own)
        self._gone = gone if end > 0 else np.zeros_like(gone)
        return Reaction(np.array([0.0, 0.0, force]), np.zeros(3))

    def state(self) -> Json:
        """What it remembers."""
        return {"top": np.array(self._top), "ever": np.array(self._ever), "given_way": self._gone.copy()}

    def restore(self, state: Json) -> None:
        """Take back what `state` gave."""
        self._top, self._ever = (float(state[name]) for name in ("top", "ever"))
        self._gone = np.array(state["given_way"], dtype=float).reshape(self._gone.shape)


Runs = Mapping[str, Penetration]


def kept_law(settings: PenetrateSettings, folder: Path) -> AmendedLaw | None:
    """The law of the model that the folder keeps; None where there is none."""
    return None if settings.model is None else read_law(folder / MODEL_COPY, settings)


def run_beside(
    law: AmendedLaw, units: Sequence[Unit], beds: Runs, models: Runs, folder: RunFolder
) -> tuple[dict[str, Json], list[str], dict[str, Json]]:
    """Make every run of the bed on the law and keep its series: quantities, sentences and, by id, each run's numbers.

    `models` are the same runs on the spring-damper that was fitted to the bed.
    """
    runs = {unit.id: law.run(unit, beds[unit.id] if unit.kind == "driven" else models[unit.id]) for unit in units}
    for name, series in runs.items():
        folder.write_series(f"{name}.amended", series.columns())
    driven = [unit.id for unit in units if unit.kind == "driven"]
    plain, amended = (force_gap(driven, beds, others) for others in (models, runs))
    note = "rms difference over the bed's rms force, driven runs, in, at rest and out"
    quantities: dict[str, tuple[float | None, str, str]] = {
        "force_gap_spring_damper": (plain, "1", note),
        "force_gap_amended": (amended, "1", f"the same with {law.words}"),
        "sinkage_amended": (rest_of(units, runs), "m", f"depth at rest with {law.words}"),
        "work_returned_amended": (returned_by(units, runs), "1", "work of unloading over work of loading, driven"),
    }
    known = plain is not None and amended is not None
    sentences = [say("off_by", law=law, amended=100 * amended, plain=100 * plain)] if known else []  # type: ignore[operator]
    return quantities_of(quantities, std=None), sentences, {name: amended_numbers(run) for name, run in runs.items()}


def amended_numbers(run: Penetration) -> Json:
    """The numbers of a run on the law, by their names in result.json."""
    return {f"amended_{name}": value for name, value in run.quantities().items()}


def rest_of(units: Sequence[Unit], runs: Runs) -> float | None:
    return mean_of([runs[unit.id].resting_depth for unit in units if unit.kind == "set_down"])


def returned_by(units: Sequence[Unit], runs: Runs) -> float | None:
    return mean_of([returned_work(runs[unit.id]) for unit in units if unit.kind == "driven"])
