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
    assert "| 10 |" in row and "no change | 1 change" in row and len(asked) == 6
    path = tmp_path / constants.FILE
    lines = path.read_text().splitlines()
    assert len(lines) == 6 and {json.loads(line)["factor"] for line in lines} == {0.5, 1.0, 2.0}
    path.write_text("\n".join(lines[:-1]) + "\n" + lines[-1][:50])  # killed while it wrote
    assert constants.continues(tmp_path) and constants.run(tmp_path, **given)["table"] == text
    assert len(asked) == 7
