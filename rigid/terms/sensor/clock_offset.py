"""IMU against camera."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.term import Parameter, Term


def true_time(written, offset, drift):
    """True time of a time on a clock that is off by `offset` at 0 and gains `drift` a second."""
    return (written - offset) / (1.0 + drift)


TERM = Term(
    rank=170, id="clock-offset", summary="IMU against camera", acts="the IMU's times", sensor=True,
    parameters=(
        Parameter("offset", "s", 0.0, "IMU time minus true time, at t = 0"),
        Parameter("drift", "1", 0.0, "what the IMU's clock gains in a second", lowest=-0.5, highest=0.5),
    ),
    source="two clocks, read apart", limits="it gains evenly, in every trial from t = 0 on",
    hooks={"clock": true_time},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the IMU's clock is not the camera's",
    confirm="knock on the platform in view of the camera: both should see it that much apart",
    tumble=Tumble(
        rank=130,
        forms=lambda t: (
            Form("constant", (free("offset", "s", 1e-3, -0.5, 0.5),), ((3e-3,), (-3e-3,), (0.02,), (-0.02,))),
        ),
        bends=(bent("of any shape", "constant", shape("drift", 0.0, 0.01, -0.2, 0.2)),),
        equation="the IMU's time = (1 + drift) * t + offset",
        bench="knock on the platform: camera and IMU see the same instant",
    ),
)  # fmt: skip
