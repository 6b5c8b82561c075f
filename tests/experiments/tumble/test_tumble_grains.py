"""`hedgebed tumble --ground bed`: refusals before any work; a small platform on a small bed, stopped and taken up."""

import json
import math
import re
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden
from tumble_runs import SMALL, prepare_small, small_bed, stop_at

from coupling import CoupledTumble, LawGround, LeftTheBedError
from dem import SAND_WEAK, BedFailure
from dem.grains.materials import material as find_material
from experiments.cli.main import main
from experiments.grains import following
from experiments.grains.bearing import STICKING
from experiments.grains.recipes import recipe_of
from experiments.grains.softening import Softening, run_limit
from experiments.platform.numbers import platform_numbers
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.spatial.settings import SpatialSettings
from experiments.spatial.trial import plan_spatial
from experiments.tumble import experiment as tumble
from experiments.tumble import on_grains_result as tumble_grains_result
from experiments.tumble import opening as tumble_opening
from experiments.tumble import steppers as tumble_steppers
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble, spikes_of
from rigid import Trial
from rigid.planar.simulate import simulate


def on_bed(**more):
    return TumbleSettings(**({"surface": "sand-weak", "ground": "bed", "duration": 0.9} | more))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"bed_size": (0.2, 0.06, 0.046)},
            r"bed_size = 0.2 m along the motion .* needs 0.28 m.* use 0.42 m, or a shorter duration",
        ),
        ({"bed_size": (0.4, 0.03, 0.046)}, r"bed_size = 0.03 m across .* use 0.036 m"),
        ({"bed_size": (0.4, 0.06, 0.03)}, r"bed_size = 0.03 m deep .* use 0.043 m"),
        ({"grain": 0.013}, r"grain = 0.013 m is larger than the spike: use at most 0.012 m"),
        ({"grain": 0.0003}, r"grain = 0.0003 m makes about .* use 0.00\d+ m or a smaller bed"),
        ({"coarse": 0.006}, r"grain = 0.003 m is more than a fifth of spike_diameter = 0.012 m .* use 0.0024 m"),
        (
            {"coarse": 0.006, "grain": 0.0024, "place": 0.1, "bed_size": (0.4, 0.036, 0.046)},
            r"place = 0.1 m with coarse = 0.006 m: .* place = 0 or another seed",
        ),
        ({"place": 5.0, "bed_size": (0.3, 0.06, 0.046)}, r"place = 5 m is outside the bed, .* use -0.15 to 0.15 m"),
        ({"place": -0.31, "bed_size": (0.3, 0.06, 0.046), "bed_repeats": 2}, r"outside the bed, which is 0.6 m long"),
        (
            {"coarse": 0.007, "grain": 0.0024, "bed_size": (0.4, 0.036, 0.046)},
            r"coarse = 0.007 m makes grains of .* give at most coarse = 0.006 m",
        ),
        ({"surface": "steel"}, r"surface = 'steel' has no grains .* use sand, sand-weak, jsc1a"),
        ({"spike_clear": 0.01}, r"spike_diameter = 0.012 m, spike_clear = 0.01 m"),
        ({"bed_stages": ("rain:dry", "stick", "level")}, r"bed_stages: .* these grains do not stick anyway"),
        ({"bed_stages": ("rain", "compact:0.6")}, r"bed_stages ends with 'compact:0.6': put 'level' last"),
        ({"bed_stages": ("rain", "cut:0.1", "level")}, r"bed_stages: .* would undo it"),
        (
            {"bed_size": (0.1, 0.06, 0.046), "bed_repeats": 2},
            r"bed_size = 0.1 m along the motion with bed_repeats = 2, 0.2 m in all, is too short: .* use 0.42 m",
        ),
        (
            {"bed_repeats": 2, "coarse": 0.006, "grain": 0.0024, "bed_size": (0.4, 0.036, 0.046)},
            r"bed_repeats = 2 with coarse = 0.006 m: .* one of the two",
        ),
        ({"fine_radius": 0.02}, r"fine_radius = 0.02 m belongs to a graded bed, but coarse"),
        (
            {"coarse": 0.006, "grain": 0.0024, "fine_radius": 0.005, "bed_size": (0.4, 0.036, 0.046)},
            r"fine_radius = 0.005 m is less than half of a spike diameter: use at least 0.006 m",
        ),
        (
            {"coarse": 0.006, "grain": 0.0024, "fine_depth": 0.06, "bed_size": (0.4, 0.036, 0.046)},
            r"fine_depth = 0.06 m must be between .* and 0.046 m",
        ),
        ({"bed_repeats": 99, "grain": 0.002}, r"makes about .* or a smaller bed"),
        ({"bed_stages": ("rain", "tilt:5")}, r"bed_stages has 'tilt:5', but a platform needs a level bed"),
        ({"young": 1.0, "bed_size": (0.5, 0.06, 0.046)}, r"young = 1 Pa is so soft .* max_overlap = 0.05: use"),
        ({"max_overlap": 1e-5, "bed_size": (0.5, 0.06, 0.046)}, r"the fastest tip's speed = .* max_overlap = 1e-05 of"),
    ],
)
def test_a_bed_that_will_not_do_is_refused_before_any_work(given, said):
    with pytest.raises(ValueError, match=said):
        tumble.check(on_bed(**given))


@pytest.mark.parametrize(
    "given",
    [
        {"effects": ("torque-rise.rise=0.25", "pendulum.length=2.2")},
        {"method": "paper"},
        {"campaign": "made"},
        {"ground_parameters": ("stiffness=3",)},
        {"ground": "spring-damper", "grain": 0.004},
        {"sleep_force": 2.0},
        {"ground": "spring-damper", "sleep_share": 0.4},
        {"bed_repeats": 0},
        {"bed_repeats": 1.5},
        {"bed_repeats": -1},
        {"sleep": True, "arch": "cuda"},
        {"ground": "spring-damper", "arch": "cuda"},
        {"ground": "spring-damper", "bed_repeats": 2},
    ],
)
def test_what_does_not_go_with_grains_is_refused_by_name(given):
    with pytest.raises(ValueError, match=list(given)[-1]):
        on_bed(**given)


def test_the_whole_of_a_bed_laid_end_to_end_counts_for_the_forecast():
    """It takes 0.28 m, says the refusal of 0.2 m: so do two pieces of 0.14 m; the footprints lie in their middle."""
    settings = on_bed(bed_size=(0.14, 0.06, 0.046), bed_repeats=2)
    tumble.check(settings)
    whole = on_bed(bed_size=(0.28, 0.06, 0.046))
    laid, whole = PlanarOnBed(settings), PlanarOnBed(whole)
    assert laid.origin == pytest.approx(whole.origin)
    assert laid.grain_count() == pytest.approx(whole.grain_count())


def eight_sided(tmp_path, spikes="clear = 0.012\ndiameter = 0.006"):
    """A small platform's file: eight rows 30 mm from the axis."""
    path = tmp_path / "mine.toml"
    path.write_text(
        'format = "hedgebed-platform/1"\nname = "mine"\n[body]\nmass = 0.1\ninertia = [2e-5, 2e-5, 2e-5]\n'
        '[hull]\nshape = "prism"\nsides = 8\ndiameter = 0.06\nheight = 0.03\n'
        + (f"[spikes]\n{spikes}\n" if spikes else "")
        + "[wheels]\ninertia = 1e-6\nmax_speed = 1000.0\nmotor_torque = 0.01\naxes = [[0.0, 1.0, 0.0]]\n"
    )
    return str(path)


def spikes_in(settings):
    return spikes_of(settings, platform_numbers(settings.platform))


def test_spikes_are_those_of_the_platforms_file_unless_given(tmp_path):
    """The Hedgehog's to the bit what the defaults were, 12 and 40 mm; a key wins over the file, each by itself."""
    own = spikes_in(on_bed())
    assert (own.diameter, own.clear) == (0.012, 0.04)
    mine = eight_sided(tmp_path)
    found = spikes_in(on_bed(platform=mine))
    assert (found.diameter, found.clear, found.of_platform) == (0.006, 0.012, ("spike_diameter", "spike_clear"))
    mixed = spikes_in(on_bed(platform=mine, spike_clear=0.015))
    assert (mixed.diameter, mixed.clear, mixed.of_platform) == (0.006, 0.015, ("spike_diameter",))
    settings = on_bed(platform=mine, rig=0.0085, torque=1e-3, duration=0.05, bed_size=(0.2, 0.02, 0.04))
    tumble.check(settings)
    plan = PlanarOnBed(settings).plan
    spike, *_, hull = PlanarOnBed(settings).members()
    assert spike.radius == 0.003 and np.linalg.norm(spike.at) == pytest.approx(0.03 - 0.003)
    assert hull.radius == pytest.approx(0.95 * 0.018 * math.cos(math.pi / 8))
    said = tumble_opening.opening(settings, plan, grains=1e3, softening=Softening(1e7, 1, 1, 7e10), lowering_speed=0.2)
    assert any(text.startswith(f"platform {mine}:") and "spike_diameter = 0.006" in text for text in said)


def test_a_platform_of_four_rows_is_refused_on_grains_in_the_plane_and_sent_into_space():
    """Rows that share a body of the bed would be next to each other."""
    said = r"platform = 'cubli' has 4 rows of spikes .* 6, 8 or 16 rows, or `hedgebed tumble spatial`"
    with pytest.raises(ValueError, match=said):
        tumble.check(on_bed(platform="cubli", torque=0.05, spike_diameter=0.006, spike_clear=0.012))


def test_a_platform_without_spikes_is_refused_on_grains_unless_they_are_given(tmp_path):
    bare = eight_sided(tmp_path, spikes="")
    with pytest.raises(ValueError, match=r"no \[spikes\] for the contact with grains: give spike_clear \(in m\)"):
        tumble.check(on_bed(platform=bare, spike_diameter=0.006))
    spikes = spikes_in(on_bed(platform=bare, spike_diameter=0.006, spike_clear=0.012))
    assert (spikes.diameter, spikes.clear, spikes.of_platform) == (0.006, 0.012, ())


def test_the_spikes_that_an_older_run_toml_names_on_the_spring_damper_are_no_fault():
    TumbleSettings(surface="sand", spike_diameter=0.012, spike_clear=0.04)
    with pytest.raises(ValueError, match=r"spike_diameter = 0.01 belongs to ground = 'bed'"):
        TumbleSettings(surface="sand", spike_diameter=0.01)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, None),
        ({"spike_length": 0.2}, None),
        (
            {"spike_length": 0.15},
            "spike_length = 0.15 is given, and spike_diameter and spike_clear are not. Spikes are 12 mm",
        ),
        (
            {"spike_length": 0.15, "spike_diameter": 0.006},
            "spike_clear are not. Spikes are 6 mm thick and extend 40",
        ),
        ({"spike_length": 0.15, "spike_diameter": 0.006, "spike_clear": 0.02}, None),
    ],
)
def test_another_body_on_the_platforms_spikes_is_said(given, said):
    settings = on_bed(**given)
    warning = PlanarOnBed(settings).whose_spikes()
    assert warning is None if said is None else said in warning


def test_what_was_set_is_said_first_and_defaults_are_counted_and_young_is_told():
    settings = on_bed(rig=0.0085, torque=0.22, grain=0.004, sleep=True)
    plan = PlanarOnBed(settings).plan
    soft = Softening(2.1e7, 1.0, 1.0, 7e10)
    said = tumble_opening.opening(settings, plan, grains=12345.0, softening=soft, lowering_speed=0.2)
    assert (
        said[0].startswith("set: ")
        and "rig = 0.0085" in said[0]
        and "torque = 0.22" in said[0]
        and "sleep = yes" in said[0]
    )
    assert any(text.startswith("platform hedgehog:") and "mass = 5.3" in text for text in said)
    assert any("spike_diameter = 0.012" in text and "spike_clear = 0.04" in text for text in said)
    (bed,) = (text for text in said if text.startswith("bed: "))
    for words in ("12,300 grains", "4 mm", "young = 2.1e+07", "max_overlap = 0.05", "3,333 times softer"):
        assert words in bed, words
    assert re.match(r"\d+ more settings", said[-1]) and len(said) < 12
    golden("tumble/opening_on_bed", [*said[:-1], re.sub(r"^\d+", "N", said[-1])])
    assert not any("default)" in text or "None" in text for text in said)
    again = TumbleSettings(**settings.model_dump())  # as from the run.toml of a run that is taken up again
    assert tumble_opening.opening(again, plan, grains=12345.0, softening=soft, lowering_speed=0.2) == said


def test_a_duration_in_which_the_first_10_mm_are_not_gone_is_told_before_any_work():
    """0.22 N m in the rig: on the spring-damper they take some 0.58 s, and with 0.01 N m they never come."""
    told = {}
    for name, given in (
        ("short", {"duration": 0.4}), ("long", {"duration": 0.9}), ("weak", {"duration": 0.4, "torque": 0.01}),
        ("landing", {"duration": 0.1, "drop_speed": 0.05}),
    ):  # fmt: skip
        settings = on_bed(rig=0.0085, bed_size=(0.4, 0.06, 0.06), **given)
        plan = PlanarOnBed(settings).plan
        law = PlanarOnBed(settings).forecast.trajectory
        told[name] = tumble_opening.short_of_way(settings, plan, law)
    assert told["long"] is None is told["landing"]
    assert "4.1 mm" in told["short"] and "duration = 0.4" in told["short"]
    wanted = float(re.search(r"duration = (\S+) s is sufficient", told["short"])[1])
    assert simulate(plan_of(0.4), duration=wanted).trajectory_angle is not None
    assert simulate(plan_of(0.4), duration=wanted - 0.02).trajectory_angle is None
    assert "in 3.2 s" in told["weak"] and "a larger torque" in told["weak"]
    golden("tumble/short_of_way", [told["short"], told["weak"]])


@pytest.mark.parametrize(
    ("torque", "wheel_speed", "said"),
    [
        (5.0, 10.0, "use wheel_speed_0 = 20 rad/s"),
        (0.01, 900.0, "use torque = 0.04 N m"),
        (0.01, 10.0, "use wheel_speed_0 = 40 rad/s with torque = 0.04 N m"),
    ],
)
def test_of_a_brake_that_does_not_bring_it_away_what_would_do_is_said(torque, wheel_speed, said):
    """A wheel with too little in it, whatever slows it; a brake far below W l sin(pi / n) = 0.067 N m; both."""
    settings = on_bed(rig=0.0085, actuator="brake", duration=0.4, torque=torque, wheel_speed_0=wheel_speed)
    plan = PlanarOnBed(settings).plan
    trial = plan.trial
    told = tumble_opening.short_of_way(settings, plan, simulate(trial, duration=0.4))
    assert "in 3.2 s" in told and said in told
    stronger = {name: float(value) for name, value in re.findall(r"(wheel_speed_0|torque) = (\S+)", said)}
    assert simulate(replace(trial, **stronger), duration=3.2).trajectory_angle is not None


def plan_of(duration):
    return PlanarOnBed(on_bed(rig=0.0085, duration=duration)).plan.trial


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"spike_length": 40}, r"spike_length = 40 m \(given\) is 376 times .* metres are expected: 0.04\?"),
        ({"spike_diameter": 12}, r"spike_diameter = 12 m, where .* 0.2 m from its centre: .* expected: 0.012\?"),
        ({"spike_clear": 40}, r"spike_clear = 40 m, .* expected: 0.04\?"),
        ({"grain": 3}, r"grain = 3 m, .* expected: 0.003\?"),
        ({"coarse": 6}, r"coarse = 6 m, .* expected: 0.006\?"),
        ({"bed_size": (0.5, 60, 0.046)}, r"bed_size\[1\] = 60 m, .* at most 20 m is accepted; .* expected: 0.06\?"),
        ({"rig": 3}, r"rig = 3 g is not below the local gravity, 1 g .* \(3 m/s2 are 0.306 g\), or gravity"),
    ],
)
def test_lengths_in_mm_and_a_rig_in_m_s2_are_refused_by_what_would_do(given, said):
    with pytest.raises(ValueError, match=said):
        tumble.check(on_bed(**given))


def test_k_and_c_of_another_spike_are_said(tmp_path):
    """Those of sand are of a spike of 12 mm; brick's of none; who gives both knows."""
    mine = eight_sided(tmp_path)

    def said(settings):
        return [text for text in plan_tumble(settings).warnings if "with ball tips" in text]

    assert not said(TumbleSettings(surface="sand"))
    assert not said(TumbleSettings(platform=mine, torque=1e-3))
    (warning,) = said(TumbleSettings(surface="sand", platform=mine, torque=1e-3))
    assert warning.startswith("stiffness and damping") and "12 mm" in warning and "6 mm" in warning
    (half,) = said(TumbleSettings(surface="sand", platform=mine, torque=1e-3, stiffness=40.0))
    assert half.startswith("damping of sand")
    assert not said(TumbleSettings(surface="sand", platform=mine, torque=1e-3, stiffness=40.0, damping=0.3))
    (bare,) = said(TumbleSettings(surface="sand", platform=eight_sided(tmp_path, ""), torque=1e-3))
    assert "there are none" in bare
    beside = PlanarOnBed(on_bed(spike_diameter=0.008)).plan.warnings
    assert any("8 mm thick" in text for text in beside)
    golden("tumble/another_spike", {"neither given": warning, "stiffness given": half, "none": bare})
    assert not any("with ball tips" in text for text in PlanarOnBed(on_bed()).plan.warnings)
    cube = plan_spatial(SpatialSettings(surface="sand", platform=mine))
    assert sum("with ball tips" in text for text in cube.warnings) == 1


def test_the_box_over_the_sand_is_as_high_as_a_brake_may_throw_it():
    """v^2 / 2 g at twice the speed of the spring-damper's fastest tip; a slow motor's sand stays in its box."""
    made = []
    bed = SimpleNamespace(
        surface=0.06, height=0.16, repeated=lambda times, height: made.append((times, height)) or "up"
    )
    brake = on_bed(torque=6.0, actuator="brake", wheel_speed_0=300.0, duration=0.6)
    forecast = PlanarOnBed(brake).forecast
    assert 1.0 < forecast.fastest < 0.2 * 0.0012 * 300 / 0.06 * 1.2  # the wheel's momentum, on the whole of l
    assert PlanarOnBed(brake).laid_out(bed) == "up"
    assert made == [(1, pytest.approx(0.06 + (2 * forecast.fastest) ** 2 / (2 * 9.80665)))]
    motor = on_bed(torque=0.125)
    assert PlanarOnBed(motor).laid_out(bed) is bed


def test_the_box_is_as_high_as_a_platform_carries_grains_that_stick():
    """All of it, 2 l, and two grains on its tip, with what its centre rises; sand, which does not stick, needs none."""
    bed = SimpleNamespace(surface=0.06, height=0.16, repeated=lambda times, height: height)
    found = {}
    for surface in ("jsc1a", "sand"):
        motor = on_bed(surface=surface, torque=0.22, bed_stages=None)
        sticky = PlanarOnBed(motor)
        found[surface] = sticky.laid_out(bed)
        law = sticky.forecast.trajectory
        rise = law.y.max() - law.y[0]
        if surface == "jsc1a":
            assert found[surface] == pytest.approx(0.06 + 2 * sticky.trial.spike_length + rise + 2 * motor.grain)
    assert found["sand"] is bed


def test_grains_that_stick_are_stiff_enough_for_what_a_spike_meets_however_little_the_law_sinks():
    """The pressure holds the resistance of the material, of the largest forces; sand has none."""
    met = STICKING * recipe_of(find_material("jsc-1a-loose-cut")).resistance

    def chosen(surface):
        return PlanarOnBed(on_bed(surface=surface, torque=0.22, bed_stages=None, stiffness=1500.0)).softening()

    assert chosen("jsc1a").pressure > met > chosen("sand").pressure
    assert chosen("jsc1a").young > 2 * chosen("sand").young


def test_the_length_that_a_refusal_names_holds_the_way_that_tumbles_on_grains_have_gone():
    """0.22 N m for 2 s: 263 mm on 2.4 mm grains (docs/results/grains1-sand-0.0085-0.22), on springs 101."""
    with pytest.raises(ValueError, match=r"m, or a shorter duration") as refused:
        tumble.check(on_bed(bed_size=(0.3, 0.06, 0.046), duration=2.0))
    named = float(str(refused.value).rsplit(" m, or a shorter", 1)[0].rsplit(" ", 1)[1])
    wide = on_bed(bed_size=(named, 0.06, 0.046), duration=2.0)
    tumble.check(wide)
    assert PlanarOnBed(wide).may_leave() is None
    assert named - PlanarOnBed(wide).origin > 0.263 + 0.1
    short = on_bed(bed_size=(0.4, 0.06, 0.046), duration=2.0)
    tumble.check(short)
    said = PlanarOnBed(short).may_leave()
    assert f"bed_size = {named:g} m" in said and "bed_repeats = 2" in said


def test_a_tumble_on_grains_with_nothing_but_its_torque_given_stays_on_its_bed():
    """`hedgebed tumble --surface sand --ground bed --rig 0.0085 --torque 0.22`: 1.1 s, where planar tumbles have 3."""
    given = {"surface": "sand", "rig": 0.0085, "torque": 0.22}
    settings = TumbleSettings(**given, ground="bed")
    assert (settings.duration, TumbleSettings(**given).duration) == (1.1, 3.0)
    assert TumbleSettings(**given, ground="bed", tumbles=2).duration == 3.0
    assert TumbleSettings(surface="sand", ground="bed", gravity=1e-2).duration == 3.0
    tumble.check(settings)
    forecast = PlanarOnBed(settings).forecast
    assert PlanarOnBed(settings).may_leave() is None
    # A tip may come down as far ahead as a torque that acts all the time rolls it, less what sand takes.
    assert forecast.farthest > 0.0788 + 0.077  # what grains did in 1.1 s, and the next row ahead of the centre


def test_beds_of_jsc1a_are_prepared_as_their_material_needs_it_and_a_message_names_the_stages(tmp_path, monkeypatch):
    """By the recipe of the material; as set where stages are set. Sand is rained and levelled, without a message."""

    class ReachedError(Exception):
        pass

    def prepare(*_):
        raise ReachedError

    monkeypatch.setattr(PlanarOnBed, "prepare", prepare)
    shipped = ("rain:dry", "compact:0.57", "stick", "level")
    told = {}
    for name, given, stages in (
        ("plain", {"surface": "jsc1a"}, ("rain:dry", "compact:0.56", "stick", "level")),
        ("older", {"surface": "jsc1a-heights"}, shipped), ("sand", {}, None),
        ("staged", {"surface": "jsc1a", "bed_stages": shipped}, shipped),
    ):  # fmt: skip
        settings = on_bed(bed_size=(0.4, 0.06, 0.061), **given)
        tumble.check(settings)
        progress, told[name] = Progress(), []
        monkeypatch.setattr(progress, "message", told[name].append)
        with pytest.raises(ReachedError):
            tumble.run(settings, tmp_path / name, progress=progress)
        assert PlanarOnBed(settings).stages == stages
    (said,) = (text for text in told["plain"] if "is prepared as" in text)
    assert "jsc-1a-loose-cut" in said and said.endswith(" ".join(PlanarOnBed(on_bed(surface="jsc1a")).stages))
    assert any("jsc-1a-loose-heights" in text for text in told["older"])
    assert not any("is prepared as" in text for name in ("staged", "sand") for text in told[name])


@pytest.mark.parametrize("false", [False, True])
def test_the_result_dates_the_wheels_limit_and_warns_of_energy_made_and_of_overlaps_past_the_bound(false, tmp_path):
    """On the spring-damper in place of grains, which for once holds 1 W more and more than it took."""
    settings = on_bed(torque=0.125, max_wheel_speed=1.0, duration=0.1, bed_size=(0.4, 0.06, 0.046))
    plan = PlanarOnBed(settings).plan
    footing = LawGround.of_trial(plan.trial)
    footing.bed = SimpleNamespace(
        grain_count=1, packing_fraction=0.6, surface=0.0, time_step=1e-4, max_overlap=0.2 if false else 0.0,
        material=SAND_WEAK,
    )  # fmt: skip
    run = CoupledTumble(plan.trial, footing, duration=0.1, max_wheel_speed=plan.max_wheel_speed)
    if false:
        footing.energies = lambda: {"springs": run.body.time}
    beside = PlanarOnBed(settings).forecast.trajectory
    run.run()
    result = tumble_grains_result.conclude(
        settings, plan, run, beside, Softening(1e7, 1.0, 1.0, 7e10), tmp_path,
    )  # fmt: skip
    assert result["wheel_at_limit"] == pytest.approx(plan.trial.wheel_inertia / 0.125, rel=1e-9)
    assert any("at 0.0096 s" in said for said in result["warnings"])
    reversal = result["quantities"]["dissipation_reversal"]["value"]
    assert any("dissipation_reversal" in said for said in result["warnings"]) == false == (reversal > 1e-3)
    pressed = "past max_overlap = 5 %, where 5 % are small: young = 8e+07 Pa"  # F ~ E overlap^1.5
    assert any(pressed in said for said in result["warnings"]) == false
    assert any("rolling friction" in said for said in result["warnings"])
    assert "dissipated_friction" not in result["quantities"]  # a law keeps no such book
    shown = {row[0]: row[1:] for row in result["tables"][0]["rows"]}
    deepest = result["quantities"]["sinkage_largest"]["value"], result["grains"]["beside"]["sinkage_largest"]["value"]
    assert deepest[0] == pytest.approx(deepest[1], rel=0.02)  # the same law, through the master and by itself
    assert next(row for name, row in shown.items() if "deepest" in name) == [
        f"{1e3 * depth:.2f} mm" for depth in deepest
    ]
    assert "10 mm away" in result["departures"]["sentences"][0]


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ((-24.04, 11.63), "It goes down (−24.0 degrees); on the spring-damper it would go up (+11.6 degrees)."),
        ((20.0, 11.63), "It goes up (+20.0 degrees); on the spring-damper it goes up (+11.6 degrees)."),
        ((-5.0, None), "It goes down (−5.0 degrees); on the spring-damper it does not get 10 mm away in this time."),
        ((None, 90.0), "It does not get 10 mm away in this time; on the spring-damper it goes up (+90.0 degrees)."),
        ((0.0, -0.01), "It goes level (0.0 degrees); on the spring-damper it goes level (0.0 degrees)."),
    ],
)
def test_which_way_it_went_is_said_in_words_with_the_spring_damper_s(angles, said):
    from vis.tumble.beside import beside_words

    sides = [{"trajectory_angle": {"value": None if angle is None else math.radians(angle)}} for angle in angles]
    assert beside_words(*sides) == said


def test_a_run_on_a_bed_may_pass_the_overlap_that_its_step_is_chosen_for_up_to_twice():
    """Meant: 9 %. At 17 % it goes on, taken up from a state too; at 19 % it ends."""
    settings = on_bed(**SMALL | {"max_overlap": 0.09})
    run = PlanarOnBed(settings).stepper(small_bed(settings))
    bed = run.ground.bed
    bed.restore(bed.state())
    bed.max_overlap = 0.17
    bed.advance(1)
    bed.max_overlap = 0.19
    with pytest.raises(BedFailure, match=r"overlap of 19 % .* its bound of 18 %"):
        bed.advance(1)


@pytest.mark.long
def test_a_checkpoint_of_before_takes_the_bound_on_overlaps_that_a_run_has_now(tmp_path, monkeypatch):
    """One that ended at its `max_overlap` of 9 % goes on with the bound of today, and with all else as it was."""
    settings = on_bed(**SMALL | {"max_overlap": 0.09, "frame_count": 0})
    of_today = PlanarOnBed(settings)
    old, new = (of_today.stepper(small_bed(settings)) for _ in range(2))
    old.ground.bed.overlap_limit = 0.09
    for _ in range(3):
        old.master.step()
    folder = RunFolder.create(tmp_path / "run", "tumble", settings)
    folder.save_checkpoint("tumble", old.state())

    @contextmanager
    def stopping():
        yield lambda: True

    monkeypatch.setattr(following, "held_back", stopping)
    with pytest.raises(KeyboardInterrupt):
        of_today.follow(new, folder, Progress())
    assert new.ground.bed.overlap_limit == run_limit(0.09) > 0.09
    assert new.ground.bed.steps == old.ground.bed.steps + settings.substeps


def test_a_run_that_leaves_the_bed_says_where_and_keeps_its_state_and_series(tmp_path, monkeypatch, capsys):
    """On the spring-damper in place of grains, which after 50 steps answers as a bed whose end is passed."""

    def stepper(on_bed, bed):
        footing = LawGround.of_trial(on_bed.trial)
        plain, count = footing.step, 0

        def step(*given):
            nonlocal count
            count += 1
            if count > 50:
                raise LeftTheBedError("spike 7 came down 0.01 m ahead of the bed, which is 0.4 m long", lacking=0.02)
            return plain(*given)

        footing.step = step
        return CoupledTumble(on_bed.trial, footing, duration=on_bed.duration)

    monkeypatch.setattr(PlanarOnBed, "prepare", lambda *_: SimpleNamespace(surface=0.0, height=1.0))
    monkeypatch.setattr(PlanarOnBed, "stepper", stepper)
    out = tmp_path / "left"
    given = ("--surface", "sand", "--ground", "bed", "--bed-size", "0.4", "0.06", "0.046", "--frame-count", "0")
    assert main(["tumble", *given, "--duration", "0.3", "--quiet", "--out", str(out)]) == 2
    said = capsys.readouterr().err.replace("\n", " ")
    assert all(number in said for number in ("at 0.05 s:", "spike 7", "0.01 m ahead", "by 0.04 m"))
    assert json.loads((out / "status.json").read_text())["status"] == "failed"
    state = RunFolder.open(out).load_checkpoint("tumble.failed")
    assert state is not None and state["master.count"] == 50
    assert len((out / "trajectory.csv").read_text().splitlines()) == 1 + 51


def test_a_landing_that_lets_go_of_the_sand_on_its_way_down_has_not_rebounded():
    """Touched at -0.05 m/s, let go of still going down, left at +0.02: restitution 0.4; without the last, none."""
    speeds = np.array([-0.05, -0.05, -0.04, -0.01, 0.02, 0.02])
    states = ["hop", "pivot", "hop", "pivot", "hop", "hop"]
    for end, share in ((6, 0.4), (4, None)):
        rows = {"time": np.arange(end), "vx": 0 * speeds[:end], "vy": speeds[:end], "omega": 0 * speeds[:end]}
        rows["kinetic_energy"] = speeds[:end] ** 2
        run = SimpleNamespace(columns=rows, states=states[:end], trial=Trial(gravity_sim=9.80665, spike_length=0.2))
        found = tumble_steppers._landing(run)["restitution"]["value"]
        assert found == (share and pytest.approx(share))


@pytest.mark.slow
@pytest.mark.parametrize("repeats", [1, 4])
def test_a_run_stopped_by_ctrl_c_is_taken_up_again_to_the_same_numbers(repeats, tmp_path, monkeypatch):
    """On one bed, and on a piece laid end to end four times."""
    monkeypatch.setattr(PlanarOnBed, "prepare", prepare_small)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
    size = (SMALL["bed_size"][0] / repeats, *SMALL["bed_size"][1:])
    settings = TumbleSettings(**SMALL | {"bed_size": size}, sleep=True, bed_repeats=repeats)
    whole = tumble.run(settings, tmp_path / "whole")
    stop_at(monkeypatch, 250)
    with pytest.raises(KeyboardInterrupt):
        tumble.run(settings, tmp_path / "broken")
    assert RunFolder.open(tmp_path / "broken").load_checkpoint("tumble") is not None
    again = tumble.resume(tmp_path / "broken")
    assert again["quantities"] == whole["quantities"]
    for name in ("trajectory.csv", "series/feet.csv", "series/bed.csv", "series/motion.csv", "frames/tumble.pvd"):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert whole["quantities"]["energy_residual"]["value"] < 0.01
    assert whole["quantities"]["momentum_residual"]["value"] < 1e-12
    assert whole["quantities"]["angular_momentum_residual"]["value"] < 1e-4 * settings.torque * settings.duration
    grains = whole["grains"]
    assert (grains["repeats"], grains["grain_count"]) == (repeats, 384)
    assert grains["grain_steps"] == pytest.approx(grains["awake_share"] * grains["grain_steps_all_awake"])
    assert 0 < grains["awake_share"] < 0.9 and grains["lowering_time"] > 0
    assert whole["method"] == "coupled" and whole["ground"] == "bed"
    assert whole["grains"]["beside"]["max_speed"]["value"] > 0
    rows = (tmp_path / "whole" / "trajectory.csv").read_text().count("\n") - 1
    assert rows >= 1000 * settings.duration
    _check_report(tmp_path / "whole", whole)


@pytest.mark.parametrize(("repeats", "tips", "said"), [(3, 0.62, True), (3, 0.55, False), (1, 0.62, False)])
def test_tips_that_come_down_over_more_than_one_copy_are_said_to_meet_the_same_sand(repeats, tips, said, monkeypatch):
    """Over 0.62 m and a spike's 12 mm on copies of 0.6 m; where there is one piece it is the whole bed."""
    monkeypatch.setattr(tumble_grains_result, "tips_in_ground", lambda run: (np.array([-0.1, tips - 0.1]), None))
    settings = SimpleNamespace(bed_size=(0.6, 0.036, 0.06), bed_repeats=repeats)
    warning = tumble_grains_result._same_sand_again(settings, None, 0.012)
    assert (warning is not None and "every 0.6 m" in warning) == said


def _check_report(folder, result):
    """The section of the report has its figures and both columns, and where the energy went."""
    from vis.page.report import Report
    from vis.tumble.grains import grains_section

    section = grains_section(Report(folder, package="vis.tumble"))
    assert [block.kind for block in section.blocks] == ["figure", "text", "table", "figure", "text", "figure"]
    drawn = ("beside.png", "feet.png", "books.png")
    assert all((folder / "figures" / name).stat().st_size > 5000 for name in drawn)
    assert "at 1 g" in section.blocks[4].text


def test_stages_of_a_bed_reach_the_laboratory_and_its_cache(monkeypatch):
    """`--bed-stages`, with a stand-in for the laboratory; what it refuses on the way fails the run, with its words."""
    from dem.grains.materials import material
    from dem.prepare.report import Prepared
    from experiments.grains import staged as bed_staged

    asked, bed = [], SimpleNamespace()

    def prepare_as(material, *, stages, cache, progress, **options):
        asked.append((stages, cache))
        progress.stage("rain", 1.0)
        progress.update(0.5)
        if "fluff" not in stages:
            raise ValueError("packing = 0.6 cannot be reached")
        return Prepared(bed, {}, [])

    monkeypatch.setattr(bed_staged, "prepare_as", prepare_as)
    options = {
        "size": (0.04, 0.04, 0.03), "grain": 0.005, "spread": 0.15, "gravity": 9.81, "seed": 1, "young": 1e6,
        "max_overlap": 0.1, "arch": "cpu", "threads": 1, "cache": True, "progress": Progress(),
        "asked_to_stop": lambda: False,
    }  # fmt: skip
    assert bed_staged.staged_bed(material("sand"), ("rain", "fluff", "level"), **options) is bed
    assert asked == [(("rain", "fluff", "level"), True)]
    with pytest.raises(RuntimeError, match=r"packing = 0\.6 cannot be reached"):
        bed_staged.staged_bed(material("sand"), ("rain", "compact:0.6", "level"), **options)


def test_a_tumble_with_stages_asks_the_laboratory_for_a_bed_with_all_it_was_told(monkeypatch):
    """jsc1a with the stages of older cases, and by its recipe: the laboratory takes what the tumble hands on."""
    import inspect

    from dem.prepare.prepare import prepare_as as laboratory
    from dem.prepare.specification import BedOptions
    from experiments.grains import staged as bed_staged

    asked, bed = {}, SimpleNamespace()

    def prepare_as(*given, **options):
        found = inspect.signature(laboratory).bind(*given, **options).arguments
        assert found["options"].keys() <= BedOptions.__annotations__.keys()
        asked.update(found | found["options"])
        return SimpleNamespace(bed=bed)

    monkeypatch.setattr(bed_staged, "prepare_as", prepare_as)
    shipped, own = (("rain:dry", f"compact:{packing}", "stick", "level") for packing in ("0.57", "0.56"))
    for given, stages in ((shipped, shipped), (None, own)):
        settings = on_bed(surface="jsc1a", bed_size=(0.4, 0.06, 0.061), bed_stages=given, threads=1, seed=7)
        staged = PlanarOnBed(settings)
        softening = staged.softening()
        assert staged.prepare(softening, Progress()) is bed
        assert asked["stages"] == stages and asked["seed"] == 7 and asked["young"] == softening.young
        assert (asked["arch"], asked["threads"], asked["gravity"]) == ("cpu", 1, pytest.approx(9.80665))
        assert asked["material"].name == "jsc-1a-loose-cut"
