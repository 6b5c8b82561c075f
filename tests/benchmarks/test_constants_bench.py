"""`hedgebed bench constants`: constants are changed wherever the diagnosis uses them, and changed verdicts counted."""

import json
import subprocess
import sys

import pytest

from benchmarks import constants
from benchmarks.diagnosis.changed import CONSTANTS, begin_changed
from experiments.runs.progress import Progress

CHANGED = """
from benchmarks.diagnosis.changed import begin_changed
begin_changed({"core.rivals:LEAD": 5.0, "fit.evidence:SMALL": 2.4})
from experiments.diagnose.core import matters, rivals, search
from experiments.diagnose.fit import evidence
assert (rivals.LEAD, matters.LEAD) == (5.0, 5.0)
assert (evidence.SMALL, matters.MOST) == (2.4, 2.4)
assert search._LEADS == 2.0
"""


def test_a_changed_constant_is_changed_in_every_module_that_uses_it():
    done = subprocess.run([sys.executable, "-c", CHANGED], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def test_every_constant_is_in_the_code_and_changes_within_its_range():
    for constant in CONSTANTS:
        low, high = sorted(constant.times(factor) for factor in constants.FACTORS)
        assert 0 < low < constant.value() < high, constant.id
        if constant.rest:
            assert high < 1


def test_a_constant_that_is_none_is_refused():
    with pytest.raises(ValueError, match=r"core\.rivals:NONE"):
        begin_changed({"core.rivals:NONE": 1.0})
    with pytest.raises(ValueError, match="only = 'LEAD'"):
        constants.run(None, progress=Progress(), only="LEAD")
    with pytest.raises(ValueError, match="kind = 'push'"):
        constants.run(None, progress=Progress(), kind="push")


@pytest.mark.long
def test_verdicts_that_change_are_counted_and_a_stopped_study_goes_on(tmp_path, monkeypatch, capsys):
    asked = []

    def answers(constant, factor, kind, cases, folders, known):
        for k, case in enumerate(cases):
            if constants._key(kind, case, constant.id if constant else "", factor) not in known:
                asked.append((factor, k))
                verdict = "unknown" if factor == 2.0 and k == 0 else "none"
                yield k, {"verdict": verdict, "effects": [], "alternatives": [], "cpu": 1.0}

    monkeypatch.setattr(constants, "_answers", answers)
    given = {"progress": Progress(), "count": 2, "seed": 7, "only": "core.rivals:LEAD"}
    text = constants.run(tmp_path, **given)["table"]
    row = next(line for line in text.splitlines() if "core.rivals:LEAD" in line)
    assert "| 10 |" in row and "| 1 change" in row and len(asked) == 6
    path = tmp_path / constants.FILE
    lines = path.read_text().splitlines()
    assert len(lines) == 6 and {json.loads(line)["factor"] for line in lines} == {0.5, 1.0, 2.0}
    path.write_text("\n".join(lines[:-1]) + "\n" + lines[-1][:50])  # killed while it wrote
    assert constants.continues(tmp_path) and constants.run(tmp_path, **given)["table"] == text
    assert len(asked) == 7


def test_a_diagnosis_that_fails_is_counted_and_shown(tmp_path, monkeypatch):
    said, progress = [], Progress()
    monkeypatch.setattr(progress, "message", said.append)

    def answers(constant, factor, kind, cases, folders, known):
        for k in range(len(cases)):
            told = {"effects": [], "alternatives": [], "cpu": 1.0}
            failed = factor == 0.5 and k == 1
            yield k, told | ({"verdict": "failed", "error": "A\nLinAlgError: no"} if failed else {"verdict": "none"})

    monkeypatch.setattr(constants, "_answers", answers)
    given = {"count": 2, "seed": 7, "only": "core.rivals:LEAD"}
    text = constants.run(tmp_path, progress=progress, **given)["table"]
    row = next(line for line in text.splitlines() if "core.rivals:LEAD" in line)
    assert row.count("failed") == 1 and "1 of 2" in row
    assert len(said) == 1 and "LinAlgError" in said[0] and "core.rivals:LEAD" in said[0]


@pytest.mark.parametrize("damage", [b"{not json", b"[]", b'{"kind": "second-push"}', b"\xff"])
def test_a_damaged_line_is_refused_by_file_and_line(tmp_path, damage):
    (tmp_path / constants.FILE).write_bytes(damage + b"\n")
    with pytest.raises(ValueError, match=r"constants\.jsonl, line 1"):
        constants.run(tmp_path, progress=Progress(), count=1, only="core.rivals:LEAD")


def test_a_campaign_that_is_half_written_has_no_name_that_counts(tmp_path, monkeypatch):
    def killed(folder, campaign):
        folder.mkdir(parents=True)
        raise KeyboardInterrupt

    monkeypatch.setattr(constants, "write_campaign", killed)
    for _ in range(2):  # the second run meets what the first one left
        with pytest.raises(KeyboardInterrupt):
            constants.run(tmp_path, progress=Progress(), count=1, only="core.rivals:LEAD")
        assert all(path.name.endswith(".unfinished") for path in (tmp_path / "campaigns").iterdir())


@pytest.mark.long
def test_one_campaign_is_diagnosed_with_a_constant_as_it_is_halved_and_doubled(tmp_path):
    given = {"progress": Progress(), "count": 1, "seed": 1, "only": "fit.evidence:SMALL"}
    constants.run(tmp_path, **given)
    records = [json.loads(line) for line in (tmp_path / constants.FILE).read_text().splitlines()]
    assert [record["factor"] for record in records] == [1.0, 0.5, 2.0]
    assert all(
        record["verdict"] in ("none", "named", "ambiguous", "unknown") and record["cpu"] > 0 for record in records
    )
