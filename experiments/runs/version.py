"""The version of hedgebed, which `rigid.series` has."""

from rigid.series import __version__

__all__ = ["__version__"]
