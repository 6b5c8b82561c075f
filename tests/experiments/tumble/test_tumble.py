"""`hedgebed tumble` from the command line: what it writes, what it says, what it refuses, and that it is quick."""

import json
import math
import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from golden import golden

from experiments.campaign import EffectTable, TumbleModel, write_model
from experiments.campaign.tables import FORMAT, PlatformTable, RigTable, TumbleSurface, WheelTable
from experiments.cli.main import main
from experiments.grains.bed_result import residual_warning, reversal_warning
from experiments.platform.numbers import torque_within_limit
from experiments.platform.surfaces import find_surface, surface_names
from experiments.runs.folder import read_series
from experiments.tumble.result import tumble_sentences
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid.planar.simulate import simulate
from rigid.platform.rig import STANDARD_GRAVITY

SHORT = ("--duration", "0.3", "--quiet")


pytestmark = pytest.mark.usefixtures("unreported")


def result_of(folder):
    return json.loads((Path(folder) / "result.json").read_text())


def value_of(folder, name):
    return result_of(folder)["quantities"][name]["value"]


def a_model(**changes):
    tables = {
        "format": FORMAT,
        "kind": "tumble",
        "name": "fitted",
        "platform": PlatformTable(mass=5.2, inertia=0.07, spike_length=0.19),
        "wheel": WheelTable(inertia=1.1e-3),
        "rig": RigTable(counterweight=5.1, wire_length=2.2),
        "surface": TumbleSurface(kind="slate", stiffness=2e4, damping=70.0, mu_s=0.4),
        "effect": (EffectTable(id="pendulum", parameters={"length": 2.2}),),
    }
    return TumbleModel(**(tables | changes))


# What it writes


def test_the_trajectory_has_the_columns_and_rows_that_were_agreed():
    assert main(["tumble", "--duration", "0.7503", "--quiet", "--out", "a"]) == 0
    text = Path("a/trajectory.csv").read_text().splitlines()
    assert text[0] == "t_s,x_m,y_m,theta_rad,vx_m_s,vy_m_s,omega_rad_s,state"
    columns = read_series(Path("a/trajectory.csv"))
    assert columns["t_s"][0] == 0.0 and columns["t_s"][-1] == 0.7503
    assert np.diff(columns["t_s"]).max() <= 1e-3 + 1e-12
    assert set(columns["state"]) <= {"stand", "pivot", "slip", "hop"}
    assert columns["x_m"][0] == 0.0 and columns["theta_rad"][0] == 0.0


def test_the_quantities_are_those_of_the_trajectory():
    assert main(["tumble", "--surface", "brick", "--torque", "0.22", "--duration", "1.0", "--quiet", "--out", "a"]) == 0
    result = result_of("a")
    units = {name: quantity["unit"] for name, quantity in result["quantities"].items()}
    assert units == {
        "trajectory_angle": "rad",
        "max_speed": "m/s",
        "time_of_max_speed": "s",
        "max_angular_velocity": "rad/s",
        "transition_angle_slip": "rad",
        "transition_angle_hop": "rad",
        "tipping_torque": "N m",
        "slip_torque": "N m",
        "energy_residual": "1",
        "sinkage_start": "m",
        "sinkage_largest": "m",
        "ahead_1s": "m",
        "up_1s": "m",
        "rotation_1s": "rad",
        "torque_work_1s": "J",
    }
    rows = read_series(Path("a/trajectory.csv"))
    for name, column in {"ahead_1s": "x_m", "up_1s": "y_m", "rotation_1s": "theta_rad"}.items():
        assert value_of("a", name) == pytest.approx(rows[column][-1] - rows[column][0], rel=1e-9)
    hop = value_of("a", "transition_angle_hop")  # The torque ends with the hop
    assert value_of("a", "torque_work_1s") == pytest.approx(0.22 * hop, rel=1e-6)
    away = np.hypot(rows["x_m"] - rows["x_m"][0], rows["y_m"] - rows["y_m"][0])
    first = int(np.argmax(away >= 0.01))
    angle = math.atan2(rows["y_m"][first] - rows["y_m"][0], rows["x_m"][first] - rows["x_m"][0])
    assert value_of("a", "trajectory_angle") == pytest.approx(angle, abs=1e-3)
    speed = np.hypot(rows["vx_m_s"], rows["vy_m_s"]).max()
    assert speed * (1 - 1e-12) <= value_of("a", "max_speed") <= 1.001 * speed
    fastest = rows["t_s"][np.argmax(np.hypot(rows["vx_m_s"], rows["vy_m_s"]))]
    assert value_of("a", "time_of_max_speed") == pytest.approx(fastest, abs=2e-3)
    assert value_of("a", "transition_angle_hop") == pytest.approx(
        rows["theta_rad"][rows["state"] == "hop"][0], abs=2e-3
    )
    assert value_of("a", "energy_residual") < 1e-6


def test_what_never_happens_is_null():
    assert main(["tumble", "--torque", "0.02", *SHORT, "--out", "a"]) == 0  # W l sin(pi/8) = 0.067 N m would tip it
    for name in ("trajectory_angle", "transition_angle_slip", "transition_angle_hop", "ahead_1s", "torque_work_1s"):
        assert value_of("a", name) is None  # SHORT ends before one second


def test_a_centre_that_stays_within_10_mm_is_told_how_far_it_got_and_which_way():
    assert main(["tumble", "--torque", "0.02", *SHORT, "--out", "a"]) == 0
    (said,) = (warning for warning in result_of("a")["warnings"] if "no trajectory angle" in warning)
    away, along, up, when = (
        float(x) for x in re.findall(r"[+-]?[0-9.]+(?:e-?[0-9]+)?(?= (?:mm(?:,| along| up)|s$))", said)
    )
    rows = read_series("a/trajectory.csv")
    row = int(np.argmin(np.abs(rows["t_s"] - when)))
    for told, of in ((along, "x_m"), (up, "y_m")):
        assert told == pytest.approx(1e3 * (rows[of][row] - rows[of][0]), rel=0.01)
    assert away == pytest.approx(math.hypot(along, up), rel=0.01) and 0 < away < 10


def test_json_prints_the_result_and_nothing_else(capsys):
    assert main(["tumble", *SHORT, "--json", "--out", "a"]) == 0
    assert json.loads(capsys.readouterr().out) == result_of("a")


def test_every_default_is_printed(capsys):
    assert main(["tumble", "--duration", "0.05", "--torque", "0.2", "--out", "a"]) == 0
    said = capsys.readouterr().err
    for line in (
        "surface = brick (default)",
        "ground = spring-damper (default)",
        "actuator = motor (default)",
        "platform = hedgehog (default)",
        "mass = 5.3 kg (platform hedgehog)",
        "inertia = 0.06 kg m2 (platform hedgehog)",
        "spike_length = 0.2 m (platform hedgehog)",
        "wheel_inertia = 0.0012 kg m2 (platform hedgehog)",
        "stiffness = 15000 N/m (surface brick)",
        "damping = 60 N s/m (surface brick)",
        "mu_s = 0.5 (surface brick)",
        "mu_d = 0.25 (surface brick)",
        "rig = 0.0085 (default)",
        "rig_reading = pair (default)",
        "effects = none (default)",
        "gravity_sim = 0.0833565 m/s2 (rig = 0.0085 by default, read as pair)",
        "counterweight = 5.21066 kg",
        "torque_until = no end (default: as long as the trial)",
        "wheel_speed_0 = 0 rad/s (default)",
        "max_wheel_speed = 1050 rad/s (platform hedgehog)",
        "max_motor_torque = 0.22 N m (platform hedgehog)",
        "spike_count = 8 (rows of platform hedgehog)",
    ):
        assert line in said, line
    assert "torque = 0.2 " not in said  # that was given


def test_the_report_stands_on_its_own(reported):
    assert main(["tumble", *SHORT, "--out", "a"]) == 0
    page = Path("a/report.html").read_text()
    assert page.count("data:image/png") == 3 and "data:image/gif" in page
    assert not re.search(r"https?:|<script [^>]*src=", page) and page.count('class="scene"') == 1
    assert {item.name for item in Path("a/figures").iterdir()} == {"trajectory.png", "states.png", "energy.png"}


def test_a_run_is_a_case_that_gives_the_same_trajectory():
    assert main(["tumble", "--surface", "sand", "--torque", "0.2", *SHORT, "--out", "a"]) == 0
    assert main(["tumble", "a/run.toml", "--quiet", "--out", "b"]) == 0
    assert Path("a/trajectory.csv").read_bytes() == Path("b/trajectory.csv").read_bytes()


def test_a_run_whose_result_was_lost_is_finished_by_resume():
    assert main(["tumble", *SHORT, "--out", "a"]) == 0
    before = Path("a/trajectory.csv").read_bytes()
    Path("a/result.json").unlink()
    assert main(["resume", "a", "--quiet"]) == 0
    assert Path("a/trajectory.csv").read_bytes() == before and Path("a/result.json").exists()


def test_no_compiler_and_no_3d_is_loaded_for_it():
    script = (
        "import sys; from experiments.cli.main import main; "
        "status = main(['tumble', '--duration', '0.05', '--quiet']); "
        "sys.exit(status or sum(name in sys.modules for name in ('taichi', 'pyvista', 'vtk')))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# What it computes


def test_the_rig_can_be_read_in_two_ways():
    plans = [plan_tumble(TumbleSettings(rig=0.0085, rig_reading=reading)) for reading in ("pair", "weight")]
    pair, weight = (plan.trial for plan in plans)
    g = 0.0085 * STANDARD_GRAVITY
    assert pair.gravity_sim == pytest.approx(g) and pair.weight == pytest.approx((5.3 + pair.counterweight) * g)
    assert weight.weight == pytest.approx(5.3 * g)
    assert pair.weight / weight.weight == pytest.approx(2 / 1.0085)


def test_with_a_counterweight_the_stated_gravity_still_rules_the_weight():
    plan = plan_tumble(TumbleSettings(rig=0.0085, counterweight=5.0))
    assert plan.trial.gravity_sim == pytest.approx(0.0085 * STANDARD_GRAVITY)
    assert plan.trial.weight == pytest.approx((5.3 + 5.0) * 0.0085 * STANDARD_GRAVITY)
    assert any("would leave" in warning for warning in plan.warnings)


def test_a_free_platform_has_no_counterweight():
    trial = plan_tumble(TumbleSettings(gravity=1e-3)).trial
    assert (trial.counterweight, trial.gravity_sim, trial.weight) == (0.0, 1e-3, pytest.approx(5.3e-3))


@pytest.mark.parametrize(("options", "ratio"), [((), 1.0), (("--rig", "0.0085"), 2.0)], ids=["default", "rig"])
def test_a_strong_brake_slides_off_at_the_angle_of_the_closed_form(options, ratio):
    # tan(angle) = m / (M_y mu_d): 76.1 degrees in the rig on steel, 82.9 free of it. The weight, small against the
    # force of the brake, bends the first 10 mm down by less than half a degree.
    free = options == ()
    options = ("--gravity", "0.01") if free else options
    brake = ("--torque", "6", "--actuator", "brake", "--wheel-speed-0", "500")
    assert main(["tumble", "--surface", "steel", *brake, *options, *SHORT, "--out", "a"]) == 0
    expected = 82.87 if free else 76.06
    assert math.degrees(value_of("a", "trajectory_angle")) == pytest.approx(expected, abs=0.5)
    assert value_of("a", "transition_angle_slip") == pytest.approx(0.0, abs=1e-6)


def test_a_choice_that_was_given_is_no_default_though_it_equals_it():
    assert plan_tumble(TumbleSettings()).choices["actuator"] == "motor"
    plan = plan_tumble(TumbleSettings(actuator="motor", duration=3.0))
    assert not any(line.startswith(("actuator", "duration")) for line in plan.sentences())
    assert plan.choices["method"] == "located" and not {"actuator", "duration"} & plan.choices.keys()


def test_a_brake_beyond_the_platforms_own_is_said():
    plan = plan_tumble(TumbleSettings(torque=600.0, actuator="brake", wheel_speed_0=300.0))
    assert any("beyond the brake" in warning for warning in plan.warnings)


def test_a_motor_has_no_torque_once_its_wheel_is_at_its_limit():
    """From 1040 rad/s, standing: (1050 - 1040) J_w / tau = 54.5 ms, and not a row of the wheel is faster after that."""
    assert main(["tumble", "--wheel-speed-0", "1040", *SHORT, "--out", "a"]) == 0
    result = result_of("a")
    assert result["wheel_at_limit"] == pytest.approx(10 * 1.2e-3 / 0.22, rel=1e-9)
    assert any("1050 rad/s, at" in warning and "0.05455 s" in warning for warning in result["warnings"])
    wheel = read_series(Path("a/series/motion.csv"))["wheel_speed_rad_s"]
    assert wheel.max() == pytest.approx(1050, rel=1e-9)
    assert main(["tumble", "--wheel-speed-0", "1040", "--max-wheel-speed", "2000", *SHORT, "--out", "b"]) == 0
    assert result_of("b")["wheel_at_limit"] is None and not any("limit" in said for said in result_of("b")["warnings"])


def test_the_limit_of_a_wheel_is_found_across_a_hop():
    """The torque rests in a hop: the wheel is at its limit when its time on the ground times tau / J_w is enough.

    A limit in the middle of the second contact, so that the whole first hop lies before it.
    """
    plan = plan_tumble(TumbleSettings(surface="brick"))
    free = simulate(plan.trial, duration=2.0)
    changes = [(time, state) for time, state, _ in free.transitions] + [(2.0, "end")]
    grounded = [(a, b) for (a, state), (b, _) in pairwise([(0.0, "stand"), *changes]) if state != "hop"]
    down = next(a for a, _ in grounded if any(state == "hop" and time < a for time, state in changes))
    after = next(b for a, b in grounded if a == down)
    middle = 0.5 * (down + after)
    speed = 0.22 / 1.2e-3 * sum(min(b, middle) - a for a, b in grounded if a < middle)
    ended, time = torque_within_limit(plan.trial, max_wheel_speed=speed, duration=2.0)
    assert time == pytest.approx(middle, abs=1e-7)
    assert simulate(ended, duration=2.0).wheel_speed.max() == pytest.approx(speed, rel=1e-6)


def test_the_limit_is_that_of_the_platforms_own_wheel():
    other = plan_tumble(TumbleSettings(wheel_inertia=6e-4, wheel_speed_0=2000.0))
    assert other.max_wheel_speed == math.inf and "not the wheel" in other.numbers["max_wheel_speed"].origin
    golden("tumble/no_limit_known", [line for line in other.sentences() if "max_wheel_speed" in line])
    assert plan_tumble(TumbleSettings(max_wheel_speed=3000.0, wheel_speed_0=2000.0)).trial.wheel_speed_0 == 2000.0


def test_the_motors_limit_is_that_of_the_platforms_own_wheel_too():
    """Another wheel has another motor, of which nothing is known; the same inertia is the same wheel."""
    other = plan_tumble(TumbleSettings(wheel_inertia=6e-4, torque=0.5))
    assert other.trial.torque == 0.5 and other.numbers["max_motor_torque"].value == math.inf
    with pytest.raises(ValueError, match=r"torque = 0\.5 N m is beyond the motor of platform = 'hedgehog'"):
        plan_tumble(TumbleSettings(wheel_inertia=1.2e-3, torque=0.5))
    assert plan_tumble(TumbleSettings(max_motor_torque=0.6, torque=0.5)).trial.torque == 0.5
    with pytest.raises(ValueError, match=r"beyond max_motor_torque \(given\): at most 0\.4 N m"):
        plan_tumble(TumbleSettings(wheel_inertia=6e-4, max_motor_torque=0.4, torque=0.5))


@pytest.mark.parametrize(("surface", "gravity"), [("steel", {"rig": 0.0085}), ("brick", {"gravity": 0.05})])
def test_the_slip_torque_parts_those_that_slip_at_once_from_those_that_stick(surface, gravity):
    """mu_s W (J + m h^2) / (m h), h = l cos(pi/8): a hundredth below it sticks at the first moment, above it slips."""
    torque = plan_tumble(TumbleSettings(surface=surface, **gravity)).trial.slip_torque
    first = {}
    for share in (0.99, 1.01):
        trial = plan_tumble(TumbleSettings(surface=surface, torque=share * torque, **gravity)).trial
        first[share] = simulate(trial, duration=0.01).transitions[0][1]
    assert first == {0.99: "stand", 1.01: "slip"}


def test_the_tipping_torque_parts_those_that_tip_from_those_that_do_not():
    """W l sin(pi/8) where the torque comes up slowly; at once 1.6 sqrt(W / K l) = 2.7 % less does (docs/planar.md)."""
    trial = plan_tumble(TumbleSettings(mu_s=2.0)).trial
    assert trial.tipping_torque == pytest.approx(trial.weight * 0.2 * math.sin(math.pi / 8))
    turned = {}
    for share in (0.95, 1.01):
        plan = plan_tumble(TumbleSettings(mu_s=2.0, torque=share * trial.tipping_torque))
        turned[share] = simulate(plan.trial, duration=6.0, sample_interval=0.01).theta.max()
    assert turned[0.95] < 0.01 and turned[1.01] > 0.3


def test_the_terminal_tells_the_way_through_the_states_and_angles_in_degrees(capsys):
    assert main(["tumble", "--duration", "1.2", "--quiet", "--out", "a"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    result = result_of("a")
    hop = next(entry for entry in result["transitions"] if entry["state"] == "hop")
    assert f"hop at {hop['time']:.4g} s, {math.degrees(hop['theta']):.3g} degrees" in shown
    assert f"Trajectory angle {math.degrees(value_of('a', 'trajectory_angle')):.3g}°" in shown
    assert f"Fastest at {value_of('a', 'time_of_max_speed'):.4g} s" in shown
    assert "no scatter" in shown and "trajectory_angle" not in shown


def test_an_impulsive_brake_on_ground_that_does_not_give_way_leaves_at_half_a_spikes_angle():
    # Closed form, sticking, damped far beyond critical: omega = H / (J + m l^2), v = l omega, launch at 22.5 degrees.
    options = {"mu_s": 20.0, "mu_d": 20.0, "stiffness": 1e6, "damping": 1e5, "gravity": 1e-2}
    plan = plan_tumble(TumbleSettings(torque=6000.0, actuator="brake", wheel_speed_0=300.0, **options))
    trajectory = simulate(plan.trial, duration=0.15)
    impulse = 1.2e-3 * 300
    assert trajectory.omega[-1] == pytest.approx(impulse / (0.06 + 5.3 * 0.2**2), rel=0.03)
    assert math.degrees(trajectory.trajectory_angle) == pytest.approx(22.5, abs=1.5)


def test_a_platform_of_another_shape_tumbles():
    plan = plan_tumble(TumbleSettings(platform="cubli", torque=0.05, gravity=0.05))
    assert plan.trial.spike_count == 4
    assert plan.trial.spike_length == pytest.approx(0.075 * math.sqrt(2))
    assert simulate(plan.trial, duration=0.5).theta[-1] > 0.1


@pytest.mark.parametrize("name", surface_names())
def test_every_surface_has_its_numbers_and_their_source(name):
    surface = find_surface(name)
    trial = plan_tumble(TumbleSettings(surface=name)).trial
    assert (trial.stiffness, trial.damping, trial.mu_s, trial.mu_d) == (
        surface.stiffness, surface.damping, surface.mu_s, surface.mu_d,
    )  # fmt: skip
    assert len(surface.source) > 20
    assert surface.guess == (name == "jsc1a-heights")


def test_the_weak_sand_is_twice_the_spike_that_was_computed_grain_by_grain():
    """Of an older step of the contact: its source says of which, and what the results that ship have since."""
    sand = find_surface("sand-weak")
    told = re.findall(r"[0-9.]+(?= ±)", sand.source)
    spikes = [sand.stiffness / 2, sand.damping / 2]
    for name in ("penetrate", "penetrate-full"):
        kept = json.loads((Path(__file__).parents[3] / f"docs/results/{name}/result.json").read_text())["quantities"]
        spikes += [kept[key]["value"] for key in ("stiffness", "damping")]
    assert told == [f"{number:.{len(text.partition('.')[2])}f}" for number, text in zip(spikes, told, strict=True)]


def test_the_sand_is_twice_its_spike_extrapolated_to_real_grains_and_takes_its_grains():
    """And is found by its earlier name."""
    sand = find_surface("sand")
    with pytest.warns(FutureWarning, match="'sand-calibrated' is called 'sand'"):
        assert find_surface("sand-calibrated") is sand
    kept = Path(__file__).parents[3] / "docs/results/converge-flagship/result.json"
    found = json.loads(kept.read_text())["quantities"]
    assert sand.stiffness == pytest.approx(2 * found["stiffness"]["value"], rel=1e-3)
    assert sand.damping == pytest.approx(2 * found["damping"]["value"], rel=2e-3)
    assert sand.grains == "sand" and find_surface("sand-weak").grains == "sand-weak"


@pytest.mark.parametrize(
    ("given", "gravity"),
    [({"gravity": 1.0}, 1.0), ({"rig": 0.0085}, 9.80665), ({"gravity": 1.0, "ground_parameters": ("gravity=3",)}, 3.0)],
)
def test_a_law_whose_grains_have_weight_takes_the_gravity_of_the_place(given, gravity):
    """In the rig the grains are at 1 g."""
    plan = plan_tumble(TumbleSettings(ground="rft", **given))
    assert plan.trial.ground.parameters["gravity"] == gravity == plan.numbers["ground_gravity"].value
    assert plan.numbers["gravity"].value == plan.trial.gravity == given.get("gravity", 9.80665)


def test_another_law_takes_its_parameters_of_one_spike():
    given = ("dissipation=0.1", "exponent=1.4")
    plan = plan_tumble(TumbleSettings(ground="hunt-crossley", ground_parameters=given))
    assert plan.trial.ground.parameters == {"dissipation": 0.1, "exponent": 1.4}
    assert plan.trial.ground.spikes_per_row == 2.0
    assert (plan.numbers["exponent"].origin, plan.numbers["stiffness"].unit) == ("given", "N/m^n")
    assert main(["tumble", "--ground", "hunt-crossley", *SHORT, "--out", "a"]) == 0


def test_the_defaults_that_help_states_are_those_that_are_taken():
    said = {name: field.description for name, field in TumbleSettings.model_fields.items()}
    for name, number in plan_tumble(TumbleSettings()).numbers.items():
        stated = re.search(r"\((?:hedgehog|brick): ([0-9.e-]+)\)", said.get(name, ""))
        if stated:
            assert number.value == float(stated[1]), name


# Models


def test_a_model_gives_what_is_not_given_and_adds_its_effects():
    write_model("model.toml", a_model())
    assert main(["tumble", "--model", "model.toml", "--mass", "5.4", *SHORT, "--out", "a"]) == 0
    result = result_of("a")
    told = {name: (entry["value"], entry["origin"]) for name, entry in result["trial"].items()}
    assert told["mass"] == (5.4, "given")
    assert told["inertia"] == (0.07, "model")
    assert told["stiffness"] == (2e4, "model")
    assert told["mu_d"] == (0.2, "model")  # half of mu_s, which the model has
    assert told["counterweight"] == (5.1, "model")
    assert result["effects"][0]["id"] == "pendulum" and result["effects"][0]["parameters"]["length"] == 2.2
    assert result["surface"] == "slate"
    assert tomllib.loads(Path("a/model.toml").read_text())["name"] == "fitted"


def test_an_effect_of_a_model_moves_the_platform():
    write_model("with.toml", a_model())
    write_model("without.toml", a_model(effect=()))
    ends = {}
    for name in ("with", "without"):
        assert main(["tumble", "--model", f"{name}.toml", "--duration", "1", "--quiet", "--out", name]) == 0
        ends[name] = read_series(Path(name) / "trajectory.csv")["x_m"][-1]
    assert ends["with"] < ends["without"] - 1e-4  # the wires pull back


def test_a_model_is_kept_with_the_run_so_that_resume_needs_nothing_else():
    write_model("model.toml", a_model())
    assert main(["tumble", "--model", "model.toml", *SHORT, "--out", "a"]) == 0
    before = Path("a/trajectory.csv").read_bytes()
    Path("model.toml").unlink()
    Path("a/result.json").unlink()
    assert main(["resume", "a", "--quiet"]) == 0
    assert Path("a/trajectory.csv").read_bytes() == before


def test_a_term_of_ones_own_runs_from_a_file_beside_the_model():
    Path("wind.py").write_text(
        "from rigid.terms import Parameter, Term\n"
        "def blow(s, push):\n"
        "    return push, 0.0, 0.0\n"
        "TERM = Term(id='wind', summary='a steady push', acts='virtual work', source='test', limits='steady',\n"
        "            hooks={'force': blow}, parameters=(Parameter(name='push', unit='N', default=0.0, summary='x'),))\n"
    )
    effect = EffectTable(id="wind", parameters={"push": 0.05}, file="wind.py")
    write_model("model.toml", a_model(effect=(effect,)))
    assert main(["tumble", "--model", "model.toml", *SHORT, "--out", "a"]) == 0
    write_model("calm.toml", a_model(effect=()))
    assert main(["tumble", "--model", "calm.toml", *SHORT, "--out", "b"]) == 0
    blown, calm = (read_series(Path(name) / "trajectory.csv")["x_m"][-1] for name in "ab")
    assert blown > calm
    assert Path("a/wind.py").exists()


# What is refused


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--actuator", "brake"], ["wheel_speed_0 is not given", "rad/s, such as 300"]),
        (["--actuator", "brake", "--wheel-speed-0", "0"], ["wheel_speed_0 = 0"]),
        (["--torque", "0.5"], ["torque = 0.5 N m", "motor", "at most 0.22"]),
        (["--torque", "6"], ["torque = 6 N m", "motor", "actuator = brake"]),
        (["--counterweight", "6"], ["counterweight = 6 kg", "mass = 5.3 kg", "lift"]),
        (["--rig", "1"], ["rig = 1", "below the local gravity"]),
        (["--rig", "0.01", "--gravity", "0.1"], ["gravity = 0.1", "rig = 0.01"]),
        (["--gravity", "0.1", "--counterweight", "5"], ["counterweight = 5.0 belongs to a rig"]),
        (["--gravity", "0.1", "--rig-reading", "weight"], ["rig_reading = weight belongs to a rig"]),
        (["--inertia", "0.5"], ["inertia = 0.5 kg m2", "no body"]),
        (["--inertia", "0.0005"], ["inertia = 0.0005 kg m2 must exceed wheel_inertia = 0.0012 kg m2"]),
        (["--wheel-inertia", "0.06"], ["inertia = 0.06 kg m2 must exceed wheel_inertia = 0.06 kg m2"]),
        (["--wheel-inertia", "5"], ["wheel_inertia = 5 kg m2", "mass spike_length^2 = 0.212 kg m2"]),
        (["--mass", "-1"], ["--mass = -1.0", "greater than 0", "[kg]"]),
        (["--mass", "nan"], ["--mass", "finite"]),
        (["--torque", "-0.1"], ["--torque = -0.1", "greater than or equal to 0"]),
        (["--mu-s", "0.4", "0.5"], ["0.5 belongs to no option", "--sweep KEY=FROM:TO:STEP"]),
        (["--effects", "com-offset.x=0.01"], ["tips over", "com-offset.x may be up to 1.29 mm"]),
        (["--mu-d", "0.6"], ["mu_d = 0.6 is above mu_s = 0.5 (surface brick)"]),
        (["--mu-s", "0.2", "--mu-d", "0.3"], ["mu_d = 0.3", "mu_s = 0.2"]),
        (["--surface", "jsc-1a-loose-cut"], ["surface = 'jsc-1a-loose-cut'", "did you mean 'jsc1a'"]),
        (["--surface", "snow"], ["surface = 'snow'", "steel, brick, sand, sand-weak, jsc1a"]),
        (["--ground", "moon"], ["ground = 'moon'", "spring-damper"]),
        (["--ground", "grains"], ["ground = 'grains'", "rft, bed, lammps (of grains)"]),
        (["--ground", "beds"], ["ground = 'beds'", "did you mean 'bed'?"]),
        (["--ground", "power", "--stiffness", "100"], ["stiffness = 100", "ground_parameters"]),
        (["--ground", "power", "--ground-parameters", "n=2"], ["n is no parameter of power", "exponent"]),
        (["--ground", "power", "--ground-parameters", "exponent"], ["'exponent' has no =", "exponent=1.5"]),
        (["--ground-parameters", "exponent=2"], ["ground_parameters", "stiffness and damping"]),
        (["--effects", "magic"], ["effect 'magic' is unknown", "pendulum"]),
        (["--effects", "com-offset"], ["'com-offset' alone changes nothing", "com-offset.x=... [m]", "com-offset.y"]),
        (["--effects", "pendulum.size=2"], ["size", "length"]),
        (["--effects", "pendulum=2"], ["effects = 'pendulum=2'", "pendulum.length=2.2"]),
        (["--effects", "pendulum.length=-2"], ["pendulum", "length"]),
        (["--platform", "nothing"], ["nothing", "hedgehog"]),
        (["--platform", "mascot"], ["platform = 'mascot'", "66.9 and 113 degrees apart", "simulate_spatial"]),
        (["--wheel-speed-0", "1051"], ["wheel_speed_0 = 1051", "max_wheel_speed = 1050 rad/s (platform hedgehog)"]),
        (["--max-wheel-speed", "100", "--wheel-speed-0", "200"], ["wheel_speed_0 = 200", "(given)"]),
        (["--mass", "0"], ["--mass = 0", "greater than 0"]),
        (["--model", "absent.toml"], ["absent.toml", "no such file"]),
        (["--model", "bad.toml"], ["bad.toml: [platform] mass = 'heavy'", "kg"]),
        (["--model", "spike.toml"], ["spike.toml", "kind 'penetration'", "'tumble'"]),
        (["--model", "free.toml"], ["gravity must be given", "no [rig]"]),
        (["--stiffness", "1e9", "--method", "paper"], ["time_step = 0.001 s", "stiffness = 1e+09", "'located'"]),
        (["--effects", "wire-compliance.stiffness=1e7", "--method", "paper"],
         ["time_step = 0.001 s", "'wire-compliance', stiffness = 1e+07", "'located'"]),
        (["--ground", "power", "--ground-parameters", "stiffness=1e12", "--method", "paper"],
         ["ground = 'power', stiffness = 1e+12"]),
        (["--method", "paper", "--wheel-inertia", "1e-6", "--torque", "1e300"], ["short trial", "finite at t"]),
        (["--sample-interval", "0.01"], ["--sample-interval = 0.01", "[s]"]),
        (["--duration", "0"], ["--duration = 0"]),
        (["--spike-lenght", "0.2"], ["--spike-lenght", "--spike-length"]),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name_and_leaves_no_folder(capsys, options, said):
    write_model("free.toml", a_model(rig=None, effect=()))
    Path("bad.toml").write_text(Path("free.toml").read_text().replace("mass = 5.2 ", "mass = 'heavy' "))
    Path("spike.toml").write_text(
        'format = "hedgehog-campaign/1"\nkind = "penetration"\nname = "x"\n[spike]\ndiameter = 0.01\n'
        '[surface]\nkind = "sand"\nstiffness = 1.0\ndamping = 1.0\n'
    )
    assert main(["tumble", *options, "--out", "a"]) == 2
    text = capsys.readouterr().err
    assert all(words in text for words in said), text
    assert "Traceback" not in text
    assert not Path("a").exists()


def test_a_platform_with_a_weaker_motor_is_given_its_own_torque():
    plan = plan_tumble(TumbleSettings(platform="cubli", gravity=1.0))
    assert (plan.trial.torque, plan.numbers["torque"].origin) == (0.1, "motor of cubli")
    assert plan.trial.spike_count == 4


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"mass": 8.0, "spike_length": 0.25}, "mass, spike_length given; inertia = 0.06 kg m2, 8 rows of spikes stay"),
        ({"mass": 5.5}, None),
        ({}, None),
    ],
)
def test_numbers_of_another_body_on_a_platform_that_ships_are_said(given, kept):
    found = [text for text in plan_tumble(TumbleSettings(**given)).warnings if "rows of spikes" in text]
    assert found == [] if kept is None else kept in found[0]


def test_it_is_said_when_a_torque_does_not_tip_the_platform():
    trial = plan_tumble(TumbleSettings(torque=0.03, surface="brick")).trial
    said = " ".join(tumble_sentences(simulate(trial, duration=1.0)))
    assert "does not tip" in said and f"{trial.tipping_torque:.4g} N m" in said
    tipped = plan_tumble(TumbleSettings(torque=0.22, surface="brick")).trial
    assert "does not tip" not in " ".join(tumble_sentences(simulate(tipped, duration=2.0)))


def test_the_spring_damper_through_the_master_is_the_planar_model_to_its_tolerance():
    """`--method coupled` beside the default on the same trial: the batch's tolerance (docs/planar.md), and its feet."""
    given = ("tumble", "--surface", "sand", "--rig", "0.0085", "--torque", "0.22", "--duration", "0.9", "--quiet")
    assert main([*given, "--out", "planar"]) == 0
    assert main([*given, "--method", "coupled", "--out", "coupled"]) == 0
    one, other = (read_series(Path(name) / "trajectory.csv") for name in ("planar", "coupled"))
    most = {"x_m": 5e-5, "y_m": 2e-4, "theta_rad": 1.5e-3, "vx_m_s": 1e-4, "vy_m_s": 4e-4, "omega_rad_s": 3e-3}
    rows = np.flatnonzero(np.abs(other["t_s"] * 1e3 - np.round(other["t_s"] * 1e3)) < 1e-6)  # both have a row then
    at = np.round(other["t_s"][rows] * 1e3).astype(int)
    assert len(rows) > 400
    for channel, tolerance in most.items():
        assert np.abs(other[channel][rows] - one[channel][at]).max() < tolerance, channel
    feet, found = read_series(Path("coupled/series/feet.csv")), result_of("coupled")
    assert found["method"] == "coupled" and found["quantities"]["exchange_residual"]["value"] < 1e-5
    weight, stiffness = (found["trial"][name]["value"] for name in ("weight", "stiffness"))
    assert feet["normal_0_N"][0] == pytest.approx(weight / 2, rel=1e-6)
    assert value_of("coupled", "sinkage_start") == pytest.approx(weight / (2 * stiffness), rel=1e-6)
    # Coupled or not, the ground's force is what accelerates the platform: (m + m_b) ay + W, mean of each step.
    motion = read_series(Path("coupled/series/motion.csv"))
    heavy = found["trial"]["mass"]["value"] + found["trial"]["counterweight"]["value"]
    lifted = sum(feet[f"normal_{row}_N"] for row in range(8))
    assert np.abs(lifted - heavy * motion["ay_m_s2"] - weight)[1:].max() < 1e-9 * weight


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--ground", "bekker"), "ground = 'bekker' is not possible: it accepts the spring-damper"),
        (("--effects", "pendulum.length=2.2"), "effects = pendulum is not possible with method = 'coupled'"),
        (("--substeps", "30"), "substeps = 30 makes a step of 1.2 ms.* use at most 25"),
        (("--grain", "0.004"), "grain = 0.004 belongs to ground = 'bed'"),
        (("--drop-spin", "1"), "drop_spin = 1 belongs to a landing: give drop_speed"),
        (
            ("--drop-speed", "0.1", "--torque", "0.1"),
            "torque = 0.1 with drop_speed is not possible",
        ),
        (("--tumbles", "2", "--torque-until", "1"), "torque_until with tumbles = 2 is not possible: tumble_turn sets"),
    ],
)
def test_what_the_master_cannot_step_is_refused_by_name(given, said, capsys):
    assert main(["tumble", "--method", "coupled", *given]) == 2
    assert re.search(said, capsys.readouterr().err.replace("\n", " "))


def test_a_landing_says_how_fast_it_came_and_what_it_kept():
    """On the spring of brick with its damper, flat on two rows: it comes at 0.05 m/s and leaves slower."""
    given = (
        "--surface",
        "brick",
        "--rig",
        "0.0085",
        "--method",
        "coupled",
        "--drop-speed",
        "0.05",
        "--drop-spin",
        "0.1",
    )
    assert main(["tumble", *given, *SHORT, "--out", "landed"]) == 0
    found = result_of("landed")
    assert "0.05 m/s down" in found["title"]
    assert found["trial"]["torque"] == {"value": 0.0, "unit": "N m", "origin": "a landing"}
    assert value_of("landed", "impact_speed") == pytest.approx(0.05, rel=0.02)
    assert 0.3 < value_of("landed", "restitution") < 1 and 0 < value_of("landed", "energy_kept") < 1
    assert value_of("landed", "energy_residual") < 1e-3


def test_a_row_of_tumbles_lists_each_row_that_comes_down(reported):
    """Result, table and report of two tumbles on the spring-damper; the depths are those of series/feet.csv."""
    given = ("--surface", "sand", "--rig", "0.0085", "--method", "coupled", "--tumbles", "2", "--duration", "4")
    assert main(["tumble", *given, "--quiet", "--out", "row"]) == 0
    found, feet = result_of("row"), read_series(Path("row/series/feet.csv"))
    deepest = [fall["deepest"] for fall in found["footfalls"]]
    golden("tumble/row_titles", [table["title"] for table in found["tables"]])
    assert len(deepest) >= 3 and max(deepest) == pytest.approx(max(feet[f"sinkage_{row}_m"].max() for row in range(8)))
    assert [fall["set_down"] for fall in found["footfalls"]] == [True, True] + [False] * (len(deepest) - 2)
    page = Path("row/report.html").read_text()
    assert "Tumble by tumble" in page and all(table["title"] in page for table in found["tables"])
    # The torques that ended, and those after which it lay, are the table's; a warning names the others.
    rests = found["tables"][0]["rows"][1:]
    lay = [row[-1] == "yes" for row in rests]
    assert value_of("row", "tumbles_at_rest") == sum(lay) and value_of("row", "tumbles_done") in (
        len(lay),
        len(lay) + 1,
    )
    warned = " ".join(found["warnings"])
    assert ("not come to" in warned) == (not all(lay))
    assert ("ended before" in warned) == (value_of("row", "tumbles_done") > len(lay))


@pytest.mark.parametrize("value", [0.0100001, 0.01004, 0.0151, 0.3, math.inf])
def test_a_residual_that_is_warned_of_is_written_larger_than_its_limit(value):
    """`0.01 is above 0.01`, said of 0.01004, tells no one anything."""
    for warned in (residual_warning(value), reversal_warning(value)):
        said, limit = re.search(r"= (\S+) is above (\S+):", warned).groups()
        assert float(said) > float(limit) and len(said) <= 9
