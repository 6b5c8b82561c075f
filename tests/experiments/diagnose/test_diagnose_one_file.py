"""An effect is one file: one of a person's own is found where it is hidden, one in the package without another edit."""

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from penetration_campaigns import DAMPING, STIFFNESS, campaign_of, driven_trial, saved
from tumble_campaigns import CONDITIONS, campaign

import experiments
from experiments.campaign import read_model
from experiments.cli.main import main
from experiments.diagnose.fit.forms import load_own
from experiments.diagnose.push.law import push
from experiments.diagnose.push.slots import slot_places, slot_table
from experiments.diagnose.tumble.data import tumble_data
from experiments.diagnose.tumble.forms import physical, tumble_forms
from experiments.diagnose.tumble.forward import Forward

ROOT = Path(experiments.__file__).parents[1]
MUD = ROOT / "experiments" / "terms" / "sticky_mud.py"
FORCE, SPEED = 1.5, 0.03


def muddy(z, v, top=0.0):
    rate = max(v, 0.0)
    return STIFFNESS * z + DAMPING * rate + FORCE * (1 - math.exp(-rate / SPEED))


@pytest.mark.long
def test_an_effect_from_a_file_is_found_where_it_is_hidden_with_its_words_and_its_equation(tmp_path):
    trials = [
        (f"{k}", "driven", v, driven_trial(muddy, speed=v, seed=k)) for k, v in enumerate((0.01, 0.1, 0.03, 0.01))
    ]
    folder, out = saved(tmp_path / "campaign", campaign_of(trials)), tmp_path / "out"
    assert main(["diagnose", str(folder), "--effects-from", str(MUD), "--out", str(out), "--quiet"]) == 0
    said = json.loads((out / "diagnosis.json").read_text())
    assert said["verdict"] == "named" and [effect["id"] for effect in said["effects"]] == ["sticky-mud"]
    for name, true in (("mud_force", FORCE), ("mud_speed", SPEED)):
        entry = said["effects"][0]["parameters"][name]
        assert abs(entry["value"] - true) < 5 * entry["std"] + 0.02 * true
    (effect,) = read_model(out / "model.toml").effect
    assert (effect.id, effect.file) == ("sticky-mud", "sticky_mud.py")
    assert "mud_force * (1 - exp(-v / mud_speed))" in (out / "model.toml").read_text()
    assert said["equations"][0]["units"] == {"mud_force": "N", "mud_speed": "m/s"}
    assert "level off" in json.dumps(said)


def test_its_law_of_pushes_is_compiled_into_ours():
    own = (load_own(MUD),)
    table, places = slot_table(1, own), slot_places(own)
    assert table[0, places["mud_speed"]] == 0.03
    numbers = {"mass": 0.5, "stiffness": STIFFNESS, "damping": DAMPING, "mud_force": FORCE, "mud_speed": SPEED}
    for name, value in numbers.items():
        table[0, places[name]] = value
    depth = np.concatenate([np.linspace(1e-4, 0.02, 40), np.linspace(0.02, 1e-4, 40)])
    rate = np.concatenate([np.full(40, 0.05), np.full(40, -0.05)])
    found = push(table, np.zeros(1, dtype=np.int32), np.array([0, 80], dtype=np.int32), depth, rate, own)[0]
    assert found == pytest.approx([muddy(z, v) for z, v in zip(depth, rate, strict=True)], abs=1e-12)


def test_it_is_a_candidate_of_tumbles_too():
    form = tumble_forms(rig=True, sinkage=1e-3, weight=1.0, lift_speed=0.01, own=(load_own(MUD),))[-1]
    assert form.id == "sticky-mud:bounded" and form.starts[0] == {
        "sticky-mud.force": pytest.approx(0.06), "sticky-mud.log_speed": 0.0
    }  # fmt: skip
    columns = physical(form, {"sticky-mud.force": np.array([0.2]), "sticky-mud.log_speed": np.array([1.0])})
    assert columns["sticky-mud.speed"] == pytest.approx(0.01 * math.e)


_ASKED = """
from experiments.cli.main import main
from experiments.diagnose.core.effect_texts import PENETRATION
from experiments.diagnose.core.effect_texts import meaning
from experiments.diagnose.push.law import SLOTS
from experiments.diagnose.tumble.data import tumble_data
from experiments.diagnose.tumble.forms import tumble_forms
from experiments.diagnose.tumble.forward import Forward
from rigid import Effect, Trial, simulate

assert main(["effects", "sticky-mud"]) == 0
print(meaning("sticky-mud"), "mud_speed" in SLOTS, "sticky-mud:bounded" in PENETRATION)
print([form.id for form in tumble_forms(rig=False, sinkage=1e-3, weight=1.0)][-1])
hops = [simulate(Trial(gravity_sim=0.1, torque=0.2, effects=effects), duration=0.2).y[-1]
        for effects in ((), (Effect(id="sticky-mud", parameters={"force": 0.5}),))]
print(hops[0] != hops[1])
"""


def test_a_file_put_into_the_package_is_an_effect_of_the_library(tmp_path):
    shutil.copytree(ROOT / "rigid", tmp_path / "rigid", ignore=shutil.ignore_patterns("__pycache__"))
    text = MUD.read_text().replace("from rigid.terms import", "from rigid.terms.term import")
    (tmp_path / "rigid" / "terms" / "contact" / "sticky_mud.py").write_text(text)
    asked = subprocess.run(
        [sys.executable, "-c", _ASKED], cwd=tmp_path, env={**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert asked.returncode == 0, asked.stderr
    assert "--effects sticky-mud.force=" in asked.stdout
    *_, words, last, moved = asked.stdout.strip().splitlines()
    assert words == "sticky-mud: mud resists a spike that goes in, up to a bound. True True"
    assert (last, moved) == ("sticky-mud:bounded", "True")


_LATE = """
from rigid.terms.candidate import Candidate, Form, Tumble, free
from rigid.terms.term import Parameter, Term


def earlier(written, delay):
    return written - delay


TERM = Term(
    id="imu-delay", summary="the IMU is late", acts="the IMU's times", source="a test", limits="none", sensor=True,
    parameters=(Parameter("delay", "s", 0.0, summary="by which it is late"),), hooks={"clock": earlier},
)
CANDIDATE = Candidate(
    meaning="the IMU is late", confirm="knock on the platform",
    tumble=Tumble(forms=lambda t: (Form("constant", (free("delay", "s", 1e-3, -0.5, 0.5),), ((3e-3,),)),),
                  equation="the IMU's time = t + delay"),
)
"""

_RECORDED = """
import numpy as np
from experiments.diagnose.tumble.forms import tumble_forms
from experiments.tumble.synthesis import record
from rigid import Effect, Trial
from rigid.sensors import SensorSet

late, same = (
    record(Trial(gravity_sim=0.1, torque=0.2, effects=(effect,)), duration=0.2, sensors=SensorSet(), seed=1)[0].imu
    for effect in (Effect(id="imu-delay", parameters={"delay": 0.01}),
                   Effect(id="clock-offset", parameters={"offset": 0.01}))
)
rows = np.isin(late["t_s"], same["t_s"])
print(all(np.allclose(late[name][rows], same[name], atol=0.2) for name in late), abs(late["gyro_rad_s"]).max() > 0)
print("imu-delay:constant" in [form.id for form in tumble_forms(rig=False, sinkage=1e-3, weight=1.0)])
"""


def test_a_sensors_effect_from_a_file_reads_as_its_hook_says(tmp_path):
    (tmp_path / "imu_delay.py").write_text(_LATE)
    data = tumble_data(campaign(seed=1, conditions=CONDITIONS[:1]))
    own = Forward(data, own=[load_own(tmp_path / "imu_delay.py")])
    found = own.predict({"imu-delay.delay": np.array([0.01, 0.0])})[0].value
    known = Forward(data).predict({"clock-offset.offset": np.array([0.01, 0.0])})[0].value
    assert np.array_equal(found, known) and not np.array_equal(found[0], found[1])


def test_a_sensors_file_put_into_the_package_is_recorded_and_a_candidate_without_another_edit(tmp_path):
    shutil.copytree(ROOT / "rigid", tmp_path / "rigid", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "rigid" / "terms" / "sensor" / "imu_delay.py").write_text(_LATE)
    asked = subprocess.run(
        [sys.executable, "-c", _RECORDED], cwd=tmp_path, env={**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert asked.returncode == 0, asked.stderr
    assert asked.stdout.split() == ["True", "True", "True"]
