"""Several beds under one robot: their mean and its interval, what a law leaves open, and what stands beside grains."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from spatial_runs import EXAMPLES, grain_bed

from experiments.compare.robots import read_moved
from experiments.grains.bed_progress import show_bed
from experiments.grains.bed_result import sides_warning, sleep_words
from experiments.grains.on_bed import PlatformOnBed
from experiments.platform.law_spread import moved
from experiments.robot import experiment as robot
from experiments.robot.beds import carry_out_beds
from experiments.robot.feet import heights_of
from experiments.robot.flight import find_flights
from experiments.robot.on_grains import RobotFollowed, RobotOnBed
from experiments.robot.plan import plan_robot
from experiments.robot.result import quantities_of, write_series_of
from experiments.robot.settings import RobotSettings
from experiments.robot.sure import ANSWER, sure_of_law
from experiments.runs.folder import RunFolder, write_series
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.whole_runs import draw_report
from rigid.ground.laws import find_law
from rigid.ground_file import GroundFile
from rigid.intervals import NORMAL
from vis.robot.beds import answer_tiles

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",)}
ON_BED = HOPPER | {"ground": "bed", "height": 0.012, "grain": 0.012, "bed_size": (0.2, 0.2, 0.16), "duration": 0.2}


def followed(**given):
    """A robot that was followed on a law."""
    settings = RobotSettings(**given)
    run = RobotFollowed(settings, plan_robot(settings)).run_on_law()
    run.run()
    return run


@pytest.mark.parametrize(("more", "law"), [({}, "rft"), ({"stiffness": 500.0}, "spring-damper")])
def test_beside_a_robot_on_grains_stands_its_run_on_the_law_that_is_the_default(more, law):
    settings = RobotSettings(**ON_BED | more)
    beside = RobotOnBed(settings, plan_robot(settings)).beside
    alone = followed(**HOPPER, height=0.012, duration=0.2, **more)
    assert settings.default_law == law == RobotSettings(**HOPPER, **more).ground
    count = len(alone.columns["z"])  # beside a bed it is followed on, until it rests
    assert (beside.columns["z"][:count] == alone.columns["z"]).all() and beside.columns["sinkage"].max() > 0.001


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"seeds": (1, 2)}, "seeds = 1 2 belongs to ground = 'bed'"),
        ({"ground": "bed", "seeds": (1, 2), "seed": 3}, "seed = 3 and seeds are both given"),
        ({"ground": "bed", "seeds": (1, 2, 1)}, "seeds = 1 2 1 holds a seed twice"),
    ],
)
def test_seeds_are_of_several_beds_and_each_is_given_once(given, said):
    with pytest.raises(ValueError, match=said):
        RobotSettings(**HOPPER | given)


def law_in_place_of_grains(computed):
    """A `RobotOnBed.carry_out` that follows the robot on `rft` from a height that goes with the seed."""

    def carry_out(self, folder, progress):
        seed = self.settings.seed
        computed.append(seed)
        if computed == [1, 2]:
            raise KeyboardInterrupt
        run = followed(**HOPPER, height=0.01 * seed, duration=0.12)
        heights, rows = heights_of(run), run.columns
        numbers = quantities_of(run, heights, find_flights(run, heights))
        write_series_of(run, folder.path)
        columns = {"t_s": rows["time"], "z_m": rows["z"], "sinkage_m": rows["sinkage"]}
        write_series(folder.path / "series" / "rft.csv", columns)
        folder.write_result(Result.make(
            "mujoco", title="a robot on a bed of sand", quantities=numbers, code="of grains",
            departures={"sentences": ["said of all"]}, trial={}, surface="sand", ground="bed", duration=0.12,
            hop=seed != 2, feet=["foot"], feet_reached={"foot": {"clearance_largest": float(heights.max())}},
            warnings=["on all", f"on {seed}"], grains={"seed": seed, "beside": numbers, "beside_law": "rft"},
        ))  # fmt: skip

    return carry_out


def test_several_beds_have_means_with_students_interval_and_a_stopped_run_computes_no_bed_twice(tmp_path, monkeypatch):
    """Mean ± t s / sqrt(n), t of Student at 97.5 % and n - 1 degrees of freedom."""
    computed = []
    monkeypatch.setattr(RobotOnBed, "carry_out", law_in_place_of_grains(computed))
    monkeypatch.setattr(RobotOnBed, "check", lambda _: None)
    settings = RobotSettings(**ON_BED, seeds=(1, 2, 3), controller=f"{EXAMPLES / 'mujoco-hopper' / 'hop.py'}:control")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(RobotOnBed, "forecast", None)
        patch.setattr(RobotOnBed, "beside", None)
        robot.run(settings, tmp_path)
    assert RunFolder.open(tmp_path / "beds" / "seed-2").status == "stopped"
    with monkeypatch.context() as patch:
        patch.setattr(RobotOnBed, "forecast", None)
        patch.setattr(RobotOnBed, "beside", None)
        result = robot.resume(tmp_path)
    assert computed == [1, 2, 2, 3]
    of_beds = [RunFolder.open(tmp_path / "beds" / f"seed-{seed}").read_result() for seed in (1, 2, 3)]
    for name in ("sinkage_largest", "largest_force"):
        values = [one["quantities"][name]["value"] for one in of_beds]
        half = stats.t.ppf(0.975, 2) * np.std(values, ddof=1) / math.sqrt(3)
        assert result.quantities[name].value == pytest.approx(np.mean(values)) and np.ptp(values) > 0
        assert result.quantities[name].std == pytest.approx(np.std(values, ddof=1))
        assert result["sure"][name]["high"] == pytest.approx(np.mean(values) + half)
    no_rise = [bed["answer"]["highest"] == bed["answer"]["clearance_largest"] == 0.0 for bed in result["beds"]]
    assert no_rise == [False, True, False] and result["hop"]  # of the second bed, on which the robot stays
    largest = max(one["quantities"]["energy_residual"]["value"] for one in of_beds)
    assert result.quantities["energy_residual"].value == largest
    assert result.warnings == ["on all", *(f"seed {k}: on {k}" for k in (1, 2, 3))]
    assert "3 beds" in result.title and "±" in result.departures.sentences[0]
    assert (tmp_path / "beds" / "seed-3" / "controller.py").read_bytes() == (tmp_path / "controller.py").read_bytes()
    report = (tmp_path / "report.html").read_text()
    assert "chance (95" in report and (tmp_path / "figures" / "beds.png").exists()
    with pytest.raises(ValueError, match=r"name one of them.*seed-1"):
        read_moved(tmp_path, result)


@pytest.mark.long
def test_the_report_of_each_bed_is_in_the_time_to_go(tmp_path, monkeypatch):
    """45 s each, with pictures of grains."""
    planned, begun = {}, []

    class Plan(Progress):
        def plan(self, costs, **given):
            planned.update(given["seconds"])

        def stage(self, name, total=None):
            begun.append(name)

    made = law_in_place_of_grains([])
    monkeypatch.setattr(
        RobotOnBed, "carry_out",
        lambda self, folder, progress: (made(self, folder, progress), draw_report(folder, progress)),
    )  # fmt: skip
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    settings = RobotSettings(**ON_BED, seeds=(1, 3), controller=f"{EXAMPLES / 'mujoco-hopper' / 'hop.py'}:control")
    carry_out_beds(settings, plan_robot(settings), RunFolder.create(tmp_path / "run", "mujoco", settings), Plan())
    assert planned == {"report, seed 1": 45.0, "report, seed 3": 45.0, "report": 5.0} and begun == list(planned)


def test_two_beds_of_grains_have_an_interval_that_holds_both(tmp_path, monkeypatch):
    monkeypatch.setattr(RobotOnBed, "prepare", lambda self, *_: grain_bed(young=5e6 * self.settings.seed))
    monkeypatch.setattr(RobotOnBed, "check", lambda _: None)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    given = ON_BED | {"grain": 0.006, "bed_size": (0.096, 0.096, 0.05), "duration": 0.03, "height": 0.003}
    result = robot.run(RobotSettings(**given, frame_count=0, seeds=(1, 2)), tmp_path)
    forces = [bed["answer"]["largest_force"] for bed in result["beds"]]
    sure = result["sure"]["largest_force"]
    assert forces[0] != forces[1] and min(forces) > 1.0
    assert sure["low"] <= min(forces) and max(forces) <= sure["high"]
    assert not [said for said in result.warnings if "one bed" in said]


def test_slow_grains_of_a_bed_that_sleeps_are_shown_beside_those_awake():
    bed, progress = grain_bed(), Progress()
    bed.let_sleep()
    bed.sleeper.fast = 384  # half of the 768 grains, as after a check that made the others slow
    progress.stage("robot", total=1.0)
    show_bed(progress, bed)
    assert progress.bed_words == ["768 grains", "100 % awake", "50 % slow"]


def test_a_run_with_sleep_states_what_it_saved_and_that_it_saved_next_to_nothing(tmp_path, monkeypatch):
    """No grain is slow for the first sqrt(d / g) = 25 ms."""
    monkeypatch.setattr(RobotOnBed, "prepare", lambda *_: grain_bed())
    monkeypatch.setattr(RobotOnBed, "check", lambda _: None)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    progress, said = Progress(), []
    monkeypatch.setattr(progress, "message", said.append)
    given = ON_BED | {"grain": 0.006, "bed_size": (0.096, 0.096, 0.05), "duration": 0.012, "height": 0.003}
    result = robot.run(RobotSettings(**given, frame_count=0, sleep=True), tmp_path, progress=progress)
    own = [one for one in result["departures"]["sentences"] if "leep" in one]
    assert own == [one for one in said if one in own] and len(own) == 2
    assert "100% of" in own[0] and "0 of 768" in own[0]


def test_a_bed_of_which_a_part_sleeps_states_how_many_grains_do():
    """1,000 grains, 10 exchanges of 10 steps after the placement's 5: 40,000 of 100,000 grain-steps."""
    bed = SimpleNamespace(grain_count=1000, sleeper=SimpleNamespace(awake=300, fast=100))
    master = SimpleNamespace(count=15)
    run = SimpleNamespace(master=master, placing_steps=5, samples={"grain_steps": np.array([5e4, 7e4, 9e4])})
    (said,) = sleep_words(RobotSettings(**ON_BED, sleep=True, substeps=10), run, bed)
    assert "40% of" in said and "700 of 1,000" in said and "200 are slow" in said
    assert sleep_words(RobotSettings(**ON_BED), run, bed) == []


def test_a_preparation_is_expected_to_last_longer_in_less_gravity_and_a_robot_is_not_set_down():
    """Times of similar motions of dry grains go with 1 / sqrt(g)."""
    runs = [RobotSettings(**ON_BED, gravity=g) for g in (9.81, 0.0981)]
    costs = [RobotOnBed(settings, plan_robot(settings)).costs for settings in runs]
    assert costs[1]["bed"] == pytest.approx(10 * costs[0]["bed"]) and costs[0]["robot"] == costs[1]["robot"] == 0.2


def test_a_bed_prepared_in_more_gravity_rests_in_that_of_the_run(monkeypatch):
    """The floor carries the weight of the grains in the run's gravity."""
    made = []
    monkeypatch.setattr(PlatformOnBed, "prepare", lambda *_: made.append(grain_bed()) or made[0])
    settings = RobotSettings(**ON_BED | {"grain": 0.006}, gravity=0.0981, settle_gravity=9.81)
    on_bed = RobotOnBed(settings, plan_robot(settings))
    assert on_bed.first_gravity == 9.81
    progress, shares = Progress(), []
    monkeypatch.setattr(progress, "update", lambda done: shares.append((progress.stage_name, done)))
    bed = on_bed.prepare(None, progress)
    assert len(shares) > 2 and {stage for stage, _ in shares} == {"lower gravity"}
    assert [done for _, done in shares] == sorted({done for _, done in shares}) and shares[-1][1] < 1
    assert bed is made[0] and bed.gravity[2] == pytest.approx(-0.0981) and bed.steps == 0
    assert bed.floor_force == pytest.approx(bed.weight, rel=0.02)


def test_another_gravity_of_a_bed_is_refused_below_that_of_the_run_and_on_a_law():
    settings = RobotSettings(**ON_BED, gravity=9.81, settle_gravity=1.0)
    with pytest.raises(ValueError, match=r"settle_gravity = 1 m/s2 is below"):
        RobotOnBed(settings, plan_robot(settings)).check()
    with pytest.raises(ValueError, match=r"settle_gravity = 1\.0 belongs"):
        RobotSettings(**HOPPER, settle_gravity=1.0)


def surely(path, **given):
    """The result of a short run on a law."""
    return robot.run(RobotSettings(**HOPPER | given, height=0.012, duration=0.12, frame_count=0), path)


def of_the_largest_foot():
    """K [N/m] and C [N s/m] of the foot of the leg on sand, as similarity has them."""
    plan = plan_robot(RobotSettings(**HOPPER, ground="spring-damper"))
    own = plan.feet_options(plan.robot())["under"]["foot"]
    return own["stiffness"], own["damping"]


def test_a_hop_on_a_law_has_the_range_that_k_of_the_surface_leaves_open(tmp_path, monkeypatch):
    """Ends of the range: the same robot on K at 95 % of the map, and as much lower as that is higher, as a factor."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    result = surely(tmp_path / "sand", ground="spring-damper")
    known = plan_robot(RobotSettings(**HOPPER, ground="spring-damper")).rule.answer.stiffness
    k, c = of_the_largest_foot()
    factor = 1 + NORMAL * known.std / known.value
    assert factor > 2  # one less than that below K would be negative
    ends = [
        surely(tmp_path / name, ground="spring-damper", stiffness=k * times, damping=c)
        for name, times in (("low", 1 / factor), ("high", factor))
    ]
    for name in ("sinkage_largest", "largest_force"):
        values = [one.quantities[name].value for one in (result, *ends)]
        sure = result["sure"][name]
        assert (sure["low"], sure["high"]) == pytest.approx((min(values), max(values)), rel=1e-3)
        assert sure["high"] > 1.05 * sure["low"]
    assert set(result["sure"]) == set(ANSWER) and "factor of 2" in " ".join(result.departures.sentences[:2])
    tile = next(tile for tile in answer_tiles(result) if tile.label == "Sinkage")
    assert " to " in tile.errors[0]
    assert "sure" not in ends[0] and [said for said in ends[0].departures.sentences if "is not known" in said]


def test_the_range_of_k_reaches_each_foot_where_the_map_of_sticking_grains_has_it():
    plan = plan_robot(RobotSettings(**HOPPER, surface="jsc1a", gravity=0.0981))
    tried: list[float] = []

    def follow(other):
        tried.append(other.feet_options(other.robot())["under"]["foot"]["stiffness"])
        return dict.fromkeys(ANSWER, -0.001 * len(tried))

    follow(plan)
    sure, _ = sure_of_law(plan, dict.fromkeys(ANSWER, -0.002), follow)
    known = plan.rule.answer.stiffness
    half = NORMAL * known.std / known.value
    assert tried[1] / tried[0] == pytest.approx(1 - half if half < 1 else 1 / (1 + half))
    assert tried[2] / tried[0] == pytest.approx(1 + half)
    # A rise may be below 0, a depth not.
    assert (sure["highest"]["low"], sure["highest"]["high"]) == (-0.003, -0.002)
    assert (sure["sinkage_largest"]["low"], sure["sinkage_largest"]["high"]) == (0.0, 0.0)


@pytest.mark.parametrize(
    "given", [{"surface": "brick"}, {"ground": "katsuragi-durian", "ground_parameters": ("drag=50",)}]
)
def test_a_law_whose_numbers_have_no_range_says_that_its_error_is_not_known(given, tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    result = surely(tmp_path, **given)
    assert "sure" not in result and len([x for x in result.departures.sentences if "is not known" in x]) == 1


def test_a_ground_file_gives_the_range_of_the_95_percent_intervals_of_its_parameters(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    values = find_law("spring-damper").values({"stiffness": 39.0, "damping": 0.16})
    file = GroundFile(
        format="hedgebed-ground/1", law="spring-damper", material="sand", source="a test",
        foot={"tip": "sphere", "diameter": 0.012},
        range={"load": (0, 50), "depth": (0, 0.1), "speed": (0, 5), "gravity": (9.8, 9.9), "diameter": (0.012, 0.012)},
        parameters={name: {"value": values[name], "std": 10.0 * (name == "stiffness")} for name in values},
    )  # fmt: skip
    assert [name for name, *_ in moved(file)] == ["stiffness"]
    result = surely(tmp_path / "run", ground=str(file.write(tmp_path / "ground.toml")))
    ends = [
        surely(tmp_path / f"{k}", ground=str(other.write(tmp_path / f"{k}.toml"))).quantities["sinkage_largest"].value
        for k, other in enumerate(moved(file)[0][1:])
    ]
    sure = result["sure"]["sinkage_largest"]
    assert sure["high"] - sure["value"] == pytest.approx(NORMAL * abs(ends[0] - ends[1]) / 2, rel=1e-6)


@pytest.mark.parametrize(("way", "said"), [(0.2, False), (1.5, True)])
def test_a_bed_whose_sides_moved_is_said_to_be_too_narrow(way, said):
    # 10 mm grains; those of the lower half and of the middle move far and do not count.
    places = np.stack(np.meshgrid(*[np.arange(0.005, 0.2, 0.01)] * 3, indexing="ij"), -1).reshape(-1, 3)
    at_side = (np.minimum(places, 0.2 - places)[:, :2] < 0.01).any(axis=1) & (places[:, 2] > 0.1)
    moved_by = np.zeros_like(places)
    moved_by[:, 2] = np.where(at_side, way * 0.01, 0.05)
    grains = SimpleNamespace(radius=np.full(len(places), 0.005), position=places + moved_by, displacement=moved_by)
    bed = SimpleNamespace(size=(0.2, 0.2, 0.25), surface=0.2, grains=lambda contacts: grains)
    warning = sides_warning(bed)
    assert (warning is not None) == said
    assert not said or ("1.5 diameters" in warning and "0.3 by 0.3" in warning)
