"""Controls the hopping leg: a push of 60 N for 90 ms, twice a second."""


def control(model, data):
    """Sets the one motor by the time alone."""
    data.ctrl[0] = -60.0 if 0.25 <= data.time % 0.5 < 0.34 else 0.0
