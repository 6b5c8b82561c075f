"""The bed changes at a depth; of pushes only."""

from math import exp, log

from rigid.terms.candidate import Candidate, Form, Number, Push, Starts, amplitude, between


def push_loading(grown, depth, layer_depth, layer_width, layer_slope, layer_step, layer_factor, layer_bump):
    """From a depth on another factor, a step or a slope, over a width; or a crust there."""
    force = grown
    away = 0.0
    if layer_step != 0.0 or layer_factor != 0.0 or layer_bump != 0.0 or layer_slope != 0.0:
        away = (depth - layer_depth) / layer_width
    if layer_step != 0.0 or layer_factor != 0.0:
        inside = 1.0 / (1.0 + exp(min(-away, 60.0)))
        force = force * (1.0 + layer_factor * inside)
        force = force + layer_step * inside
    if layer_bump != 0.0:
        force = force + layer_bump * exp(-0.5 * away * away)
    if layer_slope != 0.0:  # a corner that is rounded over the width, and no force at the surface
        corner = log(1.0 + exp(-abs(away))) - log(1.0 + exp(-layer_depth / layer_width))
        force = force + layer_slope * (max(depth - layer_depth, 0.0) + layer_width * corner)
    return force


def reaches_surface(layer_depth, layer_width):
    """Whether the bed changes from the surface on: a tenth of the change or more stands there. The width of an edge is
    counted from a tenth to nine tenths, as a rise time is. A layer has undisturbed ground above its edge."""
    return layer_depth < log(9.0) * layer_width


def _form(name: str, slot: str, how: str, std: float, lowest: float, highest: float, starts: Starts, equation: str,
          edge: Number, width: Number) -> Form:  # fmt: skip
    first = amplitude(slot, how, std, lowest, highest)
    becomes = () if name == "crust" else (("depth-hardening", reaches_surface),)
    stiffness = "above the layer" if slot in ("layer_slope", "layer_factor") else f"without the {name}"
    return Form(name, (first, edge, width), starts, equation, redefines=("stiffness",), stiffness=stiffness,
                becomes=becomes)  # fmt: skip


def _starts(sizes: tuple[float, ...], depths: tuple[float, ...], width: float) -> Starts:
    return tuple((a, log(x), log(width)) for x in depths for a in sizes)


# A layer is sharp: its edge is narrower than a quarter of D. What changes all the way down is hardening.
_EDGE = between("layer_depth", "depth", log(0.03), log(1.25))
_NARROW = between("layer_width", "depth", log(0.005), log(0.12))
_PLACES = (0.1, 0.3, 0.55, 0.85)
_SHARP = _starts((0.3, -0.2), _PLACES, 0.04)
_INSIDE = "inside = 1 / (1 + exp(-(z - layer_depth) / layer_width))"

CANDIDATE = Candidate(
    meaning="the bed changes at a depth",
    confirm="open the bed, or push at another place: the change should be at the same depth",
    push=Push(
        rank=20, law={"loading": push_loading}, lengths={"layer_depth": 0.01, "layer_width": 1e-3},
        forms=(
            _form("slope", "layer_slope", "spring", 0.8, -1.5, 20.0, _starts((0.4, -0.25), _PLACES, 0.02),
                  "+ layer_slope * max(z - layer_depth, 0), its corner rounded over layer_width", _EDGE, _NARROW),
            _form("factor", "layer_factor", "plain", 0.8, -0.95, 20.0, _SHARP,
                  f"K * z * (1 + layer_factor * inside), {_INSIDE}", _EDGE, _NARROW),
            _form("step", "layer_step", "spring force", 0.5, -2.0, 10.0, _SHARP, f"+ layer_step * inside, {_INSIDE}",
                  _EDGE, _NARROW),
            _form("crust", "layer_bump", "spring force", 0.4, 0.0, 10.0, _starts((0.15,), (0.15, 0.35, 0.6, 0.9), 0.08),
                  "+ layer_bump * exp(-((z - layer_depth) / layer_width)^2 / 2)",
                  between("layer_depth", "depth", log(0.05), log(1.25)),
                  between("layer_width", "depth", log(0.02), log(0.2))),
        ),
    ),
)  # fmt: skip
