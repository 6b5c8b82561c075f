"""Effects on the sensors: declared here, applied in `rigid.sensors`."""

from .term import Parameter, Term

__all__ = ["SENSOR_EFFECTS"]

SENSOR_EFFECTS: tuple[Term, ...] = (
    Term(
        id="clock-offset", summary="IMU against camera", acts="the IMU's times", sensor=True,
        parameters=(Parameter(name="offset", unit="s", default=0.0, summary="IMU time minus true time"),),
        source="two clocks, read apart", limits="constant over a trial",
    ),
    Term(
        id="camera-scale", summary="the camera's scale is off", acts="the camera's x and y", sensor=True,
        parameters=(Parameter(name="scale", unit="1", default=1.0, lowest=0.0, above_lowest=True,
                              summary="measured over true, x and y"),),
        source="a ruler in the wrong plane", limits="the same in x and y, no distortion",
    ),
)  # fmt: skip
