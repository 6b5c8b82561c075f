"""`hedgebed experiments list`, `run` and `sinking`: the platform's experiments on grains, as named cases that ship."""

import json as json_module
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

from experiments.pool.tasks import Outcome
from experiments.pool.together import Planned, Where, run_all, whole_folder
from experiments.runs.progress import duration, make_progress
from experiments.runs.streams import file_words, refusing, say, stdout_to_stderr
from experiments.runs.strict import Scheduler, Workers, described
from experiments.runs.types import Json
from experiments.suite.cases import EXPERIMENTS, KEPT, LONGEST, Case, cases, estimate, keep, planned, standing
from experiments.tumble.footfalls import Footfall, sinking_over
from rigid.result import read_result

__all__ = ["add_suite_commands"]

RESULTS, WORK = Path("docs/results"), Path("runs/experiments")
_Names = Annotated[
    tuple[str, ...],
    Parameter(help="Names of cases, or the beginnings of names; all if not given.", negative="", show_default=False),
]
_Results = Annotated[
    Path, Parameter(help="Folder of the kept results; each case has its own folder in it.", negative="")
]
_Work = Annotated[Path, Parameter(help="Folder of the runs; each case has its own run folder in it.", negative="")]


def add_suite_commands(home: App) -> None:
    """Add the commands to ``hedgebed experiments``."""
    home.command(_list, name="list")
    home.command(_run, name="run")
    home.command(_sinking, name="sinking")


def _list(
    names: _Names = (),
    /,
    *,
    results: _Results = RESULTS,
    work: _Work = WORK,
    json: Annotated[bool, Parameter(help="Print it as JSON on stdout and nothing else.", negative="")] = False,
) -> int:
    """List the cases: what each costs on two quiet cores by an estimate, and whether it has a result."""
    with refusing(), stdout_to_stderr():
        rows = [_row(case, results, work) for case in cases(names)]
    if json:
        print(json_module.dumps(rows, indent=2))
        return 0
    console = Console(file=sys.stdout, highlight=False)
    for number, title in EXPERIMENTS.items():
        own = [row for row in rows if row["experiment"] == number]
        if not own:
            continue
        console.print(f"{number}  {title}", markup=False, style="italic")
        table = Table(box=None, pad_edge=False)
        for heading in ("case", "standing", "grains", "bed", "run"):
            table.add_column(heading, justify="left" if heading in ("case", "standing") else "right", no_wrap=True)
        for row in own:
            table.add_row(row["case"], row["standing"], *row["words"])
        console.print(table, markup=False)
        for sentence in dict.fromkeys(row["why"] for row in own if row["why"]):
            console.print(f"- {sentence}", markup=False)
    return 0


def _row(case: Case, results: Path, work: Path) -> Json:
    found, (stands, why) = estimate(case, results), standing(case, results, work)
    row: Json = {"case": case.name, "experiment": case.experiment, "standing": stands, "why": why}
    if isinstance(found, str):
        return row | {"standing": "done" if stands == "done" else "not yet", "why": found, "words": ["", "", ""]}
    if stands == "to do" and found.seconds > LONGEST:
        why = "too long: more than an hour by its estimate; done only where it is named"
        row |= {"standing": "too long", "why": why}
    numbers = {
        "grains": round(found.grains), "time_step": found.time_step, "grain_steps": found.grain_steps,
        "grain_steps_from": "result" if found.kept else "estimate",
        "bed_seconds": found.bed_seconds, "run_seconds": found.run_seconds,
    }  # fmt: skip
    words = [f"{round(found.grains, -2):,.0f}", duration(found.bed_seconds), duration(found.run_seconds)]
    return row | numbers | {"words": words}


def _run(
    names: _Names = (),
    /,
    *,
    results: _Results = RESULTS,
    work: _Work = WORK,
    workers: Annotated[int | None, Parameter(help=described(Workers), negative="")] = None,
    scheduler: Annotated[str | None, Parameter(help=described(Scheduler), negative="")] = None,
    quiet: Annotated[bool, Parameter(help="Show no progress.", negative="")] = False,
) -> int:
    """Run the cases that have no result yet; stopped ones continue, beds come from the cache.

    A case that would take more than an hour by its estimate, or cannot be run yet, is left out unless its full name is
    given.
    """
    where = Where.of(Where(scheduler, workers))
    with refusing(), stdout_to_stderr():
        where.check()
        chosen = [(case, _row(case, results, work)) for case in cases(names)]
    failed: list[str] = []
    todo: dict[str, Planned] = {}
    for case, row in chosen:
        if row["standing"] in ("done", "not yet") or (row["standing"] == "too long" and case.name not in names):
            say(f"{case.name}: {row['standing']}{': ' + row['why'] if row['standing'] == 'not yet' else ''}")
        elif row["standing"] == "failed" and case.name not in names:
            say(f"{case.name}: failed before ({row['why']}); give its full name to continue it")
            failed.append(case.name)
        else:
            if row["standing"] == "to do" and row["why"]:
                say(f"{case.name}: {row['why']}")
            one = planned(case, results, work)
            todo[one.task.name] = one

    def take(outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            name = todo[outcome.name].words
            if outcome.fault:
                failed.append(f"{name} ({outcome.fault})")
            else:
                keep(whole_folder(todo[outcome.name].task, *KEPT), results / name)
                say(f"{name}: kept in {results / name}")

    with refusing(), stdout_to_stderr(), make_progress(quiet=quiet) as progress:
        try:
            run_all(list(todo.values()), where=where, progress=progress, on_outcomes=take, report=0.0)
        except KeyboardInterrupt:
            say("stopped; the same command continues")
            return 3
        except (OSError, RuntimeError) as error:
            said = file_words(error, f"a file below {work} or {results}") if isinstance(error, OSError) else error
            say(f"failed: {said}; the same command continues")
            return 1
    if failed:
        say(f"without a result: {', '.join(failed)}")
    return 1 if failed else 0


def _sinking(names: _Names = (), /, *, results: _Results = RESULTS) -> int:
    """State whether the platform sinks further with each of several tumbles in a row, from the kept results.

    Cases that differ only in the seed of their bed are one group, and each group has its verdict.
    """
    groups: dict[str, dict[str, list[Footfall]]] = {}
    with refusing(), stdout_to_stderr():
        for case in cases(names):
            kept = results / case.name / "result.json"
            if kept.exists() and (falls := read_result(kept).get("footfalls")):
                group = case.name.removesuffix(f"-seed{case.settings.seed}")
                groups.setdefault(group, {})[case.name] = [Footfall(**fall) for fall in falls]
    for group, beds in groups.items():
        for name, falls in beds.items():
            depths = " ".join(f"{1e3 * fall.deepest:.1f}{'' if fall.counts else '*'}" for fall in falls)
            print(f"{name}: {depths} mm")
        found = sinking_over(list(beds.values()))
        print(f"{group}: {found.verdict if found else 'too few rows came down for a verdict'}")
    if not groups:
        say(f"no case of several tumbles has a result in {results}: `hedgebed experiments run grains3` makes them")
        return 1
    print("* during the placement, or still going down at the end: not used in the fit")
    return 0
