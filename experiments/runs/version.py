"""The version of hedgebed, which `rigid.version` states."""

from rigid.version import __version__

__all__ = ["__version__"]
