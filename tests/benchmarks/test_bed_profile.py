"""Where a step's time goes: the profile of the bed. Taichi is started anew for it."""

import pytest
from race_stacks import stack

import benchmarks.bed as race
from benchmarks.race import table
from experiments.runs.progress import Progress


@pytest.mark.long
def test_a_profile_says_what_a_step_is_made_of(monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(race, "prepare_grains", lambda count, **options: stack(layers=4))
    monkeypatch.setattr(race, "REPEATS", 2)
    monkeypatch.setattr("benchmarks.race.machine.cores_there", lambda: 1)  # Taichi is started anew for another number
    for name, value in {"SIZES": "256", "STEPS": "20"}.items():
        monkeypatch.setenv(f"HEDGEBED_BENCH_{name}", value)
    bench = race.run(tmp_path, progress=Progress(), profile=True)
    (bed,) = bench["profile"]
    ours = bed["columns"][0]
    assert (ours["name"], ours["threads"]) == ("hedgebed", 1)
    assert sum(ours["phases"].values()) == pytest.approx(ours["total"])
    assert min(ours["phases"][phase] for phase in ("finding", "forces", "sorting", "listing")) >= 0
    counts = bed["counts"]
    assert counts["rows"] >= counts["touching_rows"]
    # One chunk computes each contact once; contacts are counted from positions.
    assert counts["touching_rows"] == pytest.approx(counts["contacts"], rel=1e-12)
    assert bench["command"].endswith(" --profile")
    assert "bench bed --profile" in table.marks_of(bench)[0]
    for loop in bed["columns"][1:]:
        assert sum(loop["phases"].values()) == pytest.approx(loop["total"])
        assert loop["phases"]["forces"] > 0
    assert f"{ours['total']:.1f}" in table.markdown(bench)
    assert "forces" in capfd.readouterr().out
