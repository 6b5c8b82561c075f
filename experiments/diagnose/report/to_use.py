"""Which K and C of pushes and drops to use, and what their standard errors leave out."""

from collections.abc import Mapping
from typing import Any

from experiments.diagnose.fit.gaps import numeral
from vis.diagnose.usable import has_numbers_to_use, secant_depth

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
    depth = secant_depth(diagnosis)
    secant, of_depth = ("", "") if depth is None else (say("secant", depth_mm=1e3 * depth), say("of_depth"))
    sentence = say("use", numbers=", ".join(shown), secant=secant, beside=beside, each=each, of_depth=of_depth)
    bounds = "".join(_bound(name, after[name]["at_most"]) for name in is_open[:_SHOWN] if "at_most" in after[name])
    covered = diagnosis.get("covered", {})
    no_way_out = "" if covered.get("withdrawal", True) else f" {say('no_withdrawal')}"
    return [sentence + (say("c_is_open", bounds=bounds) if is_open else "") + no_way_out]


def _bound(name: str, bound: float) -> str:
    """; it is at most 1.2 N s/m at 60 mm"""
    return say("c_at_most", at_most=numeral(bound, 2), at=_at(name))


def _words(name: str, entry: Mapping[str, Any]) -> str:
    """K = 5932 ± 7.2 N/m at 60 mm"""
    error = "" if entry["std"] is None else f" ± {entry['std']:.2g}"
    return f"K = {entry['value']:.4g}{error} {entry['unit']}{_at(name)}"


def _at(name: str) -> str:
    _, _, diameter = name.partition("@")
    return f" at {1e3 * float(diameter):g} mm" if diameter else ""
