"""Two commands on one scheduler: each has its own results, and Ctrl-C in one leaves the runs of the other."""

import socket
import threading
import time
import warnings
from contextlib import suppress

import pytest

from experiments.pool import workers
from experiments.pool.tasks import Outcome, task_of
from experiments.runs.progress import Progress
from experiments.runs.registry import find_experiment

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and one worker in this process; what clients set for all of dask is as before afterwards."""
    given = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with dask.config.set(scheduler=None), distributed.LocalCluster(**given) as made:
        yield made


def task(home, name, torque=0.2):
    tumble = find_experiment("tumble")
    return task_of(tumble, tumble.settings_class()(duration=0.1, torque=torque), home, name=name)


def carried_out(tasks, cluster, on_outcome, on_share=lambda name, share: None):
    workers.carry_out_all(
        tasks, scheduler=cluster.scheduler_address, workers=1, cores=1, on_outcome=on_outcome, on_share=on_share,
        progress=Progress(),
    )  # fmt: skip


def test_runs_of_one_name_in_two_folders_or_of_other_settings_are_two(cluster, tmp_path, monkeypatch):
    """The second command asks while the first one's result is still with the scheduler."""
    monkeypatch.setattr(workers, "carry_out", lambda one, tell: Outcome(one.name, f"{one.home} {one.settings.torque}"))
    first, others = task(tmp_path / "a", "one"), [task(tmp_path / "b", "one"), task(tmp_path / "a", "one", 0.15)]
    found = []

    def on_outcome(outcome):
        found.append(outcome.result)
        for other in others:
            carried_out([other], cluster, lambda outcome: found.append(outcome.result))

    carried_out([first], cluster, on_outcome)
    assert found == [f"{one.home} {one.settings.torque}" for one in (first, *others)]


def test_ctrl_c_in_one_command_takes_back_only_what_has_not_begun_and_the_other_gives_it_again(
    cluster, tmp_path, monkeypatch
):
    """Of the first: `quick` is over, `slow` under way, `shared` and `own` wait; the second waits for two of them."""
    quick, slow, shared, own = (task(tmp_path, name) for name in ("quick", "slow", "shared", "own"))
    go, slow_began, carried, outcomes = threading.Event(), threading.Event(), [], []

    def carry_out(one, tell):
        carried.append(one.name)
        if one.name == "slow":
            assert go.wait(20)
        return Outcome(one.name, "done")

    monkeypatch.setattr(workers, "carry_out", carry_out)
    second = threading.Thread(target=carried_out, args=([slow, shared], cluster, outcomes.append))

    def wants(one):
        """How many clients want it, with the one that stands for those that have gone."""
        found = cluster.scheduler.tasks.get(one.key)
        return len(found.who_wants) if found is not None else 0

    def on_outcome(outcome):
        assert outcome.name == "quick" and slow_began.wait(20)
        second.start()
        until = time.monotonic() + 20
        while wants(shared) < 3 and time.monotonic() < until:
            time.sleep(0.01)
        raise KeyboardInterrupt

    def on_share(name, share):
        if name == "slow":
            slow_began.set()

    with pytest.raises(KeyboardInterrupt):
        carried_out([quick, slow, shared, own], cluster, on_outcome, on_share)
    go.set()
    second.join(20)
    assert not second.is_alive()
    assert sorted((one.name, one.result, one.fault) for one in outcomes) == [
        ("shared", "done", ""), ("slow", "done", ""),
    ]  # fmt: skip
    assert carried == ["quick", "slow", "shared"]


def test_a_scheduler_that_is_no_file_is_named_and_one_that_goes_away_is_told_apart():
    with pytest.raises(ValueError, match="no such file"), workers._client(distributed, "/nowhere/s.json", 1):
        pass
    lost = type("Future", (), {"status": "lost"})()
    with pytest.raises(workers.SchedulerGoneError, match="gone away"):
        workers._outcome("a", lost, "tcp://a:1")


def test_processes_here_leave_the_port_of_dask_s_dashboard_alone():
    """With the port taken nothing is said, and the scheduler listens on this machine alone."""
    with socket.socket() as taken, warnings.catch_warnings():
        with suppress(OSError):  # then another has it, which is as good
            taken.bind(("", 8787))
            taken.listen()
        warnings.simplefilter("error", UserWarning)
        with workers._client(distributed, None, 1) as client:
            services = client.scheduler_info()["services"]
    assert services.get("dashboard") != 8787
