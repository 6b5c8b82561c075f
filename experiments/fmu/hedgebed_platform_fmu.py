"""What an FMU of hedgebed loads first: `hedgebed fmu` puts this file into it, and the FMU's library imports it."""

try:
    from experiments.fmu.slave import PlatformSlave
except ImportError as error:
    raise ImportError(
        f"this FMU is computed by hedgebed, which this Python cannot import ({error}): install hedgebed[fmi] for it"
    ) from error
from pythonfmu3 import Fmi3Slave

__all__ = ["Platform"]


class Platform(PlatformSlave, Fmi3Slave):
    """The class that the library of pythonfmu3 looks for in this file, by its base class."""
