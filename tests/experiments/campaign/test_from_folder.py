"""`hedgebed campaign new --from`: a campaign of one's own recordings, with what they do not show marked and listed."""

import re

import numpy as np
import pytest
from golden import golden

from experiments.campaign import read_campaign
from experiments.campaign.files import new_from_recordings
from experiments.campaign.headers import Column, column_of
from experiments.cli.main import main

OTHERS = "Time [s],Crosshead displacement (mm),Load cell [N],Temperature [degC]"


def recordings(folder, headers):
    """Pushes of 20 mm, a file for each of `headers`, whose second column is in mm."""
    folder.mkdir()
    time = np.linspace(0, 2, 50)
    rows = np.column_stack([time, 10 * time, 7 * time, 20 + time])
    for number, header in enumerate(headers, start=1):
        width = header.count(",") + 1
        lines = [",".join(f"{cell:.4f}" for cell in row[:width]) for row in rows]
        (folder / f"{number}.csv").write_bytes("\r\n".join([header, *lines, ""]).encode())
    return folder


def filled(folder):
    """campaign.toml with a value for every "unknown"."""
    values = {"diameter": "0.02", "tip": '"flat"', "kind": '"sand"', "granular": "true", "std": "[0.05]", "mass": "0.5"}
    path = folder / "campaign.toml"
    path.write_text(
        re.sub(
            r'^(\w+) = (?:"unknown"|\["unknown"\])',
            lambda m: f"{m[1]} = {values.get(m[1], '0.01')}",
            path.read_text(),
            flags=re.M,
        )
    )


@pytest.mark.parametrize(
    ("heading", "quantity", "unit"),
    [
        ("force [N]", "force", "N"),
        ("z_mm", "depth", "mm"),
        ("Load cell (kN)", "force", "kN"),
        ("Time, sec", "t", "s"),
        ("Displacment / mm", "depth", "mm"),
        ("Acceleration (m/s^2)", "accel", "m_s2"),
        ("accel_m_s2", "accel", "m_s2"),
        ("depth", "depth", ""),
        ("Temperature [degC]", "", "degC"),
        ("mass", "", ""),
        ("force time", "", ""),
    ],
)
def test_a_heading_is_recognised_by_its_words_and_unit(heading, quantity, unit):
    assert column_of(heading) == Column(quantity, unit)


def test_own_recordings_become_a_campaign_that_reads_once_the_unknown_is_filled_in(tmp_path):
    """The recordings stay as they are, and their copies differ in the first line only."""
    source = recordings(tmp_path / "r", [OTHERS, OTHERS, "t_s,depth_mm,force_N"])
    before = {path.name: path.read_bytes() for path in source.iterdir()}
    found = new_from_recordings(tmp_path / "own", source)
    assert {path.name: path.read_bytes() for path in source.iterdir()} == before
    for name, content in before.items():
        assert (tmp_path / "own" / name).read_bytes().partition(b"\n")[2] == content.partition(b"\n")[2]
    assert (tmp_path / "own" / "3.csv").read_bytes() == before["3.csv"]
    with pytest.raises(ValueError, match="unknown") as refused:
        read_campaign(tmp_path / "own")
    keys = ("diameter", "tip", "granular", r"\[sensors.depth\] std", r"\[sensors.force\] std")
    lines = str(refused.value).splitlines()
    assert len(lines) == len(keys) and all(re.search(key, line) for key, line in zip(keys, lines, strict=True))
    assert len(found.columns) == 2 and "(mm)' is depth_mm" in found.columns[0]
    filled(tmp_path / "own")
    campaign = read_campaign(tmp_path / "own")
    assert [trial.id for trial in campaign.tables.trial] == ["1", "2", "3"]
    assert campaign.recording("1", "data")["depth_m"][-1] == pytest.approx(0.02)
    assert "Temperature [degC]" in campaign.recording("1", "data").extra
    assert campaign.tables.uncertainty.stiffness == campaign.tables.uncertainty.damping == 1.0


def test_what_is_not_recognised_is_listed_by_file_and_column_and_check_names_it_too(tmp_path):
    headers = ["time,depth [cm],F [kN]", "t_s,z_mm,displacement_mm,force_N", "depth_mm,force_N", "Time [s],z [m],a [g]"]
    found = new_from_recordings(tmp_path / "own", recordings(tmp_path / "r", headers))
    golden("campaign/from_folder", "\n".join([*found.columns, *found.unknown]))
    filled(tmp_path / "own")
    with pytest.raises(ValueError, match=r"1\.csv") as refused:
        read_campaign(tmp_path / "own")
    assert [re.search(r"(\d)\.csv", line)[1] for line in str(refused.value).splitlines()] == ["1", "2", "3"]


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"t_s;depth_m;force_N\n0;0;0\n", r"1\.csv, line 1: .*semicolons"),
        (b"0,0,0\n1,1,1\n", r"1\.csv, line 1: is '0,0,0'"),
        (b"t_s,depth_m,force_N \xff\n", r"1\.csv: is not UTF-8"),
        (None, "holds no CSV file"),
    ],
)
def test_a_folder_that_cannot_be_read_is_refused_and_nothing_is_written(tmp_path, content, fault):
    source = tmp_path / "r"
    source.mkdir()
    if content is not None:
        (source / "1.csv").write_bytes(content)
    with pytest.raises(ValueError, match=fault):
        new_from_recordings(tmp_path / "own", source)
    assert not (tmp_path / "own").exists()


def test_the_command_writes_it_and_asks_for_a_kind_without_recordings(tmp_path, capsys):
    source = recordings(tmp_path / "r", [OTHERS])
    assert main(["campaign", "new", str(tmp_path / "own"), "--from", str(source)]) == 0
    assert "to fill in" in capsys.readouterr().err
    for wrong in ([], ["--kind", "tumble", "--from", str(source)]):
        assert main(["campaign", "new", str(tmp_path / "other"), *wrong]) == 2
        assert "penetration" in capsys.readouterr().err
