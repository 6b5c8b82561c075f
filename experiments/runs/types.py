"""Types that many modules name."""

from typing import Any

__all__ = ["Json"]

Json = dict[str, Any]  # A table as JSON and TOML hold it: text to numbers, text, lists and further tables
