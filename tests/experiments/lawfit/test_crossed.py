"""Several tips and gravities: similar runs, laws without dimensions, further runs in each bed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from fake_bed import FakeBed

from experiments import lawfit
from experiments.lawfit.cells import cells_of
from experiments.lawfit.crossed import crossed_result, tangents_of
from experiments.lawfit.data import Data, PushRun
from experiments.lawfit.dimensionless import CrossedLaw, cross, tangent_at
from experiments.lawfit.fit import fit_law, interval
from experiments.lawfit.laws import CANDIDATES
from experiments.lawfit.synthetic import FOUNDATION, TRUTHS, scaled_cells, synthetic_data
from experiments.lawfit.trust import beyond
from experiments.penetrate import beds
from experiments.runs.progress import Progress
from rigid.ground_file import read_ground

STEP, UNLOAD = 5e-5, 5000.0
TWO = {
    "budget": 3600.0, "tips": ("ball:12mm", "flat:0.012"), "gravities": ("1g", "0.1g"), "bed_size": (0.06, 0.06, 0.04),
    "grain": 0.0024, "seeds": (1, 2), "most_beds": 2, "speeds": (0.2, 0.4), "drop_speeds": (), "load": 0.4,
    "depth": 0.01, "young": 2e7, "laws": ("spring-damper",),
}  # fmt: skip


def names(settings):
    return [cell.name for cell in cells_of(settings)]


def test_all_cells_have_one_froude_number_one_depth_over_diameter_and_one_load_over_rho_g_d3():
    settings = lawfit.Settings(
        **(TWO | {"tips": ("ball:12mm", "cone:15mm:90"), "loads": (0.8,), "drag_depths": (0.005,)})
    )
    cells = cells_of(settings)
    assert names(settings) == [
        "sphere-12mm-9.807ms2", "cone-15mm-90deg-9.807ms2", "sphere-12mm-0.9807ms2", "cone-15mm-90deg-0.9807ms2",
    ]  # fmt: skip
    for cell in cells:
        base = cell.base
        unit = math.sqrt(base.gravity * base.tip_diameter)
        assert base.speeds[1] / unit == pytest.approx(0.4 / math.sqrt(9.80665 * 0.012), rel=1e-5)
        assert base.depth / base.tip_diameter == pytest.approx(0.01 / 0.012, rel=1e-5)
        assert cell.drag_depths[0] / base.tip_diameter == pytest.approx(0.005 / 0.012, rel=1e-5)
        heavy = base.gravity * base.tip_diameter**3
        assert base.weight / heavy == pytest.approx(0.4 / (9.80665 * 0.012**3), rel=1e-5)
        assert cell.loads[0] / base.weight == pytest.approx(2.0, rel=1e-5)
        assert base.hold * base.speeds[0] / base.tip_diameter == pytest.approx(0.01 * 0.2 / 0.012, rel=1e-5)
    assert [cell.new_bed for cell in cells] == [True, False, True, False]


def test_the_modulus_is_one_for_the_tips_of_a_gravity_and_goes_with_gravity():
    cells = cells_of(lawfit.Settings(**(TWO | {"young": None})))
    young = [cell.base.young for cell in cells]
    assert young[0] == young[1] and young[2] == young[3]
    assert young[0] / young[2] == pytest.approx(10.0, rel=0.01)


@pytest.fixture
def made(monkeypatch):
    """Seeds and tips of the beds that were made, in order. Beds are as stiff as g, and those of flat tips differ."""
    found = []

    def prepare(settings, seed, young, progress):
        found.append((seed, settings.tip, round(settings.gravity, 3)))
        scatter = 0.2 if settings.tip == "flat" else 0.01
        hardness = 100.0 * settings.gravity / 9.80665 * (1 + scatter * (-1) ** seed)
        return FakeBed(size=settings.bed_size, time_step=STEP, seed=seed, hardness=hardness, unload=UNLOAD)

    monkeypatch.setattr(beds, "prepare_bed", prepare)
    monkeypatch.setattr(beds, "bed_step", lambda settings, young: STEP)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    return found


@pytest.mark.long
def test_beds_are_added_to_the_tip_and_gravity_whose_force_is_least_sure(made, tmp_path):
    result = lawfit.run(
        lawfit.Settings(**(TWO | {"gravities": (), "most_beds": 4, "tolerance": 1e-4})), tmp_path / "run"
    )
    cells, sure, count = [cell["name"] for cell in result["cells"]], {}, {}
    for number, step in enumerate(result["design"]):
        if number < 2:  # each begins with two beds
            assert (step["cell"], len(step["runs"])) == (cells[number], 2)
        else:
            going = {name: value for name, value in sure.items() if count[name] < 4}
            assert step["cell"] == max(going, key=going.get)
        sure[step["cell"]], count[step["cell"]] = step["sure"], count.get(step["cell"], 0) + len(step["runs"])
    assert result["design"][2]["cell"] == "flat-12mm-9.807ms2"  # the beds that differ most
    assert set(count.values()) == {4}
    assert {path.name for path in (tmp_path / "run" / "cells").iterdir()} == set(cells)
    assert (tmp_path / "run" / "cells" / "flat-12mm-9.807ms2" / "ground.toml").is_file()


@pytest.mark.long
def test_further_runs_are_made_in_each_bed_and_found_again(made, tmp_path):
    more = {"tips": (), "gravities": (), "tip_diameter": 0.012, "loads": (0.2, 0.6), "unload_depths": (0.005,)}
    settings = lawfit.Settings(
        **(TWO | more | {"laws": ("power-irreversible",), "drag_depths": (0.006,), "members": str(tmp_path / "kept")})
    )
    result = lawfit.run(settings, tmp_path / "a")
    pair = next(law for law in result["laws"] if law["name"] == "spring-damper")
    assert [one["load"] for one in pair["sinkage"]] == [0.2, 0.4, 0.6]
    for one in result["placements"]:
        hardness = 100.0 * (1 + 0.01 * (-1) ** int(one["bed"].split()[1]))
        assert one["depth"] == pytest.approx(one["load"] / hardness, rel=0.01)
    for one in result["unloadings"]:
        assert one["stiffness"] == pytest.approx(UNLOAD, rel=0.05)
        # Driven on by 0.05 D: from 5 mm to 5.6 mm in the mean 6 % more.
        assert one["again"] == pytest.approx(5.3 / (5 * 0.975), rel=0.02)
        # A spring K and an unloading spring U: work out over work in is K / U.
        assert one["returned"] == pytest.approx(100.0 / UNLOAD, rel=0.15)
    assert len(result["drags"]) == 2 and all(one["side"] == 0 for one in result["drags"])
    # The force falls to 0 over K / U = 0.02 of the depth; the file keeps what a step of 1 ms follows.
    kept = read_ground(tmp_path / "a" / "laws" / "power-irreversible.toml").parameters["rebound"]
    assert kept.value == 0.05 and "0.0" in kept.note
    made.clear()
    again = lawfit.run(settings, tmp_path / "b")
    assert made == [] and again["unloadings"] == result["unloadings"]


def test_what_cannot_be_crossed_is_refused_by_name():
    for given, named in (
        ({"tips": ("bal:12mm",)}, "bal:12mm"),
        ({"tips": ("ball:12mm:60",)}, "ball:12mm:60"),
        ({"tips": ("ball:12s",)}, "ball:12s"),
        ({"tips": ("ball:12mm", "sphere:0.012")}, "twice"),
        ({"tip": "flat"}, "tip"),
        ({"gravity": 1.0}, "gravity"),
        ({"drag_depths": (0.02,)}, "drag_depths"),
        ({"runs": ("a",), "budget": None}, "tips|speeds|grain"),
    ):
        with pytest.raises(ValueError, match=named):
            lawfit.Settings(**(TWO | given))
    with pytest.raises(ValueError, match="cone-40mm"):
        lawfit.check(lawfit.Settings(**(TWO | {"tips": ("ball:12mm", "cone:40mm")})))
    with pytest.raises(ValueError, match="loads has 50 N"):
        lawfit.check(lawfit.Settings(**(TWO | {"loads": (50.0,)})))
    with pytest.raises(ValueError, match="4 tips"):
        lawfit.check(lawfit.Settings(**(TWO | {"budget": 1.0})))


def test_the_first_of_a_list_may_be_given_beside_it_in_any_unit():
    plain = lawfit.Settings(**TWO)
    for given in ({"tip_diameter": "12mm", "gravity": "1g"}, {"tip_diameter": 0.012, "gravity": 9.80665}):
        assert lawfit.Settings(**(TWO | given)) == plain
    for given, named in (({"tip_diameter": "13mm"}, "tip_diameter = '13mm'"), ({"gravity": "2g"}, "gravity = '2g'")):
        with pytest.raises(ValueError, match=named):
            lawfit.Settings(**(TWO | given))


EARLY = CrossedLaw("power-early", ("sphere", "flat"))
TRUTH = np.array([6.0, 9.0, 1.3, 0.9, 3.0, 0.5])  # k and n of both shapes, b, T


def test_runs_of_a_law_without_dimensions_give_it_back_and_rank_it_first():
    found = crossed_result(scaled_cells(EARLY, TRUTH), Progress())
    assert found.laws[0]["name"] == "power-early"
    assert found.best.candidate.free == ("k_sphere", "k_flat", "n_sphere", "n_flat", "b", "T")
    np.testing.assert_allclose(found.best.theta, TRUTH, rtol=0.1)
    laws = {law["name"]: law for law in found.laws}
    assert laws["power-early"]["above_best"]["value"] == 0
    assert laws["power-square"]["above_best"]["low"] > 0  # inertia at every depth is clearly worse
    assert laws["one-pair"]["held_out"]["beds"] > 5 * laws["power-early"]["held_out"]["beds"]
    # A gravity that it was not fitted to is predicted as well as the beds are.
    assert laws["power-early"]["gravity_out"]["rms"] < 0.1 < laws["one-pair"]["gravity_out"]["rms"]
    assert laws["power-early"]["tip_out"] is None  # each shape has a strength of its own


def test_the_area_of_the_tip_predicts_a_shape_that_was_left_out():
    law = CrossedLaw("area-square", ("sphere", "flat"))
    found = crossed_result(scaled_cells(law, np.array([10.0, 0.6, 1.0])), Progress())
    out = next(one for one in found.laws if one["name"] == "area-square")
    assert out["tip_out"]["groups"] == ["sphere 0.012", "flat 0.016"] and out["tip_out"]["rms"] < 0.1


def test_local_k_and_c_are_the_derivatives_of_the_law_at_any_tip_and_gravity():
    cells = scaled_cells(EARLY, TRUTH, noise=0.0)
    fitted = fit_law(EARLY, cross(cells))
    of = replace(cells["sphere-9.81"].foundation, gravity=3.7, diameter=0.014)
    found = tangent_at(fitted, of, 0.3, 0.1)
    k, _, n, _, b, settles = fitted.theta
    unit, speed = of.bulk_density * of.gravity * of.diameter**3, math.sqrt(of.gravity * of.diameter)
    x, fr = found.depth.value / of.diameter, 0.1 / speed
    fading = math.exp(-x / (settles * fr))
    # F / (rho g D^3) = k x^n + b Fr^2 exp(-x / (T Fr)), differentiated by hand
    stiffness = unit / of.diameter * (k * n * x ** (n - 1) - b * fr / settles * fading)
    damping = unit / speed * b * fading * (2 * fr + x / settles)
    assert unit * (k * x**n + b * fr**2 * fading) == pytest.approx(0.3, rel=1e-6)
    assert (found.stiffness.value, found.damping.value) == pytest.approx((stiffness, damping), rel=1e-5)
    assert found.stiffness.low < found.stiffness.value < found.stiffness.high
    assert tangent_at(fitted, of, 1e6, 0.1) is None


def test_the_error_beyond_the_runs_is_that_of_what_was_left_out():
    # A spring-damper fitted to F = k z^2 at z <= 2/3: K = k sum(z^3) / sum(z^2), compared with deeper rows.
    depth = (np.arange(12) + 0.5) / 12 * 0.012
    runs = [
        PushRun(f"{bed}-{v}", str(bed), "driven", v, depth, 0 * depth + v, 0 * depth, (4e3 + 40 * bed) * depth**2)
        for bed in range(3) for v in (0.1, 0.2, 0.4)
    ]  # fmt: skip

    found = beyond(
        fit_law(CANDIDATES["bekker"](replace(FOUNDATION, tip="flat", tip_height=0.0)), Data(FOUNDATION, tuple(runs)))
    )
    assert abs(found["depth"].error) < 1e-3 and abs(found["speed"].error) < 1e-3  # A k z^n is the law
    pair = beyond(fit_law(CANDIDATES["spring-damper"](FOUNDATION), Data(FOUNDATION, tuple(runs))))
    assert (pair["speed"].left_out, pair["speed"].fitted_to) == (0.4, 0.2)
    low, high = depth[depth <= 0.008], depth[depth > 0.0077]
    design = np.array([[z, v] for z in low for v in (0.1, 0.2, 0.4)])
    k, c = np.linalg.lstsq(design, np.repeat(low**2, 3), rcond=None)[0]
    expected = np.mean([k * high + c * v for v in (0.1, 0.2, 0.4)]) / np.mean(high**2) - 1
    assert pair["depth"].error == pytest.approx(expected, abs=0.02)
    assert pair["depth"].error < -0.2 and pair["depth"].interval[0] <= pair["depth"].error
    two = Data(FOUNDATION, tuple(run for run in runs if run.speed < 0.3))
    assert "speed" not in beyond(fit_law(CANDIDATES["spring-damper"](FOUNDATION), two))


def test_speeds_typed_to_six_digits_are_one_froude_number_in_all_cells():
    cells = scaled_cells(EARLY, TRUTH, noise=0.0)
    typed = {
        name: replace(data, runs=tuple(replace(run, speed=float(f"{run.speed:.6g}")) for run in data.runs))
        for name, data in cells.items()
    }
    data = cross(typed)
    assert data.speeds == pytest.approx([0.2, 0.4, 0.8], rel=1e-5)
    fastest = data.only(lambda run: run.speed == data.speeds[-1])
    assert {run.cell for run in fastest.scaled} == set(cells)
    found = beyond(fit_law(CrossedLaw("one-pair", EARLY.shapes), data))["speed"]
    assert (found.left_out, found.fitted_to) == pytest.approx((0.8, 0.4), rel=1e-5)


def test_the_interval_beyond_the_runs_is_that_of_fits_without_one_bed_each():
    law, design = "spring-damper", dict.fromkeys(range(4), (0.1, 0.2, 0.4))
    data, candidate = synthetic_data(law, TRUTHS[law], design, seed=5), CANDIDATES[law](FOUNDATION)
    found = beyond(fit_law(candidate, data))
    without = [beyond(fit_law(candidate, data.without_bed(bed))) for bed in data.beds]
    for kind, one in found.items():
        expected = interval(one.error, np.array([other[kind].error for other in without]))
        assert one.interval == pytest.approx((expected.low, expected.high), rel=0.02)
    slow_in_one = data.only(lambda run: run.bed == "0" or run.speed > 0.3)
    assert beyond(fit_law(candidate, slow_in_one))["speed"].interval is None


def test_an_exponent_that_cannot_be_told_from_its_bound_counts_as_at_it():
    fitted = fit_law(EARLY, cross(scaled_cells(EARLY, TRUTH)))
    assert not any(map(fitted.at_bound, EARLY.free))
    place = EARLY.free.index("n_flat")
    left_out = fitted.left_out.copy()
    left_out[:, place] = fitted.theta[place] + np.array([-1.0, 0.0, 1.0]) * fitted.theta[place]
    unsure = replace(fitted, left_out=left_out)
    assert unsure.parameter("n_flat").low < 0
    assert [name for name in EARLY.free if unsure.at_bound(name)] == ["n_flat"]


def test_every_load_and_speed_of_a_cell_has_a_tangent_or_is_named_by_a_warning():
    # The inertia of these runs bears the smallest loads at the surface when the tip is fast.
    cells = scaled_cells(CrossedLaw("power-square", EARLY.shapes), np.array([6.0, 9.0, 1.3, 0.9, 6.0]))
    fitted = fit_law(CrossedLaw("power-square", EARLY.shapes), cross(cells))
    for name, data in cells.items():
        rows, warned = tangents_of(fitted, name, data)
        assert len(rows) + sum(text.count(" N, ") for text in warned) == 3 * 2
        assert rows and name in warned[0]
