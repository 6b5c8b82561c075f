"""Something resists a spike's motion in either direction; of pushes only."""

from math import exp, log, tanh

from rigid.terms.candidate import SETS_IN, Bend, Candidate, Form, Number, Push, Starts, amplitude, between, times
from rigid.terms.curves import mobilised


def push_force(
    z, v, x, way, share, shaft, shaft_deep, shaft_power, shaft_viscous, shaft_slow, shaft_speed, shaft_held,
    shaft_growth, shaft_onset, shaft_sharpness, shaft_rise,
):  # fmt: skip
    """Friction against the motion, by depth, speed or the distance since it turned; and a viscous one."""
    rub = (shaft + shaft_deep * x) * way
    if shaft_power != 0.0:
        rub = rub + shaft_power * x**shaft_growth * way
    if shaft_slow != 0.0:
        rub = rub + shaft_slow * exp(-abs(v) / shaft_speed) * way
    if shaft_held != 0.0:
        rub = rub + shaft_held * x**shaft_growth * share
    if shaft_onset > 0.0:
        rub = rub * mobilised(z / shaft_onset, shaft_sharpness)
    if shaft_rise > 0.0:
        rub = rub * (tanh(abs(v) / shaft_rise) / max(abs(way), 1e-9))  # in place of the direction
    return rub + shaft_viscous * v


def _form(name: str, slot: str, how: str, starts: Starts, equation: str, *more: Number, highest: float = 10.0) -> Form:
    std = 0.3 if highest > 1 else 0.1
    return Form(name, (amplitude(slot, how, std, 0.0, highest), *more), starts, equation,
                "" if name == "constant" else "retreats")  # fmt: skip


CANDIDATE = Candidate(
    meaning="something resists the spike's motion in either direction",
    confirm="move the {body}'s guide up and down without a bed: a guide's resistance is there too, that of a shaft or "
            "an edge in the bed is not; for that, push a {body} with a rougher side",
    push=Push(
        rank=60, law={"force": push_force}, lengths={"shaft_speed": 1e-2, "shaft_reach": 1e-3},
        turning=("shaft_held", "shaft_reach"), steep=(("shaft", "shaft_deep", "shaft_power"), "shaft_rise"),
        forms=(
            _form("constant", "shaft", "perimeter", ((0.05,),), "+ shaft * sign(v)"),
            _form("growing with depth", "shaft_deep", "perimeter", ((0.05,),), "+ shaft_deep * z / D * sign(v)"),
            _form("by a power of depth", "shaft_power", "perimeter", ((0.05, 0.5), (0.05, 1.5)),
                  "+ shaft_power * (z / D)^shaft_growth * sign(v)", between("shaft_growth", "plain", 0.0, 2.0)),
            _form("viscous", "shaft_viscous", "viscous", ((0.05,),), "+ shaft_viscous * v"),
            _form("falling with speed", "shaft_slow", "perimeter", ((0.05, -1.0), (0.05, -3.0)),
                  "+ shaft_slow * exp(-abs(v) / shaft_speed) * sign(v)", between("shaft_speed", "speed", -5.0, 1.0)),
            # It takes a way to turn round, and stays while the spike is held. Were its bound as large as the spring, it
            # would be a crater: loading doubled, nothing given back.
            _form("mobilised over a way", "shaft_held", "perimeter", ((0.05, -4.0, 0.3), (0.05, -2.0, 0.3)),
                  "+ shaft_held * (z / D)^shaft_growth * w, dw = (sign(dz) - w) * abs(dz) / shaft_reach",
                  between("shaft_reach", "depth", log(0.003), 0.0), between("shaft_growth", "plain", 0.0, 1.5),
                  highest=0.4),
        ),
        bends=(
            # The shaft behind a wider tip, or a plate's edge: from a depth on it rubs as it will.
            Bend("{}, setting in", ("constant", "by a power of depth", "falling with speed", "mobilised over a way"),
                 (between("shaft_onset", "depth", -6.0, 0.0, value=-3.0, std=1.5),
                  between("shaft_sharpness", "plain", 0.7, 8.0, value=2.5, std=2.0)), ((-3.0, 3.0), (-1.3, 3.0)),
                 times(SETS_IN, "y = z / shaft_onset", "q = shaft_sharpness")),
            # What shears between the shaft and the bed resists the more the faster, up to a bound.
            Bend("{}, rising with speed", ("constant", "growing with depth", "by a power of depth"),
                 (between("shaft_rise", "speed", -8.0, 0.0, value=-3.0, std=1.5),), ((-2.5,), (-4.0,)),
                 times("tanh(abs(v) / shaft_rise)")),
        ),
    ),
)  # fmt: skip
