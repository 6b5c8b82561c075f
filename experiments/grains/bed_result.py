"""Common parts of the results of a platform on a bed of grains: numbers of the bed, its series, and warnings."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from coupling import MOST_REVERSAL, CoupledTumble, Master, SpatialRun
from coupling.robot import RobotRun
from dem import Bed
from dem.grains.materials import caveat
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import write_series
from experiments.runs.types import Json

from . import say
from .settings import GrainsSettings
from .softening import Softening, stable_overlap

__all__ = [
    "bed_numbers", "bed_warnings", "overlap_warning", "residual_warning", "reversal_warning", "sides_warning",
    "sleep_words", "unsettled_warning", "write_bed_series",
]  # fmt: skip

AnyRun = CoupledTumble | SpatialRun | RobotRun
PACKING_OFF = 0.02  # Difference of the packing from that of the grains' calibration that is worth a warning [1]
SIDES_MOVED = 0.5  # Way of the grains at the sides of a bed, over their diameter, that is worth a warning [1]
MOST_RESIDUAL = 0.01  # A larger energy_residual is worth a warning [1]
BED_COLUMNS = {
    "time": "t_s", "momentum_error": "momentum_error_N_s", "angular_momentum_error": "angular_momentum_error_N_m_s",
    "grain_steps": "grain_steps",
}  # fmt: skip
"""Sample of a run -> column of series/bed.csv, where it is no energy."""


def write_bed_series(folder: Path, run: AnyRun) -> None:
    """series/bed.csv: energies of the bed, losses of its grains, error of the momentum, grain-steps."""
    samples = run.samples | {f"{name}_lost": values for name, values in run.losses.items()}
    columns = {BED_COLUMNS.get(name, f"{name}_J"): values for name, values in samples.items()}
    write_series(folder / "series" / "bed.csv", columns)


LITTLE = 0.9  # Share of the grain-steps from which on sleep is said to save next to nothing [1]


def bed_numbers(
    settings: GrainsSettings,
    run: AnyRun,
    bed: Bed,
    softening: Softening,
    *,
    in_rig: bool,
) -> Json:
    """The entry ``grains`` of result.json for any bed under a platform, and the number of grain-steps computed."""
    done = run.samples["grain_steps"]
    steps = (run.master.count - run.placing_steps) * settings.substeps
    return {
        "mode": "rig: grains at 1 g" if in_rig else "flight: grains at the platform's gravity",
        "grain_count": int(bed.grain_count), "packing_fraction": float(bed.packing_fraction),
        "surface": float(bed.surface), "young": softening.young, "softer_than_real": softening.factor,
        "time_step": float(bed.time_step), "max_overlap": float(bed.max_overlap), "seed": settings.seed,
        "sleep": settings.sleep, "grain_steps": float(done[-1] - done[0]),
        "grain_steps_all_awake": float(steps * int(bed.grain_count)),
    }  # fmt: skip


def sleep_words(settings: GrainsSettings, run: AnyRun, bed: Bed) -> list[str]:
    """How much of the work sleep left out, and who sleeps at the end, in a sentence; none of a bed that does not sleep.

    A second one where it left out next to nothing.
    """
    sleeper = bed.sleeper if settings.sleep else None
    if sleeper is None:
        return []
    done, steps = run.samples["grain_steps"], (run.master.count - run.placing_steps) * settings.substeps
    share = float(done[-1] - done[0]) / max(1.0, float(steps * bed.grain_count))
    asleep, slow = bed.grain_count - sleeper.awake, sleeper.awake - sleeper.fast
    told = [say("slept", share=share, asleep=asleep, slow=slow, count=bed.grain_count)]
    return told if share < LITTLE else [*told, say("slept_little")]


def bed_warnings(bed: Bed, surface: str, *, across: float, foot: str = "spike") -> Iterator[str]:
    """Warnings of feet too few grains across, of a packing unlike that of the calibration, and of doubtful grains.

    `across`: a foot's diameter over the grains' [1]; `foot`: what a foot is called.
    """
    if across < 10:
        yield say("few_grains_across", across=across, foot=foot)
    own = find_surface(surface)
    if own.packing is not None and abs(bed.packing_fraction - own.packing) > PACKING_OFF:
        yield say("packing_off", packing=bed.packing_fraction, surface=own)
    if doubt := caveat(bed.material):
        yield doubt


def sides_warning(bed: Bed) -> str | None:
    """Warning of a bed so narrow that the push moved the grains at its periodic sides: the copies of the foot beyond
    them push the same grains.

    Of the grains whose centre began less than a diameter from a side, in the upper half of the bed, the median way.
    """
    grains = bed.grains(contacts=False)
    diameter = 2 * float(grains.radius.mean())
    start = grains.position - grains.displacement
    across = start[:, :2] % np.array(bed.size[:2])
    side = np.minimum(across, np.array(bed.size[:2]) - across).min(axis=1) < diameter
    side &= start[:, 2] > 0.5 * float(bed.surface)
    if not side.any():
        return None
    way = float(np.median(np.linalg.norm(grains.displacement[side], axis=1))) / diameter
    wider = " by ".join(f"{1.5 * side:.3g}" for side in bed.size[:2])
    return say("sides_moved", way=way, wider=wider) if way > SIDES_MOVED else None


def overlap_warning(bed: Bed, softening: Softening, max_overlap: float) -> str | None:
    """Warning of overlaps above the intended bound."""
    return softening.overlapping(float(bed.max_overlap), max_overlap, stable_overlap(bed.material, max_overlap))


def residual_warning(residual: float) -> str | None:
    """Warning of an energy balance that is not closed, if `energy_residual` is too large."""
    above = {"value": _above(residual, MOST_RESIDUAL), "limit": MOST_RESIDUAL}
    return say("residual", **above) if residual > MOST_RESIDUAL else None


def reversal_warning(made: float) -> str | None:
    """Warning of energy created by the bed, if `dissipation_reversal` is too large."""
    return say("reversal", value=_above(made, MOST_REVERSAL), limit=MOST_REVERSAL) if made > MOST_REVERSAL else None


def unsettled_warning(master: Master) -> str | None:
    """Warning of exchange steps that did not converge within the allowed iterations, if there are any."""
    return say("unsettled", many=master.exchange.unsettled, master=master) if master.exchange.unsettled else None


def _above(value: float, limit: float) -> str:
    """A value with enough digits, at least two, to show that it is above the limit."""
    texts = (f"{value:.{digits}g}" for digits in range(2, 18))
    return next((text for text in texts if float(text) > limit), f"{value:g}")
