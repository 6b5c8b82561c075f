"""The platform's experiments on grains: which cases there are, what each costs, which have a result; doing the rest.

A case is a TOML file in experiments/cases/grains, named after the experiment that it belongs to. Its result is done
once docs/results/<case>/ holds result.json; what is under way is a run folder below `work`, which is gone on with. Each
is a process of its own, so that one that fails or is stopped leaves the others alone.
"""

import functools
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.runs.folder import read_json, write_json
from experiments.runs.reading import read_case, settings_from
from experiments.runs.registry import CASES
from experiments.tumble.settings import TumbleSettings

from .cost import Cost, cost_of_tumble

__all__ = ["KEPT", "LONGEST", "Case", "EXPERIMENTS", "cases", "do_case", "estimate", "keep", "standing"]

LONGEST = 3600.0
"""A case that is estimated to take longer on two cores [s] is done only where it is named."""
KEPT = ("run.toml", "result.json", "trajectory.csv")
"""What of a run folder is kept as a result."""
MOST_ROWS = 2000
"""Rows of trajectory.csv that are kept, evenly thinned: a repository is no archive."""
EXPERIMENTS = {
    1: "the paper's granular cases",
    2: "flight: grains and platform at a small gravity",
    3: "four tumbles in a row: does it go on sinking?",
    4: "one case at three grain sizes",
    5: "landing: a drop with a spin",
    6: "trials for `hedgebed diagnose`",
}


@dataclass(frozen=True)
class Case:
    """One case that ships."""

    name: str
    path: Path
    settings: TumbleSettings

    @property
    def experiment(self) -> int:
        """Its number in EXPERIMENTS."""
        match = re.match(r"grains(\d+)-", self.name)
        if match is None:
            raise ValueError(f"case {self.name!r} is not named after its experiment: grains1-... would do")
        return int(match.group(1))


def cases(names: Sequence[str] = ()) -> list[Case]:
    """Those that ship, in order; or those of `names`, of which each is a case, or how several begin.

    Raises ValueError for a name that no case has.
    """
    found = []
    for path in sorted((CASES / "grains").glob("*.toml")):
        settings = settings_from(TumbleSettings, [read_case(path)])
        assert isinstance(settings, TumbleSettings)
        found.append(Case(path.stem, path, settings))
    for name in names:
        if not any(case.name.startswith(name) for case in found):
            raise ValueError(f"there is no case {name!r}: `hedgebed experiments list` names those there are")
    return [case for case in found if not names or any(case.name.startswith(name) for name in names)]


def estimate(case: Case) -> Cost | str:
    """What it costs; or in words why it cannot be run. The same for beds that differ in their seed alone."""
    return _estimate(case.settings.model_copy(update={"seed": 1}))


@functools.cache
def _estimate(settings: TumbleSettings) -> Cost | str:
    try:
        return cost_of_tumble(settings)
    except ValueError as error:
        return str(error)


def standing(case: Case, results: Path, work: Path) -> tuple[str, str]:
    """One of done, failed, stopped, running, to do; and why, where that is known."""
    if (results / case.name / "result.json").exists():
        return "done", ""
    folder = work / case.name
    if not (folder / "run.toml").exists():
        return "to do", ""
    try:
        kept = read_json(folder / "status.json")
    except (OSError, ValueError):
        return "stopped", ""
    if kept.get("status") == "done" and (folder / "result.json").exists():
        return "to do", "finished, to be kept"
    return str(kept.get("status", "stopped")), str(kept.get("reason") or "")


def do_case(case: Case, results: Path, work: Path, *, say: Callable[[str], None]) -> int:
    """Run it, or go on with it, and keep its result; the exit status of the run."""
    folder = work / case.name
    if (folder / "run.toml").exists():
        arguments = ["resume", str(folder)]
    else:
        arguments = ["tumble", str(case.path), "--out", str(folder)]
    say(f"{case.name}: hedgebed {' '.join(arguments)}")
    work.mkdir(parents=True, exist_ok=True)
    status = subprocess.run(
        [sys.executable, "-m", "hedgebed", *arguments, "--json"], stdout=subprocess.DEVNULL, check=False
    ).returncode
    if status == 0:
        keep(folder, results / case.name)
        say(f"{case.name}: kept in {results / case.name}")
    return status


def keep(folder: Path, target: Path) -> None:
    """Put the settings and the numbers of a finished run where results are kept, and what it cost.

    All or nothing: what is kept is put together beside `target` and renamed; result.json, by which a case is done, is
    last where `target` is there already. cost.json has null for what an older run's status.json does not say.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as beside:
        made = Path(beside) / target.name
        made.mkdir()
        for name in KEPT:
            if name == "trajectory.csv":
                _keep_thinned(folder / name, made / name)
            else:
                shutil.copyfile(folder / name, made / name)
        read_json(made / "result.json")
        cost = read_json(folder / "status.json")
        write_json(made / "cost.json", {name: cost.get(name) for name in ("processor_time", "updated")})
        if not target.exists():
            made.rename(target)
            return
        (target / "result.json").unlink(missing_ok=True)
        for path in sorted(made.iterdir(), key=lambda path: path.name == "result.json"):
            path.replace(target / path.name)


def _keep_thinned(source: Path, target: Path) -> None:
    """At most MOST_ROWS rows, evenly; the head stays."""
    head, *rows = source.read_text(encoding="utf-8").splitlines()
    every = max(1, -(-len(rows) // MOST_ROWS))
    target.write_text("\n".join([head, *rows[::every]]) + "\n", encoding="utf-8")
