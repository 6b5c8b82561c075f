"""`hedgebed paper`: which trials it makes, what it claims of the text, and the whole of it within a minute."""

import json
import math
from dataclasses import replace
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

import numpy as np
import pytest
from golden import golden

from experiments.cli.main import main
from experiments.paper.claims import friction_of_a_rigid_pivot
from experiments.paper.experiment import plan_jobs, run
from experiments.paper.settings import PaperSettings
from experiments.paper.transitions import slip_before_hop
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid.planar.simulate import simulate


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The folder of a short run: one gravity, one motor torque and the brake, two surfaces."""
    folder = tmp_path_factory.mktemp("paper") / "a"
    settings = PaperSettings(
        rigs=(0.0085,), motor_torques=(0.125,), surfaces=("brick", "sand"), duration=2.5, brake_duration=1.2,
        sweep=False, workers=1,
    )  # fmt: skip
    run(settings, folder)
    return folder


def result_of(folder):
    return json.loads((folder / "result.json").read_text())


def test_the_whole_is_two_gravities_three_torques_four_surfaces_with_bands_and_both_integrators():
    jobs = plan_jobs(PaperSettings())
    cases = {(job.rig, job.torque, job.surface) for job in jobs}
    assert len(cases) == 24
    for case in cases:
        variants = {job.variant: job for job in jobs if (job.rig, job.torque, job.surface) == case}
        assert {"nominal", "low", "high", "paper"} <= set(variants)
        mu = {name: (variants[name].trial.mu_s, variants[name].trial.mu_d) for name in ("low", "nominal", "high")}
        assert mu["low"] == pytest.approx([0.9 * value for value in mu["nominal"]])
        assert mu["high"] == pytest.approx([1.1 * value for value in mu["nominal"]])
        assert variants["paper"].method == "paper" and variants["low"].method == "located"
    assert {job.torque for job in jobs if job.trial.actuator == "brake"} == {6.0}


def test_the_sweep_halves_and_doubles_one_number_at_a_time():
    jobs = plan_jobs(PaperSettings())
    swept = [job for job in jobs if job.kind == "sweep"]
    assert {job.surface for job in swept} == {"steel", "brick"}
    nominal = {(j.rig, j.torque, j.surface): j.trial for j in jobs if j.variant == "nominal"}
    for job in swept:
        key, factor = job.varied["key"], job.varied["factor"]
        assert job.variant == f"{key} x{factor:g}" and factor in (0.5, 2.0)
        base = nominal[job.rig, job.torque, job.surface]
        assert job.trial == replace(base, **{key: factor * getattr(base, key)})


def test_sliding_friction_is_varied_up_to_the_static_one_everywhere_it_is_assumed():
    jobs = plan_jobs(PaperSettings())
    nominal = {(j.rig, j.torque, j.surface): j.trial for j in jobs if j.variant == "nominal"}
    sliding = [job for job in jobs if job.kind == "sliding"]
    for job in sliding:
        base = nominal[job.rig, job.torque, job.surface]
        assert job.trial == replace(base, mu_d=job.varied["ratio"] * base.mu_s)
    hard = {(s, t) for s in ("steel", "brick") for t in (0.125, 0.22, 6.0)}
    assert {(j.surface, j.torque) for j in sliding} == hard | {("sand", 6.0), ("jsc1a", 6.0)}
    assert {job.varied["ratio"] for job in sliding} == {0.6, 0.8, 1.0}


def test_a_brake_trial_on_grains_leaves_below_zero_where_the_ground_is_soft_and_gives_little_back():
    # docs/tumble.md: at 0.0085 g neither will do alone. Soft is the law's own default, 36.5 N/m a row, stiff JSC-1A's.
    jobs = [j for j in plan_jobs(PaperSettings(rigs=(0.0085,), surfaces=("sand",))) if j.kind == "grains"]
    assert {(j.varied["law"], j.varied["rebound"]) for j in jobs} == {
        ("spring-damper", 1.0), ("katsuragi-durian", 0.5), ("katsuragi-durian", 0.05), ("bekker", 0.05), ("rft", 0.05),
    }  # fmt: skip
    stiffnesses = sorted({job.varied["stiffness"] for job in jobs if job.varied["stiffness"] is not None})
    assert stiffnesses[1:] == [140.0, 150.0]
    at = {(job.varied["stiffness"], job.varied["rebound"]): job.trial for job in jobs if job.varied["stiffness"]}
    corners = {
        (stiffness, rebound): math.degrees(
            simulate(at[stiffness, rebound], duration=2.0, sample_interval=5e-3).trajectory_angle
        )
        for stiffness in (stiffnesses[0], 150.0)
        for rebound in (0.05, 1.0)
    }
    assert [corner for corner, angle in corners.items() if angle < 0] == [(stiffnesses[0], 0.05)]


def test_low_torque_on_brick_starts_at_about_22_degrees_and_the_brake_slips_at_once(small):
    cases = {(c["surface"], c["torque"], c["variant"]): c for c in result_of(small)["cases"]}
    angle = math.degrees(cases["brick", 0.125, "nominal"]["trajectory_angle"])
    # A pure pivot starts at pi/8 and its chord after 10 mm points at pi/8 - asin(0.005 / 0.2) = 21.07 degrees.
    assert angle == pytest.approx(22.5 - math.degrees(math.asin(0.005 / 0.2)), abs=1.0)
    assert math.degrees(cases["brick", 6.0, "nominal"]["transition_angle_slip"]) == pytest.approx(0.0, abs=0.1)


def test_claims_say_what_is_stated_what_came_out_and_whether_it_is_inside(small):
    claims = {claim["statement"]: claim for claim in result_of(small)["claims"]}
    low = claims["starts at about 22.5 degrees (brick, 0.0085 g, 0.125 N m)"]
    assert low["met"] is True and low["ours"].endswith("degrees") and low["difference"].startswith("-1.")
    negative = claims["on grains a brake trial sinks and leaves at a negative angle (sand, 0.0085 g, 6 N m)"]
    assert negative["met"] is False  # a spring-damper does not do what grains do, and the report says so
    about_60 = claims["the angle grows to about 60 degrees (brick, 0.0085 g, 6 N m)"]
    assert about_60["met"] is True
    golden("paper/notes", {"on grains": negative["note"], "about 60 degrees": about_60["note"]})
    compared = [claim for claim in claims.values() if claim["met"] is not None]
    quantities = result_of(small)["quantities"]
    assert quantities["claims_compared"]["value"] == len(compared)
    assert quantities["claims_met"]["value"] == sum(claim["met"] for claim in compared)


def test_a_hop_counts_as_brief_by_the_contact_before_it_and_brakes_do_not_count(small):
    hop = next(c for c in result_of(small)["claims"] if c["statement"].startswith("even a short tumble ends"))
    golden("paper/brief_hops", [hop["ours"], hop["judged_by"]])
    cases = {(c["surface"], c["torque"], c["variant"]): c for c in result_of(small)["cases"]}
    motor, brake = (cases["brick", torque, "nominal"]["launch"] for torque in (0.125, 6.0))
    assert motor["landed"] and motor["lasts"] == pytest.approx(0.65, abs=0.01) and motor["lasts"] < motor["time"]
    assert motor["height"] == pytest.approx(motor["vy"] ** 2 / (2 * 0.0085 * 9.80665), rel=1e-9)
    assert not brake["landed"] and brake["lasts"] > brake["time"]
    assert f"{brake['lasts']:.2f} s after {brake['time']:.2f} s of contact" in hop["note"]


def test_transition_angles_are_shown_with_bands_and_judged_once_measured_ones_are_given(tmp_path):
    settings = PaperSettings(
        rigs=(0.0085,), motor_torques=(0.22,), surfaces=("brick",), duration=1.0, brake_duration=0.2, sweep=False,
        workers=1, measured_angles=("brick-0.22-hop=19", "brick-6-slip=0", "brick-6-hop=14"),
    )  # fmt: skip
    run(settings, tmp_path / "a")
    claim = result_of(tmp_path / "a")["claims"][-1]
    # 15.35, 0 and 8.06 degrees: two of three within five.
    assert claim["met"] is True
    golden("paper/measured_angles", [claim["ours"], claim["note"]])


def test_the_slip_that_ends_in_a_hop_is_not_the_jerk_of_the_torque():
    states = [(0.0, "slip", 0.0), (0.05, "pivot", 0.001), (1.3, "slip", 0.2), (1.6, "hop", 0.35), (2.3, "slip", 0.8)]
    assert slip_before_hop({"transitions": states}) == 0.2
    assert slip_before_hop({"transitions": states[:3]}) is None
    assert slip_before_hop({"transitions": [(0.0, "pivot", 0.0), (1.0, "hop", 0.3)]}) is None


def test_the_numbers_hold_both_integrators_and_the_friction_band(small):
    cases = {(c["surface"], c["torque"], c["variant"]): c for c in result_of(small)["cases"]}
    for surface in ("brick", "sand"):
        for torque in (0.125, 6.0):
            four = [cases[surface, torque, variant] for variant in ("nominal", "low", "high", "paper")]
            # a step of 1 ms is of order 1 and was chosen by the paper: half a degree is ample on these cases
            assert abs(four[0]["trajectory_angle"] - four[3]["trajectory_angle"]) < math.radians(0.5)
    brake = [cases["brick", 6.0, variant]["trajectory_angle"] for variant in ("low", "nominal", "high")]
    assert brake[0] > brake[1] > brake[2]  # tan(angle) = m / (M_y mu_d): less friction, steeper


def test_steel_slips_at_once_under_a_step_of_the_torque_and_pivots_under_one_that_rises():
    jobs = [job for job in plan_jobs(PaperSettings(sweep=False)) if (job.surface, job.rig) == ("steel", 0.0085)]
    first = {}
    for job in jobs:
        if job.torque == 0.125 and job.variant in ("nominal", "torque rise 0.1 s"):
            transitions = simulate(job.trial, duration=0.5).transitions
            first[job.variant] = next(state for _, state, _ in transitions if state != "stand")
    assert first == {"nominal": "slip", "torque rise 0.1 s": "pivot"}


def test_a_hop_is_extrapolated_from_where_and_how_it_begins(small):
    case = next(
        c for c in result_of(small)["cases"] if (c["surface"], c["torque"], c["variant"]) == ("brick", 6.0, "nominal")
    )
    launch = case["launch"]
    rows = np.genfromtxt(small / case["series"], delimiter=",", skip_header=1, usecols=(0, 1, 2))
    later = rows[(rows[:, 0] > launch["time"]) & (rows[:, 0] < launch["time"] + launch["lasts"])]
    since = later[:, 0] - launch["time"]
    assert later[:, 1] == pytest.approx(launch["x"] + launch["vx"] * since, abs=1e-6)
    parabola = launch["y"] + launch["vy"] * since - 0.5 * launch["gravity"] * since**2
    assert later[:, 2] == pytest.approx(parabola, abs=1e-6)


def test_the_report_shows_the_figures_there_are_trials_for(small):
    page = (small / "report.html").read_text()
    count = result_of(small)["integrations"]
    words_of_it = (f"{count} integrations", "no friction of a tip that slides", "all friction of sand: they are ours")
    for words in ("Figure 6", "Figure 7", "Figure 8", "not comparable", "What the text states", *words_of_it):
        assert words in page
    assert not (small / "figures" / "figure5.png").exists()  # that one is of steel
    assert "http://" not in page and "https://" not in page


def test_the_friction_that_a_rigid_pivot_asks_for_solves_newtons_equations():
    trial = plan_tumble(TumbleSettings(rig=0.0085, torque=0.125)).trial
    gamma, length, heavy = math.pi / 8, trial.spike_length, trial.mass + trial.counterweight
    # Unknown alpha, F, N at the front tip, (l sin, -l cos) from the centre, clockwise positive:
    # x'' = l cos alpha, y'' = l sin alpha; m x'' = F; M_y y'' = N - W; J alpha = tau - l sin N - l cos F.
    sine, cosine = length * math.sin(gamma), length * math.cos(gamma)
    matrix = [[trial.mass * cosine, -1, 0], [heavy * sine, 0, -1], [trial.inertia, cosine, sine]]
    _, along, up = np.linalg.solve(matrix, [0, -trial.weight, trial.torque])
    assert friction_of_a_rigid_pivot(trial) == pytest.approx(along / up, rel=1e-12)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--surfaces", "steel", "snow"], ["surface = 'snow'"]),
        (["--rigs", "0.01", "0.01"], ["rigs", "twice"]),
        (["--friction-band", "1.5"], ["--friction-band = 1.5", "less than 1"]),
        (["--measured-angles", "brick-0.125"], ["measured_angles", "SURFACE-TORQUE-STATE=DEGREES"]),
        (["--measured-angles", "sand-6-hop=3"], ["sand-6-hop", "none of steel, brick"]),
        (["--motor-torques", "1"], ["torque = 1 N m", "motor"]),
        (["--motor-torques", "0.1", "--brake-torques", "0.1"], ["brake_torques", "motor_torques"]),
    ],
)
def test_bad_input_is_refused_by_name_and_leaves_no_folder(capsys, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    assert main(["paper", *options, "--out", "a"]) == 2
    text = capsys.readouterr().err
    assert all(words in text for words in said), text
    assert not Path("a").exists()


@pytest.mark.slow
def test_the_whole_paper_takes_less_than_a_minute_of_processor_time(tmp_path):
    def processor_time():  # of this process and of those it has started; the wall's depends on who else is there
        return sum(r.ru_utime + r.ru_stime for r in map(getrusage, (RUSAGE_SELF, RUSAGE_CHILDREN)))

    start = processor_time()
    result = run(PaperSettings(workers=2), tmp_path / "a")
    assert processor_time() - start < 60
    assert result["quantities"]["case_count"]["value"] == 24
    assert result["quantities"]["energy_residual"]["value"] < 1e-6
    for name in ("figure5", "figure6", "figure7", "figure8", "sweep"):
        assert (tmp_path / "a" / "figures" / f"{name}.png").exists()
