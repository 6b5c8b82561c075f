"""A bed's state as numpy arrays: taken, put back to the bit, kept in a file, taken over by a bed of another layout."""

import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dem.grains.materials import Material

from .base import BedBase
from .engine import Engine
from .lists import INDEX_BITS, INDEX_MASK
from .rows import read_fields, row_numbers, take_rows, write_fields
from .sleep import Sleep, Sleeper
from .values import BedSettings, State

__all__ = ["adopt", "laid_end_to_end", "put_back", "read_file", "take", "touching_pairs", "whole_file", "write_file"]

STATE_FORMAT = "hedgebed-bed/3"
# Before there was cohesion, and before contacts remembered their last step; these files can still be read.
STATE_FORMATS = ("hedgebed-bed/1", "hedgebed-bed/2", STATE_FORMAT)

MATERIAL_NUMBERS = ("density", "young", "poisson", "friction", "restitution", "rolling_friction", "surface_energy")
GRAIN_FIELDS = Engine.GRAIN_FIELDS
BODY_FIELDS = (*Engine.BODY_FIELDS, "overlap", "pushes")
NEAR_FIELDS = ("near_grain", "near_body", "near_slide", "near_roll")
LIST_NAMES = ("pair_count", "pair", "slide", "near_count", *NEAR_FIELDS)
NAMES = (*GRAIN_FIELDS, *BODY_FIELDS, *LIST_NAMES, "numbers", "reals")
ABOUT = ("material", "material_numbers", "cohesion", "size", "height", "tensile", "seed", "precision")


def take(bed: BedBase) -> State:
    """Everything that the next step depends on, to the bit."""
    bed.check_valid()
    e = bed.engine
    state = {name: e.read(name) for name in (*GRAIN_FIELDS, *BODY_FIELDS)}
    start, end = e.read("pair_start"), e.read("pair_end")
    counts = end - start
    rows = row_numbers(start, counts)
    pair = take_rows(e.pair, rows)
    touching = rows[pair < 0]
    state |= {"pair_count": counts, "pair": pair, "slide": take_rows(e.slide, touching)}
    near_count = e.read("near_end") - _near_starts(e)
    near = row_numbers(_near_starts(e), near_count)
    state |= {"near_count": near_count, **read_fields(e, dict.fromkeys(NEAR_FIELDS, near), "")}
    if e.rolling:
        state["roll"] = take_rows(e.roll, touching)
    state |= e.shape_state()
    if bed.sleeper is not None:
        state |= bed.sleeper.state(rows)
    if e.balance.on:
        state |= read_fields(e.balance, e.balance.rows(rows, near), "ledger_")
    bodies = int(e.body_count[None])
    state["numbers"] = np.array(
        [bed.steps, bodies, bed.list_count, bed.steps_since_lists, bed.reaction_steps, int(bed.has_floor)]
    )
    state["reals"] = np.array(
        [bed.time_step, bed.skin, *bed.gravity, bed.surface, bed.packing_fraction, bed.overlap_limit]
    )
    return state


def put_back(bed: BedBase, state: State) -> None:
    """Bring a bed of the same layout to a state. Raises ValueError for a state of another bed."""
    e = bed.engine
    if len(state["id"]) != bed.grain_count or len(state["near_count"]) != e.chunk_count:
        raise ValueError(
            f"this state has {len(state['id'])} grains in {len(state['near_count'])} chunks, the bed "
            f"{bed.grain_count} in {e.chunk_count}; it belongs to another bed"
        )
    if state["position"].dtype != bed.runtime.dtype:
        raise ValueError(f"this state is in {state['position'].dtype}, the bed in {bed.runtime.precision}")
    for name in (*GRAIN_FIELDS, *BODY_FIELDS):
        e.write(name, state[name])
    e.restore_shapes(state)
    counts = state["pair_count"]
    awake, chunks = state.get("sleep_numbers", (bed.grain_count, e.chunk_count))[:2]
    chunk = _chunk_starts(awake, chunks)
    before = np.concatenate(([0], np.cumsum(counts)))
    which = np.repeat(np.arange(chunks), np.diff(chunk))
    start = np.zeros(bed.grain_count, dtype=np.int32)
    start[:awake] = before[:awake] - before[chunk[which]] + which * e.chunk_room
    rows = row_numbers(start, counts)
    touching = rows[state["pair"] < 0]
    e.write("pair_start", start)
    e.write("pair_end", (start + counts).astype(np.int32))
    e.write("first", np.repeat(np.arange(bed.grain_count), counts).astype(np.int32), rows)
    for name, at in (("pair", rows), ("slide", touching), *((("roll", touching),) if e.rolling else ())):
        e.write(name, state[name], at)
    near = _write_near(e, state["near_count"], state)
    e.close_balance()
    if "ledger_taken" in state:
        x, y, z = (float(v) for v in state["reals"][2:5])
        e.open_balance((x, y, z))
        write_fields(e.balance, e.balance.rows(rows, near), "ledger_", state)
    numbers = [int(v) for v in state["numbers"]]
    bed.steps, bodies, bed.list_count, bed.steps_since_lists, bed.reaction_steps, floor = numbers
    bed.has_floor, bed.tallied = bool(floor), None
    e.body_count[None] = bodies
    e.moved[None] = 0
    e.halted[None] = 0
    reals = [float(v) for v in state["reals"]]
    bed.time_step, bed.skin = reals[:2]
    bed.gravity = tuple(reals[2:5])
    bed.surface, bed.packing_fraction, bed.overlap_limit = reals[5:]
    e.wake_all()
    bed.sleeper = None
    if "sleep_rules" in state:
        e.let_sleep()
        e.count[e.AWAKE], e.count[e.CHUNKS] = int(awake), int(chunks)
        bed.sleeper = Sleeper(bed, Sleep(*state["sleep_rules"][:-1], every=int(state["sleep_rules"][-1])))
        bed.sleeper.restore(state, rows)


def write_file(bed: BedBase, path: Path) -> None:
    """Write a bed to an .npz file, whole or not at all."""
    stuff = bed.material
    about: State = {
        "format": np.array(STATE_FORMAT),
        "material": np.array(stuff.name),
        "material_numbers": np.array([getattr(stuff, key) for key in MATERIAL_NUMBERS]),
        "cohesion": np.array(stuff.cohesion),
        "size": np.array(bed.size),
        "height": np.array(bed.settings.height),
        "tensile": np.array(bed.settings.tensile),
        "seed": np.array(-1 if bed.seed is None else bed.seed),
        "precision": np.array(bed.runtime.precision),
    }
    about |= {f"state.{key}": values for key, values in take(bed).items()}
    with whole_file(path) as part, part.open("wb") as file:
        np.savez(file, **about)  # type: ignore[arg-type]


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file to write to that becomes ``path`` at the end, so that this is written whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
        yield (part := Path(scratch) / path.name)
        part.replace(path)


def read_file(path: Path) -> tuple[BedSettings, State, str]:
    """Settings, state and precision of a bed that ``write_file`` wrote. Raises ValueError where there is none."""
    try:
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            stored = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; a bed saved by Bed.save was expected") from None
    except (zipfile.BadZipFile, ValueError, OSError, EOFError) as problem:
        raise ValueError(f"{path} is not a bed saved by hedgebed ({problem})") from None
    found = str(stored.get("format", "missing"))
    if found not in STATE_FORMATS:
        raise ValueError(f"{path}: format is {found}, {STATE_FORMAT!r} was expected")
    if found == STATE_FORMATS[0] and "material_numbers" in stored:
        stored["material_numbers"] = np.append(stored["material_numbers"], 0.0)
        stored["cohesion"] = np.array("none")
    lacking = [key for key in (*ABOUT, *(f"state.{name}" for name in NAMES)) if key not in stored]
    if lacking:
        raise ValueError(f"{path} is not a whole bed saved by hedgebed: it lacks {', '.join(lacking)}")
    numbers: Any = dict(zip(MATERIAL_NUMBERS, map(float, stored["material_numbers"]), strict=True))
    state = {name[6:]: value for name, value in stored.items() if name.startswith("state.")}
    if found != STATE_FORMAT:
        for key in ("slide", "near_slide"):  # 0: as of a contact that has just begun
            state[key] = np.pad(state[key], ((0, 0), (0, 1)))
    seed = int(stored["seed"])
    settings = BedSettings(
        material=Material(str(stored["material"]), cohesion=str(stored["cohesion"]), **numbers),
        size=_three(stored["size"]),
        gravity=_three(state["reals"][2:5]),
        time_step=float(state["reals"][0]),
        max_overlap=float(state["reals"][7]),
        height=float(stored["height"]),
        tensile=bool(stored["tensile"]),
        seed=None if seed < 0 else seed,
    )
    return settings, state, str(stored["precision"])


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def adopt(bed: BedBase, state: State, *, keep: np.ndarray | None = None) -> None:
    """Take over the grains, contacts and bodies of a state whose layout is another; ``keep``: which grains, by id."""
    e = bed.engine
    if "sleep_rules" in state:
        raise ValueError("this state has grains that sleep, and its layout is another: wake the bed before it is saved")
    ids = state["id"]
    if keep is None:
        keep = np.ones(len(ids), dtype=bool)
    new_id = np.cumsum(keep) - 1
    stay = keep[ids]
    place = np.cumsum(stay) - 1  # row in the old order -> row in the new one
    dtype = bed.runtime.dtype
    for name in ("position", "velocity", "spin", "origin"):
        e.write(name, state[name][stay].astype(dtype))
    e.write("id", new_id[ids[stay]].astype(np.int32))
    # The contacts as one list a grain, each pair once, rows from 0: what make_lists takes over as history.
    first, second, _ = touching_pairs(state)
    chosen = stay[first] & stay[second]
    a, b = place[first[chosen]], place[second[chosen]]
    counts = np.bincount(a, minlength=bed.grain_count)
    start = np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.int32)
    e.write("pair_start", start)
    e.write("pair_end", (start + counts).astype(np.int32))
    e.write("pair", ~b.astype(np.int32))
    e.write("slide", state["slide"][chosen])
    if e.rolling:
        e.write("roll", state["roll"][chosen])
    near = stay[state["near_grain"]]
    grain = place[state["near_grain"][near]]
    starts = _chunk_starts(bed.grain_count, e.chunk_count)
    chunk = np.searchsorted(starts, grain, side="right") - 1
    near_count = np.bincount(chunk, minlength=e.chunk_count)
    _write_near(e, near_count, {name: state[name][near] for name in NEAR_FIELDS} | {"near_grain": grain})
    for name in Engine.BODY_FIELDS:
        e.write(name, state[name])
    e.restore_shapes(state)
    e.body_count[None] = int(state["numbers"][1])
    bed.has_floor = bool(state["numbers"][5])
    bed.steps = int(state["numbers"][0])
    bed.make_lists()
    bed.compute_forces()
    # Computed anew they would lack what dashpots know of the step before: only where a contact has gone.
    lost = np.zeros(len(ids), dtype=bool)
    apart = stay[first] != stay[second]
    lost[first[apart]] = lost[second[apart]] = True
    row = np.empty(bed.grain_count, dtype=np.int64)
    row[new_id[ids[stay]]] = np.flatnonzero(stay)
    row = row[e.read("id")]
    for name in ("force", "torque"):
        e.write(name, np.where(lost[row, None], e.read(name), state[name][row].astype(dtype)))
    bed.measure_surface()


def laid_end_to_end(state: State, times: int, *, period: float) -> State:
    """The grains and contacts of a state `times` over along x, one `period` [m] apart, for ``adopt``; bodies once.

    A contact across the ends of the period becomes one of a copy with the next, and across the ends of the whole.
    """
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


def _chunk_starts(grain_count: int, chunk_count: int) -> np.ndarray:
    """First grain of each chunk and the end, shape [chunk_count + 1]; as ``Engine.chunk_range`` has it."""
    base, rest = divmod(grain_count, chunk_count)
    c = np.arange(chunk_count + 1)
    return c * base + np.minimum(c, rest)


def touching_pairs(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The touching rows of the pair lists: grain, neighbour, and periods (x, y) from the neighbour's image back to it.

    Grains are places in memory; shapes [row_count], [row_count], [row_count, 2].
    """
    touching = state["pair"] < 0
    first = np.repeat(np.arange(len(state["id"])), state["pair_count"])[touching]
    bits = ~state["pair"][touching].astype(np.int64)
    image = bits >> INDEX_BITS
    return first, bits & INDEX_MASK, np.column_stack([image % 3 - 1, image // 3 - 1])


def _near_starts(e: Engine) -> np.ndarray:
    """First row of each chunk in the lists of grains near bodies."""
    return np.arange(e.chunk_count) * e.near_room


def _write_near(e: Engine, counts: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Put the lists of grains near bodies into the engine, ``counts`` of them in each chunk; their rows."""
    rows = row_numbers(_near_starts(e), counts)
    e.write("near_end", (counts + _near_starts(e)).astype(np.int32))
    write_fields(e, dict.fromkeys(NEAR_FIELDS, rows), "", values)
    return rows
