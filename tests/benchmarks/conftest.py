"""One engine serves all small beds."""

from engine_pool import roomy_engines

__all__ = ["roomy_engines"]
