"""`hedgebed compare` of runs in space: gaps by a known amount, grains beside the spring-damper, what is refused."""

import json
import math
import re
import shutil

import numpy as np
import pytest
from spatial_runs import CUBE, small_bed

from experiments.cli.main import main
from experiments.compare.experiment import numbers_until
from experiments.compare.spatial import _never_down, read_moved
from experiments.runs.folder import read_series, write_series
from experiments.spatial import experiment as spatial
from experiments.spatial.settings import SpatialSettings
from rigid.spatial.quaternions import from_turn, multiply

THROWN = {
    "surface": "sand", "gravity": 1.0, "turn": (0.3, 0.2, 0.0), "velocity": (0.05, 0.02, -0.15),
    "angular_velocity": (0.0, 1.0, 2.0), "duration": 0.03, "frame_count": 2,
}  # fmt: skip


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """One cube thrown onto the spring-damper and onto a small bed; it as moved by a known amount; a planar tumble."""
    home = tmp_path_factory.mktemp("runs")
    (home / "cube.toml").write_text(CUBE.read_text())
    thrown = THROWN | {"platform": str(home / "cube.toml")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda *_: None)
        patch.setattr("experiments.spatial.on_grains.SpatialOnBed.prepare", small_bed)
        patch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
        spatial.run(SpatialSettings(**thrown), home / "law")
        on_bed = {"ground": "bed", "bed_size": (0.14, 0.14, 0.05), "grain": 0.006, "young": 1e6, "max_overlap": 0.2}
        spatial.run(SpatialSettings(**thrown, **on_bed, threads=1, substeps=4), home / "bed")
        assert main(["tumble", "--duration", "0.05", "--quiet", "--out", str(home / "planar")]) == 0
    _move(home / "law", home / "moved")
    return home


SHIFT, TURN, FASTER = (2e-3, -1e-3, 3e-3), np.array([0.0, 0.0, 0.1]), 0.25


def _move(source, target):
    """The run as if it had drifted by SHIFT and turned by TURN besides until its end, 0.25 m/s faster at the end."""
    shutil.copytree(source, target)
    path = read_series(target / "trajectory.csv")
    share = path["t_s"] / path["t_s"][-1]
    for axis, away in zip("xyz", SHIFT, strict=True):
        path[f"{axis}_m"] = path[f"{axis}_m"] + share * away
    turns = np.column_stack([path[f"q{k}"] for k in range(4)])
    turned = np.array([multiply(from_turn(part * TURN), turn) for part, turn in zip(share, turns, strict=True)])
    path |= {f"q{k}": -turned[:, k] for k in range(4)}  # the other sign is the same attitude
    path["vy_m_s"] = path["vy_m_s"] + share * FASTER
    path["state"] = np.where(share > 0.75, "hop", path["state"])
    write_series(target / "trajectory.csv", path)
    feet = read_series(target / "series" / "feet.csv")
    for name in [name for name in feet if name.startswith("sinkage_")]:
        feet[name] = np.where(feet[name] > 0, feet[name] + 1e-3, 0.0)
    write_series(target / "series" / "feet.csv", feet)


def compared(runs, out, first, second, *more):
    assert main(["compare", str(runs / first), str(runs / second), "--quiet", "--out", str(out), *more]) == 0
    return json.loads((out / "result.json").read_text())


@pytest.mark.long
def test_the_gaps_of_a_run_moved_by_a_known_amount_are_that_amount(runs, tmp_path):
    result = compared(runs, tmp_path / "out", "law", "moved", "--no-pictures")
    gaps = {name: entry["value"] for name, entry in result["quantities"].items()}
    columns = read_series(tmp_path / "out" / "series" / "compared.csv")
    last = read_series(runs / "law" / "trajectory.csv")["t_s"][-1]
    share = columns["t_s"][-1] / last  # the grid ends within a millisecond of the run
    assert 1 - share < 1e-3 / last
    for axis, away in zip("xyz", SHIFT, strict=True):
        assert gaps[f"gap_{axis}_end"] == pytest.approx(share * away, rel=1e-6)
        assert gaps[f"gap_{axis}"] == pytest.approx(share * abs(away), rel=1e-6)
    assert gaps["gap_place_end"] == pytest.approx(share * np.linalg.norm(SHIFT), rel=1e-6)
    # Between rows an attitude is taken along the chord: of second order in what it turns in a row of 0.4 ms.
    assert gaps["gap_attitude_end"] == gaps["gap_attitude"] == pytest.approx(share * 0.1, rel=1e-4)
    assert columns["apart_rad"] == pytest.approx(0.1 * columns["t_s"] / last, abs=1e-5)
    assert gaps["gap_velocity"] == pytest.approx(share * FASTER, rel=1e-6) and gaps["gap_angular_velocity"] == 0.0
    assert gaps["gap_sinkage"] == pytest.approx(1e-3, rel=1e-3)
    path = read_series(runs / "law" / "trajectory.csv")
    late = columns["t_s"] > 0.75 * last
    states = path["state"][np.searchsorted(path["t_s"], columns["t_s"], side="right") - 1]
    assert gaps["same_state"] == pytest.approx(np.mean(~late | (states == "hop")), abs=0.04)
    turned = 2 * math.acos(abs(np.column_stack([path[f"q{k}"] for k in range(4)])[[0, -1]].prod(axis=0).sum()))
    assert columns["turn_rad_1"][-1] == pytest.approx(turned, rel=0.02)
    assert columns["turn_rad_1"][0] == columns["turn_rad_2"][0] == 0.0
    weight = result["weights"][0]
    assert weight == pytest.approx(0.1) and columns["lift_N_1"].max() > weight


@pytest.mark.long
def test_grains_and_spring_damper_stand_side_by_side_in_curves_and_flat_pictures(runs, tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_NO_OPENGL", "1")
    out = tmp_path / "both"
    result = compared(runs, out, "bed", "law")
    assert {"sand", "spring-damper"} <= {*result["title"].split()} and result["kind"] == "tumble spatial"
    assert any("attitudes are" in sentence for sentence in result["departures"]["sentences"])
    differs = {row["key"] for row in result["differs"]}
    assert {"ground", "substeps"} <= differs and not {"grain", "seed", "bed_size"} & differs
    rows = {row["name"]: row for row in result["compared"]}
    assert rows["impact_speed"]["difference"] is not None and rows["dissipated_friction"]["second"] is None
    columns = read_series(out / "series" / "compared.csv")
    for number, name in ((1, "bed"), (2, "law")):
        feet = read_series(runs / name / "series" / "feet.csv")
        told = {column.split("_")[1] for column in feet if column.startswith("normal_")}
        assert told == {column.split("_")[1] for column in columns if re.fullmatch(rf"load_\w+_N_{number}", column)}
        # All spikes together are the force upwards; of the books nothing is lost on the way.
        loads = sum(columns[f"load_{spike}_N_{number}"] for spike in told)
        assert loads == pytest.approx(columns[f"lift_N_{number}"], abs=2e-3)
        energy = columns[f"energy_J_{number}"] + columns[f"dissipated_J_{number}"] - columns[f"torque_work_J_{number}"]
        assert np.ptp(energy) < 5e-3 * 0.1 * 0.15**2
    page = (out / "report.html").read_text()
    assert page.count("data:image/png") >= 8 and "no OpenGL" in page and "Rotation and states" in page
    assert (out / "film.gif").exists()
    seen = {path.name for path in (out / "figures").glob("seen-*.png")}
    assert seen == {f"seen-{name}.png" for name in ("start", "middle", "end")}


@pytest.mark.long
def test_a_run_without_frames_has_its_curves_compared_and_says_why_there_is_no_picture(runs, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(runs / "moved", bare)
    shutil.rmtree(bare / "frames")
    compared(runs, tmp_path / "out", "law", str(bare))
    assert "(frame_count = 0)" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.long
@pytest.mark.parametrize(
    ("other", "said"),
    [
        ("planar", r"is of tumble spatial and .*planar' of tumble\. .*a run in space has an attitude"),
        ("footless", r"has no series/feet.csv: run it again, `hedgebed tumble spatial .*run.toml`"),
        ("older", r"trajectory.csv of .*older' has no state .*written by an older hedgebed.*: run it again"),
    ],
)
def test_what_cannot_be_compared_is_refused_by_name(runs, tmp_path, capsys, other, said):
    folder = runs / other
    if other != "planar":
        folder = tmp_path / other
        shutil.copytree(runs / "law", folder)
    if other == "footless":
        (folder / "series" / "feet.csv").unlink()
    if other == "older":
        path = read_series(folder / "trajectory.csv")
        del path["state"]
        write_series(folder / "trajectory.csv", path)
    assert main(["compare", str(runs / "law"), str(folder), "--out", str(tmp_path / "out")]) == 2
    assert re.search(said, " ".join(capsys.readouterr().err.split()))
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_numbers_of_a_run_in_space_until_a_time_within_it_are_those_of_its_series_until_then(runs):
    """At the end of the run itself they are its own; at 20 ms displacement and largest values are those of then."""
    result = json.loads((runs / "law" / "result.json").read_text())
    own = {name: entry["value"] for name, entry in result["quantities"].items()}
    moved = read_moved(runs / "law", result)
    assert all(
        numbers_until(0.03, moved, result, runs / "law")[name] == own[name] for name in ("max_speed", "tilt_end")
    )
    found = numbers_until(0.02, moved, result, runs / "law")
    path = moved.series
    until = path["t_s"] <= 0.02
    fall = np.interp(0.02, path["t_s"], path["z_m"]) - path["z_m"][0]
    assert found["displacement_z"] == pytest.approx(fall) and found["displacement_z"] != own["displacement_z"]
    speed = np.sqrt(sum(path[f"v{axis}_m_s"][until] ** 2 for axis in "xyz"))
    assert found["max_speed"] == pytest.approx(speed.max())
    assert math.cos(found["tilt_end"]) == pytest.approx(
        1 - 2 * float(np.interp(0.02, path["t_s"], path["q1"] ** 2 + path["q2"] ** 2)), abs=1e-6
    )
    touch = own["first_touch"]
    assert found["first_touch"] == (touch if touch is not None and touch <= 0.02 else None)


def test_that_one_of_two_never_touches_is_said_and_of_both_or_none_nothing():
    hit, none = np.array([0.0, 0.2, 0.0]), np.zeros(3)
    for lifts, said in (
        ((none, hit), "On law the platform touches nothing"),
        ((hit, none), "On bed the platform touches nothing"),
        ((hit, hit), ""),
        ((none, none), ""),
    ):
        columns = {f"lift_N_{number}": lift for number, lift in enumerate(lifts, 1)}
        assert " ".join(_never_down(columns, ("law", "bed"))).startswith(said)
        assert len(_never_down(columns, ("law", "bed"))) == int(bool(said))
