"""Height maps, and frames that hold them and points with forces."""

import math

import numpy as np
import pytest

from vis.pictures.frames import FrameWriter, HeightMap, read_frames
from vis.pictures.tracks import height_map, lying


def test_a_height_map_is_the_upper_side_of_the_spheres_also_across_the_bed_s_ends():
    """Over a sphere z = z_c + sqrt(r^2 - d^2); one at x = 0 shows at both ends, one left out not at all."""
    radius = 3e-3
    at = np.array([[0.0, 0.01, 0.004], [0.02, 0.01, 0.005], [0.03, 0.01, 0.5]])
    found = height_map(at, np.full(3, radius), (0.04, 0.02), spacing=5e-4, lies=[True, True, False])
    height = found.fields["height"]
    assert height.shape == (40, 80) and found.spacing == pytest.approx((5e-4, 5e-4))
    x = found.origin[0] + found.spacing[0] * np.arange(80)
    y = found.origin[1] + found.spacing[1] * np.arange(40)
    across = np.minimum(abs(x[None, :] - at[0, 0]), 0.04 - abs(x[None, :] - at[0, 0]))
    expected = np.zeros_like(height)
    for d2, z in ((across**2 + (y[:, None] - 0.01) ** 2, 0.004), ((x - 0.02) ** 2 + (y[:, None] - 0.01) ** 2, 0.005)):
        expected = np.maximum(expected, np.where(d2 < radius**2, z + np.sqrt(np.maximum(radius**2 - d2, 0)), 0))
    assert height == pytest.approx(expected, abs=1e-12)
    covered = np.count_nonzero(height) * 5e-4**2
    assert covered == pytest.approx(2 * math.pi * radius**2, rel=0.03)


def test_what_hangs_on_a_spike_or_flies_is_no_part_of_the_surface_and_a_heap_is():
    """A cubic bed, 5 x 5 x 4; two grains on top of one another in the middle, and two that touch high above."""
    r, apart = 1e-3, 1.999e-3
    bed = apart * (np.stack(np.meshgrid(*map(np.arange, (5, 5, 4)), indexing="ij"), axis=-1).reshape(-1, 3) + 0.5)
    x, y, z = bed[bed[:, 2] == bed[:, 2].max()][12]
    heap, aloft = [[x, y, z + apart], [x, y, z + 2 * apart]], [[x, y, 0.05], [x + apart, y, 0.05]]
    found = lying(np.vstack([bed, heap, aloft]), np.full(104, r))
    assert found.tolist() == [True] * 102 + [False] * 2
    assert lying(np.empty((0, 3)), []).shape == (0,)


def test_frames_keep_forces_and_the_surface_and_paraview_s_reader_finds_them(tmp_path):
    import pyvista

    writer = FrameWriter(tmp_path, name="tumble")
    force = np.array([[0.0, 0.0, 1.5]])
    for time in (0.0, 0.1):
        rows = slice(0, 1) if time else slice(0, 0)  # at first nothing touches
        change = np.arange(6.0).reshape(2, 3) * time
        writer.write(
            time, {"position": np.zeros((2, 3)), "radius": np.full(2, 1e-3)},
            clouds={"row_forces": (np.array([[0.1, 0.2, 0.3]])[rows], {"force": force[rows]})},
            maps={"surface": HeightMap((0.5, 1.5), (1.0, 2.0), {"height": change + 1, "change": change})},
        )  # fmt: skip
    first, last = read_frames(tmp_path, "tumble")
    assert len(first.clouds["row_forces"][0]) == 0 and not first.bodies
    points, fields = last.clouds["row_forces"]
    assert points == pytest.approx(np.array([[0.1, 0.2, 0.3]])) and fields["force"] == pytest.approx(force)
    surface = last.maps["surface"]
    assert surface.fields["change"] == pytest.approx(np.arange(6.0).reshape(2, 3) * 0.1)
    assert (surface.origin, surface.spacing) == ((0.5, 1.5), (1.0, 2.0))
    reader = pyvista.PVDReader(tmp_path / "frames" / "tumble.pvd")
    reader.set_active_time_value(0.1)
    _, arrows, grid = reader.read()
    assert arrows["force"] == pytest.approx(force)
    # Warped by its height it lies where the surface is: x fastest, then y.
    assert grid.warp_by_scalar("height").points[:, 2] == pytest.approx(1 + 0.1 * np.arange(6.0))
    assert grid.points[1] == pytest.approx([1.5, 1.5, 0.0])


def test_maps_and_forces_of_wrong_shape_are_refused_by_name(tmp_path):
    grains = {"position": np.zeros((1, 3))}
    with pytest.raises(ValueError, match="'surface'"):
        FrameWriter(tmp_path).write(0.0, grains, maps={"surface": HeightMap((0, 0), (1, 1), {"height": np.zeros(3)})})
    with pytest.raises(ValueError, match="'force' of 'rows' has 2 rows for 1 points"):
        FrameWriter(tmp_path).write(0.0, grains, clouds={"rows": (np.zeros((1, 3)), {"force": np.zeros((2, 3))})})
    with pytest.raises(ValueError, match="spacing"):
        height_map(np.zeros((1, 3)), [1.0], (1.0, 1.0), spacing=0.0)
