"""Packing profile, surface, sizes drawn, first positions: against volumes and a lattice."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dem.grains.packing import bulk_packing, draw_radii, packing_profile, rain_positions, surface_height


def test_the_packing_profile_integrates_to_the_solid_volume():
    rng = np.random.default_rng(1)
    heights, radii = rng.uniform(0.01, 0.05, 500), rng.uniform(0.001, 0.004, 500)
    edges = np.sort(np.concatenate([[0.0, 0.06], rng.uniform(0, 0.06, 40)]))
    profile = packing_profile(heights, radii, 0.002, edges)
    solid = (profile * np.diff(edges)).sum() * 0.002
    assert solid == pytest.approx(4 / 3 * math.pi * (radii**3).sum(), rel=1e-12)


def test_the_packing_profile_of_one_sphere_is_its_section():
    """pi (r^2 - t^2) / A in thin slabs."""
    edges = np.linspace(0.0, 0.02, 2001)
    profile = packing_profile(np.array([0.01]), np.array([0.004]), 0.001, edges)
    t = 0.5 * (edges[1:] + edges[:-1]) - 0.01
    assert profile == pytest.approx(np.pi * np.maximum(0.004**2 - t**2, 0) / 0.001, abs=2e-6)


def lattice(layers, d):
    """A simple cubic lattice of touching spheres over an area of ten by ten; heights and radii."""
    z = np.repeat((np.arange(layers) + 0.5) * d, 100)
    return z, np.full(len(z), d / 2)


def test_bulk_packing_and_surface_of_a_lattice():
    """pi / 6; packing falls to half of it where the top sphere's section does: pi/4 (1 - 4 t^2/d^2) = pi/12."""
    d = 0.002
    heights, radii = lattice(20, d)
    area = (10 * d) ** 2
    edges = np.arange(21) * d
    assert packing_profile(heights, radii, area, edges) == pytest.approx(math.pi / 6)
    bulk = bulk_packing(heights, radii, area)
    assert bulk == pytest.approx(math.pi / 6, rel=0.02)  # its limits do not cut whole layers
    surface = surface_height(heights, radii, area, bulk=math.pi / 6)
    assert surface == pytest.approx(19.5 * d + 0.5 * d * math.sqrt(2 / 3), abs=0.01 * d)


def test_the_surface_of_loose_grains_ignores_a_stray_one():
    d = 0.002
    heights, radii = lattice(20, d)
    with_stray = surface_height(np.append(heights, 30 * d), np.append(radii, d / 2), 100 * d * d, bulk=math.pi / 6)
    assert with_stray == pytest.approx(surface_height(heights, radii, 100 * d * d, bulk=math.pi / 6), abs=0.02 * d)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.floats(0.0, 0.5), st.floats(50, 3000))
def test_radii_add_up_to_the_solid_volume_asked_for(seed, spread, count):
    grain = 0.003
    volume = count * math.pi / 6 * grain**3
    radii = draw_radii(np.random.default_rng(seed), volume, grain, spread)
    assert (np.abs(2 * radii / grain - 1) <= spread + 1e-12).all()
    # The sum of so many draws scatters by about 3 spread / sqrt(3 n); one grain may be rounded off.
    off = abs((4 / 3 * math.pi * radii**3).sum() / volume - 1)
    assert off < 6 * 3 * spread / math.sqrt(3 * len(radii)) + 1 / len(radii)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000), st.floats(0.0, 0.5), st.floats(0.012, 0.03), st.floats(0.012, 0.03))
def test_rain_never_overlaps(seed, spread, width, depth):
    """Across the periodic boundaries too, and nothing reaches below the floor."""
    rng = np.random.default_rng(seed)
    radii = draw_radii(rng, 150 * math.pi / 6 * 0.002**3, 0.002, spread)
    x = rain_positions(rng, radii, (width, depth))
    d = x[:, None] - x[None]
    d[..., :2] -= np.array([width, depth]) * np.round(d[..., :2] / [width, depth])
    gap = np.linalg.norm(d, axis=2) - radii[:, None] - radii
    np.fill_diagonal(gap, 1.0)
    assert gap.min() > 0
    assert (x[:, 2] - radii).min() > 0
    assert (x[:, :2] >= 0).all() and (x[:, :2] <= [width, depth]).all()
