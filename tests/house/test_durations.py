"""How long each file of tests takes is known: `make fast` leaves out the longest by it."""

import tomllib
from pathlib import Path

from conftest import DURATIONS, FAST_BUDGET, ROOT, heavy_files, longest_first, merged


def test_durations_of_a_few_files_are_added_to_those_of_the_others_and_files_that_are_gone_are_left_out(tmp_path):
    for name in ("test_old.py", "test_new.py", "test_again.py"):
        (tmp_path / name).write_text("")
    known = {"test_old.py": 3.0, "test_gone.py": 1.0, "test_again.py": 9.0}
    found = merged(known, {"test_new.py": 2.0, "test_again.py": 4.0}, tmp_path)
    assert list(found.items()) == [("test_again.py", 4.0), ("test_new.py", 2.0), ("test_old.py", 3.0)]


def test_a_file_without_a_duration_begins_first_and_those_beyond_the_budget_are_heavy():
    known = {"a": 0.4 * FAST_BUDGET, "b": 0.5 * FAST_BUDGET, "c": 0.6 * FAST_BUDGET}
    assert longest_first(["a", "new", "c"], known) == ["new", "c", "a"]
    assert heavy_files(known) == {"c"}


def test_every_file_with_tests_of_make_test_alone_has_a_duration():
    """Files with long or slow tests may have no other ones, and then none is measured."""
    files = {path.relative_to(ROOT).as_posix(): path for path in Path(ROOT, "tests").rglob("test_*.py")}
    known = tomllib.loads(DURATIONS.read_text(encoding="utf-8"))
    new = {name for name in files.keys() - known.keys() if "mark.long" not in (text := files[name].read_text("utf-8"))
           and "mark.slow" not in text}  # fmt: skip
    assert not new, "see make tiers"
    assert not known.keys() - files.keys()
