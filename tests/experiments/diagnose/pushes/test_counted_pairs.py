"""How often two names are right: every text has the sums of `counts.toml`, in which alone a new count is entered."""

import re
from pathlib import Path

import pytest

from experiments.diagnose.report.document import COUNTS

ROOT = Path(__file__).parents[4]
PAIRS = COUNTS["pairs"].values()


@pytest.mark.parametrize("page", ["docs/diagnose.md", "docs/limits.md", "vis/page/limits.toml"])
def test_campaigns_with_two_effects_are_counted_as_in_the_one_file(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(r"Of (\d+) campaigns [^.]*two hidden effects[^.]*named in (\d+)", text)
    both = [sum(pair[name] for pair in PAIRS) for name in ("hidden", "right")]
    assert found and all([int(n) for n in one] == both for one in found)


def test_verdicts_with_two_names_are_counted_as_in_the_one_file():
    page = (ROOT / "docs/diagnose.md").read_text(encoding="utf-8")
    (told,) = re.findall(r"Of (\d+) verdicts with two names (\d+) are", page)
    assert [int(n) for n in told] == [sum(pair[name] for pair in PAIRS) for name in ("named", "right")]
