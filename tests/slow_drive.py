"""A drive whose torque comes up along a straight line: an effect from a file, for the tests of such."""

from rigid.terms import Parameter, Term


def factor(s, rise):
    """t / rise, at most 1."""
    return min(1.0, s.time / rise)


TERM = Term(
    id="slow-drive",
    summary="the torque comes up along a straight line",
    acts="force",
    source="made up, for the tests",
    limits="from t = 0 only",
    hooks={"torque_factor": factor},
    parameters=(Parameter("rise", "s", 0.1, "when all of it is there", lowest=0.0, above_lowest=True),),
)
FIT = {"rise": {"typical": 0.05, "off": 1e-4}}
