"""Whether the best push of a search separates two models at all: beds and noise may differ by more than they do.

Of one reading where two predictions differ most; `Planned.apart` has it. A single push is in one bed, whose stiffness
is a factor on the whole force. More readings of the push do not help.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from experiments.diagnose.fit.trials import Planned
from rigid.intervals import half_of, joint_freedom
from vis.page.sentences import Sentences

__all__ = ["by_chance", "chosen_push", "in_other_beds", "no_push_words", "pushes_needed", "separates"]

say = Sentences(__package__)
_MOST_PUSHES = 20  # whose mean is proposed where one does not separate two models


def in_other_beds(apart: Mapping[str, float], scatter: Mapping[str, float]) -> dict[str, float]:
    """`Planned.apart` with what beds differ by: `scatter` by kind, and the `freedom` that it was found from.

    Where the search did not find what other beds do, a stiffer bed makes both forces as much larger."""
    bed, wander, zero = (scatter.get(kind, 0.0) for kind in ("bed", "force", "force zero"))
    wide, rests, most, freedom = {}, {}, 0.0, scatter.get("freedom")
    for key in ("one", "other", "one_peak", "other_peak"):
        if f"{key}_N" not in apart:  # a plan without peaks
            continue
        beds = math.hypot(apart.get(f"{key}_beds_N") or bed * apart[f"{key}_N"], wander)
        wide[f"{key}_std_N"] = std = math.hypot(apart[f"{key}_std_N"], beds)
        rests[key] = apart.get(f"{key}_rests_N", 0.0)
        part = math.hypot(beds, rests[key])  # both of one estimate of the scatter
        if part > 0 and freedom:
            wide[f"{key}_freedom"] = joint_freedom(std, part, freedom)
        most = max(most, beds) if "peak" not in key else most
    between = {"model_std_N": math.hypot(apart["one_std_N"], apart["other_std_N"]),
               "model_rests_N": math.hypot(rests["one"], rests["other"]),
               "scatter_N": math.hypot(apart.get("noise_N", 0.0), most, zero),
               "scatter_rests_N": math.hypot(most, zero)}  # fmt: skip
    return {**apart, **wide, **between, **({"freedom": freedom} if freedom else {})}


def chosen_push(plan: Planned, scatter: Mapping[str, float]) -> Planned:
    """Of the pushes of a search the best that separates the two models beside this `scatter`; else the best of all."""
    wide = [replace(push, apart=in_other_beds(push.apart, scatter)) for push in plan.compared or (plan,) if push.apart]
    good = [push for push in wide if push.apart and separates(push.apart)]
    return max(good or wide, key=lambda push: push.nats, default=plan)


def by_chance(apart: Mapping[str, float], count: int = 1) -> float:
    """By how much [N] two predictions of `in_other_beds` and the mean of `count` such pushes may differ by chance: half
    of a 95 % interval. Student's where the scatter of beds was found from few; further beds show it as well."""
    std = math.hypot(apart["model_std_N"], apart["scatter_N"] / math.sqrt(count))
    part = math.hypot(apart["model_rests_N"], apart["scatter_rests_N"] / math.sqrt(count))
    freedom = joint_freedom(std, part, apart["freedom"] + count - 1) if part > 0 and "freedom" in apart else None
    return half_of({"std": std, "freedom": freedom}) or 0.0


def separates(apart: Mapping[str, float]) -> bool:
    """Whether two predictions of `in_other_beds` differ by more than models, noise and beds leave open (95 %)."""
    return _difference(apart) > by_chance(apart)


def pushes_needed(apart: Mapping[str, float]) -> int | None:
    """How many such pushes, each in a bed prepared anew, separate the two by their mean. None for more than 20, and
    where the models' own errors are too large."""
    counts = range(1, _MOST_PUSHES + 1)
    return next((count for count in counts if _difference(apart) > by_chance(apart, count)), None)


def _difference(apart: Mapping[str, float]) -> float:
    return abs(apart["one_N"] - apart["other_N"])


def no_push_words(plan: Planned, first: str, rival: str, advice: str) -> str:
    """That no push of a search separates two models, and what does: more of them, or else `advice`."""
    apart = dict(plan.apart or {})
    count = pushes_needed(apart)
    instead = say("what_would" if count is None else "many_pushes", count=count, advice=advice)
    return say("no_push", plan=plan, first=first, rival=rival, difference=_difference(apart), open_N=by_chance(apart),
               depth_mm=1e3 * apart["depth_m"], instead=instead)  # fmt: skip
