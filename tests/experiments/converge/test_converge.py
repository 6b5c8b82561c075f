"""A sweep end to end on stand-in beds whose stiffness is known: design, order, restart, errors, what is refused."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fake_bed import FakeBed
from golden import golden
from pydantic import ValidationError

from dem.grains.materials import material
from experiments.cli.main import main
from experiments.converge import experiment as converge
from experiments.converge.analysis import numbers_of, two_finest
from experiments.converge.design import affordable, inertial_number, members_of, variants_of
from experiments.converge.result import doubts, plan_told
from experiments.converge.settings import ConvergeSettings
from experiments.penetrate import beds
from experiments.penetrate import experiment as penetrate
from experiments.penetrate.result import SHIPPED_RESULT
from experiments.pool.tasks import carry_out, done_before
from experiments.runs.folder import RunFolder
from experiments.runs.headline import headline_of
from experiments.runs.progress import Progress
from experiments.runs.registry import EXPERIMENTS
from experiments.runs.result import Result, quantity
from vis.report import write_report

GRAINS = replace(material("sand"), name="made-up", friction=0.5, rolling_friction=0.2)
TIP, STEP = 0.012, 5e-5
QUICK = {
    "tip_diameter": TIP,
    "bed_size": (0.06, 0.06, 0.04),
    "grain": 0.0024,
    "seeds": (1, 2, 3),
    "speeds": (0.2, 0.8),
    "drop_speeds": (0.1,),
    "mass": 0.3,
    "load": 0.4,
    "depth": 0.01,
    "young": 2e7,
    "ratios": (5.0, 8.0, 10.0),
    "widths": (8.0,),
    "bed_depths": (),
    "overlaps": (0.02,),
    "paces": (0.5,),
    "life_grain": 0.00024,
    "substeps": 10,
}
STIFF, SLOPE, WIDER, RATE = 100.0, 300.0, 4.0, 0.5
"""K of the stand-in beds: 100 N/m + 300 d / D, 4 N/m less where they are wider, and some N/m by their seed."""
BY_SEED = {1: -2.0, 2: 0.0, 3: 2.0}


def hard(settings, seed):
    narrow = settings.bed_size[0] < 0.09
    return STIFF + SLOPE * settings.grain / TIP - (0.0 if narrow else WIDER) + BY_SEED[seed]


@pytest.fixture
def fake(monkeypatch):
    """Beds whose K and C are known; the list of those that were made."""
    made = []

    def prepare(settings, seed, young, progress):
        made.append((settings.grain, settings.bed_size[0], seed))
        return FakeBed(
            size=settings.bed_size, time_step=STEP, seed=seed, hardness=hard(settings, seed), rate=RATE, unload=4000.0,
        )  # fmt: skip

    monkeypatch.setattr(beds, "prepare_bed", prepare)
    monkeypatch.setattr(beds, "find_material", lambda settings: GRAINS)
    monkeypatch.setattr(beds, "bed_step", lambda settings, young: STEP)
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda *given: None)
    return made


def made_up(settings):
    """What `penetrate` would say of a bed of this K and C, as far as a sweep reads it."""
    (seed,) = settings.seeds
    across, apart = settings.grain / TIP, BY_SEED[seed]
    stiffness, damping, deep = hard(settings, seed), RATE + 0.1 * across * apart, settings.depth
    slow = min(settings.speeds)
    runs = []
    for speed in settings.speeds:
        z = np.linspace(0.0, deep, 200)
        force = stiffness * z + damping * speed
        zz, zf, vf, ff = (float(np.mean(product)) for product in (z * z, z * force, speed * force, force * force))
        moments = {"zz": zz, "zv": speed * deep / 2, "vv": speed**2, "zf": zf, "vf": vf, "ff": ff}
        work = {"work_in": {"value": float(np.mean(force)) * deep}}
        runs.append({"id": f"{seed}-{speed}", "kind": "driven", "speed": speed, "moments": moments, "quantities": work})
    bands = [{"speed": slow, "bed_force": stiffness * deep * (k + 0.5) / 4} for k in range(4)]
    told = {
        "sinkage_dem": 0.4 / stiffness,
        "packing_fraction": 0.58 + 0.001 * apart,
        "grain_count": settings.grain_count,
    }
    quantities = {
        name: quantity(value, "1") for name, value in (told | {"max_overlap": 0.03, "time_step": 1e-5}).items()
    }
    return Result.make(
        "penetrate", title="made up", quantities=quantities, runs=runs, departures={"sentences": [], "table": bands}
    )


@pytest.fixture
def swift(fake, monkeypatch):
    """Members are made up; the list of those that were."""
    made = []

    def compute(settings, folder, progress):
        made.append(folder.path.name)
        result = made_up(settings)
        folder.write_result(result)
        return result

    monkeypatch.setattr(penetrate, "compute", compute)
    return made


def settings_of(**changed):
    return ConvergeSettings(**(QUICK | changed))


def sweep(folder, **changed):
    return converge.run(settings_of(**changed), folder)


# What is made -----------------------------------------------------------------------------------------------------


def test_members_differ_from_the_base_in_one_thing():
    base, *others = variants_of(settings_of())
    alike = ("material", "depth", "load", "mass", "tip", "hold", "drop_speeds", "gravity", "substeps")
    assert [variant.id for variant in others] == ["grain-8", "grain-10", "width-8", "overlap-0.02", "speed-0.5"]
    for variant in others:
        own = variant.settings
        assert all(getattr(own, key) == getattr(base.settings, key) for key in alike)
        assert (own.young != base.settings.young) == (variant.what == "overlap")
        assert (own.bed_size != base.settings.bed_size) == (variant.what == "width")
        assert (own.grain != base.settings.grain) == (variant.what == "grain")
    stiffer = next(variant for variant in others if variant.what == "overlap").settings
    assert stiffer.young == pytest.approx(2e7 * 2**1.5)  # Hertz: F goes with E overlap^1.5


def test_grains_of_every_size_are_driven_at_one_inertial_number_and_another_pace_at_its_share():
    base, *others = variants_of(settings_of())
    own = [inertial_number(base.settings, speed) for speed in base.settings.speeds]
    for variant in others:
        factor = 0.5 if variant.what == "speed" else 1.0
        found = [inertial_number(variant.settings, speed) for speed in variant.settings.speeds]
        assert found == pytest.approx([factor * number for number in own])
    # The speeds that were asked for are those of the finest grains.
    assert next(v for v in others if v.id == "grain-10").settings.speeds == pytest.approx((0.2, 0.8))
    assert base.settings.speeds == pytest.approx((0.1, 0.4))


def test_the_inertial_number_is_the_rate_of_shear_times_the_time_in_which_a_grain_falls_its_size():
    s = settings_of()
    pressure, density = 0.6 * 2650.0 * s.gravity * TIP, 2650.0
    expected = 0.3 / TIP * s.grain * math.sqrt(density / pressure)
    assert inertial_number(s, 0.3) == pytest.approx(expected)


def test_the_cheapest_news_comes_first_and_a_budget_leaves_out_the_dearest():
    members = members_of(settings_of(), variants_of(settings_of()))
    keys = [member.core_hours * member.place / member.tells for member in members]
    assert keys == sorted(keys) and members[0].id == "base-seed1" and len(members) == 6 * 3
    for variant in {member.variant for member in members}:
        assert [member.seed for member in members if member.variant == variant] == [1, 2, 3]
    half = 0.5 * sum(member.core_hours for member in members)
    chosen = affordable(members, half)
    assert sum(member.core_hours for member in chosen) <= half
    assert chosen == members[: len(chosen)] and 3 < len(chosen) < len(members)


def test_a_member_is_found_again_by_its_settings_in_another_sweep():
    first = {m.id: m.folder for m in members_of(settings_of(), variants_of(settings_of()))}
    wider = settings_of(grain=TIP / 8, ratios=(5.0, 8.0), speed_grain=TIP / 10, threads=1)
    again = {m.id: m.folder for m in members_of(wider, variants_of(wider))}
    assert again["base-seed2"] == first["grain-8-seed2"]
    assert again["grain-5-seed2"] == first["base-seed2"]
    harder = settings_of(spike_friction=0.4)
    other = {m.id: m.folder for m in members_of(harder, variants_of(harder))}
    assert not set(other.values()) & set(first.values())


# What comes out ---------------------------------------------------------------------------------------------------


def test_stiffness_is_told_at_the_real_grain_with_three_errors(swift, tmp_path):
    result = sweep(tmp_path / "run")
    assert Result.load(tmp_path / "run") == result and result["status"] == "done"
    assert len(result["members"]) == len(swift) == 18
    entry, told = result["quantities"]["stiffness"], result["convergence"]["stiffness"]
    truth = STIFF + SLOPE * 0.00024 / TIP
    assert entry["value"] == pytest.approx(truth, abs=0.05)
    assert entry["std"] == pytest.approx(2.0, rel=0.01)  # between the beds of the finest grains: -2, 0, 2
    assert entry["chance"] > 0 and entry["total"] == pytest.approx(
        entry["chance"] + entry["grain_size"] + entry["rest"]
    )
    assert told["without_coarsest"] == pytest.approx(truth, abs=0.1)  # the truth is straight
    assert told["slope"] == pytest.approx(SLOPE, rel=1e-3)
    (wide,) = [one for one in told["differences"] if one["what"] == "width"]
    assert (wide["mean"], wide["half"]) == (pytest.approx(-WIDER, abs=0.02), pytest.approx(0.0, abs=0.05))
    assert told["unknown"] == ["depth"]
    base = told["sizes"][-1]["mean"]  # the coarsest grains are the base's
    assert entry["rest"] >= (WIDER - 0.02) * truth / base  # a share of the base's, taken of the value
    assert result["quantities"]["damping"]["value"] == pytest.approx(RATE, rel=0.01)
    standing = result["quantities"]["stiffness_standing"]
    assert standing["value"] == pytest.approx(0.4 / result["quantities"]["sinkage"]["value"])


def test_every_member_is_an_ordinary_run_of_penetrate(fake, tmp_path):
    result = sweep(tmp_path / "run", ratios=(5.0,), widths=(), overlaps=(), paces=(), seeds=(1, 2))
    for member in result["members"]:
        own = RunFolder.open(tmp_path / "run" / "members" / member["folder"])
        assert (own.command, own.status) == ("penetrate", "done")
        assert own.settings["seeds"] == [member["seed"]]
        assert own.read_result()["experiment"] == "penetrate"
        assert penetrate.resume(own.path)["quantities"] == own.read_result()["quantities"]


def test_a_sweep_that_is_stopped_has_a_result_and_goes_on_without_repeating(swift, tmp_path, monkeypatch):
    compute, made = penetrate.compute, swift

    def until_the_fifth(settings, folder, progress):
        if len(made) == 4:
            made.append(folder.path.name)
            raise KeyboardInterrupt
        return compute(settings, folder, progress)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(penetrate, "compute", until_the_fifth)
        sweep(tmp_path / "run")
    part = Result.load(tmp_path / "run")
    assert (part["status"], len(part["members"])) == ("stopped", 4)
    assert part["convergence"]["stiffness"]["unknown"]
    whole = converge.resume(tmp_path / "run")
    assert len(made) == 5 + 14 and made[4] == made[5] and len(set(made)) == 18
    assert whole["quantities"] == sweep(tmp_path / "other")["quantities"]
    assert len(made) == 19 + 18
    converge.resume(tmp_path / "run")
    assert len(made) == 19 + 18


def test_fewer_runs_give_wider_errors_and_say_what_is_missing(swift, tmp_path):
    whole = sweep(tmp_path / "whole")["convergence"]["stiffness"]
    part = sweep(tmp_path / "part", seeds=(1, 3), ratios=(5.0, 8.0))["convergence"]["stiffness"]
    assert part["chance"] > whole["chance"] and part["grain"] > whole["grain"]
    alone = sweep(tmp_path / "alone", seeds=(1,), ratios=(5.0,), widths=(), overlaps=(), paces=())
    told = alone["convergence"]["stiffness"]
    assert (told["chance"], told["grain"], told["rest"], told["total"]) == (None,) * 4
    assert told["unknown"] == ["chance", "grain size", "width", "depth", "overlap", "speed"]


def test_a_member_that_fails_is_named_and_the_others_are_made(swift, tmp_path, monkeypatch):
    compute = penetrate.compute

    def one_fails(settings, folder, progress):
        if settings.bed_size[0] > 0.09 and settings.seeds == (2,):
            raise RuntimeError("an overlap of 7 %")
        return compute(settings, folder, progress)

    with monkeypatch.context() as patch:
        patch.setattr(penetrate, "compute", one_fails)
        with pytest.raises(RuntimeError, match=r"1 of 18 runs have no result, as width-8-seed2: .*an overlap of 7 %"):
            sweep(tmp_path / "run")
        assert main(["resume", str(tmp_path / "run"), "--quiet"]) == 1  # it fails again
    result = Result.load(tmp_path / "run")
    assert (result["status"], len(result["members"])) == ("stopped", 17)
    assert any("width-8-seed2" in text and "7 %" in text for text in result["warnings"])
    assert converge.resume(tmp_path / "run")["status"] == "done"  # tried again


def test_a_sweep_of_which_every_member_fails_is_no_result(swift, tmp_path, monkeypatch):
    def fails(*given):
        raise RuntimeError("not at rest")

    monkeypatch.setattr(penetrate, "compute", fails)
    with pytest.raises(RuntimeError, match="not at rest"):
        sweep(tmp_path / "run", ratios=(5.0,), widths=(), overlaps=(), paces=(), seeds=(1,))


def test_sweeps_that_share_a_folder_of_members_share_their_runs(swift, tmp_path):
    sweep(tmp_path / "few", members=str(tmp_path / "kept"), ratios=(5.0, 10.0), seeds=(1, 2))
    before = len(swift)
    sweep(tmp_path / "more", members=str(tmp_path / "kept"), seeds=(1, 2))
    assert len(swift) - before == 2  # the beds of the one size that is new


# What is said -----------------------------------------------------------------------------------------------------


HOLD = """
import sys, time
from filelock import FileLock
with FileLock(sys.argv[1]):
    open(sys.argv[1], "w").write("4711")
    print("held", flush=True)
    time.sleep(0.3)
"""


def test_a_member_that_another_process_has_is_waited_for_and_not_made_twice(swift, tmp_path):
    task, told = members_of(settings_of(), variants_of(settings_of()))[0].planned(tmp_path).task, []
    progress = Progress()
    progress.message = told.append
    task.path.mkdir()
    with subprocess.Popen([sys.executable, "-c", HOLD, task.path / "lock"], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        first = carry_out(task, float, progress)
        assert other.wait() == 0
    assert len(told) == 1 and "process 4711" in told[0] and len(swift) == 1
    assert first.result == done_before(task).result == carry_out(task, float, progress).result and len(swift) == 1


def finding(fine, coarse):
    return SimpleNamespace(sizes=(SimpleNamespace(x=0.1, values=fine), SimpleNamespace(x=0.125, values=coarse)))


@pytest.mark.parametrize(
    ("coarse", "verdict"),
    [((10.1, 10.1, 10.2), "yes"), ((12.0, 12.1, 12.0), "no"), ((10.4, 9.0, 11.5), "open"), ((12.0,), "open")],
)
def test_the_two_finest_agree_where_all_of_the_interval_is_within_five_per_cent(coarse, verdict):
    assert two_finest(finding((10.0, 10.1, 9.9), coarse))["verdict"] == verdict


def test_stiffness_and_damping_are_those_of_penetrate_where_neither_is_at_its_bound():
    shipped = Result.load(SHIPPED_RESULT)
    found = numbers_of(shipped)
    for name in ("stiffness", "damping"):
        assert found[name] == pytest.approx(shipped["quantities"][name]["value"], rel=1e-6)


def test_what_is_told_before_and_after(swift, tmp_path):
    settings = settings_of(seeds=(1, 2))
    members = members_of(settings, variants_of(settings))
    chosen = affordable(members, 0.6 * sum(member.core_hours for member in members))
    result = sweep(tmp_path / "run", seeds=(1, 2))
    lines = headline_of(EXPERIMENTS["converge"], result)
    said = {
        "before": [*plan_told(settings.model_copy(update={"budget": 1.0}), chosen, members[len(chosen) :])],
        "doubts": [*doubts(settings.model_copy(update={"widths": ()}))],
        "after": [*result["departures"]["sentences"], *result["warnings"]],
        "headline": [" | ".join(row) for row in (lines.head, *lines.rows)],
    }
    golden("converge/told", said)


def test_the_report_has_a_figure_of_each_quantity(swift, tmp_path):
    result = sweep(tmp_path / "run")
    report = write_report(tmp_path / "run")
    drawn = {path.stem.removeprefix("convergence-") for path in (tmp_path / "run" / "figures").glob("*.png")}
    assert drawn == set(result["convergence"]) and report.stat().st_size > 100_000


def test_the_report_of_a_first_bed_alone_is_drawn(swift, tmp_path):
    sweep(tmp_path / "run", seeds=(1,), ratios=(5.0,), widths=(), overlaps=(), paces=())
    assert write_report(tmp_path / "run").is_file()


# What is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"ratios": (4.0,)}, "ratios has 4.*5 is sufficient.*h of one core"),
        ({"widths": (3.0,)}, "widths has 3.*4 is sufficient.*h of one core"),
        ({"bed_depths": (1.5,)}, "bed_depths has 1.5.*h of one core"),
        ({"budget": 1e-9}, "budget = 1e-09 h.*at least"),
    ],
)
def test_a_list_that_holds_what_cannot_be_is_refused_with_what_would_do_and_its_cost(changed, words):
    with pytest.raises(ValueError, match=words):
        converge.check(settings_of(**changed))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"bed_size": (0.04, 0.06, 0.04)}, "bed_size.*too narrow.*0.048 m.*times"),
        ({"grain": 0.003}, "4 grains across.*0.0024 m.*times"),
        ({"ratios": (5.0, 5.0)}, "ratios.*twice"),
        ({"reference": "shipped"}, "reference"),
        ({"time_step": 1e-6}, "time_step"),
        ({"life_grain": 0.002}, "life_grain.*0.0012"),
        ({"ground": "spring-damper"}, "ground|model"),
        ({"set_down": False}, "set_down"),
    ],
)
def test_settings_that_no_sweep_can_have_are_refused_by_name(changed, words):
    with pytest.raises(ValidationError, match=words):
        settings_of(**changed)


@pytest.mark.long
def test_a_sweep_on_real_grains_ends_with_a_number_and_its_errors(tmp_path):
    # 216 to 512 grains: far too few to mean anything, enough to go through all of it.
    result = converge.run(
        ConvergeSettings(
            bed_size=(0.03, 0.03, 0.0254), grain=0.004, tip_diameter=0.0075, shaft_length=0.03, allow_coarse=True,
            seeds=(1, 2), speeds=(0.2, 0.4), depth=0.006, hold=0.0, load=0.1, drop_speeds=(), rest_time=0.01,
            ratios=(2.0, 2.4), widths=(), bed_depths=(), overlaps=(), paces=(0.5,), young=2e7, cache=False,
        ),
        tmp_path / "run",
    )  # fmt: skip
    assert result["status"] == "done" and len(result["members"]) == 8
    told = result["convergence"]["stiffness"]
    assert len(told["sizes"]) == 3 and told["chance"] > 0 and told["unknown"] == ["width", "depth", "overlap"]
    bound = 2 * ConvergeSettings.model_fields["max_overlap"].default  # at which a member ends
    assert all(0 < member["quantities"]["max_overlap"] <= bound for member in result["members"])
    assert (tmp_path / "run" / "report.html").is_file()
    assert json.loads((tmp_path / "run" / "cost.json").read_text())
