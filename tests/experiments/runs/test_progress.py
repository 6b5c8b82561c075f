"""Progress: fractions and times to go, and how lines and bars show them."""

import io

import pytest
from rich.console import Console

from dem.prepare.report import ShowsBed
from experiments.grains.bed_progress import BedProgress, Stages
from experiments.runs.progress import LineProgress, LiveProgress, Progress, as_expected, duration, make_progress


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.mark.parametrize(
    ("seconds", "text"), [(5, "0:05"), (750, "12:30"), (3750, "1:02:30"), (None, "?"), (-1, "0:00")]
)
def test_durations_as_a_person_reads_them(seconds, text):
    assert duration(seconds) == text


def test_the_stage_goes_on_at_the_rate_it_went(clock):
    progress = Progress(clock=clock)
    progress.stage("dig", total=200)
    assert progress.stage_remaining() is None
    clock.now += 10
    progress.update(50)
    assert progress.stage_fraction == 0.25
    assert progress.stage_remaining() == pytest.approx(30)


def test_the_whole_follows_from_the_costs_of_the_stages(clock):
    progress = Progress(clock=clock)
    assert progress.fraction is None
    progress.plan({"dig": 30.0, "fill": 10.0})
    progress.stage("dig", total=1)
    clock.now += 30
    progress.update(0.5)
    assert progress.fraction == pytest.approx(15 / 40)
    assert progress.remaining() == pytest.approx(50)
    progress.stage("fill", total=4)
    assert progress.fraction == pytest.approx(30 / 40)
    clock.now += 5
    progress.update(2)
    assert progress.fraction == pytest.approx(35 / 40)
    progress.close()
    assert progress.fraction == 1.0
    assert progress.remaining() == 0.0


def test_a_new_plan_starts_the_reckoning_afresh(clock):
    progress = Progress(clock=clock)
    progress.plan({"prepare": 1.0})
    progress.stage("prepare")
    clock.now += 1000
    progress.plan({"dig": 1.0})
    progress.stage("dig", total=2)
    clock.now += 5
    progress.update(1)
    assert progress.remaining() == pytest.approx(5)


def test_a_stage_outside_the_plan_belongs_to_the_one_it_comes_within(clock):
    progress = Progress(clock=clock)
    progress.plan({"prepare": 3.0, "dig": 1.0})
    progress.stage("prepare")
    progress.stage("rain", total=2)
    clock.now += 1
    progress.update(1)
    assert progress.stage_fraction == 0.5
    assert progress.remaining() is None and progress.fraction == 0.0  # nothing tells how far the plan is
    progress.stage("level", total=2)
    clock.now += 2
    progress.stage("dig", total=2)
    assert progress.fraction == 0.75


def test_a_bed_that_was_in_the_cache_counts_nothing(clock):
    """A stage that is over without an update found its work done: the rest is still all to do."""
    progress = Progress(clock=clock)
    progress.plan({"bed": 1.5, "drive": 0.5, "drop": 0.5})
    progress.stage("bed", total=2.0)
    clock.now += 0.5
    progress.stage("drive", total=1.0)
    clock.now += 9.5
    assert progress.fraction == 0.0
    progress.update(0.5)
    assert progress.remaining() == pytest.approx(9.5 + 19.0)
    assert progress.fraction == pytest.approx(10.0 / 38.5)


def test_the_whole_goes_on_at_least_as_long_as_the_stage(clock):
    progress = Progress(clock=clock)
    progress.plan({"drive": 1.0}, seconds={"report": 40.0})
    progress.stage("drive", total=1.0)
    clock.now += 100
    progress.update(1.0)
    assert progress.remaining() == pytest.approx(40.0)
    progress.stage("report", total=1.0)
    clock.now += 30
    progress.update(0.1)
    assert progress.remaining() == progress.stage_remaining() == pytest.approx(36)  # nine tenths of what was planned
    clock.now += 30
    progress.update(0.35)
    assert progress.remaining() == pytest.approx(0.65 * (0.5 * 40 + 0.5 * 120))  # half way to its own pace
    clock.now += 30
    progress.update(0.6)
    assert progress.remaining() == progress.stage_remaining() == pytest.approx(0.4 * 120)


def test_a_share_once_told_is_never_taken_back(clock):
    """A stage slower than its cost said, a last stage longer than thought, an update that goes back."""
    progress = Progress(clock=clock)
    progress.plan({"bed": 1.5, "drive": 0.5, "report": 0.5})
    told = []
    for stage, pace, steps in (("bed", 0.2, 10), ("drive", 3.0, 10), ("report", 9.0, 10)):
        progress.stage(stage, total=steps)
        for done in (*range(1, steps // 2 + 1), 2, *range(steps // 2, steps + 1)):
            clock.now += pace
            progress.update(done)
            told.append((progress.fraction, progress.stage_fraction if done != 2 else 0.0))
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_a_first_guess_tells_from_the_start_and_gives_way_to_what_is_measured(clock):
    progress = Progress(clock=clock)
    progress.plan({"bed": 60.0, "drive": 60.0}, unit=2.0)
    assert progress.remaining() == pytest.approx(240)
    progress.stage("bed", total=1.0)
    clock.now += 20  # compilers
    progress.update(0.0)
    for done in range(1, 11):
        clock.now += 6
        progress.update(done / 10)
    # 60 s for a cost of 60, beside a guess of 2 s for each that weighs 15 s
    assert progress.remaining() == pytest.approx(60 * 75 / 67.5, rel=1e-6)


def test_what_a_stage_waited_for_at_first_is_not_its_pace(clock):
    progress = Progress(clock=clock)
    progress.plan({"bed": 1.0, "next bed": 1.0})
    progress.stage("bed", total=100)
    clock.now += 50  # compilers
    progress.update(1)
    clock.now += 49
    progress.update(50)
    assert progress.stage_remaining() == pytest.approx(50)
    assert progress.remaining() == pytest.approx(150)


def test_between_two_updates_the_time_to_go_counts_down_but_never_to_nothing(clock):
    progress = Progress(clock=clock)
    progress.plan({}, seconds={"report": 40.0})
    progress.stage("report", total=1.0)
    clock.now += 30
    assert progress.remaining() == pytest.approx(10)
    clock.now += 50
    assert progress.remaining() == pytest.approx(0.15 * 80)


def test_while_compilers_are_waited_for_nothing_is_done_and_nothing_counts_down(clock):
    progress = Progress(clock=clock)
    progress.plan({"bed": 30.0}, seconds={"report": 10.0}, unit=1.0)
    progress.stage("bed", total=100)
    clock.now += 60
    assert (progress.fraction, progress.remaining()) == (0.0, pytest.approx(40))
    progress.update(1)
    assert progress.fraction == 0.0
    clock.now += 15
    progress.update(51)
    assert progress.fraction == pytest.approx(0.5 * 30 / 40, abs=0.02)


def test_times_known_in_seconds_follow_a_slower_machine(clock):
    progress = Progress(clock=clock)
    progress.plan({"bed": 1000.0}, seconds={"report": 10.0}, unit=0.1)
    progress.stage("bed", total=1.0)
    progress.update(0.0)
    clock.now += 200
    progress.update(0.999)
    assert progress.remaining() == pytest.approx(10 * 215 / 115, rel=0.02)  # the guess weighs 15 s


def test_what_is_to_come_can_be_expected_to_cost_otherwise(clock):
    progress = Progress(clock=clock)
    progress.plan({"bed 1": 10.0, "bed 2": 10.0, "drive": 5.0}, unit=1.0)
    progress.stage("bed 1", total=1.0)
    progress.expect({"bed 1": 0.0, "bed 2": 0.0, "other": 3.0})
    assert progress.remaining() == pytest.approx(15)


@pytest.mark.parametrize("late", [0.5, 1.0, 3.0])
def test_what_is_late_is_never_said_to_be_over(late):
    assert as_expected(0.8) == pytest.approx(0.8) and as_expected(0.79) < 0.8 < as_expected(0.81)
    assert as_expected(late) < 1


def test_a_bed_in_preparation_goes_by_time(clock):
    """The pieces of a bed of 20,182 grains as they were told, one a second: calming and resting are not announced."""
    progress = Progress(clock=clock)
    progress.plan({"bed": 1.0}, unit=60.0)
    bed = BedProgress(progress, "bed", lambda: False)
    bed.stage("rain", 1.0)
    told = []
    fallen = [0.03 * k for k in range(1, 28)]
    calmed = [1.0, 0.10, 0.13, 1.0]
    settled = [0, 0.35, 0.20, 0.52, 0.42, 0.62, 0.59, 0.68, 0.76, 0.80, 0.86, 0.87, 0.89, 0.94, 0.98, 0.98, 1.0]
    rested = [0.95, 0.88, 0.89, 0.85, 0.80, 0.82, 0.81, 0.87, 0.88, 0.95, 0.97, 0.97, 0.97, 0.94]
    for done in fallen + calmed:
        bed.update(done)
        told.append(progress.stage_fraction)
    bed.stage("settle", 1.0)
    for done in settled + rested:
        bed.update(done)
        told.append(progress.stage_fraction)
    assert told == sorted(told)
    down, calm, still = len(fallen) - 1, len(fallen + calmed) - 1, len(fallen + calmed + settled) - 1
    assert told[down] == pytest.approx(0.30, abs=0.06)
    assert told[calm] == pytest.approx(0.42, abs=0.03)
    assert told[still] == pytest.approx(0.74, abs=0.03)
    assert 0.9 < told[-1] < 1
    assert progress.fraction is not None


@pytest.mark.parametrize(("power", "down"), [(1.0, 0.60), (2.0, 0.30)])
def test_grains_that_fall_at_a_constant_pace_are_as_far_as_they_have_fallen(power, down, clock):
    """On a busy machine a step takes the same time however few grains touch, on a quiet one more in a denser bed.

    The share of the fall that is over is then that of its time: (fallen / 0.82)^power.
    """
    bed = BedProgress(progress := Progress(clock=clock), "bed", lambda: False, clock=clock)
    bed.stage("rain", 1.0)
    began, told = clock.now, {}
    for fallen in (0.03 * k for k in range(1, 28)):
        clock.now = began + 300.0 * fallen**power
        bed.update(fallen)
        told[round(fallen, 2)] = progress.stage_fraction
    for fallen in (0.3, 0.6):
        assert told[fallen] == pytest.approx(down * (fallen / 0.82) ** power, rel=0.15)
    assert told[0.81] == pytest.approx(down, rel=0.2)  # it nears its end ever more slowly


def test_a_cost_below_nothing_is_refused():
    with pytest.raises(ValueError, match="less than nothing"):
        Progress().plan({"dig": -1.0})


def test_lines_come_when_a_stage_begins_and_then_rarely(clock):
    stream = io.StringIO()
    with LineProgress(stream, every=10, clock=clock) as progress:
        progress.plan({"dig": 1.0, "fill": 1.0})
        progress.stage("dig", total=100)
        for done in range(1, 101):
            clock.now += 0.25
            progress.update(done)
        progress.message("found [water]")
        progress.stage("fill")
    lines = stream.getvalue().splitlines()
    assert lines == [
        "[   0:00] dig (all 0 %)",
        "[   0:10] dig: 40 %, 0:15 to go, all 19 %, 0:40 to go",
        "[   0:20] dig: 80 %, 0:05 to go, all 39 %, 0:30 to go",
        "[   0:25] found [water]",
        "[   0:25] fill (all 49 %, 0:25 to go)",
    ]


def test_bars_show_the_stage_and_how_long_to_go(clock):
    console = Console(file=io.StringIO(), force_terminal=True, width=100, color_system=None)
    with LiveProgress(console, clock=clock) as progress:
        progress.plan({"dig [deep]": 1.0, "fill": 1.0})
        progress.stage("dig [deep]", total=100)
        clock.now += 10
        progress.update(50)
        progress.message("found [water]")
        clock.now += 10
        progress.stage("fill", total=None)
        progress.update(3)
    text = console.file.getvalue()
    for expected in ("dig [deep]: 0:20", "found [water]", "fill", "50 %", "0:20 to go"):
        assert expected in text


def test_a_bed_is_shown_by_its_grains_the_share_awake_and_its_rate(clock):
    progress = Progress(clock=clock)
    progress.stage("drive", total=100)
    assert progress.bed_words == []
    for second in range(31):  # twice as fast in the last ten seconds
        steps = 2_000_000 * second + 2_000_000 * max(0, second - 20)
        progress.show_grains(grain_count=20_789, awake_count=7_000, grain_steps=steps)
        clock.now += 1
    assert progress.bed_words == ["20,789 grains", "33 % awake", "4 million grain-steps/s"]
    progress.show_grains(grain_count=10, awake_count=10, grain_steps=0)  # another bed has no rate yet
    assert progress.bed_words == ["10 grains", "100 % awake"]
    progress.show_grains(grain_count=10, awake_count=9, grain_steps=0, slow_count=4)
    assert progress.bed_words == ["10 grains", "90 % awake", "40 % slow"]
    progress.stage("report")
    assert progress.bed_words == []


@pytest.mark.parametrize(("steps", "words"), [(0, []), (2_000, ["compiling"]), (2e6, ["1 million grain-steps/s"])])
def test_a_bed_whose_first_steps_wait_for_kernels_has_no_rate(clock, steps, words):
    progress = Progress(clock=clock)
    progress.stage("robot", total=100)
    for done in (0, steps):
        progress.show_grains(grain_count=6_000, awake_count=6_000, grain_steps=int(done))
        clock.now += 2
    assert progress.bed_words[2:] == words


def test_lines_and_bars_show_the_bed(clock):
    stream = io.StringIO()
    console = Console(file=io.StringIO(), force_terminal=True, width=140, color_system=None)
    for progress in (LineProgress(stream, every=10, clock=clock), LiveProgress(console, clock=clock)):
        with progress:
            progress.stage("drive", total=100)
            for done in (10, 20):
                clock.now += 10
                progress.show_grains(grain_count=20_789, awake_count=7_000, grain_steps=3_000_000 * done)
                progress.update(done)
    line, bars = stream.getvalue().splitlines()[-1], console.file.getvalue()
    for piece in ("20 %", "1:20 to go", "20,789 grains", "33 % awake", "3 million grain-steps/s"):
        assert piece in line and piece in bars, piece


def test_the_kind_suits_the_stream():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    assert type(make_progress(io.StringIO())) is LineProgress
    assert type(make_progress(Terminal())) is LiveProgress
    assert type(make_progress(Terminal(), quiet=True)) is Progress


def test_the_preparation_of_a_bed_takes_a_progress_for_one_without_beds():
    """Benchmarks pass it as it is: its words on grains are not the protocol's."""
    assert not isinstance(Progress(), ShowsBed)
    assert isinstance(Stages(Progress(), bool), ShowsBed)
