"""`hedgebed experiments`: the cases that ship are valid, what has a result is left alone, the rest is done and kept."""

import json
from pathlib import Path

import pytest

from experiments.cli.main import main
from experiments.pool import tasks
from experiments.runs.reading import find_case
from experiments.runs.registry import CASES
from experiments.suite import cases as suite
from experiments.suite import commands as suite_commands
from experiments.suite.cases import Cost, cost_of_tumble, keep
from experiments.tumble.settings import TumbleSettings
from rigid.digests import digest_of


def test_every_case_of_every_experiment_is_valid_and_found_by_its_name():
    found = suite.cases()
    assert {case.experiment for case in found} == set(suite.EXPERIMENTS)
    assert all(case.settings.ground == "bed" for case in found)
    assert find_case(Path(found[0].name), CASES) == found[0].path
    counts = {number: sum(case.experiment == number for case in found) for number in suite.EXPERIMENTS}
    assert counts == {1: 35, 2: 6, 3: 3, 4: 4, 5: 6, 6: 16}


@pytest.mark.long
def test_no_case_that_ships_is_refused():
    """The spring-damper's tips stay on the bed for as long as the case lasts, and whatever else is checked before."""
    refused = {case.name: cost for case in suite.cases() if isinstance(cost := suite.estimate(case), str)}
    assert not refused


def test_cases_that_can_share_a_bed_do():
    """What shapes a bed is the same, its modulus given: then `Bed.prepare` finds it in the cache."""
    shaping = ("bed_size", "grain", "spread", "young", "max_overlap", "seed")

    def beds(*names):
        return {tuple(getattr(case.settings, key) for key in shaping) for case in suite.cases(names)}

    for names, seeds in (
        (("grains1-sand", "grains5-landing"), 1), (("grains1-look", "grains5-look"), 3), (("grains3-row",), 3),
        (("grains6-trial",), 2), (("grains6-coarse", "grains1-coarse-sand"), 2),
        (("grains1-coarse-jsc1a",), 1),
        (("grains2-flight-1e-2-brake", "grains2-flight-1e-4-brake", "grains2-flight-1e-6-brake"), 1),
        (("grains1-sand-0.0085-0.22", "grains1-long-sand"), 1),
        (("grains1-overlap3",), 1),
    ):  # fmt: skip
        found = beds(*names)
        assert len(found) == len({bed[-1] for bed in found}) == seeds
        assert not any(None in bed for bed in found)


def test_a_bed_laid_end_to_end_costs_what_one_piece_of_it_does():
    """Its preparation, and with sleep the run too: as many grains are awake; there are three times as many."""
    piece, long = (suite.estimate(case) for case in suite.cases(("grains1-sand-0.0085-0.22", "grains1-long-sand")))
    if piece.grains > long.grains:
        piece, long = long, piece
    assert long.grains == pytest.approx(3 * piece.grains)
    assert (long.bed_seconds, long.run_seconds) == pytest.approx((piece.bed_seconds, piece.run_seconds))


def test_a_bed_that_is_tapped_denser_costs_its_taps_too():
    """17 taps to 0.6 and 9 to 0.57, of 0.0041 each from 0.534 on."""
    (case,) = suite.cases(("grains1-coarse-jsc1a-0.0085-0.22",))
    poured, tapped, denser = (
        cost_of_tumble(
            case.settings.model_copy(update={"bed_stages": ("rain:dry", *more, "stick", "level")})
        ).bed_seconds
        for more in ((), ("compact:0.57",), ("compact:0.6",))
    )
    assert (denser - poured) / (tapped - poured) == pytest.approx(17 / 9)


def test_a_case_with_a_result_costs_its_grain_steps_by_todays_rules_of_sleep(tmp_path):
    """Those of before 2026-11-26 computed 1.16 times fewer, 1.3 times while the platform was set down."""
    (case,) = suite.cases(("grains6-trial-0.125-seed1",))
    folder = tmp_path / case.name
    folder.mkdir()
    grains = {"grain_steps": 4e8, "grain_steps_lowering": 1e8, "grain_steps_all_awake": 3e9}
    (folder / "result.json").write_text(json.dumps({"grains": grains}))
    (folder / "run.toml").write_text("[settings]\nsleep = true\nsleep_pace = 4\n")
    without, now = suite.estimate(case), suite.estimate(case, tmp_path)
    assert suite.estimate(case, tmp_path / "nothing") == without
    assert (now.grain_steps, now.kept, without.kept) == (5e8, True, False)
    (folder / "run.toml").write_text("[settings]\nsleep = true\n")
    once = suite.estimate(case, tmp_path)
    assert once.grain_steps == pytest.approx(1.16 * 4e8 + 1.3 * 1e8)
    assert now.run_seconds < once.run_seconds < without.run_seconds


@pytest.fixture
def stubbed(monkeypatch, tmp_path):
    """Two cases of an hour and of a day; runs that write what a run writes."""
    chosen = [case for case in suite.cases() if case.name in ("grains1-sand-0.0085-0.22", "grains1-sand-0.015-brake")]
    seconds = {chosen[0].name: 3000.0, chosen[1].name: 9e4}
    monkeypatch.setattr(
        suite_commands, "cases", lambda names=(): [case for case in chosen if not names or case.name in names]
    )
    for module in (suite, suite_commands):
        monkeypatch.setattr(
            module, "estimate", lambda case, _: Cost(8e4, 1e-5, 100.0, seconds[case.name] - 100, 1e10, 1e5, 0)
        )
    calls = []

    def run(task, folder, progress):
        calls.append((task.name.rpartition("-")[0], folder.has_work))
        (folder.path / "checkpoint").mkdir(exist_ok=True)
        if len(calls) == 1:
            raise KeyboardInterrupt
        if len(calls) == 2:
            raise RuntimeError("overlap")
        folder.write_result({"title": "made up"})
        (folder.path / "trajectory.csv").write_text("t_s\n" + "\n".join(map(str, range(5000))) + "\n")
        folder.set_status("done")
        return tasks.done_before(task)

    monkeypatch.setattr(tasks, "_compute", run)
    where = ("--results", str(tmp_path / "results"), "--work", str(tmp_path / "work"))
    return calls, where, ("--workers", "1", "--quiet")


def test_what_has_no_result_is_done_gone_on_with_and_kept(stubbed, tmp_path, capsys):
    """Stopped the first time; fails the second, and is named in full then; the one of a day is left out."""
    calls, where, alone = stubbed
    name, long = "grains1-sand-0.0085-0.22", "grains1-sand-0.015-brake"
    assert main(["experiments", "run", *where, *alone]) == 3
    assert main(["experiments", "run", *where, *alone]) == 1
    assert "overlap" in capsys.readouterr().err
    assert calls == [(name, False), (name, True)]
    assert main(["experiments", "run", *where, *alone, name]) == 0
    assert len(calls) == 3
    kept = tmp_path / "results" / name
    assert sorted(path.name for path in kept.iterdir()) == ["cost.json", "result.json", "run.toml", "trajectory.csv"]
    assert json.loads((kept / "cost.json").read_text())["processor_time"] >= 0
    assert len((kept / "trajectory.csv").read_text().splitlines()) == 1 + 5000 // 3 + 1
    assert main(["experiments", "run", *where, *alone]) == 0 and len(calls) == 3
    capsys.readouterr()
    assert main(["experiments", "list", "--json", *where]) == 0
    rows = {row["case"]: row["standing"] for row in json.loads(capsys.readouterr().out)}
    assert rows == {name: "done", long: "too long"}
    assert main(["experiments", "run", long, *where, *alone]) == 0 and len(calls) == 4


def test_a_run_of_other_settings_or_code_is_not_kept_as_the_result(tmp_path, monkeypatch, unreported, capsys):
    """Done before with a torque of 0.2 N m; then the case has 0.15, then the code is another."""
    results, work = tmp_path / "results", tmp_path / "work"
    monkeypatch.setattr(suite_commands, "estimate", lambda case, _: Cost(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0))
    monkeypatch.setattr(suite, "estimate", suite_commands.estimate)

    def done(torque):
        settings = TumbleSettings(duration=0.1, torque=torque)
        case = suite.Case("grains1-made-up", Path("grains1-made-up.toml"), settings)
        monkeypatch.setattr(suite_commands, "cases", lambda names=(): [case])
        tokens = ["--results", str(results), "--work", str(work), "--workers", "1", "--quiet"]
        assert main(["experiments", "run", *tokens]) == 0
        kept = (results / case.name / "result.json").read_bytes()
        (results / case.name / "result.json").unlink()
        return kept, len(list(work.iterdir()))

    first, second = done(0.2), done(0.15)
    said = capsys.readouterr().err
    assert (first[1], second[1]) == (1, 2) and first[0] != second[0]
    assert f"{work}/grains1-made-up-" in said
    assert done(0.2) == (first[0], 2)
    monkeypatch.setattr(tasks, "code_of", lambda experiment: "other")
    assert done(0.2) == (first[0], 3)


def test_processes_that_cannot_be_are_refused_before_any_run(stubbed, capsys):
    calls, where, _ = stubbed
    for given, word in ((("--workers", "0"), "workers = 0"), (("--workers", "2", "--scheduler", "x"), "workers = 2")):
        assert main(["experiments", "run", *where, *given]) == 2
        assert word in capsys.readouterr().err
    assert calls == []


@pytest.fixture
def finished(tmp_path):
    """The folder of a run that has finished, of before status.json had the processor's time."""
    folder = tmp_path / "run"
    folder.mkdir()
    for name, text in (
        ("run.toml", "x = 1\n"), ("result.json", '{"n": 2}'), ("trajectory.csv", "t_s\n0\n1\n"),
        ("status.json", '{"status": "done", "reason": "", "updated": "2026-11-20"}'),
    ):  # fmt: skip
        (folder / name).write_text(text)
    return folder


def test_a_run_of_before_the_processor_s_time_was_kept_is_kept_without_it(finished, tmp_path):
    keep(finished, tmp_path / "results" / "case")
    assert json.loads((tmp_path / "results" / "case" / "cost.json").read_text()) == {
        "processor_time": None, "updated": "2026-11-20",
        "digests": {name: digest_of(finished / name) for name in ("run.toml", "result.json", "trajectory.csv")},
    }  # fmt: skip
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["case"]


@pytest.mark.parametrize("before", [(), ("run.toml", "result.json", "README.md")])
def test_a_result_is_kept_whole_or_not_at_all(finished, tmp_path, before):
    """What is missing or no JSON leaves what was there; whole, it takes its place and leaves notes beside it alone."""
    target = tmp_path / "results" / "case"
    for name in before:
        target.mkdir(parents=True, exist_ok=True)
        (target / name).write_text("old")
    (finished / "result.json").write_text("{")
    with pytest.raises(ValueError):
        keep(finished, target)
    (finished / "result.json").unlink()
    with pytest.raises(OSError):
        keep(finished, target)
    assert [path.name for path in (tmp_path / "results").iterdir()] == (["case"] if before else [])
    assert all((target / name).read_text() == "old" for name in before)
    (finished / "result.json").write_text('{"n": 2}')
    keep(finished, target)
    kept = {path.name: path.read_text() for path in target.iterdir()}
    assert kept["result.json"] == '{"n": 2}' and kept["run.toml"] == "x = 1\n" and "cost.json" in kept
    assert kept.get("README.md") == ("old" if before else None)


def test_a_case_there_is_not_is_refused(capsys):
    assert main(["experiments", "list", "grains9"]) == 2
    assert "'grains9'" in capsys.readouterr().err


def test_a_mistyped_case_names_those_spelt_like_it_and_an_unlike_one_those_of_the_folder():
    """At most four names of the grains' cases that lie a folder deeper, too, not all seventy."""
    with pytest.raises(ValueError, match="cases of names near it that ship are ") as raised:
        find_case(Path("grains1-sand-0.0085-0.23"), CASES)
    near = str(raised.value).partition(" that ship are ")[2].split(", ")
    assert near[0] == "grains1-sand-0.0085-0.22" and len(near) == 4
    assert all(find_case(Path(name), CASES).is_file() for name in near)
    with pytest.raises(ValueError, match=r"that ship are bed-make, .* and \d+ that `hedgebed experiments list` names"):
        find_case(Path("zzz"), CASES)


@pytest.mark.parametrize("second", ["24mm", "0.024", "1e-3g", "-3", "5m/s"])
def test_a_second_value_of_an_option_is_not_taken_for_the_name_of_a_case(second):
    with pytest.raises(ValueError, match="takes one value"):
        find_case(Path(second), CASES)
