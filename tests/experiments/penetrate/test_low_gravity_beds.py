"""Real beds, small ones: made stiffer without another grain in another place, and prepared by the recipe of grains
that stick; a foot in them."""

import numpy as np
import pytest

from dem import Bed
from experiments.grains.staged import come_to_rest, lower_gravity
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.settings import PenetrateSettings
from rigid.checks.unfit import UnfitSettingsError

SMALL = {
    "bed_size": (0.024, 0.024, 0.018), "grain": 0.003, "tip_diameter": 0.006, "depth": 0.004, "shaft_length": 0.014,
    "allow_coarse": True, "seeds": (1,), "threads": 1, "frame_count": 0,
}  # fmt: skip


@pytest.mark.long
def test_a_bed_made_stiffer_has_the_same_grains_in_their_places_at_rest(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path))
    settings = PenetrateSettings(**SMALL)
    young = beds.choose_softness(settings).young
    bed = Bed.prepare(
        beds.find_material(settings), size=settings.bed_size, grain=0.003, gravity=settings.gravity, young=young,
        max_overlap=0.05, cache=False, threads=1,
    )  # fmt: skip
    stiffer = beds.stiffened(bed, 1.5 * young, settings)
    before, now = bed.grains(), stiffer.grains()
    assert np.array_equal(before.radius, now.radius)
    moved = np.linalg.norm(now.position - before.position, axis=1) / 0.003
    assert np.quantile(moved, 0.9) < 0.02  # loose ones on top may roll over
    assert moved.max() < 0.5
    assert stiffer.material == bed.material.softened(1.5 * young)
    assert stiffer.time_step == pytest.approx(bed.time_step / np.sqrt(1.5), rel=1e-6)  # as 1 / sqrt(E)
    assert stiffer.overlap_limit == bed.overlap_limit
    assert stiffer.kinetic_energy < 1e-5 * stiffer.weight * 0.003
    assert stiffer.floor_force == pytest.approx(stiffer.weight, rel=0.01)
    assert (stiffer.time, stiffer.max_overlap) == (0.0, 0.0)


@pytest.mark.long
def test_a_foot_in_grains_that_stick_works_from_one_option_in_low_gravity(tmp_path, monkeypatch):
    """JSC-1A by its recipe, prepared at 1 g, bears 0.01 N at 1e-3 g; sand without cohesion does a metre down."""
    monkeypatch.setenv("HEDGEBED_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    settings = PenetrateSettings(
        **SMALL, material="jsc-1a-loose-heights", gravity="1e-3g", load=0.01, speeds=(0.2,), drop_speeds=()
    )
    result = penetrate.run(settings, tmp_path / "run")
    (facts,) = result["bed"]["seeds"]
    assert facts["packing_fraction"] == pytest.approx(0.57, abs=0.03)
    assert "rest" not in result
    assert result["quantities"]["sinkage_dem"]["value"] < 0.003
    assert result["quantities"]["max_overlap"]["value"] <= settings.max_overlap


class Ringing:
    """A bed whose energy falls a thousandth in a spell without drag, and ten times in one with drag."""

    time_step, weight, mean_diameter = 1e-5, 1.0, 1.0

    def __init__(self, drag_helps):
        self.kinetic_energy, self.drags, self.drag_helps = 1e-2, [], drag_helps

    def advance(self, steps, *, drag_time=np.inf):
        self.drags.append(bool(np.isfinite(drag_time)))
        self.kinetic_energy *= 0.1 if self.drags[-1] and self.drag_helps else 0.999

    def measure_surface(self):
        self.measured = True

    mark_origin = measure_surface


def test_a_bed_that_rings_is_dragged_until_it_is_at_rest_and_must_be_without():
    bed = Ringing(drag_helps=True)
    come_to_rest(bed, unit=1e-3)
    assert bed.drags == [True] * 4 + [False]  # 1e-2 to below 1e-5
    assert bed.measured


def test_a_bed_that_never_rests_says_how_much_it_moves():
    with pytest.raises(UnfitSettingsError, match=r"within 0.09 s .* 0.0094 m g d .* less than 1e-05"):
        come_to_rest(Ringing(drag_helps=False), unit=1e-3)


def test_a_floor_that_never_carries_the_bed_in_the_lowered_gravity_is_a_setting_that_does_not_fit():
    """Exit status 2, as where the grains never rest."""
    bed = Ringing(drag_helps=True)
    bed.floor_force, bed.set_gravity, bed.gravity = 0.5, lambda gravity: None, (0.0, 0.0, -9.81)
    with pytest.raises(UnfitSettingsError, match="the floor"):
        lower_gravity(bed, 0.1, unit=1e-3)


class Shown:
    """Keeps the shares of a stage."""

    def __init__(self):
        self.shares = []

    def show_bed(self, bed):
        pass

    def update(self, share):
        self.shares.append(share)


@pytest.mark.parametrize(("gravity", "spells"), [(0.1, 30), (0.01, 100)])
def test_gravity_falls_in_steps_that_the_grains_follow_and_the_share_goes_on_to_the_end(gravity, spells):
    """The share of the estimate's time: while gravity falls by ln(g / g') units, and in a rest of twice the longer
    unit, sqrt(g / g'); a rest that is late goes on ever more slowly. Rest may last ten of these."""
    bed, shown, seen = Ringing(drag_helps=True), Shown(), []
    falls, rests = np.log(10 / gravity), 2 * (10 / gravity) ** 0.5
    bed.drag_helps = False  # a thousandth in each step and spell, down to the energy of rest
    bed.kinetic_energy = 1e-5 * 0.999 ** -(np.ceil(10 * falls) + spells - 0.5)
    bed.gravity, bed.floor_force = (0.0, 0.0, -10.0), 1.0
    bed.set_gravity = seen.append
    lower_gravity(bed, gravity, unit=1e-3, progress=shown)
    ratios = np.divide([10.0, *seen[:-1]], seen)
    assert seen[-1] == pytest.approx(gravity) and ratios.max() < 1.11 and len(seen) == np.ceil(10 * falls)
    shares = np.array(shown.shares)
    assert (np.diff(shares) > 0).all() and shares[-1] < 1
    assert shares[len(seen) - 1] == pytest.approx(falls / (falls + rests))
    on_time = int(0.8 * rests / 1.5)
    assert shares[len(seen) + on_time - 1] == pytest.approx((falls + 1.5 * on_time) / (falls + rests))


def test_a_rest_in_a_drag_and_without_it_shows_a_share_that_never_stands_still():
    """The drag is half of it, by the logarithm of the energy: from 300 times that of rest to less in three spells."""
    bed, shown = Ringing(drag_helps=True), Shown()
    bed.free, bed.kinetic_energy = 0, 3e-2

    def advance(steps, *, drag_time=np.inf):
        Ringing.advance(bed, steps, drag_time=drag_time)
        if not bed.drags[-1]:
            bed.free += 1
            bed.kinetic_energy = 2e-5 if bed.free < 12 else 1e-6

    bed.advance = advance
    come_to_rest(bed, unit=1e-3, progress=shown)
    assert shown.shares[:4] == pytest.approx([0.0, *(0.5 - 0.5 * np.log([30, 3, 1]) / np.log(300))])
    assert len(shown.shares) == 15 and (np.diff(shown.shares) > 0).all() and 0.9 < shown.shares[-1] < 1
