"""Driven, dropped, set down: closed forms on grounds whose law is known, order in H, and restart to the bit."""

import math

import numpy as np
import pytest
from fake_bed import FakeBed

from coupling import Drive, Drop, Ground, SetDown, drive, drop, set_down
from rigid import Spike, SpringDamper

SPIKE = Spike(diameter=0.012, length=0.05, mass=0.5)


def proud(bed):
    bed.proud = 0.002
    return bed


def test_grounds_keep_the_contract():
    from coupling import BedGround

    assert isinstance(SpringDamper(stiffness=1.0), Ground)
    assert isinstance(BedGround(FakeBed(), SPIKE), Ground)


def test_driven_keeps_its_speeds_and_ends_where_told():
    run = drive(SPIKE, into=FakeBed(), speed=0.1, depth=0.0101, hold=0.01, retreat_speed=0.2)
    assert run.max_depth == pytest.approx(0.0101, rel=1e-12)
    assert set(run.phase) == {"free", "in", "rest", "out"}
    assert run.depth[-1] == pytest.approx(0.0, abs=2e-5)
    inside = run.loading
    with pytest.warns(DeprecationWarning, match=r"Penetration\.loading"):
        assert np.array_equal(run.way_in, inside)
    assert np.allclose(run.velocity[inside][:-1], 0.1)
    assert np.allclose(run.force[inside], 100.0 * run.depth[inside], rtol=1e-9)
    # t = 0 at the surface, exactly
    first = int(np.argmax(inside))
    assert run.time[first] == 0.5 * run.macro_step and run.depth[first] == 0.05 * run.macro_step


def test_work_in_and_out():
    """K z^2 / 2 in; out of the elastic line, F^2 / (2 unload)."""
    run = drive(SPIKE, into=FakeBed(unload=5000.0), speed=0.1, depth=0.01)
    assert run.work_in == pytest.approx(0.5 * 100.0 * 0.01**2, rel=1e-9)
    assert run.work_out == pytest.approx(0.5 * 1.0**2 / 5000.0, rel=2e-2)


def test_free_fall_is_exact():
    ground = SpringDamper(stiffness=0.0, time_step=1e-3)
    run = drop(SPIKE, into=ground, speed=0.1, max_time=0.1)
    assert run.ended == "max_time"
    end = Drop(SPIKE, ground, speed=0.1, max_time=0.1, substeps=1)
    for _ in range(100):
        end.advance()
    assert end.depth == pytest.approx(0.1 * 0.1 + 0.5 * 9.80665 * 0.1**2, rel=1e-12)
    assert run.max_depth > 0


def test_the_last_rows_of_a_run_are_its_rows_also_after_a_touch_above_the_surface_and_a_restart():
    """A spike rests by them."""
    options = {"load": 1.0, "lowering_speed": 0.05, "rest_time": 0.01}
    run, steps = SetDown(SPIKE, proud(FakeBed()), **options), 0
    while not run.done:
        run.advance()
        steps += 1
        last = run._last(0.01)
        assert last is None or np.array_equal(last, np.array(run._rows[-len(last) :]))
        if steps == 300:
            kept = run.state()
            run = SetDown(SPIKE, proud(FakeBed()), **options)
            run.restore(kept)
    assert steps > 400 and last is not None


@pytest.mark.parametrize("shallow", [True, False])
@pytest.mark.parametrize("rest_time", [0.04, 0.3])
@pytest.mark.parametrize("kind", [Drop, SetDown])
def test_a_long_time_at_rest_is_read_as_a_whole_only_where_the_spike_rests(kind, rest_time, shallow, monkeypatch):
    """Else a step takes as long as the time at rest has rows: hundreds of thousands, pushed some micrometres deep."""

    def made(restarted):
        ground = SpringDamper(stiffness=400.0 if shallow else 60.0, damping=3.0)
        options = {"speed": 0.1} if kind is Drop else {"lowering_speed": 0.1}
        options |= {"load": 1.0, "mass": 0.2, "rest_time": rest_time, "max_time": 2.0, "substeps": 5}
        run = kind(SPIKE, ground, **options)
        for _ in range(300 if restarted else 0):
            run.advance()
        if restarted:
            kept, run = run.state(), kind(SPIKE, ground, **options)
            run.restore(kept)
        return run

    looked = []
    of_last = kind._last
    monkeypatch.setattr(kind, "_last", lambda run, seconds: looked.append(run.count) or of_last(run, seconds))
    first, again = made(False).run(), made(True).run()
    assert len(looked) <= 4, looked  # once a run, or once more where another digit decides
    monkeypatch.setattr(kind, "_may_rest", lambda run: True)
    plain = made(False).run()
    assert len(looked) > 100
    for run in (first, again):
        assert run.ended == plain.ended and np.array_equal(run.phase, plain.phase)
        assert np.array_equal(run.force, plain.force)


def _drop_error(step):
    """A drop on a spring: z = v/w sin wt + W/K (1 - cos wt); error at a fixed time, and of the energy."""
    stiffness, mass, load, speed = 500.0, 0.5, 2.0, 0.3
    run = Drop(SPIKE, SpringDamper(stiffness=stiffness, time_step=step), speed=speed, mass=mass, load=load, substeps=1)
    while run.time < 0.04 - 0.5 * step:
        run.advance()
    omega = math.sqrt(stiffness / mass)
    exact = speed / omega * math.sin(omega * 0.04) + load / stiffness * (1 - math.cos(omega * 0.04))
    energy = 0.5 * mass * run.velocity**2 + 0.5 * stiffness * run.depth**2 - load * run.depth
    return abs(run.depth - exact), abs(energy - 0.5 * mass * speed**2)


def test_second_order_in_the_macro_step():
    coarse, fine = _drop_error(1e-3), _drop_error(1e-3 / 8)
    for before, after in zip(coarse, fine, strict=True):
        assert math.log(before / after, 8) > 1.85
    assert fine[1] < 1e-4 * 0.5 * 0.5 * 0.3**2


def test_a_drop_comes_to_rest_on_a_bed_that_keeps_what_it_takes():
    bed = FakeBed(hardness=100.0, unload=8000.0, rate=1.0)
    run = drop(SPIKE, into=bed, speed=0.06, mass=2.63, load=0.219, max_time=3.0)
    stop = math.sqrt(2.63 / 100.0) * 0.5 * math.pi
    assert run.stop_time == pytest.approx(stop, rel=0.3)
    assert run.loading.sum() * run.macro_step == pytest.approx(run.stop_time, rel=1e-9)


def test_set_down_ends_at_the_sinkage_that_carries_the_load():
    ground = SpringDamper(stiffness=100.0, time_step=1e-4)
    run = set_down(SPIKE, onto=ground, load=0.2, lowering_speed=0.03)
    assert run.ended == "rest"
    assert run.resting_depth == pytest.approx(0.2 / 100.0, rel=0.003)
    assert run.max_depth < 0.2 / 100.0  # from above, without overshoot
    run = set_down(SPIKE, onto=FakeBed(hardness=2e4, power=2.0), load=0.2, lowering_speed=0.03)
    assert run.final_depth == pytest.approx(math.sqrt(0.2 / 2e4), rel=0.02)
    assert run.max_depth < 1.002 * math.sqrt(0.2 / 2e4)


def test_a_spike_set_down_is_let_go_where_it_first_touches():
    """Grains stick out of a bed: felt 2 mm above its surface, it carries F = K (z + 2 mm), never more than the load."""
    bed = FakeBed(hardness=300.0, proud=0.002)
    run = set_down(SPIKE, onto=bed, load=0.3, lowering_speed=0.1, start_depth=-0.006)
    assert run.ended == "rest"
    assert run.force.max() <= 0.3
    assert run.depth[-1] == pytest.approx(0.3 / 300.0 - 0.002, rel=0.01)
    assert np.allclose(np.diff(run.time), run.macro_step, rtol=1e-9)
    touched = int(np.argmax(run.force > 0))
    assert run.time[touched] == pytest.approx(-0.5 * run.macro_step, rel=1e-6)
    assert run.settings["start_depth"] == pytest.approx(-0.006, rel=0.01)


@pytest.mark.parametrize(
    "make",
    [
        lambda bed: Drive(SPIKE, bed, speed=0.2, depth=0.004, hold=0.002),
        lambda bed: Drop(SPIKE, bed, speed=0.1, mass=0.3, load=1.0, max_time=0.2),
        lambda bed: SetDown(SPIKE, bed, load=0.3, max_time=0.2),
        lambda bed: SetDown(SPIKE, proud(bed), load=0.3, max_time=0.2, start_depth=-0.004),
    ],
)
def test_a_run_taken_up_again_gives_the_same_bits(make, tmp_path):
    frames: list[float] = []
    whole = make(FakeBed(rate=2.0)).run(on_frame=lambda run: frames.append(run.time), frame_interval=0.005)
    broken = make(FakeBed(rate=2.0))
    again: list[float] = []

    def stop(run):
        if run.count == 57:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        broken.run(on_step=stop, on_frame=lambda run: again.append(run.time), frame_interval=0.005)
    np.savez(tmp_path / "state.npz", **broken.state())
    with np.load(tmp_path / "state.npz") as state:
        other = make(FakeBed(rate=2.0))
        other.restore(dict(state))
    rest = other.run(on_frame=lambda run: again.append(run.time), frame_interval=0.005)
    for name in ("time", "depth", "velocity", "force", "phase"):
        assert np.array_equal(getattr(whole, name), getattr(rest, name)), name
    assert (whole.ended, frames) == (rest.ended, again)


def test_a_bed_too_shallow_for_the_depth_is_refused():
    with pytest.raises(ValueError, match=r"depth is 0.05: this ground takes the spike down to 0.039 m"):
        drive(SPIKE, into=FakeBed(surface=0.045), speed=0.1, depth=0.05)


def test_a_state_of_another_kind_is_refused():
    state = SetDown(SPIKE, FakeBed(), load=0.3).state()
    with pytest.raises(ValueError, match="set_down"):
        Drop(SPIKE, FakeBed(), speed=0.1).restore(state)


@pytest.mark.parametrize("given", [{"speed": -0.1}, {"depth": 0.0}, {"hold": -1.0}, {"substeps": 0}])
def test_what_cannot_be_is_refused_by_name(given):
    with pytest.raises(ValueError, match=next(iter(given))):
        Drive(SPIKE, FakeBed(), **({"speed": 0.1, "depth": 0.01} | given))


def test_a_saved_run_is_a_run_folder(tmp_path):
    import json
    import tomllib

    from coupling import Penetration

    run = drive(SPIKE, into=FakeBed(), speed=0.2, depth=0.004)
    folder = run.save(tmp_path / "first")
    text = (folder / "run.toml").read_text()
    table = tomllib.loads(text)
    assert (table["speed"], table["spike"]["diameter"], table["bed"]["grain_count"]) == (0.2, 0.012, 200)
    assert "0.2  # m/s" in text and "0.004  # m" in text
    result = json.loads((folder / "result.json").read_text())
    assert result["quantities"]["peak_force"]["value"] == run.peak_force
    back = Penetration.read_csv(folder / result["runs"][0]["series"], kind="driven", macro_step=run.macro_step)
    for name in ("time", "depth", "velocity", "force", "phase"):
        assert np.array_equal(getattr(back, name), getattr(run, name))


def test_a_run_is_not_lost_to_a_folder_in_use(tmp_path):
    run = drive(SPIKE, into=FakeBed(), speed=0.2, depth=0.004)
    run.save(tmp_path / "first")
    (tmp_path / "first-2").write_text("a file")
    with pytest.warns(UserWarning, match=r"'.*first' is in use: the run is in '.*first-3'"):
        kept = run.save(tmp_path / "first")
    assert kept == tmp_path / "first-3"
    assert (kept / "series" / "driven.csv").read_bytes() == (tmp_path / "first" / "series" / "driven.csv").read_bytes()


def test_a_drop_that_bobs_ends_a_set_time_after_its_first_stop():
    """Undamped spring, it would bob for ever; first stop at (pi/2 + phi) sqrt(m/K), tan phi = W / (v sqrt(mK))."""
    ground = SpringDamper(stiffness=100.0, damping=0.0, time_step=1e-5)
    spike = Spike(diameter=0.012, length=0.06, mass=0.2)
    series = drop(spike, into=ground, speed=0.1, load=0.2, after_stop=0.03, max_time=5.0)
    stop = (0.5 * np.pi + np.arctan(0.2 / (0.1 * np.sqrt(0.2 * 100.0)))) * np.sqrt(0.2 / 100.0)
    assert series.ended == "stopped"
    assert series.time[-1] == pytest.approx(stop + 0.03, abs=5e-4)
