"""How verdicts change with a model structure error of a known size: a figure, and the counts behind it.

    python -m benchmarks.second.structure FIGURE.png DIR ...

DIR are folders of ``hedgebed bench diagnose --kind second-... --structure STD``. A bar is one size of the error, root
mean square over the noise of the sensors: the share of each verdict among nulls, single effects and effects that no
library has.
"""

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from matplotlib.patches import Patch

from benchmarks.diagnosis.table import read_cases
from experiments.runs.types import Json
from vis.page.plots import legend_above, sheet, styled, title_above

__all__ = ["counted", "draw", "outcome_of", "titled"]

GROUPS = ("nothing hidden", "one effect", "outside the library")
OUTCOMES = {
    "right": "#2a7f62", "among several": "#8fc1a9", "unknown, it leads": "#e0b050",
    "unknown": "#b0b0b0", "none": "#d9d9d9", "wrong name": "#b3413a",
}  # fmt: skip
"""Outcomes and their colours; `unknown` is right, and green, outside the library, `none` where nothing is hidden."""


def group_of(case: Json) -> str | None:
    """Which of `GROUPS` a record is of; None for a pair."""
    if case["outside"]:
        return GROUPS[2]
    return GROUPS[len(case["truth"])] if len(case["truth"]) < 2 else None


def outcome_of(case: Json) -> str:
    """One of `OUTCOMES` for a record of cases.jsonl."""
    verdict, names = case["verdict"], case["effects"]
    if group_of(case) == GROUPS[2]:
        return "right" if verdict == "unknown" else verdict if verdict == "none" else "wrong name"
    if not case["truth"]:
        return "right" if verdict == "none" else verdict if verdict == "unknown" else "wrong name"
    if verdict == "none":
        return "none"
    if verdict == "unknown":
        leads = case.get("leading", [])[:1] == case["truth"][:1]
        return "unknown, it leads" if leads else "unknown"
    if names == case["truth"] and not case["alternatives"]:
        return "right"
    held = case["truth"][0] in {*names, *case["alternatives"]}
    return "among several" if held else "wrong name"


def counted(cases: Sequence[Json]) -> dict[str, dict[float, Counter[str]]]:
    """Group -> size of the error that was asked for -> how often each outcome came."""
    found: dict[str, dict[float, Counter[str]]] = {group: {} for group in GROUPS}
    for case in cases:
        size, group = case["case"].get("structure"), group_of(case)
        if size is not None and group is not None:
            found[group].setdefault(float(size), Counter())[outcome_of(case)] += 1
    return found


def titled(cases: Sequence[Json]) -> str:
    """What the campaigns are of, as the figure has it; the second simulator's pushes are in sand at 1 g."""
    kinds = sorted({str(case["kind"]).removeprefix("second-") for case in cases})
    where = ", sand, 9.81 m/s²" if kinds == ["push"] else ""
    return f"Verdicts on simulated campaigns ({' and '.join(kinds)}{where})"


def draw(path: Path, cases: Sequence[Json]) -> None:
    """Write the figure of these records to `path`. Raises ValueError where none has a stated size."""
    found = counted(cases)
    if not any(found.values()):
        raise ValueError("no record has a stated structure: run bench diagnose with --structure")
    groups = [group for group in GROUPS if found[group]]
    seen = {outcome for group in groups for counts in found[group].values() for outcome in counts}
    with styled():
        drawing, (axes,) = sheet(1, len(groups), 3.4, sharey=True)
        for axis, group in zip(axes, groups, strict=True):
            sizes = sorted(found[group])
            below = [0.0] * len(sizes)
            for outcome, colour in OUTCOMES.items():
                shares = [found[group][size][outcome] / found[group][size].total() for size in sizes]
                axis.bar(range(len(sizes)), shares, bottom=below, color=colour, width=0.7)
                below = [low + share for low, share in zip(below, shares, strict=True)]
            axis.set_xticks(range(len(sizes)), [f"{size:g}\n({found[group][size].total()})" for size in sizes])
            axis.set(title=group, xlabel="structure error over the noise [1]\n(campaigns)")
            axis.grid(False, axis="x")
        axes[0].set_ylabel("share of campaigns [1]")
        legend_above(drawing, [Patch(color=OUTCOMES[name], label=name) for name in OUTCOMES if name in seen], 6)
        title_above(drawing, titled(cases))
        drawing.savefig(path, dpi=126)


def main(arguments: Sequence[str]) -> None:
    """Draw, and print the counts."""
    cases = [case for folder in arguments[1:] for case in read_cases(Path(folder))]
    draw(Path(arguments[0]), cases)
    print(json.dumps({group: {str(size): dict(own) for size, own in sorted(sizes.items())}
                      for group, sizes in counted(cases).items()}, indent=1))  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
