"""The figures of `hedgebed bench diagnose`: counted from cases whose answers are known."""

import numpy as np
import pytest

from benchmarks.diagnose import summarise
from benchmarks.hidden_penetration import EFFECTS, make_hidden


def case(truth, verdict, effects=(), *, outside=None, signature=20.0, alternatives=(), before=9.0, after=1.0):
    return {
        "truth": list(truth), "outside": outside, "signature": signature, "verdict": verdict,
        "effects": list(effects), "alternatives": list(alternatives), "before": before, "after": after,
        "seconds": 1.0, "cpu": 1.0,
    }  # fmt: skip


def test_alarms_names_and_unknowns_are_counted_apart():
    summary = summarise([
        case((), "none", signature=0.0), case((), "named", ["layering"], signature=0.0),
        case(["adhesion"], "named", ["adhesion"]), case(["adhesion"], "named", ["layering"]),
        case(["adhesion"], "ambiguous", ["layering"], alternatives=["adhesion"], signature=2.0),
        case((), "unknown", outside="shock"), case((), "named", ["layering"], outside="shock"),
    ])  # fmt: skip
    assert summary["false_alarms"] == {"share": 0.5, "of": 2}
    assert summary["named_right_plain"] == {"share": 0.5, "of": 2}
    assert summary["ambiguous_sets_hold_truth"] == {"share": 1.0, "of": 1}
    assert summary["unknown_recall"] == {"share": 0.5, "of": 2}
    assert summary["median_gap_closed"] == pytest.approx(1.0)


def test_the_answer_is_not_in_the_campaign_and_a_seed_gives_the_same_campaign():
    campaign, hidden = make_hidden(3, kind="layering", strength=8.0)
    again, _ = make_hidden(3, kind="layering", strength=8.0)
    text = campaign.tables.model_dump_json()
    assert hidden.effects == ("layering",) and not any(effect in text for effect in EFFECTS)
    assert 4.0 < hidden.signature < 16.0
    first, second = campaign.recording("001", "data"), again.recording("001", "data")
    assert all(np.array_equal(first[name], second[name]) for name in first.columns)
