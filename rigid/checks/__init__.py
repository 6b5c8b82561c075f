"""Checks of numbers that several classes share: each raises ValueError with the key, its value and what is allowed.

Imports nothing of ours.
"""

import math
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from difflib import get_close_matches
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Coulomb", "Parameter", "check_above_zero", "check_counterweight", "check_friction", "check_not_negative",
    "check_parameters", "check_simulated_gravity", "is_number", "nearest", "read_toml", "sample_times",
    "warn_user",
]  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """One number that a user sets, of an effect or of a surface law; with all defaults an effect changes nothing."""

    name: str
    unit: str
    default: float
    summary: str
    _: KW_ONLY
    lowest: float = -math.inf
    highest: float = math.inf
    above_lowest: bool = False  # Whether it must exceed `lowest`, not only reach it
    source: str = ""  # Of the default
    visible: tuple[float, float] | None = None
    """Range of values whose effect can be seen, for benchmarks and tests; None: they leave it at its default."""

    def check(self, value: Any, key: str) -> float:
        """`value` as a float. Raises ValueError with `key`, what a user calls it, and what is allowed."""
        if not is_number(value) or math.isnan(value):
            raise ValueError(f"{key} = {value!r} must be a number ({self.unit})")
        low = value > self.lowest if self.above_lowest else value >= self.lowest
        if not (low and value <= self.highest) or (math.isinf(value) and value != self.default):
            least = "" if self.lowest == -math.inf else f"{'above' if self.above_lowest else 'from'} {self.lowest:g}"
            most = "" if self.highest == math.inf else f"at most {self.highest:g}"
            raise ValueError(
                f"{key} = {value!r} must be {' and '.join(filter(None, (least, most))) or 'finite'} "
                f"({self.unit}; {self.summary})"
            )
        return float(value)


def check_parameters(parameters: Sequence[Parameter], given: Mapping[str, Any], owner: str) -> dict[str, float]:
    """All parameters by name, as given or by default. Raises ValueError for an unknown one or a value out of bounds."""
    known = {parameter.name: parameter for parameter in parameters}
    for key in given:
        if key not in known:
            raise ValueError(f"{owner}.{key} is no parameter; there is {', '.join(known) or 'none'}")
    return {
        key: parameter.check(given.get(key, parameter.default), f"{owner}.{key}") for key, parameter in known.items()
    }


_LISTED, _ALIKE = 40, 8
"""Words up to which `nearest` lists all, and how many it lists of more."""


def nearest(word: str, words: Iterable[str]) -> str:
    """``did you mean 'x'?`` for the word most like `word`; where none is, all `words`, of many the most alike."""
    words = list(words)
    close = get_close_matches(word, words, n=1) or get_close_matches(word.replace("-", "_").lower(), words, n=1)
    if close:
        return f"did you mean {close[0]!r}?"
    if len(words) <= _LISTED:
        return f"there is {', '.join(words)}"
    alike = get_close_matches(word, words, n=_ALIKE, cutoff=0.0)
    return f"the most alike of {len(words)} are {', '.join(alike)}; --help lists all"


def alike(path: str | Path, *, folders: bool = False) -> str:
    """``; did you mean 'x'?`` for the file beside `path`, or the folder, that is spelt like it; empty where none is."""
    path = Path(path)
    there = path.parent.iterdir() if path.parent.is_dir() else ()
    stems = [one.stem for one in there if one.is_dir() == folders and one.suffix == path.suffix]
    close = get_close_matches(path.stem, stems, n=1)
    return f"; did you mean {str(path.with_name(close[0] + path.suffix))!r}?" if close else ""


def why_unread(path: str | Path, error: OSError) -> str:
    """Why a file could not be read: of one that is not there, with the file of its folder that is spelt like it."""
    path = Path(path)
    if not isinstance(error, FileNotFoundError):
        return str(error.strerror)
    if not path.parent.is_dir():
        return f"there is no folder {str(path.parent)!r}"
    return f"there is no such file{alike(path)}"


def is_number(value: Any) -> bool:
    """Whether `value` is a real number, of numpy too, and not a bool."""
    return isinstance(value, Real) and not isinstance(value, bool)


def check_above_zero(unit: str = "", /, **numbers: Any) -> None:
    """Raise ValueError for what is no finite number above 0; `unit` is shown where it is given."""
    _check(unit, "above 0", numbers, lambda value: value > 0)


def check_not_negative(unit: str = "", /, **numbers: Any) -> None:
    """Raise ValueError for what is no finite number of 0 or more; `unit` is shown where it is given."""
    _check(unit, "0 or more", numbers, lambda value: value >= 0)


def _shown(value: Any) -> str:
    return str(value) if is_number(value) else repr(value)


def _check(unit: str, allowed: str, numbers: Mapping[str, Any], fits: Callable[[Any], bool]) -> None:
    for key, value in numbers.items():
        if not (is_number(value) and math.isfinite(value) and fits(value)):
            raise ValueError(f"{key} = {_shown(value)} must be {allowed}" + (f" ({unit})" if unit else ""))


class Coulomb:
    """Base of classes with coefficients of static and sliding friction, `mu_s` and `mu_d` [1]."""

    mu_s: float
    mu_d: float | None

    @property
    def sliding_friction(self) -> float:
        """mu_d [1], as given, or by default half of mu_s."""
        return 0.5 * self.mu_s if self.mu_d is None else self.mu_d


def check_friction(mu_s: float, mu_d: float | None, *, endless: bool = False) -> None:
    """Raise ValueError for impossible coefficients; mu_d None: by default; `endless`: mu_s may be infinite."""
    if not (endless and mu_s == math.inf):
        check_not_negative(mu_s=mu_s)
    if mu_d is not None and not 0 <= mu_d <= mu_s:
        raise ValueError(f"mu_d = {mu_d} must be from 0 to mu_s = {mu_s}")


def check_counterweight(mass: float, counterweight: float) -> None:
    """Raise ValueError for a counterweight that lifts the platform; both masses in kg."""
    if counterweight >= mass:
        raise ValueError(
            f"counterweight = {counterweight:g} kg must be below mass = {mass:g} kg: a heavier one would lift the "
            f"platform off the ground"
        )


def check_simulated_gravity(gravity: float, **simulated: float) -> None:
    """Raise ValueError for a gravity in the rig that is not below the local `gravity`; all in m/s2."""
    for key, value in simulated.items():
        if value >= gravity:
            raise ValueError(
                f"{key} = {value:g} m/s2 must be below gravity = {gravity:g} m/s2: a rig can only take weight away"
            )


def sample_times(
    duration: float, interval: float, times: ArrayLike | None, *, strict: bool = False
) -> NDArray[np.float64]:
    """Sample times [s], shape [n]: every `interval` from 0 to `duration`, the end included, or `times` where given.

    Raises ValueError for given times that are not finite, fall, lie outside 0 to `duration` or, where `strict`, repeat.
    """
    if times is None:
        every = interval * np.arange(math.floor(duration / interval * (1 + 1e-12)) + 1)
        if duration - every[-1] > 1e-9 * duration:
            every = np.append(every, duration)
        return np.minimum(every, duration)
    given = np.asarray(times, dtype=float)
    falls = np.less_equal if strict else np.less
    if given.ndim != 1 or len(given) == 0 or not np.isfinite(given).all() or falls(np.diff(given), 0).any():
        raise ValueError("times must be a list of finite numbers that rise")
    if given[0] < 0 or given[-1] > duration:
        raise ValueError(f"times must lie within 0 to duration = {duration:g} s, not {given[0]:g} to {given[-1]:g} s")
    return given


OURS = ("coupling", "dem", "experiments", "rigid", "vis")


def warn_user(text: str) -> None:
    """Warn at the line of the first caller outside of hedgebed's packages. Functions that hedgebed writes have no name
    of a module."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", OURS[0]).partition(".")[0] in OURS:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


def read_toml(path: Path) -> dict[str, Any]:
    """The table in the TOML file `path`. Raises ValueError, naming it, for one that is not there or is no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {why_unread(path, error)}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: is not TOML: {error}") from None
