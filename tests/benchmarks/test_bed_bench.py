"""The race of the bed: what peers' logs say, who counts, and a tiny race from end to end."""

import json
import math
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from race_stacks import stack

import benchmarks.bed as race
from benchmarks.bed import Lane, Settings, pick_best
from benchmarks.race import table
from benchmarks.race.entrants import LIGGGHTS, Entrant, Heat, Ours, PeerError, read_log, read_yade, run_peer
from benchmarks.race.grains import BENCH, DIAMETER, coordination, packing, prepare_grains, wrapped, write_data
from benchmarks.race.yardstick import Yardstick, compile_yardstick
from experiments.cli.benching import benchmark_options, spelled_out
from experiments.cli.main import main
from experiments.runs.progress import Progress

PROGRAMS = {
    "liggghts": ("liggghts",),
    "lammps": ("lmp", "lammps"),
    "openmpi-bin": ("mpirun",),
    "yade": ("yade",),
}
MISSING = [package for package, names in PROGRAMS.items() if not any(map(shutil.which, names))]

LIGGGHTS_LOG = """LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled 2022-01-26 by someone, git commit unknown)
units           si
run             ${warm}
    Step         KinEng             er             cn           zsum             Lx             Ly
       0              0              0           4504            6.5          0.044          0.044
    1000       1.75e-05        1.4e-06           4122            6.4          0.044          0.044
Loop time of 3.5 on 2 procs for 1000 steps with 1000 atoms, finish time Sat Nov 21 12:17:51 2026

Neighbor list builds = 4
Dangerous builds = 0
run             ${steps}
    Step         KinEng             er             cn           zsum             Lx             Ly
    1000       1.75e-05        1.4e-06           4122            6.4          0.044          0.044
    1200       2.25e-05        2.5e-06           4036            6.5          0.044          0.044
Loop time of 0.5 on 2 procs for 200 steps with 1000 atoms, finish time Sat Nov 21 12:17:52 2026

Neighbor list builds = 3
Dangerous builds = 1
"""

LAMMPS_LOG = """LAMMPS (29 Sep 2021 - Update 2)
OMP_NUM_THREADS environment is not set.
run             ${warm}
Step KinEng
       0            0
    1000     1.75e-05
Loop time of 3.5 on 2 procs for 1000 steps with 1000 atoms

99.0% CPU use with 2 MPI tasks x 1 OpenMP threads
Neighbor list builds = 4
Dangerous builds = 0
run             ${steps}
Step KinEng c_turning c_touching c_heights Lx Ly
    1000     1.75e-05      1.4e-06         4130          6.4        0.044        0.046
    1200     2.25e-05      2.5e-06         4010          6.5        0.044        0.046
Loop time of 0.25 on 2 procs for 200 steps with 1000 atoms

99.0% CPU use with 2 MPI tasks x 1 OpenMP threads
Neighbor list builds = 2
Dangerous builds = 0
Total wall time: 0:00:05
"""


# What logs say


def test_the_timed_run_is_read_from_a_log_of_liggghts():
    outcome = read_log(LIGGGHTS_LOG)
    assert outcome.version == "LIGGGHTS-PUBLIC 3.8.0"
    assert (outcome.time, outcome.steps, outcome.grain_count) == (0.5, 200, 1000)
    assert (outcome.list_count, outcome.missed) == (3, 1)
    assert outcome.kinetic_energy == pytest.approx(2.5e-5)
    assert outcome.coordination == 4.036
    assert outcome.mean_height == 6.5e-3
    assert outcome.period == (0.044, 0.044)


def test_the_timed_run_is_read_from_a_log_of_lammps():
    outcome = read_log(LAMMPS_LOG)
    assert outcome.version == "29 Sep 2021 - Update 2"
    assert (outcome.time, outcome.steps, outcome.list_count, outcome.missed) == (0.25, 200, 2, 0)
    assert outcome.coordination == 4.010
    assert outcome.period == (0.044, 0.046)


@pytest.mark.parametrize(
    ("log", "said"),
    [
        ("", "no timed run"),
        (LAMMPS_LOG.partition("run             ${steps}")[0], "no timed run"),
        (LAMMPS_LOG.replace("         4010", ""), "cannot be read"),
        (LAMMPS_LOG.replace("         4010", "      garbled"), "cannot be read"),
        (LAMMPS_LOG.replace("Neighbor list builds = 2", ""), "cannot be read"),
    ],
)
def test_a_log_that_lacks_something_is_refused(log, said):
    with pytest.raises(PeerError, match=said):
        read_log(log)


def test_what_yade_wrote_is_read_and_refused_where_it_lacks_something():
    told = {
        "version": "2023.02a", "time": 0.5, "steps": 200, "grain_count": 1000, "list_count": 3, "missed": 0,
        "kinetic_energy": 2.5e-5, "coordination": 4.036, "mean_height": 6.5e-3, "period": [0.044, 0.046],
    }  # fmt: skip
    outcome = read_yade(json.dumps(told))
    assert (outcome.steps, outcome.coordination, outcome.period) == (200, 4.036, (0.044, 0.046))
    for wrong in ({"time": 0.0}, {"coordination": math.nan}, {"period": [1]}, {"more": 1}):
        with pytest.raises(PeerError, match="cannot be read"):
            read_yade(json.dumps(told | wrong))
    with pytest.raises(PeerError, match="cannot be read"):
        read_yade(json.dumps({key: value for key, value in told.items() if key != "steps"}))


def test_with_and_without_rolling_each_has_a_best_peer():
    lanes = [lane("free", 6.0), lane("rolls", 9.0), lane("rolls too", 8.0)]
    for one in lanes[1:]:
        one.entrant.rolling = True
    assert pick_best(lanes) is lanes[0]
    assert pick_best(lanes, rolling=True) is lanes[1]
    lanes[1].other_work = "coordination -1.4 %"
    assert pick_best(lanes, rolling=True) is lanes[2]


def test_a_peer_that_fails_is_quoted(tmp_path, monkeypatch):
    for name, text in (("mpirun", "echo 'not enough slots'; exit 5"), ("liggghts", "exit 0")):
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PeerError, match=r"LIGGGHTS failed \(exit status 5\): not enough slots"):
        run_peer(LIGGGHTS, tmp_path, ranks=2, variables={"in": "bed.data"}, limit=10)


def test_a_peer_that_hangs_is_ended(tmp_path, monkeypatch):
    for name in ("mpirun", "liggghts"):
        (tmp_path / name).write_text("#!/bin/sh\nexec /bin/sleep 60\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PeerError, match="was ended after 0 s"):
        run_peer(LIGGGHTS, tmp_path, ranks=2, variables={}, limit=0.2)


# What is measured


def test_coordination_of_a_stack_counts_neighbours_across_the_periods_but_not_the_floor():
    grains = stack(layers=2)
    assert coordination(grains) == 8  # four beside, four above or below


def test_packing_of_a_column_of_known_height():
    assert packing(0.3, (1.0, 1.0), mean_height=0.25) == pytest.approx(0.6)


def test_positions_are_wrapped_into_the_period():
    inside = wrapped(np.array([[-1e-20, 1.5, -2.0], [1.0, 0.25, 3.0]]), (1.0, 1.0))
    assert inside.tolist() == [[0.0, 0.5, -2.0], [0.0, 0.25, 3.0]]


def test_a_data_file_holds_every_grain_in_a_box_that_takes_them(tmp_path):
    grains = stack()
    write_data(tmp_path / "bed.data", grains)
    lines = (tmp_path / "bed.data").read_text().splitlines()
    assert "320 atoms" in lines
    assert f"0 {grains.period[0]:.12g} xlo xhi" in lines
    rows = np.loadtxt(lines[lines.index("Atoms") + 1 :])
    assert rows[:, 0].tolist() == list(range(1, 321))
    assert rows[:, 2:4] == pytest.approx(np.tile([DIAMETER, BENCH.density], (320, 1)))
    assert rows[:, 4:] == pytest.approx(grains.positions, rel=1e-11)
    height = float(next(line for line in lines if line.endswith("zhi")).split()[1])
    assert height > (grains.positions[:, 2] + grains.radii).max()


# The yardstick in C


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    found, said = compile_yardstick(tmp_path_factory.mktemp("yardstick"))
    if found is None:
        pytest.skip(said)
    return found


@pytest.mark.long
@pytest.mark.parametrize("blocks", [True, False])
def test_the_c_loop_does_our_work_to_round_off(blocks, program, ours, tmp_path):
    """The same law and order of a step: what differs is the order of sums, and how that has grown in 1020 steps."""
    heat = ours.heat(20)
    loop = Yardstick(stack(), program=program, folder=tmp_path, threads=2, blocks=blocks, skin=1e-4).heat(20)
    assert loop.coordination == heat.coordination
    assert loop.packing == pytest.approx(heat.packing, rel=1e-9)
    assert loop.kinetic_energy == pytest.approx(heat.kinetic_energy, rel=1e-6)
    there = np.fromfile(tmp_path / "yardstick.out").reshape(-1, 3)
    period = np.array([*stack().period, np.inf])
    apart = there - ours._bed.grains().position
    apart[:, :2] -= period[:2] * np.round(apart[:, :2] / period[:2])
    assert np.abs(apart).max() < 1e-6 * DIAMETER


def test_the_c_loop_with_rolling_does_the_same_in_blocks_and_pair_by_pair(program, tmp_path):
    options = {"program": program, "folder": tmp_path, "skin": 2e-4, "rolling": True}
    heats = [
        Yardstick(stack(), blocks=blocks, threads=threads, **options).heat(20)
        for blocks in (True, False)
        for threads in (1, 2)
    ]
    assert {heat.coordination for heat in heats} == {heats[0].coordination}
    energies = [heat.kinetic_energy for heat in heats]
    assert energies == pytest.approx(4 * [energies[0]], rel=1e-6)
    free = Yardstick(stack(), blocks=True, threads=1, **{**options, "rolling": False}).heat(20)
    assert free.kinetic_energy > 1.01 * energies[0]


def test_without_a_compiler_the_c_loop_is_left_out_and_that_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    program, said = compile_yardstick(tmp_path)
    assert program is None and "apt install" in said


# Who counts


class Fake(Entrant):
    def __init__(self, name, *, counted=True, skin=2e-4):
        self.name, self.counted, self.skin, self.threads = name, counted, skin, 2

    def heat(self, steps):
        raise NotImplementedError


def lane(name, *speeds, coordination=4.0, packing=0.58, missed=0, **options):
    heats = [
        Heat(
            speed=speed,
            list_count=1,
            coordination=coordination,
            packing=packing,
            kinetic_energy=1e-5,
            missed=missed,
            version="1",
        )
        for speed in speeds
    ]
    return Lane(Fake(name, **options), heats)


def test_the_best_peer_is_the_fastest_that_counts_and_did_the_same_work():
    ours = lane("ours", 9.0, counted=False)
    others = [
        lane("slow", 4.0, 5.0, 6.0),
        lane("best", 6.0, 7.0, 1.0, coordination=4.03),
        lane("loose", 8.0, packing=0.5785),
        lane("few", 8.0, coordination=3.95),
        lane("blind", 8.0, coordination=math.nan),
        lane("late", 8.0, missed=2),
        lane("shown", 8.0, counted=False),
        lane("fell"),
    ]
    others[-1].failure = "exit status 1"
    race._check_work(ours, others)
    best = pick_best([ours, *others])
    assert best is not None and best.entrant.name == "best" and best.speed == 6.0
    said = {other.entrant.name: other.other_work for other in others}
    assert said == {
        "slow": "",
        "best": "",
        "loose": "packing -0.26 %",
        "few": "coordination -1.2 %",
        "blind": "coordination +nan %",
        "late": "2 lists came too late",
        "shown": "",
        "fell": "",
    }
    assert pick_best([ours, *others[2:]]) is None


def test_each_peer_goes_on_with_its_fastest_skin_and_those_near_to_it():
    lanes = [
        lane("a", 10.0, skin=1e-4),
        lane("a", 9.0, skin=2e-4),
        lane("a", 8.0, skin=4e-4),
        lane("b", 1.0, skin=1e-4),
        lane("b", skin=2e-4),
        lane("c", 6.0, skin=1e-4),
    ]
    assert race._leaders(lanes) == [lanes[0], lanes[1], lanes[5]]  # b has no chance


def test_an_option_that_stands_alone_means_yes():
    assert spelled_out(["bench", "bed", "--limit", "--out", "b", "--quiet"]) == [
        "bench", "bed", "--limit=yes", "--out", "b", "--quiet",
    ]  # fmt: skip
    assert spelled_out(["tumble", "--sleep"]) == ["tumble", "--sleep"]
    assert benchmark_options(race.run, {"limit": "yes"}) == {"limit": True}
    with pytest.raises(ValueError, match="limit = '3' must be yes or no"):
        benchmark_options(race.run, {"limit": "3"})


def test_the_environment_sets_sizes_rounds_and_steps(monkeypatch):
    assert Settings.from_environment() == Settings((20_000, 100_000), 5, None, True)
    for name, value in {"SIZES": "300,400 500", "ROUNDS": "2", "STEPS": "20", "SHOWN": "0"}.items():
        monkeypatch.setenv(f"HEDGEBED_BENCH_{name}", value)
    assert Settings.from_environment() == Settings((300, 400, 500), 2, 20, False)
    for name, value in {"SIZES": "many", "ROUNDS": "1 2", "STEPS": "0", "SHOWN": "no"}.items():
        with monkeypatch.context() as wrong:
            wrong.setenv(f"HEDGEBED_BENCH_{name}", value)
            with pytest.raises(ValueError, match=f"HEDGEBED_BENCH_{name} = '{value}' must be"):
                Settings.from_environment()


# From end to end


@pytest.fixture(scope="module")
def ours():
    """Our bed of the stack, for every race here: compiling it takes longer than all of them."""
    return Ours(stack(), threads=len(os.sched_getaffinity(0)))


@pytest.fixture
def tiny(ours, tmp_path, monkeypatch):
    """A race of 320 grains that need no preparation, 20 steps, two rounds."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(race, "prepare_grains", lambda count, **options: stack())
    monkeypatch.setattr(race, "Ours", lambda grains, **options: ours)
    monkeypatch.setattr(race, "SKINS", (2e-4,))
    for name, value in {"SIZES": "320", "ROUNDS": "2", "STEPS": "20", "SHOWN": "0"}.items():
        monkeypatch.setenv(f"HEDGEBED_BENCH_{name}", value)


@pytest.mark.long
def test_coordination_from_positions_is_that_of_the_beds_own_lists(ours):
    """The bed's has the floor's contacts as well."""
    heat = ours.heat(20)
    bed = ours._bed
    grains = bed.grains()
    floor = np.count_nonzero(grains.position[:, 2] < grains.radius)
    assert heat.coordination > 6
    assert bed.coordination_number == pytest.approx(heat.coordination + floor / bed.grain_count, rel=1e-12)


def test_a_race_without_peers_has_null_ratios_and_says_who_was_missing(tiny, monkeypatch, capfd):
    import experiments.cli.benching

    monkeypatch.setattr(experiments.cli.benching, "load_benchmark", lambda what: race.run)
    monkeypatch.setenv("PATH", "")
    assert main(["bench", "bed", "--out", "b", "--quiet", "--json"]) == 0
    shown = capfd.readouterr()
    bench = json.loads(Path("b/bench.json").read_text())
    assert json.loads(shown.out) == bench
    assert (bench["format"], bench["what"], bench["ratios"]) == ("hedgebed-bench/1", "bed", {"320": None})
    assert bench["peers"] == {"LIGGGHTS": None, "LAMMPS": None, "YADE": None}
    for name in bench["peers"]:
        assert any(name in remark and "apt install" in remark for remark in bench["remarks"])
        assert name in shown.err
    (bed,) = bench["beds"]
    (ours,) = bed["entrants"]
    assert ours["speed"] > 0 and ours["ours"]
    first, second = (heat["kinetic_energy"] for heat in ours["heats"])
    assert first == second > 0  # every heat starts from the same state
    assert bed["best_peer"] is None
    assert [path.name for path in Path().iterdir()] == ["b"]
    assert [path.name for path in Path("b").iterdir()] == ["bench.json"]
    assert str(Path.cwd()) not in json.dumps(bench)


@pytest.mark.skipif(bool(MISSING), reason=f"races against peers: apt install {' '.join(MISSING)}")
def test_a_race_on_a_stack_finds_that_peers_do_the_same_work(tiny, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", None)
    if len(os.sched_getaffinity(0)) > 2:  # so few grains cannot be shared out among many
        monkeypatch.setattr("benchmarks.race.machine.cores_there", lambda: 2)
    bench = race.run(tmp_path / "b", progress=Progress())
    (bed,) = bench["beds"]
    assert {entrant["failure"] for entrant in bed["entrants"]} == {""}
    assert {entrant["other_work"] for entrant in bed["entrants"]} == {""}
    assert bench["ratios"]["320"] > 0
    assert all(bench["peers"].values())
    assert "best peer" in capfd.readouterr().out
    assert list((tmp_path / "temporary").iterdir()) == []
    assert not (tmp_path / "b").exists()
    marks = table.marks_of(bench)
    page = table.insert(f"before\n{marks[0]}\nold\n{marks[1]}\nafter\n", table.markdown(bench), marks)
    assert page.startswith("before\n") and page.endswith("after\n") and "old" not in page
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    assert len(rows) == 1 + 4
    assert len({row.count("|") for row in rows}) == 1


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"races against peers: apt install {' '.join(MISSING)}")
def test_a_race_on_a_prepared_bed_finds_that_peers_do_the_same_work(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    grains = prepare_grains(2000)
    assert grains.count == 2000
    assert (grains.positions[:, :2] >= 0).all() and (grains.positions[:, :2] < grains.period).all()
    again = prepare_grains(2000)  # from the cache
    assert (again.positions == grains.positions).all()
    monkeypatch.setattr(race, "prepare_grains", lambda count, **options: grains)
    for name, value in {"SIZES": "2000", "ROUNDS": "1", "STEPS": "200", "SHOWN": "0"}.items():
        monkeypatch.setenv(f"HEDGEBED_BENCH_{name}", value)
    bench = race.run(tmp_path / "b", progress=Progress())
    entrants = bench["beds"][0]["entrants"]
    assert [entrant["failure"] for entrant in entrants] == [""] * 8  # one that was ended has done no work to compare
    assert [entrant["other_work"] for entrant in entrants] == [""] * 8
