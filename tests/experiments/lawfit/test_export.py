"""law.py and law.json: the law of a calibration in a process that has no hedgebed on its path."""

import importlib
import json
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from experiments.lawfit.dimensionless import CROSSED, CrossedLaw, cross, tangent_at
from experiments.lawfit.export import export_cell, export_crossed
from experiments.lawfit.fit import fit_law, interval
from experiments.lawfit.laws import CANDIDATES
from experiments.lawfit.synthetic import DESIGNS, FOUNDATION, TRUTHS, scaled_cells, synthetic_data

SHAPES = ("sphere", "flat")


def alone(folder, expression):
    """The value of `expression` in a process with the standard library alone; `law` is the module."""
    program = f"""import json, sys, warnings
warnings.simplefilter("error")
sys.path.insert(0, {str(folder)!r})
import law
assert not any(name.split(".")[0] in ("numpy", "experiments", "rigid", "hedgebed") for name in sys.modules)
print(json.dumps({expression}))"""
    done = subprocess.run([sys.executable, "-I", "-S", "-c", program], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    "name", ["spring-damper", "hunt-crossley", "power-irreversible", "katsuragi-durian", "bekker", "rft"]
)
def test_the_exported_law_has_the_force_of_the_fit_and_its_interval_without_hedgebed(name, tmp_path):
    data = synthetic_data("power-irreversible", TRUTHS["power-irreversible"], DESIGNS["three beds, two speeds"], seed=3)
    fitted = fit_law(CANDIDATES[name](FOUNDATION), data)
    export_cell(fitted, [], tmp_path)
    places = [(0.001, 0.1), (0.004, 0.4), (0.011, 0.25)]
    forces, ends = alone(tmp_path, f"[[law.force(z, v) for z, v in {places}], law.force_interval(0.004, 0.4)]")
    z, v = np.array(places).T
    np.testing.assert_allclose(forces, fitted.candidate.force(fitted.theta, z, v), rtol=1e-12)
    all_of_them = [fitted.candidate.force(theta, z[1:2], v[1:2])[0] for theta in (fitted.theta, *fitted.left_out)]
    expected = interval(all_of_them[0], np.array(all_of_them[1:]))
    assert ends == pytest.approx([expected.low, expected.high], rel=1e-5)
    kept = json.loads((tmp_path / "law.json").read_text())
    assert (kept["law"], kept["parameters"]) == (name, fitted.candidate.values(fitted.theta))


def test_k_and_c_of_the_exported_spring_damper_are_the_pair_with_its_intervals(tmp_path):
    data = synthetic_data("spring-damper", TRUTHS["spring-damper"], DESIGNS["three beds, two speeds"], seed=3)
    fitted = fit_law(CANDIDATES["spring-damper"](FOUNDATION), data)
    export_cell(fitted, [], tmp_path)
    (k, c, depth), ends = alone(tmp_path, "[law.tangent(0.3, 0.2), law.tangent_intervals(0.3, 0.2)]")
    pair = [fitted.parameter(name) for name in ("stiffness", "damping")]
    assert (k, c) == pytest.approx([one.value for one in pair], rel=1e-6)
    assert depth == pytest.approx((0.3 - c * 0.2) / k, rel=1e-6)
    for own, one in zip(ends, pair, strict=False):
        assert own == pytest.approx([one.low, one.high], rel=1e-4)


@pytest.mark.parametrize("name", CROSSED)
def test_the_exported_law_of_all_tips_and_gravities_has_the_force_and_tangent_of_the_fit(name, tmp_path):
    truth = CrossedLaw("power-early", SHAPES)
    cells = scaled_cells(truth, (6.0, 9.0, 1.3, 0.9, 3.0, 0.5))
    fitted = fit_law(CrossedLaw(name, SHAPES), cross(cells))
    export_crossed(fitted, [], cells, tmp_path)
    where = [(0.003, 0.1, "sphere", 0.012, 3.7), (0.009, 0.15, "flat", 0.016, 9.80665)]
    found = alone(tmp_path, f"""[
        [law.force(z, tip, d, g, v) for z, v, tip, d, g in {where}], law.tangent(0.01, "sphere", 0.012, 3.7, 0.05)
    ]""")  # fmt: skip
    # One density for all cells in the file; the made-up beds have the same.
    for (z, v, tip, d, g), force in zip(where, found[0], strict=True):
        of = replace(cells["sphere-9.81"].foundation, tip=tip, diameter=d, gravity=g)
        assert force == pytest.approx(fitted.candidate.force(fitted.theta, of, z, v), rel=1e-9)
    of = replace(cells["sphere-9.81"].foundation, gravity=3.7)
    own = tangent_at(fitted, of, 0.01, 0.05)
    assert found[1] == pytest.approx([own.stiffness.value, own.damping.value, own.depth.value], rel=1e-3)


def test_what_is_outside_the_runs_warns_and_what_no_depth_bears_is_refused(tmp_path):
    data = synthetic_data("spring-damper", TRUTHS["spring-damper"], DESIGNS["three beds, two speeds"], seed=3)
    export_cell(fit_law(CANDIDATES["spring-damper"](FOUNDATION), data), [], tmp_path)
    for call, named in (
        ("law.force(0.05, 0.1)", "depth = 0.05"), ("law.force(0.005)", "speed = 0"),
        ("law.force_interval(0.05, 0.1)", "depth = 0.05"), ("law.tangent(5.0, 0.1)", "load = 5"),
        ("law.tangent(1e9, 0.1)", "load = 1e\\+09"), ("law.tangent(0.01, 0.1)", "surface"),
        ("law.tangent_intervals(5.0, 0.1)", "load = 5"),
    ):  # fmt: skip
        with pytest.raises(AssertionError, match=named):
            alone(tmp_path, call)


def test_the_law_of_all_tips_warns_outside_depth_froude_number_and_load_of_the_same_tip(tmp_path, monkeypatch):
    law = CrossedLaw("power-square", SHAPES)
    cells = scaled_cells(law, (6.0, 9.0, 1.3, 0.9, 3.0))  # z / D to 0.86, Fr 0.2 to 0.8
    export_crossed(fit_law(law, cross(cells)), [], cells, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "law", raising=False)
    exported = importlib.import_module("law")
    monkeypatch.delitem(sys.modules, "law")

    def warned(call, *given):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            call(*given)
        return {str(one.message).split(" = ")[0] for one in caught}

    earth, low = ("sphere", 0.012, 9.80665), ("sphere", 0.012, 0.980665)
    assert warned(exported.force, 0.006, *earth, 0.15) == set()
    # 0.15 m/s is in the range under 1 g, and a Froude number of 1.4 under 0.1 g.
    assert warned(exported.force, 0.006, *low, 0.15) == {"froude"}
    assert warned(exported.force, 0.006, *earth) == {"froude"}  # at rest: slower than every run
    # 13 mm is less than the flat tip of 16 mm went, and more than this ball.
    assert warned(exported.force, 0.013, *earth, 0.15) == {"depth_over_diameter"}
    assert warned(exported.force_interval, 0.006, "sphere", 0.016, 9.80665, 0.15) == {"diameter"}
    assert {"load_over_rho_g_d3", "depth_over_diameter"} == warned(exported.tangent, 1.0, *earth, 0.15)
    assert "load_over_rho_g_d3" in warned(exported.tangent_intervals, 1.0, *earth, 0.15)
    with pytest.raises(ValueError, match="cone60"):
        exported.force(0.005, "cone60", 0.012, 9.80665, 0.15)
