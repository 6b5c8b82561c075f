"""A picture of a run for the documentation: `python -m vis.pictures.publish PICTURE.png docs/images/NAME.png`.

Its colours stay true, 24 bits for each pixel without a palette: a palette of 256 divides a colour bar into uneven
steps. It becomes small by its width and by colours in 64 even steps of each channel, which nobody sees.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

__all__ = ["even_colours", "main", "publish"]

WIDTH = 1000
"""Of a picture on a page [pixels]."""


def even_colours(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image with each channel in 64 even steps, of the same shape; black and white stay what they are."""
    coarse = image >> 2
    return (coarse << 2 | coarse >> 4).astype(np.uint8)


def publish(source: Path, target: Path, *, width: int = WIDTH) -> int:
    """Write a picture as a PNG in true colours that is at most `width` pixels wide, and return its bytes.

    What is transparent becomes white. Raises ValueError, with the file, where `source` is no picture or `target` does
    not end in .png.
    """
    if target.suffix != ".png":
        raise ValueError(f"the picture goes to {str(target)!r}; its name must end in .png")
    try:
        with Image.open(source) as read:
            layer = read.convert("RGBA")
    except OSError as error:
        raise ValueError(f"{str(source)!r} is no picture that can be read: {error}") from error
    whole = Image.alpha_composite(Image.new("RGBA", layer.size, "white"), layer).convert("RGB")
    if whole.width > width:
        whole = whole.resize((width, round(whole.height * width / whole.width)), Image.Resampling.LANCZOS)
    Image.fromarray(even_colours(np.asarray(whole))).save(target, "PNG", optimize=True)
    return target.stat().st_size


def main(arguments: Sequence[str] | None = None) -> int:
    """Publish one picture and print its size; exit status 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m vis.pictures.publish", description=__doc__)
    parser.add_argument("source", type=Path, help="picture to read")
    parser.add_argument("target", type=Path, help="PNG to write")
    parser.add_argument("--width", type=int, default=WIDTH, help=f"most pixels across (default {WIDTH})")
    given = parser.parse_args(arguments)
    if given.width < 1:
        parser.error(f"--width is {given.width}; it must be 1 or more")
    try:
        size = publish(given.source, given.target, width=given.width)
    except ValueError as error:
        parser.error(str(error))
    print(f"{given.target}: {size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
