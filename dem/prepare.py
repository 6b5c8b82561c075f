"""Prepares a bed as in a laboratory: rain the grains in, let them settle, level the surface, settle again.

Prepared beds are kept in a cache, keyed by everything that shaped them, so nobody waits for the same rain twice.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from . import runtime
from .bed import Bed, BedFailure
from .materials import Material
from .materials import material as find_material
from .packing import RAIN_COLUMN, draw_radii, rain_positions
from .timestep import choose_young

__all__ = ["cache_folder", "fingerprint", "prepare_bed"]

_EXPECTED_PACKING = 0.57
# Penetration resistance of sand grows with depth about sixty times as fast as its overburden (3D-RFT, Agarwal et al.
# 2023: 0.9 MN/m3 at mu = 0.5 against 16 kN/m3); a bed is made for a tip that may go half its depth.
_BEARING = 30.0
# More is rained in than is kept: this much higher, and at least this many diameters.
_SURPLUS, _SURPLUS_DIAMETERS = 0.06, 2.0
# Settled: mean kinetic energy of a grain over m g d, and floor force over weight.
ENERGY_RATIO, FLOOR_RATIO = 1e-5, 0.01
_ROUGH_ENERGY_RATIO = 1e-2
# Time constant of the drag while settling, in the time that a grain takes to fall the bed's depth.
_DRAG = 0.1
_LONGEST = 60.0  # settling gives up after this many fall times
_MOST_TAPS = 40


def cache_folder() -> Path:
    """Where prepared beds are kept: ``HEDGEBED_CACHE``, or ~/.cache/hedgebed."""
    given = os.environ.get("HEDGEBED_CACHE")
    return Path(given).expanduser() if given else Path.home() / ".cache" / "hedgebed"


@functools.cache
def fingerprint() -> str:
    """A short digest of the code that computes beds and of Taichi's version: other code may give other bits."""
    import taichi

    digest = hashlib.sha256(repr(taichi.__version__).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def prepare_bed(
    material: str | Material,
    *,
    size: Sequence[float],
    grain: float,
    spread: float = 0.15,
    packing: float | None = None,
    gravity: float = 9.81,
    seed: int = 1,
    young: float | None = None,
    max_overlap: float = 0.05,
    time_step: float | None = None,
    precision: str = "float64",
    arch: str = "cpu",
    threads: int | None = None,
    cache: bool = True,
    progress: Any = None,
) -> Bed:
    """A bed rained in, levelled and settled under gravity, or the same one from the cache.

    Args:
        material: a name or a Material.
        size: lateral periods (x, y) and depth after levelling (z) [m].
        grain: mean diameter [m].
        spread: diameters are uniform within +- this share of the mean [1].
        packing: bulk packing fraction [1]; the bed is tapped until it is reached. As rained when None.
        gravity: of the grains, downwards [m/s2].
        seed: of sizes and positions.
        young: Young's modulus of the softened grains [Pa]; chosen from ``max_overlap`` when None
            (``dem.timestep.choose_young``).
        max_overlap: bound on overlap over diameter; also ends a later run that goes past it.
        time_step: [s]; an eighth of the contact time when None.
        precision: "float64" or "float32". arch: "cpu" or "cuda". threads: all when None.
        cache: whether to look in the cache, and to leave the bed there.
        progress: anything with ``stage(name, total)`` and ``update(done)``, or None.

    The grains fall as a loose column from rest, come to rest in a drag that stands in for the long ringing of a soft
    bed, lose what lies above the level, and settle again, at the end without drag. Settled means: mean kinetic energy
    of a grain below 1e-5 m g d, and floor force within 1 % of the weight.

    Raises:
        ValueError: an unknown material, a size or grain that is not positive, grains too large for the bed, a spread
            outside 0 to 0.5, a packing that cannot be reached, a time step too long.
        BedFailure: the bed did not come to rest.
    """
    stuff = find_material(material)
    _check(size, grain, spread, packing, gravity, seed, max_overlap)
    size = tuple(float(s) for s in size)
    if young is None:
        bulk = _EXPECTED_PACKING * stuff.density
        young = choose_young(
            stuff,
            pressure=(1 + _BEARING) * bulk * gravity * size[2],
            speed=math.sqrt(2 * gravity * RAIN_COLUMN * size[2]),
            max_overlap=max_overlap,
        )
    recipe = {
        "code": fingerprint(),
        "material": {f.name: getattr(stuff, f.name) for f in fields(stuff) if f.name != "sources"},
        "size": size,
        "grain": float(grain),
        "spread": float(spread),
        "packing": packing,
        "gravity": float(gravity),
        "seed": int(seed),
        "young": float(young),
        "max_overlap": float(max_overlap),
        "time_step": time_step,
        "precision": precision,
        "arch": arch,
    }
    runtime.start(arch=arch, threads=threads, precision=precision)
    key = hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:24]
    path = cache_folder() / "beds" / f"{stuff.name}-{key}.npz"
    if cache and path.exists():
        try:
            bed = Bed.load(path, arch=arch, threads=threads)
        except ValueError as problem:
            warnings.warn(f"the cached bed {path.name} cannot be read and is made anew: {problem}", stacklevel=2)
        else:
            bed.material = stuff.softened(young)
            return bed
    report = _Reporter(progress)
    bed = _rain(stuff, size, grain, spread, gravity, seed, young, max_overlap, time_step, precision, arch, threads)
    try:
        report.stage("rain", None)
        _fall(bed, grain, report)
        _settle(bed, grain, _ROUGH_ENERGY_RATIO, report, drag=True)
        bed = _level(bed, size[2])
        report.stage("settle", None)
        _settle(bed, grain, ENERGY_RATIO, report, drag=True)
        bed.measure_surface()
        if packing is not None:
            bed = _tap(bed, grain, packing, report)
    except BedFailure as failure:
        kept = bed.save(cache_folder() / "failed" / path.name)
        raise BedFailure(f"{failure.reason}; the bed as it was is in {kept}") from None
    bed = _reset(bed)
    if cache:
        try:
            bed.save(path)
            (path.with_suffix(".json")).write_text(json.dumps(recipe, indent=1))
        except OSError as problem:
            warnings.warn(f"the bed could not be kept in the cache: {problem}", stacklevel=2)
    return bed


def _check(size, grain, spread, packing, gravity, seed, max_overlap) -> None:
    if not 0 < max_overlap <= 0.2:
        raise ValueError(f"max_overlap = {max_overlap} must be above 0 and at most 0.2 of a diameter")
    if int(seed) != seed or seed < 0:
        raise ValueError(f"seed = {seed} must be a whole number, 0 or more")
    if len(size) != 3 or not all(math.isfinite(s) and s > 0 for s in size):
        raise ValueError(f"size = {tuple(size)} must be three positive lengths [m]")
    if not (math.isfinite(grain) and grain > 0):
        raise ValueError(f"grain = {grain} must be a positive diameter [m]")
    if not 0 <= spread <= 0.5:
        raise ValueError(f"spread = {spread} must be between 0 and 0.5 of the mean diameter")
    if packing is not None and not 0.5 < packing <= 0.64:
        raise ValueError(
            f"packing = {packing} is no packing fraction of spheres at rest; leave it out or ask for 0.55 to 0.64"
        )
    if not (math.isfinite(gravity) and gravity > 0):
        raise ValueError(f"gravity = {gravity} must be positive [m/s2]; nothing settles without it")
    for name, length, least in (("x", size[0], 6), ("y", size[1], 6), ("z", size[2], 4)):
        if length < least * grain:
            raise ValueError(
                f"size: {name} = {length} m is less than {least} grains of {grain} m; {least * grain:.4g} m would do"
            )


def _rain(stuff, size, grain, spread, gravity, seed, young, max_overlap, time_step, precision, arch, threads) -> Bed:
    """The grains in the air, at rest, in a loose column."""
    rng = np.random.default_rng(seed)
    fill = max(size[2] * (1 + _SURPLUS), size[2] + _SURPLUS_DIAMETERS * grain)
    volume = 0.60 * fill * size[0] * size[1]
    radii = draw_radii(rng, volume, grain, spread)
    positions = rain_positions(rng, radii, size[:2])
    top = float((positions[:, 2] + radii).max())
    return Bed.from_grains(
        stuff,
        positions=positions,
        radii=radii,
        size=size,
        height=top + 10 * grain,
        gravity=gravity,
        young=young,
        max_overlap=max_overlap,
        time_step=time_step,
        seed=seed,
        precision=precision,
        arch=arch,
        threads=threads,
    )


def _settle(bed: Bed, grain: float, ratio: float, report: _Reporter, *, drag: bool = False) -> None:
    """Advance until the bed is at rest by ``ratio`` and the floor carries the weight.

    Soft grains in a deep bed ring as one spring for long. With ``drag`` the grains settle as in a fluid until they are
    at rest; then, without it, they must still be.
    """
    g = math.hypot(*bed.gravity)
    unit = bed.weight / bed.grain_count * grain
    fall = math.sqrt(2 * bed.size[2] / g)
    steps = max(1, round(0.05 * fall / bed.time_step))
    tolerance = FLOOR_RATIO if ratio == ENERGY_RATIO else 0.5
    began = bed.time
    first = None
    while True:
        bed.advance(steps, drag_time=_DRAG * fall if drag else math.inf)
        energy = bed.kinetic_energy / bed.grain_count / unit
        floor = abs(bed.floor_force / bed.weight - 1)
        first = first or math.log(max(energy / ratio, math.e))
        report.update(1 - min(1.0, max(0.0, math.log(max(energy / ratio, 1.0)) / first)))
        if energy < ratio and floor < tolerance:
            if not drag:
                return
            drag = False
        if bed.time - began > _LONGEST * fall:
            raise BedFailure(
                f"the bed did not come to rest in {bed.time - began:.3g} s: energy {energy:.2g} m g d (below {ratio:g} "
                f"was wanted), floor force off by {100 * floor:.2g} % of the weight"
            )


def _fall(bed: Bed, grain: float, report: _Reporter) -> None:
    """Advance until the rain is down: the grains' energy has passed its peak and is a tenth of m g d a grain."""
    g = math.hypot(*bed.gravity)
    unit = bed.weight / bed.grain_count * grain
    top = bed.grains()["position"][:, 2].max()
    fall = math.sqrt(2 * top / g)
    steps = max(1, round(0.03 * fall / bed.time_step))
    peak = 0.0
    while True:
        bed.advance(steps)
        energy = bed.kinetic_energy / bed.grain_count / unit
        peak = max(peak, energy)
        report.update(min(1.0, bed.time / fall))
        if energy < 0.1 and energy < 0.5 * peak:
            return
        if bed.time > _LONGEST * fall:
            raise BedFailure(f"the rain was not down after {bed.time:.3g} s: energy {energy:.2g} m g d a grain")


def _level(bed: Bed, depth: float) -> Bed:
    """Take away the grains whose centres lie above the level."""
    grains = bed.grains()
    above = grains["position"][:, 2] > depth
    if not above.any():
        return bed
    return bed.without(above)


def _tap(bed: Bed, grain: float, packing: float, report: _Reporter) -> Bed:
    """Tap the bed until its packing fraction is reached; its surface sinks as it gets denser and stays nearly level.

    A tap is half a sine of acceleration of the bed's frame, 3 g high, as long as a grain takes to fall its diameter.
    """
    if bed.packing_fraction > packing + 0.002:
        raise ValueError(
            f"packing = {packing} cannot be reached: this material rains in at {bed.packing_fraction:.4f} already, and "
            f"tapping only makes it denser; ask for more, or give the grains more friction"
        )
    g = -bed.gravity[2]
    length = math.sqrt(2 * grain / g)
    report.stage("tap", None)
    start = bed.packing_fraction
    for _ in range(_MOST_TAPS):
        if bed.packing_fraction >= packing - 0.0005:
            return bed
        pieces = 10
        for k in range(pieces):
            bed.set_gravity((0.0, 0.0, -g * (1 - 3 * math.sin(math.pi * (k + 0.5) / pieces))))
            bed.advance(max(1, round(length / pieces / bed.time_step)))
        bed.set_gravity(g)
        _settle(bed, grain, ENERGY_RATIO, report, drag=True)
        bed.measure_surface()
        report.update((bed.packing_fraction - start) / max(1e-9, packing - start))
    raise ValueError(
        f"packing = {packing} cannot be reached: {_MOST_TAPS} taps brought the bed from {start:.4f} to "
        f"{bed.packing_fraction:.4f}"
    )


def _reset(bed: Bed) -> Bed:
    """The prepared bed at time 0, with displacements counted from here."""
    bed.mark_origin()
    bed.max_overlap = 0.0
    bed.steps = 0
    return bed


class _Reporter:
    """Passes stages on to whatever progress the caller has."""

    def __init__(self, progress: Any):
        self._progress = progress

    def stage(self, name: str, total: float | None) -> None:
        if self._progress is not None:
            self._progress.stage(name, 1.0 if total is None else total)

    def update(self, done: float) -> None:
        if self._progress is not None:
            self._progress.update(done)
