"""What is written is what other programs read back; a resumed series has neither gaps nor doubles."""

import re
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest
import pyvista

from vis.pictures.frames import GRAIN_FIELDS, FrameWriter, check_frames, frame_names, read_frames
from vis.pictures.meshes import spike_mesh

COUNT = 50


def grains(seed=0):
    rng = np.random.default_rng(seed)
    return {
        "id": np.arange(COUNT),
        "position": rng.random((COUNT, 3)),
        "radius": rng.uniform(0.001, 0.002, COUNT),
        "velocity": rng.normal(size=(COUNT, 3)),
        "spin": rng.normal(size=(COUNT, 3)),
        "force": rng.normal(size=(COUNT, 3)),
        "coordination": rng.integers(0, 9, COUNT),
        "displacement": rng.normal(size=(COUNT, 3)),
    }


def spike():
    return {"spike": spike_mesh("sphere", diameter=0.012, length=0.05, segments=12)}


def fill(folder, times, **options):
    writer = FrameWriter(folder, **options)
    for time in times:
        writer.write(time, grains(int(1000 * time)), spike(), values={"depth": 2 * time})
    return writer


def test_meshio_reads_points_cells_and_fields(tmp_path):
    fill(tmp_path, [0.0])
    given = grains(0)
    mesh = meshio.read(tmp_path / "frames/grains_0000.vtu")
    assert {block.type: len(block.data) for block in mesh.cells} == {"vertex": COUNT}
    assert set(mesh.point_data) == set(GRAIN_FIELDS)
    assert np.allclose(mesh.points, given["position"], rtol=1e-6)
    for name in GRAIN_FIELDS:
        assert mesh.point_data[name].shape == given[name].shape
        assert np.allclose(mesh.point_data[name], given[name], rtol=1e-6)
    assert mesh.point_data["velocity"].dtype == np.float32
    body = meshio.read(tmp_path / "frames/spike_0000.vtu")
    points, triangles = spike()["spike"]
    assert {block.type: len(block.data) for block in body.cells} == {"triangle": len(triangles)}
    assert np.allclose(body.points, points, atol=1e-8)


def test_pvd_lists_parts_and_times(tmp_path):
    fill(tmp_path, [0.0, 0.1, 0.2], name="drop-0.1-seed1")
    root = ElementTree.parse(tmp_path / "frames/drop-0.1-seed1.pvd").getroot()
    sets = [(float(s.get("timestep")), s.get("part"), s.get("file")) for s in root.iter("DataSet")]
    assert sets[:3] == [
        (0.0, "0", "drop-0.1-seed1_grains_0000.vtu"),
        (0.0, "1", "drop-0.1-seed1_spike_0000.vtu"),
        (0.1, "0", "drop-0.1-seed1_grains_0001.vtu"),
    ]
    reader = pyvista.PVDReader(tmp_path / "frames/drop-0.1-seed1.pvd")
    assert reader.time_values == [0.0, 0.1, 0.2]
    reader.set_active_time_value(0.1)
    both = reader.read()
    assert [block.n_points for block in both] == [COUNT, len(spike()["spike"][0])]


def test_frames_come_back(tmp_path):
    fill(tmp_path, [0.0, 0.1])
    frames = read_frames(tmp_path)
    assert len(frames) == 2
    assert [frame.time for frame in frames] == [0.0, 0.1]
    assert frames[-1].values == {"depth": 0.2}
    assert np.allclose(frames[1].grains["displacement"], grains(100)["displacement"], rtol=1e-6)
    assert frames[0].bodies["spike"][1].tolist() == spike()["spike"][1].tolist()


def test_several_runs_lie_side_by_side(tmp_path):
    fill(tmp_path, [0.0, 0.1], name="drop-0.1")
    fill(tmp_path, [0.0], name="drop-0.1-seed2")
    assert frame_names(tmp_path) == ["drop-0.1", "drop-0.1-seed2"]
    fill(tmp_path, [0.5], name="drop-0.1")  # afresh: the old frames of this run go, the other run's stay
    assert read_frames(tmp_path, "drop-0.1").times.tolist() == [0.5]
    assert not (tmp_path / "frames/drop-0.1_grains_0001.vtu").exists()
    assert len(read_frames(tmp_path, "drop-0.1-seed2")) == 1


def test_resumed_series_is_the_uninterrupted_one(tmp_path):
    fill(tmp_path / "whole", [0.0, 0.1, 0.2, 0.3])
    fill(tmp_path / "cut", [0.0, 0.1, 0.2])
    writer = FrameWriter(tmp_path / "cut", resume=True, keep_until=0.1)
    assert writer.times == [0.0, 0.1]
    assert not (tmp_path / "cut/frames/grains_0002.vtu").exists()
    for time in (0.1, 0.2, 0.3):  # the frame of the checkpoint is written again and takes the old one's place
        writer.write(time, grains(int(1000 * time)), spike(), values={"depth": 2 * time})
    files = sorted(path.name for path in (tmp_path / "whole/frames").iterdir())
    assert sorted(path.name for path in (tmp_path / "cut/frames").iterdir()) == files
    for name in files:
        assert (tmp_path / "cut/frames" / name).read_bytes() == (tmp_path / "whole/frames" / name).read_bytes()


def test_a_frame_of_a_moment_of_its_own_takes_the_place_of_the_last_such_frame(tmp_path):
    writer = FrameWriter(tmp_path, name="robot")
    for time, own in ((0.0, False), (0.04, True), (0.06, True), (0.1, False), (0.13, True), (0.2, False)):
        writer.write(time, grains(int(1000 * time)), spike(), own_moment=own)
    assert read_frames(tmp_path, "robot").times.tolist() == [0.0, 0.1, 0.13, 0.2]
    read_frames(tmp_path, "robot").check()
    names = [path.stem for path in (tmp_path / "frames").glob("robot_grains_*")]
    assert sorted(names) == [f"robot_grains_{one}" for one in ("0000", "0001", "0002", "at_130000000")]
    again = FrameWriter(tmp_path, name="robot", resume=True, keep_until=0.12)
    again.write(0.2, grains(200), spike(), own_moment=True)
    again.write(0.2, grains(200), spike())  # a frame at an even time at that moment takes its place
    assert again.times == [0.0, 0.1, 0.2] and not list((tmp_path / "frames").glob("*_at_*"))


def test_an_empty_bed_and_no_body(tmp_path):
    writer = FrameWriter(tmp_path)
    writer.write(0.0, {"position": np.zeros((0, 3)), "radius": np.zeros(0)})
    assert len(read_frames(tmp_path)[0].grains["position"]) == 0


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"radius": np.ones(COUNT - 1)}, "radius"),
        ({"velocity": np.ones((COUNT, 2))}, "velocity"),
        ({"force": np.full((COUNT, 3), np.nan)}, "force"),
        ({"temperature": np.ones(COUNT)}, "temperature"),
    ],
)
def test_wrong_arrays_are_refused_by_name(tmp_path, changed, word):
    with pytest.raises(ValueError, match=word):
        FrameWriter(tmp_path).write(0.0, grains() | changed)


def test_other_misuse_is_refused(tmp_path):
    writer = fill(tmp_path, [0.0, 0.1])
    with pytest.raises(ValueError, match="time"):
        writer.write(0.05, grains())
    with pytest.raises(ValueError, match="triangles"):
        writer.write(0.2, grains(), {"spike": (np.zeros((3, 3)), [[0, 1, 3]])})
    with pytest.raises(ValueError, match="name"):
        FrameWriter(tmp_path, name="../out")
    with pytest.raises(ValueError, match="keep_until"):
        FrameWriter(tmp_path, keep_until=1.0)
    with pytest.raises(FileNotFoundError):
        read_frames(tmp_path, "nothing")
    (tmp_path / "frames/frames.pvd").write_text("<VTKFile>")
    with pytest.raises(ValueError, match="PVD"):
        read_frames(tmp_path)


@pytest.mark.parametrize("file", ["grains_0001.vtu", "spike_0000.vtu", "frames.pvd"])
@pytest.mark.parametrize("end", [True, False])
def test_a_damaged_frame_is_refused_by_name(file, end, tmp_path):
    """Cut off, and with one digit changed that no reader of the format can see."""
    fill(tmp_path, [0.0, 0.25])
    check_frames(tmp_path)
    path = tmp_path / "frames" / file
    content = path.read_bytes()
    changed = content.replace(b"0.25", b"0.35") if file == "frames.pvd" else content.replace(b"A", b"B", 1)
    assert changed != content
    path.write_bytes(content[:-40] if end else changed)
    with pytest.raises(ValueError, match=re.escape(str(path))):
        list(read_frames(tmp_path))
    with pytest.raises(ValueError, match=re.escape(str(path))):
        check_frames(tmp_path)


def test_frames_of_earlier_versions_have_no_digests_and_are_read(tmp_path):
    fill(tmp_path, [0.0, 0.25])
    path = tmp_path / "frames" / "frames.pvd"
    tree = ElementTree.parse(path)
    tree.getroot().remove(tree.getroot().find("Digests"))
    tree.write(path)
    check_frames(tmp_path)
    assert [frame.time for frame in read_frames(tmp_path)] == [0.0, 0.25]
    FrameWriter(tmp_path, resume=True).write(0.5, grains())
    assert [frame.time for frame in read_frames(tmp_path)] == [0.0, 0.25, 0.5]
