"""The bed may be asked for other layouts of its engine, and has a cache of its own, in every test of physics."""

from engine_pool import engines, quick_collection, roomy_engines, test_arch

__all__ = ["engines", "quick_collection", "roomy_engines", "test_arch"]
