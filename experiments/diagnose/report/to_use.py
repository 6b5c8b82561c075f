"""Which K and C of pushes and drops to use, and what their standard errors leave out."""

from collections.abc import Mapping
from typing import Any

from vis.diagnose.usable import has_numbers_to_use

from .sentences import say

__all__ = ["use_sentences"]

_SHOWN = 4  # diameters whose K is in the sentence; of more it is in the table


def use_sentences(diagnosis: Mapping[str, Any]) -> list[str]:
    """K by diameter with its error, what C is, and what the errors do not count; none where there is no K to use."""
    if not has_numbers_to_use(diagnosis):
        return []
    after = diagnosis["base"]["after"]
    stiffnesses = {name: entry for name, entry in after.items() if name.startswith("stiffness")}
    if not stiffnesses:
        return []
    shown = [_words(name, entry) for name, entry in list(stiffnesses.items())[:_SHOWN]]
    shown += ["more in the table"] if len(stiffnesses) > _SHOWN else []
    names = " and ".join(effect["id"] for effect in diagnosis["effects"])
    beside = f", together with {names} as in model.toml" if names else ""
    each = say("one_k_each") if len(stiffnesses) > 1 else ""
    is_open = [name for name, entry in after.items() if name.startswith("damping") and entry["std"] is None]
    return [say("use", numbers=", ".join(shown), beside=beside, each=each) + (say("c_is_open") if is_open else "")]


def _words(name: str, entry: Mapping[str, Any]) -> str:
    """K = 5932 ± 7.2 N/m at 60 mm"""
    _, _, diameter = name.partition("@")
    error = "" if entry["std"] is None else f" ± {entry['std']:.2g}"
    return f"K = {entry['value']:.4g}{error} {entry['unit']}" + (
        f" at {1e3 * float(diameter):g} mm" if diameter else ""
    )
