"""Folders of each kind that a command writes and a command reads again, small enough to be made once for a test.

Beds are stand-ins of `fake_bed` where `fake` says so: they are prepared in no time, and all files are real ones.
"""

import shutil
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fake_bed import FakeBed
from small_cases import GRAINS, TUMBLE_ON_GRAINS

import dem
import experiments.bed.work
import experiments.suite.cases
from experiments.campaign.files import new_campaign
from experiments.cli.main import main
from experiments.penetrate import beds
from experiments.runs.folder import RunFolder
from rigid.platform.files import PLATFORM_FOLDER

__all__ = ["KINDS", "Kind", "patched"]

STEP = 5e-5
SPREAD = {1: -3.0, 2: 3.0, 3: 0.5, 4: -0.5}
BEDS = """
bed_size = [0.06, 0.06, 0.04]
tip_diameter = 0.012
grain = 0.0024
speeds = [0.2, 0.8]
drop_speeds = []
mass = 0.3
load = 0.4
depth = 0.01
young = 2e7
frame_count = 0
"""
CASE = "seeds = [1]\n" + BEDS
CALIBRATE = "seeds = [1, 2]\nmost_beds = 2\nbudget = 3600.0\nlaws = ['spring-damper']\nworkers = 1\n" + BEDS
FURTHER = "unload_depths = [0.005]\n"
CONVERGE = BEDS + """
seeds = [1, 2]
ratios = [5.0, 8.0]
widths = []
bed_depths = []
overlaps = []
paces = []
life_grain = 0.00024
workers = 1
"""  # fmt: skip
ON_GRAINS = GRAINS + "grain = 0.004\nseeds = [1]\nspeeds = [0.4]\nhold = 0.0\ndrop_speeds = []\nyoung = 2e7\n"
TUMBLE = TUMBLE_ON_GRAINS + "duration = 0.02\nframe_count = 2\n"
SWEEP = ["sweep", "--experiment", "tumble", "--fixed", "duration=0.1", "--over", "torque=[0.15, 0.2]", "--workers", "1"]


@dataclass(frozen=True)
class Kind:
    """`make` leaves what is damaged in the present folder; the commands of `read` answer into `answers`, patterns."""

    make: Callable[[], None]
    read: tuple[str, ...]
    answers: tuple[str, ...] = ("run/result.json", "run/*.csv", "run/*.nc", "run/series/*.csv", "run/ground.toml")
    damaged: tuple[str, ...] = ("run/**/*",)  # Patterns
    fake: bool = False
    tier: str = ""  # The mark of its tests


def hedgebed(words: str) -> int:
    """The exit status of the command."""
    return main([*words.split(), "--quiet"])


def done(words: str) -> None:
    """Carry out a command that must succeed."""
    assert hedgebed(words) == 0, words


def unfinished(run: str) -> None:
    """Leave a run as one that was stopped before it had a result; what its parts have finished stays."""
    (Path(run) / "result.json").unlink()
    RunFolder.open(Path(run)).set_status("stopped")


def case(text: str, name: str = "case.toml") -> str:
    Path(name).write_text(text, encoding="utf-8")
    return name


def of(words: str, text: str = "", *, stopped: bool = False) -> Callable[[], None]:
    """Make `run` by a command, of a case if there is one; `stopped`: without its result."""

    def make() -> None:
        done(f"{words} {case(text) if text else ''} --out run")
        if stopped:
            unfinished("run")

    return make


def sweep(*, stopped: bool) -> Callable[[], None]:
    def make() -> None:
        assert main([*SWEEP, "--out", "run", "--quiet"]) == 0
        if stopped:
            unfinished("run")

    return make


def two_runs() -> None:
    """Two runs of `penetrate` in two beds each."""
    for name, seeds in (("a", [1, 2]), ("b", [3, 4])):
        done(f"penetrate {case(f'seeds = {seeds}' + BEDS)} --out {name}")


def copies() -> None:
    """Stopped runs that keep copies of what they were given: a law, a platform, a material."""
    done(f"calibrate {case(CALIBRATE)} --out fitted")
    shutil.copy("fitted/ground.toml", "law.toml")
    shutil.copy(PLATFORM_FOLDER / "cube.toml", "cube.toml")
    shutil.copy(Path(dem.__file__).parent / "presets" / "sand.toml", "mine.toml")
    done("tumble --duration 0.1 --ground law.toml --platform cube.toml --rig 0.03 --out tumbled")
    done(f"penetrate {case(CASE)} --material mine.toml --out run")
    for name in ("tumbled", "run"):
        unfinished(name)
        shutil.rmtree(Path(name) / "checkpoint", ignore_errors=True)
    for name in ("law.toml", "mine.toml"):
        Path(name).unlink()


def diagnosed() -> None:
    new_campaign(Path("campaign"), kind="penetration")
    done("diagnose campaign --out run")


CAMPAIGN = "--duration 0.1 --lead 0.05 --camera-rate 60 --imu-rate 50 --wheel-rate 100 --brake-torques 6.0 --rig 0.0085"


def bed(*, stopped: bool) -> Callable[[], None]:
    """A bed that is made, with a name; `stopped`: after its first stage."""

    def make() -> None:
        words = "bed make --stages rain level --size 0.024 0.024 0.02 --threads 1 --name rained --out run"
        calls = iter([False] * 3) if stopped else iter(())

        @contextmanager
        def held_back():
            yield lambda: next(calls, stopped)

        before, experiments.bed.work.held_back = experiments.bed.work.held_back, held_back
        try:
            assert hedgebed(words) == (3 if stopped else 0)
        finally:
            experiments.bed.work.held_back = before

    return make


def cached() -> None:
    """The cache of a run: a finished bed."""
    done(f"penetrate {case(ON_GRAINS)} --out first")
    shutil.rmtree("first")


def suite_of_cases() -> None:
    """Runs of `experiments run` that are finished and not yet kept."""
    Path("cases/grains").mkdir(parents=True)
    case(TUMBLE, "cases/grains/grains1-small.toml")
    done("experiments run --work work --results results --workers 1")
    shutil.rmtree("results")


def kept_result() -> None:
    """A result as `experiments run` keeps it."""
    suite_of_cases()
    done("experiments run --work work --results results --workers 1")
    shutil.rmtree("work")


KINDS = {
    "calibrate, members": Kind(of("calibrate", CALIBRATE + FURTHER, stopped=True), ("resume run",), fake=True),
    "calibrate, done": Kind(
        of("calibrate", CALIBRATE), ("tumble --duration 0.1 --rig 0.0085 --ground run/ground.toml --out out",
                                     "resume run --json"),
        ("run/result.json", "run/series/*.csv", "run/ground.toml", "out/result.json", "out/*.csv"), fake=True,
    ),
    "calibrate, runs": Kind(
        two_runs, ("calibrate a b --laws spring-damper --out out", "compare a b --out compared"),
        ("out/result.json", "out/ground.toml", "compared/result.json", "compared/**/*.csv"), ("a/**/*", "b/**/*"),
        fake=True,
    ),
    "penetrate, marks": Kind(
        of("penetrate", CASE.replace("frame_count = 0", "frame_count = 2"), stopped=True),
        ("resume run", "view run --out view.html --no-open"), ("run/result.json", "run/series/*.csv", "view.html"),
        fake=True,
    ),
    "sweep, members": Kind(sweep(stopped=True), ("resume run",)),
    "sweep, done": Kind(sweep(stopped=False), ("resume run --json",)),
    "converge, members": Kind(of("converge", CONVERGE, stopped=True), ("resume run",), fake=True),
    "copies": Kind(
        copies, ("resume tumbled", "resume run"), ("*/result.json", "*/*.csv", "*/series/*.csv"),
        ("tumbled/*", "run/*"), fake=True,
    ),
    "campaign, written": Kind(
        of(f"campaign {CAMPAIGN}"), ("campaign check run/campaign --out out",), ("out/result.json", "out/series/*.csv"),
        ("run/campaign/*",),
    ),
    "diagnose, model": Kind(
        diagnosed, ("penetrate --ground spring-damper --model run/model.toml --out out", "resume run --json"),
        ("out/result.json", "out/series/*.csv"), tier="slow",
    ),
    "bed, done": Kind(
        bed(stopped=False), ("bed show rained --json", "resume run --json"), damaged=("run/**/*", "shelf/*"),
        tier="slow",
    ),
    "bed, stopped": Kind(bed(stopped=True), ("resume run",), tier="slow"),
    "cache": Kind(
        cached, ("penetrate case.toml --out run",), damaged=("cache/beds/*",), tier="slow",
    ),
    "experiments run": Kind(
        suite_of_cases, ("experiments run --work work --results results --workers 1",),
        ("results/*/result.json", "results/*/*.csv"), ("work/**/*",), tier="slow",
    ),
    "kept result": Kind(
        kept_result, ("resume results/grains1-small --json",), (), ("results/**/*",), tier="slow",
    ),
}  # fmt: skip


def patched(kind: Kind, patch) -> None:
    """Set up what the commands of a kind find: stand-in beds, cases, and a shelf and a cache in the present folder."""
    patch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    patch.setattr(experiments.suite.cases, "CASES", Path("cases"))
    patch.setenv("HEDGEBED_BEDS", "shelf")
    patch.setenv("HEDGEBED_CACHE", "cache")
    patch.setenv("HEDGEBED_NO_OPENGL", "1")
    if kind.fake:
        patch.setattr(beds, "prepare_bed", stand_in)
        patch.setattr(beds, "bed_step", lambda settings, young: STEP)


def stand_in(settings, seed, young, progress):
    """A bed whose hardness depends on its grains and its seed."""
    hardness = 100.0 + 300.0 * settings.grain / settings.tip_diameter + SPREAD[seed]
    return FakeBed(size=settings.bed_size, time_step=STEP, seed=seed, hardness=hardness, rate=0.5, unload=4000.0)
