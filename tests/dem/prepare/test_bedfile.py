"""A bed in one file with its preparation: the same bits, listed, shared; what is no bed is refused."""

import zipfile

import numpy as np
import pytest

from dem import SAND, Bed
from dem.prepare.bedfile import (
    bed_shelf,
    find_bed,
    list_beds,
    load_prepared,
    read_preparation,
    save_prepared,
    share_bed,
    shelf_path,
)
from dem.prepare.report import Prepared, measure_stage


@pytest.fixture(scope="module")
def prepared():
    """Four grains, one above the other three, and a report as of a preparation."""
    positions = [[0.01, 0.01, 0.00199], [0.014, 0.01, 0.00199], [0.012, 0.0135, 0.00199], [0.012, 0.0112, 0.0055]]
    bed = Bed.from_grains(
        SAND, positions=positions, radii=[0.002] * 4, size=(0.024, 0.024, 0.016), young=1e7, threads=1
    )
    bed.advance(50)
    return Prepared(bed, {"stages": ["rain"], "seed": 1}, [measure_stage(bed, "rain", grain=0.004, notes={"a": 1})])


def test_a_bed_and_its_preparation_come_back_from_one_file_to_the_bit(prepared, tmp_path):
    path = save_prepared(prepared, tmp_path / "deep" / "bed.npz")
    again = load_prepared(path, threads=1)
    assert again.reports == prepared.reports and again.recipe == prepared.recipe == again.bed.recipe
    plain = Bed.load(path, threads=1)
    for bed in (again.bed, plain):
        state = bed.state()
        assert all(state[key].tobytes() == values.tobytes() for key, values in prepared.bed.state().items())
    assert sorted(item.name for item in path.parent.iterdir()) == ["bed.npz"]


def test_a_bed_is_shared_as_one_smaller_file_and_nothing_is_overwritten(prepared, tmp_path):
    path = save_prepared(prepared, tmp_path / "bed.npz")
    sent = share_bed(path, tmp_path / "sent.npz")
    assert sent.stat().st_size < path.stat().st_size
    assert load_prepared(sent, threads=1).reports == prepared.reports
    with pytest.raises(ValueError, match=r"to = .*sent.npz' is there already"):
        share_bed(path, sent)


def test_beds_are_listed_and_what_is_no_bed_is_listed_with_why(prepared, tmp_path):
    save_prepared(prepared, tmp_path / "a.npz")
    prepared.bed.save(tmp_path / "b.npz")
    (tmp_path / "c.npz").write_bytes(b"no bed")
    a, b, c = list_beds(tmp_path)
    assert (a["name"], a["material"], a["grain_count"], a["stages"]) == ("a", "sand", 4, ["rain"])
    assert a["grain"] == pytest.approx(0.004) and a["size"] == [0.024, 0.024, 0.016]
    assert b["stages"] == [] and b["packing_fraction"] == a["packing_fraction"]
    assert "not a bed" in c["problem"]


def test_a_bed_is_found_by_path_by_folder_and_by_name(prepared, tmp_path, monkeypatch):
    monkeypatch.setenv("HEDGEBED_BEDS", str(tmp_path / "shelf"))
    assert bed_shelf() == tmp_path / "shelf"
    path = save_prepared(prepared, tmp_path / "run" / "bed.npz")
    named = save_prepared(prepared, shelf_path("loose"))
    assert find_bed(path) == path and find_bed(tmp_path / "run") == path and find_bed("loose") == named
    with pytest.raises(ValueError, match=r"bed = 'lose' is no file, .*; the shelf holds loose"):
        find_bed("lose")
    with pytest.raises(ValueError, match="name = 'a/b' cannot name a bed"):
        shelf_path("a/b")


def test_a_damaged_preparation_is_refused(prepared, tmp_path):
    path = save_prepared(prepared, tmp_path / "bed.npz")
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, b'{"format": "other"}' if name == "preparation.json" else data)
    with pytest.raises(ValueError, match="its format is 'other'"):
        read_preparation(path)
    with pytest.raises(ValueError, match="no such file"):
        read_preparation(tmp_path / "none.npz")
    assert np.isfinite(prepared.reports[0].packing_fraction)
