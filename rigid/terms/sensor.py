"""Effects on the sensors: declared here, applied in `rigid.sensors`."""

from .term import Parameter, Term

__all__ = ["SENSOR_EFFECTS"]

SENSOR_EFFECTS: tuple[Term, ...] = (
    Term(
        id="clock-offset", summary="IMU against camera", acts="the IMU's times", sensor=True,
        parameters=(
            Parameter(name="offset", unit="s", default=0.0, summary="IMU time minus true time, at t = 0"),
            Parameter(name="drift", unit="1", default=0.0, lowest=-0.5, highest=0.5,
                      summary="what the IMU's clock gains in a second"),
        ),
        source="two clocks, read apart", limits="it gains evenly, in every trial from t = 0 on",
    ),
    Term(
        id="camera-scale", summary="the camera's scale is off", acts="the camera's x and y", sensor=True,
        parameters=(
            Parameter(name="scale", unit="1", default=1.0, lowest=0.0, above_lowest=True,
                      summary="measured over true, x and y"),
            Parameter(name="bend", unit="1/m2", default=0.0,
                      summary="added to it by the square of the distance from where the platform stood"),
        ),
        source="a ruler in the wrong plane; a lens that bends outwards or inwards",
        limits="the same in x and y; the lens's axis is on the start",
    ),
)  # fmt: skip
