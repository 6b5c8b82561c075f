"""The centre of mass is off the shaft."""

from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.term import Parameter, Term


def com_offset_mass(s, x, y):
    """T = m v . e', e the offset in the world's axes, e' = omega (e_y, -e_x)."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    return 0.0, 0.0, 0.0, s.mass * ey, -s.mass * ex, 0.0


def com_offset_potential(s, x, y):
    """V = m g (height of the centre of mass over the shaft), g the true gravity."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    return s.mass * s.gravity * (ex * s.up_x + ey * s.up_y)


def com_offset_force(s, x, y):
    """Centripetal m omega^2 e, and -dV/d theta."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    spin = s.mass * s.omega * s.omega
    return spin * ex, spin * ey, s.mass * s.gravity * (ex * s.up_y - ey * s.up_x)


TERM = Term(
    rank=20, id="com-offset", summary="the centre of mass is off the shaft", acts="T and V",
    parameters=(
        Parameter("x", "m", 0.0, "along body x (forward at theta = 0)", lowest=-0.05, highest=0.05,
                  visible=(-3e-4, 3e-4)),
        Parameter("y", "m", 0.0, "along body y (up at theta = 0)", lowest=-0.05, highest=0.05, visible=(-1e-3, 1e-3)),
    ),
    source="true gravity pulls at the centre of mass, the wires hold the shaft",
    limits="J stays the inertia about the shaft",
    hooks={"mass": com_offset_mass, "potential": com_offset_potential, "force": com_offset_force},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the centre of mass is not on the axis of rotation",
    confirm="let the platform turn freely about its shaft: it should come to rest with the centre of mass below; "
            "balance it, and the effect should vanish",
    tumble=Tumble(
        rank=20,
        forms=lambda t: (
            Form("both", (free("x", "m", 2e-4, -0.03, 0.03), free("y", "m", 2e-4, -0.03, 0.03)),
                 ((3e-4, 0.0), (-3e-4, 0.0), (0.0, 3e-4), (0.0, -3e-4))),
        ),
        equation="the centre of mass at x, y of the body's axes from the shaft: m * g * (its height) in V, and its "
                 "motion about the shaft in T",
        bench="let the platform turn freely about its shaft and see in which attitude it comes to rest",
    ),
)  # fmt: skip
