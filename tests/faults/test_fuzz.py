"""Settings and campaigns drawn at random: exit 0, or exit 2 with a sentence that names what is wrong, before any work.

`make fuzz` draws as many as HEDGEBED_FUZZ says, in parts that each have a seed of their own; the suite 300. The work
itself is replaced: what is tried is all that comes before it. HEDGEBED_FUZZ_KEPT names a file to which each part that
passes adds a line; parts that it has are not done again.
"""

import json
import re
import shutil
import subprocess
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import pytest
from faults import fuzzing
from faults.fuzzing import ALL, CASES, in_words, kept, outcome
from hypothesis import HealthCheck, find, given, seed, settings
from hypothesis import strategies as st

from experiments.campaign.files import new_campaign
from experiments.runs import registry
from experiments.runs.registry import EXPERIMENTS
from rigid.result import toml_value

ROOT = Path(__file__).resolve().parents[2]
PART, CAMPAIGNS = 250, 25
"""Cases of settings and campaigns of a part, at most."""
PARTS = range(-(-CASES // PART))
MANY = pytest.mark.long
"""Of a whole part of settings, where `make fuzz` does not ask for it: the few of the last part show the same."""

numbers = st.one_of(
    st.sampled_from([0, 1, -1, 2, 3, 0.5, 1e-3, 1e-6, 1e6, 1e300, -1e-300, 2**31, float("nan"), float("inf")]),
    st.floats(1e-4, 1e2),
    st.integers(1, 20),
)
texts = st.one_of(
    st.sampled_from(
        ["", "none", "bed", "sand", "brick", "16mm", "1e-3g", "3 kg", "a=b", "nowhere.toml", "../x", "x:y:z"]
    ),
    st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=6),
)
values = st.recursive(st.one_of(numbers, texts, st.booleans()), lambda inner: st.lists(inner, max_size=3), max_leaves=4)


@st.composite
def cases(draw):
    """An experiment, and some of its settings: as they are by default, near that, or anything."""
    experiment = draw(st.sampled_from(list(EXPERIMENTS.values())))
    fields = experiment.settings_class().model_fields
    given = {}
    for name in draw(st.lists(st.sampled_from(sorted(fields)), max_size=5, unique=True)):
        default, choices = fields[name].get_default(call_default_factory=True), get_args(fields[name].annotation)
        near = [st.sampled_from(choices)] if choices and all(isinstance(one, str) for one in choices) else []
        if isinstance(default, float) and default:
            near.append(st.floats(0.3, 3.0).map(lambda factor, default=default: factor * default))
        given[name] = draw(st.one_of(*near, values))
    if draw(st.integers(0, 9)) == 0:
        given[draw(st.text(st.characters(codec="ascii", categories=["Ll"]), min_size=1, max_size=8))] = draw(values)
    return experiment.name, given


@pytest.fixture
def no_work(monkeypatch, tmp_path):
    """Every experiment is over as soon as its settings are accepted."""

    def over(self, given, folder, *, progress):
        result = {"title": self.name, "quantities": {}}
        registry.import_module("experiments.runs.folder").RunFolder.open(folder).write_result(result)
        return result

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry.Experiment, "run", over)
    monkeypatch.setattr("experiments.cli.runs.headline_of", lambda experiment, result: None)


@pytest.mark.parametrize(("target", "variable"), [("fuzz", "FUZZED"), ("torture", "KILLED")])
def test_make_names_the_file_of_what_is_done_by_its_whole_path(target, variable):
    """The tests work in folders of their own."""
    made = subprocess.run(
        ["make", "-n", target, f"{variable}=some/parts.jsonl"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert f"_KEPT={ROOT / 'some' / 'parts.jsonl'} " in made.stdout


def test_a_part_that_the_file_has_is_not_done_again(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzzing, "KEPT", tmp_path / "parts.jsonl")
    for part in ("settings 0", "settings 1"):
        with kept(part) as counts:
            counts[2] += 3
    with pytest.raises(pytest.skip.Exception), kept("settings 1"):
        pass
    lines = [json.loads(line) for line in (tmp_path / "parts.jsonl").read_text().splitlines()]
    assert lines == [{"part": f"settings {part}", "exit 2": 3} for part in (0, 1)]


@pytest.mark.parametrize("part", [pytest.param(part, marks=MANY if part == 0 and not ALL else ()) for part in PARTS])
def test_settings_of_any_kind_are_run_or_refused_in_words(part, no_work):
    with kept(f"settings {part}") as counts:
        count = min(CASES - part * PART, PART)

        @seed(part)
        @settings(max_examples=count, deadline=None, suppress_health_check=list(HealthCheck), database=None)
        @given(case=cases())
        def fuzz(case):
            name, given = case
            lines = [f"{key} = {toml_value(value)}\n" for key, value in given.items()]
            Path("case.toml").write_text("".join(lines), encoding="utf-8")
            shutil.rmtree("out", ignore_errors=True)
            status, said = outcome(*name.split(" "), "case.toml", "--out", "out", "--quiet")
            assert status in (0, 2) and in_words(said), (name, given, status, said)
            assert status == 0 or said.strip(), (name, given)
            counts[status] += 1

        fuzz()


ODD = ["", "0", "-1", "x", "nan", "1e308", "-0.0", "true", "1,2", "[", '"', "\t", "é", "<script>alert(1)</script>"]


@dataclass(frozen=True)
class Change:
    """One thing of a file that is another: `line` counts from 0; `place` of a word or a character, or another line."""

    file: str
    line: int
    how: Literal["line left out", "line of another place", "word", "character"]
    place: int = 0
    odd: str = ""

    def made(self, text):
        """The text with the change."""
        lines = text.splitlines(keepends=True)
        given = lines[self.line]
        if self.how == "line left out":
            del lines[self.line]
        elif self.how == "line of another place":
            lines.insert(self.line, lines[self.place])
        elif self.how == "word":
            words = re.split(r"(,| )", given)
            lines[self.line] = "".join([*words[: self.place], self.odd, *words[self.place + 1 :]])
        else:
            lines[self.line] = given[: self.place] + self.odd + given[self.place + 1 :]
        return "".join(lines)


@st.composite
def changes(draw, files):
    """A change of one of these files, by their texts; simplest is the first file without its first line."""
    file = draw(st.sampled_from(sorted(files)))
    lines = files[file].splitlines(keepends=True)
    line = draw(st.integers(0, len(lines) - 1))
    how = draw(st.sampled_from(get_args(Change.__annotations__["how"])))
    counts = {"line of another place": len(lines), "word": len(re.split(r"(,| )", lines[line]))}
    if how == "line left out":
        return Change(file, line, how)
    place = draw(st.integers(0, counts.get(how, len(lines[line]) + 1) - 1))
    odd = "" if how == "line of another place" else draw(st.sampled_from(ODD))
    return Change(file, line, how, place, odd)


CAMPAIGN_PARTS = range(-(-CASES // (20 * 2 * CAMPAIGNS)) if ALL else 1)


@pytest.mark.parametrize("part", CAMPAIGN_PARTS)
@pytest.mark.parametrize("kind", ["tumble", "penetration"])
def test_campaigns_with_something_wrong_are_checked_or_refused_in_words(kind, part, tmp_path, monkeypatch):
    """No markup of a campaign gets into the page as such."""
    monkeypatch.chdir(tmp_path)
    new_campaign(tmp_path / "new", kind=kind)
    files = {path.name: path.read_text(encoding="utf-8") for path in Path("new").iterdir()}
    if not ALL:
        monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
    with kept(f"changed campaigns {kind} {part}") as counts:

        @seed(f"{kind} {part}")
        @settings(
            max_examples=CAMPAIGNS if ALL else 4, deadline=None, suppress_health_check=list(HealthCheck), database=None
        )
        @given(change=changes(files))
        def fuzz(change):
            shutil.rmtree("one", ignore_errors=True), shutil.rmtree("out", ignore_errors=True)
            shutil.copytree("new", "one")
            (Path("one") / change.file).write_text(change.made(files[change.file]), encoding="utf-8")
            with warnings.catch_warnings(record=True) as warned:
                warnings.simplefilter("always")
                status, said = outcome("campaign", "check", "one", "--out", "out", "--quiet")
            assert status in (0, 2) and in_words(said), said
            assert not [str(each.message) for each in warned if not issubclass(each.category, DeprecationWarning)]
            if ALL and status == 0:
                assert "<script>" not in (Path("out") / "report.html").read_text(encoding="utf-8")
            counts[status] += 1

        fuzz()


@pytest.mark.parametrize(
    ("change", "made"),
    [
        (Change("a", 0, "line left out"), "2,3 4\n"),
        (Change("a", 1, "line of another place", 0), "one\none\n2,3 4\n"),
        (Change("a", 1, "word", 0, "nan"), "one\nnan,3 4\n"),
        (Change("a", 1, "character", 2, "["), "one\n2,[ 4\n"),
    ],
)
def test_a_change_of_a_file_is_one_line_word_or_character(change, made):
    assert change.made("one\n2,3 4\n") == made


def test_what_the_fuzzer_finds_is_told_by_its_simplest_change():
    """Of all changes of two files that lose the word `tip`, one without a place or a word."""
    files = {"a.csv": "t_s,z_m\n0,1\n" * 20, "campaign.toml": "format = 1\n[spike]\ntip = 'flat'\n"}
    lost = find(
        changes(files), lambda change: "tip" in files[change.file] and "tip" not in change.made(files[change.file])
    )
    assert lost == Change("campaign.toml", 2, "line left out")


@pytest.mark.parametrize("line", [1, 3])
def test_a_lone_quotation_mark_in_a_recording_is_named_with_its_line(line, tmp_path, monkeypatch):
    """Found by the fuzzer: the rest of the file was one cell, and the message had all of it."""
    monkeypatch.chdir(tmp_path)
    new_campaign(tmp_path / "one", kind="penetration")
    lines = (tmp_path / "one" / "003.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    lines[line - 1] = lines[line - 1].replace(",", ',"', 1)
    (tmp_path / "one" / "003.csv").write_text("".join(lines), encoding="utf-8")
    status, said = outcome("campaign", "check", "one", "--out", "out", "--quiet")
    assert status == 2 and in_words(said) and f"003.csv, line {line}: " in said and "quotation" in said
