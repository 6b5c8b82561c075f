"""What held-out trials say of a diagnosis."""

from collections.abc import Mapping
from typing import Any

__all__ = ["worsens_held_out"]


def worsens_held_out(diagnosis: Mapping[str, Any]) -> bool:
    """Whether the best model of an unknown predicts held-out trials worse than the base model: then no name leads."""
    if diagnosis["verdict"] != "unknown":
        return False
    before, after = (diagnosis.get("gap", {}).get(stage, {}).get("held_out") for stage in ("before", "after"))
    return before is not None and after is not None and after > before
