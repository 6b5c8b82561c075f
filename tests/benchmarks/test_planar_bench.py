"""``hedgebed bench planar`` on a few trials."""

import json

import pytest

from benchmarks import planar
from experiments.cli.main import main
from rigid import EFFECTS


def test_all_terms_means_all():
    assert set(planar.AMPLITUDES) == {id for id, term in EFFECTS.items() if not term.sensor}
    assert all(planar.AMPLITUDES.values())  # each effect's own file says which sizes can be seen
    forms = {"inertial-drag": "power", "depth-hardening": "bend"}  # which change the form of a force, not its size
    for id, name in forms.items():
        low, high = planar.AMPLITUDES[id][name]
        assert low < high


@pytest.mark.long
def test_bench_planar_writes_speed_and_agreement(tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_BENCH_TRIALS", "200")
    monkeypatch.setenv("HEDGEBED_BENCH_ROUNDS", "2")
    monkeypatch.setenv("HEDGEBED_BENCH_COMPARED", "18")
    assert main(["bench", "planar", "--out", str(tmp_path / "bench"), "--quiet"]) == 0
    bench = json.loads((tmp_path / "bench" / "bench.json").read_text(encoding="utf-8"))
    assert (bench["format"], bench["what"]) == ("hedgebed-bench/1", "planar")
    assert bench["trials_per_s"] > 0 and bench["trials_per_s_all_terms"] > 0
    for part in bench["sets"].values():
        agreement = part["agreement"]
        assert agreement["trials"] == sum(agreement["counts"].values()) >= 1
        assert agreement["counts"]["unexplained"] == 0 and agreement["stand_by_one_only"] == 0
        for name, limit in agreement["tolerance"].items():
            assert agreement["differences"][name]["median"] < 0.1 * limit
        assert agreement["largest_energy_residual_accurate"] < 1e-6


def test_a_wrong_variable_of_the_environment_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv("HEDGEBED_BENCH_TRIALS", "many")
    with pytest.raises(ValueError, match="HEDGEBED_BENCH_TRIALS"):
        planar.Settings()
