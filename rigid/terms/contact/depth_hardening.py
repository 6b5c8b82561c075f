"""Force grows other than linearly with depth."""

from math import exp, log

from rigid.terms import candidate as fit
from rigid.terms.curves import mobilised
from rigid.terms.term import Parameter, Term


def hardened(depth, force, work, exponent, reference, bend):
    """The law's force times (z / z_0)^(n - 1) and 1 + b z, or 1 / (1 + |b| z) where b is negative.

    The work is exact for every law that is a power of depth, of a negative b for one that is straight.
    """
    grown = force
    stored = work
    if exponent != 1.0:
        z = max(depth, 1e-12)
        ratio = (z / reference) ** (exponent - 1.0)
        grown = force * ratio
        stored = work * ratio
        if work > 0.0:
            stored = grown * z / (force * z / work + exponent - 1.0)
    if bend < 0.0:
        x = max(-bend * depth, 0.0)
        share = 1.0 - x * (2.0 / 3.0 - x * (0.5 - 0.4 * x))  # 2 (x - ln(1 + x)) / x^2
        if x > 1e-3:
            share = 2.0 * (x - log(1.0 + x)) / (x * x)
        stored = stored * share
        grown = grown / (1.0 + x)
    if bend > 0.0:
        z = max(depth, 0.0)
        power = 2.0  # one more than the power of depth in the force
        if stored > 0.0:
            power = grown * z / stored
        stored = stored * (1.0 + bend * z * power / (power + 1.0))
        grown = grown * (1.0 + bend * z)
    return grown, stored


TERM = Term(
    rank=130, id="depth-hardening", summary="force grows other than linearly with depth", acts="the ground's law",
    parameters=(
        Parameter("exponent", "1", 1.0, "n of (z / z_0)^(n - 1) on the law's force; 1 changes nothing", lowest=0.3,
                  highest=4.0, visible=(0.8, 1.6)),
        Parameter("reference", "m", 1e-3, "z_0: the depth at which the power changes nothing", lowest=0.0,
                  above_lowest=True),
        Parameter("bend", "1/m", 0.0,
                  "b of 1 + b z, or of 1 / (1 - b z) where negative, a factor beside the power's: a law that is "
                  "straight while shallow", visible=(0.0, 80.0)),
    ),
    source="pressure and sinkage of soils (Bekker 1969); slow penetration grows as z^1.3 (Hill et al. 2005)",
    limits="work exact for laws that are powers of depth (spring-damper, Hunt-Crossley, power, Katsuragi-Durian); "
           "with a negative bend for the spring-damper and an exponent of 1",
    hooks={"stiffen": hardened},
)  # fmt: skip


def forms(t: fit.Typical) -> tuple[fit.Form, ...]:
    """A bend of the curve, or another power of the depth."""
    bends = tuple((b / t.depth,) for b in (0.005, 0.05, 0.5, -0.03, -0.4))
    power = (fit.free("exponent", "1", 0.1, -0.65, 2.5, how="change", typical=1.0), fit.logarithm("reference", t.depth))
    return (
        fit.Form("straight while shallow", (fit.free("bend", "1/m", 0.03 / t.depth, -1e6, 1e6),), bends,
             redefines=("stiffness",)),
        fit.Form("power", power, ((0.3, 0.7), (-0.2, 0.7), (0.3, 2.0)), redefines=("stiffness",)),
    )  # fmt: skip


def push_loading(
    grown, x, depth, hardening_power, hardening_quadratic, hardening_cubic, hardening_exponential, hardening_early,
    hardening_reach, hardening_level, hardening_sharpness, hardening_steeper, hardening_locking,
):  # fmt: skip
    """K z times a factor of x = z / D, one of several; `early` adds to it."""
    force = grown
    if hardening_power != 0.0:
        force = force * max(x, 1e-9) ** hardening_power
    if hardening_exponential != 0.0:
        rise = hardening_exponential * x
        if abs(rise) > 1e-6:
            force = force * ((exp(min(rise, 30.0)) - 1.0) / rise)
    if hardening_level * x > 1e-6:
        force = force * (mobilised(hardening_level * x, hardening_sharpness) / (hardening_level * x))
    y = x  # of the quadratic form, with a power of its own
    if hardening_steeper != 0.0:
        y = max(x, 1e-9) ** (1.0 + hardening_steeper)
    force = force * (1.0 + hardening_quadratic * y + hardening_cubic * x * x)
    if hardening_locking != 0.0:
        force = force / max(1.0 - hardening_locking * x, 0.05)
    if hardening_early != 0.0:
        force = force + hardening_early * (1.0 - exp(-depth / hardening_reach))
    return force


def _form(name: str, how: str, std: float, lowest: float, highest: float, starts: fit.Starts, equation: str,
          *more: fit.Number, slot: str = "", stiffness: str = "slope at the surface") -> fit.Form:  # fmt: skip
    first = fit.amplitude(f"hardening_{slot or name}", how, std, lowest, highest)
    return fit.Form(name, (first, *more), starts, equation, redefines=("stiffness",), stiffness=stiffness)


CANDIDATE = fit.Candidate(
    meaning="the force grows other than linearly with depth",
    confirm="press {one} in slowly, deeper than here, and read force over depth",
    tumble=fit.Tumble(
        rank=70, forms=forms,
        equation="the law's force times (z / reference)^(exponent - 1), or times 1 + bend * z (bend below 0: over 1 - "
                 "bend * z)",
        bench="press one spike in slowly and read force over depth",
    ),
    push=fit.Push(
        rank=10, law={"loading": push_loading}, lengths={"hardening_reach": 1e-3},
        forms=(
            _form("power", "plain", 0.6, -0.9, 3.0, ((0.2,), (-0.2,)), "K * z * (z / D)^hardening_power",
                  stiffness="F / z at z = D"),
            _form("quadratic", "plain", 0.8, -0.6, 20.0, ((0.3,), (-0.2,)),
                  "K * z * (1 + hardening_quadratic * z / D)"),
            _form("cubic", "plain", 0.8, -0.4, 20.0, ((0.3,), (-0.15,)), "K * z * (1 + hardening_cubic * (z / D)^2)"),
            _form("exponential", "plain", 0.8, -8.0, 6.0, ((0.5,), (-0.5,)),
                  "K * z * (exp(h) - 1) / h, h = hardening_exponential * z / D"),
            # Towards a depth that it never reaches: a bed that locks.
            _form("locking", "plain", 0.4, 0.0, 0.71, ((0.2,), (0.5,)),
                  "K * z / max(1 - hardening_locking * z / D, 0.05)"),
            _form("early", "spring force", 0.5, 0.0, 20.0, ((0.1, -2.5), (0.2, -1.0)),
                  "K * z + hardening_early * (1 - exp(-z / hardening_reach))",
                  fit.between("hardening_reach", "depth", -4.0, 0.0), stiffness="slope far below hardening_reach"),
            # Towards a bound, a hyperbola (Kondner, J. Soil Mech. Found. Div. 89 (1963), 115) where the sharpness is 1.
            _form("levelling off", "plain", 0.8, 0.0, 20.0, ((0.3, 1.5), (1.0, 1.5)),
                  "K * z / (1 + x^hardening_sharpness)^(1 / hardening_sharpness), x = hardening_level * z / D",
                  fit.between("hardening_sharpness", "plain", 0.7, 5.0), slot="level"),
        ),
        bends=(
            fit.Bend("with a power", ("quadratic",),
                 (fit.between("hardening_steeper", "plain", -0.8, 2.0, value=0.0, std=0.5),), ((-0.35,), (0.35,)),
                 "K * z * (1 + hardening_quadratic * (z / D)^(1 + hardening_steeper))"),
        ),
        apart={
            "layering": "Push once, slowly, to twice the depth in this bed and once in a bed prepared anew: hardening "
                        "goes on smoothly, a layer stays at its depth.",
            "shaft-friction": "Push in and retreat slowly: friction changes sign, hardening does not.",
        },
    ),
)  # fmt: skip
