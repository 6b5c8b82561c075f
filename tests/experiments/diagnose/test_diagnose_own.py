"""Effects of one's own among the candidates of diagnose: a Python file with an equation and a name."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import slow_drive
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, saved

from experiments.campaign import read_model
from experiments.cli.main import main
from experiments.diagnose.fit.forms import load_own, own_starts, parameters_of
from experiments.diagnose.push.law import fall, push
from experiments.diagnose.push.problem import make_problem
from experiments.diagnose.push.slots import SLOTS, slot_table

GUIDE = Path(slow_drive.__file__).parents[1] / "docs" / "diagnose.md"
SLOW = Path(slow_drive.__file__)
FORCE, SPEED = 1.5, 0.03


@pytest.fixture
def mud(tmp_path):
    """The example of the guide, as a file."""
    (text,) = [part for part in re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.S) if "TERM = Term(" in part]
    file = tmp_path / "mud.py"
    file.write_text(text)
    return file


def muddy(z, v, top=0.0):
    rate = max(v, 0.0)
    return STIFFNESS * z + DAMPING * rate + FORCE * (1 - math.exp(-rate / SPEED))


def test_an_effect_from_a_file_acts_on_a_spike_as_its_equation_says(mud):
    own = (load_own(mud),)
    table = slot_table(1, own)
    for name, value in {"mass": 0.5, "gravity": 9.81, "stiffness": STIFFNESS, "damping": DAMPING}.items():
        table[0, SLOTS.index(name)] = value
    table[0, len(SLOTS) :] = (FORCE, SPEED)
    depth = np.concatenate([np.linspace(1e-4, 0.02, 40), np.linspace(0.02, 1e-4, 40)])
    rate = np.concatenate([np.full(40, 0.05), np.full(40, -0.05)])
    starts = np.array([0, 80], dtype=np.int32)
    found = push(table, np.zeros(1, dtype=np.int32), starts, depth, rate, own)[0]
    assert found == pytest.approx([muddy(z, v) for z, v in zip(depth, rate, strict=True)], abs=1e-12)
    # A drop obeys m z'' = m g - F; the accelerations are those of the force at the motion found.
    time = np.arange(0.001, 0.06, 0.002)
    motion = fall(table, np.zeros(1, dtype=np.int32), np.array([0, len(time)], dtype=np.int32), time,
                  np.array([0.5]), own)[0]  # fmt: skip
    going = (motion[:, 0] > 0) & (motion[:, 1] > 0)
    expected = [9.81 - muddy(z, v) / 0.5 for z, v in motion[going, :2]]
    assert going.sum() > 10 and motion[going, 2] == pytest.approx(expected, abs=1e-9)


def test_the_command_names_an_effect_from_a_file_and_the_model_brings_the_file_along(mud, tmp_path):
    trials = [
        (f"{k}", "driven", v, driven_trial(muddy, speed=v, seed=k)) for k, v in enumerate((0.01, 0.1, 0.03, 0.01))
    ]
    folder = saved(tmp_path / "campaign", campaign_of(trials))
    out = tmp_path / "out"
    assert main(["diagnose", str(folder), "--effect-file", str(mud), "--out", str(out), "--quiet"]) == 0
    said = json.loads((out / "diagnosis.json").read_text())
    assert said["verdict"] == "named" and [effect["id"] for effect in said["effects"]] == ["mud"]
    for name, true in (("force", FORCE), ("speed", SPEED)):
        entry = said["effects"][0]["parameters"][name]
        assert abs(entry["value"] - true) < 5 * entry["std"] + 0.02 * true
    (effect,) = read_model(out / "model.toml").effect
    assert (effect.id, effect.file) == ("mud", "mud.py")
    assert load_own(out / effect.file).id == "mud"


def test_amplitudes_are_counted_from_what_changes_nothing():
    own = load_own(SLOW)
    (rise,) = parameters_of(own.id, own.form.numbers)
    assert rise.value == 0.0 and own.neutral("rise") == 1e-4
    assert rise.lowest == 0.0
    assert [start["slow-drive.rise"] for start in own_starts(own, (rise,))] == [0.0125, 0.05, 0.2]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("FIT =", "OTHER ="), "FIT = {name: {'typical': number}} of force, speed was expected, found none"),
        (('"typical": 0.03', '"typical": 0.0'), r"FIT\['speed'\]"),
        (('id="mud"', 'id="layering"'), "'layering' is taken"),
        (('"rate_force": drag', '"side_force": drag'), "hook 'side_force' has no meaning"),
    ],
)
def test_a_file_that_cannot_be_fitted_is_refused_by_name(mud, tmp_path, change, words):
    file = tmp_path / "effect.py"
    text = mud.read_text().replace(*change)
    if "side_force" in change[1]:
        text = text.replace("rate, force", "slip, force").replace("max(rate", "max(slip")
    file.write_text(text)
    campaign = campaign_of([("d", "driven", 0.01, driven_trial(muddy, speed=0.01))])
    with pytest.raises(ValueError, match=words) as raised:
        make_problem(campaign, own=[load_own(file)])
    assert "effect.py" in str(raised.value)


def test_a_hook_that_calls_a_function_of_its_file_is_refused_instead_of_coming_out_as_nothing(mud, tmp_path):
    file = tmp_path / "helped.py"
    text = mud.read_text().replace("TERM = Term(", "def grow(rate):\n    return rate\n\n\nTERM = Term(")
    file.write_text(text.replace("max(rate, 0.0)", "grow(rate)"))
    with pytest.raises(ValueError, match=r"helped.py.*hook 'rate_force' calls grow\(\) of the same file"):
        load_own(file)
