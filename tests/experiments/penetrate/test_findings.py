"""What is said of a run: forces above depth 0, which stiffness holds when, one bed, fits that cannot tell K from C."""

import pytest
from fake_bed import FakeBed, lay_closed_form
from golden import golden

from dem.grains.materials import Material
from experiments.grains.softening import Softening
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.result import overlap_warning, softening_note
from experiments.penetrate.settings import PenetrateSettings

SAND = Material("sand", 2650.0, 7e10, 0.25, 0.5, 0.5, 0.1)
QUICK = {
    "speeds": (0.2, 0.4), "other_speeds": (0.4,), "drop_speeds": (0.1,), "other_drop_speeds": (0.1,), "drop_time": 0.5,
    "depth": 0.01, "frame_count": 0, "mass": 0.3, "load": 0.4, "lowering_speed": 0.1, "substeps": 20, "seeds": (1,),
}  # fmt: skip


@pytest.fixture(autouse=True)
def fake(monkeypatch):
    lay_closed_form(monkeypatch, beds, SAND)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)


def test_what_the_bed_pushes_with_at_its_surface_is_said_where_it_matters(tmp_path, monkeypatch):
    """Grains that stick out push with 0.2 N from 1 mm above depth 0: half the load."""
    settings = PenetrateSettings(**QUICK)
    plain = penetrate.run(settings, tmp_path / "plain")
    assert plain["quantities"]["surface_force"]["value"] == 0 and "surface" not in plain["departures"]
    law = FakeBed.law
    monkeypatch.setattr(FakeBed, "law", lambda bed, depth, v: law(bed, depth, v) + (0.2 if depth > -1e-3 else 0.0))
    found = penetrate.run(settings, tmp_path / "out")
    assert found["quantities"]["surface_force"]["value"] == pytest.approx(0.2)
    said = found["departures"]["surface"]
    golden("penetrate/surface_force", said)
    assert said in found["departures"]["sentences"]


def test_the_stiffness_of_a_foot_that_stands_is_load_over_sinkage(tmp_path, monkeypatch):
    """A bed that is softer the deeper: K fitted to all of it is too soft for where a foot stands."""
    law = FakeBed.law
    monkeypatch.setattr(FakeBed, "law", lambda bed, depth, v: law(bed, depth, v) + (0.2 if depth > 0 else 0.0))
    settings = PenetrateSettings(**(QUICK | {"seeds": (1, 2)}))
    result = penetrate.run(settings, tmp_path / "run")
    numbers = result["quantities"]
    standing = numbers["stiffness_standing"]["value"]
    assert standing == pytest.approx(0.4 / numbers["sinkage_dem"]["value"])
    ratio = standing / numbers["stiffness"]["value"]
    assert ratio > 1.1
    said = [result["departures"][key] for key in ("which_stiffness", "set_down")]
    assert f" {ratio:.2g} times" in said[0] and "0.3 kg times" in said[1]
    golden("penetrate/foot_that_stands", said)


def test_one_bed_tells_nothing_of_other_beds(tmp_path):
    """Std null for what was counted or measured in one bed, 0 for what is set; and words that do not speak of more."""
    settings = PenetrateSettings(**QUICK)
    numbers = penetrate.run(settings, tmp_path / "run")["quantities"]
    for name in ("grain_count", "packing_fraction", "time_step", "stiffness", "sinkage_dem", "work_returned_dem"):
        assert numbers[name]["std"] is None, name
    assert [numbers[name]["std"] for name in ("young", "load", "drop_mass")] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"speeds": (0.2,), "drop_speeds": (0.1,)}, True),
        ({"speeds": (0.2, 0.4), "drop_speeds": ()}, True),
        ({"speeds": (0.2, 0.4), "drop_speeds": (0.1,)}, False),
    ],
)
def test_a_fit_that_cannot_tell_the_two_says_so(tmp_path, given, told):
    settings = PenetrateSettings(**(QUICK | given))
    said = [
        text for text in penetrate.run(settings, tmp_path / "run")["warnings"] if "hardly separates K from C" in text
    ]
    assert bool(said) == told
    assert not told or ("two speeds" in said[0] and "two drop_speeds" in said[0])


def test_beds_pushed_at_one_speed_get_one_warning_of_k_and_c(tmp_path):
    """All beds together and each by itself do not separate them: two warnings would say the same."""
    given = {"seeds": (1, 2), "speeds": (0.2,), "other_speeds": (0.2,), "drop_speeds": (), "other_drop_speeds": ()}
    result = penetrate.run(PenetrateSettings(**(QUICK | given)), tmp_path / "run")
    assert not any(fit["separates"] for fit in result["fits"])
    (said,) = (text for text in result["warnings"] if "separate" in text)
    golden("penetrate/not_separated", said)


def test_a_bed_less_than_six_tips_wide_is_said(tmp_path):
    wide = PenetrateSettings(**QUICK)
    narrow = wide.model_copy(update={"tip_diameter": 0.016})
    told = [
        [text for text in penetrate.run(case, tmp_path / name)["warnings"] if "tips wide" in text]
        for name, case in (("wide", wide), ("narrow", narrow))
    ]
    assert told[0] == [] and "4.5 tips wide" in told[1][0] and "0.096 m" in told[1][0]


def test_drops_can_be_left_out(tmp_path):
    """None on the first seed is none on any; the fit is then to the driven runs alone."""
    settings = PenetrateSettings(**({k: v for k, v in QUICK.items() if "drop" not in k} | {"drop_speeds": ()}))
    assert settings.other_drop_speeds == ()
    assert PenetrateSettings(drop_speeds=(), other_drop_speeds=(0.1,)).other_drop_speeds == (0.1,)
    penetrate.check(settings)
    result = penetrate.run(settings, tmp_path / "run")
    assert {run["kind"] for run in result["runs"]} == {"driven", "set_down"}
    assert result["quantities"]["stiffness"]["value"] > 0


def test_the_first_line_says_where_speed_and_pressure_come_from():
    settings = PenetrateSettings(**QUICK, retreat_speed=0.7)
    said = softening_note(settings, Softening(1e7, 3000.0, 0.7, 7e10))
    slower = softening_note(settings, Softening(1e7, 3000.0, 0.4, 7e10))
    assert "0.7 m/s" in said and "0.4 m/s" in slower
    golden("penetrate/softening_note", [said, slower])


def test_an_overlap_near_its_bound_names_the_modulus_that_leaves_room():
    """Hertz: delta/d goes with E^(-2/3), so 0.048 comes down to 0.8 x 0.05 with E times (0.048 / 0.04)^1.5."""
    settings = PenetrateSettings(**QUICK)
    softening = Softening(1e7, 3000.0, 0.4, 7e10)
    assert overlap_warning(0.044, settings, softening) is None
    said = overlap_warning(0.048, settings, softening)
    assert "= 1.3e+07 Pa" in said and "(now 1e+07 Pa)" in said
    golden("penetrate/overlap_warning", said)


def flat_run(tmp_path, name, **given):
    """A flat foot whose load would sink away, on beds of K = 0.11, 0.12 and 0.13 N/m, speeds as a user leaves them."""
    settings = PenetrateSettings(
        gravity="1e-3g", tip="flat", tip_diameter=0.016, load=0.5, grain=0.0032, bed_size=(0.064, 0.064, 0.044),
        frame_count=0, **given,
    )  # fmt: skip
    return penetrate.run(settings, tmp_path / name)


@pytest.fixture
def weak(monkeypatch):
    """Beds of a thousandth of the stiffness of `fake`."""

    def prepare(settings, seed, young, progress):
        hardness = 0.1 + 0.01 * seed
        return FakeBed(size=settings.bed_size, time_step=6e-4, seed=seed, hardness=hardness, rate=0.05, unload=4.0)

    monkeypatch.setattr(beds, "prepare_bed", prepare)
    monkeypatch.setattr(beds, "bed_step", lambda settings, young: 6e-4)


def width(sure):
    return sure["high"] / sure["low"]


def test_three_beds_give_a_narrower_depth_to_rest_than_one(weak, tmp_path):
    """Left to the command, further beds get the slowest and the fastest push, which separate K from C."""
    one, three = (flat_run(tmp_path, str(len(s)), seeds=s) for s in ((1,), (1, 2, 3)))
    assert [run["speed"] for run in three["runs"] if run["seed"] == 3] == [0.00316, 0.0126]
    sure = three["sure"]["depth_to_rest"]
    assert width(sure) < width(one["sure"]["depth_to_rest"])
    beds_k = [fit["stiffness"] for fit in three["fits"]]
    assert beds_k == pytest.approx([0.11, 0.12, 0.13], rel=1e-3)
    ends = three["sure"]["stiffness"]["chance"]
    assert ends[0] < min(beds_k) and max(beds_k) < ends[1]


def test_further_beds_at_one_speed_have_no_k_and_the_interval_is_that_of_one_bed(weak, tmp_path):
    """At one speed K z + C v is one force: K of such a bed is what the noise makes of it."""
    one = flat_run(tmp_path, "one", seeds=(1,))
    three = flat_run(tmp_path, "three", seeds=(1, 2, 3), other_speeds=(0.0126,))
    assert not any(fit["separates"] for fit in three["fits"])
    assert three["quantities"]["stiffness"]["std"] is None
    sure = three["sure"]["depth_to_rest"]
    assert width(sure) == pytest.approx(width(one["sure"]["depth_to_rest"]), rel=0.2)
    assert "--other-speeds" in sure["sentence"] and "--seeds" not in sure["sentence"]


def test_one_speed_on_one_bed_determines_no_depth_to_rest(weak, tmp_path):
    sure = flat_run(tmp_path, "run", seeds=(1,), speeds=(0.0126,))["sure"]
    assert "stiffness" not in sure and sure["depth_to_rest"]["low"] is None
    assert "(--speeds)" in sure["depth_to_rest"]["sentence"]
