"""What the kernels share: the terms' functions, the numbers that are known when they are compiled, small functions."""

import math
from types import SimpleNamespace

from rigid.model.model import assemble, parameter_names
from rigid.terms import STATE_FIELDS, Term

__all__ = ["CHANNELS", "FIXED_NUMBERS", "SUMMARY", "make_parts"]

FIXED_NUMBERS = (
    "mass", "inertia", "length", "stance", "counterweight", "gravity", "weight", "torque", "torque_until",
    "wheel_inertia", "wheel_sign", "wheel_speed_0", "mu_s", "mu_d",
)  # fmt: skip
"""The first columns of the trials' numbers; those of the ground's law and of the effects follow."""
SUMMARY = (
    "trajectory_angle", "max_speed", "max_angular_velocity", "stand", "pivot", "slip", "hop", "status",
    "x", "y", "theta", "vx", "vy", "omega", "wheel_speed", "splits", "longest_step",
)  # fmt: skip
"""Columns of the summary: launch, largest speeds, theta on entering each state first (NaN: never), status, end, and the
longest step [s] for the coordinate that a term has of its own (NaN: there is none).

Status: 0 done, 1 too deep, 2 no longer finite, 3 cannot stand, 4 the step is too long for a term's own coordinate."""
CHANNELS = ("x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "wheel_speed", "state")  # Channels of the series
_MOTION = ("x", "y", "theta", "vx", "vy", "omega", "ax", "ay", "alpha", "wheel", "own", "own_v", "own_a")
"""The motion at one time; `own` is the coordinate that a term has of its own, with its speed and acceleration."""
_FORCES = (
    "fx", "fy", "ft", "load", "bound", "mean_h", "bias", "plain_h", "hold", "margin", "own_holds",
)  # fmt: skip
"""Applied force and torque; load, bound and mean arm of the spikes that stick; what holds them and what is left of it.
Pairs of the same of the dry frictions, pulleys and bearing, are `dry_hold`, `dry_bound` and `dry_margin`."""
_MODES = ("touch", "stick", "backwards", "fresh", "over", "lowest", "out")
"""Bits of the spikes that touch, stick, slide towards -x, may stick from now, left a crater with walls (`out`); whether
the torque is over; the lowest spike. `slide`: directions in which pulleys and bearing slide."""
_NUMBERS = (
    "nominal", "until", "spin_up", "braking", "mu_s", "mu_d", "radius", "crater", "kept", "wall",
    "mxx", "mxy", "myy", "mxt", "myt", "mtt", "inverse_x", "inverse_y", "inverse_t",
)  # fmt: skip
"""A trial's torque and when it ends, the wheel's acceleration under 1 N m, friction, tips, mass matrix."""
_TALLY = (
    "best_angle", "largest_speed", "largest_spin", "stand", "pivot", "slip", "hop", "status", "splits", "longest",
)  # fmt: skip
"""What the summary gets, the end of the motion aside."""


def make_parts(terms: tuple[Term, ...], ground: str, count: int) -> SimpleNamespace:
    """For these effects on this ground, for platforms with `count` rows of spikes."""
    from hedgebed_taichi import ti

    model = assemble(terms, ground, taichi=True)
    names = parameter_names(terms)
    State = ti.types.struct(**dict.fromkeys(STATE_FIELDS, ti.f64))
    Parameters = ti.types.struct(**dict.fromkeys(names, ti.f64))
    LAW = len(FIXED_NUMBERS)
    LAW_SIZE = len(model.law.slots)
    vertical, tip_radius, torque_factor = model.vertical, model.tip_radius, model.torque_factor
    inertia, applied, dry_friction = model.inertia, model.applied, model.dry_friction
    inner_start, inner, crater_of = model.inner_start, model.inner, model.crater
    contact, arms, divide_mass = model.contact, model.contact_arms, model.divide_mass
    settle, settled, settled_share, added = model.settle, model.settled, model.settled_share, model.added
    plastic_share, wall_of = model.plastic_share, model.wall
    Motion, Tally, Numbers = (
        ti.types.struct(**dict.fromkeys(fields, ti.f64)) for fields in (_MOTION, _TALLY, _NUMBERS)
    )
    pair = dict.fromkeys(("dry_hold", "dry_bound", "dry_margin"), ti.types.vector(2, ti.f64))
    Forces = ti.types.struct(**dict.fromkeys(_FORCES, ti.f64), **pair)
    Modes = ti.types.struct(**dict.fromkeys(_MODES, ti.i32), slide=ti.types.vector(2, ti.i32))
    Event = ti.types.struct(ahead=ti.f64, kind=ti.i32, which=ti.i32)  # at this share of the step; 0: none (`events`)
    MEMORY = model.has_memory
    SHEDS = model.law.has_memory or model.has("crater", "unload")
    HOLDS = model.has("hold", "rate_pull")
    SETTLES = model.settles
    three = dict.fromkeys(("h", "d", "depth"), ti.types.vector(3, ti.f64))
    Spikes = ti.types.struct(**three, settling=ti.types.vector(3 * max(SETTLES, 1), ti.f64))  # spike by spike of a term
    CARRIES = model.has("added_mass")
    WALLS = model.has("wall")
    DRY = model.has("vertical_friction", "rotation_friction")
    INNER = model.has("inner_mass")
    BETA = 2 * math.pi / count
    HALF = math.pi / count
    TURN_COS = [math.cos(k * BETA) for k in (-1, 0, 1)]
    TURN_SIN = [math.sin(k * BETA) for k in (-1, 0, 1)]
    TWICE_COS, TWICE_SIN = math.cos(2 * BETA), math.sin(2 * BETA)
    DIAGONAL = not model.has("mass", "up", "added_mass")  # then the mass matrix is constant and diagonal
    SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(8)]
    COSINE = [(-1) ** k / math.factorial(2 * k) for k in range(9)]
    NAN = math.nan
    NEAR = 1e-12  # of a bound: less is rounding

    @ti.func
    def load_parameters(numbers: ti.template(), i):
        return Parameters(*[numbers[i, LAW + LAW_SIZE + k] for k in ti.static(range(len(names)))])

    @ti.func
    def small_sine(a):
        value = SINE[7]
        for k in ti.static(range(6, -1, -1)):
            value = value * (a * a) + SINE[k]
        return value * a

    @ti.func
    def small_cosine(a):
        value = COSINE[8]
        for k in ti.static(range(7, -1, -1)):
            value = value * (a * a) + COSINE[k]
        return value

    @ti.func
    def dry_along(s: ti.template(), x, y, turn):
        """Parts of a vector along the directions of the dry frictions: the vertical, the rotation."""
        return ti.Vector([s.up_x * x + s.up_y * y, turn])

    @ti.func
    def earlier(e: ti.template(), share, kind, which):
        """Put an event at this share of the step into `e`, where it comes before what is there."""
        if share < e.ahead or e.kind == 0:
            e.ahead, e.kind, e.which = share, kind, which

    @ti.func
    def crater_left(c: ti.template(), out, x, deepest, given_way, place):
        """As `System._crater_left` has it: what is left of a crater at x, and its slope."""
        share, slope = 1.0, 0.0
        bottom = c.kept * deepest + given_way
        if out != 0 and bottom > 0.0:
            share = 1.0 - c.wall * ti.abs(x - place) / bottom
            slope = -c.wall / bottom
            if x < place:
                slope = -slope
            if share <= 0.0:
                share, slope = 0.0, 0.0
        return share, slope

    @ti.func
    def state_of(touch, stick):
        state = 3
        if touch != 0:
            state = 2
            if stick != 0:
                state = 1
                if (stick & (stick - 1)) != 0:
                    state = 0
        return state

    @ti.func
    def trial_state(numbers: ti.template(), i):
        return State(
            inner_mode=1.0, mass=numbers[i, 0], inertia=numbers[i, 1], length=numbers[i, 2], stance=numbers[i, 3],
            counterweight=numbers[i, 4], gravity=numbers[i, 5], weight=numbers[i, 6],
        )  # fmt: skip

    @ti.func
    def trial_numbers(numbers: ti.template(), i, s: ti.template(), p: ti.template()):
        c = Numbers(nominal=numbers[i, 7], until=numbers[i, 8], mu_s=numbers[i, 12], mu_d=numbers[i, 13])
        c.spin_up = numbers[i, 10] / numbers[i, 9]
        if numbers[i, 10] < 0.0:
            c.braking = 1.0
        c.radius = tip_radius(p)
        c.crater = crater_of(p)
        c.kept = ti.max(c.crater, plastic_share(p))
        c.wall = wall_of(p)
        set_mass(c, p, s)
        c.inverse_x, c.inverse_y, c.inverse_t = 1.0 / c.mxx, 1.0 / c.myy, 1.0 / c.mtt
        return c

    @ti.func
    def set_mass(c: ti.template(), p: ti.template(), s: ti.template()):
        c.mxx, c.mxy, c.myy, c.mxt, c.myt, c.mtt = inertia(p, s)

    @ti.func
    def divide(c: ti.template(), fx, fy, ft):
        return divide_mass(c.mxx, c.mxy, c.myy, c.mxt, c.myt, c.mtt, fx, fy, ft)

    return SimpleNamespace(**locals())
