"""Effects of one's own among the candidates: a Python file with an equation and a name.

```python
from rigid.terms import Parameter, Term

def drag(s, depth, rate, c):
    return c * rate                       # [N], along the normal, by the depth and its rate

TERM = Term(id="mud", summary="mud drags both ways", acts="contact", source="ours", limits="slow",
            hooks={"rate_force": drag},
            parameters=(Parameter(name="c", unit="N s/m", default=0.0, lowest=0.0, summary="drag"),))
FIT = {"c": {"typical": 2.0}}
```
TERM is a term as `rigid.terms` has them; the first parameter is the amplitude. FIT has for each parameter `typical`, a
size that can be seen, from which fits begin; of the amplitude also `off`, the value that changes nothing (the default
if left out). Tumbles take every hook but those of a coordinate of its own. Penetration takes `stiffen`, `rate_force`
and `hold`, with depth, rate and deepest depth of the spike, and of `s` what a spike that goes straight down has: mass,
gravity, weight, y = -depth and vy.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rigid.terms import Term, load_effect

from .problem import Parameter, Values

__all__ = ["PENETRATION_HOOKS", "OwnEffect", "load_own", "own_parameters", "own_starts"]

PENETRATION_HOOKS = ("stiffen", "rate_force", "hold")
_FINE = 0.2
"""Scale of a change that can be seen, over the typical size."""


@dataclass(frozen=True, kw_only=True)
class OwnEffect:
    """A term from a file, and how it is fitted."""

    term: Term
    file: Path
    off: float
    """Of the amplitude: the value that changes nothing."""
    typical: Mapping[str, float]
    """Parameter -> a size that can be seen."""

    @property
    def id(self) -> str:
        """Its name."""
        return self.term.id

    @property
    def amplitude(self) -> str:
        """Its first parameter."""
        return self.term.parameters[0].name

    def actual(self, name: str, value: float) -> float:
        """The term's parameter, from what is fitted: an amplitude is counted from `off`."""
        return value + self.off if name == self.amplitude else value


def load_own(file: str | Path) -> OwnEffect:
    """The effect in `file`. Raises ValueError, naming the file and the key, for what cannot be fitted."""
    term = load_effect(file)
    said = f"effect_file = {str(file)!r}"
    if not term.hooks or not term.parameters:
        raise ValueError(f"{said}: TERM has no {'hooks' if not term.hooks else 'parameters'}: there is nothing to fit")
    module = sys.modules[next(iter(term.hooks.values())).__module__]
    told = getattr(module, "FIT", None)
    names = [p.name for p in term.parameters]
    if not isinstance(told, dict) or set(told) != set(names):
        found = "none" if not isinstance(told, dict) else f"one of {', '.join(map(str, told)) or 'nothing'}"
        wanted = f"FIT = {{name: {{'typical': number}}}} of {', '.join(names)}"
        raise ValueError(f"{said}: {wanted} was expected, found {found}")
    typical = {}
    for name in names:
        size = told[name].get("typical")
        number = isinstance(size, int | float) and not isinstance(size, bool) and math.isfinite(size) and size != 0
        if set(told[name]) - {"typical", "off"} or not number:
            raise ValueError(f"{said}: FIT[{name!r}] = {told[name]!r}: 'typical', a number other than 0, was expected")
        typical[name] = float(size)
    first = term.parameters[0]
    off = told[first.name].get("off", first.default)
    if not isinstance(off, int | float) or not math.isfinite(off):
        raise ValueError(f"{said}: FIT[{first.name!r}]: off = {off!r}: the value that changes nothing was expected")
    return OwnEffect(term=term, file=Path(file).resolve(), off=float(off), typical=typical)


def own_parameters(own: OwnEffect) -> tuple[Parameter, ...]:
    """What is fitted: the amplitude from 0, the others about their typical size, to within that size."""
    found = []
    for p in own.term.parameters:
        size = abs(own.typical[p.name])
        shift = own.off if p.name == own.amplitude else 0.0
        lowest = p.lowest - shift
        if p.above_lowest and p.name != own.amplitude:
            lowest += 1e-3 * size
        elif p.above_lowest:
            lowest = max(lowest, 0.0) if own.off > p.lowest else lowest
        found.append(Parameter(
            name=f"{own.id}.{p.name}", unit=p.unit, value=0.0 if p.name == own.amplitude else own.typical[p.name],
            std=math.inf if p.name == own.amplitude else size, scale=_FINE * size, step=0.02 * _FINE * size,
            lowest=lowest, highest=p.highest - shift,
        ))  # fmt: skip
    return tuple(found)


def own_starts(own: OwnEffect, parameters: Sequence[Parameter]) -> tuple[Values, ...]:
    """Amplitudes of a quarter of the typical size, of it and of four times it, either sign where the bounds allow."""
    first, *others = parameters
    rest = {p.name: p.value for p in others}
    sizes = [sign * size * own.typical[own.amplitude] for sign in (1, -1) for size in (0.25, 1.0, 4.0)]
    return tuple({first.name: size, **rest} for size in sizes if first.lowest < size < first.highest)
