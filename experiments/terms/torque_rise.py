"""A motor whose torque comes up with a time constant; a term of one's own, as `model.toml` names one by its file.

The paper's torques are steps. A real drive's are not, and on springs that decides whether a platform slips at once:
while the torque rises the load moves over to the front spikes.
"""

from math import exp

from rigid.terms import Parameter, Term


def factor(s, rise):
    """1 - exp(-t / rise)."""
    return 1.0 - exp(-s.time / rise)


TERM = Term(
    id="torque-rise",
    summary="the torque comes up with a time constant",
    acts="force",
    source="a drive of first order",
    limits="from t = 0 only, not at each touch-down",
    hooks={"torque_factor": factor},
    parameters=(Parameter("rise", "s", 0.1, "its time constant", lowest=0.0, above_lowest=True),),
)
FIT = {"rise": {"typical": 0.05, "off": 1e-4}}
"""How `hedgebed diagnose --effects-from` fits it: a size that can be seen, and one that changes nothing."""
