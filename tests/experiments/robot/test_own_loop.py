"""The law of a run in MuJoCo's own loop: the robot goes the same way."""

import re

import numpy as np
import pytest
from import_graph import ROOT

from coupling.robot import FootForces, find_feet, load_model
from coupling.robot.models import switch_off_floors
from experiments.robot.on_grains import RobotFollowed
from experiments.robot.own_loop import law_of_run
from experiments.robot.plan import plan_robot
from experiments.robot.settings import RobotSettings

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

GRAVITY, DURATION = 3.0, 0.3
GIVEN = {
    "spring-damper": {}, "hunt-crossley": {"stiffness": 5e4, "dissipation": 0.4},
    "power": {"stiffness": 2e4, "damping": 9.0}, "power-irreversible": {}, "katsuragi-durian": {}, "rft": {},
    "bekker": {"cohesive_modulus": 300.0, "frictional_modulus": 5e5},
}  # fmt: skip


def in_own_loop(step, options):
    """Height of the leg's joint [m] over time in a loop of MuJoCo that starts as the run does."""
    model = load_model("hopper")
    model.opt.gravity[2], model.opt.timestep = -GRAVITY, step
    switch_off_floors(model)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    feet, found = find_feet(model, data, ["foot"]), []
    with FootForces(model, data, feet, **options(model)):
        for _ in range(round(DURATION / step)):
            mujoco.mj_step(model, data)
            found.append(data.qpos[0])
    return np.array(found)


@pytest.mark.parametrize("law", GIVEN)
def test_a_loop_of_ones_own_goes_the_way_of_the_command_up_to_an_error_of_first_order_in_the_step(law):
    """Heights agree within 0.05 mm at 0.2 ms; MuJoCo's steps are of first order, so half the step has half of that."""
    given = GIVEN[law]
    said = tuple(f"{name}={value}" for name, value in given.items())
    options = {"ground": law, "ground_parameters": said}
    settings = RobotSettings(model="hopper", feet=("foot",), gravity=GRAVITY, duration=DURATION, substeps=5, **options)
    run = RobotFollowed(settings, plan_robot(settings)).run_on_law()
    rows, heights = run.run(), run.joints["qpos"][:, 0]
    off = []
    for step in (2e-4, 1e-4):
        own = in_own_loop(step, lambda model: law_of_run(model, ["foot"], **options).law)
        off.append(np.abs(own - np.interp(step * np.arange(1, len(own) + 1), rows["time"], heights)).max())
    assert rows["sinkage"].max() > 3e-3
    assert off[0] < 5e-5 and off[1] < 0.7 * off[0]
    if law != "spring-damper":  # which has no default for a foot
        assert (in_own_loop(1e-4, lambda model: {"law": law, "parameters": given}) == own).all()


@pytest.mark.parametrize("law", ["spring-damper", "hunt-crossley", "power"])
def test_a_law_of_brick_has_no_default_for_a_foot_in_an_own_loop(law):
    with pytest.raises(ValueError, match=f"law = '{law}': stiffness and"):
        in_own_loop(1e-4, lambda model: {"law": law})


def test_moduli_of_bekker_are_refused_in_another_gravity_unless_given():
    known = {"model": "hopper", "feet": ("foot",), "ground": "bekker"}
    with pytest.raises(ValueError, match=r"gravity = 0\.1 m/s2: .*cohesive_modulus and frictional_modulus"):
        plan_robot(RobotSettings(**known, gravity=0.1))
    assert plan_robot(RobotSettings(**known, gravity=9.7))
    moduli = ("cohesive_modulus=0", "frictional_modulus=15000")
    assert plan_robot(RobotSettings(**known, gravity=0.1, ground_parameters=moduli))


def test_the_spring_of_katsuragi_and_durian_is_as_gravity_and_its_drag_is_not():
    """k D / (m g) and d_1 / D do not depend on g (Physical Review E 87, 052208)."""
    known = {"model": "hopper", "feet": ("foot",), "ground": "katsuragi-durian"}
    low, high = (plan_robot(RobotSettings(**known, gravity=gravity)).numbers for gravity in (0.02, 5.0))
    assert high["stiffness"].value == pytest.approx(250 * low["stiffness"].value)
    assert high["drag"].value == low["drag"].value
    with pytest.raises(ValueError, match="gravity = 0 m/s2"):
        plan_robot(RobotSettings(**known, gravity=0.0))


def test_a_loop_of_ones_own_takes_no_grains():
    with pytest.raises(ValueError, match="made of grains"):
        law_of_run(load_model("hopper"), ["foot"], ground="bed")


def test_the_notes_begin_with_the_warnings_name_a_floor_that_is_on_and_have_numbers_that_are_given_too():
    model = load_model("hopper")
    on = law_of_run(model, ["foot"], surface="sand", ground_parameters={"inertia": 2}).notes
    switch_off_floors(model)
    off = law_of_run(model, ["foot"], surface="sand").notes
    assert on[0].startswith("warning") and "contype" in on[0] and not any("contype" in said for said in off)
    (given,) = [said for said in on if said.startswith("inertia = 2 ")]
    assert "given" in given and not any("warning" in said for said in on[1:])
    assert any(said.startswith("inertia = 1.1 ") for said in off)


def test_the_loop_on_grains_of_the_page_runs_as_it_is_printed_and_its_controller_works(monkeypatch, tmp_path):
    """The bed is three layers of grains, and the run shorter: the rest is what docs/mujoco.md prints."""
    from spatial_runs import grain_bed

    from dem import Bed

    page = (ROOT / "docs" / "mujoco.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"### On grains in Python\n```python\n(.*?)```", page, re.DOTALL)
    made = []
    monkeypatch.setattr(Bed, "prepare", lambda *_, **options: made.append(options) or grain_bed())
    monkeypatch.chdir(tmp_path)
    code = code.replace("duration=0.4", "duration=0.06").replace("0.25 < run", "0.05 < run")
    code = code.replace("(0.1, 0.1)", "(0.048, 0.048)")
    found = {}
    exec(code, found)
    run = found["run"]
    assert made[0]["grain"] == 0.012 and run.done and np.any(run.columns["actuator_work"])
    assert (run.foot("foot")["force"] == run.feet_now[0, 7:10]).all()
    assert run.foot("foot")["depth"] == run.feet_now[0, 13]
    with pytest.raises(ValueError, match="robot has"):
        run.foot("toe")
    with pytest.raises(ValueError, match="grains in Python"):
        law_of_run(load_model("hopper"), ["foot"], ground="bed")
