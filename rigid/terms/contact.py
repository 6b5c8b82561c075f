"""Effects at the contact: friction that changes, tips that are balls, ground that drags, hardens, stays or holds."""

from math import exp, log

from .term import Parameter, Term

__all__ = ["CONTACT_EFFECTS"]


def vibration_factor(s, slip, reduction, speed, power):
    """1 - r w^p / (w^p + w_0^p) on both coefficients, w the wheel's speed."""
    w = s.wheel_speed * s.wheel_speed
    half = speed * speed
    if power != 2.0:
        w = max(w, 1e-12) ** (0.5 * power)
        half = speed**power
    factor = 1.0 - reduction * w / (w + half)
    return factor, factor


def ball_radius(radius):
    """The spike ends in a ball of this radius, whose lowest point touches."""
    return radius


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
        power = 2.0  # one more than the power of depth that the force goes with
        if stored > 0.0:
            power = grown * z / stored
        stored = stored * (1.0 + bend * z * power / (power + 1.0))
        grown = grown * (1.0 + bend * z)
    return grown, stored


def crater_share(share):
    """Unloading follows the loading curve compressed into the last 1 - f of the depth."""
    return share


def open_crater(open):
    """Whether a tip above the bottom of its crater counts as touching, although nothing carries it [0 or 1]."""
    return open


def bent_unloading(depth, top, force, share, bend):
    """The force times (z / z_top)^a, a = c (1 - exp(-f / 0.05)): 0 where nothing stays; `depth` is the compressed z."""
    left = force
    if bend != 0.0 and share > 0.0 and depth < top:
        left = force * (max(depth, 1e-12 * top) / top) ** (bend * (1.0 - exp(-20.0 * share)))
    return left


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
    """-A (1 - exp(-|v| / v_0)) (1 - exp(-x)) while the tip goes out at v, x the retreat over d; 0 on the way in."""
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


def rate_friction_factor(s, slip, change, speed, power):
    """mu_d (1 + c |u|^p / (|u|^p + u_0^p)): grows (c > 0) or falls (c < 0) and saturates."""
    u = abs(slip)
    half = speed
    if power != 1.0:
        u = max(u, 1e-12) ** power
        half = speed**power
    return 1.0, 1.0 + change * u / (u + half)


CONTACT_EFFECTS: tuple[Term, ...] = (
    Term(
        id="wheel-vibration", summary="a spinning wheel lowers the friction at the spikes", acts="mu_s and mu_d",
        parameters=(
            Parameter(name="reduction", unit="1", default=0.0, lowest=0.0, highest=0.99,
                      summary="share of the friction that a fast wheel takes away"),
            Parameter(name="speed", unit="rad/s", default=100.0, lowest=0.0, above_lowest=True,
                      summary="wheel speed at half of it"),
            Parameter(name="power", unit="1", default=2.0, lowest=0.3, highest=8.0,
                      summary="p: how sharply it sets in about that speed"),
        ),
        source="the paper suspects it; vibration lowers mean friction by the share of time in light contact "
               "(Dupont et al. 1994, IEEE TAC 39:2, for the phenomenon)",
        limits="a mean effect: no resonances, no normal vibration of the platform",
        hooks={"friction_factor": vibration_factor},
    ),
    Term(
        id="tip-radius", summary="the tips are balls", acts="contact geometry: the point that touches rolls",
        parameters=(Parameter(name="radius", unit="m", default=0.0, lowest=0.0, highest=0.1,
                              summary="of the ball, whose centre is l - r from the platform's"),),
        source="the paper names ball tips; rolling of a circle on a line",
        limits="the ball's sinkage does not move the point of contact round it", hooks={"tip_radius": ball_radius},
    ),
    Term(
        id="inertial-drag", summary="force of the square of the tip's speed", acts="normal and tangential force",
        parameters=(
            Parameter(name="normal", unit="kg/m", default=0.0, lowest=0.0, summary="b, while the tip goes in"),
            Parameter(name="sideways", unit="kg/m", default=0.0, lowest=0.0, summary="b_x, while the tip slides"),
            Parameter(name="power", unit="1", default=2.0, lowest=1.0, highest=3.0,
                      summary="of the speed of going in; where it is not 2, b is the force at 1 m/s over (1 m/s)^2"),
        ),
        source="Katsuragi and Durian, Nature Physics 3 (2007), 420: the inertia of displaced grains",
        limits="b does not grow with depth",
        hooks={"rate_force": inertial_rate_force, "side_force": inertial_side_force},
    ),
    Term(
        id="depth-hardening", summary="force grows other than linearly with depth", acts="the ground's law",
        parameters=(
            Parameter(name="exponent", unit="1", default=1.0, lowest=0.3, highest=4.0,
                      summary="n of (z / z_0)^(n - 1) on the law's force; 1 changes nothing"),
            Parameter(name="reference", unit="m", default=1e-3, lowest=0.0, above_lowest=True,
                      summary="z_0: the depth at which the power changes nothing"),
            Parameter(name="bend", unit="1/m", default=0.0,
                      summary="b of 1 + b z, or of 1 / (1 - b z) where negative, a factor beside the power's: a law "
                              "that is straight while shallow"),
        ),
        source="pressure and sinkage of soils (Bekker 1969); slow penetration grows as z^1.3 (Hill et al. 2005)",
        limits="work exact for laws that are powers of depth (spring-damper, Hunt-Crossley, power, Katsuragi-Durian); "
               "with a negative bend for the spring-damper and an exponent of 1",
        hooks={"stiffen": hardened},
    ),
    Term(
        id="plastic-sinkage", summary="the surface does not spring back", acts="the ground's law, with memory",
        parameters=(
            Parameter(name="share", unit="1", default=0.0, lowest=0.0, highest=0.95,
                              summary="of the deepest depth that stays when the load is gone"),
            Parameter(name="bend", unit="1", default=0.0, lowest=0.0, highest=4.0,
                      summary="c: what unloading's exponent has more than loading's, fully from a share of 0.2 on"),
            Parameter(name="open", unit="1", default=0.0, lowest=0.0, highest=1.0,
                      summary="1: a tip in its crater still touches, without a load, until it is above the undisturbed "
                              "surface (the torque acts, the damper too); 0: it touches the crater's bottom"),
        ),
        source="elastic-plastic unloading as in Walton and Braun 1986, with the unloading curve similar to the loading "
               "(bend = 0); the bend and the open crater are ours",
        limits="a spike forgets its crater when its tip leaves the undisturbed surface; the way back in is the way "
               "out; no bend and no open crater on laws whose unloading has a curve of its own",
        hooks={"crater": crater_share, "hollow": open_crater, "unload": bent_unloading},
    ),
    Term(
        id="adhesion", summary="the tip is held on retreat", acts="normal force, with memory",
        parameters=(
            Parameter(name="force", unit="N", default=0.0, lowest=0.0, summary="A, a row's, fully mobilised"),
            Parameter(name="reach", unit="m", default=1e-4, lowest=0.0, above_lowest=True,
                      summary="retreat over which it is mobilised"),
            Parameter(name="sharpness", unit="1", default=0.0, lowest=-1.0, highest=2.5,
                      summary="m: 0 as 1 - exp, 1 as tanh of the retreat over that reach"),
            Parameter(name="speed", unit="m/s", default=0.0, lowest=0.0,
                      summary="v_0: where it is not 0 the pull acts on the way out only, at the speed v times "
                              "1 - exp(-v / v_0), and friction loses it all"),
            Parameter(name="grip", unit="1", default=0.0, lowest=0.0, highest=1.0,
                      summary="share of the pull that friction does not lose: at 0 its bound goes with the net normal "
                              "force, at 1 with what the ground presses alone"),
        ),
        source="pull-off force of cohesive ground; mobilised over a distance so that rest is well defined; friction "
               "of what sticks together goes with the load and the adhesion (Derjaguin 1934, Z. Phys. 88:661)",
        limits="breaks where the tip leaves the surface",
        hooks={"hold": held_back, "rate_pull": pulled_out, "grip": gripping},
    ),
    Term(
        id="rate-friction", summary="friction depends on the sliding speed", acts="mu_d",
        parameters=(
            Parameter(name="change", unit="1", default=0.0, lowest=-0.95, highest=10.0,
                      summary="relative change of mu_d at high sliding speed"),
            Parameter(name="speed", unit="m/s", default=0.05, lowest=0.0, above_lowest=True,
                      summary="sliding speed at half of it"),
            Parameter(name="power", unit="1", default=1.0, lowest=0.2, highest=8.0,
                      summary="p: how sharply it sets in about that speed"),
        ),
        source="velocity strengthening or weakening (Stribeck; Armstrong-Helouvry et al. 1994, Automatica 30:1083)",
        limits="no memory of past sliding", hooks={"friction_factor": rate_friction_factor},
    ),
)  # fmt: skip
