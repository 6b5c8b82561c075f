"""The sketch of the planar model: signs of its drawing are those of the model, and it is the same each time."""

import io
import math

import numpy as np
import pytest

import rigid
from vis.page.plots import styled
from vis.paper.sketch import CLEAR, LEADING, LENGTH, ROWS, draw_sketch, tip

WORDS = (
    "$K$", "$C$", "$N$", "$F$", "$l$", "$x$", "$y$", "$W$", "$m_b$", "$g$", r"$+\tau$", r"\theta", r"\gamma_n",
    "g_{sim}", r"\mu_s", r"\mu_d", r"\omega_w", "z = h - y", "undisturbed surface", "flywheel", "pulleys", "wires",
)  # fmt: skip


def texts(figure):
    """All words of the figure."""
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def test_tips_are_where_the_platform_has_them():
    """At theta = 0 the eight directions of the Hedgehog's tips in the plane, each a row of two or four."""
    platform = rigid.find_platform("hedgehog")
    across = platform.tips[:, [0, 2]]
    reach = np.hypot(*across.T)
    outer = across[reach > 0.99 * reach.max()]
    assert reach.max() == pytest.approx(LENGTH, rel=1e-3)
    drawn = np.array([tip(row, (0.0, 0.0), 0.0) for row in range(ROWS)])
    for point in outer:
        assert np.linalg.norm(drawn - point, axis=1).min() < 1e-3 * LENGTH
    for point in drawn:
        assert np.linalg.norm(outer - point, axis=1).min() < 1e-3 * LENGTH
    assert platform.stance().lean == pytest.approx(math.pi / ROWS)
    assert 0 < CLEAR < LENGTH


def test_theta_turns_clockwise_and_the_leading_row_is_ahead_and_lower():
    """A clockwise turn lifts row 0, behind, and lowers row 7, ahead: d(x, y)/dtheta of a point is (y, -x) about 0."""
    rear, ahead = (np.array(tip(row, (0.0, 0.0), 0.0)) for row in (0, LEADING))
    assert rear[0] < 0 < ahead[0] and rear[1] == pytest.approx(ahead[1])
    small = 1e-6
    for row in range(ROWS):
        point, moved = (np.array(tip(row, (0.0, 0.0), theta)) for theta in (0.0, small))
        assert (moved - point) / small == pytest.approx([point[1], -point[0]], abs=1e-5)
    assert tip(0, (0.0, 0.0), 0.1)[1] > rear[1]


def test_every_symbol_of_the_model_is_on_the_sketch_and_inside_it():
    with styled():
        figure = draw_sketch()
        figure.canvas.draw()
        written = " ".join(texts(figure))
        assert [word for word in WORDS if word not in written] == []
        page = figure.bbox
        for axis in figure.axes:
            for text in axis.texts:
                box = text.get_window_extent()
                where = (text.get_text(), box)
                assert box.x0 >= page.x0 and box.x1 <= page.x1 and box.y0 >= page.y0 and box.y1 <= page.y1, where


def test_the_sketch_is_the_same_each_time():
    drawn = []
    for _ in range(2):
        with styled():
            file = io.BytesIO()
            draw_sketch().savefig(file, dpi=40, metadata={"Software": None})
        drawn.append(file.getvalue())
    assert drawn[0] == drawn[1]
