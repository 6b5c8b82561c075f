"""The torque falls with speed or time."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.curves import raised
from rigid.terms.term import Parameter, Term


def torque_fade_factor(s, speed_loss, time_loss, speed_power, time_power):
    """1 - (a w)^p - (b t)^q, w the wheel's speed, never below zero; p = q = 1 are straight lines."""
    return max(0.0, 1.0 - raised(speed_loss * abs(s.wheel_speed), speed_power) - raised(time_loss * s.time, time_power))


TERM = Term(
    rank=80, id="torque-fade", summary="the torque falls with speed or time",
    acts="virtual work: the flywheel's torque",
    parameters=(
        Parameter("speed_loss", "s/rad", 0.0, "share lost per rad/s of the wheel: 1 / no-load speed of a DC motor",
                  lowest=0.0, visible=(1e-4, 2e-3)),
        Parameter("time_loss", "1/s", 0.0, "share lost a second: heating", lowest=0.0, visible=(0.01, 0.2)),
        Parameter("speed_power", "1", 1.0, "p of (speed_loss w)^p: 1 a straight line, above it falls late", lowest=0.2,
                  highest=5.0, visible=(0.7, 2.0)),
        Parameter("time_power", "1", 1.0, "q of (time_loss t)^q", lowest=0.2, highest=5.0, visible=(0.7, 2.0)),
    ),
    source="torque-speed line of a DC motor at a fixed voltage; fade of a brake that warms",
    limits="cut at zero", hooks={"torque_factor": torque_fade_factor},
)  # fmt: skip

_POWER = (1.0, 0.4, -0.65, 2.0)

CANDIDATE = Candidate(
    meaning="the torque falls with the wheel's speed or with time",
    confirm="run the wheel on the bench up to its speed here and read the slope of its speed",
    tumble=Tumble(
        rank=50,
        forms=lambda t: (
            Form("speed", (free("speed_loss", "s/rad", 1e-4, 0.0, 0.02),), ((1e-4,), (6e-4,))),
            Form("time", (free("time_loss", "1/s", 0.02, 0.0, 5.0),), ((0.03,), (0.2,))),
        ),
        bends=(
            bent("of any shape", "speed", shape("speed_power", *_POWER)),
            bent("of any shape", "time", shape("time_power", *_POWER)),
        ),
        equation="the torque times max(0, 1 - (speed_loss * w)^speed_power - (time_loss * t)^time_power), w the "
                 "wheel's speed; powers that are not named are 1",
        bench="run the wheel on the bench and read its speed up to the end: its slope is the torque",
    ),
)  # fmt: skip
