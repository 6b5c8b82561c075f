"""`hedgebed bench constants`: what half and twice each constant of the diagnosis does to its verdicts.

    hedgebed bench constants [--kind second-push] [--count 10] [--seed 1] [--trials 6] [--only NAME] [--out DIR]

The campaigns are those of `hedgebed bench diagnose` with the same options. Each is diagnosed with the constants as they
are, then with one of them halved and doubled (`benchmarks/diagnosis/changed.py`). DIR/constants.jsonl keeps every
verdict, and the same command with the same DIR goes on where it was stopped.
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from experiments.campaign import Campaign, write_campaign
from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .diagnose import digest
from .diagnosis.changed import CONSTANTS, Constant, begin_changed
from .diagnosis.worker import answer
from .hidden.suite import KINDS, make_case, suite
from .race.machine import now

__all__ = ["FILE", "continues", "run", "table"]

FILE = "constants.jsonl"
FACTORS = (0.5, 2.0)
_RECORD = (
    "kind", "case", "constant", "factor", "code", "suite", "truth", "outside", "verdict", "effects", "alternatives",
    "cpu",
)  # fmt: skip


def run(
    out: Path, *, progress: Progress, kind: str = "second-push", count: int = 10, seed: int = 1, trials: int = 6,
    only: str = "",
) -> Json:  # fmt: skip
    """Diagnose `count` campaigns of a kind with each constant as it is, halved and doubled; show the table on stdout.

    `only`: one constant, as module:NAME; empty: all. Raises ValueError for settings that cannot be.
    """
    if kind not in KINDS:
        raise ValueError(f"kind = {kind!r}: one of {', '.join(KINDS)} was expected")
    if count < 1 or not 4 <= trials <= 100:
        raise ValueError(f"count = {count}, trials = {trials}: at least 1, and 4 to 100, were expected")
    chosen = [constant for constant in CONSTANTS if only in ("", constant.id)]
    if not chosen:
        raise ValueError(f"only = {only!r}: one of {', '.join(c.id for c in CONSTANTS)} was expected")
    cases = suite(kind, count, seed=seed, only=None, trials=trials, structure=None)
    made = [make_case(kind, case) for case in cases]
    folders = [out / "campaigns" / f"{kind}-{seed}-{trials}-{number}" for number in range(count)]
    for (campaign, _), folder in zip(made, folders, strict=True):
        if not folder.is_dir():
            _write_whole(folder, campaign)
    variants = [(None, 1.0), *((constant, factor) for constant in chosen for factor in FACTORS)]
    path, known = out / FILE, _read(out / FILE)
    progress.plan({"diagnose": float(len(variants) * count)})
    progress.stage("diagnose", total=len(variants) * count)
    for number, (constant, factor) in enumerate(variants):
        for k, said in _answers(constant, factor, kind, cases, folders, known):
            hidden = made[k][1]
            record = {
                "kind": kind, "case": cases[k], "constant": constant.id if constant else "", "factor": factor,
                "date": now(), "code": digest("code"), "suite": digest(kind), "truth": list(hidden.effects),
                "outside": hidden.outside, "signature": float(hidden.signature),
                **{name: said.get(name) for name in ("verdict", "effects", "alternatives", "cpu", "error")},
            }  # fmt: skip
            known[_key(kind, cases[k], record["constant"], factor)] = record
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")
            if record["verdict"] == "failed":
                progress.message(
                    f"the diagnosis of {folders[k]} failed {_setting(constant, factor)}: {_reason(record)}"
                )
            progress.update(number * count + k + 1)
        progress.update((number + 1) * count)
    rows = [[known[_key(kind, case, c.id if c else "", factor)] for case in cases] for c, factor in variants]
    text = table(chosen, rows)
    print(text)
    return {
        "format": "hedgebed-bench/1", "what": "constants", "kind": kind, "count": count, "seed": seed, "trials": trials,
        "date": now(), "code": digest("code"), "suite": digest(kind), "table": text,
    }  # fmt: skip


def _answers(
    constant: Constant | None, factor: float, kind: str, cases: Sequence[Json], folders: Sequence[Path],
    known: Mapping[str, Json],
) -> Iterator[tuple[int, Json]]:  # fmt: skip
    """The place of each campaign that has no record yet with this value, and what the diagnosis says of it."""
    id_ = constant.id if constant else ""
    left = [k for k, case in enumerate(cases) if _key(kind, case, id_, factor) not in known]
    if not left:
        return
    values = {id_: constant.times(factor)} if constant else {}
    with ProcessPoolExecutor(1, get_context("spawn"), begin_changed, (values,)) as pool:
        for k in left:
            yield k, pool.submit(answer, str(folders[k])).result()


def _write_whole(folder: Path, campaign: Campaign) -> None:
    """Write a campaign under a temporary name and rename it: a run that is killed leaves no half campaign."""
    unfinished = folder.with_name(f"{folder.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    write_campaign(unfinished, campaign)
    unfinished.rename(folder)


def _setting(constant: Constant | None, factor: float) -> str:
    return f"with {factor:g} times {constant.id}" if constant else "with the constants as they are"


def _reason(record: Json) -> str:
    """The last line of the traceback."""
    return (str(record["error"]).strip() or "no reason was given").splitlines()[-1]


def continues(out: Path) -> bool:
    """Whether `out` holds an unfinished or finished run of this benchmark, with which it goes on."""
    return (out / FILE).is_file()


def table(constants: Sequence[Constant], rows: Sequence[Sequence[Json]]) -> str:
    """Markdown: for each constant its value and source, and how many verdicts change and are right if it changes.

    `rows`: the records as they are, then halved and doubled for each constant.
    """
    base = rows[0]
    lines = [
        f"As they are: {_told(base)}, {sum(r['cpu'] for r in base):.0f} s of processor time.",
        "",
        "| constant | value | decides | from | halved | doubled |",
        "|---|---:|---|---|---|---|",
    ]
    for k, constant in enumerate(constants):
        told = []
        for changed in (rows[1 + 2 * k], rows[2 + 2 * k]):
            other = sum(_said(a) != _said(b) for a, b in zip(base, changed, strict=True))
            failed = any(r["verdict"] == "failed" for r in changed)
            told.append(f"{other} change: {_told(changed)}" if other or failed else "no change")
        cells = (f"`{constant.id}`", f"{constant.value():g}", constant.decides, constant.source, *told)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _said(record: Json) -> tuple[str, frozenset[str], frozenset[str]]:
    """Verdict and names, whose order does not count."""
    return record["verdict"], frozenset(record["effects"]), frozenset(record["alternatives"])


def _told(records: Sequence[Json]) -> str:
    """How many empty campaigns are none, effects are named, outside causes unknown, and diagnoses failed."""
    empty = [r for r in records if not r["truth"] and not r["outside"]]
    inside = [r for r in records if r["truth"]]
    outside = [r for r in records if r["outside"]]
    parts = (
        (sum(r["verdict"] == "none" for r in empty), len(empty), "`none`"),
        (sum(r["verdict"] == "named" and set(r["effects"]) == set(r["truth"]) for r in inside), len(inside), "named"),
        (sum(r["verdict"] == "unknown" for r in outside), len(outside), "`unknown`"),
    )
    failed = sum(r["verdict"] == "failed" for r in records)
    told = [f"{found} of {total} {word}" for found, total, word in parts if total]
    return ", ".join([*told, *([f"**{failed} of {len(records)} failed**"] if failed else [])])


def _read(path: Path) -> dict[str, Json]:
    """Records of the present code by `_key`; a last line that was cut short is left out.

    Raises ValueError for another line that is no record.
    """
    if not path.is_file():
        return {}
    data = path.read_bytes()
    if not data.endswith(b"\n"):
        path.write_bytes(data := data[: data.rfind(b"\n") + 1])
    found = {}
    for number, line in enumerate(data.splitlines(), 1):
        try:
            record = json.loads(line)
            if any(name not in record for name in _RECORD) or record["kind"] not in KINDS:
                raise ValueError("a record lacks a key or has an unknown kind")
        except (ValueError, TypeError):
            raise ValueError(
                f"{path}, line {number}: {line[:40]!r} was found, a record was expected. Remove the line"
            ) from None
        if record["code"] == digest("code") and record["suite"] == digest(record["kind"]):
            found[_key(record["kind"], record["case"], record["constant"], record["factor"])] = record
    return found


def _key(kind: str, case: Json, constant: str, factor: float) -> str:
    return json.dumps([kind, case, constant, factor], sort_keys=True)
