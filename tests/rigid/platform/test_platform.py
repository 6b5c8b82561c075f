"""The platforms: geometry, mesh, inertia; the files that ship and files that are wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from rigid.platform.files import PLATFORM_FOLDER, find_platform, platform_names, read_platform
from rigid.platform.inertia import Part, check_inertia, combine

HEDGEHOG = find_platform("hedgehog")
ALL = pytest.mark.parametrize("name", platform_names())


# The Hedgehog ---------------------------------------------------------------------------------------------------------


def test_24_spikes_end_at_the_corners_of_a_rhombicuboctahedron():
    """Circumradius edge sqrt(5 + 2 sqrt 2) / 2 = 0.214 m; each corner has four neighbours, an edge away."""
    assert HEDGEHOG.spike_count == 24
    distance = np.linalg.norm(HEDGEHOG.tips, axis=1)
    assert distance == pytest.approx(0.5 * 0.153 * math.sqrt(5 + 2 * math.sqrt(2)), rel=1e-12)
    assert distance[0] == pytest.approx(0.214, abs=5e-4)
    apart = np.linalg.norm(HEDGEHOG.tips[:, None] - HEDGEHOG.tips[None], axis=2)
    assert (np.isclose(apart, 0.153).sum(axis=1) == 4).all()


def test_its_octagonal_section_is_400_mm_across_with_eight_rows_of_two():
    """In the plane of motion the 16 tips of the rows lie in pairs on a circle of l = 0.2 m, 45 degrees apart."""
    radius = np.hypot(HEDGEHOG.tips[:, 0], HEDGEHOG.tips[:, 2])
    outer = HEDGEHOG.tips[radius > 0.19]
    assert len(outer) == 16
    assert 2 * radius.max() == pytest.approx(0.4, abs=5e-4)
    angles = np.sort(np.degrees(np.arctan2(outer[:, 0], -outer[:, 2])) % 360)
    assert angles[::2] == pytest.approx(22.5 + 45 * np.arange(8))
    assert angles[1::2] == pytest.approx(22.5 + 45 * np.arange(8))
    assert np.unique(np.round(outer[:, 1], 9)) == pytest.approx([-0.0765, 0.0765])


def test_it_stands_on_two_rows_of_two_and_tumbles_at_22_5_degrees():
    stance = HEDGEHOG.stance()
    assert (len(stance.row), len(stance.rear)) == (2, 2)
    assert stance.lean == pytest.approx(math.pi / 8)
    assert stance.spike_length == pytest.approx(0.2, abs=2e-4)
    assert (HEDGEHOG.tips[list(stance.row), 0] > 0).all()


def test_its_mesh_is_closed_and_its_hull_has_the_volume_of_the_solid():
    """Rhombicuboctahedron: V = (4 + 10 sqrt(2) / 3) a^3, A = (18 + 2 sqrt 3) a^2; normals outward make V positive."""
    hull, whole = HEDGEHOG.hull(), HEDGEHOG.mesh(around=16)
    edge = 0.153 * (1 - 0.040 / np.linalg.norm(HEDGEHOG.tips[0]))
    assert hull.volume == pytest.approx((4 + 10 * math.sqrt(2) / 3) * edge**3, rel=1e-12)
    assert hull.area == pytest.approx((18 + 2 * math.sqrt(3)) * edge**2, rel=1e-12)
    assert hull.is_watertight and whole.is_watertight
    assert np.linalg.norm(whole.vertices, axis=1).max() == pytest.approx(HEDGEHOG.reach)
    clear = HEDGEHOG.reach - np.linalg.norm(HEDGEHOG.hull_vertices, axis=1).max()
    assert clear == pytest.approx(0.040)


def test_a_mesh_with_a_hole_or_a_face_turned_round_is_not_closed():
    mesh = HEDGEHOG.hull()
    assert not type(mesh)(mesh.vertices, mesh.faces[1:]).is_watertight
    faces = mesh.faces.copy()
    faces[0] = faces[0][::-1]
    assert not type(mesh)(mesh.vertices, faces).is_watertight


def test_its_numbers_are_those_of_the_paper_or_say_that_they_are_ours():
    assert (HEDGEHOG.mass, HEDGEHOG.moment(), HEDGEHOG.wheel().inertia) == (5.3, 0.06, 1.2e-3)
    assert (HEDGEHOG.wheel().motor_torque, HEDGEHOG.wheel().brake_torque) == (0.22, 6.0)
    assert np.array([wheel.axis for wheel in HEDGEHOG.wheels]) == pytest.approx(np.eye(3))
    assert HEDGEHOG.sources["body.inertia"].startswith("ours")


# Those that ship ------------------------------------------------------------------------------------------------------


@ALL
def test_a_platform_that_ships_stands_is_closed_and_gives_its_sources(name):
    platform = find_platform(name)
    assert 0 < platform.stance().lean < math.pi / 2
    assert platform.mesh().is_watertight
    assert {"body.mass", "wheels.inertia", "wheels.max_speed", "wheels.motor_torque"} <= set(platform.sources)
    with pytest.raises(ValueError, match="no wheel about"):
        platform.wheel((1.0, 1.0, 0.0))


def test_the_others_have_the_sizes_that_are_published():
    """Cubli 15 cm cube; MASCOT 29.5 x 27.5 x 19.5 cm, 9.8 kg (NSSDC); MINERVA 12 cm across, 10 cm, 591 g (JAXA)."""
    cubli, mascot, minerva = (find_platform(name) for name in ("cubli", "mascot", "minerva"))
    assert np.ptp(cubli.tips, axis=0) == pytest.approx([0.15, 0.15, 0.15])
    assert cubli.stance().lean == pytest.approx(math.pi / 4)
    assert np.ptp(mascot.tips, axis=0) == pytest.approx([0.295, 0.275, 0.195])
    assert mascot.inertia[1, 1] == pytest.approx(9.8 * (0.295**2 + 0.195**2) / 12)
    assert np.hypot(*minerva.tips[:, [0, 2]].T) == pytest.approx(0.06)
    assert (mascot.mass, minerva.mass) == (9.8, 0.591)


# Inertia --------------------------------------------------------------------------------------------------------------


def test_parts_add_up_by_steiner():
    """Two balls on a rod: 2 (2/5 m r^2 + m d^2) across, 2/5 m r^2 each along; the rod m L^2 / 12."""
    parts = [Part(mass=2.0, shape="ball", size=(0.1,), position=(s * 0.5, 0, 0)) for s in (-1, 1)]
    parts.append(Part(mass=1.0, shape="cylinder", size=(0.01, 1.0), axis="x"))
    mass, centre, inertia = combine(parts)
    along = 2 * 0.4 * 2 * 0.01 + 0.5 * 1.0 * 0.01**2
    across = 2 * (0.4 * 2 * 0.01 + 2 * 0.25) + 1 / 12 + 0.25 * 0.01**2
    assert (mass, centre.tolist()) == (5.0, [0, 0, 0])
    assert inertia == pytest.approx(np.diag([along, across, across]), abs=1e-15)


def test_a_box_of_boxes_is_the_box():
    eighths = [
        Part(mass=0.125, shape="box", size=(0.1, 0.2, 0.3), position=(0.05 * a, 0.1 * b, 0.15 * c))
        for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)
    ]  # fmt: skip
    whole = Part(mass=1.0, shape="box", size=(0.2, 0.4, 0.6)).inertia()
    assert combine(eighths)[2] == pytest.approx(whole, abs=1e-15)


@pytest.mark.parametrize(
    ("tensor", "said"),
    [
        (np.diag([0.1, 0.02, 0.02]), "sum of the other two"),
        (np.diag([0.02, -0.02, 0.02]), "above 0"),
        (np.diag([0.3, 0.3, 0.3]), "m r"),
        ([[0.1, 0.02, 0], [0, 0.1, 0], [0, 0, 0.1]], "symmetric"),
        (np.eye(2), "3 x 3"),
    ],
)
def test_an_inertia_that_no_body_has_is_refused(tensor, said):
    with pytest.raises(ValueError, match=said):
        check_inertia(tensor, 5.3, 0.214)


def test_the_limits_of_inertia_are_reached_by_a_ring_and_a_shell_and_not_refused():
    check_inertia(Part(mass=1.0, shape="ring", size=(0.2,)).inertia(), 1.0, 0.2)
    check_inertia(Part(mass=1.0, shape="shell", size=(0.2,)).inertia(), 1.0, 0.2)


# Files that are wrong -------------------------------------------------------------------------------------------------


def write(folder, *changes):
    text = (PLATFORM_FOLDER / "hedgehog.toml").read_text(encoding="utf-8")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("mass = 5.3", "mass = -5.3", r"body\.mass = -5\.3 .*greater than 0"),
        ("mass = 5.3", 'mass = "5.3"', r"body\.mass = '5\.3' .*valid number"),
        ("mass = 5.3 ", "", r"body\.mass is missing"),
        ("mass = 5.3", "mas = 5.3\nmass = 5.3", r"body\.mas = 5\.3 is no key .*did you mean 'mass'"),
        ("clear = 0.040", "clearr = 0.040", r"spikes\.clearr = 0\.04 is no key .*did you mean 'clear'"),
        ("[body]", "colour = 3\n[body]", r"colour = 3 is no key .*there is format, name, body, hull"),
        ("[0.06, 0.06, 0.06]", "[0.06, 0.06, 0.2]", "sum of the other two"),
        ("[0.06, 0.06, 0.06]", "[0.6, 0.6, 0.6]", r"m r\^2"),
        ("edge = 0.153 ", "size = [1.0, 1.0, 1.0] ", "edge"),
        ("clear = 0.040", "clear = 0.5", r"spikes\.clear = 0\.5"),
        ("inertia = 1.2e-3", "inertia = 0.07", "wheel"),
        ("[0.0, 1.0, 0.0], ", "[0.0, 1.0, 0.5], ", "orthogonal"),
        ("hedgebed-platform/1", "hedgebed-platform/9", "format"),
        ("[body]", "[body", "not TOML"),
    ],
)
def test_a_wrong_file_is_refused_with_file_key_found_and_expected(tmp_path, before, after, said):
    path = write(tmp_path, (before, after))
    with pytest.raises(ValueError, match=said) as refused:
        read_platform(path)
    assert str(path) in str(refused.value)


def test_a_platform_there_is_not_is_refused_with_those_there_are():
    with pytest.raises(ValueError, match=r"'hedgehoq'.*hedgehog"):
        find_platform("hedgehoq")
    with pytest.raises(ValueError, match=r"nowhere\.toml"):
        find_platform("nowhere.toml")


def test_a_file_of_ones_own_is_read_and_goes_before_the_name_of_one_that_ships(tmp_path, monkeypatch):
    path = write(tmp_path, ("mass = 5.3", "mass = 6.1"))
    assert find_platform(path).mass == 6.1
    monkeypatch.chdir(tmp_path)
    assert find_platform("cube").mass == 0.1
    path.rename("cube")
    assert find_platform("cube").mass == 6.1


def test_the_file_in_the_docs_is_a_platform(tmp_path):
    """Tips reach l = edge / (2 sin(pi/8)) = 0.18 m within the digits shown."""
    text = (Path(__file__).parents[3] / "docs" / "platform.md").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    platform = read_platform(tmp_path / "mine.toml")
    assert platform.mass == 4.2
    assert platform.stance().spike_length == pytest.approx(0.18, abs=1e-4)
