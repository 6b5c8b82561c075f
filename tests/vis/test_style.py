"""Ways of a platform: drawn in their true shape where something of it can be seen."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from vis.style import as_it_lies


@pytest.mark.parametrize(("length", "aspect", "title"), [(0.3, 1.0, ""), (2.0, "auto", "heights stretched")])
def test_a_way_that_would_be_a_line_is_stretched_and_says_so(length: float, aspect: float | str, title: str) -> None:
    axis = Figure().subplots()
    x = np.linspace(0.0, length, 50)
    axis.plot(x, 0.025 * (1.0 + np.sin(40.0 * x)))
    as_it_lies(axis)
    assert axis.get_aspect() == aspect
    assert axis.get_title(loc="left") + axis.get_title() == title
