"""Whether the best push of a search separates two models at all: beds and noise may differ by more than they do.

Of one reading where two predictions differ most; `Planned.apart` has it. A single push is in one bed, whose stiffness
is a factor on the whole force. More readings of the push do not help.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

from experiments.diagnose.fit.trials import Planned
from rigid.intervals import NORMAL, joint_freedom
from vis.page.sentences import Sentences

__all__ = ["chosen_push", "in_other_beds", "no_push_words", "pushes_needed", "separates"]

say = Sentences(__package__)
_MOST_PUSHES = 20  # whose mean is proposed where one does not separate two models


def in_other_beds(apart: Mapping[str, float], scatter: Mapping[str, float]) -> dict[str, float]:
    """`Planned.apart` with what beds differ by: `scatter` by kind, and the `freedom` that it was found from.

    Where the search did not find what other beds do, a stiffer bed makes both forces as much larger."""
    bed, wander, zero = (scatter.get(kind, 0.0) for kind in ("bed", "force", "force zero"))
    wide, most = {}, 0.0
    for key in ("one", "other", "one_peak", "other_peak"):
        if f"{key}_N" not in apart:  # a plan without peaks
            continue
        beds = math.hypot(apart.get(f"{key}_beds_N") or bed * apart[f"{key}_N"], wander)
        wide[f"{key}_std_N"] = std = math.hypot(apart[f"{key}_std_N"], beds)
        if beds > 0 and scatter.get("freedom"):
            wide[f"{key}_freedom"] = joint_freedom(std, beds, scatter["freedom"])
        most = max(most, beds) if "peak" not in key else most
    return {**apart, **wide, "model_std_N": math.hypot(apart["one_std_N"], apart["other_std_N"]),
            "scatter_N": math.hypot(apart.get("noise_N", 0.0), most, zero)}  # fmt: skip


def chosen_push(plan: Planned, scatter: Mapping[str, float]) -> Planned:
    """Of the pushes of a search the best that separates the two models beside this `scatter`; else the best of all."""
    wide = [replace(push, apart=in_other_beds(push.apart, scatter)) for push in plan.compared or (plan,) if push.apart]
    good = [push for push in wide if push.apart and separates(push.apart)]
    return max(good or wide, key=lambda push: push.nats, default=plan)


def separates(apart: Mapping[str, float]) -> bool:
    """Whether two predictions of `in_other_beds` differ by more than models, noise and beds leave open (95 %)."""
    return abs(apart["one_N"] - apart["other_N"]) > NORMAL * math.hypot(apart["model_std_N"], apart["scatter_N"])


def pushes_needed(apart: Mapping[str, float]) -> int | None:
    """How many such pushes, each in a bed prepared anew, separate the two by their mean. None for more than 20, and
    where the models' own errors are too large."""
    room = (apart["one_N"] - apart["other_N"]) ** 2 - (NORMAL * apart["model_std_N"]) ** 2
    count = math.ceil((NORMAL * apart["scatter_N"]) ** 2 / room) if room > 0 else math.inf
    return int(count) if count <= _MOST_PUSHES else None


def no_push_words(plan: Planned, first: str, rival: str, advice: str) -> str:
    """That no push of a search separates two models, and what does: more of them, or else `advice`."""
    apart = dict(plan.apart or {})
    difference, count = abs(apart["one_N"] - apart["other_N"]), pushes_needed(apart)
    open_N = NORMAL * math.hypot(apart["model_std_N"], apart["scatter_N"])
    instead = say("what_would" if count is None else "many_pushes", count=count, advice=advice)
    return say("no_push", plan=plan, first=first, rival=rival, difference=difference, open_N=open_N,
               depth_mm=1e3 * apart["depth_m"], instead=instead)  # fmt: skip
