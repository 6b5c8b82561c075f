"""The pulleys turn with the wires."""

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.term import Parameter, Term


def pulley_mass(s, mass):
    """T = m_p (vertical speed)^2 / 2, m_p = sum of I / r^2 over the pulleys."""
    return mass * s.up_x * s.up_x, mass * s.up_x * s.up_y, mass * s.up_y * s.up_y, 0.0, 0.0, 0.0


TERM = Term(
    rank=40, id="pulley-inertia", summary="the pulleys turn with the wires", acts="T", needs_rig=True,
    parameters=(Parameter("mass", "kg", 0.0, "I / r^2 summed over the pulleys, added in y", lowest=0.0,
                          visible=(0.05, 0.6)),),
    source="Atwood's machine with a heavy pulley (any mechanics textbook)", limits="the wires do not slip",
    hooks={"mass": pulley_mass},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the rig's pulleys have to be turned, which acts as mass in y",
    confirm="let the balanced rig run under a small known weight: its acceleration gives the mass",
    tumble=Tumble(
        rank=170,
        forms=lambda t: (Form("added mass", (free("mass", "kg", 0.05, 0.0, 20.0),), ((0.1,), (1.0,))),),
        equation="mass * (vertical speed)^2 / 2 in T",
        bench="let the balanced rig fall under a small known weight and compare two weights",
    ),
)  # fmt: skip
