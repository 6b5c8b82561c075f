"""What a case of the verification suite is: what is known, what came out, and the band between them."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from experiments.runs.types import Json

__all__ = [
    "Case", "Comparison", "Compute", "Curve", "Outcome", "Plot", "Tell", "compared", "listed", "near_zero", "tracked",
    "within", "worst",
]  # fmt: skip
Item = TypeVar("Item")


@dataclass(frozen=True)
class Comparison:
    """One number beside the one it should be."""

    quantity: str  # what it is, with the case it is of ("e_t at 10 deg")
    unit: str  # of both; "1" for a ratio
    reference: float  # from the closed form, or published
    ours: float  # measured on the bed
    band: float  # the largest difference that passes, over the reference's size where ``relative``
    relative: bool = True  # False where ``band`` is in the unit itself

    def __post_init__(self) -> None:
        if not self.band > 0 or (self.relative and self.reference == 0):
            raise ValueError(f"{self.quantity}: a band of {self.band} about {self.reference} cannot be met")

    @property
    def difference(self) -> float:
        """Ours less the reference, in its unit."""
        return self.ours - self.reference

    @property
    def share(self) -> float:
        """How much of the band the difference takes [1]; infinite for what is not a number."""
        scale = self.band * (abs(self.reference) if self.relative else 1.0)
        share = abs(self.difference) / scale
        return float(share) if math.isfinite(share) else math.inf  # numpy's would make a bool that JSON refuses

    @property
    def passes(self) -> bool:
        """Whether it lies in the band."""
        return self.share <= 1

    def as_dict(self) -> Json:
        """What result.json keeps."""
        return vars(self) | {"difference": self.difference, "share": self.share, "passes": self.passes}


def compared(
    quantity: str, at: Sequence[Any] | np.ndarray, reference: Any, ours: Any, *, band: float, unit: str = "1",
    form: str = "{}", only: np.ndarray | None = None,
) -> list[Comparison]:  # fmt: skip
    """A comparison for each of several numbers, called ``<quantity> at <at>``, each ``at`` written as ``form``.

    ``reference``: of each, or one of all. ``only``: which are compared, shape [n]. Raises ValueError for other lengths.
    """
    wanted = np.broadcast_to(np.asarray(reference, dtype=float), np.shape(ours))
    rows = zip(at, wanted, np.asarray(ours, dtype=float), strict=True)
    found = [Comparison(f"{quantity} at {form.format(x)}", unit, float(a), float(b), band) for x, a, b in rows]
    return found if only is None else [one for one, chosen in zip(found, only, strict=True) if chosen]


@dataclass(frozen=True)
class Curve:
    """Points of a plot, shapes [n]: ``ours`` is drawn as dots, a reference as a line."""

    label: str
    x: Any
    y: Any
    ours: bool = True


@dataclass(frozen=True)
class Plot:
    """What shows how well the case comes out. ``log``: "", "x", "y" or "xy"."""

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    log: str = ""


@dataclass(frozen=True)
class Outcome:
    """What a case found. ``skipped`` says in words what it lacks on this machine."""

    comparisons: Sequence[Comparison] = ()
    plots: Sequence[Plot] = ()
    remarks: Sequence[str] = ()
    skipped: str = ""

    @property
    def status(self) -> str:
        """``pass``, ``fail`` or ``skipped``."""
        if self.skipped:
            return "skipped"
        return "pass" if self.comparisons and all(one.passes for one in self.comparisons) else "fail"


Tell = Callable[[float], None]  # takes how far a case is, 0 to 1
Compute = Callable[[Tell], Outcome]  # computes a case


def tracked(items: Iterable[Item], tell: Tell) -> Iterator[Item]:
    """The items one by one; each is reported as done when the next one is asked for."""
    rows = list(items)
    for done, item in enumerate(rows, 1):
        yield item
        tell(done / len(rows))


def within(tell: Tell, start: float, end: float) -> Tell:
    """Takes how far a part of a case is; the part goes from one share of the whole to another."""
    return lambda share: tell(start + share * (end - start))


def worst(found: Any, wanted: float) -> float:
    """Of several numbers the one that is farthest off."""
    return float(np.ravel(found)[np.argmax(np.abs(found - wanted))])


def listed(values: Iterable[float], form: str) -> str:
    """Numbers in a sentence."""
    return ", ".join(format(value, form) for value in values)


def near_zero(quantity: str, ours: float, band: float, unit: str = "1") -> Comparison:
    """A number that should be 0, within `band` in its unit."""
    return Comparison(quantity, unit, 0.0, float(ours), band, False)


@dataclass(frozen=True)
class Case:
    """One row of the suite."""

    id: str  # for ``--only``; letters, digits and hyphens
    family: str  # the heading it stands under
    title: str  # what is tested
    reference: str  # the closed form, or what was published
    source: str  # where that is from
    compute: Compute | None = None  # None where the bed cannot do it yet
    slow: bool = False  # left out by ``--quick``
    measured: bool = False  # held against an experiment: what ``--measured`` runs
    informational: bool = False  # it is shown and not counted: what it is held against is known to be something else
    seconds: float = 2.0  # expected time, for the progress [s]
    reason: str = ""  # why it fails, where it is known to; shown only while it does
    stuff: str = ""  # of a bed: its grains and their gravity, for the titles of the figures
    waits_for: str = ""  # what is missing in the bed, where ``compute`` is None

    def __post_init__(self) -> None:
        if (self.compute is None) != bool(self.waits_for):
            raise ValueError(f"case {self.id!r} needs either compute or waits_for")

    def about(self) -> Json:
        """What result.json says of it whatever comes out."""
        keys = ("id", "family", "title", "reference", "source", "slow", "measured")
        return {key: getattr(self, key) for key in keys} | ({"stuff": self.stuff} if self.stuff else {})

    def counted(self, status: str) -> str:
        """How a status counts: a failure of one that is informational does not."""
        return "informational" if status == "fail" and self.informational else status

    def head(self) -> Json:
        """What result.json says of it before it has run."""
        status = {"status": "not run"} if self.compute else {"status": "not yet", "waits_for": self.waits_for}
        return self.about() | status
