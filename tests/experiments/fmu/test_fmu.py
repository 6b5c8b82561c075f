"""`hedgebed fmu`: the FMU in fmpy, an importer that is not ours, against the runs of `hedgebed tumble`."""

import math
import re
import sys
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from import_graph import ROOT

from coupling import CoupledTumble
from experiments.cli.main import main
from experiments.fmu.build import build_fmu
from experiments.fmu.driven import ground_of
from experiments.fmu.settings import FmuSettings
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid import simulate
from rigid.ground_file import GroundFile

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
pytest.importorskip("pythonfmu3", reason="pythonfmu3 is not installed: pip install 'hedgebed[fmi]'")

CHANNELS = {"x": "x", "z": "y", "theta": "theta", "vx": "vx", "vz": "vy", "omega": "omega"}  # Ours: the trajectory's
STEP = 1e-3


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    """The file, with the platform and the surface by default: the Hedgehog in the rig, on brick."""
    return build_fmu(tmp_path_factory.mktemp("fmu") / "hedgehog.fmu", FmuSettings())


class Instance:
    """One of an FMU, by fmpy's plain functions of FMI 3."""

    def __init__(self, file, folder, **start):
        from fmpy.fmi3 import FMU3Slave

        self.description = fmpy.read_model_description(file)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.said = []
        self.fmu = FMU3Slave(
            guid=self.description.guid, modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=fmpy.extract(file, folder), instanceName="one",
        )  # fmt: skip
        self.fmu.instantiate(loggingOn=True, logMessage=lambda *all_of_it: self.said.append(str(all_of_it[-1])))
        self.time = 0.0
        self.begin(**start)

    def begin(self, **start):
        self.fmu.enterInitializationMode(startTime=0.0)
        self.set(**start)
        self.fmu.exitInitializationMode()
        self.time = 0.0

    def set(self, **values):
        for name, value in values.items():
            kind = "String" if isinstance(value, str) else "Boolean" if isinstance(value, bool) else "Float64"
            getattr(self.fmu, f"set{kind}")([self.variables[name].valueReference], [value])

    def get(self, *names):
        return np.array(self.fmu.getFloat64([self.variables[name].valueReference for name in names]))

    def go(self, count, step=STEP):
        """Rows of x, z, theta, wheel speed and work on the ground after each of `count` steps."""
        rows = []
        for _ in range(count):
            self.fmu.doStep(self.time, step)
            self.time += step
            rows.append(self.get("x", "z", "theta", "wheel_speed", "ground_work"))
        return np.array(rows)


@pytest.fixture
def instance(fmu, tmp_path):
    made = []

    def make(file=fmu, **start):
        made.append(Instance(file, tmp_path / str(len(made)), **start))
        return made[-1]

    yield make
    for each in made:
        each.fmu.freeInstance()


def of_tumble(**settings):
    """The trial of `hedgebed tumble` with these settings."""
    return plan_tumble(TumbleSettings(**settings)).trial


def largest_error(found, trial, *, until):
    """Over the channels: largest difference from `rigid.simulate`, over the channel's largest value; until [s]."""
    exact = simulate(trial, duration=until, sample_interval=STEP)
    count = min(len(exact.time), len(found["time"]))
    return max(
        np.abs(found[own][:count] - getattr(exact, theirs)[:count]).max() / np.abs(getattr(exact, theirs)).max()
        for own, theirs in CHANNELS.items()
    )


def test_fmpy_finds_no_fault_in_the_file(fmu):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu)) == []
    description = fmpy.read_model_description(fmu)
    options = description.coSimulation
    assert options.canHandleVariableCommunicationStepSize and options.canSerializeFMUstate
    causes = {variable.name: variable.causality for variable in description.modelVariables}
    assert {name for name, cause in causes.items() if cause == "input"} == {"torque", "brake"}
    assert sum(name.startswith("normal_force[") for name in causes) == 8


def test_a_tumble_is_that_of_hedgebed_tumble_to_the_second_order_of_the_inner_step(fmu, tmp_path):
    soft = {"torque": 0.22, "surface": "sand", "stiffness": 140.0, "damping": 3.0}
    trial, errors = of_tumble(**soft), []
    fine = build_fmu(tmp_path / "fine.fmu", FmuSettings(longest_step=STEP / 12))
    for file in (fmu, fine):  # of inner steps of 1/3 and 1/12 ms
        found = fmpy.simulate_fmu(
            str(file), stop_time=0.15, step_size=STEP, output_interval=STEP,
            start_values=soft, output=[*CHANNELS, "energy_residual", "torque_work"],
        )  # fmt: skip
        errors.append(largest_error(found, trial, until=0.15))
        assert found["theta"][-1] > 0.01  # it turns over
        assert np.abs(found["energy_residual"]).max() < 1e-4 * found["torque_work"][-1]
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)


@pytest.mark.long
@pytest.mark.parametrize("ground", [{"surface": "brick"}, {"surface": "sand", "stiffness": 140.0, "damping": 3.0}])
def test_after_the_last_tip_lifts_off_the_torque_ends_within_an_inner_step(fmu, ground):
    given = {"torque": 0.22, **ground}
    found = fmpy.simulate_fmu(
        str(fmu), stop_time=0.9, step_size=STEP, output_interval=STEP, output=[*CHANNELS, "normal_force[1]"],
        start_values=given,
    )  # fmt: skip
    trial = of_tumble(**given)
    exact = simulate(trial, duration=0.9, sample_interval=STEP)
    assert exact.state_names[-1] == "hop"
    impulse = trial.torque * 4e-4 / trial.inertia  # tau H / J [rad/s]: of one inner step
    assert np.abs(found["omega"] - exact.omega).max() < 1.1 * impulse
    assert np.abs(found["theta"] - exact.theta).max() < 1.1 * impulse * 0.9
    for own, theirs in (("x", "x"), ("z", "y")):
        assert np.abs(found[own] - getattr(exact, theirs)).max() < 1e-6


def test_inner_steps_of_the_coupled_method_give_the_same_bits(instance):
    trial = of_tumble(torque=0.22, surface="brick")
    run = CoupledTumble(trial, ground_of(trial), duration=0.04, substeps=4)  # 4 times 0.1 ms
    run.run()
    found = instance(torque=0.22).go(100, run.macro_step)
    assert np.array_equal(found[:, 2], run.columns["theta"][1:101])
    assert np.array_equal(found[:, 0], run.columns["x"][1:101])


def test_a_brake_stops_the_wheel_as_in_hedgebed_tumble_and_not_beyond(instance):
    trial = of_tumble(torque=3.0, actuator="brake", wheel_speed_0=60.0, surface="brick")
    exact = simulate(trial, duration=0.05, sample_interval=STEP)
    found = instance(wheel_speed_start=-60.0, brake=3.0).go(50)
    assert found[-1, 3] == 0  # 60 rad/s times 1.2e-3 kg m2 over 3 N m: 24 ms
    assert found[9, 3] == pytest.approx(-60 + 3.0 / 1.2e-3 * 0.01, abs=1e-9)
    assert np.abs(found[:, 2] - exact.theta[1:]).max() < 1e-4 * np.abs(exact.theta).max()


def test_the_motor_stops_at_the_largest_speed_of_the_wheel_and_a_brake_holds_it(instance):
    one = instance(wheel_speed_start=1049.0, torque=0.22)  # the Hedgehog's limit: 1050 rad/s after 5.5 ms
    assert one.go(10)[-1, 3] == pytest.approx(1050, abs=1e-9)
    one.set(torque=-0.22)
    assert one.go(10)[-1, 3] == pytest.approx(1050 - 0.22 / 1.2e-3 * 0.01, abs=1e-9)
    held = instance(torque=0.1, brake=0.2).go(10)
    assert np.abs(held[:, 2]).max() < 1e-12
    assert not held[:, 3].any()


def test_time_may_begin_anywhere(fmu):
    late, early = (
        fmpy.simulate_fmu(str(fmu), start_time=begin, stop_time=begin + 0.01, step_size=STEP, output_interval=STEP,
                          start_values={"torque": 0.22}, output=["theta"])
        for begin in (2.5, 0.0)
    )  # fmt: skip
    assert late["time"][-1] == pytest.approx(2.51) and np.allclose(late["theta"], early["theta"], rtol=1e-9, atol=0)


def test_two_instances_do_not_know_of_each_other(fmu, instance):
    first, second = instance(torque=0.22), instance(torque=0.22, surface="sand")
    both = [(first.go(1), second.go(1)) for _ in range(30)]
    alone = instance(torque=0.22, surface="sand").go(30)
    assert np.array_equal(np.concatenate([of_second for _, of_second in both]), alone)
    assert not np.array_equal(both[-1][0], both[-1][1])


def test_a_reset_starts_again_to_the_same_bits_with_the_numbers_of_the_file(instance):
    one = instance(torque=0.22, surface="sand")
    one.go(20)
    one.fmu.reset()
    one.begin(torque=0.22)
    assert np.array_equal(one.go(20), instance(torque=0.22).go(20))


def test_a_state_also_as_bytes_goes_on_to_the_same_bits(instance):
    one = instance(torque=0.22)
    one.go(20)
    state, time, load = one.fmu.getFMUState(), one.time, one.get("normal_force[1]", "ground_energy", "force_z")
    kept = one.fmu.serializeFMUState(state)
    ahead = one.go(15)
    one.fmu.setFMUState(state)
    one.time = time
    assert np.array_equal(one.get("normal_force[1]", "ground_energy", "force_z"), load)
    assert np.array_equal(one.go(15), ahead)
    other = instance()
    again = other.fmu.deserializeFMUState(kept)
    other.fmu.setFMUState(again)
    other.time = time
    assert np.array_equal(other.go(15), ahead)


def test_in_flight_the_torques_act_where_that_is_asked_for(instance):
    thrown = {"height": 0.5, "vz_start": 0.1, "gravity": 1e-2, "torque": 0.1}
    waits, turns = instance(**thrown).go(10), instance(torque_in_flight=True, **thrown).go(10)
    assert waits[-1, 2] == 0 and waits[-1, 3] == 0
    assert turns[-1, 3] == pytest.approx(0.1 * 0.01 / 1.2e-3)
    assert turns[-1, 2] == pytest.approx(0.5 * 0.1 / 0.06 * 0.01**2, rel=0.01)  # tau t^2 / 2 J
    fall = 0.5 + 0.1 * 0.01 - 0.5 * 1e-2 * 0.01**2
    assert waits[-1, 1] == pytest.approx(fall, abs=1e-12)


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ({"surface": "cheese"}, "surface"),
        ({"platform": "minervaa"}, "minervaa"),
        ({"theta_start": 0.1}, "needs height"),
        ({"stiffness": 1e12}, "longest_step"),
        ({"mu_s": 0.1, "mu_d": 0.3}, "mu_d"),
        ({"gravity": math.nan}, "gravity"),
        ({"rig": math.nan}, "rig"),
        ({"gravity": 1.0, "rig": math.nan}, "rig"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused_by_name(fmu, tmp_path, start, said):
    with pytest.raises(fmpy.fmi1.FMICallException):
        Instance(fmu, tmp_path, **start)
    # What the log says is checked on the class itself: fmpy hands the log only to a live instance.
    with pytest.raises(ValueError, match=said):
        slave_of(fmu, tmp_path, **start).exit_initialization_mode()


def slave_of(file, folder, **values):
    """The FMU's class as its library makes it, without the library."""
    from experiments.fmu.slave import PlatformSlave

    resources = fmpy.extract(file, folder / "plain")
    slave = PlatformSlave(instance_name="plain", resources=f"{resources}/resources")
    by_name = {variable.name: variable for variable in slave.vars.values()}
    for name, value in values.items():
        by_name[name].setter(value)
    return slave


def test_a_step_that_cannot_be_is_an_error_and_the_instance_lives(instance):
    one = instance(torque=0.22)
    one.go(2)
    for values, said in (({"torque": float("nan")}, "torque"), ({"brake": -1.0}, "brake")):
        one.set(**values)
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.fmu.doStep(one.time, STEP)
        assert said in one.said[-1]
        one.set(torque=0.22, brake=0.0)
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.fmu.doStep(one.time + 1.0, STEP)
    assert np.array_equal(one.go(3), instance(torque=0.22).go(5)[2:])


def test_a_parameter_is_fixed_after_the_first_step(fmu, tmp_path):
    slave = slave_of(fmu, tmp_path, surface="sand")
    slave.do_step(0.0, STEP)
    setter = next(variable.setter for variable in slave.vars.values() if variable.name == "mu_s")
    with pytest.raises(ValueError, match="mu_s"):
        setter(0.3)


def test_a_platform_with_other_rows_needs_another_fmu(fmu, tmp_path):
    with pytest.raises(ValueError, match=r"4 rows.*8"):
        slave_of(fmu, tmp_path, platform="cubli").exit_initialization_mode()


def test_parameters_that_are_changed_win_over_those_of_the_file(tmp_path):
    given = FmuSettings(surface="sand", stiffness=200.0, gravity=1e-3)
    file = build_fmu(tmp_path / "own.fmu", given)
    slave = slave_of(file, tmp_path, rig=0.015, gravity=-1.0, damping=5.0)
    trial = slave.run.trial
    assert trial.stiffness == 200 and trial.damping == 5 and trial.mu_s == 0.6
    assert trial.gravity_sim == pytest.approx(0.015 * 9.80665) and trial.counterweight > 0


def test_a_law_and_a_platform_in_files_travel_with_the_fmu(tmp_path, instance):
    ranges = {"load": (0, 50), "depth": (0, 0.1), "speed": (0, 5), "gravity": (0, 10), "diameter": (0.01, 0.012)}
    values = {"stiffness": 2.1e5, "dissipation": 0.2, "exponent": 1.5}
    fitted = GroundFile(
        format="hedgebed-ground/1", law="hunt-crossley", material="sand", source="a test", range=ranges,
        foot={"tip": "sphere", "diameter": 0.012},
        parameters={name: {"value": value, "std": 0.1} for name, value in values.items()},
    )  # fmt: skip
    law = fitted.write(tmp_path / "ground.toml")
    file = build_fmu(tmp_path / "own.fmu", FmuSettings(ground=str(law), gravity=0.1))
    trial = of_tumble(ground=str(law), gravity=0.1, torque=0.22)
    law.unlink()
    found = instance(file, torque=0.22)
    rows = found.go(100)
    exact = simulate(trial, duration=0.1, sample_interval=STEP)
    assert np.abs(rows[:, 2] - exact.theta[1:]).max() < 1e-4 * np.abs(exact.theta).max()


def test_without_pythonfmu3_the_command_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, "experiments.fmu.slave", raising=False)
    monkeypatch.delattr("experiments.fmu.slave", raising=False)
    monkeypatch.setitem(sys.modules, "pythonfmu3", None)
    assert main(["fmu", str(tmp_path / "new.fmu")]) == 2
    assert "hedgebed[fmi]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["two words.fmu"], ".fmu"),
        (["platform.zip"], ".fmu"),
        (["nowhere/platform.fmu"], "nowhere"),
        (["there.fmu"], "exists"),
        (["new.fmu", "--gravity", "1", "--rig", "0.01"], "rig"),
        (["new.fmu", "--ground", "bekkr"], "bekker"),
        (["new.fmu", "--x-start", "nan"], "--x-start"),
        (["new.fmu", "--ground", "power", "--stiffness", "3"], "ground_parameters"),
        (["new.fmu", "--surface", "snad"], "sand"),
        (["new.fmu", "--longest-step", "1e-3", "--stiffness", "1e9"], "longest_step"),
    ],
)
def test_what_cannot_be_made_is_refused_by_name(tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.fmu").write_bytes(b"")
    assert main(["fmu", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "new.fmu").exists()


def test_the_command_writes_the_file_that_it_names(tmp_path, capsys):
    file = tmp_path / "of_sand.fmu"
    assert main(["fmu", str(file), "--surface", "sand", "--gravity", "1e-3g"]) == 0
    assert str(file) in capsys.readouterr().out
    start = {variable.name: variable.start for variable in fmpy.read_model_description(file).modelVariables}
    assert start["surface"] == "sand" and float(start["gravity"]) == pytest.approx(9.80665e-3)
    assert [path.name for path in tmp_path.iterdir()] == [file.name]  # no scratch is left


def test_the_parameters_of_an_fmu_on_a_ground_file_are_those_of_the_file(tmp_path):
    """Not -1 and brick: K and C under a row of two spikes, and the surface that friction is of."""
    fitted = GroundFile(
        format="hedgebed-ground/1", law="spring-damper", material="sand", source="a test",
        foot={"tip": "sphere", "diameter": 0.012},
        parameters={"stiffness": {"value": 70.0, "std": 0.0}, "damping": {"value": 0.5, "std": 0.0}},
        range=dict.fromkeys(("load", "depth", "speed", "gravity", "diameter"), (0.0, 100.0)),
    )  # fmt: skip
    file = build_fmu(tmp_path / "own.fmu", FmuSettings(ground=str(fitted.write(tmp_path / "ground.toml"))))
    with zipfile.ZipFile(file) as packed:
        told = ElementTree.fromstring(packed.read("modelDescription.xml"))
    found = {each.get("name"): each for each in told.iter()}
    assert float(found["stiffness"].get("start")) == 140.0 and float(found["damping"].get("start")) == 1.0
    assert found["surface"].find("Start").get("value") == "sand"


def test_the_script_of_the_page_prints_the_angle_that_it_states(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "fmu.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^hedgebed (fmu .*)$", text, re.MULTILINE)
    (script,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert main(command.split()) == 0
    capsys.readouterr()
    exec(script, {})
    stated = float(re.search(r"# ([\d.]+) rad", script)[1])
    assert float(capsys.readouterr().out.split()[-1]) == pytest.approx(stated, abs=5e-4)
