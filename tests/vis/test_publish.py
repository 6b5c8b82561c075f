"""Pictures for the documentation: true colours, even steps, no wider than a page."""

import numpy as np
import pytest
from PIL import Image

from vis.pictures.canvas import colourmap, even_steps, nice_above
from vis.pictures.publish import even_colours, main, publish


@pytest.fixture
def bar(tmp_path):
    """A colour bar, light at its foot, beside white."""
    colours = np.round(255 * colourmap()(np.linspace(0.0, 1.0, 512))[:, :3]).astype(np.uint8)
    image = np.full((512, 1200, 3), 255, np.uint8)
    image[:, :300] = colours[::-1, None, :]
    path = tmp_path / "bar.png"
    Image.fromarray(image).save(path)
    return path


def test_a_colour_bar_keeps_even_steps_without_a_palette(bar, tmp_path):
    """Each channel in steps of 4 of 255: no two neighbours on the bar differ by more than two of them."""
    size = publish(bar, tmp_path / "out.png")
    with Image.open(tmp_path / "out.png") as read:
        assert read.mode == "RGB" and read.size == (1000, round(512 * 1000 / 1200))
        image = np.asarray(read).astype(int)
    assert size == (tmp_path / "out.png").stat().st_size
    column = image[2:-2, 100]
    assert np.abs(np.diff(column, axis=0)).max() <= 9
    assert len(np.unique(column, axis=0)) > 100
    assert (image[:, 800] == 255).all()


def test_colours_change_by_less_than_one_step():
    every = np.arange(256, dtype=np.uint8)
    rounded = even_colours(every).astype(int)
    assert np.abs(rounded - every).max() <= 3
    assert rounded[0] == 0 and rounded[-1] == 255
    assert set(np.diff(np.unique(rounded))) <= {4, 5} and len(np.unique(rounded)) == 64


def test_what_is_transparent_becomes_white(tmp_path):
    Image.new("RGBA", (8, 8), (200, 0, 0, 0)).save(tmp_path / "clear.png")
    publish(tmp_path / "clear.png", tmp_path / "out.png")
    assert (np.asarray(Image.open(tmp_path / "out.png")) == 255).all()


def test_what_is_no_picture_is_refused_by_name(tmp_path, capsys):
    (tmp_path / "text.png").write_text("no picture")
    for source, target in (("text.png", "out.png"), ("missing.png", "out.png"), ("text.png", "out.gif")):
        with pytest.raises(SystemExit) as stopped:
            main([str(tmp_path / source), str(tmp_path / target)])
        assert stopped.value.code == 2
        named = target if target.endswith(".gif") else source
        assert named in capsys.readouterr().err


@pytest.mark.parametrize("least", [0.7, 1.0, 1.2, 1.7, 2.5, 3.3, 4.2, 5.5, 7.0, 9.0])
@pytest.mark.parametrize("power", [1e-3, 1.0, 1e4])
def test_numbers_at_a_colour_bar_are_round_and_equally_far_apart_up_to_its_end(least, power):
    """Steps of 1, 2 or 5 times a power of ten, three to six of them."""
    top = nice_above(least * power)
    marks = even_steps(top)
    assert marks[0] == 0.0 and marks[-1] == pytest.approx(top)
    steps = np.diff(marks)
    assert steps == pytest.approx(steps[0]) and 3 <= len(steps) <= 6
    first = steps[0] / 10.0 ** np.floor(np.log10(steps[0]) + 1e-9)
    assert min(abs(first - n) for n in (1.0, 2.0, 5.0, 10.0)) < 1e-6
