"""Checks of recordings before they are fitted: signs, units, zeros and speeds that cannot be.

A column in degrees under a heading in radians, a force that points down, an accelerometer's reading where the second
derivative of the depth was asked for: each fits no effect of any library and would be diagnosed as one. Nothing is set
aside for it; a person has to state what is right. `hedgebed campaign check` and `hedgebed diagnose` both report it.

Imports `experiments.campaign`, `rigid`, `vis.page`.
"""

from .findings import find_implausible, loud_sensors, missing_sensors, said_once, without_companions
from .template import template_warning
from .unstated import find_unstated

__all__ = [
    "find_implausible",
    "find_unstated",
    "loud_sensors",
    "missing_sensors",
    "said_once",
    "template_warning",
    "without_companions",
]
