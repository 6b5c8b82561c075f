"""The depth at which a body stands under a load, by 3D-RFT: the inverse of the force at a depth, with its errors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy import optimize

from rigid.ground.rft_table import MOST, Pieces, RftTable, jackknife_std, law_force
from rigid.intervals import NORMAL

__all__ = ["Standing", "standing_depth"]

_DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Standing:
    """Depths of the origin of a body [m]."""

    depth: float  # Where the law carries the load
    std: float | None  # Standard error over beds; None where the table has one bed only
    low: float  # End of the 95 % interval where the ground is stronger
    high: float | None  # The other end; None where the error of the law reaches the whole force
    law_error: float  # rms of the law's error over the force [1]


def standing_depth(table: RftTable, pieces: Pieces, *, load: float, gravity: float | None = None) -> Standing:
    """The depth at which the upward force of the law is `load` [N]; the body moves straight down.

    The 95 % interval has two parts, added as variances of the force: the scatter of the factors between beds
    (jackknife) and the law's own error, the larger of `unseen` and the rms of `shape_errors`. `gravity` [m/s2]: that of
    the table if not given. Raises ValueError for a load that is not positive, and for one that needs more than `MOST`
    times the depth of the plates.
    """
    if not 0 < load < math.inf:
        raise ValueError(f"load = {load:g} N must be positive and finite")
    scale = 1.0 if gravity is None else gravity / table.gravity
    bottom = float(pieces.points[:, 2].min())
    most = MOST * table.depth[1]

    def force(factors: Sequence[float], depth: float) -> float:
        return scale * float(law_force(factors, table.surface_friction, pieces, depth, _DOWN)[2])

    def depth_of(carried: float, factors: Sequence[float]) -> float | None:
        if force(factors, bottom + most) < carried:
            return None
        return float(optimize.brentq(lambda z: force(factors, z) - carried, bottom, bottom + most, xtol=1e-9))

    depth = depth_of(load, table.factors)
    if depth is None:
        strongest = force(table.factors, bottom + most)
        raise ValueError(
            f"load = {load:g} N: at most {strongest:.3g} N was expected, what the law carries at its largest depth of "
            f"{most:.3g} m; hedgebed penetrate finds whether it rests deeper, or not at all"
        )
    loads = [force(factors, depth) for factors in table.left_out]
    spread = float(jackknife_std([[value] for value in loads])[0]) if len(loads) > 1 else None
    law = max(table.unseen, table.shape_errors[0] if table.shape_errors is not None else 0.0)
    share = NORMAL * math.hypot(law, (spread or 0.0) / load)
    depths = [depth_of(load, factors) for factors in table.left_out]
    known = [[d] for d in depths if d is not None]
    std = float(jackknife_std(known)[0]) if len(known) == len(depths) > 1 else None
    # The true force may be (1 +- share) times that of the law.
    low = depth_of(load / (1 + share), table.factors)
    high = depth_of(load / (1 - share), table.factors) if share < 1 else None
    return Standing(depth, std, depth if low is None else low, high, law)
