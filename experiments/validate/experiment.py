"""`hedgebed validate`: runs the verification suite into a run folder, case by case; finished cases are kept.

The result that docs/validation.md is made of is kept in the checkout. Long cases need not all be run in one go:
`hedgebed validate --only sink-from-rest --keep` puts its row into the table with its own date, command and code, and
leaves the others as they are.
"""

import json
import math
import shutil
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from itertools import groupby
from pathlib import Path
from typing import Any

from experiments.runs.folder import RunFolder, plain, write_text
from experiments.runs.progress import Progress
from experiments.runs.result import Result, quantities_of
from experiments.runs.types import Json
from experiments.validate.settings import ValidateSettings

from .base.case import Case, Outcome
from .suite import SUITE, chosen, fingerprint, fingerprint_of

__all__ = ["check", "fingerprint", "keep", "markdown", "resume", "run", "run_case"]

_ROOT = Path(__file__).resolve().parents[2]
_KEPT = Path("docs/results/validate/result.json")


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
    """Raise ValueError, naming key, value and what would do, for an unknown case or a file that cannot be written."""
    _wanted(settings)
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
        progress.plan({case.title: case.seconds for case in left})
        for case in left:
            progress.stage(case.title, total=1.0)
            record = _record(folder, case, progress)
            progress.message(": ".join(filter(None, (f"{record['status']:>7}  {case.id}", _line(record)))))
            records[case.id] = record
        entire = not (settings.only or settings.quick or settings.measured)
        result = _result([_row(case, records.get(case.id)) for case in SUITE], entire)
        folder.write_result(result)
        text = markdown(result, command=_command(settings))
        write_text(folder.path / "validation.md", text)
        progress.stage("report", total=1.0)
        from vis.bed.validation import write_validation_report

        write_validation_report(folder.path, progress=progress.update)
        if settings.document is not None:
            write_text(Path(settings.document), text)
        elif entire and _is_checkout():
            kept: Json = plain(result)
            kept["cases"] = [_illustrated(row, folder.path) for row in kept["cases"]]
            write_text(_ROOT / "docs" / "validation.md", markdown(kept, command=_command(settings)))
            _keep_result(kept)
        elif settings.keep:
            keep([_illustrated(row, folder.path) for row in result["cases"]])
        return result


def _illustrated(row: Json, folder: Path) -> Json:
    """The row with the titles of its figures, where it is of an experiment: they are copied beside the table."""
    if not (row.get("measured") and row.get("plots")):
        return row
    (_ROOT / "docs" / "images").mkdir(exist_ok=True)
    for k in range(1, len(row["plots"]) + 1):
        shutil.copyfile(folder / "figures" / f"{row['id']}-{k}.png", _ROOT / "docs" / _image(row["id"], k))
    return row | {"images": [plot["title"] for plot in row["plots"]]}


def _image(case: str, number: int) -> str:
    """Of a figure of a case, from docs/ on."""
    return f"images/validate-{case}-{number}.png"


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
    if found.status != "skipped":
        folder.mark_done(case.id, record)
    return record


def _line(record: Json) -> str:
    """What is worth a line while it runs."""
    if worst := worst_of(record["comparisons"]):
        return f"{worst['quantity']} {worst['ours']:.5g}, wanted {worst['reference']:.5g}"
    return record["skipped"] or next(iter(record["remarks"]), "")


def worst_of(comparisons: Sequence[Json]) -> Json | None:
    """The comparison that takes the largest share of its band."""
    return max(comparisons, key=lambda one: math.inf if one["share"] is None else one["share"], default=None)


def _row(case: Case, record: Json | None) -> Json:
    if record is None:
        return case.head()
    status = case.counted(record["status"])
    reason = case.reason if status in _OUTSIDE else ""
    return case.about() | record | {"status": status, "reason": reason, "worst": worst_of(record["comparisons"])}


STATUSES = ("pass", "fail", "informational", "skipped", "not run", "not yet")
_OUTSIDE = ("fail", "informational")


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

    A row for each case of the suite: as run now, or as it was before, or what is known of one that was not run. A row
    has the command that runs its case alone: with others it comes to the same.
    """
    path = _ROOT / _KEPT
    before = dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None
    now = [dict(row) | {"command": f"hedgebed validate --only {row['id']}"} for row in cases]
    known = {row["id"]: row for row in [*(before["cases"] if before else ()), *now] if row["status"] in _RAN}
    rows = [
        case.about() | known[case.id] | {"family": case.family} if case.id in known else case.head() for case in SUITE
    ]
    for case, row in zip(SUITE, rows, strict=True):
        row["status"] = case.counted(row["status"])
        if row["status"] in _OUTSIDE:
            row["reason"] = case.reason or row.get("reason", "")
    result: Json = plain(_result(rows, before is not None))
    if before is not None:
        result |= {key: before[key] for key in ("version", "code", "date")}
    _keep_result(result)
    write_text(_ROOT / "docs" / "validation.md", markdown(result, command="hedgebed validate"))


def _keep_result(result: Json) -> None:
    """In the checkout, without what its plots are drawn from (that is in the run folder)."""
    slim = {key: value for key, value in result.items() if key not in ("departures", "warnings")}
    slim["cases"] = [{key: value for key, value in row.items() if key != "plots"} for row in result["cases"]]
    (_ROOT / _KEPT).parent.mkdir(parents=True, exist_ok=True)
    write_text(_ROOT / _KEPT, json.dumps(slim, indent=0) + "\n")


_RAN = ("pass", "fail", "informational")


def _command(settings: ValidateSettings) -> str:
    only = ["--only", *settings.only] if settings.only else []
    given = [f"--{word}" for word, on in (("quick", settings.quick), ("measured", settings.measured)) if on]
    return " ".join(["hedgebed validate", *only, *given])


MARKS = {"fail": "**FAIL**", "informational": "outside, informational"}


def _cells(row: Mapping[str, Any]) -> str:
    """What was wanted, ours, difference and band: in per cent of the reference, or in the unit."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    scale, sign = (100, " %") if row["relative"] else (1, "")
    wanted, ours = ("–" if row[key] is None else f"{row[key]:.5g}{unit}" for key in ("reference", "ours"))
    difference, band = "not a number", f"±{scale * row['band']:.2g}{sign}"
    if row["difference"] is not None:
        size = abs(row["reference"]) if row["relative"] else 1
        difference = f"{scale * row['difference'] / size:+.2g}{sign}"
    return f"{wanted} | {ours} | {difference} | {band}"


def markdown(result: Mapping[str, Any], *, command: str) -> str:
    """docs/validation.md from the result: one row a case, then what lies behind each row."""
    return "\n".join(_lines_of(result, command)) + "\n"


def _lines_of(result: Mapping[str, Any], command: str) -> Iterator[str]:
    yield "# Verification of the bed"
    yield ""
    about = f"version {result['version']}, code {result['code']}"
    yield f"Written by `{command}` on {result['date']} ({about}); do not edit."
    alone = any(row.get("command") for row in result["cases"])
    since = " Cases that were run by themselves since say when and with which code." if alone else ""
    yield f"{result['title'].partition(': ')[2].capitalize()}.{since}"
    yield ""
    yield "A row shows the number of its case that takes the largest share of its band; its other numbers are below."
    yield "A case that fails stays here as failing, with what is known of the reason."
    yield ""
    yield "| case | what | closed form or figure | source | wanted | ours | difference | band | |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in result["cases"]:
        yield _overview(row)
    yield from _failing(result)
    ran = (row for row in result["cases"] if row["status"] in _RAN)
    for family, rows in groupby(ran, key=lambda row: row["family"]):
        yield from ("", f"## {family}")
        for row in rows:
            yield from _details(row)


def _overview(row: Mapping[str, Any]) -> str:
    cells = _cells(row["worst"]) if row.get("worst") else "– | – | – | –"
    why = "" if row.get("worst") else row.get("waits_for") or row.get("skipped") or ""
    mark = ": ".join(filter(None, (MARKS.get(row["status"], row["status"]), why)))
    return f"| {row['id']} | {row['title']} | {row['reference']} | {row['source']} | {cells} | {mark} |"


def _failing(result: Mapping[str, Any]) -> Iterator[str]:
    for status, title in zip(_OUTSIDE, ("What fails, and why", "Outside, and not counted"), strict=True):
        rows = [row for row in result["cases"] if row["status"] == status]
        if rows:
            yield from ("", f"## {title}", "")
        for row in rows:
            beyond = sum(not one["passes"] for one in row["comparisons"])
            why = row["reason"] or "not looked into yet"
            yield f"- **{row['id']}** ({beyond} of {len(row['comparisons'])} numbers): {why}."


def _details(row: Mapping[str, Any]) -> Iterator[str]:
    yield from ("", f"### {row['id']}: {row['title']}", "")
    by = f" by `{row['command']}`, code {row['code']}" if row.get("command") else ""
    yield f"{row['reference']} ({row['source']}). Run on {row['date']}{by}, {row['seconds']:.0f} s."
    for remark in row["remarks"]:
        yield from ("", remark)
    for k, title in enumerate(row.get("images", ()), 1):
        yield from ("", f"![{title}]({_image(row['id'], k)})")
    if len(row["comparisons"]) > 1:
        yield from ("", "| number | wanted | ours | difference | band | |", "|---|---|---|---|---|---|")
        for one in row["comparisons"]:
            yield f"| {one['quantity']} | {_cells(one)} | {'pass' if one['passes'] else '**FAIL**'} |"
