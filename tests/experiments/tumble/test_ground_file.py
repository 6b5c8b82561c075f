"""`--ground ground.toml` of tumble, hop, paper and penetrate."""

import numpy as np
import pytest

from experiments import hop, paper, penetrate, tumble
from experiments.hop.numbers import plan_hop
from experiments.paper.experiment import plan_jobs
from experiments.platform.ground_file import reached
from experiments.platform.law_spread import Uncertain, moved, spread_of_law, spread_of_surface, uncertain_of
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import read_series
from experiments.runs.whole_runs import without_reports
from experiments.spatial.settings import SpatialSettings
from experiments.spatial.trial import plan_spatial
from experiments.tumble.trial import plan_tumble
from rigid.checks.unfit import UnfitSettingsError
from rigid.ground_file import GroundFile, read_ground
from rigid.planar.simulate import simulate

WIDE = {"load": (0, 50), "depth": (0, 0.1), "speed": (0, 5), "gravity": (0, 10), "diameter": (0.01, 0.012)}
SOFT = {"stiffness": 62.0, "damping": 0.5}
CROSSLEY = {"stiffness": 2.1e5, "dissipation": 0.2, "exponent": 1.5}


@pytest.fixture
def written(tmp_path):
    def write(law="spring-damper", values=SOFT, limits=WIDE, material="sand", stds=None):
        stds = dict.fromkeys(values, 0.1) if stds is None else stds
        made = GroundFile(
            format="hedgebed-ground/1", law=law, material=material, source="a test", range=limits,
            foot={"tip": "sphere", "diameter": 0.012},
            parameters={name: {"value": value, "std": stds[name]} for name, value in values.items()},
        )  # fmt: skip
        return str(made.write(tmp_path / "ground.toml"))

    return write


def test_a_tumble_on_a_file_of_one_spike_is_that_on_twice_its_k_and_c(written, tmp_path):
    on_file = tumble.run(tumble.Settings(ground=written(), duration=0.5), tmp_path / "a")
    given = tumble.Settings(surface="sand", stiffness=124.0, damping=1.0, duration=0.5)
    tumble.run(given, tmp_path / "b")
    paths = [read_series(tmp_path / name / "trajectory.csv") for name in "ab"]
    np.testing.assert_array_equal(paths[0]["theta_rad"], paths[1]["theta_rad"])
    assert on_file["ground"] == "spring-damper"
    assert on_file["ground_file"]["material"] == "sand"


def test_another_law_of_a_file_is_that_of_the_same_parameters(written):
    fitted = plan_tumble(tumble.Settings(ground=written("hunt-crossley", CROSSLEY), surface="sand")).trial
    given = tuple(f"{name}={value}" for name, value in CROSSLEY.items())
    named = tumble.Settings(ground="hunt-crossley", ground_parameters=given, surface="sand")
    assert fitted == plan_tumble(named).trial


def test_a_file_of_other_grains_than_the_surface_is_refused_by_both_names(written):
    for surface, made in (("brick", "hard ground"), ("jsc1a", "made of jsc-1a-loose-cut")):
        with pytest.raises(ValueError, match=f"surface = '{surface}' is {made}, .* of sand"):
            plan_tumble(tumble.Settings(ground=written(), surface=surface))
    own = tumble.Settings(ground=written(), mu_s=0.2, mu_d=0.1)  # another friction
    assert plan_tumble(own).trial.mu_s == 0.2


def test_a_tumble_that_leaves_the_range_says_which_number_and_how_far(written, tmp_path):
    limits = WIDE | {"depth": (0, 1e-3), "gravity": (1e-3, 1e-3)}
    result = tumble.run(tumble.Settings(ground=written(limits=limits), duration=0.3), tmp_path / "run")
    said = [text.split(" ")[0] for text in result["warnings"] if "outside the range" in text]
    assert said == ["depth"]
    assert any("0.000102 g" in text for text in result["warnings"] if "--gravity 1g" in text)


def test_what_a_tumble_reaches_at_rest_is_its_weight_on_four_spikes(written):
    trial = plan_tumble(tumble.Settings(ground=written(), torque=0.0)).trial
    found = reached(simulate(trial, duration=0.05))
    # At rest K z of each of the four spikes bears a quarter of the weight, as the rows stand at the same depth.
    assert found["load"] == pytest.approx(trial.weight / 4, rel=1e-3)
    assert found["depth"] == pytest.approx(trial.weight / 4 / 62.0, rel=1e-3)
    assert found["speed"] < 1e-6


def test_the_friction_of_grains_without_a_surface_is_said_to_be_the_default_s(written):
    plan = plan_tumble(tumble.Settings(ground=written(material="jsc-1a-dense-heights")))
    assert plan.surface == "brick"
    assert any("jsc-1a-dense-heights" in text for text in plan.warnings)


def test_a_run_goes_on_with_its_copy_when_the_file_is_gone(written, tmp_path):
    path = written()
    settings = tumble.Settings(ground=path, duration=0.2)
    first = tumble.run(settings, tmp_path / "run")
    (tmp_path / "ground.toml").unlink()
    again = tumble.resume(tmp_path / "run")
    assert again["quantities"] == first["quantities"]


def test_a_hop_from_a_file_is_that_from_twice_its_k_and_c(written):
    fitted, given = (
        plan_hop(hop.Settings(**options))
        for options in ({"ground": written()}, {"surface": "sand", "stiffness": 124.0, "damping": 1.0})
    )
    assert (fitted.stiffness, fitted.damping, fitted.law) == (given.stiffness, given.damping, None)
    assert fitted.numbers["mu_s"] == given.numbers["mu_s"]
    law = plan_hop(hop.Settings(ground=written("hunt-crossley", CROSSLEY))).law
    assert (law.name, law.spikes_per_row, dict(law.parameters)) == ("hunt-crossley", 2.0, CROSSLEY)


def test_the_paper_s_trials_stand_on_the_law_where_the_surface_is_of_its_grains(written):
    settings = paper.Settings(surfaces=("steel", "sand"), ground=written(), evidence=False, sweep=False)
    stiffness = {job.surface: job.trial.stiffness for job in plan_jobs(settings) if job.variant == "nominal"}
    assert stiffness == {"steel": 1.5e4, "sand": 124.0}
    with pytest.raises(ValueError, match="none of surfaces"):
        plan_jobs(paper.Settings(surfaces=("steel",), ground=written()))


def test_a_spike_set_down_on_the_law_of_a_file_rests_at_load_over_stiffness(written, tmp_path):
    settings = penetrate.Settings(ground=written(limits=WIDE | {"speed": (0.2, 0.3)}), load=0.2)
    result = penetrate.run(settings, tmp_path / "run")
    # A set-down ends within 0.3 % of its load.
    assert result["quantities"]["sinkage_law"]["value"] == pytest.approx(0.2 / 62.0, rel=4e-3)
    said = [text for text in result["warnings"] if "speed =" in text]
    assert [float(text.split("speed = ")[1].split(" ")[0]) for text in said] == [0.4, 0.1]


def test_a_drop_that_bounces_for_longer_than_a_law_has_steps_is_bad_input_and_the_pushes_are_kept(
    written, tmp_path, monkeypatch
):
    """Found by the fuzzer: nothing bounds a drop but drop_time, which was not counted."""
    path = written(values=SOFT | {"damping": 0.0})
    monkeypatch.setattr("experiments.penetrate.on_law.MOST_STEPS_ON_LAW", 3e4)
    settings = penetrate.Settings(ground=path, load=0.03, depth=1e-3, after_stop=1e9, rest_time=0.01)
    penetrate.check(settings)
    with pytest.raises(UnfitSettingsError, match=r"drop at 0.1 m/s: not over after .* s in .* change drop_time or"):
        penetrate.run(settings, tmp_path / "run")
    assert len(list((tmp_path / "run" / "series").iterdir())) == 3
    shorter = settings.model_copy(update={"drop_time": 0.01})
    with without_reports():
        assert penetrate.run(shorter, tmp_path / "shorter")["runs"][3]["ended"] == "max_time"


def test_what_cannot_stand_beside_a_file_is_refused(written):
    path = written()
    for kind, options, named in (
        (tumble.Settings, {"stiffness": 10.0}, "stiffness"),
        (tumble.Settings, {"ground_parameters": ("stiffness=10",)}, "ground_parameters"),
        (hop.Settings, {"damping": 1.0}, "damping"),
        (penetrate.Settings, {"model": "model.toml"}, "model"),
    ):
        with pytest.raises(ValueError, match=named):
            kind(ground=path, **options)
    for kind in (tumble, hop, paper, penetrate):
        with pytest.raises(ValueError, match="ground"):
            kind.Settings(ground="sandy")
    for kind in (tumble, hop, paper, penetrate):
        with pytest.raises(ValueError, match=r"nowhere\.toml: cannot be read, .* was expected"):
            kind.check(kind.Settings(ground="nowhere.toml"))


def test_the_deviation_of_an_answer_is_that_of_a_closed_form(written, tmp_path):
    """At rest the platform sinks W / 4K: with K = 62 +- 3 its std is 3/62 of it to second order; C is of no effect."""
    fitted = read_ground(written(stds={"stiffness": 3.0, "damping": 0.1}))
    best = {"sinkage": 10.0 / fitted.values["stiffness"], "none": None}
    stds = spread_of_law(fitted, lambda file: {"sinkage": 10.0 / file.values["stiffness"], "none": None}, best)
    assert stds["sinkage"] == pytest.approx(best["sinkage"] * 3 / 62, rel=(3 / 62) ** 2 * 1.01)
    assert stds["none"] is None
    result = tumble.run(
        tumble.Settings(ground=str(tmp_path / "ground.toml"), torque=0.0, duration=0.05), tmp_path / "r"
    )
    start = result["quantities"]["sinkage_start"]
    assert start["std"] == pytest.approx(start["value"] * 3 / 62, rel=5e-3)


def test_a_parameter_at_the_end_of_what_its_law_allows_moves_one_way(written):
    """C = 0.1 +- 0.3 N s/m is moved to 0 and to 0.4; a linear answer has the std of its slope all the same."""
    fitted = read_ground(written(values={"stiffness": 62.0, "damping": 0.1}, stds={"stiffness": 0.0, "damping": 0.3}))
    ((name, lower, higher),) = moved(fitted)
    assert name == "damping" and lower.values["damping"] == pytest.approx(0.0, abs=1e-6)
    assert higher.values["damping"] == pytest.approx(0.4)
    stds = spread_of_law(fitted, lambda file: {"force": 5 * file.values["damping"]}, {"force": 0.5})
    assert stds["force"] == pytest.approx(1.5)


def test_a_tumble_on_a_surface_whose_k_has_an_error_states_that_of_its_numbers(tmp_path, monkeypatch):
    """z = W / 2K at K - s and K + s: a slope of W / 2 (K^2 - s^2), so a share of K s / (K^2 - s^2); C changes none."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    found = {
        name: tumble.run(tumble.Settings(surface=name, torque=0.0, duration=0.05), tmp_path / name)
        for name in ("sand", "brick")
    }
    start, sand = found["sand"]["quantities"]["sinkage_start"], find_surface("sand")
    share = sand.stiffness * sand.stiffness_std / (sand.stiffness**2 - sand.stiffness_std**2)
    assert start["std"] == pytest.approx(start["value"] * share, rel=5e-3)
    assert found["sand"]["law_spread"] == {"parameters": ["stiffness", "damping"], "absent": []}
    assert found["brick"]["law_spread"]["parameters"] == []
    assert found["brick"]["quantities"]["sinkage_start"]["std"] == 0.0
    assert "C of sand" in found["sand"]["departures"]["sentences"][-1]


def test_numbers_that_are_given_are_not_moved_and_those_of_one_spike_have_half_the_deviation():
    sand = find_surface("sand")
    numbers = plan_tumble(tumble.Settings(surface="sand", stiffness=50.0)).numbers
    (damping,) = uncertain_of(numbers, sand)
    assert (damping.name, damping.std) == ("damping", sand.damping_std)
    assert uncertain_of(plan_tumble(tumble.Settings()).numbers, find_surface("brick")) == []
    halved = plan_spatial(SpatialSettings(surface="sand")).numbers
    assert [one.std for one in uncertain_of(halved, sand)] == [0.5 * sand.stiffness_std, 0.5 * sand.damping_std]


def test_a_surface_on_which_the_platform_cannot_stand_leaves_the_deviation_unknown():
    def answer(name, value):
        if value < 1.0:
            raise ValueError("sinks away")
        return {"force": 3 * value}

    (one,) = (Uncertain(name="stiffness", value=2.0, std=0.5),)
    assert spread_of_surface([one], answer, {"force": 6.0}) == {"force": pytest.approx(1.5)}
    wide = Uncertain(name="stiffness", value=2.0, std=1.5)
    assert spread_of_surface([wide], answer, {"force": 6.0}) == {"force": None}


@pytest.mark.long
def test_a_tumble_and_a_hop_on_a_file_state_deviations_and_what_no_law_knows(written, tmp_path):
    path = written(stds={"stiffness": 3.0, "damping": 0.1})
    on_law = tumble.run(tumble.Settings(ground=path, duration=1.0, threads=2), tmp_path / "a")
    angle = on_law["quantities"]["trajectory_angle"]
    assert 0 < angle["std"] < 0.2 * abs(angle["value"])
    hopped = hop.run(hop.Settings(ground=path), tmp_path / "b")
    for name in ("model_launch_speed", "model_distance"):
        assert 0 < hopped["quantities"][name]["std"] < 0.2 * hopped["quantities"][name]["value"]
    assert hopped["quantities"]["launch_speed"]["std"] == 0
    for result in (on_law, hopped):
        assert sum("ploughing" in text for text in result["warnings"]) == 1


def test_a_sweep_states_no_deviation_of_its_trial_and_not_that_it_is_exact(written, tmp_path):
    settings = tumble.Settings(ground=written(), duration=0.1, mu_d=0.3, sweep=("mu_s=0.5:0.6:0.1",))
    assert tumble.run(settings, tmp_path / "run")["quantities"]["sinkage_start"]["std"] is None


def test_a_file_without_deviations_says_that_the_answer_has_none(written, tmp_path):
    path = written(stds={"stiffness": 0.0, "damping": 0.0})
    result = tumble.run(tumble.Settings(ground=path, duration=0.3), tmp_path / "run")
    assert any("no parameter" in text for text in result["warnings"])
    assert result["quantities"]["sinkage_start"]["std"] == 0
