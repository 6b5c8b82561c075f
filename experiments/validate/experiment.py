"""`hedgebed validate`: runs the verification suite into a run folder, case by case; finished cases are kept.

Where several processes compute, each case is a run of its own below members/.

The result that docs/validation.md and docs/notes/validation.md are made of is kept in the checkout. Long cases need not
all be run in one go:
`hedgebed validate --only sink-from-rest --keep` puts its row into the table with its own date, command and code, and
leaves the others as they are.
"""

import json
import shutil
import time
import traceback
from collections.abc import Sequence
from datetime import date
from pathlib import Path
from typing import Any

from experiments.pool.tasks import Outcome as TaskOutcome
from experiments.pool.tasks import task_of
from experiments.pool.together import Planned, Where, run_all, whole_folder
from experiments.runs.folder import RunFolder, plain, write_text
from experiments.runs.progress import Progress
from experiments.runs.registry import find_experiment
from experiments.runs.result import Result, quantities_of
from experiments.runs.types import Json
from experiments.runs.whole_runs import draw_report
from experiments.validate.settings import ValidateSettings

from .base.case import Case, Outcome
from .pages import KEPT, RAN, UNCOUNTED, image, worst_of, write_pages
from .suite import SUITE, chosen, fingerprint, fingerprint_of

__all__ = ["check", "fingerprint", "keep", "resume", "run", "run_case"]

_ROOT = Path(__file__).resolve().parents[2]
_RECORD = ("status", "skipped", "comparisons", "plots", "remarks", "seconds", "date", "code")
"""What is kept of a case."""


def run(settings: ValidateSettings, folder: str | Path, *, progress: Progress | None = None) -> Result:
    """Run the suite into `folder` and return the result, as result.json has it. Raises ValueError as `check` does."""
    check(settings)
    kept = RunFolder.ensure(Path(folder), "validate", settings, code=fingerprint())
    return _carry_out(settings, kept, progress or Progress())


def resume(folder: str | Path, *, progress: Progress | None = None) -> Result:
    """Go on: cases that this code has finished are kept, others are run."""
    kept = RunFolder.open(Path(folder))
    return _carry_out(ValidateSettings(**kept.settings), kept, progress or Progress())


def check(settings: ValidateSettings) -> None:
    """Raise ValueError, naming key, value and remedy, for an unknown case or a file that cannot be written."""
    _wanted(settings)
    Where.of(settings).check()
    if settings.document is not None and not Path(settings.document).resolve().parent.is_dir():
        raise ValueError(f"document = {settings.document!r} lies in a folder that does not exist: make it first")
    if settings.keep and settings.document is not None:
        raise ValueError("keep = True is for a checkout's own table: leave document out")
    if settings.keep and not _is_checkout():
        raise ValueError(f"keep = True needs a checkout, with docs/ and pyproject.toml: {_ROOT} is none")


def _wanted(settings: ValidateSettings) -> list[Case]:
    return chosen(settings.only, quick=settings.quick, held=settings.measured)


def run_case(case: Case, tell: Any = None) -> tuple[Outcome, float]:
    """What a case finds, and the time it took [s]; an error of the bed is a failure of the case."""
    if case.compute is None:
        raise ValueError(f"case {case.id!r} cannot be run yet: it waits for {case.waits_for}")
    began = time.monotonic()
    try:
        found = case.compute(tell or (lambda done: None))
    except Exception as error:  # the others go on
        found = Outcome(remarks=[f"It ended with {type(error).__name__}: {error}", traceback.format_exc(limit=-3)])
    return found, time.monotonic() - began


def _carry_out(settings: ValidateSettings, folder: RunFolder, progress: Progress) -> Result:
    wanted = _wanted(settings)
    with folder.lock():
        done = {case: folder.done_data(case.id) for case in wanted if case.compute and folder.is_done(case.id)}
        records = {case.id: record for case, record in done.items() if record["code"] == fingerprint_of(case)}
        left = [case for case in wanted if case.compute and case.id not in records]
        where = Where.of(settings)
        progress.plan({case.title: case.seconds for case in left})
        if where.scheduler is None and where.processes([case.seconds for case in left]) == 1:
            for case in left:
                progress.stage(case.title, total=1.0)
                records[case.id] = _told(case, _record(folder, case, progress), progress)
        else:
            records |= _elsewhere(left, folder, where, progress)
        entire = not (settings.only or settings.quick or settings.measured)
        result = _result([_row(case, records.get(case.id)) for case in SUITE], entire)
        folder.write_result(result)
        write_pages(folder.path / "validation.md", result, command=_command(settings))
        draw_report(folder, progress)
        if settings.document is not None:
            write_pages(Path(settings.document), result, command=_command(settings))
        elif entire and _is_checkout():
            kept: Json = plain(result)
            kept["cases"] = [_illustrated(row, folder.path) for row in kept["cases"]]
            write_pages(_ROOT / "docs" / "validation.md", kept, command=_command(settings))
            _keep_result(kept)
        elif settings.keep:
            keep([_illustrated(row, folder.path) for row in result["cases"]])
        return result


def _elsewhere(left: Sequence[Case], folder: RunFolder, where: Where, progress: Progress) -> dict[str, Json]:
    """The records of cases that are each a run of its own, in members/ of the folder, computed beside one another.

    Raises RuntimeError for a case whose run failed, after the others, which are kept.
    """
    experiment, records = find_experiment("validate"), dict[str, Json]()
    planned = {
        case: Planned(
            task_of(experiment, ValidateSettings(only=(case.id,)), folder.path / "members"), case.id, case.seconds
        )
        for case in left
    }

    def take(outcomes: Sequence[TaskOutcome]) -> None:
        over = {outcome.name: outcome for outcome in outcomes if not outcome.fault}
        for case, one in planned.items():
            if one.task.name in over:
                record = _record_of(case, json.loads(over[one.task.name].result))
                series = [plot["series"] for plot in record["plots"]]
                home = whole_folder(one.task, *series)
                for name in series:
                    (folder.path / name).parent.mkdir(exist_ok=True)
                    shutil.copyfile(home / name, folder.path / name)
                records[case.id] = _told(case, _kept(folder, case, record), progress)

    outcomes = run_all(list(planned.values()), where=where, progress=progress, on_outcomes=take)
    if faults := [outcome for outcome in outcomes.values() if outcome.fault]:
        raise RuntimeError(f"{len(faults)} cases have no result, as {faults[0].name}: {faults[0].fault}")
    return records


def _record_of(case: Case, result: Json) -> Json:
    """The record of a case in the result of a run of it alone."""
    (row,) = (row for row in result["cases"] if row["id"] == case.id)
    status = "fail" if row["status"] == "informational" else row["status"]
    return {key: row[key] for key in _RECORD} | {"status": status}


def _told(case: Case, record: Json, progress: Progress) -> Json:
    """Return the record after showing a line of it."""
    progress.message(": ".join(filter(None, (f"{record['status']:>7}  {case.id}", _line(record)))))
    return record


def _illustrated(row: Json, folder: Path) -> Json:
    """The row with the titles of its figures, where it is of an experiment: they are copied beside the table."""
    if not (row.get("measured") and row.get("plots")):
        return row
    (_ROOT / "docs" / "images").mkdir(exist_ok=True)
    for k in range(1, len(row["plots"]) + 1):
        shutil.copyfile(folder / "figures" / f"{row['id']}-{k}.png", _ROOT / "docs" / image(row["id"], k))
    return row | {"images": [plot["title"] for plot in row["plots"]]}


def _record(folder: RunFolder, case: Case, progress: Progress) -> Json:
    """Run a case; its record, kept unless it was skipped."""
    found, seconds = run_case(case, progress.update)
    plots = []
    for k, plot in enumerate(found.plots, 1):
        named = [(curve.label.replace(",", ";"), curve) for curve in plot.curves]
        points = [(n, float(x), float(y)) for n, curve in named for x, y in zip(curve.x, curve.y, strict=True)]
        columns = dict(zip(("curve", "x", "y"), zip(*points, strict=True), strict=True))
        about = {"title": plot.title, "x": plot.x, "y": plot.y, "log": plot.log}
        about["series"] = folder.write_series(f"{case.id}-{k}", columns)
        plots.append(about | {"lines": [name for name, curve in named if not curve.ours]})
    record = {
        "status": found.status,
        "skipped": found.skipped,
        "comparisons": [one.as_dict() for one in found.comparisons],
        "plots": plots,
        "remarks": list(found.remarks),
        "seconds": seconds,
        "date": date.today().isoformat(),
        "code": fingerprint_of(case),
    }
    return _kept(folder, case, record)


def _kept(folder: RunFolder, case: Case, record: Json) -> Json:
    """The record, kept unless the case was skipped."""
    if record["status"] != "skipped":
        folder.mark_done(case.id, record)
    return record


def _line(record: Json) -> str:
    """What is worth a line while it runs."""
    if worst := worst_of(record["comparisons"]):
        return f"{worst['quantity']} {worst['ours']:.5g}, wanted {worst['reference']:.5g}"
    return record["skipped"] or next(iter(record["remarks"]), "")


def _row(case: Case, record: Json | None) -> Json:
    if record is None:
        return case.head()
    status = case.counted(record["status"])
    reason = case.reason if status in UNCOUNTED else ""
    return case.about() | record | {"status": status, "reason": reason, "worst": worst_of(record["comparisons"])}


STATUSES = ("pass", "fail", "informational", "skipped", "not run", "not yet")


def _result(rows: list[Json], entire: bool) -> Result:
    counts = {status: sum(row["status"] == status for row in rows) for status in STATUSES}
    words = [f"{counts['pass']} pass", f"{counts['fail']} fail"]
    words += [f"{counts[key]} {key}" for key in STATUSES[2:] if counts[key]]
    sentences = []
    for row in rows:
        if row["status"] == "fail":
            what, worst = "it ended with an error", row["worst"]
            if worst:
                what = f"{worst['quantity']} is {worst['ours']:.4g}, {worst['reference']:.4g} was wanted"
            sentences.append(f"{row['id']} fails: {what}{f' ({reason})' if (reason := row['reason']) else ''}")
    sentences += [f"{row['id']} is skipped: {row['skipped']}" for row in rows if row["status"] == "skipped"]
    return Result.make(
        "validate",
        code=fingerprint(),
        title=f"Verification of the bed: {', '.join(words)}",
        entire=entire,
        date=date.today().isoformat(),
        quantities=quantities_of({f"cases_{key.replace(' ', '_')}": (n, "1", "") for key, n in counts.items()}),
        cases=rows,
        departures={"sentences": sentences},
        warnings=[] if entire else ["not the whole suite: see which cases were not run"],
    )


def _is_checkout() -> bool:
    """Whether this code lies in a checkout, with a table to be kept up."""
    return (_ROOT / "docs").is_dir() and (_ROOT / "pyproject.toml").is_file()


def keep(cases: Sequence[Json]) -> None:
    """Put the cases that were run into the checkout's table, docs/validation.md, and the result that it is made of.

    Each case of the suite has a row: the new one, the earlier one, or what is known of a case that was not run. A row
    has the command that runs its case alone; run with others the case gives equal numbers. Titles, sources and reasons
    are those of the present cases.toml. Without `cases` nothing else changes
    (``python -m experiments.validate.experiment``).
    """
    path = _ROOT / KEPT
    before = dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None
    now = [dict(row) | {"command": f"hedgebed validate --only {row['id']}"} for row in cases]
    known = {row["id"]: row for row in [*(before["cases"] if before else ()), *now] if row["status"] in RAN}
    rows = [known[case.id] | case.about() if case.id in known else case.head() for case in SUITE]
    for case, row in zip(SUITE, rows, strict=True):
        row["status"] = case.counted(row["status"])
        if row["status"] in UNCOUNTED:
            row["reason"] = case.reason or row.get("reason", "")
    result: Json = plain(_result(rows, before is not None))
    if before is not None:
        result |= {key: before[key] for key in ("version", "code", "date")}
    _keep_result(result)
    write_pages(_ROOT / "docs" / "validation.md", result, command="hedgebed validate")


def _keep_result(result: Json) -> None:
    """In the checkout, without what its plots are drawn from (that is in the run folder)."""
    slim = {key: value for key, value in result.items() if key not in ("departures", "warnings")}
    slim["cases"] = [{key: value for key, value in row.items() if key != "plots"} for row in result["cases"]]
    (_ROOT / KEPT).parent.mkdir(parents=True, exist_ok=True)
    write_text(_ROOT / KEPT, json.dumps(slim, indent=0) + "\n")


def _command(settings: ValidateSettings) -> str:
    only = ["--only", *settings.only] if settings.only else []
    given = [f"--{word}" for word, on in (("quick", settings.quick), ("measured", settings.measured)) if on]
    return " ".join(["hedgebed validate", *only, *given])


if __name__ == "__main__":
    keep(())
