"""`hedgebed hop`: the wheel speed for a distance, what is said of escape, what is refused."""

import json
import math
import re

import pytest

from experiments.cli import BAD_INPUT, DONE, main
from rigid.hop import Tumbler, brake_launch, flight
from rigid.platform_files import PLATFORM_FOLDER, find_platform


def hop(tmp_path, capsys, *options, name="run"):
    status = main(["hop", *options, "--json", "--quiet", "--out", str(tmp_path / name)])
    said = capsys.readouterr()
    return status, json.loads(said.out) if status == DONE else said.err


def test_the_wheel_speed_takes_the_hedgehog_the_distance(tmp_path, capsys):
    """The wheel it names, put through launch and flight by hand, goes 5 m."""
    status, result = hop(tmp_path, capsys, "--gravity", "1e-3", "--distance", "5", "--body-radius", "300")
    assert status == DONE
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    platform = find_platform("hedgehog")
    stance = platform.stance()
    tumbler = Tumbler(
        mass=5.3, inertia=0.06, spike_length=stance.spike_length, lean=math.pi / 8, gravity=1e-3, mu_s=0.5, mu_d=0.25
    )
    left = brake_launch(tumbler, 1.2e-3 * value["wheel_speed"], 6.0)
    assert flight(left.speed, left.angle, gravity=1e-3, radius=300.0).distance == pytest.approx(5.0, rel=1e-6)
    assert value["distance"] == pytest.approx(5.0, rel=1e-6)
    assert math.degrees(value["launch_angle"]) == pytest.approx(76.0, abs=0.1)  # tan = 1 / mu_d
    assert value["wheel_speed"] == pytest.approx(value["wheel_speed_impulsive"], rel=0.05)
    assert value["escape_speed"] == pytest.approx(math.sqrt(2 * 1e-3 * 300))
    assert value["escape_ratio"] == pytest.approx(value["launch_speed"] / value["escape_speed"])
    assert not any("escape" in warning for warning in result["warnings"])
    assert json.loads((tmp_path / "run" / "result.json").read_text()) == result


def test_without_a_radius_it_says_that_it_cannot_tell(tmp_path, capsys):
    _, result = hop(tmp_path, capsys, "--distance", "5")
    assert result["quantities"]["escape_speed"]["value"] is None
    assert any("cannot be told without body_radius" in warning for warning in result["warnings"])


def test_near_escape_it_says_so_with_the_share(tmp_path, capsys):
    _, result = hop(tmp_path, capsys, "--distance", "12", "--body-radius", "20")
    ratio = result["quantities"]["escape_ratio"]["value"]
    assert ratio > 0.5
    assert any(f"{100 * ratio:.3g} % of the escape speed" in warning for warning in result["warnings"])


def test_escape_is_near_from_half_its_speed_on(tmp_path, capsys):
    """On a flat enough body 5 m take the same launch: radii for which it is 0.49 and 0.51 of sqrt(2 g R)."""
    _, flat = hop(tmp_path, capsys, "--distance", "5", name="flat")
    speed = flat["quantities"]["launch_speed"]["value"]
    near = {}
    for share in (0.45, 0.55):
        radius = (speed / share) ** 2 / (2 * 1e-3)
        _, result = hop(tmp_path, capsys, "--distance", "5", "--body-radius", f"{radius:.6g}", name=f"{share:g}")
        ratio = result["quantities"]["escape_ratio"]["value"]
        near[ratio > 0.5] = any("escape is near" in warning for warning in result["warnings"])
        assert not any("cannot be told" in warning for warning in result["warnings"])
    assert near == {True: True, False: False}


def test_what_is_said_reads_well(tmp_path, capsys):
    """The words that a person sees, under a brake and under a motor."""
    _, brake = hop(tmp_path, capsys, "--distance", "5", name="a")
    _, motor = hop(tmp_path, capsys, "--distance", "0.5", "--actuator", "motor", name="b")
    first = [result["departures"]["sentences"][0] for result in (brake, motor)]
    assert re.fullmatch(
        r"Braking a wheel at \S+ rad/s \(\S+ rpm\) with 6 N m, the platform slides off at \S+ m/s, .*", first[0]
    )
    assert re.fullmatch(r"A motor at \S+ N m, whose wheel comes to \S+ rad/s \(\S+ rpm\), the platform .*", first[1])


def test_a_motor_is_asked_for_its_torque(tmp_path, capsys):
    status, result = hop(tmp_path, capsys, "--actuator", "motor", "--distance", "0.5")
    assert status == DONE
    value = {key: quantity["value"] for key, quantity in result["quantities"].items()}
    assert 0 < value["torque"] <= 0.22
    assert value["wheel_speed"] == pytest.approx(value["torque"] * value["torque_time"] / 1.2e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--distance", "5000"), "distance = 5000 m is too far"),
        (("--distance", "30", "--body-radius", "20"), "escapes"),
        (("--actuator", "motor", "--distance", "1"), "0.22 N m"),
        (("--torque", "7"), "at most 6 N m"),
        (("--torque", "1", "--actuator", "motor"), "torque = 1 N m"),
        (("--gravity", "9.81", "--torque", "1"), "does not tip"),
        (("--platform", "roomba"), "'roomba'"),
        (("--gravity", "-1"), "gravity"),
        (("--mu-s", "0.2", "--mu-d", "0.3"), "mu_d = 0.3"),
    ],
)
def test_a_hop_that_cannot_be_is_refused_before_there_is_a_folder(tmp_path, capsys, options, said):
    status, error = hop(tmp_path, capsys, *options)
    assert status == BAD_INPUT
    assert said in error
    assert not (tmp_path / "run").exists()


def test_a_platform_file_of_ones_own_will_do(tmp_path, capsys):
    shipped = (PLATFORM_FOLDER / "cubli.toml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.toml"
    mine.write_text(shipped.replace('"Cubli"', '"Mine"'), encoding="utf-8")
    status, result = hop(tmp_path, capsys, "--platform", str(mine), "--distance", "3")
    assert status == DONE
    assert result["title"].startswith("Mine")


def test_a_hop_is_resumed_to_the_same_numbers(tmp_path, capsys):
    _, result = hop(tmp_path, capsys, "--distance", "2")
    (tmp_path / "run" / "result.json").unlink()
    (tmp_path / "run" / "status.json").write_text('{"status": "stopped", "reason": ""}')
    assert main(["resume", str(tmp_path / "run"), "--json", "--quiet"]) == DONE
    assert json.loads(capsys.readouterr().out) == result
