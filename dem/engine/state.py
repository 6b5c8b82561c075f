"""The state of a bed: as numpy arrays, in a file, in a bed of another layout; and checkpoint and rollback.

A checkpoint is all that the next steps depend on, copied where it lies, on the device. ``Bed.state`` returns the same
as arrays of the host, packed, for files. A coupling that repeats steps needs checkpoints often; on a GPU they stay on
the device.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from dem.files.arrays import read_arrays, whole_file
from dem.grains.materials import Material, of_before

from .bodies import BedBodies
from .engine import Engine
from .lists import ABSENT, INDEX_BITS, INDEX_MASK
from .rows import layout_of, read_fields, take_rows, twins_of, write_fields
from .sleep import Sleeper
from .values import BedSettings, Sleep, State

__all__ = ["BedState", "Checkpoint", "adopt", "laid_end_to_end", "read_file", "touching_pairs"]

STATE_FORMAT = "hedgebed-bed/4"
# Before there was cohesion, before contacts remembered their last step, and before springs were rescaled; these files
# can still be read.
STATE_FORMATS = ("hedgebed-bed/1", "hedgebed-bed/2", "hedgebed-bed/3", STATE_FORMAT)

MATERIAL_NUMBERS = ("density", "young", "poisson", "friction", "restitution", "rolling_friction", "surface_energy")
GRAIN_FIELDS = Engine.GRAIN_FIELDS
BODY_FIELDS = (*Engine.BODY_FIELDS, "overlap", "pushes")
NEAR_FIELDS = ("near_grain", "near_body", "near_slide", "near_roll")
LIST_NAMES = ("pair_count", "pair", "slide", "near_count", *NEAR_FIELDS)
NAMES = (*GRAIN_FIELDS, *BODY_FIELDS, *LIST_NAMES, "numbers", "reals")
ABOUT = ("material", "material_numbers", "cohesion", "tangential", "size", "height", "tensile", "seed", "precision")


_BED_NUMBERS = ("steps", "list_count", "grain_steps", "steps_since_lists", "reaction_steps", "skin", "tallied")
_SLEEP_NUMBERS = ("awake", "fast", "mass", "slept", "leaving", "begun_ahead")


@dataclass(eq=False)
class Checkpoint:
    """What ``Bed.checkpoint`` returned. A bed keeps one; the next one replaces it.

    Attributes:
        tables: whose fields were copied: the engine, the sleepers, the balance. Others where lists have grown since.
        numbers: (owner, attribute, value) of what no field holds.
        conditions: gravity, and the rules of sleep at work, which must be the same at a rollback.
    """

    tables: tuple[Any, ...]
    numbers: list[tuple[Any, str, Any]]
    conditions: tuple[Any, ...]


class BedState(BedBodies):
    """A bed whose state can be taken, brought back and kept in a file."""

    def state(self) -> State:
        """Everything that the next step depends on, to the bit: a flat dict of numpy arrays."""
        self.check_valid()
        e = self.engine
        state = {name: e.read(name) for name in (*GRAIN_FIELDS, *BODY_FIELDS)}
        counts, rows = e.listed_pairs()
        pair = take_rows(e.pair, rows)
        touching = rows[pair < 0]
        state |= {"pair_count": counts, "pair": pair, "slide": take_rows(e.slide, touching)}
        near_count, near = e.listed_near()
        state |= {"near_count": near_count, **read_fields(e, dict.fromkeys(NEAR_FIELDS, near), "")}
        if e.gpu:  # not yet added to the sums of the bodies
            state["near_push"] = take_rows(e.near_push, near)
        if e.rolling:
            state["roll"] = take_rows(e.roll, touching)
        state |= e.shape_state()
        if self.sleeper is not None:
            state |= self.sleeper.state(rows)
        if e.balance.on:
            state |= read_fields(e.balance, e.balance.rows(rows, near), "ledger_")
        bodies = int(e.body_count[None])
        state["numbers"] = np.array(
            [self.steps, bodies, self.list_count, self.steps_since_lists, self.reaction_steps, int(self.has_floor)]
        )
        state["reals"] = np.array(
            [self.time_step, self.skin, *self.gravity, self.surface, self.packing_fraction, self.overlap_limit]
        )
        return state

    def restore(self, values: State) -> None:
        """Go back to a state of this bed, or of one that was made with the same settings.

        Raises ValueError: a state of another number of grains, of another layout or precision, or of rules of sleep
        that there are no more.
        """
        self.check_valid()
        e = self.engine
        if len(values["id"]) != self.grain_count or len(values["near_count"]) != e.chunk_count:
            raise ValueError(
                f"this state has {len(values['id'])} grains in {len(values['near_count'])} chunks, the bed "
                f"{self.grain_count} in {e.chunk_count}; it belongs to another bed"
            )
        if values["position"].dtype != self.runtime.precision:
            raise ValueError(f"this state is in {values['position'].dtype}, the bed in {self.runtime.precision}")
        rules = Sleep.of_numbers(values["sleep_rules"].tolist()) if "sleep_rules" in values else None
        layout = layout_of(values)
        self.make_room(*e.rooms_for(values["pair_count"], values["near_grain"], *layout))
        e = self.engine
        for name in (*GRAIN_FIELDS, *BODY_FIELDS):
            e.write(name, values[name])
        e.restore_shapes(values)
        rows = e.lay_pairs(values["pair_count"], *layout)
        touching = rows[values["pair"] < 0]
        for name, at in (("pair", rows), ("slide", touching), *((("roll", touching),) if e.rolling else ())):
            e.write(name, values[name], at)
        near = _write_near(e, values, *layout)
        if e.gpu:
            e.write("near_push", values["near_push"], near)
        e.balance = ABSENT
        if "ledger_taken" in values:
            x, y, z = (float(v) for v in values["reals"][2:5])
            e.open_balance((x, y, z))
            kept = e.balance.of_today(values, prefix="ledger_")
            write_fields(e.balance, e.balance.rows(rows, near), "ledger_", kept)
        numbers = [int(v) for v in values["numbers"]]
        self.steps, bodies, self.list_count, self.steps_since_lists, self.reaction_steps, floor = numbers
        self.has_floor, self.tallied, self.sleeper = bool(floor), None, None
        e.body_count[None] = bodies
        e.moved[None] = e.halted[None] = 0
        reals = [float(v) for v in values["reals"]]
        self.time_step, self.skin, self.gravity = reals[0], reals[1], tuple(reals[2:5])
        self.surface, self.packing_fraction, self.overlap_limit = reals[5:]
        e.wake_all()
        if rules is not None:
            e.let_sleep()
            e.count[e.AWAKE], e.count[e.CHUNKS], e.count[e.FAST], e.count[e.FAST_CHUNKS] = layout
            self.sleeper = Sleeper(self, rules)
            self.sleeper.restore(values, rows)

    def successor(self, values: State, *, keep: np.ndarray | None = None, **changes: Any) -> Self:
        """Another bed, of the grains of a state or those to ``keep``, by id; ``changes`` are to the settings."""
        radii = values["position"][np.argsort(values["id"]), 3].astype(float)
        settings = replace(self.settings, gravity=self.gravity, **changes)
        bed = type(self)(settings, radii if keep is None else radii[keep], **asdict(self.runtime))
        bed.debug = self.debug
        adopt(bed, values, keep=keep)
        return bed

    def checkpoint(self) -> Checkpoint:
        """Keep what the next steps depend on for ``rollback``, in the memory of the device: on a GPU nothing is read.

        A bed has one checkpoint at a time; the first one takes as much memory again as grains and lists do.
        """
        self.check_valid()
        owners: list[tuple[Any, tuple[str, ...]]] = [(self, _BED_NUMBERS)]
        if self.sleeper is not None:
            owners.append((self.sleeper, _SLEEP_NUMBERS))
        numbers = [(owner, name, getattr(owner, name)) for owner, names in owners for name in names]
        kept = Checkpoint(_tables(self.engine), numbers, (*map(float, self.gravity), self.sleeper))
        for table in kept.tables:
            for name, twin in twins_of(table).items():
                twin.copy_from(getattr(table, name))
        self.engine.held = kept
        return kept

    def rollback(self, kept: Checkpoint) -> None:
        """Go back to the last checkpoint, to the bit; as often as you like.

        Raises ValueError: another checkpoint has been taken since, or sleep, its rules, gravity or the balance changed.
        """
        self.check_valid()
        e = self.engine
        if e.held is not kept or kept.tables != _tables(e):
            raise ValueError("this bed holds another state by now: only the last one that was held can be taken back")
        if kept.conditions != (*map(float, self.gravity), self.sleeper):
            raise ValueError("gravity or the rules of sleep are others by now than when this bed was held")
        for table in kept.tables:
            for name, twin in twins_of(table).items():
                getattr(table, name).copy_from(twin)
        if e.rest.on:
            e.rest.whole[None] = 1  # of what lists were made with nothing is kept
        for owner, name, value in kept.numbers:
            setattr(owner, name, value)

    def save(self, path: str | Path) -> Path:
        """Write the bed to one file (.npz), whole or not at all. Returns the path."""
        stuff = self.material
        about: State = {
            "format": np.array(STATE_FORMAT),
            "material": np.array(stuff.name),
            "material_numbers": np.array([getattr(stuff, key) for key in MATERIAL_NUMBERS]),
            "cohesion": np.array(stuff.cohesion),
            "tangential": np.array(stuff.tangential),
            "size": np.array(self.size),
            "height": np.array(self.settings.height),
            "tensile": np.array(self.settings.tensile),
            "seed": np.array(-1 if self.seed is None else self.seed),
            "precision": np.array(self.runtime.precision),
        }
        about |= {f"state.{key}": values for key, values in self.state().items()}
        with whole_file(Path(path)) as part, part.open("wb") as file:
            np.savez(file, **about)  # type: ignore[arg-type]
        return Path(path)

    @classmethod
    def load(cls, path: str | Path, *, arch: str = "cpu", threads: int | None = None) -> Self:
        """Read a bed that ``save`` wrote; it continues bitwise the same on the same kind of processor.

        Raises ValueError: the file is missing or is not a bed.
        """
        settings, values, precision = read_file(Path(path))
        bed = cls(settings, values["position"][:, 3].astype(float), precision=precision, arch=arch, threads=threads)
        if len(values["near_count"]) == bed.engine.chunk_count:
            bed.restore(values)
        else:
            adopt(bed, values)
        return bed


def _tables(e: Engine) -> tuple[Any, ...]:
    """The tables of fields at work: the engine, the sleepers, the balance."""
    return (e, *(table for table in (e.rest, e.balance) if table.on))


def read_file(path: Path) -> tuple[BedSettings, State, str]:
    """Settings, state and precision of a bed that ``BedState.save`` wrote. Raises ValueError where there is none."""
    try:
        stored = read_arrays(path)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; a bed saved by Bed.save was expected") from None
    except (ValueError, OSError) as problem:
        raise ValueError(f"{path} is not a bed saved by hedgebed ({problem})") from None
    found = str(stored.get("format", "missing"))
    if found not in STATE_FORMATS:
        raise ValueError(f"{path}: format is {found}, {STATE_FORMAT!r} was expected")
    if found == STATE_FORMATS[0] and "material_numbers" in stored:
        stored["material_numbers"] = np.append(stored["material_numbers"], 0.0)
        stored["cohesion"] = np.array("none")
    if found in STATE_FORMATS[:3]:
        stored["tangential"] = np.array("displacement")
    missing = [key for key in (*ABOUT, *(f"state.{name}" for name in NAMES)) if key not in stored]
    if missing:
        raise ValueError(f"{path} is not a whole bed saved by hedgebed: {', '.join(missing)} are missing")
    numbers: Any = dict(zip(MATERIAL_NUMBERS, map(float, stored["material_numbers"]), strict=True))
    state = {name[6:]: value for name, value in stored.items() if name.startswith("state.")}
    if found in STATE_FORMATS[:2]:
        for key in ("slide", "near_slide"):  # 0: as of a contact that has just begun
            state[key] = np.pad(state[key], ((0, 0), (0, 1)))
    seed = int(stored["seed"])
    (x, y, z), (gx, gy, gz) = map(float, stored["size"]), map(float, state["reals"][2:5])
    settings = BedSettings(
        material=of_before(
            Material(
                str(stored["material"]),
                cohesion=str(stored["cohesion"]),
                tangential=str(stored["tangential"]),
                **numbers,
            )
        ),
        size=(x, y, z),
        gravity=(gx, gy, gz),
        time_step=float(state["reals"][0]),
        max_overlap=float(state["reals"][7]),
        height=float(stored["height"]),
        tensile=bool(stored["tensile"]),
        seed=None if seed < 0 else seed,
    )
    return settings, state, str(stored["precision"])


def adopt(bed: BedBodies, state: State, *, keep: np.ndarray | None = None) -> None:
    """Take over the grains, contacts and bodies of a state whose layout is another; ``keep``: which grains, by id."""
    e = bed.engine
    if "sleep_rules" in state:
        raise ValueError("this state has grains that sleep, and its layout is another: wake the bed before it is saved")
    ids = state["id"]
    keep = np.ones(len(ids), dtype=bool) if keep is None else keep
    new_id = np.cumsum(keep) - 1
    stay = keep[ids]
    place = np.cumsum(stay) - 1  # row in the old order -> row in the new one
    for name in ("position", "velocity", "spin", "origin"):
        e.write(name, state[name][stay])
    e.write("id", new_id[ids[stay]])
    # The contacts as one list a grain, each pair once, rows from 0: what make_lists takes over as history.
    first, second, _ = touching_pairs(state)
    chosen = stay[first] & stay[second]
    a, b = place[first[chosen]], place[second[chosen]]
    counts = np.bincount(a, minlength=bed.grain_count)
    near = stay[state["near_grain"]]
    values = {name: state[name][near] for name in NEAR_FIELDS}
    values["near_grain"] = place[values["near_grain"]]
    bed.make_room(*e.rooms_for(counts, values["near_grain"], bed.grain_count, e.chunk_count))
    e = bed.engine
    rows = e.lay_history(counts)
    e.write("pair", ~b, rows)
    for name in ("slide", "roll") if e.rolling else ("slide",):
        e.write(name, state[name][chosen], rows)
    _write_near(e, values, bed.grain_count, e.chunk_count)
    for name in Engine.BODY_FIELDS:
        e.write(name, state[name])
    e.restore_shapes(state)
    e.body_count[None] = int(state["numbers"][1])
    bed.has_floor = bool(state["numbers"][5])
    bed.steps = int(state["numbers"][0])
    bed.make_lists()
    e = bed.engine
    bed.compute_forces()
    # Computed anew they are without what dashpots know of the step before: only where a contact has gone.
    lost, apart = np.zeros(len(ids), dtype=bool), stay[first] != stay[second]
    lost[first[apart]] = lost[second[apart]] = True
    row = np.empty(bed.grain_count, dtype=np.int64)
    row[new_id[ids[stay]]] = np.flatnonzero(stay)
    row = row[e.read("id")]
    for name in ("force", "torque"):
        e.write(name, np.where(lost[row, None], e.read(name), state[name][row]))
    bed.measure_surface()


def laid_end_to_end(state: State, times: int, *, period: float) -> State:
    """A state ``times`` over along x, one ``period`` [m] apart, for ``adopt``; contacts across its ends join copies."""
    count = len(state["id"])
    copy = np.repeat(np.arange(times), count)
    found = dict(state)
    for name in ("position", "velocity", "spin", "force", "torque", "origin"):
        found[name] = np.tile(state[name], (times, 1))
    for name in ("position", "origin"):
        found[name][:, 0] += (period * copy).astype(found[name].dtype)
    found["id"] = np.tile(state["id"], times) + count * copy
    # Those that touch, which alone have a history.
    first, second, back = touching_pairs(state)
    found["pair_count"] = np.tile(np.bincount(first, minlength=count), times)
    found["pair"] = np.concatenate([~(second + count * ((k - back[:, 0]) % times)) for k in range(times)])
    found["near_grain"] = np.concatenate([state["near_grain"].astype(np.int64) + count * k for k in range(times)])
    found["near_body"] = np.tile(state["near_body"], times)
    for name in ("slide", "roll", "near_slide", "near_roll"):
        if name in state:
            found[name] = np.tile(state[name], (times, 1))
    return found


def touching_pairs(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The touching rows of the pair lists: grain, neighbour, and periods (x, y) from the neighbour's image back to it.

    Grains are places in memory; shapes [row_count], [row_count], [row_count, 2].
    """
    touching = state["pair"] < 0
    first = np.repeat(np.arange(len(state["id"])), state["pair_count"])[touching]
    bits = ~state["pair"][touching].astype(np.int64)
    image = bits >> INDEX_BITS
    return first, bits & INDEX_MASK, np.column_stack([image % 3 - 1, image // 3 - 1])


def _write_near(e: Engine, values: Mapping[str, np.ndarray], *layout: int) -> np.ndarray:
    """Put the lists of grains near bodies into the engine; their rows."""
    rows = e.lay_near(values["near_grain"], *layout)
    write_fields(e, dict.fromkeys(NEAR_FIELDS, rows), "", values)
    return rows
