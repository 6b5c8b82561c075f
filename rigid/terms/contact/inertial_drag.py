"""Force of the square of the tip's speed."""

from rigid.terms import candidate as fit
from rigid.terms.curves import mobilised
from rigid.terms.term import Parameter, Term


def inertial_rate_force(s, depth, rate, normal, power):
    """b rate^2 while going in: the ground's own inertia; with another power p, b (1 m/s)^2 (rate / (1 m/s))^p."""
    sinking = max(rate, 0.0)
    drag = normal * sinking * sinking
    if power != 2.0:
        drag = normal * max(sinking, 1e-12) ** power
    return drag


def inertial_side_force(s, depth, slip, sideways):
    """-b_x |u| u: the same for a tip that ploughs."""
    return -sideways * abs(slip) * slip


def carried_along(depth, normal, power, added):
    """a b z of mass that moves with the tip, and its slope a b: taking it along needs a b v^2 of the force."""
    slope = 0.0
    if power == 2.0:
        slope = added * normal
    return slope * max(depth, 0.0), slope


TERM = Term(
    rank=120, id="inertial-drag", summary="force of the square of the tip's speed", acts="normal and tangential force",
    parameters=(
        Parameter("normal", "kg/m", 0.0, "b, while the tip goes in", lowest=0.0, visible=(5.0, 80.0)),
        Parameter("sideways", "kg/m", 0.0, "b_x, while the tip slides", lowest=0.0, visible=(0.1, 5.0)),
        Parameter("power", "1", 2.0,
                  "of the speed of going in; where it is not 2, b is the force at 1 m/s over (1 m/s)^2", lowest=1.0,
                  highest=3.0, visible=(1.0, 3.0)),
        Parameter("added", "1", 0.0,
                  "a: share of b that is mass carried along, a b z at the depth z since the tip touched; only with a "
                  "power of 2", lowest=0.0, highest=1.0, visible=(0.0, 1.0)),
    ),
    source="Katsuragi and Durian, Nature Physics 3 (2007), 420: the inertia of displaced grains. Ground that "
           "solidifies under a foot moves with it, an added mass that grows with depth: F = d(m_a v)/dt (Aguilar and "
           "Goldman, Nature Physics 12 (2016), 278, arXiv 1512.05762)",
    limits="b does not grow with depth; the added mass stays behind where the tip stops; friction does not see the "
           "part of the force that goes with the acceleration",
    hooks={"rate_force": inertial_rate_force, "side_force": inertial_side_force, "added_mass": carried_along},
)  # fmt: skip


def forms(t: fit.Typical) -> tuple[fit.Form, ...]:
    """While a tip goes in; while it slides, too; by any power of the speed of going in."""
    normal, sideways = fit.free("normal", "kg/m", 0.5, 0.0, 1e4), fit.free("sideways", "kg/m", 0.2, 0.0, 1e4)
    power = fit.prior("power", "1", 0.3, 0.2, 0.01, -1.0, 1.0, typical=2.0)
    return (
        fit.Form("normal", (normal,), ((1.0,), (20.0,))),
        fit.Form("with the mass that it carries", (normal, fit.fixed("added", 1.0)), ((1.0,), (20.0,))),
        fit.Form("both", (normal, sideways), ((1.0, 0.3), (10.0, 2.0))),
        fit.Form("any power", (normal, sideways, power), ((1.0, 0.3 * 1.0, 0.0), (10.0, 0.3 * 10.0, 0.0))),
    )


def push_force(
    z, v, x, radius_depth, drag, drag_onset, drag_reach, drag_sharpness, drag_deep, drag_tip, drag_both, drag_carried
):
    """b v^2 of loading, b by the depth in one of four ways, or with its mass; or both ways."""
    sinking = max(v, 0.0)
    share = drag + drag_carried + drag_deep * x
    if drag_tip != 0.0:
        wide = min(z / radius_depth, 1.0)
        share = share + drag_tip * wide * (2.0 - wide)
    if drag_onset != 0.0:
        share = share + drag_onset * mobilised(z / drag_reach, drag_sharpness)
    return share * sinking * sinking + drag_both * v * abs(v)


def push_mass(z, drag_carried):
    """b z: the ground that a spike carries along, whose momentum takes b v^2."""
    return drag_carried * max(z, 0.0)


def _form(
    name: str, slot: str, equation: str, *more: fit.Number, starts: fit.Starts = ((0.1,),), needs: str = "speeds"
) -> fit.Form:
    return fit.Form(name, (fit.amplitude(slot, "drag", 0.5, 0.0, 20.0), *more), starts, equation, needs)


_ONSET = " * (1 - exp(-z / drag_reach))"

CANDIDATE = fit.Candidate(
    meaning="the surface resists with the square of the tip's speed",
    confirm="drop {one} at two speeds: the excess force should go with the square",
    tumble=fit.Tumble(
        rank=60, forms=forms,
        equation="+ normal * rate^power while a tip goes in (power 2 where it is not named), - sideways * u * abs(u) "
                 "while it slides at u; with added = 1 a mass normal * z of ground moves with the tip while it goes in",
        bench="drop one spike onto the surface at two speeds",
    ),
    push=fit.Push(
        rank=30, law={"force": push_force, "mass": push_mass}, lengths={"drag_reach": 1e-3},
        forms=(
            _form("square", "drag", "+ drag * v^2, while it goes in", needs=""),
            _form("with an onset", "drag_onset", f"+ drag_onset{_ONSET} * v^2, while it goes in",
                  fit.between("drag_reach", "depth", -3.0, 1.0), starts=((0.1, -2.0), (0.1, 0.0))),
            _form("growing with depth", "drag_deep", "+ drag_deep * z / D * v^2, while it goes in"),
            _form("of the tip", "drag_tip", "+ drag_tip * u * (2 - u) * v^2, u = min(z / H, 1), while it goes in"),
            _form("with the mass that it carries", "drag_carried",
                  "+ drag_carried * v^2, while it goes in; a drop then has the mass drag_carried * z more",
                  needs="drops"),
            _form("both ways", "drag_both", "+ drag_both * v * abs(v)"),
        ),
        bends=(
            # A tip that is in when it is in, or a stream that goes on widening.
            fit.Bend("{}, as sharp as it is", ("with an onset",),
                 (fit.between("drag_sharpness", "plain", 0.7, 8.0, value=2.5, std=2.0),), ((1.0,), (4.0,)),
                 fit.times(fit.SETS_IN, "y = z / drag_reach", "q = drag_sharpness", instead=_ONSET)),
        ),
        apart={
            "shaft-friction": "Push to one depth at a tenth of the speed and at the full one: drag falls to a "
                              "hundredth, friction stays.",
            "depth-hardening": "Push to one depth at a tenth of the speed: hardening stays.",
            "layering": "Push to one depth at a tenth of the speed: a layer stays.",
            "plastic-sinkage": "Push in slowly and retreat: a crater shows at any speed.",
        },
    ),
)  # fmt: skip
