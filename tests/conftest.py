"""Same examples in every run; one thread; which files of tests are quick enough for `make fast`, and which begin."""

import math
import os
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import engine_pool
import golden
import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parent.parent
DURATIONS = ROOT / "tests" / "durations.toml"
FAST_BUDGET = 110.0
"""What all tests of `make fast` may take together, as tests/durations.toml has it [s]; two processes share it."""

# A suite that passes here has to pass elsewhere; HYPOTHESIS_PROFILE=search looks for new examples, and more of them.
settings.register_profile("same", derandomize=True, deadline=None, database=None)
settings.register_profile("search", max_examples=1000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session", autouse=True)
def one_core():
    """Beds and batches that are not told how many threads to take find one core.

    With another number of threads Taichi is started anew and every kernel is compiled again; these beds are too small
    for two, and two workers of pytest-xdist would be in each other's way. What threads do is shown in
    dem/engine/test_bits.py.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
        yield


@pytest.fixture(scope="session", autouse=True)
def no_pace(tmp_path_factory):
    """Estimates are those of a machine that has not run anything yet, and runs of tests do not change those of others.

    The file cannot be written: its folder is a file.
    """
    with pytest.MonkeyPatch.context() as patch:
        no_folder = tmp_path_factory.mktemp("pace") / "file"
        no_folder.touch()
        patch.setattr("experiments.runs.pace._file", lambda: no_folder / "pace.json")
        yield


@pytest.fixture(scope="session", autouse=True)
def one_command_line():
    """The options of all commands are set out once, not in each of a thousand calls of the command line."""
    from experiments.cli import main
    from experiments.runs import registry

    built = main.build_app
    apps: dict[tuple, object] = {}

    def build_app():
        known = tuple(registry.EXPERIMENTS.values())
        if known not in apps:
            apps[known] = built()
        return apps[known]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", build_app)
        yield


def heavy_files(durations: dict[str, float]) -> set[str]:
    """The files that `make fast` leaves out: it takes the quickest ones until its budget is used up."""
    total, heavy = 0.0, set()
    for name, seconds in sorted(durations.items(), key=lambda item: item[1]):
        total += seconds
        if total > FAST_BUDGET:
            heavy.add(name)
    return heavy


def merged(durations: dict[str, float], measured: dict[str, float], root: Path = ROOT) -> dict[str, float]:
    """All durations after a run of some files: `measured` over those of before, without files that are gone, sorted."""
    return {name: seconds for name, seconds in sorted((durations | measured).items()) if (root / name).is_file()}


def pytest_addoption(parser):
    parser.addoption(
        "--write-durations", action="store_true", help="measure the files of this run for tests/durations.toml"
    )
    parser.addoption("--update-golden", action="store_true", help="write tests/golden/*.txt instead of comparing")


def pytest_configure(config):
    golden.UPDATE = config.getoption("--update-golden")
    config.pluginmanager.register(_Stopwatch(config))


def longest_first(names: Iterable[str], durations: dict[str, float]) -> list[str]:
    """The files in the order in which workers take them, so that none is left with a long file at the end.

    A file that has no measured duration may be long: it comes first.
    """
    return sorted(names, key=lambda name: (-durations.get(name, math.inf), name))


def pytest_collection_modifyitems(config, items):
    durations = tomllib.loads(DURATIONS.read_text(encoding="utf-8"))
    heavy = heavy_files(durations)
    names = {item: item.path.relative_to(ROOT).as_posix() for item in items}
    if hasattr(config, "workerinput"):
        place = {name: number for number, name in enumerate(longest_first(set(names.values()), durations))}
        items.sort(key=lambda item: place[names[item]])
    for item in items:
        if engine_pool.ARCH != "cpu" and (mark := item.get_closest_marker("cpu_only")):
            item.add_marker(pytest.mark.skip(reason=f"{mark.args[0]}: on a CPU only"))
        if names[item] in heavy:
            item.add_marker("heavy")


class _Stopwatch:
    """Adds up how long the tests of each file take; under pytest-xdist the process that leads the others writes."""

    def __init__(self, config):
        self.wanted = config.getoption("--write-durations") and not hasattr(config, "workerinput")
        self.seconds = Counter()

    def pytest_runtest_logreport(self, report):
        self.seconds[report.nodeid.split("::")[0]] += report.duration

    def pytest_sessionfinish(self):
        if self.wanted:
            known = merged(tomllib.loads(DURATIONS.read_text(encoding="utf-8")), dict(self.seconds))
            lines = [f'"{name}" = {seconds:.1f}\n' for name, seconds in known.items()]
            head = "# Seconds that each file of tests takes, set-up included: `make tiers` measures them.\n"
            DURATIONS.write_text(head + "".join(lines), encoding="utf-8")
