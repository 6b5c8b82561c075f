"""Reads run folders of penetrate into the `Data` of a fit; runs that cannot be fitted together are refused by name."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupling import Penetration
from dem.grains.materials import material
from experiments.grains.kept_material import MATERIAL_COPY
from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.folder import RunFolder
from experiments.runs.types import Json
from rigid.checks import alike

from .cells import Cell
from .data import Data, Drag, Foundation, Placement, Unloading, binned, reached
from .further import read_further
from .settings import LawFitSettings, say

__all__ = ["read_cells", "read_folders"]

_OF_BED = (
    "bed", "seed", "bed_size", "grain", "spread", "coarse", "fine_radius", "fine_depth", "packing", "bed_stages",
    "gravity", "young", "max_overlap", "time_step",
)  # fmt: skip
"""Settings that decide which bed a run begins in: the same run twice is one that has them all in common."""
_SHARED = {"material": "grains", "grain": "grain [m]", "spike_friction": "friction of spike and grains [1]"}
"""Settings that all runs must have in common, and what they are."""
_MAY_DIFFER = {
    "bed_size": "bed_size [m]",
    "young": "Young's modulus [Pa]",
    "packing": "packing",
    "bed_stages": "stages",
}
"""Settings that may differ between the beds; a note says so."""


@dataclass(frozen=True)
class _Source:
    """One run folder."""

    name: str  # as the user wrote it, or the name below the folder that he gave
    folder: RunFolder
    settings: PenetrateSettings
    result: Json


def read_cells(settings: LawFitSettings) -> dict[str, Data]:
    """All runs of `settings`: name of each tip and gravity (`Cell.name`) -> the data of its fits.

    Raises ValueError, naming the folder and what was found: for no finished run of penetrate in a bed; for a kept
    result without series; for runs of different grains or the same run twice. A tip and gravity with fewer than two
    beds is refused too. So are runs at one speed, from which C and K cannot be separated.
    """
    sources = [_read(name, path) for given in settings.runs for name, path in _folders(given)]
    _refuse_mixed(sources)
    found: dict[str, list[_Source]] = {}
    for source in sources:
        found.setdefault(Cell(source.settings).name, []).append(source)
    cells = {}
    for name, own in found.items():
        try:
            cells[name] = _data(own, settings)
        except ValueError as error:
            raise ValueError(f"{name}: {error}" if len(found) > 1 else str(error)) from None
    return cells


def read_folders(folders: Sequence[tuple[str, Path]], settings: LawFitSettings) -> Data:
    """The runs in `folders` (name, path), of one tip and gravity; raises as `read_cells`."""
    return _data([_read(name, path) for name, path in folders], settings)


def _data(sources: Sequence[_Source], settings: LawFitSettings) -> Data:
    loaded: list[tuple[Penetration, Json]] = []
    placements: list[Placement] = []
    above: list[str] = []  # Beds whose grains carry the spike at the surface or above it
    grains: dict[str, set[str]] = {}
    seen: dict[tuple[Any, ...], str] = {}
    for source in sources:
        for entry in source.result["runs"]:
            run = _series(source, entry)
            begun, bed = _bed_of(source.settings, int(entry["seed"]))
            speed = float(entry["speed"])
            grains.setdefault(bed, set()).add(begun)
            free = () if run.kind == "driven" else (source.settings.weight, source.settings.mass)
            key = (begun, run.kind, speed, *free)
            if key in seen and run.kind == "set_down":
                continue  # every run of penetrate has one: the same again
            if key in seen:
                raise ValueError(say("twice", name=source.name, other=seen[key], kind=key[1], speed=speed))
            seen[key] = source.name
            if run.kind == "set_down":
                if (depth := run.resting_depth) is not None and depth > 0:
                    placements.append(Placement(bed, source.settings.weight, depth))
                elif depth is not None:
                    above.append(bed)
                continue
            loaded.append((run, {"id": f"{source.name}/{entry['id']}", "bed": bed, "speed": speed}))
    more = [
        one for source in sources for one in read_further(source.folder, _bed_of(source.settings, _seed(source))[1])
    ]
    placements += [one for one in more if isinstance(one, Placement)]
    deepest = max((reached(run) for run, _ in loaded), default=0.0)
    made = [(about["id"], binned(run, **about, bins=settings.bins, deepest=deepest)) for run, about in loaded]
    notes = list(_notes(sources))
    if left := [name for name, run in made if run is None]:
        notes.append(say("not_fitted", runs=", ".join(left)))
    if above:
        notes.append(say("above", beds=", ".join(above), count=len(above), of=len(above) + len(placements)))
    if shared := [bed for bed, of_bed in grains.items() if len(of_bed) > 1]:
        notes.append(say("one_seed", beds=", ".join(shared)))
    data = Data(
        _foundation(sources), tuple(run for _, run in made if run is not None), tuple(placements),
        tuple(source.name for source in sources), unloadings=tuple(one for one in more if isinstance(one, Unloading)),
        drags=tuple(one for one in more if isinstance(one, Drag)), notes=tuple(notes),
    )  # fmt: skip
    _refuse_few(data)
    return data


def _folders(given: str) -> Iterator[tuple[str, Path]]:
    """The run folders that a setting names: the folder itself, or those within it, in the order of their names."""
    path = Path(given)
    if not path.is_dir():
        near = alike(path, folders=True)
        raise ValueError(f"runs = {given!r} is no folder: the folder of a run of penetrate was expected{near}")
    if (path / "run.toml").is_file():
        yield path.name or given, path
        return
    inside = [below for below in sorted(path.iterdir()) if (below / "run.toml").is_file()]
    done = [below for below in inside if RunFolder.open(below).status == "done"]
    if not done:
        raise ValueError(f"runs = {given!r} holds no finished run: the folder of a run of penetrate was expected")
    for below in done:
        yield below.name, below


def _read(name: str, path: Path) -> _Source:
    folder = RunFolder.open(path)
    if folder.command != "penetrate":
        raise ValueError(f"runs = {str(path)!r} is a run of {folder.command!r}: one of 'penetrate' was expected")
    if not (path / "result.json").exists() or folder.status not in ("done", None):
        raise ValueError(
            f"runs = {str(path)!r} is not finished ({folder.status or 'no result.json'}): wait for it if it is being "
            f"computed; `hedgebed resume {path}` finishes it if not"
        )
    if not (path / "series").is_dir():
        raise ValueError(f"runs = {str(path)!r} has no series, only numbers: {_again(path)}")
    settings = PenetrateSettings(**folder.settings)
    if (kept := path / MATERIAL_COPY).is_file():
        settings = settings.model_copy(update={"material": str(kept)})
    if not settings.on_grains:
        raise ValueError(f"runs = {str(path)!r} is a run on ground = {settings.ground!r}: one in a bed was expected")
    return _Source(name, folder, settings, folder.read_result())


def _again(path: Path) -> str:
    return f"`hedgebed penetrate {path / 'run.toml'}` computes it again"


def _series(source: _Source, entry: Json) -> Penetration:
    """The run of one entry of result.json. Raises ValueError, naming the file, for one that cannot be read."""
    path = source.folder.path / str(entry["series"])
    facts = {"kind": str(entry["kind"]), "ended": str(entry["ended"]), "macro_step": 0.0}
    try:
        run = Penetration.from_columns(source.folder.read_series(path.stem), facts)
    except (OSError, KeyError, ValueError) as error:
        raise ValueError(f"{path} cannot be read ({error}): {_again(source.folder.path)}") from None
    if not len(run.time):
        raise ValueError(f"{path} holds no row: {_again(source.folder.path)}")
    return run


def _bed_of(settings: PenetrateSettings, seed: int) -> tuple[str, str]:
    """The same text for runs that begin in the same bed, and the bed to which a fit assigns them.

    A fit treats all beds of one seed as one bed, whatever their size or the stiffness of their grains: they begin with
    the same random numbers, so their factors need not be independent.
    """
    values = [seed if name == "seed" else getattr(settings, name) for name in _OF_BED]
    bed = f"seed {seed}" + ("" if settings.bed is None else f" of {settings.bed}")
    return " ".join(str(value) for value in values), bed


def _seed(source: _Source) -> int:
    """Of the first bed; further runs are made only where there is one."""
    return int(source.settings.seeds[0])


def _shared(settings: PenetrateSettings, name: str) -> Any:
    value = getattr(settings, name)
    return material(value) if name == "material" else value


def _refuse_mixed(sources: Sequence[_Source]) -> None:
    first = sources[0]
    for source in sources[1:]:
        for name, what in _SHARED.items():
            one, other = _shared(first.settings, name), _shared(source.settings, name)
            if one != other:
                values = {"one": one, "first": first.name, "other": other, "name": source.name}
                if name == "material":
                    values |= {"one": one.name, "other": other.name}
                raise ValueError(say("mixed", what=what, key=name, **values))


def _refuse_few(data: Data) -> None:
    if not data.runs:
        raise ValueError(say("nothing", count=len(data.sources)))
    if len(data.beds) < 2:
        raise ValueError(say("one_bed"))
    if len(data.speeds) < 2:
        (speed,) = data.speeds
        raise ValueError(say("one_speed", speed=speed, more=4 * speed))


def _foundation(sources: Sequence[_Source]) -> Foundation:
    first = sources[0].settings
    stuff = material(first.material)
    packings = [float(source.result["quantities"]["packing_fraction"]["value"]) for source in sources]
    return Foundation(
        material=stuff.name, tip=first.tip, diameter=first.tip_diameter, tip_height=first.tip_height,
        cone_angle=first.cone_angle, gravity=first.gravity, grain=first.grain,
        bulk_density=stuff.density * sum(packings) / len(packings), surface_friction=first.spike_friction,
    )  # fmt: skip


def _notes(sources: Sequence[_Source]) -> Iterator[str]:
    for name, what in _MAY_DIFFER.items():
        values = {str(getattr(source.settings, name)) for source in sources}
        if len(values) > 1:
            yield say("differs", what=what, values=", ".join(sorted(values)))
    codes = {source.result.get("code") for source in sources}
    if len(codes) > 1:
        yield say("codes", count=len(codes))
