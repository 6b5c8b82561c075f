"""Ground files: a fitted law that one can take away, with its uncertainties and its range."""

import math

import numpy as np
import pytest

from coupling import Drive
from rigid import GROUNDS, Spike
from rigid.ground_file import Estimate, GroundFile, read_ground

RANGE = {"load": (0, 0.9), "depth": (0, 0.012), "speed": (0, 0.4), "gravity": (9.8, 9.8), "diameter": (0.012, 0.012)}


def ground_file(law="spring-damper", **parameters):
    values = GROUNDS[law].values(parameters)
    return GroundFile(
        format="hedgebed-ground/1", law=law, material="sand", source="a test", runs=("a", "b"),
        foot={"tip": "sphere", "diameter": 0.012}, range=RANGE,
        parameters={
            name: Estimate(value=value, std=0.1 * value, interval=(0.8 * value, 1.2 * value), note="fitted")
            for name, value in values.items()
        },
    )  # fmt: skip


@pytest.mark.parametrize("law", GROUNDS)
def test_a_file_reads_back_as_it_was_written(law, tmp_path):
    fitted = ground_file(law)
    assert read_ground(fitted.write(tmp_path / "ground.toml")) == fitted


def test_a_script_drives_a_spike_into_the_law_of_a_file(tmp_path):
    fitted = read_ground(ground_file(stiffness=62.0, damping=0.5).write(tmp_path / "ground.toml"))
    run = Drive(Spike(diameter=0.012), fitted.ground(mu_s=0.6), speed=0.1, depth=0.01).run()
    rows = run.loading & (run.depth > 1e-4)
    # The force of the spring-damper, eqs 5 and 6 of Reid et al. (i-SAIRAS 2014): K z + C dz/dt.
    np.testing.assert_allclose(run.force[rows], 62.0 * run.depth[rows] + 0.5 * run.velocity[rows], rtol=1e-9)


def test_each_number_outside_the_range_is_named_and_none_inside():
    fitted = ground_file()
    assert fitted.beyond(load=0.9, depth=0.012, speed=0.0, gravity=9.8, diameter=0.012) == []
    said = fitted.beyond(load=0.91, depth=0.02, speed=0.1, gravity=1e-3)
    assert [text.split(" ")[0] for text in said] == ["load", "depth", "gravity"]
    with pytest.raises(ValueError, match="weight"):
        fitted.beyond(weight=1.0)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('law = "spring-damper"', 'law = "jelly"', "jelly"),
        ("[parameters.damping]", "[parameters.dampening]", "parameters.damping is missing"),
        ("std = 6.2", "std = -1.0", "parameters.stiffness.std"),
        ("std = 6.2", "", "parameters.stiffness.std is missing"),
        ("value = 62.0", "value = -62.0", "interval"),
        ("depth = [0.0, 0.012]", "depth = [0.02, 0.012]", "range.depth"),
        ("depth = [0.0, 0.012]", "width = [0.0, 0.012]", "range.depth is missing"),
        ("diameter = 0.012", "diameter = nan", "foot.diameter"),
        ("[foot]", "colour = 1\n[foot]", "colour"),
        ('format = "hedgebed-ground/1"', 'format = "x"', "format"),
        ("[foot]", "[foot", "is not TOML"),
    ],
)
def test_a_fault_is_named_with_the_file_and_the_key(old, new, named, tmp_path):
    text = ground_file(stiffness=62.0, damping=0.5).to_toml()
    assert old in text
    path = tmp_path / "ground.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ValueError) as error:
        read_ground(path)
    assert named in str(error.value)
    assert str(path) in str(error.value)


def test_a_file_that_is_not_there_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"none\.toml: cannot be read"):
        read_ground(tmp_path / "none.toml")


def test_the_file_does_not_take_numbers_that_are_not_finite():
    for value in (math.nan, math.inf):
        with pytest.raises(ValueError, match="std"):
            Estimate(value=1.0, std=value)
