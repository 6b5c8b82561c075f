"""The cloud of the verification suite, under the name by which the tests of the bed know it."""

from experiments.validate.base.cloud import BALL, DIAMETER, HEIGHT, PERIOD, STEP, STUFF, initial, make

__all__ = ["BALL", "DIAMETER", "HEIGHT", "PERIOD", "STEP", "STUFF", "initial", "make"]
