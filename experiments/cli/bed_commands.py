"""`hedgebed bed list`, `bed show`, `bed share`: the beds there are, what one of them is, and one as a file to send.

`hedgebed bed foot`: the force on a shape, or its depth under a load, by the table that `bed test plates` measured.
"""

import json as json_module
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CoercionError, Parameter
from rich.console import Console
from rich.table import Table

from experiments.runs.streams import refusing, say
from experiments.runs.units import Unit, has_unit

if TYPE_CHECKING:
    from experiments.bed.standing import Standing

__all__ = ["add_bed_commands"]

_Json = Annotated[bool, Parameter(help="Print it as JSON on stdout and nothing else.", negative="")]


def _in_si(kind: str) -> Parameter:
    """Option of a number in SI units, or with a unit of this kind behind it."""

    def convert(_: Any, tokens: tuple[Any, ...]) -> float:
        word = tokens[0].value
        try:
            return Unit(kind, 1.0).value_of(word) if has_unit(word) else float(word)
        except ValueError as error:
            raise CoercionError(str(error), token=tokens[0], target_type=float) from None

    return Parameter(converter=convert, metavar="FLOAT")


_Length = Annotated[float, _in_si("length")]
_Gravity = Annotated[float, _in_si("acceleration")]
_Force = Annotated[float, _in_si("force")]
_Bed = Annotated[
    str, Parameter(help="A file, the folder of a run of bed make, or its name in the folder HEDGEBED_BEDS.")
]


def add_bed_commands(home: App) -> None:
    """Add the commands to ``hedgebed bed``."""
    home.command(_list, name="list")
    home.command(_show, name="show")
    home.command(_share, name="share")
    home.command(_foot, name="foot")


def _list(
    folder: Annotated[Path | None, Parameter(help="Folder of bed files; that of HEDGEBED_BEDS if not given.")] = None,
    /,
    *,
    json: _Json = False,
) -> int:
    """List the beds that you named: those in the folder HEDGEBED_BEDS, or in another one.

    Beds that other commands prepare are kept in a cache, without names.
    """
    from dem.prepare.bedfile import bed_shelf, list_beds
    from dem.prepare.code import cache_folder

    where = bed_shelf() if folder is None else folder
    with refusing():
        if folder is not None and not folder.is_dir():
            raise ValueError(f"folder = {str(folder)!r} is no folder: give one that holds .npz files of beds")
    beds = list_beds(where) if where.is_dir() else []
    if json:
        print(json_module.dumps(beds, indent=2))
        return 0
    headings = ("name", "material", "size [mm]", "grain [mm]", "grains", "packing", "g [m/s2]", "stages")
    table = Table(*headings, title=f"Beds in {where}", title_justify="left", box=None, pad_edge=False)
    for bed in beds:
        table.add_row(*(_cells(bed) if "problem" not in bed else (bed["name"], *[""] * 6, bed["problem"])))
    Console(file=sys.stdout, highlight=False).print(table, markup=False)
    if not beds:
        say("none here yet: `hedgebed bed make --name NAME` puts one into the folder HEDGEBED_BEDS")
    if folder is None and (count := len(list((cache_folder() / "beds").glob("*.npz")))):
        say(f"{count} more without a name, which commands prepared and use again: {cache_folder() / 'beds'}")
    return 0


def _cells(bed: dict[str, Any]) -> tuple[str, ...]:
    return (
        bed["name"],
        bed["material"],
        " x ".join(f"{1e3 * length:g}" for length in bed["size"]),
        f"{1e3 * bed['grain']:.3g}",
        str(bed["grain_count"]),
        f"{bed['packing_fraction']:.4f}",
        f"{bed['gravity']:.4g}",
        " ".join(bed["stages"]) or "not said",
    )


def _show(bed: _Bed, /, *, json: _Json = False) -> int:
    """Show what a bed is: what it was made from, and what each stage of its preparation left."""
    from dem.prepare.bedfile import find_bed, list_beds, read_preparation

    with refusing():
        path = find_bed(bed)
        about = read_preparation(path)
        entry = next(one for one in list_beds(path.parent) if one["file"] == str(path))
        if "problem" in entry:
            raise ValueError(entry["problem"])
    if json:
        entry |= {"recipe": about.recipe, "reports": [asdict(report) for report in about.reports]}
        print(json_module.dumps(entry, indent=2))
        return 0
    console = Console(file=sys.stdout, highlight=False)
    table = Table(title=str(path), title_justify="left", box=None, pad_edge=False, show_header=False)
    heads = ("name", "material", "size [mm]", "grain [mm]", "grains", "packing", "gravity [m/s2]", "stages")
    for head, cell in zip(heads, _cells(entry), strict=True):
        table.add_row(head, cell)
    for key in ("young", "seed", "max_overlap", "precision", "code"):
        if key in about.recipe:
            table.add_row(key, f"{about.recipe[key]}")
    console.print(table, markup=False)
    if about.reports:
        stages = Table("stage", "packing", "contacts", "K", "surface [mm]", "settled", box=None, pad_edge=False)
        for report in about.reports:
            ratio = "-" if report.pressure_ratio is None else f"{report.pressure_ratio:.2f}"
            packing, contacts = f"{report.packing_fraction:.4f}", f"{report.coordination_number:.2f}"
            stages.add_row(report.stage, packing, contacts, ratio, f"{1e3 * report.surface:.4g}", report.criterion)
        console.print(stages, markup=False)
    return 0


def _share(bed: _Bed, to: Annotated[Path, Parameter(help="The file to write; must be new.")], /) -> int:
    """Write a bed with its settings and preparation to one compressed file, for use on another machine."""
    from dem.prepare.bedfile import find_bed, share_bed

    with refusing():
        file = share_bed(find_bed(bed), to)
    print(f"bed: {file}")
    say(f"`hedgebed bed show {file}` says what it is, `dem.Bed.load({str(file)!r})` reads it")
    return 0


def _foot(
    table: Annotated[
        Path, Parameter(help="rft.json of a run of bed test plates; sand: the table that ships, of the material sand.")
    ],
    shape: Annotated[str, Parameter(help="ball, cone, cylinder, or a file of a closed surface (STL, OBJ).")],
    /,
    *,
    depth: Annotated[
        _Length | None, Parameter(help="Depth of the origin of the shape [m]; a built-in one stands on it.")
    ] = None,
    load: Annotated[
        _Force | None, Parameter(help="Instead of depth: the load, whose depth at rest is predicted [N].")
    ] = None,
    gamma: Annotated[float, Parameter(help="Direction of motion below the horizontal [degrees].")] = 90.0,
    size: Annotated[_Length, Parameter(help="Diameter of a ball, cone or cylinder [m].")] = 0.024,
    scale: Annotated[_Length, Parameter(help="Unit of the file [m].")] = 1.0,
    gravity: Annotated[_Gravity | None, Parameter(help="Gravity; that of the table if not given [m/s2].")] = None,
    json: _Json = False,
) -> int:
    """Predict the force of a bed on a shape of your own at a depth, or the depth at which it rests under a load.

    The law is that of pushed plates, at their speed.
    """
    import numpy as np

    from experiments.bed.plates import shaped
    from experiments.bed.plates_fit import direction_of
    from experiments.bed.standing import standing_depth
    from experiments.bed.test_settings import SHAPES
    from rigid.digests import check_as_written
    from rigid.ground.rft_table import find_rft, read_rft
    from rigid.intervals import student

    with refusing():
        file = find_rft(table)
        check_as_written(file)
        found = read_rft(file)
        if (depth is None) == (load is None):
            raise ValueError("give either --depth (the force is predicted) or --load (the depth is predicted)")
        if load is not None and gamma != 90:
            raise ValueError(f"gamma = {gamma:g} degrees with --load: a load rests straight down, 90 was expected")
        for name, value in (("depth", depth), ("size", size), ("scale", scale), ("gravity", gravity)):
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} must be positive and finite")
        if not -90 <= gamma <= 90:
            raise ValueError(f"gamma = {gamma:g} degrees: -90 (up) to 90 (down) is accepted")
        if shape not in SHAPES and not Path(shape).is_file():
            raise ValueError(f"shape = {shape!r} is no file, and no built-in shape: {', '.join(SHAPES)}")
        body, way = shaped(shape, size, scale), direction_of(gamma)
        stands = None if load is None else standing_depth(found, body.pieces, load=load, gravity=gravity)
        depth = stands.depth if stands is not None else depth
        assert depth is not None
        warnings = found.beyond(body.pieces, depth=depth, direction=way)
    if stands is not None:
        return _show_standing(stands, warnings, json=json)
    force, std = found.force(body.pieces, depth=depth, direction=way, gravity=gravity)
    size_of_law = found.unseen * float(np.linalg.norm(force))
    if json:
        numbers = {"force": force.tolist(), "std": [None if math.isnan(s) else s for s in std.tolist()]}
        errors = {"law_error": size_of_law, "shape_errors": found.shape_errors, "speed": found.speed}
        print(json_module.dumps(numbers | errors | {"unit": "N", "warnings": warnings}, indent=2))
        return 0
    half = std * student(len(found.left_out) - 1) if len(found.left_out) > 1 else std
    least = 1e-9 * float(np.linalg.norm(force))  # below it: round-off of forces that cancel
    for axis, value, spread in zip("xyz", force, half, strict=True):
        if abs(value) <= least and (math.isnan(spread) or spread <= least):
            print(f"force {axis} = 0 N")
            continue
        print(f"force {axis} = {value:.4g}" + ("" if math.isnan(spread) else f" ± {spread:.2g}") + " N")
    print(
        f"± is half of a 95 % interval over the beds; the law missed unseen plates by {100 * found.unseen:.0f} % (rms)"
    )
    if found.shape_errors is not None:
        rms, worst = (100 * error for error in found.shape_errors)
        print(f"it missed other shapes by {rms:.0f} % (rms), by {worst:.0f} % at worst")
    print(f"its plates moved at {found.speed:.3g} m/s; the law does not depend on the speed")
    for warning in warnings:
        say(f"warning: {warning}")
    return 0


def _show_standing(stands: "Standing", warnings: Sequence[str], *, json: bool) -> int:
    """Print the depth at rest with its 95 % interval, and what is not in it."""
    if json:
        print(json_module.dumps(asdict(stands) | {"unit": "m", "warnings": list(warnings)}, indent=2))
        return 0
    high = "no upper end is known" if stands.high is None else f"{1e3 * stands.high:.2g} mm"
    print(f"depth at rest = {1e3 * stands.depth:.3g} mm; 95 %: {1e3 * stands.low:.2g} to {high}")
    print(f"95 %: differences between beds, and the error of the law (rms {100 * stands.law_error:.0f} % of the force)")
    print("not included: the size of the grains and of the bed, and the uppermost grains on which a foot may stand")
    for warning in warnings:
        say(f"warning: {warning}")
    return 0
