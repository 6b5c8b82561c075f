"""The tip is held on retreat."""

from math import exp, log

from rigid.terms import candidate as fit
from rigid.terms.curves import mobilised
from rigid.terms.term import Parameter, Term


def held_back(s, depth, held, force, reach, sharpness, speed):
    """A (1 - exp(-x)) of pull, x = (top - z) / d the retreat from the deepest depth since it touched.

    A sharpness m takes A ((1 - m) (1 - exp(-x)) + m tanh(x)) instead: at 1 it is mobilised in full over a shorter way.
    """
    pull = 0.0
    work = 0.0
    if force != 0.0 and speed == 0.0:
        x = max(held - depth, 0.0) / reach
        left = exp(-x)
        share = 1.0 - left
        area = x - share
        if sharpness != 0.0:
            twice = left * left
            share = (1.0 - sharpness) * share + sharpness * (1.0 - twice) / (1.0 + twice)
            area = (1.0 - sharpness) * area + sharpness * (x + log(0.5 * (1.0 + twice)))
        pull = force * share
        work = force * reach * area
    return pull, work


def pulled_out(s, depth, rate, held, force, reach, speed):
    """-A (1 - exp(-|v| / v_0)) (1 - exp(-x)) while the tip goes out at v, x the retreat over d; 0 while it sinks."""
    pull = 0.0
    if speed > 0.0 and rate < 0.0:
        pull = -force * (1.0 - exp(rate / speed)) * (1.0 - exp(-max(held - depth, 0.0) / reach))
    return pull


def gripping(s, depth, held, force, reach, sharpness, speed, grip):
    """The share `grip` of the same pull, which presses the tip and the ground together all the same."""
    more = 0.0
    if force != 0.0 and grip != 0.0 and speed == 0.0:
        x = max(held - depth, 0.0) / reach
        left = exp(-x)
        twice = left * left
        share = (1.0 - sharpness) * (1.0 - left) + sharpness * (1.0 - twice) / (1.0 + twice)
        more = grip * force * share
    return more


TERM = Term(
    rank=150, id="adhesion", summary="the tip is held on retreat", acts="normal force, with memory",
    parameters=(
        Parameter("force", "N", 0.0, "A, a row's, fully mobilised", lowest=0.0, visible=(0.02, 0.4)),
        Parameter("reach", "m", 1e-4, "retreat over which it is mobilised", lowest=0.0, above_lowest=True),
        Parameter("sharpness", "1", 0.0, "m: 0 as 1 - exp, 1 as tanh of the retreat over that reach", lowest=-1.0,
                  highest=2.5, visible=(-0.5, 1.5)),
        Parameter("speed", "m/s", 0.0,
                  "v_0: where it is not 0 the pull acts on the way out only, at the speed v times 1 - exp(-v / v_0), "
                  "and friction loses it all", lowest=0.0),
        Parameter("grip", "1", 0.0,
                  "share of the pull that friction does not lose: at 0 its bound follows the net normal force, at 1 "
                  "what the ground presses alone", lowest=0.0, highest=1.0, visible=(0.0, 1.0)),
    ),
    source="pull-off force of cohesive ground; mobilised over a distance so that rest is well defined; friction "
           "of what sticks together is in proportion to load and adhesion (Derjaguin 1934, Z. Phys. 88:661)",
    limits="breaks where the tip leaves the surface",
    hooks={"hold": held_back, "rate_pull": pulled_out, "grip": gripping},
)  # fmt: skip


def forms(t: fit.Typical) -> tuple[fit.Form, ...]:
    """A pull over a retreat; one that presses tip and ground together all the same; one while the tip moves out."""
    force, reach = fit.free("force", "N", t.force, 0.0, 20 * t.weight), fit.logarithm("reach", t.depth)
    pulls = tuple((a * t.force, s) for a, s in ((3, 0.0), (10, 1.5), (10, -1.0)))
    torn = tuple((a * t.force, d, v) for a, d, v in ((3, -1.0, -1.0), (10, -1.5, 0.5), (10, 1.5, -1.0)))
    return (
        fit.Form("mobilised", (force, reach), pulls),
        fit.Form("that friction does not lose", (force, reach, fit.fixed("grip", 1.0)), pulls),
        fit.Form("on the way out", (force, reach, fit.logarithm("speed", t.lift_speed, std=2.0, lowest=-1.5)), torn),
    )


def push_pull(
    z, v, way, most, ever, reference, pull, pull_reach, pull_deep, pull_growth, pull_ever, pull_short, pull_viscous,
    pull_sharpness, pull_fade, pull_fade_sharpness, pull_out, pull_let,
):  # fmt: skip
    """A pull that is mobilised over the retreat, and what becomes of it."""
    back = most - z
    total = 0.0
    if back > 0.0:
        held = back / pull_reach
        grown = pull
        if pull_deep != 0.0:
            grown = grown + pull_deep * (most / reference) ** pull_growth
        if grown != 0.0:
            total = total + grown * mobilised(held, pull_sharpness)
        if pull_short != 0.0:
            total = total + pull_short * held * exp(1.0 - held)
    if pull_ever != 0.0 and z < ever:
        part = mobilised((ever - z) / pull_reach, pull_sharpness)
        total = total + pull_ever * (ever / reference) ** pull_growth * part
    if pull_fade > 0.0:
        total = total * mobilised(z / pull_fade, pull_fade_sharpness)
    if pull_let > 0.0:
        gone = back
        if pull_ever != 0.0:
            gone = ever - z
        total = total * exp(-gone / pull_let)
    return total * (1.0 - pull_out * max(way, 0.0)) + pull_viscous * max(-v, 0.0)


def _form(name: str, slot: str, how: str, starts: fit.Starts, equation: str, *more: fit.Number) -> fit.Form:
    return fit.Form(name, (fit.amplitude(slot, how, 0.3, 0.0, 10.0), *more), starts, equation, "retreats")


_HELD = "x / (1 + x^p)^(1 / p), x = r / pull_reach, p = pull_sharpness"
_REACH = fit.between("pull_reach", "depth", log(0.005), log(1.0))
_GROWN = fit.between("pull_growth", "plain", 0.0, 2.0)
# How sharply it goes from growing to its full size: 1 is a hyperbola, 2.3 next to tanh, 5 next to a corner.
_SHARP = fit.between("pull_sharpness", "plain", 0.7, 5.0)
_BY_DEPTH = ((0.05, -3.0, 0.7, 2.0), (0.1, -1.0, 0.7, 2.0))
_HELDS = ("held", "held by depth", "held wherever it has been")

CANDIDATE = fit.Candidate(
    meaning="the tip is held as it leaves",
    confirm="lift {one} off slowly and read the pull",
    tumble=fit.Tumble(
        rank=90, forms=forms,
        bends=(fit.bent("of any shape", ("mobilised", "that friction does not lose"),
                    fit.shape("sharpness", 0.0, 0.7, -1.0, 2.0)),),
        equation="- force * ((1 - sharpness) * (1 - exp(-x)) + sharpness * tanh(x)), x = (z_m - z) / reach the way "
                 "back; friction keeps the share grip of it (both 0 where they are not named); with a speed it acts "
                 "while the tip goes out at v, times 1 - exp(-v / speed)",
        bench="lift one spike off slowly and read the pull",
    ),
    push=fit.Push(
        rank=50, law={"pull": push_pull}, lengths={"pull_reach": 1e-3},
        forms=(
            _form("held", "pull", "area", ((0.05, -3.0, 2.0), (0.1, -1.0, 2.0)), f"- pull * {_HELD}", _REACH, _SHARP),
            _form("held by depth", "pull_deep", "area", _BY_DEPTH, f"- pull_deep * (z_m / D)^pull_growth * {_HELD}",
                  _REACH, _GROWN, _SHARP),
            _form("held wherever it has been", "pull_ever", "area", _BY_DEPTH,
                  f"- pull_ever * (z_m / D)^pull_growth * {_HELD}, also after it was out", _REACH, _GROWN, _SHARP),
            _form("held and let go", "pull_short", "area", ((0.1, -3.0), (0.1, -1.0)),
                  "- pull_short * x * exp(1 - x), x = r / pull_reach", _REACH),
            _form("viscous", "pull_viscous", "viscous", ((0.1,),), "- pull_viscous * abs(v), on the way out"),
        ),
        bends=(
            # What is held loses its hold as the spike comes out.
            fit.Bend("{}, fading towards the surface", _HELDS,
                     (fit.between("pull_fade", "depth", -6.0, 1.0, value=-2.0, std=1.5),
                      fit.between("pull_fade_sharpness", "plain", 0.7, 8.0, value=2.5, std=2.0)),
                     ((-2.5, 2.0), (-0.7, 2.0)),
                     fit.times(fit.SETS_IN, "y = z / pull_fade", "q = pull_fade_sharpness")),
            # What takes a motion away from the bed to act lets go of a spike that goes in again.
            fit.Bend("{}, on the way out", _HELDS,
                     (fit.between("pull_out", "plain", 0.0, 1.0, value=0.5, std=0.5),), ((0.9,),),
                     lambda text: text + "; times 1 - pull_out where it sinks again"),
            # What is held at once may let go over another way than that over which it was taken up: a meniscus, a tail.
            fit.Bend("{}, letting go", _HELDS, (fit.between("pull_let", "depth", -5.0, 3.0, value=-1.0, std=1.5),),
                     ((-1.8,), (-0.5,)), fit.times("exp(-r / pull_let)")),
        ),
        apart={
            "shaft-friction": "Stop half-way in for a second and go on: friction falls and comes back on the way in "
                              "too, adhesion shows on the way out only.",
        },
    ),
)  # fmt: skip
