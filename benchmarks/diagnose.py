"""`hedgebed bench diagnose`: campaigns with something hidden in them, diagnosed; what was named, what was missed.

    hedgebed bench diagnose [--kind penetration|tumble|rig|both|all|second-push|second-rig|second-tumble|second|
                                    mujoco-tumble]
                            [--count 40] [--seed 1] [--only WHAT] [--trials N] [--structure STD] [--baselines yes|no]
                            [--out DIR]

The campaigns are those of `hidden_suite`. Each is written to a folder, and a process of its own that is given that
folder and nothing else diagnoses it. DIR/cases.jsonl keeps every verdict: the same command with the same DIR goes on
where it was stopped. A campaign is diagnosed again only where the code of the diagnosis or of the suite has changed
since. With ``pip install .[bench]`` the baselines (`benchmarks/baseline/`) get the same campaigns.
"""

import ast
import hashlib
import json
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from experiments.campaign import read_campaign, write_campaign
from experiments.runs.progress import Progress
from experiments.runs.types import Json

from .baseline import methods as others
from .diagnosis.table import CASES_FILE, read_cases, show, summarise
from .diagnosis.worker import answer, begin, limit
from .hidden.suite import KINDS, make_case, suite
from .race.machine import now
from .race.scratch import scratch
from .second.campaigns import KINDS as SECOND

__all__ = ["continues", "digest", "read_cases", "run"]

Ask = Callable[[str], Json]
Limit = Callable[[dict[str, dict[str, NDArray[np.float64]]]], Json]
_ROOT = Path(__file__).resolve().parent.parent
_CODE = {
    "code": ("experiments/diagnose", "experiments/campaign", "rigid"),
    **dict.fromkeys(
        ("penetration", "tumble"),
        ("benchmarks/hidden/penetration.py", "benchmarks/hidden/tumble.py", "benchmarks/hidden/tumble_motion.py"),
    ),
    "rig": ("benchmarks/hidden/rig.py", "benchmarks/hidden/rig_bed.py"),
    **dict.fromkeys(SECOND, ("benchmarks/second",)),
    "mujoco-tumble": ("benchmarks/second", "benchmarks/soft"),
    "baselines": ("benchmarks/baseline/methods.py", "benchmarks/baseline/residuals.py"),
}
_SECRET = (*SECOND, "mujoco-tumble")  # kinds whose maker keeps a `benchmarks.second.drawing.Secret`
_SEVERAL = {"both": ("penetration", "tumble"), "all": ("penetration", "tumble", "rig"), "second": tuple(SECOND)}


def run(
    out: Path, *, progress: Progress, kind: str = "both", count: int = 40, seed: int = 1, only: str = "",
    trials: int = 0, structure: str = "", baselines: str = "yes", ask: Ask | None = None,
) -> Json:  # fmt: skip
    """Make, diagnose and count.

    Args:
        out: folder of cases.jsonl, which grows as it goes, and is where it goes on.
        progress: what is done, and how long it has to go.
        kind: of campaigns: penetration, tumble, rig (penetrations of another maker), both (the first two) or all
            three; second-push, second-rig, second-tumble or second (all three of the second simulator). Or
            mujoco-tumble, tumbles that MuJoCo moves.
        count: campaigns of each kind.
        seed: of the suite.
        only: hide this in every campaign; empty: the suite's mixture.
        trials: of every campaign; 0: 6 to 24.
        structure: of the second simulator's campaigns, how much what the base model leaves out of it changes, over the
            noise; empty: each campaign draws its own.
        baselines: "yes" where the baselines are to run beside, if they are installed; "no".
        ask: what answers for a folder; None: the diagnosis, in a process of its own, which is then asked for the
            numbers that readings without noise give, too (`limit`).

    Raises ValueError for settings that cannot be.
    """
    if kind not in (*KINDS, *_SEVERAL):
        raise ValueError(f"kind = {kind!r}: {', '.join(KINDS)}, both, all or second was expected")
    if count < 1:
        raise ValueError(f"count = {count}: at least 1 was expected")
    if trials and not 4 <= trials <= 100:
        raise ValueError(f"trials = {trials}: 0 (6 to 24), or 4 to 100, was expected")
    if baselines not in ("yes", "no"):
        raise ValueError(f"baselines = {baselines!r}: yes or no was expected")
    if kind == "mujoco-tumble" and find_spec("mujoco") is None:
        raise ValueError("kind = 'mujoco-tumble': MuJoCo is not installed (pip install 'hedgebed[mujoco]')")
    kinds, size = _SEVERAL.get(kind, (kind,)), _size(structure)
    plans = {
        one: suite(one, count, seed=seed, only=only or None, trials=trials or None, structure=size) for one in kinds
    }
    missing = others.missing() if baselines == "yes" else ""
    if missing:
        progress.message(missing)
    wanted = baselines == "yes" and not missing
    progress.plan({f"diagnose {one}": float(count) for one in kinds})
    path = out / CASES_FILE
    if path.is_file() and not (data := path.read_bytes()).endswith(b"\n"):  # a process ended while it wrote a line
        path.write_bytes(data[: data.rfind(b"\n") + 1])
    done = {
        _key(case["kind"], case["case"]): case
        for case in read_cases(out)
        if case.get("code") == digest("code") and case.get("suite") == digest(case["kind"])
    }
    with _asking(ask) as (asked, limited):
        for one, cases in plans.items():
            left = [case for case in cases if not _finished(done.get(_key(one, case)), wanted)]
            progress.stage(f"diagnose {one}", total=max(len(left), 1))
            if len(left) < len(cases):
                progress.message(f"{one}: {len(cases) - len(left)} of {len(cases)} campaigns were done before")
            for number, case in enumerate(left, 1):
                done[_key(one, case)] = record = _one(
                    one, case, asked, limited, before=done.get(_key(one, case)), wanted=wanted
                )  # fmt: skip
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(record) + "\n")
                progress.message(_line(record))
                progress.update(number)
    result: Json = {
        "format": "hedgebed-bench/1", "what": "diagnose", "seed": seed, "count": count, "date": now(),
        "code": digest("code"), "suite": " ".join(sorted({digest(one) for one in kinds})),
        "baselines": missing or baselines,
    }  # fmt: skip
    for one, cases in plans.items():
        result[one] = summarise([done[_key(one, case)] for case in cases])
        show(one, result[one])
    return result


def _size(structure: str) -> float | None:
    """The option `structure` as a number; None where it is empty. Raises ValueError for what is no such number."""
    try:
        size = float(structure) if structure else None
    except ValueError:
        size = math.nan
    if size is not None and not 0.0 < size <= 10.0:
        raise ValueError(f"structure = {structure!r}: a number above 0 and up to 10 was expected")
    return size


def continues(out: Path) -> bool:
    """Whether `out` holds an unfinished or finished run of this benchmark, with which it goes on."""
    return (out / CASES_FILE).is_file()


@cache
def digest(what: str) -> str:
    """Of the sources behind a record: "code" that diagnoses, a kind of campaigns that are made up, or "baselines".

    What is said about the code (comments, docstrings, how its lines are broken) does not count.
    """
    told = hashlib.sha256()
    for place in _CODE[what]:
        path = _ROOT / place
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            told.update(_bare(file.read_text(encoding="utf-8")).encode())
    return told.hexdigest()[:12]


def _bare(source: str) -> str:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(body := vars(node).get("body"), list):  # strings that stand alone are docstrings
            node.body = [one for one in body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _one(kind: str, case: Json, ask: Ask, limited: Limit | None, *, before: Json | None, wanted: bool) -> Json:
    """One record; `before` is one that lacks the baselines only."""
    campaign, hidden = make_case(kind, case)
    record = before
    with scratch() as place:
        folder = write_campaign(place / "campaign", campaign)
        said = ask(str(folder)) if record is None else {}
        if limited is not None and record is None and kind in SECOND and hidden.readings:
            said["limit"] = limited(hidden.readings)
        campaign = read_campaign(folder)  # in the format's units
    if record is None:
        record = {
            "kind": kind, "case": case, "date": now(), "code": digest("code"), "suite": digest(kind),
            "truth": list(hidden.effects), "outside": hidden.outside, "signature": float(hidden.signature),
            "true_parameters": hidden.parameters if kind in ("tumble", *_SECRET) else {},
            "coloured": bool(hidden.coloured), "trials": len(campaign.tables.trial),
            **({"hidden": hidden.extra} if kind in ("rig", *_SECRET) else {}),
        } | said  # fmt: skip
    if wanted and "base_values" in record:
        with threadpool_limits(1):
            told = others.try_all(campaign, record["base_values"], record["fitted"], record["held_out"])
        record = record | {"baselines": {"code": digest("baselines"), **told}}
    return record


def _finished(record: Json | None, wanted: bool) -> bool:
    if record is None:
        return False
    tried = record.get("baselines", {}).get("code") == digest("baselines")
    return tried or not wanted or "base_values" not in record


def _key(kind: str, case: Json) -> str:
    return json.dumps([kind, case], sort_keys=True)


def _line(record: Json) -> str:
    truth = " + ".join(record["truth"]) or record["outside"] or "nothing"
    said = " + ".join(record["effects"]) + "".join(f" or {name}" for name in record["alternatives"])
    return (
        f"{record['kind']} {record['case']['seed']}: {truth} ({record['signature']:.2g}), {record['trials']} trials: "
        f"{record['verdict']} {said} in {record['seconds']:.0f} s"
    )


@contextmanager
def _asking(ask: Ask | None) -> Iterator[tuple[Ask, Limit | None]]:
    """What answers for a folder: one process that goes on from case to case, a new one where it broke down; and what
    then answers for readings without noise."""
    if ask is not None:
        yield ask, None
        return
    pools: list[ProcessPoolExecutor] = []

    def asked(folder: str) -> Json:
        if not pools:
            pools.append(ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=begin))
        try:
            return pools[0].submit(answer, folder).result()
        except BrokenProcessPool as error:
            pools.clear()
            return {"verdict": "failed", "effects": [], "alternatives": [], "error": str(error), "seconds": 0.0,
                    "cpu": 0.0}  # fmt: skip

    def limited(readings: dict[str, dict[str, NDArray[np.float64]]]) -> Json:
        return pools[0].submit(limit, readings).result() if pools else {"error": "the process broke down"}

    try:
        yield asked, limited
    except BaseException:  # stopped: do not wait for the diagnosis under way
        for child in active_children():
            child.kill()
        raise
    finally:
        for pool in pools:
            pool.shutdown(cancel_futures=True)
