"""`hedgebed bed make` with sizes by place; where a tumble's tips come down; what cannot be is refused by name."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dem import SAND, SAND_WEAK, Bed, Graded, measure_grading
from dem.prepare.bedfile import read_preparation
from experiments.bed.refine import refined_options
from experiments.bed.settings import BedRefineSettings
from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.grains.graded import coarsest_touched, graded_under, places_touched, unmatched_warning
from experiments.grains.recipes import recipe_of
from experiments.runs.progress import Progress
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

SIZE = (0.044, 0.018, 0.013)
MAKE = ["bed", "make", "--stages", "rain", "--size", *map(str, SIZE), "--grain", "0.002", "--quiet"]
GRADED = ["--max-overlap", "0.1", "--coarse", "0.003", "--footprints", "0.002", "0.016"]
SIZES = Graded(fine=0.002, coarse=0.003, footprints=((0.002, 0.016),))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of `bed make`; its folder."""
    run = tmp_path_factory.mktemp("graded") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEDGEBED_NO_OPENGL", "1")
        assert main([*MAKE, *GRADED, "--threads", "1", "--out", str(run)]) == DONE
    return run


@pytest.mark.long
def test_a_graded_bed_is_made_told_of_and_refined(made):
    result = json.loads((made / "result.json").read_text())
    zones = next(t for t in result["tables"] if t["title"].startswith("Sizes by place"))["rows"]
    assert [row[0] for row in zones] == ["under the footprints", "between", "coarse"]
    assert float(zones[0][4]) == pytest.approx(2.0, rel=0.05) and float(zones[2][4]) == pytest.approx(3.0, rel=0.1)
    quantities = {key: entry["value"] for key, entry in result["quantities"].items()}
    assert quantities["grain_count"] == pytest.approx(SIZES.share(SIZE) * quantities["fine_count"], rel=0.1)
    assert quantities["drained_share"] == 0 and not any("grading" in words for words in result["warnings"])
    assert quantities["largest_under_footprints"] < 0.0028
    assert SIZE[2] < result["bed"]["surface"]["value"] < SIZE[2] + 3 * 0.003  # rained for two coarse grains more
    assert "Sizes by place" in (made / "report.html").read_text()
    recipe = read_preparation(made / "bed.npz").recipe["sizes"]
    assert Graded.of(recipe) == SIZES
    options, _ = refined_options(BedRefineSettings(bed=str(made)))
    finer = options["grain"]
    assert (finer.fine, finer.coarse, finer.footprints) == (0.001, 0.0015, SIZES.footprints)


@pytest.mark.long
def test_a_graded_bed_stays_graded_when_it_is_shaken(made):
    """Half of g along x, to and fro: grains move by half a diameter and more, none so that it could drain."""
    bed = Bed.load(made / "bed.npz", threads=1)
    before = measure_grading(bed, SIZES)
    under, between, _ = before.zones
    assert before.held and abs(under.packing - 0.57) < 0.05 and abs(between.packing - 0.57) < 0.05
    for way in (1, -1, 1, -1):
        bed.set_gravity((0.5 * way * 9.81, 0.0, -9.81))
        bed.advance(round(0.02 / bed.time_step))
    assert np.abs(bed.grains().displacement).max() > 0.001
    after = measure_grading(bed, SIZES)
    assert after.held and after.farthest < before.farthest + 1.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--footprints", "0.004", "0.01"], "footprints: only of a graded bed; coarse = 0.004 would make one"),
        (["--coarse", "0.003"], "footprints = [] must be pairs"),
        ([*GRADED, "0.02"], "must be pairs: where each begins and ends"),
        ([*GRADED[:-1], "0.05"], "the footprint from 0.002 to 0.05 m is outside the bed"),
        ([*GRADED, "--growth", "0.4"], "growth = 0.4 must be above 0 and, with spread = 0.15, at most 0.22"),
    ],
)
def test_what_cannot_be_graded_is_refused(options, words, tmp_path, capsys):
    assert main([*MAKE, *options, "--out", str(tmp_path / "run")]) == BAD_INPUT
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "run").exists()


def test_fine_grains_lie_where_the_tips_of_a_forecast_come_down():
    """Eight spikes of 0.2 m: standing on two, 2 L sin(pi / 8) apart; rolled on by one, the next one's place too."""
    length, half = 0.2, math.pi / 8
    pitch = 2 * length * math.sin(half)
    theta = np.linspace(0, 2 * half, 50)  # about the tip ahead, at +pitch / 2
    x = 0.5 * pitch + length * np.sin(theta - half)
    y = length * np.cos(theta - half)
    forecast = SimpleNamespace(trial=SimpleNamespace(spike_count=8, spike_length=length), theta=theta, x=x, y=y)
    places = places_touched(forecast, reach=0.001)
    assert len(places) == 3
    for (low, high), at in zip(places, (-0.5 * pitch, 0.5 * pitch, 1.5 * pitch), strict=True):
        assert low - 0.002 < at < high + 0.002
    options = {"length": 0.6, "origin": 0.2, "spike_diameter": 0.012, "spread": 0.15, "coarse": 0.006}
    graded = graded_under(forecast, grain=0.0024, **options)
    assert graded.diameter(np.array([0.2 + 0.5 * pitch]), np.array([0.01]), (0.6, 0.06, 0.05))[0] == 0.0024
    assert graded.diameter(np.array([0.2 + pitch]), np.array([0.01]), (0.6, 0.06, 0.05))[0] == 0.006
    with pytest.raises(ValueError, match=r"grain = 0.003 m is more than a fifth of spike_diameter = 0.012 m"):
        graded_under(forecast, grain=0.003, **options)
    for shift, coarsest in ((0.0, 0.0024), (0.5 * pitch, 0.006)):  # as forecast, and half a pitch ahead of it
        depth = np.zeros((len(theta), 4, 8))
        depth[:, 3, 7] = 0.01  # the tip ahead
        run = SimpleNamespace(
            trial=forecast.trial, columns={"theta": theta, "x": x + shift}, feet=depth,
            ground=SimpleNamespace(origin=np.array([0.2, 0.03, 0.05])),
        )  # fmt: skip
        assert coarsest_touched(run, graded, size=(0.6, 0.06, 0.05)) == pytest.approx(coarsest, rel=1e-9)


def test_a_graded_bed_that_lies_as_it_fell_is_warned_of():
    """Where the packing fraction of one size is not known, and neither a packing fraction nor stages are given."""
    unknown = replace(SAND, name="mine")
    assert "known for mine" in unmatched_warning(SIZES, unknown)
    for known in (
        unmatched_warning(None, unknown), unmatched_warning(SIZES, SAND),
        unmatched_warning(SIZES, unknown, packing=0.6),
        unmatched_warning(SIZES, unknown, stages=("rain", "packing:0.6", "level")),
    ):  # fmt: skip
        assert known is None


def test_a_tumble_has_its_graded_bed_brought_to_the_packing_fraction_of_a_bed_of_one_size(monkeypatch):
    asked = []
    monkeypatch.setattr(Bed, "prepare", lambda material, *, packing, **_: asked.append((material.name, packing)))
    for given in ({"coarse": 0.006}, {}):
        on_grains = PlanarOnBed(
            TumbleSettings(
                surface="sand-weak", ground="bed", duration=0.9, grain=0.0024, bed_size=(0.4, 0.06, 0.046), **given
            )
        )
        on_grains.prepare(on_grains.softening(), Progress())
    assert asked == [("sand-weak", recipe_of(SAND_WEAK).rained), ("sand-weak", None)]
