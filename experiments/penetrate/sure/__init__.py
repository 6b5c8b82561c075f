"""How sure the numbers of a spike or foot are: an interval for real grains from its beds and from kept runs; the error
of a peak force on the law of a model.

Imports `coupling`, `experiments.campaign`, `experiments.diagnose.fit`, `experiments.diagnose.push`, `experiments.runs`,
`rigid`, `vis`.
"""

from .interval import (
    Interval,
    Trend,
    ends_of,
    in_words,
    interval_of_rest,
    interval_of_sinkage,
    interval_of_stiffness,
    known_within,
    trends,
)

__all__ = [
    "Interval", "Trend", "ends_of", "in_words", "interval_of_rest", "interval_of_sinkage", "interval_of_stiffness",
    "known_within", "trends",
]  # fmt: skip
