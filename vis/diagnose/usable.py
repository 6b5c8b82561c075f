"""Whether a diagnosis has a K to use, which report and sentences put first."""

from collections.abc import Mapping
from typing import Any

__all__ = ["has_numbers_to_use"]


def has_numbers_to_use(diagnosis: Mapping[str, Any]) -> bool:
    """Whether the best model's K describes the ground: of pushes and drops, where the verdict is not unknown, and no
    number of the base model went far from what was stated."""
    far = any(bound["sigmas"] is not None for bound in diagnosis.get("at_bounds", {}).get("after", []))
    return diagnosis.get("kind") == "penetration" and diagnosis["verdict"] != "unknown" and not far
