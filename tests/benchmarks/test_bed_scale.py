"""Speed and memory of large beds: what is said of one."""

import json

import pytest
from race_stacks import stack

import benchmarks.bed as race
from benchmarks.race import table
from benchmarks.race.entrants import Ours
from benchmarks.race.scale import field_bytes
from experiments.runs.progress import Progress


@pytest.mark.long
def test_the_bytes_of_fields_are_those_of_their_arrays():
    bed = Ours(stack(), threads=1).warmed()
    sizes = field_bytes(bed)
    for name in ("position", "force", "id", "slide", "pair"):
        assert sizes[name] == getattr(bed.engine, name).to_numpy().nbytes


def test_a_scale_says_speed_and_growth_of_memory(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(race, "prepare_grains", lambda count, **options: stack())
    monkeypatch.setattr(race, "keep_bed", lambda path, grains, threads: None)
    told = {"steps": 20, "speed": 1e7, "list_count": 1, "fields": 2e6, "largest_fields": {"slide": 1e6}}
    sizes = iter([(320, 1.0e8, 1.2e8), (640, 1.0e8 + 320_000, 1.2e8 + 640_000)])

    def found(path, times, **options):
        count, held, most = next(sizes)
        assert times == count // 320
        return told | {"grain_count": count, "held": held, "most": most}

    monkeypatch.setattr(race, "scale_of", found)
    monkeypatch.setenv("HEDGEBED_BENCH_SIZES", "320 640")
    bench = race.run(tmp_path, progress=Progress(), scale=True)
    assert [size["held_per_grain"] for size in bench["scale"]] == [None, 1000.0]
    assert bench["scale"][1]["most_per_grain"] == 2000.0
    assert json.dumps(bench)
    last = table.markdown(bench).splitlines()[5 + len(bench["scale"])]
    assert [cell.strip() for cell in last.split("|")][6:9] == ["1.00", "2.00", "3.12"]
    assert "1.00" in capfd.readouterr().out
    monkeypatch.setenv("HEDGEBED_BENCH_SIZES", "320 500")
    with pytest.raises(ValueError, match="multiple of the first"):
        race.run(tmp_path, progress=Progress(), scale=True)
    with pytest.raises(ValueError, match="give one of them"):
        race.run(tmp_path, progress=Progress(), scale=True, profile=True)
