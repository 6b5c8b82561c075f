"""Files that are cut off or have a wrong byte: a sentence that names the file, never a traceback, never another number.

`make torture` damages as many files as HEDGEBED_DAMAGES says; the suite does a few.
"""

import json
import os
import random
import re
import shutil

import numpy as np
import pytest

from dem import SAND, Bed
from dem.engine.state import read_file
from dem.prepare.bedfile import read_preparation, save_prepared
from dem.prepare.report import Prepared
from experiments.campaign.files import new_campaign
from experiments.cli.main import main
from experiments.runs.folder import RunFolder

NUMBERS = ("result.json", "campaign.toml")
DAMAGES = int(os.environ.get("HEDGEBED_DAMAGES", "2"))


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """No report is drawn: what is read for the numbers is what is damaged."""
    monkeypatch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished tumble on a law and one that differs from it, which no test writes to."""
    home = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("experiments.runs.whole_runs.write_report", lambda folder, progress: None)
        for name, torque in (("run", "0.2"), ("other", "0.15")):
            tokens = ["--duration", "0.2", "--torque", torque, "--out", str(home / name), "--quiet"]
            assert main(["tumble", *tokens]) == 0
        assert [main(tokens) for tokens in reading(home / "run", home, home)] == [0, 0]
        new_campaign(home / "campaign", kind="tumble")
        assert main(["campaign", "check", str(home / "campaign"), "--out", str(home / "checked"), "--quiet"]) == 0
    return home


def reading(run, home, out):
    """Two commands that read a run: what they write goes below `out`."""
    return (
        ["compare", str(run), str(home / "other"), "--out", str(out / "compared"), "--quiet"],
        ["campaign", "from-run", str(run), str(out / "made")],
    )


def numbers(folder, run):
    """What a command wrote beside its settings and reports, the path of the run it read left out."""
    paths = [path for path in folder.rglob("*") if path.name in NUMBERS or path.suffix == ".csv"]
    return {str(path.relative_to(folder)): path.read_text().replace(str(run), "RUN") for path in paths}


def damaged(path, chance):
    """Cut the file off somewhere, or change one bit of it."""
    content = bytearray(path.read_bytes())
    place = chance.randrange(len(content))
    if chance.random() < 0.5:
        content = content[:place]
    else:
        content[place] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def said_of(tokens, capsys):
    """Exit status of the command, and what it said on stderr."""
    capsys.readouterr()
    status = main([*tokens])
    return status, capsys.readouterr().err


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_result_is_made_again_to_the_same_bits(seed, whole, tmp_path, capsys):
    """The digest in status.json tells a changed digit, which is JSON as good as another."""
    run = tmp_path / "run"
    shutil.copytree(whole / "run", run)
    damaged(run / "result.json", random.Random(seed))
    status, said = said_of(["resume", str(run), "--quiet"], capsys)
    assert status == 0 and f"{run / 'result.json'}: " in said and "Traceback" not in said
    assert (run / "result.json").read_bytes() == (whole / "run" / "result.json").read_bytes()


@pytest.mark.parametrize("with_digests", [True, False])
def test_settings_that_exclude_each_other_by_damage_name_their_file(with_digests, whole, tmp_path, capsys):
    """Also where a killed run has no digest of them yet."""
    run = tmp_path / "run"
    shutil.copytree(whole / "run", run)
    (run / "result.json").unlink()
    if not with_digests:
        (run / "status.json").unlink()
    given = (run / "run.toml").read_text()
    assert "\nspread = 0.15\n" in given  # of grains; the run is on the spring-damper
    (run / "run.toml").write_text(given.replace("\nspread = 0.15\n", "\nspread = 0.17\n"))
    status, said = said_of(["resume", str(run), "--quiet"], capsys)
    assert status == 2 and f"{run / 'run.toml'}: " in said and "Traceback" not in said


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_run_whose_settings_are_damaged_is_not_gone_on_with(seed, whole, tmp_path, capsys):
    run = tmp_path / "run"
    shutil.copytree(whole / "run", run)
    (run / "result.json").unlink()
    damaged(run / "run.toml", random.Random(seed))
    status, said = said_of(["resume", str(run), "--quiet"], capsys)
    assert status == 2 and "run.toml" in said and "Traceback" not in said
    assert not (run / "result.json").exists()


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_file_of_a_run_is_named_by_who_reads_it(seed, whole, tmp_path, capsys):
    """Settings, status, result and trajectory of one of two runs that are compared, and of a run made a campaign.

    Where it is not refused, the numbers are those of the whole run.
    """
    chance = random.Random(seed)
    run = tmp_path / "run"
    shutil.copytree(whole / "run", run)
    shutil.copytree(whole / "other", tmp_path / "other")
    name = chance.choice(["run.toml", "status.json", "result.json", "trajectory.csv", "series/motion.csv"])
    damaged(run / name, chance)
    for tokens, written in zip(reading(run, tmp_path, tmp_path), ("compared", "made"), strict=True):
        status, said = said_of(tokens, capsys)
        assert "Traceback" not in said and status in (0, 1, 2), said
        if name == "result.json":
            assert status == 2 and str(run / name) in said
        elif status:
            assert str(run / name) in said or name == "status.json" in said, said
        else:
            assert numbers(tmp_path / written, run) == numbers(whole / written, whole / "run"), (name, said)


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_campaign_is_refused_by_the_name_of_the_file_or_all_other_recordings_are_the_same(
    seed, whole, tmp_path, capsys
):
    """A person writes a campaign and changes it: it has no digests, so that another digit is another measurement."""
    chance = random.Random(seed)
    folder = tmp_path / "campaign"
    shutil.copytree(whole / "campaign", folder)
    file = chance.choice(sorted(path for path in folder.rglob("*") if path.is_file()))
    damaged(file, chance)
    status, said = said_of(["campaign", "check", str(folder), "--out", str(tmp_path / "checked"), "--quiet"], capsys)
    assert status in (0, 2) and "Traceback" not in said, said
    if status:  # of campaign.toml also by the name of a recording that it now names, and that is not there
        assert str(file) in said or (file.name == "campaign.toml" and f"{folder}{os.sep}" in said), said
        return
    found, expected = recorded(tmp_path / "checked"), recorded(whole / "checked")
    changed = {name for name in expected if found.get(name) != expected[name]}
    if file.name == "campaign.toml":
        assert not changed & set(found)  # a trial or a sensor less, or its name: what is there is as it was
    else:
        assert set(found) == set(expected) and changed <= {file.name}


def recorded(checked):
    """What the folder of a check holds of each recording, by the name of its file: its rows, and the facts on them."""
    entries = json.loads((checked / "result.json").read_text())["recordings"]
    return {
        f"{entry['trial']}-{entry['sensor']}.csv": (entry, (checked / entry["series"]).read_bytes())
        for entry in entries
    }


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_checkpoint_gives_way_to_the_one_before_it(seed, tmp_path, capsys):
    """Or is whole: zip keeps a checksum of every array, and what it does not guard is not read."""
    folder, chance = RunFolder(tmp_path, "any", "1", {}), random.Random(seed)
    arrays = np.random.default_rng(seed).normal(size=(2, 50))
    for array in arrays:
        folder.save_checkpoint("work", {"numbers": array, "name": "a"})
    damaged(tmp_path / "checkpoint" / "work.npz", chance)
    found, said = folder.load_checkpoint("work"), capsys.readouterr().err
    before = "work.npz" in said
    assert np.array_equal(found["numbers"], arrays[0 if before else 1]) and found["name"] == "a"
    damaged(tmp_path / "checkpoint" / "work.npz.before", chance)
    found = folder.load_checkpoint("work")
    assert found is None or any(np.array_equal(found["numbers"], array) for array in arrays)
    folder.drop_checkpoint("work")
    assert folder.load_checkpoint("work") is None


def test_a_checkpoint_that_was_being_replaced_when_the_run_was_killed_is_the_one_before(tmp_path):
    folder = RunFolder(tmp_path, "any", "1", {})
    folder.save_checkpoint("work", {"row": 1})
    (tmp_path / "checkpoint" / "work.npz").rename(tmp_path / "checkpoint" / "work.npz.before")
    assert folder.load_checkpoint("work")["row"] == 1


@pytest.fixture(scope="module")
def bed_file(tmp_path_factory):
    """A prepared bed of four grains."""
    positions = [[0.01, 0.01, 0.00199], [0.014, 0.01, 0.00199], [0.012, 0.0135, 0.00199], [0.012, 0.0112, 0.0055]]
    box = {"radii": [0.002] * 4, "size": (0.024, 0.024, 0.016)}
    bed = Bed.from_grains(SAND, positions=positions, young=1e7, threads=1, **box)
    return save_prepared(Prepared(bed, {"seed": 1}, []), tmp_path_factory.mktemp("bed") / "bed.npz")


@pytest.mark.parametrize(
    ("place", "bit"),
    [(6, 0x40), (8, 0x01), (8, 0x20), (8, 0x40), (10, 0x01), (10, 0x08), (16, 0x01), (24, 0x10), (46, 0x01)],
)
def test_every_field_of_a_member_of_a_bed_file_is_read_with_care(place, bit, bed_file, tmp_path):
    """Version, encrypted, patched, strong encryption, two methods, checksum, length, name.

    PKWARE's APPNOTE.TXT, 4.3.12. zipfile has NotImplementedError, RuntimeError, zlib.error and BadZipFile for them.
    """
    content = bytearray(bed_file.read_bytes())
    entry = content.index(b"PK\1\2")  # the list of members, at the end; that of the preparation is its last
    for start in (entry, content.rindex(b"PK\1\2")):
        content[start + place] ^= bit
        path = tmp_path / "bed.npz"
        path.write_bytes(content)
        with pytest.raises(ValueError, match=re.escape(str(path))):
            read_file(path) if start == entry else read_preparation(path)
        content[start + place] ^= bit


def test_one_wrong_bit_in_the_shape_of_an_array_is_not_fewer_numbers(tmp_path):
    """numpy reads as many numbers as the shape says, and with 8 kB zip does not get to its checksum."""
    folder, path = RunFolder(tmp_path, "any", "1", {}), tmp_path / "checkpoint" / "work.npz"
    for number in (1, 2):
        folder.save_checkpoint("work", {"numbers": np.full(5000, number)})
    content = bytearray(path.read_bytes())
    content[content.index(b"(5000,)") + 1] ^= ord("5") ^ ord("1")
    path.write_bytes(content)
    assert len(np.load(path)["numbers"]) == 1000
    assert np.array_equal(folder.load_checkpoint("work")["numbers"], np.full(5000, 1))


@pytest.mark.parametrize("seed", range(DAMAGES))
def test_a_damaged_bed_is_refused_by_name_or_is_the_same_bed(seed, bed_file, tmp_path):
    path = tmp_path / "bed.npz"
    shutil.copy(bed_file, path)
    damaged(path, random.Random(seed))
    try:
        about, (settings, state, _) = read_preparation(path), read_file(path)
    except ValueError as error:
        assert str(path) in str(error)
        return
    whole, (of_whole, state_of_whole, _) = read_preparation(bed_file), read_file(bed_file)
    assert (about.recipe, settings) == (whole.recipe, of_whole)
    assert {name: array.tobytes() for name, array in state.items()} == {
        name: array.tobytes() for name, array in state_of_whole.items()
    }
