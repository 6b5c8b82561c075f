"""The surface does not spring back."""

from math import exp

from rigid.terms import candidate as fit
from rigid.terms.term import Parameter, Term

REPOSE = 0.64  # slope at which sand stands, tan(32.5 degrees)


def crater_share(share):
    """Unloading follows the loading curve compressed into the last 1 - f of the depth."""
    return share


def open_crater(open):
    """Whether a tip above the bottom of its crater counts as touching, although nothing carries it [0 or 1]."""
    return open


def crater_wall(wall):
    """The crater stays where it is; its walls rise by this much a metre sideways, from its deepest point."""
    return wall


def bent_unloading(depth, top, force, share, bend):
    """The force times (z / z_top)^a, a = c (1 - exp(-f / 0.05)): 0 where nothing stays; `depth` is the compressed z."""
    left = force
    if bend != 0.0 and share > 0.0 and depth < top:
        left = force * (max(depth, 1e-12 * top) / top) ** (bend * (1.0 - exp(-20.0 * share)))
    return left


TERM = Term(
    rank=140, id="plastic-sinkage", summary="the surface does not spring back", acts="the ground's law, with memory",
    parameters=(
        Parameter("share", "1", 0.0, "of the deepest depth that stays when the load is gone", lowest=0.0, highest=0.97,
                  visible=(0.05, 0.6)),
        Parameter("bend", "1", 0.0,
                  "c: what unloading's exponent has more than loading's, fully from a share of 0.2 on", lowest=0.0,
                  highest=4.0, visible=(0.0, 1.5)),
        Parameter("open", "1", 0.0,
                  "1: a tip in its crater still touches, without a load, until it is above the undisturbed surface "
                  "(the torque acts, the damper too); 0: it touches the crater's bottom", lowest=0.0, highest=1.0),
        Parameter("wall", "1", 0.0,
                  "slope of the crater's walls: a tip that comes back to the place finds its crater, less deep by the "
                  "slope times the distance; 0: the crater is forgotten above the undisturbed surface", lowest=0.0,
                  highest=3.0, visible=(0.3, 1.0)),
    ),
    source="elastic-plastic unloading as in Walton and Braun 1986, with the unloading curve similar to the loading "
           "(bend = 0); loading again follows the line of unloading, then the curve of loading, as in repetitive "
           "loading (Wong 2008, Theory of Ground Vehicles, section 2.4); a crater's walls in sand stand at the angle "
           "of repose, a slope of 0.6 to 0.67 for 31 to 34 degrees; the bend and the open crater are ours",
    limits="a spike finds its own last crater only, never another spike's; with wall = 0 it forgets it when its tip "
           "leaves the undisturbed surface; the way back in is the way out; no bend and no open crater on laws whose "
           "unloading has a curve of its own",
    hooks={"crater": crater_share, "hollow": open_crater, "unload": bent_unloading, "wall": crater_wall},
)  # fmt: skip


def forms(t: fit.Typical) -> tuple[fit.Form, ...]:
    """A share of the depth that stays; with unloading bent, or with a crater that is open."""
    share = fit.free("share", "1", 0.1, 0.0, 0.97)
    bend = fit.prior("bend", "1", 1.0, 0.3, 0.01, 0.0, 4.0)
    shares = ((0.15,), (0.5,), (0.85,))
    return (
        fit.Form("share", (share,), shares),
        fit.Form("bent way back", (share, bend), ((0.05, 0.3), (0.15, 0.3), (0.5, 0.3), (0.85, 0.3))),
        fit.Form("open crater", (share, fit.fixed("open", 1.0)), shares),
        fit.Form("crater with walls", (share, fit.fixed("wall", REPOSE)), shares),
    )


def push_unload(at, stiff, bent, z, ever, stiffness, crater_share, crater_bend, unload_stiffness):
    """Unloading: the loading curve pressed into what is left of the depth, or a stiffer spring."""
    read = at
    less = stiff
    curve = bent
    if crater_share > 0.0 and z < ever:
        read = (z - crater_share * ever) / (1.0 - crater_share)
        if crater_bend != 0.0:
            curve = max(read / ever, 1e-9) ** crater_bend
    elif unload_stiffness > 0.0 and z < ever:
        read = ever
        less = stiffness * (1.0 + unload_stiffness) * (ever - z)
    return read, less, curve


def push_damper(spring, crater_open):
    """Where the crater is empty nothing is touched, and the damper acts in part or not at all."""
    factor = 1.0
    if spring <= 0.0:
        factor = 1.0 - crater_open
    return factor


_BACK = "at = (z - crater_share * z_m) / (1 - crater_share), on the way back; never below 0"


def _form(
    name: str, slot: str, std: float, highest: float, starts: fit.Starts, equation: str, *more: fit.Number
) -> fit.Form:
    return fit.Form(name, (fit.amplitude(slot, "plain", std, 0.0, highest), *more), starts, equation, "retreats")


CANDIDATE = fit.Candidate(
    meaning="the surface does not spring back all the way",
    confirm="press {one} in, lift it and measure the mark",
    tumble=fit.Tumble(
        rank=80, forms=forms,
        equation="on the way back the law's force at (z - share * z_m) / (1 - share), times (that over z_m)^a, "
                 "a = bend * (1 - exp(-20 * share)); z_m the deepest depth since it touched; with open = 1 a tip above "
                 "the bottom of its crater still touches: the torque and the damper act; with wall > 0 a tip that left "
                 "the ground finds its crater again, its depth less wall * the distance from where the tip left it",
        bench="press one spike in and lift it again, and see how deep the mark is",
    ),
    push=fit.Push(
        rank=40, law={"unload": push_unload, "damper": push_damper},
        forms=(
            _form("crater", "crater_share", 0.5, 0.97, ((0.1,), (0.4,), (0.8,)), f"f(at), {_BACK}"),
            _form("curved crater", "crater_share", 0.5, 0.97, ((0.1, 0.5), (0.4, 0.5), (0.7, 1.0), (0.7, 0.0)),
                  f"f(at) * (at / z_m)^crater_bend, {_BACK}", fit.between("crater_bend", "plain", 0.0, 2.5)),
            _form("stiffer unloading", "unload_stiffness", 5.0, 200.0, ((0.2,), (1.0,), (6.0,)),
                  "f(z_m) - K * (1 + unload_stiffness) * (z_m - z), on the way back; never below 0"),
        ),
        bends=(
            fit.Bend("{}, empty", ("crater", "curved crater", "stiffer unloading"),
                 (fit.between("crater_open", "plain", 0.0, 1.0, value=0.5, std=0.5),), ((0.9,),),
                 lambda text: text + "; where that is 0, C times 1 - crater_open"),
        ),
        apart={
            "adhesion": "Retreat slowly and look at the force after it has passed zero: adhesion pulls (a negative "
                        "force), a crater leaves exactly none.",
            "shaft-friction": "Retreat by a tenth of the depth and push in again: along a crater's curve the force "
                              "returns the same way, friction changes sign at once.",
        },
    ),
)  # fmt: skip
