"""`hedgebed tumble spatial`: refusals by name, the spring-damper, a small bed (stopped and taken up), the report."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from spatial_runs import CUBE, small_bed
from tumble_runs import stop_at

from coupling.lammps import LammpsMissingError, find_lammps
from experiments.cli.main import main
from experiments.runs.folder import RunFolder, read_series
from experiments.spatial import experiment as spatial
from experiments.spatial import spread
from experiments.spatial.on_grains import SpatialFollowed, SpatialOnBed
from experiments.spatial.settings import SpatialSettings
from experiments.spatial.spread import add_spread, uncertain_in
from experiments.spatial.trial import plan_spatial
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid import find_platform
from rigid.platform.rig import STANDARD_GRAVITY
from vis.film.reel import SpaceReel
from vis.page.folder import read_columns
from vis.page.law_rows import answer_rows


@pytest.fixture
def cube():
    """The cube that ships: 30 mm, eight spikes, wheels about x and y."""
    return str(CUBE)


def test_the_cube_that_ships_loads_and_is_what_the_documentation_runs():
    platform = find_platform("cube")
    assert platform.tips.shape == (8, 3) and platform.inertia[0, 0] == 1.2e-5
    assert np.abs(platform.tips) == pytest.approx(np.full((8, 3), 0.015))  # 30 mm across the tips
    assert "--platform cube " in (CUBE.parents[2] / "docs/coupling.md").read_text()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gravity": 1.0, "rig": 0.01}, "gravity = 1 m/s2 and rig = 0.01"),
        ({"velocity": (0.1, 0.0, 0.0), "lowering_speed": 0.1}, "lowering_speed = 0.1 m/s with a motion"),
        ({"actuator": "brake", "torque": (1.0, 0.0, 0.0)}, "wheel_speed_0 about x = 0 rad/s"),
        ({"actuator": "brake"}, "torque is not given"),
        ({"grain": 0.004}, "grain = 0.004 belongs to ground = 'bed'"),
        ({"ground": "lammps", "iterations": 3}, "iterations = 3 .* iterations = 1"),
        ({"ground": "beds"}, "'beds'.* 'bed'"),
        ({"ground": "bed", "sleep_pace": 8}, "sleep_pace = 8 needs sleep, which is off"),
        ({"ground": "bed", "sleep_share": 0.4}, "sleep_share = 0.4 belongs to rules of sleep"),
        ({"mu_s": 0.1, "mu_d": 0.2}, "mu_d = 0.2 is above mu_s = 0.1"),
        ({"torque": 0.1}, "it must be a list"),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(given, said):
    with pytest.raises(ValueError, match=said):
        SpatialSettings(**given)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"torque": (0.0, 0.0, 0.01)}, "has no wheel about z"),
        ({"torque": (0.03, 0.0, 0.0)}, "about x: torque is 0.03 N m: the motor gives at most 0.02"),
        ({"rig": 1.0}, "rig = 1 .* is not below the local gravity"),
        ({"surface": "steel", "ground": "bed"}, "surface = 'steel' has no grains .* use sand, .*, jsc1a"),
        (
            {"bed_size": (0.07, 0.2, 0.05)},
            r"bed_size = 0.07 m along x is too short: .* 0.\d+ m is needed",
        ),
        ({"bed_size": (0.2, 0.2, 0.02)}, r"bed_size = 0.02 m deep is too shallow: .* use"),
        ({"bed_size": (0.2, 0.2, 0.05), "grain": 0.009}, "grain = 0.009 m is larger than the spike"),
        ({"bed_size": (0.2, 0.2, 0.05), "grain": 0.003, "young": 1.0}, "young = 1 Pa is so soft that grains would"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(cube, given, said):
    own = {"surface": "sand-weak", "ground": "bed", "gravity": 1.0, "platform": cube, "duration": 0.05}
    own |= {"torque": (0.0, 0.01, 0.0), "velocity": (0.0, 0.0, -0.1)}
    if "rig" in given:
        del own["gravity"]
    with pytest.raises(ValueError, match=said):
        spatial.check(SpatialSettings(**own | given))


@pytest.mark.long
def test_the_hand_sets_down_heavy_on_soft_ground_and_what_it_cannot_is_refused_by_name():
    """The Hedgehog free at 1 m/s2: 5.3 N on four spikes of sand, W / 4 K = 32 mm deep; at the rig's speed too late."""
    heavy = {"surface": "sand-weak", "gravity": 1.0, "duration": 0.05}
    plan = plan_spatial(SpatialSettings(**heavy))
    run = SpatialFollowed(SpatialSettings(**heavy), plan).run_on_law()
    while not run.placed:
        run.advance()
    assert run.columns["sinkage"][0] == pytest.approx(5.3 / (4 * 41.1), rel=0.01)
    with pytest.raises(ValueError, match=r"bed_size = 0.1 m along x is too short"):
        spatial.check(SpatialSettings(**heavy, ground="bed", bed_size=(0.1, 0.1, 0.05), grain=0.006))
    with pytest.raises(ValueError, match=r"fails: the platform did not come to rest .* another lowering_speed"):
        spatial.check(SpatialSettings(**heavy, ground="bed", lowering_speed=0.01))


def test_a_platform_without_spikes_has_no_grains_to_touch():
    settings = SpatialSettings(surface="sand", ground="bed", platform="mascot", gravity=1.0)
    with pytest.raises(ValueError, match="tip_radius of MASCOT"):
        spatial.check(settings)


def test_set_down_by_the_hand_on_the_spring_damper_it_stands_as_deep_as_its_load_says(tmp_path, monkeypatch, capsys):
    """Four tips with K of a row halved: W / (4 K); then two wheels turn it over two sides."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    out = tmp_path / "run"
    given = ("--surface", "sand", "--torque", "0.05", "0.06", "0", "--duration", "0.1", "--frame-count", "3")
    assert main(["tumble", "spatial", *given, "--quiet", "--out", str(out)]) == 0
    assert "was set down" in capsys.readouterr().out
    result = json.loads((out / "result.json").read_text())
    weight, quantities = result["trial"]["weight"]["value"], result["quantities"]
    assert quantities["sinkage_start"]["value"] == pytest.approx(weight / (4 * 38.9), rel=0.01)
    assert quantities["energy_residual"]["value"] < 1e-5
    path = read_columns(out / "trajectory.csv")[0]
    assert path["wx_rad_s"][-1] > 0.01 and path["wy_rad_s"][-1] > 0.01
    assert path["touching"][0] == 4 and result["transitions"][0] == {"time": 0.0, "state": "stand", "turn": 0.0}
    motion = read_columns(out / "series" / "motion.csv")[0]
    inertia = 1.2e-3
    assert motion["wheel_x_rad_s"][-1] == pytest.approx(-0.05 * 0.1 / inertia, rel=1e-6)
    assert len(list((out / "frames").glob("tumble_hull_*.vtu"))) == 4
    reel = SpaceReel(out)  # the depth in its pictures is that of the curve: of the tips, which the law sees
    depths = [-reel.lowest(frame)[2] for frame in reel.frames]
    assert depths == pytest.approx(motion["sinkage_m"][[reel.row(index) for index in range(4)]], rel=1e-3)
    assert f"lowest tip {1e3 * depths[0]:.3g} mm below" in reel.line(0)


def test_a_drop_tells_its_impact_and_a_hop(tmp_path, monkeypatch, cube):
    """From 1 mm at 1 m/s2 with no damping: sqrt(2 g h) + what v0 adds, and back up with all of it on a level cube."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    settings = SpatialSettings(
        surface="brick", platform=cube, gravity=1.0, height=1e-3, damping=0.0, duration=0.15, frame_count=0,
    )  # fmt: skip
    assert plan_spatial(settings).trial.torques == ()
    quantities = spatial.run(settings, tmp_path / "drop")["quantities"]
    speed = math.sqrt(2 * 1.0 * 1e-3)
    assert quantities["first_touch"]["value"] == pytest.approx(speed, abs=1e-3)
    assert quantities["impact_speed"]["value"] == pytest.approx(speed, rel=0.02)
    assert quantities["restitution"]["value"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.long
def test_on_grains_a_stopped_run_goes_on_to_the_same_bits_with_its_books_and_overlaps_told(tmp_path, monkeypatch, cube):
    monkeypatch.setattr(SpatialOnBed, "prepare", small_bed)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    settings = SpatialSettings(
        surface="sand", ground="bed", platform=cube, gravity=1.0, turn=(0.3, 0.2, 0.0), velocity=(0.05, 0.02, -0.15),
        angular_velocity=(0.0, 1.0, 2.0), torque=(0.001, 0.0, 0.0), duration=0.03, bed_size=(0.14, 0.14, 0.05),
        grain=0.006, young=1e6, max_overlap=0.2, threads=1, frame_count=2, substeps=4,
    )  # fmt: skip
    whole = spatial.run(settings, tmp_path / "whole")
    stop_at(monkeypatch, 20)
    with pytest.raises(KeyboardInterrupt):
        spatial.run(settings, tmp_path / "broken")
    assert RunFolder.open(tmp_path / "broken").load_checkpoint("tumble") is not None
    again = spatial.resume(tmp_path / "broken")
    assert again["quantities"] == whole["quantities"]
    assert again["transitions"] == whole["transitions"]
    for name in ("trajectory.csv", "series/bed.csv", "series/motion.csv", "series/feet.csv", "frames/tumble.pvd"):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    quantities = whole["quantities"]
    assert quantities["sinkage_largest"]["value"] > 1e-3 and quantities["dissipated_friction"]["value"] > 0
    assert quantities["energy_residual"]["value"] < 5e-3 and quantities["momentum_residual"]["value"] < 1e-13
    assert whole["grains"]["beside"]["impact_speed"]["value"] > 0.1
    _check_overlaps(whole, settings)
    _check_feet(tmp_path / "whole", whole)
    frames = sorted(path.name for path in (tmp_path / "whole" / "frames").glob("*_0001.*"))
    parts = ("contact_forces", "grains", "hull", "row_forces", "spikes")
    assert frames == [*(f"tumble_{part}_0001.vtu" for part in parts), "tumble_surface_0001.vti"]
    _check_report(tmp_path / "whole")


@pytest.mark.long
def test_on_grains_in_lammps_a_stopped_run_goes_on_to_its_end(tmp_path, monkeypatch, cube):
    try:
        find_lammps()
    except LammpsMissingError as missing:
        pytest.skip(str(missing))
    monkeypatch.setattr(SpatialOnBed, "prepare", small_bed)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    settings = SpatialSettings(
        surface="sand", ground="lammps", platform=cube, gravity=1.0, turn=(0.3, 0.2, 0.0), velocity=(0.05, 0.02, -0.15),
        angular_velocity=(0.0, 1.0, 2.0), torque=(0.001, 0.0, 0.0), duration=0.03, bed_size=(0.14, 0.14, 0.05),
        grain=0.006, young=1e6, max_overlap=0.2, threads=1, frame_count=2, substeps=4,
    )  # fmt: skip
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        stop_at(patch, 20)
        spatial.run(settings, tmp_path)
    result = spatial.resume(tmp_path)
    time = read_series(tmp_path / "series" / "motion.csv")["t_s"]
    assert time[-1] == pytest.approx(0.03, rel=0.01) and (np.diff(time) > 0).all()
    assert result["ground"] == "bed" and "dissipated_friction" not in result["quantities"]
    found = {name: quantity["value"] for name, quantity in result["quantities"].items()}
    assert found["sinkage_largest"] > 1e-3 and found["angular_momentum_residual"] is None
    # Where it goes on, LAMMPS computes its forces anew, with the velocities of the time of the places.
    assert found["energy_residual"] < 5e-3 and found["momentum_residual"] < 1e-5 * 0.15 * find_platform(cube).mass


def _check_overlaps(result, settings):
    """The run allows itself 0.2 of a diameter; past 0.05 it says which modulus would keep that: F ~ E overlap^1.5."""
    overlap = result["grains"]["max_overlap"]
    said = f"young = {settings.young * (overlap / 0.05) ** 1.5:.2g} Pa or more would keep it there"
    assert overlap > 0.05 and any(said in warning for warning in result["warnings"])


def _check_feet(folder, result):
    """The spikes' forces are the whole force; what never came down has no columns; the states are told everywhere."""
    feet = read_series(folder / "series" / "feet.csv")
    motion, path = (read_series(folder / name) for name in ("series/motion.csv", "trajectory.csv"))
    came_down = {name.split("_")[1] for name in feet if name.startswith("normal_")}
    assert came_down and came_down < {str(spike) for spike in range(8)} | {"hull"}
    for what, whole in (("normal_{}_N", "fz_N"), ("along_x_{}_N", "fx_N"), ("along_y_{}_N", "fy_N")):
        told = sum(feet[what.format(spike)] for spike in came_down)
        # What is below the least force that counts as touching is left out: 0.1 % of 0.1 N a spike.
        assert np.abs(told - motion[whole]).max() < 9 * 1e-3 * 0.1
    deepest = np.max([feet[f"sinkage_{spike}_m"] for spike in came_down - {"hull"}], axis=0)
    assert "sinkage_hull_m" not in feet
    assert deepest == pytest.approx(motion["sinkage_m"], abs=1e-15)
    assert path["state"][0] == "hop" and set(path["state"]) > {"hop"}
    entries = result["transitions"]
    assert entries[0] == {"time": 0.0, "state": "hop", "turn": 0.0} and len(entries) > 1
    row = int(np.flatnonzero(path["t_s"] == entries[1]["time"])[0])
    assert path["state"][row] == entries[1]["state"] != path["state"][row - 1]
    assert path["turn_rad"][row] == entries[1]["turn"]
    assert any("hop at once" in sentence for sentence in result["departures"]["sentences"])
    assert result["grains"]["beside_transitions"][0]["state"] == "hop"


def _check_report(folder):
    """Every plot is there and the page says both grounds' numbers, without pictures."""
    from vis.spatial.report import write_spatial_report

    page = write_spatial_report(folder, pictures=False).read_text()
    assert "spring-damper" in page and "bed of sand" in page
    names = ("path", "states", "beside", "energy")
    assert all((folder / "figures" / f"{name}.png").stat().st_size > 5000 for name in names)


def test_the_flat_pictures_are_drawn_where_there_is_no_opengl(tmp_path, monkeypatch, cube):
    from vis.spatial.report import write_spatial_report

    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    settings = SpatialSettings(platform=cube, gravity=1.0, height=1e-3, duration=0.02, frame_count=2)
    spatial.run(settings, tmp_path / "law")
    page = write_spatial_report(tmp_path / "law").read_text()
    assert "no OpenGL" in page and "Pivot, slip, hop" in page and "Transitions" in page
    assert (tmp_path / "law" / "film.gif").exists() and (tmp_path / "law" / "figures" / "space-end.png").exists()


def test_in_flight_grains_are_chosen_for_what_a_torque_presses_with(cube):
    """Not for the weight alone: at 1e-3 g 0.5 N mm presses a tip 17 times as hard as the weight does."""
    given = {
        "surface": "sand", "ground": "bed", "platform": cube, "gravity": 1e-3 * STANDARD_GRAVITY, "duration": 0.02,
        "bed_size": (0.14, 0.14, 0.05), "grain": 0.003,
    }  # fmt: skip
    chosen, springs = [], []
    for torque in ((0.0, 0.0, 0.0), (0.0, 5e-4, 0.0)):
        settings = SpatialSettings(**given, torque=torque)
        plan = plan_spatial(settings)
        bed = SpatialOnBed(settings, plan)
        chosen.append(bed.softening())
        springs.append(plan.numbers["stiffness"].value * bed.forecast.deepest)
    area = math.pi * plan.trial.platform.tip_radius**2
    assert springs[1] > 10 * springs[0]
    assert chosen[1].pressure - chosen[0].pressure == pytest.approx((springs[1] - springs[0]) / area, rel=0.01)
    assert chosen[1].young > 10 * chosen[0].young


@pytest.mark.parametrize(
    ("gravity", "surface", "stiffness", "said"),
    [
        (1e-3, "sand", None, True),
        (1e-3, "sand", 50.0, False),  # given: for whatever gravity it was found at
        (1e-3, "brick", None, False),  # no grains
        (0.9, "sand", None, False),
    ],
)
def test_in_flight_it_is_said_that_the_surface_s_stiffness_is_of_grains_at_1_g(gravity, surface, stiffness, said):
    given = {"surface": surface, "gravity": gravity * STANDARD_GRAVITY, "stiffness": stiffness}
    in_space = plan_spatial(SpatialSettings(**given, torque=(0.0, 0.1, 0.0))).warnings
    in_the_plane = plan_tumble(TumbleSettings(**given, torque=0.1)).warnings
    for warnings in (in_space, in_the_plane):
        told = [warning for warning in warnings if "is that of grains at 1 g" in warning]
        assert len(told) == int(said)
        assert not told or "about 1e+03 times" in told[0]
    rig = {"surface": surface, "rig": gravity, "stiffness": stiffness}
    assert not any("at 1 g" in warning for warning in plan_tumble(TumbleSettings(**rig, torque=0.1)).warnings)


def test_the_wheels_columns_are_of_the_axes_that_they_turn_about(tmp_path, monkeypatch):
    """One wheel, about y: its speed stands under y whatever its place in the file."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    text = CUBE.read_text()
    axes = next(line for line in text.splitlines() if line.startswith("axes"))
    mine = tmp_path / "mine.toml"
    mine.write_text(text.replace(axes, "axes = [[0.0, 1.0, 0.0]]"))
    settings = SpatialSettings(platform=str(mine), surface="brick", gravity=1.0, torque=(0.0, 1e-4, 0.0), duration=0.05)
    spatial.run(settings, tmp_path / "run")
    motion = read_columns(tmp_path / "run" / "series" / "motion.csv")[0]
    wheel = find_platform(mine).wheels[0]
    assert motion["wheel_y_rad_s"][-1] == pytest.approx(-1e-4 * 0.05 / wheel.inertia, rel=1e-6)
    assert not motion["wheel_x_rad_s"].any() and not motion["wheel_z_rad_s"].any()


def test_a_standard_deviation_of_k_and_c_changes_the_answer_of_a_run_in_space(monkeypatch):
    """x = 3 K + C: std = hypot(3 std_K, std_C). A hop that a moved law does not have is named, and has no error."""
    plan = plan_spatial(SpatialSettings(surface="sand"))
    stds = {one.name: one.std for one in uncertain_in(plan)}
    assert stds == {"stiffness": pytest.approx(0.5 * 40.6), "damping": pytest.approx(0.5 * 2.26)}
    entry = {"std": 0.0, "unit": "m", "note": ""}
    best = {name: entry | {"value": value} for name, value in (("max_speed", 5.0), ("transition_angle_hop", 0.3))}
    result = {"quantities": best, "departures": {"sentences": []}}

    def run_on(other):
        law = {name: other.trial.ground_parameters[name] for name in stds}
        assert law == {name: other.numbers[name].value for name in stds}
        hops = None if law["stiffness"] < plan.numbers["stiffness"].value else 0.3
        answer = {"max_speed": 3 * law["stiffness"] + law["damping"], "transition_angle_hop": hops}
        return SimpleNamespace(run=lambda: None, answer={name: {"value": value} for name, value in answer.items()})

    monkeypatch.setattr(spread, "quantities_of", lambda run: run.answer)
    add_spread(plan, result, run_on)
    expected = math.hypot(3 * stds["stiffness"], stds["damping"])
    assert result["quantities"]["max_speed"]["std"] == pytest.approx(expected)
    assert result["quantities"]["transition_angle_hop"]["std"] is None
    assert result["law_spread"] == {"parameters": ["stiffness", "damping"], "absent": ["transition_angle_hop"]}
    rows = answer_rows(
        result | {"experiment": "tumble spatial"}, {"transition_angle_hop": ("Hops from", "")}, lambda entry: ""
    )
    assert rows[0].errors[1] == "does not hop"
