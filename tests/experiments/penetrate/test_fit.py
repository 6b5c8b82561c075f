"""K and C come back from runs whose law is known; every run weighs the same; what is found is said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from fake_bed import FakeBed
from golden import golden

from coupling import drive, drop
from experiments.penetrate.departures import departure_table, departures, depth_exponent, rate_change, sentences
from experiments.penetrate.fit import (
    Fit,
    drag_gap,
    fit_moments,
    fit_rows,
    fit_spring_damper,
    gap_of_moments,
    moments_of,
    spread,
)
from rigid import Spike, SpringDamper

SPIKE = Spike(diameter=0.012, length=0.05)


def runs_on(make_ground, speeds=(0.1, 0.2, 0.4)):
    driven = {f"d{v}": drive(SPIKE, into=make_ground(), speed=v, depth=0.01) for v in speeds}
    return driven | {"drop": drop(SPIKE, into=make_ground(), speed=0.05, mass=2.0, load=0.2, max_time=0.6)}


def test_an_exact_spring_damper_is_recovered():
    fit = fit_spring_damper(runs_on(lambda: SpringDamper(stiffness=123.0, damping=1.5, time_step=2e-5)))
    assert fit.stiffness == pytest.approx(123.0, rel=1e-9)
    assert fit.damping == pytest.approx(1.5, rel=1e-9)
    assert fit.stiffness_error == pytest.approx(0.0, abs=1e-6)
    runs = runs_on(lambda: SpringDamper(stiffness=123.0, damping=1.5, time_step=2e-5))
    assert drag_gap(list(runs.values()), fit) == pytest.approx(0.0, abs=1e-9)


def test_a_bed_with_a_memory_gives_its_way_in():
    fit = fit_spring_damper(runs_on(lambda: FakeBed(hardness=90.0, rate=0.8, unload=6000.0)))
    assert fit.stiffness == pytest.approx(90.0, rel=1e-9) and fit.damping == pytest.approx(0.8, rel=1e-9)


def test_one_constant_speed_hardly_tells_the_two_apart():
    """Columns z and v = const over 0 < z < Z: their cosine is mean(z) / rms(z) = sqrt(3) / 2."""
    run = drive(SPIKE, into=SpringDamper(stiffness=123.0, damping=1.5, time_step=2e-5), speed=0.1, depth=0.01)
    assert fit_spring_damper({"a": run}).correlation == pytest.approx(-np.sqrt(0.75), abs=1e-3)
    more = fit_spring_damper(runs_on(lambda: SpringDamper(stiffness=123.0, damping=1.5, time_step=2e-5)))
    assert -0.8 < more.correlation < 0


def test_coefficients_stay_at_or_above_zero():
    """A drag that falls with speed would want C < 0."""
    fit = fit_spring_damper(runs_on(lambda: FakeBed(hardness=90.0, rate=-0.5)))
    assert fit.damping == 0.0 and fit.stiffness > 0


def test_every_run_weighs_the_same_whatever_its_length():
    stiff = drive(SPIKE, into=SpringDamper(stiffness=200.0, time_step=2e-5), speed=0.4, depth=0.01)
    soft = drive(SPIKE, into=SpringDamper(stiffness=100.0, time_step=2e-6), speed=0.4, depth=0.01)
    assert len(soft.time) > 5 * len(stiff.time)
    fit = fit_spring_damper({"stiff": stiff, "soft": soft})
    assert fit.force(np.array([0.01]), np.array([0.4]))[0] == pytest.approx(1.5, rel=0.01)


def test_pull_out_and_rest_are_not_fitted():
    run = drive(SPIKE, into=FakeBed(), speed=0.1, depth=0.01, hold=0.01)
    rows = fit_rows(run)
    assert set(run.phase[rows]) == {"in"} and (run.depth[rows] > 0).all()
    dropped = drop(SPIKE, into=SpringDamper(stiffness=100.0, time_step=1e-4), speed=0.1, mass=0.2, load=0.1, max_time=1)
    rows = np.flatnonzero(fit_rows(dropped))
    assert (np.diff(rows) == 1).all() and (dropped.velocity[rows] > 0).all()
    assert dropped.velocity[rows[-1] + 1] < 0  # it bounces later, and goes in again: those rows do not count


def test_no_run_to_fit_is_refused():
    with pytest.raises(ValueError, match="no driven run"):
        fit_spring_damper({})


def test_spread_needs_two():
    assert spread([1.0]) is None and spread([1.0, None]) is None
    assert spread([1.0, 3.0]) == pytest.approx(np.sqrt(2))
    assert spread([0.9866102566990252, 0.9866102566990253]) == 0.0


def test_departures_are_said_by_depth_and_speed():
    """The bed grows with z^2, the law with z: too hard above, too soft below."""
    driven = [drive(SPIKE, into=FakeBed(hardness=1e4, power=2.0), speed=v, depth=0.02) for v in (0.1, 0.4)]
    fit = fit_spring_damper({str(i): run for i, run in enumerate(driven)})
    table = departure_table(driven, fit)
    assert len(table) == 8 and table[0]["gap"] > 0 > table[3]["gap"]
    assert table[0]["depth_to"] == pytest.approx(0.005)
    for value, std, beds in depth_exponent(driven).values():
        assert value == pytest.approx(2.0, abs=0.02) and (std, beds) == (None, 1)
    assert [row["beds"] for row in table] == [1] * 8 and table[0]["bed_std"] is None
    law = SpringDamper(stiffness=fit.stiffness, damping=fit.damping, time_step=2e-5)
    models = {"a": drive(SPIKE, into=law, speed=0.1, depth=0.02)}
    found = departures([driven], models, {"a": driven[0]}, fit, sinkage=((0.002, 0.0003), (0.003, None)))
    text = " ".join(found["sentences"])
    for words in ("top 5 mm", "too hard at", "too softly at", "2.00 ± 0.30", "3.0 mm, 50 %", "recovers 100 %."):
        assert words in text, words
    (costly,) = sentences([], {}, (-0.003, 0.68), [], None)
    assert "another 0.3 %" in costly
    golden("penetrate/departures", [*found["sentences"], costly])
    assert found["work_returned"]["bed"] < 0.2 < found["work_returned"]["model"]
    assert departure_table([], Fit(1.0, 0.0, None, None, ())) == []


def test_departures_are_told_with_the_spread_between_beds():
    """Beds of F = 80 z and 120 z at one speed: 100 z +- 28.3 z, so a law of K = 100 is off by 0 +- 28 %."""
    driven = [drive(SPIKE, into=FakeBed(hardness=k), speed=0.1, depth=0.02) for k in (80.0, 120.0)]
    driven.append(drive(SPIKE, into=FakeBed(hardness=90.0), speed=0.4, depth=0.02))
    fit = Fit(100.0, 0.0, None, None, ("a", "b", "c"))
    table = departure_table(driven, fit)
    slow = table[0]
    assert slow["beds"] == 2 and slow["gap"] == pytest.approx(0.0, abs=1e-9)
    assert slow["bed_std"] == pytest.approx(np.sqrt(0.08) * slow["bed_force"], rel=1e-6)
    assert slow["gap_std"] == pytest.approx(np.sqrt(0.08), rel=1e-6)
    first = sentences(table, depth_exponent(driven), None, [], None)[0]
    for words in ("11 % too hard", "at 0.4 m/s", "one bed)", "at 0.1 m/s", "2 beds", "is 28 %"):
        assert words in first, words
    golden("penetrate/departures_between_beds", first)


def test_a_change_with_speed_is_that_of_the_beds_that_have_both_speeds():
    """F = K z + C v to Z: the mean goes with K Z / 2 + C v. A third, harder bed at one speed has no say in it."""

    def bed(hardness, speeds):
        return [drive(SPIKE, into=FakeBed(hardness=hardness, rate=1.0), speed=v, depth=0.02) for v in speeds]

    beds = [bed(80.0, (0.1, 0.4)), bed(120.0, (0.1, 0.4)), bed(500.0, (0.4,))]
    rate = rate_change(beds, Fit(100.0, 0.5, None, None, ()))
    own = [0.3 / (0.8 + 0.1), 0.3 / (1.2 + 0.1)]
    assert (rate["slow"], rate["fast"], rate["beds"]) == (0.1, 0.4, 2)
    assert rate["bed"] == pytest.approx(np.mean(own), rel=0.01)
    assert rate["bed_std"] == pytest.approx(np.std(own, ddof=1), rel=0.02)
    assert rate["model"] == pytest.approx(0.15 / 1.05, rel=0.01)
    (said,) = sentences([], {}, None, [], None, rate=rate)
    assert re.findall(r"[+\d.]+ %", said)[-3:] == ["+28 %", "7.3 %", "+14 %"] and "(2 beds" in said
    golden("penetrate/change_with_speed", said)
    assert rate_change(beds[2:], Fit(100.0, 0.5, None, None, ())) is None


def test_a_peak_of_one_grain_is_told_apart_from_the_beds():
    """One macro step twice as high: the peak is twice the law's; the mean of eight steps, a tenth of the way, 9/8."""
    run = drop(SPIKE, into=SpringDamper(stiffness=100.0, time_step=1e-4), speed=0.1, mass=0.2, load=0.1, max_time=0.3)
    force = run.force.copy()
    force[int(np.argmax(force))] *= 2.0
    said = sentences([], {}, None, [(replace(run, force=force), run)], None)
    assert "50 % below" in said[0]
    golden("penetrate/peak_of_one_grain", said[:2])
    share = float(re.search(r"is (\d+) % below", said[1])[1])
    assert share == pytest.approx(11.0, abs=1.0)


def test_moments_are_enough_for_a_fit():
    """A fit to the moments of the runs is the fit to the runs; the gap too, but for its cancellation."""
    runs = runs_on(lambda: FakeBed(hardness=90.0, rate=0.8, power=1.3))
    fit, moments = fit_spring_damper(runs), {name: moments_of(run) for name, run in runs.items()}
    assert fit_moments(moments) == fit
    driven = {name: part for name, part in moments.items() if name != "drop"}
    gap = gap_of_moments(driven, fit, dict.fromkeys(driven, 1.0))
    assert gap == pytest.approx(drag_gap(list(runs.values()), fit), rel=1e-6)
