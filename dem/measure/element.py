"""A sample without weight between two rough walls, pressed and sheared: strength as a function of the grains alone.

Gravity is off, so that every layer carries the same stresses and weight is not taken for cohesion (docs/bed.md). The
sample is periodic sideways. Floor and lid are planes on which grains neither slide nor roll, as in
``dem.measure.shearing``. Nothing in it has a length but the grains: stresses scale with the pressure, and with cohesion
the strength depends on surface energy over pressure times diameter.

1. The lid presses grains of a loose jittered column together under servo control, in a drag and without adhesion.
   Adhesion acts again once the sample rests. Sticking grains would stay apart in a gauze of chains, at a packing of a
   third, unlike any soil. They have their own friction and rolling friction meanwhile, or, for denser samples, a
   friction of choice and no rolling friction.
2. The lid moves sideways, the pressure held. Rates are given as inertial numbers, rate d sqrt(density / pressure);
   below some 5e-3 strength hardly depends on them (GDR MiDi 2004, Eur. Phys. J. E 14:341).

Units of time below are d sqrt(density / pressure).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from dem.contact.law import pair_row
from dem.contact.timestep import choose_young
from dem.engine import runtime
from dem.engine.base import FLOOR
from dem.engine.core import BedCore
from dem.engine.stress import stress_profile
from dem.engine.values import BedFailure
from dem.grains.materials import Facing, Material
from dem.grains.packing import draw_radii, packing_profile, rain_positions
from dem.grains.sizes import Uniform

from .lid import ROUGH, Tell, add_lid, refuse_not_positive

__all__ = ["ElementShear", "press_element", "shear_element"]

# Distance of the column's sites [largest diameters].
_SITES = 1.06
# Packing that the height is reckoned with.
_PACKING = 0.58
# Speeds over sqrt(pressure / density): of the lid on its way to the grains, and of its servo per share of pressure that
# is missing; steps between two checks of the servo, and in how many units of time what is missing is taken into its
# speed while the sample is sheared: one that dilates steadily needs a lid that rises steadily.
_APPROACH, _SERVO, _STEPS, _REMEMBERS = 0.3, 0.06, 20, 4.0
# The servo's bound for stiff samples. Their modulus M goes as young^2/3 pressure^1/3: the lid gains on its pressure at
# the rate servo M / pressure / height, which sound brings back to it after height / sqrt(M / density). The product of
# the two, servo (young / pressure)^1/3, must stay near 1 or below: at 1.25 samples came to rest, at 1.4 none of three.
_STABLE = 0.8
# Time constants of the drag while the grains are brought together (a shorter one would carry the lid instead: at
# a tenth of sqrt(pressure / density) a layer of ten diameters takes 6 % of the pressure) and while they come to rest;
# how long pressure and rest must hold, when it gives up [units of time].
_THIN, _DRAG, _HOLDS, _LONGEST = 10.0, 1.0, 3.0, 600.0
# Pressed: within this share, and this mean kinetic energy of a grain over pressure d^3.
_NEAR, _CALM = 0.02, 1e-5
# Layers next to floor and lid that are left out of the stress and the packing [mean diameters].
_MARGIN = 2.0
# Strain between two samples of the stress inside.
_SAMPLE = 0.02
# The grains are made for this many times the pressure: chains of force under shear are stronger than at rest.
_SPARE = 1.5
# The worst of thousands of contacts over a long shear goes past what a bed is softened for; the bound is this many
# times that, or this overlap over diameter where that is more: single contacts of it do no harm.
_BOUND, _HARMLESS = 3.0, 0.1


@dataclass(frozen=True)
class ElementShear:
    """One run. Arrays of shape [n], those of the inside of shape [m] and [m, 3, 3].

    Attributes:
        strain: the lid's way over the sample's height when the shearing began [1].
        height: of the lid [m]. shear, normal: what the grains push the lid with over its area [Pa].
        inside_strain, packing, stress: packing fraction [1] and stress tensor [Pa] two diameters from lid and floor.
        pressure: asked for [Pa]. inertial_number: [1]. packing_before: of the inside before it was sheared [1].
        young: of the grains [Pa]. grain_count: [1]. max_overlap: largest overlap over diameter [1].
    """

    strain: np.ndarray
    height: np.ndarray
    shear: np.ndarray
    normal: np.ndarray
    inside_strain: np.ndarray
    packing: np.ndarray
    stress: np.ndarray
    pressure: float
    inertial_number: float
    packing_before: float
    young: float
    grain_count: int
    max_overlap: float


class _Wall:
    """The lid: it holds its pressure, at rest or on its way sideways."""

    def __init__(self, bed: BedCore, body: int, *, pressure: float, grain: float):
        self.bed, self.body, self.pressure = bed, body, pressure
        self.area = bed.size[0] * bed.size[1]
        self.speed = math.sqrt(pressure / bed.material.density)
        self.unit = grain / self.speed
        self._servo = min(_SERVO, _STABLE / (bed.material.young / pressure) ** (1 / 3))
        self._steady = 0.0

    @property
    def height(self) -> float:
        return float(self.bed.body_position(self.body)[2])

    def press(self, drag_time: float) -> float:
        """A few steps towards the pressure; the missing share of it [1]."""
        self.bed.advance(_STEPS, drag_time=drag_time)
        missing = 1 - float(self.bed.reaction(self.body)[0][2]) / (self.pressure * self.area)
        down = _APPROACH if missing > 0.6 else self._servo * max(-1.0, missing)
        self.bed.move_body(self.body, velocity=(0.0, 0.0, -down * self.speed))
        return missing

    def shear(self, sideways: float) -> np.ndarray:
        """A few steps on its way sideways [m/s]; what the grains pushed it with meanwhile [N], shape [3]."""
        self.bed.advance(_STEPS)
        force = self.bed.reaction(self.body)[0]
        down = self._servo * self.speed * max(-1.0, min(1.0, 1 - float(force[2]) / (self.pressure * self.area)))
        self._steady += down * _STEPS * self.bed.time_step / (_REMEMBERS * self.unit)
        self.bed.move_body(self.body, velocity=(sideways, 0.0, -down - self._steady))
        return force


def press_element(
    material: Material,
    *,
    pressure: float,
    grain: float,
    size: tuple[float, float, float] = (10.0, 8.0, 10.0),
    pressed_friction: float | None = None,
    spread: float = 0.15,
    seed: int = 1,
    max_overlap: float = 0.05,
    threads: int | None = None,
) -> tuple[BedCore, int]:
    """A sample at rest under its lid, without gravity; the bed and the lid's number.

    Args:
        pressure: of the lid [Pa]. grain: mean diameter [m].
        size: of the sample, about [mean diameters]: both periods and the height.
        pressed_friction: of the grains while they are pressed, then without rolling friction; 0 is densest [1]. Their
            own, rolling friction as well, when None.
        spread: diameters are uniform within 1 +- this [1]. max_overlap: the grains are softened to it.

    Raises ValueError: a pressure, a length or a friction that cannot be. BedFailure: it did not come to rest.
    """
    if pressed_friction is not None and not 0 <= pressed_friction < math.inf:
        raise ValueError(f"pressed_friction = {pressed_friction} must be 0 or more")
    refuse_not_positive(pressure=pressure, grain=grain)
    for name, value in zip("xyz", size, strict=True):
        if not 6 <= value < math.inf:
            raise ValueError(f"size: {name} = {value} must be positive and at least 6")
    young = choose_young(material, pressure=_SPARE * pressure, speed=0.0, max_overlap=max_overlap, diameter=grain)
    sizes = Uniform(grain, spread)
    period = (size[0] * grain, size[1] * grain)
    rng = np.random.default_rng(seed)
    radii = draw_radii(rng, _PACKING * period[0] * period[1] * size[2] * grain, sizes)
    positions = rain_positions(rng, radii, period, sites=(_SITES, _SITES))
    runtime.start(threads=threads)
    top = float((positions[:, 2] + radii).max())
    bed = BedCore.from_grains(
        material.with_rolling(),
        positions=positions,
        radii=radii,
        size=(*period, size[2] * grain),
        height=top + 5 * grain,
        gravity=0.0,
        young=young,
        max_overlap=max_overlap,
        seed=seed,
        threads=threads,
    )
    bed.overlap_limit = max(_BOUND * max_overlap, _HARMLESS)
    body = add_lid(bed, grain, Facing())
    _touch(bed, body, friction=pressed_friction, adhesive=False)
    wall = _Wall(bed, body, pressure=pressure, grain=grain)
    _rest(bed, wall, grain)
    if pressed_friction is not None or bed.material.cohesion != "none":
        _touch(bed, body)
        _rest(bed, wall, grain)
    return bed, body


def _touch(bed: BedCore, body: int, *, friction: float | None = None, adhesive: bool = True) -> None:
    """How grains touch one another, lid and floor: as the material says on rough walls, or all with this friction."""
    stuff = bed.material
    alike = Facing(
        friction=friction, rolling_friction=None if friction is None else 0.0, surface_energy=None if adhesive else 0.0
    )
    rough = alike if friction is not None else replace(alike, friction=ROUGH, rolling_friction=ROUGH)
    bed.engine.grain_pair[None] = pair_row(stuff, replace(alike, young=stuff.young, poisson=stuff.poisson))
    bed.engine.body_pair[body] = bed.engine.body_pair[FLOOR] = pair_row(stuff, rough)


def _rest(bed: BedCore, wall: _Wall, grain: float) -> None:
    held, began, energy, missing = 0.0, bed.time, math.inf, 1.0
    while held < _HOLDS * wall.unit:
        drag = _THIN if missing > 0.2 else _DRAG
        missing = wall.press(max(2.01 * bed.time_step, drag * wall.unit))
        if near := abs(missing) < _NEAR:
            energy = bed.kinetic_energy / bed.grain_count / (wall.pressure * grain**3)
        held = held + _STEPS * bed.time_step if near and energy < _CALM else 0.0
        if bed.time - began > _LONGEST * wall.unit:
            raise BedFailure(
                f"the sample did not come to rest under its lid: of {wall.pressure:.4g} Pa {100 * missing:.3g} % were "
                f"missing, {energy:.1e} p d^3 of kinetic energy a grain ({_CALM:g} was wanted)"
            )


def shear_element(
    material: Material,
    *,
    pressure: float,
    grain: float,
    strain: float = 1.5,
    inertial_number: float = 5e-3,
    tell: Tell = lambda share: None,
    **options,
) -> ElementShear:
    """Press a sample (``press_element``, whose options these are) and shear it.

    Args:
        strain: how far, over the height [1]. inertial_number: [1].
        tell: called with the share done, 0 to 1.

    Raises ValueError: as ``press_element``; a strain or a number that is not positive. BedFailure: it did not come to
    rest, or the bed's own reasons.
    """
    refuse_not_positive(strain=strain, inertial_number=inertial_number)
    bed, body = press_element(material, pressure=pressure, grain=grain, **options)
    tell(0.1)
    wall = _Wall(bed, body, pressure=pressure, grain=grain)
    before, start = wall.height, float(bed.body_position(body)[0])
    speed = inertial_number * before / wall.unit
    bed.max_overlap = 0.0
    rows, samples = [], [_sample(bed, 0.0, before, grain)]
    while (gone := (float(bed.body_position(body)[0]) - start) / before) < strain:
        force = wall.shear(speed)
        rows.append((gone, wall.height, -force[0] / wall.area, force[2] / wall.area))
        if gone >= samples[-1][0] + _SAMPLE:
            samples.append(_sample(bed, gone, wall.height, grain))
            tell(0.1 + 0.9 * min(1.0, gone / strain))
    inside_strain, packing, stress = (np.array(values) for values in zip(*samples, strict=True))
    return ElementShear(
        *np.array(rows).T,
        inside_strain=inside_strain,
        packing=packing,
        stress=stress,
        pressure=pressure,
        inertial_number=inertial_number,
        packing_before=samples[0][1],
        young=bed.material.young,
        grain_count=bed.grain_count,
        max_overlap=bed.max_overlap,
    )


def _sample(bed: BedCore, strain: float, height: float, grain: float) -> tuple[float, float, np.ndarray]:
    edges = np.array([_MARGIN * grain, height - _MARGIN * grain])
    grains = bed.grains()
    packing = packing_profile(grains.position[:, 2], grains.radius, bed.size[0] * bed.size[1], edges)
    return strain, float(packing[0]), stress_profile(bed, edges)[0]
