"""A brake by the time in which it stops the wheel: torque = J_w omega_w / t, in `hop`, `tumble` and platform files."""

import json

import pytest
from pydantic import ValidationError

from experiments.cli.main import DONE, main
from experiments.hop.numbers import plan_hop
from experiments.hop.search import find_hop
from experiments.hop.settings import HopSettings
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid.platform.files import PLATFORM_FOLDER, read_platform


def test_a_hop_by_a_brakes_time_has_the_torque_of_its_wheel_speed_on_both_grounds(tmp_path):
    assert main(["hop", "--brake-time", "0.05", "--distance", "5", "--quiet", "--out", str(tmp_path / "run")]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    value = {name: entry["value"] for name, entry in result["quantities"].items()}
    assert value["torque"] == pytest.approx(1.2e-3 * value["wheel_speed"] / 0.05)
    assert value["distance"] == pytest.approx(5.0, rel=1e-6)
    again = HopSettings(torque=1.2e-3 * value["model_wheel_speed"] / 0.05, wheel_speed_0=value["model_wheel_speed"])
    known = HopSettings(brake_time=0.05, wheel_speed_0=value["model_wheel_speed"])
    assert find_hop(again)[1].launch == find_hop(known)[1].launch
    assert "torque" not in result["numbers"] and result["numbers"]["brake_time"]["origin"] == "given"


def test_a_platform_file_may_state_a_brakes_time(tmp_path):
    text = (PLATFORM_FOLDER / "hedgehog.toml").read_text()
    mine = tmp_path / "mine.toml"
    mine.write_text(text.replace("brake_torque = 6.0", "brake_time = 0.1"))
    wheel = read_platform(mine).wheel()
    assert wheel.brake_time == 0.1 and wheel.brake_torque == pytest.approx(1.2e-3 * 1050 / 0.1)
    plan = plan_hop(HopSettings(platform=str(mine)))
    assert plan.brake_time == 0.1 and plan.brake == "the brake"
    assert plan_hop(HopSettings(platform=str(mine), torque=2.0)).brake_time is None
    mine.write_text(text.replace("brake_torque = 6.0", "brake_torque = 6.0\nbrake_time = 0.1"))
    with pytest.raises(ValueError, match="leave one out"):
        read_platform(mine)


def test_a_tumble_takes_a_brakes_time_with_its_wheel_speed():
    plan = plan_tumble(TumbleSettings(actuator="brake", wheel_speed_0=100.0, brake_time=0.1))
    assert plan.trial.torque == pytest.approx(1.2) and "in 0.1 s" in plan.numbers["torque"].origin


@pytest.mark.parametrize("given", [{"torque": 1.0, "actuator": "brake"}, {"actuator": "motor"}])
def test_a_brakes_time_beside_a_torque_or_with_a_motor_is_refused(given):
    for settings in (HopSettings, TumbleSettings):
        with pytest.raises(ValidationError, match=r"brake_time = 0\.1 s"):
            settings(brake_time=0.1, **given)


def test_a_brakes_time_that_needs_more_than_the_brake_has_is_warned_of():
    warned = plan_hop(HopSettings(brake_time=0.01, wheel_speed_0=100.0)).warnings
    assert any("the brake of" in warning for warning in warned)
