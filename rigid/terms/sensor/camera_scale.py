"""The camera's scale is off."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, shape
from rigid.terms.term import Parameter, Term


def scale_there(square, scale, bend):
    """scale + bend d^2, d the distance from the start."""
    return scale + bend * square


TERM = Term(
    rank=180, id="camera-scale", summary="the camera's scale is off", acts="the camera's x and y", sensor=True,
    parameters=(
        Parameter("scale", "1", 1.0, "measured over true, x and y", lowest=0.0, above_lowest=True),
        Parameter("bend", "1/m2", 0.0, "added to it by the square of the distance from where the platform stood"),
    ),
    source="a ruler in the wrong plane; a lens that bends outwards or inwards",
    limits="the same in x and y; the lens's axis is on the start", hooks={"lens": scale_there},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the camera measures lengths by another scale",
    confirm="film a ruler in the plane of motion",
    tumble=Tumble(
        rank=140,
        forms=lambda t: (
            Form("same in x and y", (free("scale", "1", 2e-3, -0.3, 0.3, how="change", typical=1.0),),
                 ((5e-3,), (-5e-3,))),
        ),
        bends=(bent("of any shape", "same in x and y", shape("bend", 0.0, 0.5, -10.0, 10.0, "1/m2")),),
        equation="x and y as seen = (scale + bend * d^2) times the true ones, d the distance from the start",
        bench="film a ruler",
    ),
)  # fmt: skip
