"""The constants that decide a diagnosis, and a process in which some of them have other values."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

from .worker import begin

__all__ = ["CONSTANTS", "Constant", "begin_changed"]

_PACKAGE = "experiments.diagnose"
_FORMAT = "the rule of the format (docs/diagnose.md, What matters)"
_SAND = "set on one campaign on sand, where the likeliest pairs are the 8th and 10th"
_TUNED = "set on some seventy campaigns of our own simulators"


@dataclass(frozen=True)
class Constant:
    """A constant of `experiments.diagnose`: module and name, what it decides, where its value comes from.

    `others`: further names of the same number, as "module:NAME". `rest`: of a share near 1, 1 minus it is changed.
    """

    module: str
    name: str
    decides: str
    source: str
    others: tuple[str, ...] = ()
    rest: bool = False

    @property
    def id(self) -> str:
        """Module and name."""
        return f"{self.module}:{self.name}"

    def value(self) -> float:
        """As it stands in the code."""
        return float(getattr(import_module(f"{_PACKAGE}.{self.module}"), self.name))

    def times(self, factor: float) -> float:
        """Its value with this factor."""
        return 1 - factor * (1 - self.value()) if self.rest else factor * self.value()


CONSTANTS = (
    Constant("fit.evidence", "SMALL", "gap up to which what is left does not matter", _FORMAT, ("core.matters:MOST",)),
    Constant("core.rivals", "LEAD", "nats by which a name leads every rival", _FORMAT),
    Constant("core.matters", "_CLOSED", "share of the misfit that a name closes instead", _FORMAT, rest=True),
    Constant("core.matters", "_ERRORS", "standard errors by which an effect lowers the held-out gap", _FORMAT),
    Constant("core.matters", "_WITHIN", "standard deviations within which a number is as stated", _TUNED),
    Constant("fit.bounds", "_FAR", "standard deviations that no true number has", "chance 6e-7 of a normal law"),
    Constant("fit.gate", "_LEVEL", "chance that a right model is refused", "chosen: 3 of 600 bootstrap campaigns"),
    Constant("core.candidate_fits", "WORTH", "nats by which an effect raises the evidence", "20 times likelier"),
    Constant("core.candidate_fits", "BEHIND", "nats behind the best beyond which a fit stops early", "cost only"),
    Constant("core.rivals", "CLOSE", "nats within which evidence does not separate", "55 times likelier"),
    Constant("core.rivals", "_SMALL_ANGLE", "degrees below which two signatures are alike", "forms of one effect"),
    Constant("core.rivals", "_SURE", "nats with prediction, below which both are named", "7 times likelier"),
    Constant("core.deciding", "_AS_LIKELY", "nats within which a second alternative is reported", "2.7 times likelier"),
    Constant("core.deciding", "_AS_NOISY", "gap up to which a misfit of form is small", "as large as the noise"),
    Constant("core.deciding", "_RIGHT_FORM", "share of the misfit that a right form leaves then", _TUNED),
    Constant("core.deciding", "_NEXT_TO_NOTHING", "share that a right form leaves at any gap", _TUNED),
    Constant("core.deciding", "_NO_EFFECT", "share left from which an effect explains too little", _TUNED),
    Constant("core.deciding", "_SURE", "standard deviations of chi-square that are not chance", "chance 1.3e-3"),
    Constant("core.deciding", "_LATE", "share of the time after which a held-out trial may diverge", "chosen"),
    Constant("core.deciding", "_CERTAIN", "share left by an effect that is certain in `unknown`", "chosen"),
    Constant("core.deciding", "_ONE_NUMBER", "relative uncertainty of an amplitude", "chosen"),
    Constant("core.deciding", "_SEEN_ELSEWHERE", "nats gained where one trial diverges", "20 times likelier"),
    Constant("core.search", "_WORTH_MORE", "nats by which a second effect raises the evidence", _TUNED),
    Constant("core.search", "_SHARE", "share of what is left that a further effect removes", _TUNED),
    Constant("core.search", "_SHARE_OF_BASE", "share of the base model's misfit that it removes", _TUNED),
    Constant("core.search", "_LEADS", "nats with prediction by which a rival takes the lead", "7 times likelier"),
    Constant("core.search", "_BESIDE", "nats behind the best within which a rival is compared", "cost only"),
    Constant("core.search", "_PAIRS_STATED", "pairs begun at stated numbers that a base model has bent", _SAND),
    Constant("fit.evidence", "_MOST_OCCAM", "nats that a form's parameters cost at most", _TUNED),
    Constant("noise.wander", "_SURE", "twice the log likelihood of a wander of replicates", "chance 4e-8 (1 number)"),
    Constant("noise.replicates", "_SURE", "chance below which replicates differ", "chosen"),
)  # fmt: skip
"""What is halved and doubled by `hedgebed bench constants`."""


def begin_changed(values: Mapping[str, float]) -> None:
    """What a fresh process does first: give constants (by `Constant.id`) other values, wherever they were imported.

    Raises ValueError for an id that is none.
    """
    known = {constant.id: constant for constant in CONSTANTS}
    if strange := set(values) - set(known):
        raise ValueError(f"constant {min(strange)!r}: one of {', '.join(known)} was expected")
    begin()
    import_module(f"{_PACKAGE}.experiment")
    for id_, value in values.items():
        constant = known[id_]
        before = getattr(import_module(f"{_PACKAGE}.{constant.module}"), constant.name)
        for other in constant.others:
            place, _, alias = other.rpartition(":")
            setattr(import_module(f"{_PACKAGE}.{place}"), alias, value)
        for place, module in list(sys.modules.items()):
            # Modules that imported it hold the same object by the same name.
            if place.startswith(_PACKAGE) and vars(module).get(constant.name) is before:
                setattr(module, constant.name, value)
