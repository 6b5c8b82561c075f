"""Which made-up campaigns `hedgebed bench diagnose` looks at, and how they and their answers are kept apart.

Case k of a suite depends on the suite's seed and on k alone, so a longer suite begins with the shorter one. Every
beginning of a suite holds what the whole does, as nearly as whole numbers can: nulls 22 %, things outside the library
17 %, pairs 8 %, single effects in turn; strengths are spread evenly over their logarithm from barely visible to plain.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.second.campaigns import KINDS as SECOND
from benchmarks.soft import tumble as soft_tumble
from experiments.campaign import Campaign, write_campaign
from experiments.runs.types import Json

from . import penetration as hidden_penetration
from . import rig as hidden_rig
from . import tumble as hidden_tumble

__all__ = ["KINDS", "STRENGTHS", "make_case", "suite", "write_suite"]

KINDS = ("penetration", "tumble", "rig", *SECOND, "mujoco-tumble")
"""Of made-up campaigns. Those of `rig` are penetrations of another maker; `second-...` are of the second simulator,
`mujoco-...` of MuJoCo."""
STRENGTHS = (0.7, 50.0)  # signatures that are aimed at, over the noise: from not quite to be seen to plain

_SHARES = {"effect": 0.53, "null": 0.22, "outside": 0.17, "pair": 0.08}
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_MAKERS: dict[str, tuple[Any, Callable[..., tuple[Campaign, Any]]]] = {
    "penetration": (hidden_penetration, hidden_penetration.make_hidden),
    "tumble": (hidden_tumble, hidden_tumble.make_hidden_tumble),
    "rig": (hidden_rig, hidden_rig.make_rig),
    **{name: (kind, kind.make) for name, kind in SECOND.items()},
    "mujoco-tumble": (soft_tumble, soft_tumble.make),
}


def suite(
    kind: str, count: int, *, seed: int = 1, only: str | None = None, trials: int | None = None,
    structure: float | None = None,
) -> list[Json]:  # fmt: skip
    """Arguments of `make_case` for `count` campaigns of `kind`: seed, kind of what is hidden, and strength.

    `only`: null, pair, an effect or one thing outside the library: the same for every case. `trials`: of every
    campaign; None for 6 to 24. `structure`: how much the second simulator's structure changes, over the noise; None
    for what each campaign draws. Raises ValueError for a kind of trial or something hidden that there is not.
    """
    if kind not in KINDS:
        raise ValueError(f"kind = {kind!r}: {' or '.join(KINDS)} was expected")
    if structure is not None and kind not in SECOND:
        raise ValueError(f"structure = {structure:g}: only campaigns of {', '.join(SECOND)} have one")
    maker, _ = _MAKERS[kind]
    names = {"effect": maker.EFFECTS, "outside": maker.OUTSIDE, "null": ("null",), "pair": ("pair",)}
    every = [name for group in names.values() for name in group]
    if only is not None and only not in every:
        raise ValueError(f"only = {only!r}: one of {', '.join(every)} was expected")
    random = np.random.default_rng(seed)
    order = {group: [str(name) for name in random.permutation(list(own))] for group, own in names.items()}
    first = {group: float(random.random()) for group in names}
    taken = dict.fromkeys(names, 0)
    low, high = (math.log(edge) for edge in STRENGTHS)
    cases = []
    for k in range(count):
        group = max(_SHARES, key=lambda name: _SHARES[name] * (k + 1) - taken[name])
        hidden = only or order[group][taken[group] % len(order[group])]
        place = (first[group] + taken[group] * _GOLDEN) % 1.0
        taken[group] += 1
        strength = {} if hidden == "null" else {"strength": round(math.exp(low + place * (high - low)), 3)}
        more = ({"trials": trials} if trials else {}) | ({} if structure is None else {"structure": structure})
        cases.append({"seed": 1000 * seed + k, "kind": hidden} | strength | more)
    return cases


def make_case(kind: str, case: Mapping[str, Any]) -> tuple[Campaign, Any]:
    """The campaign of a case of `suite`, and what is hidden in it."""
    return _MAKERS[kind][1](**case)


def write_suite(folder: Path, answers: Path, kind: str, cases: Sequence[Mapping[str, Any]]) -> None:
    """Write the campaigns as FOLDER/<number> and what is hidden in them as ANSWERS/<number>.json.

    Raises ValueError where the answers would lie within reach of whoever reads the campaigns.
    """
    folder, answers = folder.resolve(), answers.resolve()
    if answers == folder or folder in answers.parents:
        raise ValueError(f"answers = {str(answers)!r} lie within the campaigns' folder: another place was expected")
    answers.mkdir(parents=True, exist_ok=True)
    for number, case in enumerate(cases):
        campaign, told = make_case(kind, case)
        write_campaign(folder / f"{number:04d}", campaign)
        text = json.dumps(asdict(told) | {"case": dict(case)}, indent=1)
        (answers / f"{number:04d}.json").write_text(text, encoding="utf-8")
