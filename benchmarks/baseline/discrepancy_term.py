"""The term through which a learnt force acts in the accurate integrator: an effect of one's own (`rigid.terms`)."""

from collections.abc import Callable
from typing import Any

from rigid.terms import Term

__all__ = ["TERM", "acting"]

acting: list[Callable[[Any], tuple[float, float, float]]] = []
"""The force (x [N], y [N], theta [N m]) as a function of the state `s`: the last one acts."""


def _force(s: Any) -> tuple[float, float, float]:
    return acting[-1](s) if acting else (0.0, 0.0, 0.0)


TERM = Term(
    id="learnt-discrepancy", summary="what a baseline learnt", acts="a force and a torque at the centre",
    source="hedgebed bench diagnose", limits="within the states that it was learnt from", hooks={"force": _force},
)  # fmt: skip
