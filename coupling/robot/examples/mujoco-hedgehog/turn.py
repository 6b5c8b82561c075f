"""Turns the Hedgehog onto its next face: the motor of the wheel about y for 0.35 s, then none."""


def control(model, data):
    """Sets the motor by the time alone."""
    data.ctrl[1] = 0.22 if data.time < 0.35 else 0.0
