"""Lists of runs: in how many processes, what is done already, who cannot see a folder, Ctrl-C, the same numbers."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from small_cases import CALIBRATE

from experiments import lawfit
from experiments.cli.main import main
from experiments.converge import Settings as ConvergeSettings
from experiments.converge.design import members_of, variants_of
from experiments.lawfit.cells import cells_of
from experiments.lawfit.design import LEAST_BEDS, _certain, _cost, _member
from experiments.pool import tasks, together
from experiments.pool.tasks import Outcome, task_of
from experiments.pool.together import Planned, Where, run_all, whole_folder
from experiments.runs.progress import Progress
from experiments.runs.registry import find_experiment

ROOT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.usefixtures("unreported")


def tumbles(home, torques, cost=0.5):
    """Tumbles of 0.1 s on a law, as a list of runs."""
    tumble = find_experiment("tumble")
    every = [tumble.settings_class()(duration=0.1, torque=torque) for torque in torques]
    return [Planned(task_of(tumble, settings, home), f"torque {settings.torque}", cost) for settings in every]


@pytest.mark.parametrize(
    ("where", "costs", "count"),
    [
        (Where(), [20.0, 20.0], 1),  # done before processes had started
        (Where(), [60.0, 60.0, 60.0], 2),  # a core each
        (Where(), [600.0], 1),
        (Where(workers=3), [1.0, 1.0], 2),
        (Where(workers=3), [1.0] * 9, 3),
        (Where(workers=1), [600.0] * 9, 1),
        (Where(workers=4), [], 1),
    ],
)
def test_processes_are_started_where_they_are_asked_for_or_worth_it(where, costs, count, monkeypatch):
    monkeypatch.setattr(together, "cores_there", lambda: 2)
    assert where.processes(costs) == count


def test_without_dask_one_process_computes_unless_more_are_asked_for(monkeypatch):
    monkeypatch.setattr(together, "find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert Where().processes([600.0] * 9) == 1
    Where(workers=1).check()
    for where, named in (
        (Where(workers=2), "workers = 1 needs nothing more"),
        (Where("tcp://nowhere:1"), "tcp://nowhere:1"),
    ):
        with pytest.raises(ValueError, match=named):
            where.check()


def test_a_scheduler_beside_workers_is_refused_and_the_variable_replaces_it(monkeypatch):
    with pytest.raises(ValueError, match="workers = 2"):
        Where("tcp://here:1", 2).check()
    monkeypatch.setenv("HEDGEBED_SCHEDULER", "tcp://there:2")
    for given in ({"scheduler": "tcp://here:1"}, {"workers": 2}, {}):
        assert Where.of(ConvergeSettings(**given)) == Where("tcp://there:2")


def test_runs_come_in_their_order_each_once_and_what_is_done_comes_first(tmp_path, monkeypatch):
    first, second, third = tumbles(tmp_path, [0.2, 0.15, 0.18])
    begun, progress = [], Progress()
    run_all([second], where=Where(workers=1), progress=progress)
    planned = [first, second, first, third]
    outcomes = run_all(planned, where=Where(workers=1), progress=progress, on_outcomes=begun.append)
    names = [[outcome.name for outcome in some] for some in begun]
    assert names == [[second.task.name], [first.task.name], [third.task.name]]
    assert set(outcomes) == {one.task.name for one in planned} and not any(one.fault for one in outcomes.values())
    assert progress.stage_fraction == 1.0
    said = []
    monkeypatch.setattr(progress, "message", said.append)
    lost = first.task.path / "result.json"
    lost.write_bytes(lost.read_bytes()[:100])
    again = run_all(planned, where=Where(workers=1), progress=progress)
    assert {name: one.result for name, one in again.items()} == {name: one.result for name, one in outcomes.items()}
    assert len([words for words in said if str(lost) in words and "done again" in words]) == 1


def test_shares_of_runs_that_are_computed_together_are_one_progress_by_their_costs(tmp_path, monkeypatch):
    """Two processes tell how far they are; one run of three has failed, and its cost counts as done."""
    planned = [one for cost in (6.0, 3.0, 1.0) for one in tumbles(tmp_path, [0.1 + 0.01 * cost], cost)]
    first, second, third = (one.task.name for one in planned)
    progress, said, shares = Progress(), [], []
    monkeypatch.setattr(progress, "message", said.append)
    monkeypatch.setattr(together, "_TOLD_EVERY", 0.0)

    def computed(tasks, *, on_outcome, on_share, **given):
        assert [task.name for task in tasks] == [first, second, third]
        on_outcome(Outcome(third, fault="wheel lost"))
        for name, share in ((first, 0.5), (second, 0.25), (first, 0.75), (third, 0.5)):
            on_share(name, share)
            shares.append(progress.stage_fraction)

    monkeypatch.setattr(together, "carry_out_all", computed)
    run_all(planned, where=Where(workers=2), progress=progress)
    assert shares == pytest.approx([0.4, 0.475, 0.625, 0.625])
    over, *each = said[-1].split("; ")
    assert "1 of 3 " in over and "1 of them" in over
    assert sorted(one.split(": ") for one in each) == [["torque 0.13", "25 %"], ["torque 0.16", "75 %"]]


@dataclass(frozen=True)
class Twice:
    """The torque of the run, doubled, in a file of its folder."""

    share: float = 0.25
    files: tuple[str, ...] = ("twice",)

    def missing(self, path):
        return not (path / "twice").exists()

    def make(self, settings, path, tell, progress):
        (path / "twice").write_text(str(2 * settings.torque))
        tell(1.0)


def test_what_belongs_to_a_run_is_made_in_its_folder_and_once(tmp_path):
    planned = [replace(one, task=replace(one.task, after=Twice())) for one in tumbles(tmp_path, [0.2, 0.15])]
    plain, first = planned[1].task.path, planned[0].task
    run_all(tumbles(tmp_path, [0.15]), where=Where(workers=1), progress=Progress())
    made = (plain / "result.json").stat().st_mtime_ns
    assert [tasks.done_before(one.task) for one in planned] == [None, None]
    shares = []
    assert not tasks.carry_out(first, shares.append).fault
    assert shares == sorted(shares) and shares[-2:] == [0.75, 1.0]
    outcomes = run_all(planned, where=Where(workers=1), progress=Progress())
    assert not any(one.fault for one in outcomes.values())
    assert [(one.task.path / "twice").read_text() for one in planned] == ["0.4", "0.3"]
    assert (plain / "result.json").stat().st_mtime_ns == made and all(tasks.done_before(one.task) for one in planned)


def test_a_file_that_is_only_on_the_disk_of_a_worker_is_named(tmp_path):
    """The numbers arrive; a series does not."""
    (one,) = tumbles(tmp_path / "there", [0.2])
    outcome = tasks.carry_out(one.task, float)
    (here,) = tumbles(tmp_path / "here", [0.2])
    tasks.received(here.task, Outcome(here.task.name, outcome.result))
    assert whole_folder(here.task, "result.json").is_dir() and whole_folder(one.task, "trajectory.csv").is_dir()
    with pytest.raises(RuntimeError, match=r"trajectory\.csv.*workers must see .*here"):
        whole_folder(here.task, "trajectory.csv")


def test_a_run_on_a_full_disk_names_the_file_that_was_being_written(tmp_path, monkeypatch):
    """The system does not name it."""

    def run(settings, folder, *, progress):
        with Path("/dev/full").open("wb", buffering=0) as file:
            file.write(b"a")

    monkeypatch.setattr("experiments.tumble.experiment.run", run)
    (one,) = tumbles(tmp_path, [0.2])
    assert tasks.carry_out(one.task, float).fault == f"OSError: /dev/full: {os.strerror(errno.ENOSPC)}"


def test_a_member_of_converge_and_calibrate_is_named_by_all_code_that_computes_it(monkeypatch):
    """Not only by that of beds: other code of `penetrate` has other members."""
    settings = ConvergeSettings(seeds=(1,), ratios=(), widths=(), bed_depths=(), overlaps=(), paces=())
    (cell,) = cells_of(lawfit.Settings(budget=1e9))

    def names():
        return [members_of(settings, variants_of(settings))[0].folder, _member(cell, 1).folder]

    first = names()
    assert names() == first
    monkeypatch.setattr(tasks, "code_of", lambda experiment: "other")
    assert not set(names()) & set(first)


def test_beds_of_calibrate_are_computed_together_only_where_the_budget_reaches_them_in_any_case(tmp_path):
    """Also where each bed gets the faster drive, which is decided after the first two."""
    (cell,), seeds = cells_of(lawfit.Settings(budget=1e9)), list(range(1, 8))
    whole = _cost(cell, [_member(cell, seed, faster=faster) for seed in seeds[:LEAST_BEDS] for faster in (False, True)])
    for budget, count in ((1.001 * whole, LEAST_BEDS), (0.999 * whole, 2)):
        for cells in ([cell], [cell, cell]):
            planned = _certain(cells, seeds, len(cells) * budget, tmp_path)
            assert [one.task.settings.seeds for one in planned] == len(cells) * [(seed,) for seed in seeds[:count]]


def command(*tokens, log):
    """hedgebed in its own process group. It takes Ctrl-C even where a script runs these tests in the background."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with log.open("w") as file:
        return subprocess.Popen(
            [sys.executable, "-m", "hedgebed", *map(str, tokens)], env=environment, stdout=file, stderr=file,
            start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )  # fmt: skip


@pytest.mark.long
def test_ctrl_c_ends_processes_and_command_in_words_and_resume_makes_the_same_table(tmp_path):
    """Ctrl-C of a terminal reaches the processes too."""
    pytest.importorskip("distributed")
    tokens = ["sweep", "--experiment", "tumble", "--fixed", "duration=6", "--over", "torque=0.14:0.2:0.002"]
    out, log = tmp_path / "out", tmp_path / "log"
    process = command(*tokens, "--workers", "2", "--out", out, log=log)
    until = time.monotonic() + 120
    while not list(out.glob("members/*/result.json")) and time.monotonic() < until:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    said = (process.wait(timeout=120), log.read_text())
    assert said[0] == 3 and "Traceback" not in said[1] and not (out / "result.json").exists(), said
    assert main([*tokens, "--workers", "1", "--out", str(tmp_path / "one"), "--quiet"]) == 0
    assert command("resume", out, log=log).wait(timeout=120) == 0, log.read_text()
    assert (out / "table.csv").read_bytes() == (tmp_path / "one" / "table.csv").read_bytes()


@pytest.mark.slow
def test_further_runs_of_calibrate_come_out_the_same_in_two_processes(tmp_path):
    """Placement and drag in two beds: in the folders of their members, to the bit."""
    pytest.importorskip("distributed")
    case = tmp_path / "case.toml"
    case.write_text(f"{CALIBRATE}loads = [0.05]\ndrag_depths = [0.004]\n")
    found = []
    for workers in ("1", "2"):
        out, log = tmp_path / workers, tmp_path / f"log{workers}"
        made = command("calibrate", case, "--out", out, "--workers", workers, log=log).wait(timeout=900)
        assert made == 0, log.read_text()
        found.append({path.parts[-3:]: path.read_bytes() for path in out.glob("members/*/series/further-*.csv")})
    assert len(found[0]) == 4 and found[0] == found[1]


@pytest.mark.slow
def test_cases_of_the_verification_suite_come_out_the_same_in_two_processes(tmp_path):
    """All but the times; with the curves of their plots."""
    pytest.importorskip("distributed")
    one, two, log = tmp_path / "one", tmp_path / "two", tmp_path / "log"
    tokens = ["validate", "--only", "hertz-force", "t1", "--out"]
    assert main([*tokens, str(one), "--workers", "1", "--quiet"]) == 0
    assert command(*tokens, two, "--workers", "2", log=log).wait(timeout=300) == 0, log.read_text()
    assert (two / "report.html").is_file() and len(list(two.glob("members/*"))) == 2
    found = []
    for out in (one, two):
        cases = {row["id"]: row for row in json.loads((out / "result.json").read_text())["cases"]}
        curves = {path.name: path.read_bytes() for path in out.glob("series/*.csv")}
        rows = [[cases[name][key] for key in ("status", "comparisons", "plots")] for name in ("hertz-force", "t1")]
        found.append((rows, curves))
    assert found[0] == found[1] and found[0][1]
