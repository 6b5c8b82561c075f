"""A tip that slides sinks further: the ground under it gives way with the sliding distance."""

from rigid.terms.candidate import Candidate, Form, Tumble, bent, free, logarithm, shape
from rigid.terms.term import Parameter, Term

WAY = 0.018  # [m]: Janosi and Hanamoto's shear displacement of a lunar soil


def slipping(s, depth, slip, lean, gone, share, way, bias):
    """|u| max(q z - e, 0) / j: e has given way of the depth z; more or less by the side to which the spike leans."""
    left = max(share * depth - gone, 0.0)
    return max(abs(slip) - bias * lean * slip, 0.0) * left / way


TERM = Term(
    rank=135, id="slip-sinkage", summary="a tip that slides sinks further", acts="the ground's law, with memory",
    parameters=(
        Parameter("share", "1", 0.0, "q: of the depth that gives way in the end, after a long slide", lowest=0.0,
                  highest=0.95, visible=(0.1, 0.8)),
        Parameter("way", "m", WAY, "j: sliding distance over which 63 % of it gives way", lowest=1e-4,
                  visible=(0.003, 0.05)),
        Parameter("bias", "1", 0.0,
                  "more for a tip that slides with its tip ahead of its shaft, less for one that trails: times the "
                  "sine of the spike's angle", lowest=-2.0, highest=2.0, visible=(-1.0, 1.0)),
    ),
    source="slip sinkage of wheels: at full slip the sinkage is 4 times the static one, q = 0.75 (Lyasko 2010, "
           "J. Terramechanics 47:21, from memory; Ding et al. 2010, J. Cent. South Univ. Technol. 17:129, for lunar "
           "rovers); an exponential of the shear displacement, j = 18 mm of a lunar soil (Janosi and Hanamoto 1961)",
    limits="no heap and no furrow; what has given way never comes back; forgotten where the tip leaves the undisturbed "
           "surface, unless craters have walls",
    hooks={"settle": slipping},
)  # fmt: skip

CANDIDATE = Candidate(
    meaning="the ground gives way under a tip that slides",
    confirm="load {one} with a weight, drag it sideways, and read its depth over the distance",
    tumble=Tumble(
        forms=lambda t: (
            Form("by distance", (free("share", "1", 0.1, 0.0, 0.93), logarithm("way", WAY)),
                 ((0.3, 0.0), (0.7, -1.0), (0.7, 0.7))),
        ),
        bends=(bent("by the side it leans to", "by distance", shape("bias", 0.0, 0.7, -2.0, 2.0)),),
        equation="the law reads z - e of the depth z; e grows by max(share * z - e, 0) / way a metre of sliding, times "
                 "1 - bias * sin(angle of the spike) * sign(u) where bias is named",
        bench="load one spike with a weight and drag it sideways",
    ),
)  # fmt: skip
