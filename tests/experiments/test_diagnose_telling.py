"""What a diagnosis says in words and tables."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.diagnose.telling import PhaseTable, told_tables, where_sentences


def test_chi_square_by_phase_is_that_of_the_residuals_of_all_trials_of_a_kind():
    table = PhaseTable()
    phases = np.array(["in", "in", "out"])
    table.add("force", phases, np.array([1.0, 3.0, 2.0]), np.array([1.0, 1.0, 0.0]), held_out=False)
    table.add("force", phases[:1], np.array([2.0]), np.array([1.0]), held_out=False)
    table.add("force", phases[2:], np.array([4.0]), np.array([0.5]), held_out=True)
    rows = {(row["phase"], row["held_out"]): row for row in table.rows}
    assert rows["in", False] | {"before": 0} == {
        "phase": "in", "channel": "force", "held_out": False, "samples": 3, "before": 0, "after": 1.0,
    }  # fmt: skip
    assert rows["in", False]["before"] == pytest.approx((1 + 9 + 4) / 3)
    assert (rows["out", True]["before"], rows["out", True]["after"]) == (16.0, 0.25)


def place(trial: str, channel: str, phase: str, excess: float, torque: float) -> dict:
    return {"trial": trial, "channel": channel, "phase": phase, "from_s": 0.4, "to_s": 0.9, "excess": excess,
            "settings": {"torque_N_m": torque, "gravity_m_s2": 0.08}}  # fmt: skip


def test_where_the_model_fails_is_said_with_phase_channel_seconds_and_torque():
    places = [place("001", "x", "slip", 80.0, 6.0), place("002", "gyro", "slip", 15.0, 0.22),
              place("002", "x", "hop", 5.0, 0.22)]  # fmt: skip
    first, second = where_sentences({"where": places})
    assert "in phase slip (95 %) and channel x (85 %)" in first
    assert "x of trial 001 from 0.4 to 0.9 s" in first
    assert second == "Most of it is at torque 6 N m (80 %)."  # all trials share the gravity: it tells nothing
    assert where_sentences({"where": []}) == []


def test_the_table_of_candidates_has_every_name_once_and_sets_that_beat_their_parts():
    def row(candidate: str, score: float) -> dict:
        effects = [part.split(":")[0] for part in candidate.split(" + ")]
        return {"candidate": candidate, "effects": effects, "score": score, "left": 1.0}

    said = {
        "verdict": "named", "by_phase": [],
        "evidence": [row("a:1 + b:1", 30.0), row("a:1", 20.0), row("a:2", 19.0), row("b:1", 3.0), row("c:1 + b:1", 2.0),
                     row("c:1 + a:1", 1.0), row("c:1", -1.0)],
    }  # fmt: skip
    (table,) = told_tables(said)
    assert [cells[0] for cells in table["rows"]] == ["a:1 + b:1", "a:1", "b:1", "c:1"]
    assert table["rows"][1][1] == "20.0"
