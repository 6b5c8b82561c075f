"""The torque takes time to come up, as a drive's does.

The paper's torques are steps. On springs that decides whether a platform slips at once: while the torque rises the load
moves over to the leading row, which can hold a pivot then. `hedgebed paper` weighs it against its rivals.
"""

from math import exp

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.curves import raised
from rigid.terms.term import Parameter, Term


def torque_rise_factor(s, rise, rise_power):
    """1 - exp(-(t / rise)^p); 1 from the start where `rise` is 0."""
    factor = 1.0 + 0.0 * s.time
    if rise > 0.0:
        factor = 1.0 - exp(-raised(s.time / rise, rise_power))
    return factor


TERM = Term(
    rank=80, id="torque-rise", summary="the torque takes time to come up", acts="virtual work: the flywheel's torque",
    parameters=(
        Parameter("rise", "s", 0.0, "time constant, after which 63 % of the torque are there; 0: it is there at once",
                  lowest=0.0, visible=(0.02, 0.3)),
        Parameter("rise_power", "1", 1.0, "p of (t / rise)^p: 1 a drive of first order, above it begins more gently",
                  lowest=0.3, highest=5.0, visible=(0.8, 2.0)),
    ),
    source="a drive of first order; with 0.2 to 0.3 s the model does on hard ground what the paper states "
           "(docs/tumble.md)",
    limits="from t = 0 on, not anew at each touch-down; the wheel's own torque rises likewise",
    hooks={"torque_factor": torque_rise_factor},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the torque takes time to come up after it is switched on",
    confirm="run the wheel on the bench and read its speed over the first half second: its slope is the torque",
    tumble=Tumble(
        rank=51,
        forms=lambda t: (Form("first order", (free("rise", "s", 0.01, 0.0, 2.0),), ((0.02,), (0.2,))),),
        bends=(bent("of any shape", "first order", shape("rise_power", 1.0, 0.4, -0.65, 2.0)),),
        equation="the torque times 1 - exp(-(t / rise)^rise_power); rise_power is 1 where it is not named",
        bench="run the wheel on the bench and read its speed from the switch on: its slope is the torque",
    ),
)  # fmt: skip
