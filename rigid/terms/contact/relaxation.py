"""The ground's force falls with the logarithm of time while a tip rests in it."""

from math import exp, log

from rigid.terms import candidate as fit
from rigid.terms.term import Parameter, Term

SOON = 0.05  # [s]


def creeping(s, depth, slip, lean, gone, share, soon):
    """c z / tau exp(-e / (c z)): at a constant depth z the ground gives way by e = c z ln(1 + t / tau)."""
    speed = 0.0
    if share > 0.0:
        size = share * max(depth, 1e-12)
        speed = size / soon * exp(-gone / size)
    return speed


def stood_still(s, share, soon, stood):
    """c ln(1 + T / tau), the share of the depth after a rest of T."""
    return share * log(1.0 + stood / soon)


TERM = Term(
    rank=136, id="relaxation", summary="the ground's force falls with the logarithm of time at rest",
    acts="the ground's law, with memory",
    parameters=(
        Parameter("share", "1", 0.0, "c: of the force, lost for each factor of e in time", lowest=0.0, highest=0.08,
                  visible=(0.005, 0.05)),
        Parameter("soon", "s", SOON, "tau: time before which nothing is lost", lowest=5e-3, visible=(0.02, 0.2)),
        Parameter("stood", "s", 60.0, "T: how long the platform has stood before t = 0", lowest=0.0, highest=600.0),
    ),
    source="stress of packed grains falls with the logarithm of time at a constant strain (Brujic et al. 2005; Miksic "
           "and Alava 2013, Phys. Rev. E 88:032207); a rate process whose speed falls exponentially with what it has "
           "released gives that law",
    limits="one rate for all loads; what has given way never comes back, so that after a hold the force stays below "
           "that of a push without one; a slow push has time to relax: its force follows the logarithm of the speed",
    hooks={"settle": creeping, "settled": stood_still},
)  # fmt: skip


def push_settle(gone, z, span, relax_share, relax_fast, relax_soon):
    """The same after `span` more at the depth z, exactly: c z ln(exp(e / (c z)) + span / tau).

    By one time constant instead (`relax_fast`, f): e' = (f / (1 + f) z - e) / tau, where the loading curve is 1 + f
    times as steep. That is a spring f K in series with a dashpot, beside the bed's spring K: the standard linear solid
    (Zener 1948, Elasticity and Anelasticity of Metals). But these two cannot pull: e stays at most f / (1 + f) z. K
    stays what a slow push meets.
    """
    after = gone
    if relax_share > 0.0:
        size = relax_share * max(z, 1e-12)
        after = gone + size * log(1.0 + span / relax_soon * exp(-gone / size))
    elif relax_fast > 0.0:
        end = relax_fast / (1.0 + relax_fast) * z
        after = min(end + (gone - end) * exp(-span / relax_soon), end)
    return after


def push_loading(grown, relax_fast):
    """1 + f times as steep, before anything has relaxed."""
    return grown * (1.0 + relax_fast)


def forms(t: fit.Typical) -> tuple[fit.Form, ...]:
    """A share of the force a factor of e in time, from a time on."""
    numbers = (fit.free("share", "1", 0.005, 0.0, 0.08), fit.logarithm("soon", SOON, lowest=-2.0))
    return (fit.Form("logarithmic", numbers, ((0.01, 0.0), (0.04, 0.0), (0.03, 1.5))),)


CANDIDATE = fit.Candidate(
    meaning="the ground's force falls with time while the tip rests in it",
    confirm="push {one} in, hold it for a minute and read the force: it should fall by equal steps for equal "
            "factors of time",
    tumble=fit.Tumble(
        forms=forms,
        equation="the law reads z - e of the depth z; e grows at share * z / soon * exp(-e / (share * z)), which is "
                 "e = share * z * ln(1 + t / soon) at rest",
        bench="push one spike in, hold it for a minute and read the force",
    ),
    push=fit.Push(
        rank=45, law={"settle": push_settle, "loading": push_loading}, lengths={"relax_soon": SOON},
        forms=(
            fit.Form("logarithmic", (fit.amplitude("relax_share", "plain", 0.03, 0.0, 0.15),
                                     fit.between("relax_soon", "time", log(5e-3), log(5.0))),
                     ((0.02, log(0.05)), (0.05, log(0.5))),
                     "K * (z - e), de/dt = relax_share * z / relax_soon * exp(-e / (relax_share * z))"),
            fit.Form("with one time constant", (fit.amplitude("relax_fast", "plain", 0.3, 0.0, 3.0),
                                                fit.between("relax_soon", "time", log(5e-3), log(5.0))),
                     ((0.1, log(0.05)), (0.3, log(0.5))),
                     "(1 + relax_fast) * K * (z - e), "
                     "de/dt = (relax_fast / (1 + relax_fast) * z - e) / relax_soon, "
                     "e at most relax_fast / (1 + relax_fast) * z"),
        ),
        apart={
            "shaft-friction": "Hold the tip for a minute: a force that relaxes goes on falling by equal steps for "
                              "equal factors of time, friction that is let go falls once.",
            "plastic-sinkage": "Push in, hold for a minute and push on: what has relaxed is missing at the start of "
                               "the second push, a crater leaves nothing behind there.",
            "inertial-drag": "Push to one depth at a tenth of the speed and at the full one: drag falls to a "
                             "hundredth, relaxation changes the force by equal steps for equal factors of the speed.",
        },
    ),
)  # fmt: skip
