"""What the suite is to hold and the bed cannot do yet: each says what it waits for, and stays in the table "
"until then."""

from __future__ import annotations

from .case import Case

__all__ = ["CASES"]

FAMILY = "Not yet"
TESTS = "a case of its own with a figure that was read in its source; `hedgebed bed test {test}` measures it"

CASES = [
    Case(
        "repose",
        FAMILY,
        "Angle of repose against material",
        "31 to 34 degrees for fine sand",
        "design data, unverified",
        waits_for=TESTS.format(test="repose"),
    ),
]
