"""`hedgebed paper`: which trials it makes, what it claims of the text, and the whole of it within a minute."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from types import SimpleNamespace

import numpy as np
import pytest
from golden import golden
from matplotlib.colors import to_hex

import experiments
from experiments.cli.main import main
from experiments.paper.claims import Trials, claims, friction_of_a_rigid_pivot
from experiments.paper.evidence import RIVALS, evidence, nats, rival_trials
from experiments.paper.experiment import plan_jobs, run
from experiments.paper.grains import angles_of_beds, kept_angles, packed_angles, spring_angles
from experiments.paper.settings import PaperSettings
from experiments.paper.transitions import slip_before_hop
from experiments.platform.surfaces import find_surface
from experiments.runs.folder import RunFolder
from experiments.tumble.settings import TumbleSettings
from experiments.tumble.trial import plan_tumble
from rigid.planar.simulate import simulate
from vis.page.plots import BED, MODEL
from vis.paper.figures import PaperRun, figure_5, figure_signs

RESULTS = Path(experiments.__file__).parents[1] / "docs" / "results"

LEGEND = (
    "grains of sand: mean of three to five beds, 95 % (marks hide ± 2.3°)",
    "other materials, grains of sand-weak: one bed each",
)


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
    assert stiffnesses[1:] == [77.8, find_surface("jsc1a").stiffness]
    at = {(job.varied["stiffness"], job.varied["rebound"]): job.trial for job in jobs if job.varied["stiffness"]}
    corners = {
        (stiffness, rebound): math.degrees(
            simulate(at[stiffness, rebound], duration=2.0, sample_interval=5e-3).trajectory_angle
        )
        for stiffness in (stiffnesses[0], stiffnesses[-1])
        for rebound in (0.05, 1.0)
    }
    assert [corner for corner, angle in corners.items() if angle < 0] == [(stiffnesses[0], 0.05)]


def test_low_torque_on_brick_starts_at_about_22_degrees_and_the_brake_slips_at_once(small):
    cases = {(c["surface"], c["torque"], c["variant"]): c for c in result_of(small)["cases"]}
    angle = math.degrees(cases["brick", 0.125, "nominal"]["trajectory_angle"])
    # A pure pivot starts at pi/8 and its chord after 10 mm points at pi/8 - asin(0.005 / 0.2) = 21.07 degrees.
    assert angle == pytest.approx(22.5 - math.degrees(math.asin(0.005 / 0.2)), abs=1.0)
    assert math.degrees(cases["brick", 6.0, "nominal"]["transition_angle_slip"]) == pytest.approx(0.0, abs=0.1)


def test_claims_say_what_is_stated_what_came_out_and_whether_it_is_met(small):
    claims = result_of(small)["claims"]
    assert all(claim["quote"] and claim["compared"] and claim["ours"] and claim["judged_by"] for claim in claims)
    (at_once,) = [claim for claim in claims if claim["quote"].startswith("begins")]
    assert at_once["met"] is True and at_once["ours"].startswith("0.0 ")
    # mu_d is the paper's, an input; counts are of all 24 experiments, which these are not
    assert [claim["met"] for claim in claims if claim["stated"] == "0.5"] == [None]
    counted = ("Most of", "Five experiments", "Four experiments")
    assert all(claim["met"] is None for claim in claims if claim["quote"].startswith(counted))
    judged = [claim for claim in claims if claim["met"] is not None]
    quantities = result_of(small)["quantities"]
    assert quantities["claims_compared"]["value"] == len(judged)
    assert quantities["claims_met"]["value"] == sum(claim["met"] for claim in judged)
    golden("paper/quotes", [f"{claim['quote']}: {claim['compared']}" for claim in claims])


def test_each_claim_is_told_under_a_torque_that_rises_too(small):
    claims = result_of(small)["claims"]
    assert all(set(claim["risen"]) == {"ours", "difference", "met"} for claim in claims)
    assert not any(case["variant"].startswith("torque") for case in result_of(small)["cases"])  # no case of the figures
    jobs = [job for job in plan_jobs(PaperSettings()) if job.kind == "risen"]
    assert len(jobs) == 16 and all(job.trial.effects[0].values["rise"] == 0.25 for job in jobs)
    assert not any(job.trial.actuator == "brake" for job in jobs)


def test_of_the_hops_the_count_is_compared_and_not_how_brief_they_are(small):
    claims = [claim for claim in result_of(small)["claims"] if "hop" in claim["quote"] or "video" in claim["quote"]]
    hops, filmed = claims
    assert hops["ours"] == "2 of 2" and hops["met"] is True
    assert filmed["met"] is None  # of the six cases there are two
    cases = {(c["surface"], c["torque"], c["variant"]): c for c in result_of(small)["cases"]}
    motor, brake = (cases["brick", torque, "nominal"]["launch"] for torque in (0.125, 6.0))
    assert motor["landed"] and motor["lasts"] == pytest.approx(0.65, abs=0.01)
    assert motor["height"] == pytest.approx(motor["vy"] ** 2 / (2 * 0.0085 * 9.80665), rel=1e-9)
    assert not brake["landed"] and brake["lasts"] > brake["time"]
    assert f"{brake['lasts']:.2f} s after {brake['time']:.2f} s of contact" in hops["note"]


def test_angles_on_grains_are_those_of_the_kept_results():
    kept = kept_angles()
    assert {(entry.surface, entry.rig, entry.torque) for entry in kept} == {
        (surface, rig, torque)
        for surface in ("sand", "jsc1a")
        for rig in (0.0085, 0.015)
        for torque in (0.125, 0.22, 6.0)
    }  # fmt: skip
    for entry in kept:
        result = json.loads((RESULTS / entry.case / "result.json").read_text())
        angle = math.degrees(result["quantities"]["trajectory_angle"]["value"])
        assert angle == pytest.approx(entry.angle, abs=0.05), entry.case
        assert (result["surface"], result["trial"]["torque"]["value"]) == (entry.surface, entry.torque)
        folder = RunFolder.open(RESULTS / entry.case)
        assert find_surface(folder.of_today(result)["surface"]).grains == entry.grains, entry.case


def test_angles_of_several_beds_are_those_of_the_kept_runs():
    with (RESULTS / "tumble-sand/runs.csv").open() as file:
        runs = [row for row in csv.DictReader(file) if float(row["width_mm"]) == 36.0]
    assert len(angles_of_beds()) == 5
    for entry in angles_of_beds():
        case = ("jsc-" if entry.surface == "jsc1a" else "") + ("brake" if entry.torque == 6 else f"{entry.torque:g}")
        alike = [row for row in runs if row["case"] == case and float(row["grain_mm"]) == entry.grain]
        assert [float(row["angle_deg"]) for row in alike] == entry.angles, case


def test_angles_at_the_density_of_jsc_1a_are_those_of_the_kept_runs():
    with (RESULTS / "tumble-sand" / "runs.csv").open(encoding="utf-8") as file:
        motor = [float(row["angle_deg"]) for row in csv.DictReader(file) if row["case"] == "jsc-packed-0.22"]
    lines = (RESULTS / "paper-signs" / "runs.jsonl").read_text(encoding="utf-8").splitlines()
    runs = [run for run in map(json.loads, lines) if (run["lever"], run["actuator"]) == ("jsc1a", "brake")]
    assert {entry.torque: entry.angles for entry in packed_angles()} == {
        0.22: motor, 6: [run["at_10mm"]["angle"] for run in runs]
    }  # fmt: skip


def test_the_error_of_the_spring_dampers_angle_is_that_of_the_page():
    (only,) = spring_angles()
    page = (RESULTS.parent / "notes" / "calibrate.md").read_text(encoding="utf-8")
    assert f"{only.angle} ± {only.std}" in page


def test_the_picture_of_the_signs_names_the_grains_of_its_data(small):
    """One bed each is of `sand-weak`, three beds are of `sand`; JSC-1A, which was not asked for, is not named."""
    drawn = []
    paper = PaperRun(
        SimpleNamespace(draw=lambda _, drawing, **about: drawn.append(drawing), folder=small, result=result_of(small))
    )
    figure_signs(paper)
    (figure,) = drawn
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words[0] == "spring-damper of sand"
    assert [text.replace("\n", " ") for text in words[3:5]] == list(LEGEND)
    assert "friction" in words[1] and "± 18°" in words[2]
    assert [text.get_text() for text in figure.axes[0].texts] == ["sand"]
    law, *bars_and_grains = (to_hex(entry.get_color()) for entry in figure.legends[0].get_lines())
    assert set(bars_and_grains[:2]) == {law}
    grains = bars_and_grains[2:]
    assert (law, set(grains)) == (MODEL.lower(), {BED.lower()})  # as in every figure
    marks = {line.get_marker(): to_hex(line.get_color()) for line in figure.axes[0].lines}
    assert (marks["o"], marks["s"]) == (law, grains[0])
    for entry in paper.result["kept_on_grains"]["one_bed"]:
        del entry["grains"]
    figure_signs(paper)
    assert drawn[1].legends[0].get_texts()[4].get_text().startswith("other materials, grains")


def test_the_picture_of_the_signs_says_where_its_grains_are_of_other_materials_only(small):
    drawn = []
    report = SimpleNamespace(
        draw=lambda _, drawing, **about: drawn.append(drawing), folder=small, result=result_of(small)
    )
    kept = report.result["kept_on_grains"]
    beds, kept["beds"] = kept["beds"], []
    figure_signs(PaperRun(report))
    (surface, only) = (text.get_text() for text in drawn[0].axes[0].texts)
    assert surface == "sand" and "sand-weak only" in only
    kept["beds"] = [{**beds[0], "angles": [1.0, 1.1, 0.9]}]
    figure_signs(PaperRun(report))
    assert [text.get_text() for text in drawn[1].axes[0].texts] == ["sand"]
    assert drawn[1].legends[0].get_texts()[3].get_text().endswith("hide ± 0.2°)")


def trials_of(*, kept=(), **angles):
    """All 24 experiments with made-up angles [degrees], by surface: of its motors, and of its brakes."""
    settings = PaperSettings()
    cases, trials = {}, {}
    trial = plan_tumble(TumbleSettings(rig=0.0085, torque=0.125)).trial
    for surface in settings.surfaces:
        for rig in settings.rigs:
            for torque in (*settings.motor_torques, *settings.brake_torques):
                motor, brake = angles.get(surface, angles["others"])
                angle = math.radians(brake if torque in settings.brake_torques else motor)
                case = {
                    "kind": "", "trajectory_angle": angle, "transition_angle_hop": 0.3, "transition_angle_slip": 0.0,
                    "transitions": [(0.0, "slip", 0.0), (1.0, "hop", 0.3)], "launch": None, "surface": surface,
                    "torque": torque,
                }  # fmt: skip
                for variant in ("low", "nominal", "high"):
                    cases[surface, rig, torque, variant] = case
                trials[surface, rig, torque] = trial
    return Trials(settings, cases, trials, kept)


def met(trials):
    """Whether the claims that count are met: by the first word of the quote, for hard ground, springs and grains."""
    found = {}
    for claim in claims(trials):
        found.setdefault(claim["quote"].split()[0], []).append(claim["met"])
    return found["Most"], found["Five"], found["Four"]


AS_THE_PAPER = {"others": (21.0, 60.0), "sand": (21.0, -3.0), "jsc1a": (20.0, -2.0)}


def test_experiments_as_the_paper_has_them_meet_its_counts_and_one_more_above_does_not():
    """Sixteen near 22.5 but one above; four brakes at 60 on hard ground, four below zero on grains."""
    trials = trials_of(**AS_THE_PAPER)
    place = ("steel", 0.0085, 0.22)
    trials.table[(*place, "nominal")] = trials.table[(*place, "nominal")] | {"trajectory_angle": math.radians(47.0)}
    assert met(trials) == ([True, True, None], [True, True, None], [True, None])  # on grains no case is kept
    place = ("brick", 0.015, 0.22)
    trials.table[(*place, "nominal")] = trials.table[(*place, "nominal")] | {"trajectory_angle": math.radians(30.0)}
    assert met(trials) == ([True, True, None], [False, True, None], [True, None])


def test_one_motor_that_leaves_downwards_contradicts_the_papers_four_negative_angles():
    kept = kept_angles()
    # Our sand's motors are downwards, JSC-1A's brakes are not; and no motor of either is within 5 degrees of 22.5.
    assert met(trials_of(kept=kept, **AS_THE_PAPER)) == ([True, True, False], [True, True, True], [True, False])
    right = [replace(entry, angle=-2.0 if entry.torque == 6.0 else 20.0) for entry in kept]
    assert met(trials_of(kept=right, **AS_THE_PAPER)) == ([True] * 3, [True] * 3, [True] * 2)
    one = [replace(entry, angle=-1.0) if entry.case == "grains1-sand-0.015-0.22" else entry for entry in right]
    assert met(trials_of(kept=one, **AS_THE_PAPER))[2] == [True, False]


def test_transition_angles_are_shown_with_bands_and_judged_once_measured_ones_are_given(tmp_path):
    settings = PaperSettings(
        rigs=(0.0085,), motor_torques=(0.22,), surfaces=("brick",), duration=1.0, brake_duration=0.2, sweep=False,
        workers=1, measured_angles=("brick-0.22-hop=19", "brick-6-slip=0", "brick-6-hop=14"),
    )  # fmt: skip
    run(settings, tmp_path / "a")
    claim = result_of(tmp_path / "a")["claims"][-1]
    assert "majority" in claim["quote"]
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
        if job.torque == 0.125 and job.kind in ("", "risen") and job.variant not in ("low", "high", "paper"):
            transitions = simulate(job.trial, duration=0.5).transitions
            first[job.kind] = next(state for _, state, _ in transitions if state != "stand")
    assert first == {"": "slip", "risen": "pivot"}


def test_the_likelihood_of_the_text_is_largest_for_experiments_as_it_has_them():
    as_it_has = {
        "low": [22.5] * 8, "brakes": [60.0] * 4, "largest": 60.0, "at_once": [True] * 2, "hops": [True] * 6,
        "pivots": True, "mu_s": True, "mu_d": True,
    }  # fmt: skip
    best = nats(**as_it_has)
    for changed in (
        {"low": [40.0] * 5 + [22.5] * 3}, {"low": [22.5] * 4 + [10.0] * 4}, {"brakes": [22.5] * 4}, {"largest": 76.0},
        {"at_once": [True, False]}, {"hops": [True] * 3 + [False] * 3}, {"pivots": False}, {"low": [None] * 8},
        {"mu_s": False}, {"mu_d": False},
    ):  # fmt: skip
        (key,) = changed
        other = nats(**(as_it_has | changed))
        assert sum(other.values()) < sum(best.values()), changed
        assert [name for name in best if other[name] != best[name]] == [
            {"low": "low torque", "at_once": "at once"}.get(key, key)
        ]
    # One of the sixteen exceeds, on hard ground or on grains, so that one costs little and a second much.
    one, two = (nats(**(as_it_has | {"low": [47.0] * n + [22.5] * (8 - n)}))["low torque"] for n in (1, 2))
    assert best["low torque"] - 1 < one and two < one - 2
    # By hand: two experiments that slip at once, each read right with 0.95; five of six hops of six that hop.
    assert best["at once"] == pytest.approx(2 * math.log(0.95))
    assert best["hops"] == pytest.approx(math.log(6 * 0.95**5 * 0.05))
    inside = math.erf(1 / math.sqrt(2))
    assert best["largest"] == pytest.approx(math.log(0.95 * inside + 0.05 / 3))


def test_every_rival_changes_what_it_names_and_a_number_that_must_be_just_right_pays():
    trial = plan_tumble(TumbleSettings(rig=0.0085, torque=0.125, surface="steel")).trial
    made = {name: other for name, other, _ in rival_trials(trial)}
    assert len(made) == sum(len(rival.values) for rival in RIVALS)
    same = [name for name, other in made.items() if other == trial]
    assert same == ["pivot-start 0.001"]  # the same platform, started otherwise
    brake = plan_tumble(TumbleSettings(rig=0.0085, torque=6.0, actuator="brake", wheel_speed_0=300.0)).trial
    assert not any(name.startswith("torque-rise") for name, _, _ in rival_trials(brake))
    assert evidence(PaperSettings(evidence=False), []) == evidence(PaperSettings(rigs=(0.0085,)), []) == {}


@pytest.mark.long
def test_a_torque_that_rises_explains_the_hard_surfaces_as_more_friction_does_and_a_step_does_not(tmp_path):
    """docs/tumble.md, What is missing: seven of eight low torques near 22.5 degrees, one beyond, a pivot first."""
    result = run(PaperSettings(sweep=False, workers=1, surfaces=("steel", "brick")), tmp_path / "a")
    rows = {row["id"]: row for row in result["evidence"]["rivals"]}
    step, rise = rows["step"]["best"], rows["torque-rise"]["best"]
    assert (step["near"], step["above"], step["pivots"]) == (4, 4, False)
    assert (rise["near"], rise["above"], rise["pivots"]) == (7, 1, True)
    assert rows["torque-rise"]["nats"] > rows["step"]["nats"] + 8
    assert max(rows, key=lambda id: rows[id]["nats"]) == "torque-rise"
    # Two frictions that the paper does not state do as much; were friction free, they would lead.
    for id, value in (("sliding-friction", 1.0), ("friction", 1.5)):
        best = max(rows[id]["values"], key=lambda entry: entry["nats"])
        assert (best["value"], best["near"], best["above"], best["pivots"]) == (value, 7, 1, True)
        assert rows[id]["apart"] > rows["torque-rise"]["apart"]
    others = [row["nats"] for id, row in rows.items() if id not in ("torque-rise", "sliding-friction", "friction")]
    assert max(others) < rows["torque-rise"]["nats"] - 3
    assert (tmp_path / "a" / "figures" / "evidence.png").exists()


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
    words_of_it = (f"{count} integrations", "all friction of sand: they are ours", "as the paper fixed it")
    for words in ("Figure 6", "Figure 7", "Figure 8", "not judged", "Statements of the text", *words_of_it):
        assert words in page
    assert not (small / "figures" / "figure5.png").exists()  # that one is of steel
    assert "http://" not in page and "https://" not in page


def test_the_picture_of_figure_5_names_surface_and_gravity():
    path = {"x_m": np.linspace(0.0, 0.02, 9), "y_m": np.linspace(0.18, 0.2, 9)}
    paper = SimpleNamespace(
        surfaces=["steel"], rigs=[0.0085, 0.015], torques=[0.22], colour=lambda torque: "k", case=lambda *of: {},
        rows=lambda case: (path, np.array(["slip"] * 9)), handles=list,
        draw=lambda key, drawing, **values: values["about"],
        on=lambda what, surfaces, rigs: f"{what}: {surfaces[0]}, {rigs[0]} g",
    )  # fmt: skip
    assert figure_5(paper).endswith("steel, 0.0085 g")


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
    for name in ("evidence", "figure5", "figure6", "figure7", "figure8", "sweep"):
        assert (tmp_path / "a" / "figures" / f"{name}.png").exists()
