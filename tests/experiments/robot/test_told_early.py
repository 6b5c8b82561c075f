"""What a run on grains states before a long wait: a controller that never pushes, depth, modulus, a lowered gravity."""

import pytest

from experiments.cli.main import main
from experiments.grains.staged import lowering_time
from experiments.robot.forms import MOST_INERTIA
from experiments.robot.on_grains import DEEPER, PACE, RobotFollowed, RobotOnBed, report_seconds
from experiments.robot.plan import plan_robot
from experiments.robot.result import conclude
from experiments.robot.settings import RobotSettings
from experiments.runs.pace import keep_pace
from experiments.runs.progress import Progress

pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'hedgebed[mujoco]'")

HOPPER = {"model": "hopper", "feet": ("foot",), "surface": "sand", "height": 0.012}
ON_BED = HOPPER | {"ground": "bed", "grain": 0.012, "bed_size": (0.24, 0.24, 0.2)}
CONTROL = "def control(model, data):\n    data.ctrl[:] = {force} * (data.time > 0.05)\n"


class Kept(Progress):
    """Keeps messages and shares."""

    def __init__(self):
        super().__init__()
        self.said, self.shares = [], []

    def message(self, text):
        self.said.append(text)

    def update(self, done):
        super().update(done)
        self.shares.append((self.stage_name, done))


def on_bed(**given):
    settings = RobotSettings(**ON_BED | given)
    return RobotOnBed(settings, plan_robot(settings))


@pytest.mark.parametrize(("force", "idle"), [(0.0, True), (30.0, False)])
def test_a_controller_that_never_pushes_is_warned_of_half_way_before_a_bed_and_first_of_all_at_the_end(
    tmp_path, force, idle
):
    (tmp_path / "own.py").write_text(CONTROL.format(force=force), encoding="utf-8")
    own = {"controller": f"{tmp_path / 'own.py'}:control", "duration": 0.15}
    settings = RobotSettings(**HOPPER | own)
    plan = plan_robot(settings)
    followed = RobotFollowed(settings, plan)
    run, said = followed.run_on_law(), []
    run.run(on_step=lambda run: said.append(followed.notice(run)))
    told = [one for one in said if one]
    assert len(told) == idle and all("no work" in one for one in told)
    assert not idle or said.index(told[0]) == pytest.approx(0.5 * len(said), abs=2)
    warnings = conclude(settings, plan, run, tmp_path).warnings
    assert any("no work" in one for one in warnings) == ("no work" in warnings[0]) == idle
    progress = Kept()
    on_bed(**own).announce(progress)
    assert any("work on rft" in one for one in progress.said) == idle


def test_a_robot_without_a_controller_is_not_said_to_be_idle(tmp_path):
    settings = RobotSettings(**HOPPER, duration=0.05)
    plan = plan_robot(settings)
    run = RobotFollowed(settings, plan).run_on_law()
    run.run()
    assert not any("no work" in one for one in conclude(settings, plan, run, tmp_path).warnings)


def test_a_bed_must_be_as_deep_as_the_law_nearest_to_grains_asks_for_and_not_as_the_spring_damper():
    """Depth on rft with inertia=10 times 1.3, and two widths of the foot of 60 mm below it."""
    bed = on_bed(duration=0.15)
    near = bed._answer_of(bed.plan.on_law("rft", MOST_INERTIA))["sinkage_largest"]
    least = DEEPER * near + 0.12
    assert 0 < DEEPER * near < 0.8 * bed.forecast.deepest
    on_bed(duration=0.15, bed_size=(0.24, 0.24, least + 1e-4)).check_bed()
    with pytest.raises(ValueError, match="rft with inertia=10"):
        on_bed(duration=0.15, bed_size=(0.24, 0.24, least - 1e-4)).check_extent()
    spring = on_bed(duration=0.15, stiffness=200.0, damping=1.0)
    assert spring.depth_expected[0] == spring.forecast.deepest


def test_the_modulus_is_stated_and_one_that_is_too_small_is_warned_of_with_the_overlap_to_expect():
    """Hertz: the overlap grows as young to the power -2/3."""
    chosen = on_bed(duration=0.05)
    young = chosen.softening().young
    (said,) = chosen._softness()
    assert f"young = {young:.3g} Pa" in said
    stated, warned = on_bed(duration=0.05, young=0.125 * young)._softness()
    assert f"young = {0.125 * young:.3g} Pa" in stated
    assert "20.0%" in warned and f"{young:.3g} Pa or more" in warned  # four times 5 %
    assert len(on_bed(duration=0.05, young=2 * young)._softness()) == 1


def test_the_work_and_the_plan_have_the_rest_in_a_lowered_gravity_and_the_pictures():
    same, lowered = on_bed(gravity=0.1), on_bed(gravity=0.1, settle_gravity=10.0)
    assert list(lowered.costs) == ["bed", "lower gravity", "robot"] and list(same.costs) == ["bed", "robot"]
    expected = lowering_time(10.0, 0.1, grain=0.012)
    assert lowered.costs["lower gravity"] == expected
    minutes = lowered.grain_count() * expected / lowered.time_step() / (60e6 * PACE)
    assert f"{minutes:.2g} min, and" in lowered._work() and "gravity" not in same._work()
    bare = on_bed(frame_count=0)
    assert "without pictures" in bare._work()
    assert report_seconds(bare.settings) < report_seconds(lowered.settings)


@pytest.mark.parametrize(("step", "told"), [(5e-4, True), (1e-4, False)])
def test_steps_of_mujoco_that_are_shorter_than_those_of_the_model_are_stated_in_a_line(tmp_path, capsys, step, told):
    (tmp_path / "ball.xml").write_text(
        f"""<mujoco><option timestep="{step}"/><worldbody><body pos="0 0 0.03"><joint type="slide" axis="0 0 1"/>
        <geom name="foot" size="0.03" mass="1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    given = ["--feet", "foot", "--duration", "0.004", "--frame-count", "0", "--out", str(tmp_path / "run")]
    assert main(["mujoco", str(tmp_path / "ball.xml"), *given]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "shorter than the" in line]
    assert len(lines) == told and all("0.4 ms" in line and "0.5 ms" in line for line in lines)


def test_the_work_and_the_time_to_go_are_by_the_pace_of_this_machine_once_it_is_known(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.runs.pace._file", lambda: tmp_path / "pace.json")
    before = on_bed(threads=2)
    assert before.seconds_per_second is None and "of one core" in before._work()
    keep_pace("cpu-2", grains=before.grain_count(), rate=6e6)
    known = on_bed(threads=2)
    assert known.seconds_per_second == pytest.approx(known.grain_count() / known.time_step() / 6e6)
    assert all(part in known._work() for part in ("at 6 million", "measured on"))
    assert on_bed(threads=4).pace is None


@pytest.mark.parametrize(("width", "warned"), [(0.03, True), (0.06, False)])
def test_spikes_of_few_grains_under_a_wide_foot_are_warned_of(width, warned):
    """The foot is 60 mm wide and passes; what of it goes into the ground is 2.5 grains of 12 mm wide."""
    run = on_bed()
    run.__dict__["_standing"] = [(width, 1e-3)]
    assert any("2.5 grains" in warning for warning in run.told.warnings) == warned
