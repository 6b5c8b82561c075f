"""The map of JSC-1A: it is that of the kept pushes, misses beds it has not seen by what it states, and refuses more."""

import importlib.util
import json
import math
from pathlib import Path

import pytest

from experiments import groundmap as ground
from experiments.cli.main import BAD_INPUT, DONE, main
from experiments.groundmap.make import COHESIVE, PUSHED, made_cohesive
from experiments.groundmap.maps import read_map
from experiments.platform.surfaces import find_surface
from rigid.ground_file import read_ground
from vis.penetrate.groundmap import answer_tiles

FOLDER = Path(__file__).parents[3] / "docs" / "results" / PUSHED
EARTH = 9.80665
POINT = {"gravity": EARTH, "diameter": 0.012, "grain": None, "packing": None, "load": None}


@pytest.fixture(scope="module")
def table():
    """table.py of the kept pushes, as a module."""
    spec = importlib.util.spec_from_file_location("jsc_table", FOLDER / "table.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def fits(table):
    return table.fit_places(table.without_slowest(table.read_pushes()), 5e-3)


def stiffness(**changed):
    return read_map(COHESIVE).answer(**POINT | changed).stiffness


def test_the_map_that_ships_is_the_one_of_the_kept_pushes(table, fits):
    kept, made = json.loads((FOLDER / "numbers.json").read_text(encoding="utf-8"))["map, 0 to 5 mm"], table.map_of(fits)
    for key, value in made.items():
        assert kept[key] == pytest.approx(value, rel=1e-6), key
    shipped = read_map(COHESIVE)
    assert shipped.law == pytest.approx(dict(made_cohesive()["cohesive"]), rel=1e-5)
    assert shipped.packing == made_cohesive()["packing"]


def test_k_of_beds_that_were_left_out_of_the_fit_is_missed_by_the_stated_factor(table, fits):
    """The map is fitted anew without each bed; the root mean square of ln(K / map) over its cases is what it states."""
    beds, squares = table.cases_of(fits), []
    assert len(beds) >= 5
    for out, cases in beds.items():
        a, b, share = table.law_of(item for bed, found in beds.items() if bed != out for item in found.items())
        for (x, gravity, tip), value in cases.items():
            size = tip / 0.012
            predicted = math.exp(a + b * x) * ((1 - share) * gravity / EARTH * size**2 + share * size)
            squares.append(math.log(value / predicted) ** 2)
    off = math.exp(math.sqrt(sum(squares) / len(squares)))
    assert read_map(COHESIVE).law["off"] >= off * (1 - 1e-5)
    assert off < 1.25


def test_in_grains_that_were_pushed_the_map_has_the_mean_of_their_places_within_its_error(table, fits):
    for cases in table.cases_of(fits).values():
        for (x, gravity, tip), value in cases.items():
            found = stiffness(gravity=gravity, diameter=tip, grain=x * tip)
            assert abs(math.log(value / found.value)) < 2 * found.std / found.value


def test_k_does_not_depend_on_gravity_where_cohesion_carries_and_nearly_follows_it_with_no_share():
    """K goes with D there, as a stress on an area over a depth; at 1 g with up to D^2."""
    least = stiffness(gravity=1e-6 * EARTH).value
    assert stiffness(gravity=1e-4 * EARTH).value == pytest.approx(least, rel=1e-3)
    assert stiffness(gravity=1e-6 * EARTH, diameter=0.024, grain=0.0002).value == pytest.approx(2 * least, rel=1e-3)
    share = read_map(COHESIVE).law["share"]
    assert least / stiffness().value == pytest.approx(share, rel=1e-3)
    assert stiffness(gravity=share / (1 - share) * EARTH).value == pytest.approx(2 * least, rel=1e-4)


def test_the_law_of_similarity_holds_between_tips():
    """K / D depends on d / D and g D only, since cohesion is a stress that grains of all sizes have."""
    one, two = stiffness(grain=0.003).value, stiffness(gravity=EARTH / 4, diameter=0.048, grain=0.012).value
    assert two / 0.048 == pytest.approx(one / 0.012, rel=1e-9)


def test_of_real_grains_it_has_half_the_row_of_the_surface_and_its_whole_range_as_error():
    shipped, surface = read_map(COHESIVE), find_surface("jsc1a")
    answer = shipped.answer(**POINT)
    assert 2 * answer.stiffness.value == pytest.approx(surface.stiffness, rel=0.01)
    assert 2 * answer.damping.value == pytest.approx(surface.damping, rel=0.03)
    within = math.log(shipped.law["within"])
    assert answer.stiffness.std / answer.stiffness.value == pytest.approx(
        math.hypot(within, math.log(shipped.law["off"]))
    )
    finer = [stiffness(grain=grain) for grain in (0.003, 0.0024, 0.001, 0.0001)]
    errors = [number.std / number.value for number in finer]
    assert errors == sorted(errors) and errors[0] < 0.3


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--spike-diameter", "0.05"], "tip_diameter"),
        (["--gravity", "20"], "gravity"),
        (["--packing", "0.6"], "packing"),
        (["--grain", "0.005"], "grain"),
    ],
)
def test_what_is_beyond_the_map_is_refused_by_name(options, named, tmp_path, capsys):
    command = ["ground", "--material", COHESIVE, *options, "--out", str(tmp_path / "run"), "--quiet"]
    assert main(command) == BAD_INPUT
    assert named in capsys.readouterr().err


def test_the_command_states_what_carries_and_writes_a_file_that_a_tumble_in_flight_takes(tmp_path):
    low = ["--material", COHESIVE, "--gravity", "1e-3g", "--load", "0.01", "--out", str(tmp_path / "run"), "--quiet"]
    assert main(["ground", *low]) == DONE
    result = json.loads((tmp_path / "run" / "result.json").read_text(encoding="utf-8"))
    assert any("these grains stick" in text for text in result["warnings"])
    fitted = read_ground(tmp_path / "run" / "ground.toml")
    assert fitted.values["stiffness"] == pytest.approx(result["quantities"]["stiffness"]["value"])
    assert fitted.range["depth"][1] == pytest.approx(0.005)
    flight = ["--ground", str(tmp_path / "run" / "ground.toml"), "--gravity", "1e-3g", "--duration", "0.2"]
    assert main(["tumble", *flight, "--out", str(tmp_path / "tumble"), "--quiet"]) == DONE


def test_another_tip_than_the_one_of_the_runs_is_said_to_be_scaled(tmp_path):
    def words(name, **given):
        return " ".join(ground.run(ground.Settings(material=COHESIVE, **given), tmp_path / name)["warnings"])

    assert "similarity" in words("other", tip_diameter=0.024, gravity=1.0)
    assert "similarity" not in words("same", gravity=1.0)


@pytest.mark.parametrize(("gravity", "load"), [(EARTH, 0.1), (EARTH, 0.5), (1.62, 0.5), (1e-3 * EARTH, 0.5)])
def test_a_sinkage_that_only_cohesion_gives_stands_beside_the_one_without_it(gravity, load, tmp_path):
    """K = exp(..) (w + s D / D0) with w = (1 - s) g / g0 (D / D0)^2: w alone is left where cohesion is 0, as its 95 %
    interval of 24 ± 20 Pa allows. Terzaghi's depth is (p - 0.3 w' D N_gamma) / (w' N_q), w' = 0.563 * 2900 kg/m3 g,
    N_q = 23.18 and 319.1, N_gamma = 22.02 and 873.9 at 32 and 50 degrees."""
    settings = ground.Settings(material=COHESIVE, gravity=gravity, load=load, tip_diameter=0.016)
    result = ground.run(settings, tmp_path / "run")
    numbers, size, share = result["quantities"], 0.016 / 0.012, read_map(COHESIVE).law["share"]
    weight = (1 - share) * gravity / EARTH * size**2
    ratio = (weight + share * size) / weight  # of the sinkages without and with cohesion
    stated = numbers["sinkage"]
    of_soil, pressure = 0.563 * 2900 * gravity, load / (math.pi * 0.008**2)
    formula = [max(0.0, pressure - 0.3 * of_soil * 0.016 * by_width) / (of_soil * by_depth)
               for by_width, by_depth in ((22.02, 23.18), (873.9, 319.1))]  # fmt: skip
    ends = [*formula, ratio * stated["value"]]
    matters = max(ends) > stated["value"] + 1.959964 * stated["std"]
    assert matters == (load > 0.2)
    fitted = read_ground(tmp_path / "run" / "ground.toml")
    rows = dict(row[:2] for row in rows_of(result))
    assert len(fitted.notes) == 1 + matters and any("holds" in row for row in rows) == matters
    assert ("sinkage_without_cohesion" in numbers) == matters == ("95 %)" in result["warnings"][0])
    if matters:
        low, high = (numbers[f"sinkage_without_cohesion{end}"]["value"] for end in ("", "_most"))
        assert (low, high) == (pytest.approx(min(ends), rel=2e-3), pytest.approx(max(ends), rel=2e-3))


def rows_of(result):
    """Labels and values of the answer."""
    return [(tile.label, tile.value) for tile in answer_tiles(result)]
