"""Settings drawn at random that are computed: exit 0, or exit 2 with a sentence, and no number that is none.

Exit 2 also where only the computation finds it, as that a platform does not come to rest; the run keeps what it has.

Experiments without grains, of short durations, with settings near sensible ones and far from them. `make fuzz` computes
a tenth of HEDGEBED_FUZZ in parts with seeds of their own, and draws one report in 25; the suite computes 20 cases.
"""

import json
import random
import signal
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from shutil import rmtree

import pytest
from faults.fuzzing import ALL, CASES, in_words, kept, outcome

from experiments.runs import whole_runs
from experiments.runs.registry import EXPERIMENTS, TOO_LARGE
from rigid.ground.laws import GROUNDS
from rigid.platform.files import PLATFORM_FOLDER
from rigid.result import toml_value
from rigid.terms import EFFECTS

COMPUTED = CASES // 10 if ALL else 20
PART = 50
"""Cases that are computed, and those of a part, at most."""
PARTS = range(-(-COMPUTED // PART))
LONGEST = 300.0  # Processor time of a case [s]: what takes more counts as endless; a law may take minutes
SURFACES = ["steel", "brick", "sand", "sand-weak", "jsc1a", "jsc1a-heights"]
PLATFORMS = ["hedgehog", "cubli", "mascot", "minerva", "cube.toml"]
LAWS = [*GROUNDS, "law.toml"]
PLATFORM = {
    "mass": 5.3, "inertia": 0.06, "spike_length": 0.2, "wheel_inertia": 1.2e-3, "mu_s": 0.5, "mu_d": 0.25,
    "stiffness": 1.5e4, "damping": 60.0, "max_wheel_speed": 1050.0, "max_motor_torque": 0.22,
}  # fmt: skip
MODEL = """format = "hedgehog-campaign/1"
kind = "penetration"
name = "drawn"
[spike]
mass = 0.5
diameter = 0.012
tip = "sphere"
[surface]
kind = "sand"
granular = true
stiffness = 900.0
damping = 4.0
"""


@dataclass(frozen=True)
class Form:
    """A command and what is drawn for it: numbers around these, one of these words, and what is always given."""

    command: str
    numbers: dict[str, float]
    words: dict[str, list] = field(default_factory=dict)
    always: dict[str, object] = field(default_factory=dict)
    duration: tuple[float, float] | None = None
    vectors: dict[str, tuple[float, ...]] = field(default_factory=dict)
    terms: bool = False  # whether `effects` and `ground_parameters` are drawn


FORMS = [
    Form(
        "tumble",
        PLATFORM | {"rig": 0.0085, "gravity": 0.05, "counterweight": 5.0, "torque": 0.22, "torque_until": 0.1,
                    "wheel_speed_0": 100.0, "drop_speed": 0.05, "drop_along": 0.02, "drop_spin": 0.2, "drop_theta": 0.1,
                    "sample_interval": 1e-3, "tumble_turn": 1.0},
        {"surface": SURFACES, "ground": LAWS, "platform": PLATFORMS, "rig_reading": ["pair", "weight"],
         "actuator": ["motor", "brake"], "method": ["located", "located", "paper", "coupled"], "tumbles": [1, 2],
         "substeps": [1, 10, 50], "body_steps": [1, 10], "extrapolation": [0, 1, 2], "iterations": [1, 5],
         "campaign": ["trials"], "campaign_trials": [1, 3],
         "sweep": [["mu_s=0.3:0.5:0.1"], ["torque=0:0.2:0.1"], ["mass=1:3:1", "rig=0.01:0.02:0.01"]]},
        duration=(0.01, 0.5), terms=True,
    ),
    Form(
        "tumble spatial",
        {key: PLATFORM[key] for key in ("mu_s", "mu_d", "stiffness", "damping")}
        | {"rig": 0.0085, "gravity": 0.05, "torque_until": 0.1, "height": 0.02, "lowering_speed": 0.02},
        {"surface": SURFACES, "platform": PLATFORMS, "rig_reading": ["pair", "weight"], "actuator": ["motor", "brake"],
         "torque_in_flight": [True], "substeps": [5, 10, 50], "extrapolation": [0, 1, 2], "iterations": [1, 5],
         "frame_count": [0, 3]},
        duration=(0.01, 0.1),
        vectors={"torque": (0.1, 0.22, 0.1), "wheel_speed_0": (50.0, 100.0, 50.0), "turn": (0.1, 0.1, 0.3),
                 "velocity": (0.02, 0.01, -0.05), "angular_velocity": (0.1, 0.3, 0.1)},
    ),
    Form(
        "hop",
        PLATFORM | {"gravity": 1e-3, "distance": 5.0, "wheel_speed_0": 200.0, "body_radius": 5e3, "torque": 0.2},
        {"surface": SURFACES, "ground": ["spring-damper", "law.toml"], "platform": PLATFORMS,
         "actuator": ["brake", "motor"]},
    ),
    Form(
        "ground",
        {"gravity": 9.8, "tip_diameter": 0.012, "packing": 0.56, "grain": 2e-4, "load": 0.2},
        {"material": ["sand", "jsc-1a-loose-cut"], "tip": ["sphere", "cone", "flat"]},
    ),
    Form(
        "penetrate",
        {"gravity": 9.8, "tip_diameter": 0.012, "shaft_length": 0.06, "cone_angle": 60.0, "platform_mass": 5.3,
         "rig": 0.0085, "load": 0.2, "mass": 0.1, "depth": 0.006, "hold": 0.01, "retreat_speed": 0.4,
         "after_stop": 0.03, "drop_time": 0.3, "lowering_speed": 0.1, "rest_time": 0.04},
        {"tip": ["sphere", "cone", "flat"], "ground": ["spring-damper", "law.toml"], "model": ["model.toml"],
         "substeps": [1, 10, 100]},
        {"ground": "law.toml"},
        vectors={"speeds": (0.1, 0.4), "drop_speeds": (0.1, 0.2), "other_speeds": (0.4,)},
    ),
    Form(
        "mujoco",
        {"height": 0.02, "gravity": 1.6, "stiffness": 900.0, "damping": 4.0, "mu_s": 0.6, "mu_d": 0.3},
        {"surface": SURFACES, "ground": LAWS, "substeps": [1, 10, 50], "extrapolation": [0, 1, 2], "iterations": [1, 4],
         "frame_count": [0, 3], "scale_with_gravity": [True, False], "ignore_foot_size": [True],
         "ignore_gravity_range": [True], "feet": [["foot"], ["spike_*"], ["tip_*"]]},
        {"model": "hopper", "feet": ["foot"]},
        duration=(0.01, 0.2), terms=True,
    ),
    Form(
        "campaign",
        PLATFORM | {"counterweight": 5.0, "torque_until": 0.1, "brake_wheel_speed": 300.0, "wheel_std": 0.5,
                    "imu_window": 0.004, "camera_rate": 120.0, "imu_rate": 100.0, "wheel_rate": 300.0, "lead": 0.1,
                    "wire_length": 2.2, "sigma_mass": 0.002, "sigma_stiffness": 0.1, "sigma_gravity_sim": 0.02},
        {"surface": SURFACES, "platform": PLATFORMS, "trials": [1, 2], "exact": [True]},
        {"motor_torques": [0.2], "brake_torques": [6.0], "rig": [0.0085]},
        duration=(0.01, 0.3), terms=True,
        vectors={"gravity": (0.05, 0.1), "pose_std": (5e-4, 5e-4, 3e-3), "imu_std": (0.01, 0.02, 0.02)},
    ),
]  # fmt: skip
EXTREMES = [0.0, 1e-9, 1e-300, 1e9, 1e300, -1.0]


def around(number, chance):
    """A number near this one, or some powers of ten away, or an extreme one."""
    how = chance.random()
    if how < 0.1:
        return chance.choice(EXTREMES)
    return number * 10 ** (chance.uniform(-0.5, 0.5) if how < 0.8 else chance.uniform(-3.0, 3.0))


def by_parameter(near, chance):
    """One or two of these parameters, as name=value."""
    names = chance.sample(sorted(near), min(len(near), chance.choice([1, 1, 2])))
    return [f"{name}={around(near[name], chance)!r}" for name in names]


EFFECTS_NEAR = {
    f"{name}.{parameter.name}": parameter.default if 0 < parameter.default < 1e9 else min(0.1, parameter.highest)
    for name, effect in EFFECTS.items()
    for parameter in effect.parameters
}


def drawn(number):
    """The command and the settings of case `number`."""
    chance = random.Random(f"computed {number}")
    form = chance.choice(FORMS)
    given = dict(form.always)
    if form.duration:
        given["duration"] = chance.uniform(*form.duration)
    known = [*form.numbers, *form.words, *form.vectors, *(["effects"] if form.terms else [])]
    for name in chance.sample(known, chance.randint(0, 6)):
        if name in form.numbers:
            given[name] = around(form.numbers[name], chance)
        elif name in form.words:
            given[name] = chance.choice(form.words[name])
        elif name in form.vectors:
            given[name] = [around(each, chance) for each in form.vectors[name]]
        else:
            given[name] = by_parameter(EFFECTS_NEAR, chance)
    law = GROUNDS.get(str(given.get("ground", "")))
    if form.terms and law is not None and chance.random() < 0.5:
        given["ground_parameters"] = by_parameter({each.name: each.default for each in law.parameters}, chance)
    fields = EXPERIMENTS[form.command].settings_class().model_fields
    return form.command, {name: value for name, value in given.items() if name in fields}


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The files that the cases name, in the present folder."""
    monkeypatch.chdir(tmp_path)
    cube = PLATFORM_FOLDER / "cube.toml"
    Path("cube.toml").write_text(cube.read_text(encoding="utf-8"), encoding="utf-8")
    Path("model.toml").write_text(MODEL, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
        assert outcome("ground", "--out", "looked-up", "--quiet")[0] == 0
    Path("law.toml").write_bytes(Path("looked-up/ground.toml").read_bytes())


@contextmanager
def ending():
    """Stops what takes too long, as Ctrl-C does: exit status 3."""
    before = signal.signal(signal.SIGPROF, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def computed(number):
    """Case `number`, its exit status, what it said, and what is wrong with that."""
    command, given = drawn(number)
    lines = [f"{key} = {toml_value(value)}\n" for key, value in given.items()]
    Path("case.toml").write_text("".join(lines), encoding="utf-8")
    for folder in ("out", "trials"):
        rmtree(folder, ignore_errors=True)
    with ending(), warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        status, said = outcome(*command.split(" "), "case.toml", "--out", "out", "--quiet")
    faults = [] if status in (0, 2) else [f"exit {status}"]
    faults += [] if in_words(said) and (status == 0 or said.strip()) else ["not in words"]
    faults += [f"{each.filename}, line {each.lineno}: {each.message}" for each in warned if not elsewhere(each)]
    if status == 0:
        result = json.loads(Path("out/result.json").read_text(encoding="utf-8"))
        unsaid = [name for name, each in result["quantities"].items() if each["value"] is None and not each.get("note")]
        faults += [f"no number and no word: {unsaid}"] if unsaid and not result.get("warnings") else []
    return (command, given), status, said, faults


def elsewhere(warning):
    """Whether a warning is of the libraries about one another, which the numbers of a case have no part in."""
    return issubclass(warning.category, DeprecationWarning)


@pytest.mark.long
@pytest.mark.parametrize("part", PARTS)
def test_settings_of_any_kind_are_computed_or_refused_in_words(part, files, monkeypatch):
    """No traceback, no warning of numpy; a number that there is none of is null, with a note or a warning."""
    report = whole_runs.write_report
    with kept(f"computed {part}") as counts:
        for number in range(part * PART, min(COMPUTED, (part + 1) * PART)):
            draws = ALL and number % 25 == 0
            monkeypatch.setattr(whole_runs, "write_report", report if draws else lambda *given: None)
            case, status, said, faults = computed(number)
            assert not faults, (number, case, said)
            counts[status] += 1


@pytest.mark.parametrize(
    ("command", "given", "said"),
    [
        ("penetrate", {"ground": "law.toml", "speeds": [1e-9]}, "speeds = 1e-09 m/s needs"),
        ("penetrate", {"ground": "law.toml", "retreat_speed": 1e9}, "1e+09 m/s: change"),
        ("tumble spatial", {"stiffness": 1e-300}, "the platform sinks"),
        ("hop", {"body_radius": 1e300}, "body_radius = 1e+300"),
        ("campaign", {"wheel_rate": 1e9}, "wheel_rate = 1e+09 Hz"),
        ("hop", {"damping": 1e300, "spike_length": 0.156}, "damping = 1e+300"),
        ("tumble spatial", {"damping": 1e300, "duration": 0.0136}, "damping = 1e+300"),
        ("hop", {"ground": "spring-damper", "torque": 1e300, "gravity": 0.0025}, "cannot be followed"),
    ],
)
def test_what_would_take_without_end_or_overflow_is_refused_by_its_key(command, given, said, files):
    """Found by the fuzzer: without end, with a traceback, or with a warning of numpy."""
    lines = [f"{key} = {toml_value(value)}\n" for key, value in given.items()]
    Path("case.toml").write_text("".join(lines), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        status, words = outcome(*command.split(" "), "case.toml", "--out", "out", "--quiet")
    assert status == 2 and said in words and in_words(words), words
    assert not Path("out").exists()


@pytest.mark.parametrize("at", ["check", "run", "later"])
def test_a_number_too_large_to_compute_is_put_in_words_wherever_it_appears(at, files, monkeypatch):
    def overflow(*given, **options):
        if at == "later":
            (Path("out") / "checkpoint").mkdir()
            (Path("out") / "checkpoint" / "a.npz").touch()
        return 10.0**400

    module = "experiments.hop.experiment." + ("check" if at == "check" else "run")
    monkeypatch.setattr(module, overflow)
    found, words = outcome("hop", "--out", "out", "--quiet")
    assert found == 2 and in_words(words) and TOO_LARGE in words
    assert (Path("out") / "traceback.txt").exists() == (at == "later")


@pytest.mark.long
def test_a_platform_that_only_bounces_where_it_is_set_down_is_bad_input_and_its_state_is_kept(files):
    """Found by the fuzzer: 0.1 kg under 0.066 m/s2, on springs for 5 kg."""
    status, words = outcome(
        "tumble", "spatial", "--platform", "cube.toml", "--gravity", "0.0662", "--duration", "0.1", "--mu-s", "1.2",
        "--out", "out", "--quiet",
    )  # fmt: skip
    assert status == 2 and "come to rest" in words and in_words(words), words
    assert Path("out/checkpoint/tumble.failed.npz").exists()


@pytest.mark.long
def test_a_motion_whose_steps_become_too_short_to_end_is_refused_by_its_damping(files):
    """Found by the fuzzer: a damper of 2.5 million times critical, which round-off lets advance by nanoseconds."""
    (command, given), status, said, faults = computed(864)
    assert command == "hop" and given["damping"] == 1e9 and not faults
    assert status == 2 and "followed beyond" in said and "C = 1e+09" in said
