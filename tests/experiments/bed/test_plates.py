"""`hedgebed bed test plates`: which plates are pushed, the fit of made-up forces, what is refused, one small bed."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from experiments.bed import plates
from experiments.bed.plates_fit import fit_of, measured_force, predicted_force
from experiments.bed.test_settings import BedPlatesSettings
from experiments.cli.main import BAD_INPUT, DONE, main
from rigid.ground.rft import tractions
from rigid.ground.rft_table import RftTable, find_rft, read_rft

KEPT = Path(__file__).parents[3] / "docs" / "results" / "bed-test-plates"
SMALL = [
    "--size", "0.036", "0.036", "0.03", "--grain", "0.004", "--side", "0.012", "--depth", "0.006", "--travel", "0.004",
    "--shape-size", "0.012", "--seeds", "1", "--betas", "0", "60", "90", "--gammas", "90", "0", "--shapes", "ball",
    "--shape-gammas", "90", "--inertial-number", "0.2", "--threads", "1", "--quiet",
]  # fmt: skip


def made_up(factors, *, scatter=0.0, beds=3):
    """Runs of the default plates with forces of 3D-RFT, each bed's times its own factor; and their surfaces."""
    settings = BedPlatesSettings(shapes=())
    asked = plates.pushes(settings)
    surfaces = {push.name: plates.plate_of(push.beta, settings.side, settings.thickness).pieces for push in asked}
    shares = 1 + scatter * np.random.default_rng(3).standard_normal(beds)
    runs = []
    for bed, share in enumerate(shares):
        for push in asked:
            run = {"bed": f"seed{bed}", "gamma": push.gamma, "beta": push.beta, "body": push.name}
            run["samples"] = [[depth, 0, 0, 0] for depth in (0.012, 0.016, 0.02)]
            force = share * predicted_force(factors, 0.5, run, surfaces[push.name])
            run["samples"] = [[row[0], *force] for row in run["samples"]]
            runs.append(run)
    return runs, surfaces


def test_plates_that_hardly_face_their_motion_and_mirror_images_are_left_out():
    asked = plates.pushes(BedPlatesSettings(betas=(-30.0, 0.0, 30.0, 90.0), gammas=(90.0, 0.0), shapes=()))
    assert [(push.gamma, push.beta) for push in asked] == [(90, 0), (90, 30), (0, 30), (0, 90)]


def test_a_plate_is_turned_as_its_angle_says():
    """The face whose normal is (sin beta, 0, -cos beta) is the largest that meets the grains."""
    for beta in (0.0, 30.0, 90.0, 120.0):
        shape = plates.plate_of(beta, 0.02, 0.001)
        normal = np.array([math.sin(math.radians(beta)), 0.0, -math.cos(math.radians(beta))])
        facing = shape.pieces.areas[shape.pieces.normals @ normal > 0.999].sum()
        assert facing == pytest.approx(0.02**2)
        assert shape.pieces.points[:, 2].min() == pytest.approx(shape.low, abs=0.002)


@pytest.mark.parametrize(
    ("factors", "terms"), [((3e5,) * 3 + (0.0,), 1), ((3e5,) * 3 + (1.7,), 2), ((3e5, 2.4e5, 3.9e5, 0.0), 3)]
)
def test_made_up_forces_give_their_factors_back(factors, terms):
    runs, surfaces = made_up(factors)
    fit = fit_of(runs, surfaces, 0.5, terms=terms)
    assert fit.factors == pytest.approx(factors, rel=1e-4)
    assert fit.unseen < 1e-3 and max(fit.stds) < 1e-3 * factors[0]


def test_beds_that_differ_as_a_whole_give_the_standard_error_of_their_mean():
    """All forces of a bed times one factor: the scale's std is that of the mean of the factors, s / sqrt(n)."""
    runs, surfaces = made_up((3e5, 3e5, 3e5, 0.0), scatter=0.1, beds=5)
    factors = 1 + 0.1 * np.random.default_rng(3).standard_normal(5)
    fit = fit_of(runs, surfaces, 0.5, terms=1)
    assert fit.factors[0] == pytest.approx(3e5 * factors.mean(), rel=1e-6)
    assert fit.stds[0] == pytest.approx(3e5 * factors.std(ddof=1) / math.sqrt(5), rel=1e-6)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--betas", "0", "--gammas", "90"], "betas"),
        (["--gammas", "10"], "gammas"),
        (["--betas", "30", "30"], "betas"),
        (["--shapes", "none.stl"], "none.stl"),
        (["--side", "0.008"], "side"),
        (["--side", "0.04"], "size"),
        (["--depth", "0.045"], "depth"),
        (["--thickness", "0.02"], "thickness"),
    ],
)
def test_what_cannot_be_is_refused_before_any_bed_is_made(options, named, tmp_path, capsys):
    assert main(["bed", "test", "plates", *options, "--out", str(tmp_path / "run"), "--quiet"]) == BAD_INPUT
    assert named in capsys.readouterr().err
    assert not (tmp_path / "run" / "checkpoint").exists()


def test_the_force_on_a_foot_of_one_s_own_is_printed_and_bad_input_is_refused_by_name(tmp_path, capsys):
    """A cone of 60 degrees, tip first, by its closed form: xi alpha_z pi tan(b) / (3 cos(b)) z^3."""
    table = RftTable(
        format="hedgebed-rft/1", material="sand", source="made up", gravity=9.8, grain=0.004, bulk_density=1450.0,
        surface_friction=0.4, factors=(2e5, 2e5, 2e5, 0.0), stds=(1e4, 1e4, 1e4, 0.0),
        left_out=((1.9e5, 1.9e5, 1.9e5, 0.0), (2.1e5, 2.1e5, 2.1e5, 0.0)), unseen=0.1,
        depth=(0.01, 0.02), side=0.024, speed=0.1, plates=({"beta": 90.0, "gamma": 45.0}, {"beta": 0.0, "gamma": 90.0}),
        shape_errors=(0.2, 0.35),
    )  # fmt: skip
    path = tmp_path / "rft.json"
    path.write_text(table.to_json(), encoding="utf-8")

    def asked(*options):
        assert main(["bed", "foot", str(path), "cone", *options, "--json"]) == DONE
        return json.loads(capsys.readouterr().out)

    found = asked("--depth", "15mm")
    assert found["warnings"] == [] and found["shape_errors"] == [0.2, 0.35] and found["speed"] == 0.1
    assert asked("--depth", "0.015", "--gravity", "1e-3g")["force"][2] == pytest.approx(
        1e-3 * 9.80665 / 9.8 * found["force"][2]
    )
    for more, count in (
        (["0.015", "--gamma", "10"], 1), (["0.015", "--gamma", "-5"], 1), (["0.015", "--gamma", "50"], 0),
        (["34mm"], 1),
        (["0.015", "--size", "8mm"], 1),
    ):  # fmt: skip
        assert len(asked("--depth", *more)["warnings"]) == count
    half = math.radians(30.0)
    alpha = tractions([[math.cos(half), 0.0, -math.sin(half)]], [0.0, 0.0, -1.0], surface_friction=0.4)[0, 2]
    closed = 2e5 * alpha * math.pi * math.tan(half) / (3 * math.cos(half)) * 0.015**3
    assert found["force"][2] == pytest.approx(closed, rel=0.02)
    assert found["std"][2] == pytest.approx(0.05 * found["force"][2], rel=0.01)
    # The force grows with z^3: so the depth for a load, and the ends by 1.96 times beds (5 %) and law (20 %) together.
    # The surface is cut into rings, some 3 % of the depth high: that limits a small difference of depths.
    stands, share = asked("--load", str(found["force"][2])), 1.96 * math.hypot(0.05, 0.2)
    assert stands["depth"] == pytest.approx(0.015, rel=1e-4)
    assert stands["std"] == pytest.approx(0.015 * 0.05 / 3, rel=0.1)
    assert stands["low"] == pytest.approx(0.015 / (1 + share) ** (1 / 3), rel=0.02)
    assert stands["high"] == pytest.approx(0.015 / (1 - share) ** (1 / 3), rel=0.02)
    for wrong, named in (
        (["cone", "--depth", "-1"], "depth"), (["mud.stl", "--depth", "0.01"], "mud.stl"),
        (["cone", "--depth", "0.01", "--gamma", "100"], "gamma"),
        (["cone", "--depth", "0.01", "--size", "0.002"], "grain"),
        (["cone", "--depth", "0.01", "--size", "20"], "large"),
        (["cone", "--depth", "1"], "deep"), (["cone", "--depth", "15s"], "depth"),
        (["cone", "--depth", "0.01", "--out", "x"], "`> FILE`"),
        (["cone", "--depth", "0.01", "--zzz", "1"], "bed foot --help"),
        (["cone"], "--load"), (["cone", "--depth", "0.01", "--load", "1"], "--load"),
        (["cone", "--load", "-1"], "load"), (["cone", "--load", "1e6N"], "largest depth"),
        (["cone", "--load", "1", "--gamma", "45"], "gamma"),
    ):  # fmt: skip
        assert main(["bed", "foot", str(path), *wrong]) == BAD_INPUT
        assert named in capsys.readouterr().err
    assert main(["bed", "foot", str(tmp_path / "none.json"), "cone", "--depth", "0.01"]) == BAD_INPUT


def test_the_table_that_ships_is_the_kept_one():
    assert find_rft("sand").read_bytes() == (KEPT / "rft.json").read_bytes()
    assert read_rft("sand").material == "sand"


def test_forces_that_cancel_by_symmetry_are_printed_as_zero_and_others_with_95_per_cent(capsys):
    """A cylinder pushed straight down: round-off, some 1e-17 N, is no force. t of two degrees of freedom is 4.303."""
    options = ["bed", "foot", str(KEPT / "rft.json"), "cylinder", "--size", "16mm", "--depth", "1.4mm"]
    assert main([*options, "--json"]) == DONE
    error = json.loads(capsys.readouterr().out)["std"][2]
    assert main(options) == DONE
    printed = [line.split(" = ")[1] for line in capsys.readouterr().out.splitlines()[:3]]
    assert printed[:2] == ["0 N", "0 N"] and float(printed[2].split()[0]) > 0.1
    assert len(read_rft(KEPT / "rft.json").left_out) == 3
    assert float(printed[2].split()[2]) == pytest.approx(4.303 * error, rel=0.05)


def test_the_depth_for_a_load_is_printed_with_its_interval(capsys):
    """A flat foot of 16 mm under 0.5 N; the force at that depth is the load."""
    options = ["bed", "foot", str(KEPT / "rft.json"), "cylinder", "--size", "16mm"]
    assert main([*options, "--load", "0.5N"]) == DONE
    first = capsys.readouterr().out.splitlines()[0]
    depth, low, high = (float(word) for word in re.findall(r"[\d.]+", first.replace("95 %", "")))
    assert low < depth < high
    assert main([*options, "--depth", f"{depth}mm", "--json"]) == DONE
    assert json.loads(capsys.readouterr().out)["force"][2] == pytest.approx(0.5, rel=0.01)


def test_at_a_tenth_of_the_speed_kept_plates_bear_more_by_what_the_page_says():
    """The first bed of the kept table again: 1.15 and 1.32 times, within two std of a difference of two pushes."""
    kept = json.loads((KEPT / "result.json").read_text(encoding="utf-8"))["runs"]
    slow = json.loads((KEPT / "slow.json").read_text(encoding="utf-8"))["runs"]
    for run, more in zip(slow, (1.15, 1.32), strict=True):
        alike = [one for one in kept if (one["beta"], one["gamma"]) == (run["beta"], run["gamma"])]
        assert run["speed"] == pytest.approx(0.1 * alike[0]["speed"], rel=1e-3)
        assert (run["young"], run["time_step"]) == (alike[0]["young"], alike[0]["time_step"])
        forces = [np.linalg.norm(measured_force(one)) for one in alike]
        force = np.linalg.norm(measured_force(run))
        assert force / forces[0] == pytest.approx(more, abs=0.005)
        assert abs(force - forces[0]) < 2 * math.sqrt(2) * np.std(forces, ddof=1)


@pytest.mark.long
def test_one_small_bed_gives_a_table_that_predicts_a_ball(tmp_path):
    """Three grains across a plate: the signs are right, the files are there, and their force is the table's."""
    out = tmp_path / "run"
    assert main(["bed", "test", "plates", *SMALL, "--out", str(out)]) == DONE
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    down = next(row for row in result["plates"] if row["beta"] == 0)
    level = next(row for row in result["plates"] if row["beta"] == 90 and row["gamma"] == 0)
    assert down["force_z"] > 5 * abs(down["force_x"]) and level["force_x"] < 0
    table = read_rft(out / "rft.json")
    ball = result["shapes"][0]
    run = next(run for run in result["runs"] if run["shape"] == "ball")
    pieces = plates.shaped("ball", 0.012, 1.0).pieces
    force = np.mean([table.force(pieces, depth=row[0], direction=(0, 0, -1))[0][2] for row in run["samples"]])
    assert force == pytest.approx(ball["law_z"], rel=1e-6)
    assert (out / "rft_force.py").is_file() and (out / "figures" / "plates.png").is_file()
