"""The batched integrator, compiled by Taichi: one trial a lane, the same terms as the accurate integrator.

Method: velocity Verlet (kick, drift, kick) with the speed-dependent forces taken at the predicted end speeds, one
evaluation a step, order 2. A step is cut at the moment of an event (found to the second order): a spike touches,
leaves, slips through zero or reaches its static bound, or the wheel or the torque stops. Then the modes change, and the
rest of the step follows: so events cost no order. Sticking is the same constraint as in `rigid.planar.dynamics`, its
speed taken out exactly at the end of every step.

Only the lowest spike and its two neighbours are checked for contact. A trial that sinks so deep that a fourth could
touch is marked (`status`), and left to the accurate integrator.

Imports `rigid.model`, `rigid.terms`.
"""

from functools import lru_cache
from typing import Any

from rigid.terms import Term

from .advance import make_advance
from .parts import CHANNELS, FIXED_NUMBERS, SUMMARY, make_parts
from .stand import make_stand

__all__ = ["CHANNELS", "FIXED_NUMBERS", "SUMMARY", "batch_kernel"]


@lru_cache(maxsize=64)
def batch_kernel(terms: tuple[Term, ...], ground: str, count: int) -> Any:
    """The kernels for these effects on this ground, for platforms with `count` rows of spikes.

    `stand(numbers, poses)` finds y and theta at rest (theta NaN: cannot stand); `advance(numbers, poses, times,
    time_step, steps, end, launch, summary, series)` does the rest. See `rigid.batch.simulate`.
    """
    parts = make_parts(terms, ground, count)
    return make_stand(parts), make_advance(parts)
