"""3D-RFT over any shape: surfaces in pieces, the force by closed forms, the file, the function without the package."""

import json
import math

import numpy as np
import pytest

from rigid.ground.rft import flat_plate, function_of, tractions
from rigid.ground.rft_table import RftTable, box_pieces, law_force, mesh_pieces, read_rft, round_pieces

DOWN = (0.0, 0.0, -1.0)
TABLE = {
    "format": "hedgebed-rft/1", "material": "sand", "source": "made up", "gravity": 9.8, "grain": 0.004,
    "bulk_density": 1450.0, "surface_friction": 0.4, "factors": (2e5, 2e5, 2e5, 0.5), "stds": (1e4, 1e4, 1e4, 0.0),
    "left_out": [(xi, xi, xi, 0.5) for xi in (1.9e5, 2e5, 2.1e5)], "unseen": 0.1, "depth": (0.01, 0.02), "side": 0.024,
    "speed": 0.1, "plates": [],
}  # fmt: skip


def test_pieces_of_a_box_a_ball_and_a_mesh_have_their_areas_and_close():
    """The sum of area times normal of a closed surface is zero; areas 2 (ab + bc + ca), 4 pi R^2; volume by Gauss."""
    tetrahedron = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    faces = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    angles = np.linspace(0.0, math.pi, 97)
    ball = round_pieces(np.column_stack([np.sin(angles), 1 - np.cos(angles)]))
    for pieces, area, volume in (
        (box_pieces((0.3, 0.2, 0.1), 35.0), 0.22, 0.006),
        (mesh_pieces(tetrahedron[faces]), 1.5 + math.sqrt(3) / 2, 1 / 6),
        (ball, 4 * math.pi, 4 * math.pi / 3),
    ):
        assert pieces.areas.sum() == pytest.approx(area, rel=1e-3)
        assert np.abs(pieces.areas @ pieces.normals).max() < 1e-9 * area
        assert (pieces.areas * (pieces.points * pieces.normals).sum(axis=1)).sum() / 3 == pytest.approx(
            volume, rel=2e-3
        )


def test_a_level_plate_bears_its_closed_form():
    """F = 0.876 xi z A of the face below; the four thin sides add friction, the face above nothing."""
    side, thick, xi, depth = 0.05, 1e-5, 3e5, 0.02
    force = law_force((xi, xi, xi, 0.0), 0.4, box_pieces((side, side, thick), 0.0), depth, DOWN)
    assert force[2] == pytest.approx(flat_plate() * xi * depth * side**2, rel=2e-3)
    assert np.abs(force[:2]).max() < 1e-12
    assert flat_plate() == pytest.approx(0.876, abs=5e-4)


def test_the_term_of_surfaces_that_face_and_move_down_doubles_a_level_plate_and_spares_an_upright_one():
    """1 + b x1 x2 is 2 for b = 1 and n = v = -z, 1 where n or v is level, and 1 for what is pulled up."""
    level, upright = box_pieces((0.02, 0.02, 1e-6), 0.0), box_pieces((0.02, 0.02, 1e-6), 90.0)
    for pieces, way, times in ((level, DOWN, 2.0), (upright, (1.0, 0.0, 0.0), 1.0), (level, (0.0, 0.0, 1.0), 1.0)):
        with_b, without = (law_force((1e5, 1e5, 1e5, b), 0.0, pieces, 0.02, way) for b in (1.0, 0.0))
        assert with_b == pytest.approx(times * without, rel=1e-3, abs=1e-9)


def test_a_cone_bears_xi_z_cubed_times_the_traction_of_its_side():
    """F = xi alpha_z pi tan(b) / (3 cos(b)) z^3 for half-angle b; what is above the surface bears nothing."""
    half, depth, xi = math.radians(30.0), 0.02, 1e5
    radius = 0.03
    pieces = round_pieces([(0.0, 0.0), (radius, radius / math.tan(half))], along=400)
    alpha = tractions([[math.cos(half), 0.0, -math.sin(half)]], DOWN, surface_friction=0.4)[0, 2]
    wanted = xi * alpha * math.pi * math.tan(half) / (3 * math.cos(half)) * depth**3
    assert law_force((xi, xi, xi, 0.0), 0.4, pieces, depth, DOWN)[2] == pytest.approx(wanted, rel=2e-3)


def test_the_deviation_is_that_of_fits_without_one_bed_and_gravity_scales_the_force():
    """Jackknife: sqrt((n - 1) / n sum of squares); forces are in proportion to the gradients here, 10 % of 2e5 = 1.9 to
    2.1e5 about their mean gives sqrt(2 / 3 * 2 * 0.05^2) of the force."""
    table = RftTable(**TABLE)
    pieces = box_pieces((0.02, 0.02, 0.002), 30.0)
    force, std = table.force(pieces, depth=0.02, direction=(1.0, 0.0, -1.0))
    assert std[2] == pytest.approx(math.sqrt(2 / 3 * 2 * 0.05**2) * force[2])
    weak, _ = table.force(pieces, depth=0.02, direction=(1.0, 0.0, -1.0), gravity=0.98)
    assert weak == pytest.approx(0.1 * force)
    assert force[0] < 0 < force[2]


def test_the_function_without_the_package_gives_the_same_forces():
    """Three different factors, a ball that goes down at an angle and a plate: equal to 1e-5, the digits written."""
    made = {}
    exec(function_of((2.1e5, 1.7e5, 2.6e5, 1.4), 0.35, "sand", 0.1), made)
    for pieces in (box_pieces((0.02, 0.03, 0.002), 60.0), round_pieces([(0.0, 0.0), (0.01, 0.02)])):
        for way in ((1.0, 0.0, -0.5), (0.3, 0.2, -1.0), (1.0, 0.0, 0.0)):
            points = pieces.points - (0.0, 0.0, 0.015)
            own = law_force((2.1e5, 1.7e5, 2.6e5, 1.4), 0.35, pieces, 0.015, way)
            assert made["force"](points, pieces.normals, pieces.areas, way) == pytest.approx(own, rel=1e-5, abs=1e-9)


def test_a_table_reads_back_and_a_wrong_one_names_file_and_key(tmp_path):
    path = tmp_path / "rft.json"
    path.write_text(RftTable(**TABLE).to_json(), encoding="utf-8")
    assert read_rft(path) == RftTable(**TABLE)
    for change, named in (({"gravity": -1}, "gravity"), ({"factors": [0, 0, 0, 1]}, "factors"), ({"new": 1}, "new")):
        path.write_text(json.dumps(json.loads(RftTable(**TABLE).to_json()) | change), encoding="utf-8")
        with pytest.raises(ValueError, match=f"rft.json.*{named}"):
            read_rft(path)
    path.write_text("[1", encoding="utf-8")
    with pytest.raises(ValueError, match=r"rft\.json"):
        read_rft(path)
    with pytest.raises(ValueError, match=r"none\.json"):
        read_rft(tmp_path / "none.json")
    with pytest.raises(ValueError, match="direction"):
        law_force((1, 1, 1, 0), 0.4, box_pieces((1, 1, 1), 0.0), 0.0, (0, 0, 0))
    with pytest.raises(ValueError, match="corners"):
        mesh_pieces(np.zeros((2, 3)))
