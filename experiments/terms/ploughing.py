"""Sand in front of a spike that is drawn through it sideways resists by more than friction; a term of one's own.

A short pile bears 1.5 K_p rho g d h^2 sideways (Broms 1964, J. Soil Mech. Found. Div. 90(SM3):123): K_p = 2.46 of 25
degrees of friction, 1540 kg/m3 of packed sand, d = 12 mm give 670 N/m2, twice for the two spikes of a row.
"""

from math import tanh

from rigid.terms import Parameter, Term


def ploughed(s, depth, slip, strength, speed):
    """-k h^2 tanh(u / w)."""
    h = max(depth, 0.0)
    return -strength * h * h * tanh(slip / speed)


TERM = Term(
    id="ploughing",
    summary="sand ahead of a spike resists, by its depth squared",
    acts="tangential force",
    source="Broms (1964): the sideways strength of a short pile in sand",
    limits="no heap ahead, no furrow of rows before; what is to be overcome before it moves comes with the speed w",
    hooks={"side_force": ploughed},
    parameters=(
        Parameter("strength", "N/m2", 0.0, "k, of a row", lowest=0.0),
        Parameter("speed", "m/s", 0.01, "w: slower than this it resists less", lowest=1e-3),
    ),
)  # fmt: skip
FIT = {"strength": {"typical": 1300.0}, "speed": {"typical": 0.01}}
"""How `hedgebed diagnose --effects-from` fits it."""
