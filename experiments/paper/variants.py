"""What `hedgebed paper` varies beside friction's band: all that the paper does not give, and the ground under grains.

Numbers of platform and contact, halved and doubled; sliding friction, from the half of static friction, which is ours,
up to all of it; and for the brake trials on grains how stiff the ground is by how much it gives back.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from experiments.platform.surfaces import find_surface
from experiments.tumble.trial import SPIKES_PER_ROW
from rigid.ground.laws import find_law
from rigid.model.trial import Effect, Ground, Trial

from .settings import PaperSettings
from .transitions import HARD

__all__ = ["FACTORS", "GRAINS", "SLIDING", "SWEPT", "Variant", "variants"]

GRAINS = ("sand", "jsc1a")
SWEPT = ("inertia", "wheel_inertia", "stiffness", "damping", "wheel_speed_0")
"""Numbers that the paper does not give, halved and doubled."""
FACTORS = (0.5, 2.0)
SLIDING = (0.6, 0.8, 1.0)
"""mu_d / mu_s [1]; the paper gives no mu_d, and 0.5 stands where nothing is measured."""
TORQUE_RISE, RISE = Path(__file__).parents[1] / "terms" / "torque_rise.py", 0.1
"""A term, and its time constant [s]: what a step of the torque hides."""
MEMORY_LAW, LITTLE = "katsuragi-durian", 0.05
"""A law whose stiffness and rebound can be set apart, and its own rebound [1]: it gives back next to nothing."""
HALF = 0.5
"""The most that `rebound` can be."""
OTHER_LAWS = ("bekker", "rft")
"""Laws of grains with a stiffness of their own, at the same rebound."""


@dataclass(frozen=True)
class Variant:
    """One trial beside the nominal one."""

    name: str
    trial: Trial
    kind: str = ""
    """Which list of result.json it goes to: "sweep", "sliding" or "grains"; none where it is only for a claim."""
    varied: Mapping[str, Any] = field(default_factory=dict)
    """What was varied: key and factor; ratio (mu_d / mu_s); or law, stiffness (of a row, N/m) and rebound."""


def variants(settings: PaperSettings, trial: Trial, *, surface: str, first_rig: bool) -> Iterator[Variant]:
    """Those of one gravity, torque and surface. `first_rig`: whether the gravity is that of Figures 5 and 6."""
    brake = trial.actuator == "brake"
    if surface in GRAINS and brake:
        yield from _grains(trial, whole=settings.sweep)
    if surface == "steel" and first_rig and trial.torque == min(settings.motor_torques):
        rising = Effect(id="torque-rise", parameters={"rise": RISE}, file=TORQUE_RISE)
        yield Variant(f"torque rise {RISE:g} s", replace(trial, effects=(rising,)))
    if not settings.sweep:
        return
    if surface in HARD and first_rig:
        for key in SWEPT:
            value = getattr(trial, key)
            for factor in FACTORS if value else ():
                varied = replace(trial, **{key: factor * value})
                yield Variant(f"{key} x{factor:g}", varied, "sweep", {"key": key, "factor": factor})
    if (surface in HARD and first_rig) or (surface in GRAINS and brake):
        for ratio in SLIDING:
            yield Variant(f"mu_d {ratio:g} mu_s", replace(trial, mu_d=ratio * trial.mu_s), "sliding", {"ratio": ratio})


def _grains(trial: Trial, *, whole: bool) -> Iterator[Variant]:
    """Stiffness by rebound: the surface's own stiffness at little rebound first, the rest where `whole`."""
    law = find_law(MEMORY_LAW)
    default = SPIKES_PER_ROW * law.values({})["stiffness"]
    own = trial.stiffness

    def remembers(stiffness: float, rebound: float) -> Variant:
        parameters = {"stiffness": stiffness / SPIKES_PER_ROW, "rebound": rebound}
        ground = Ground(name=MEMORY_LAW, parameters=parameters, spikes_per_row=SPIKES_PER_ROW)
        varied = {"law": MEMORY_LAW, "stiffness": stiffness, "rebound": rebound}
        name = f"{MEMORY_LAW} {stiffness:.4g} N per m rebound {rebound:g}"
        return Variant(name, replace(trial, ground=ground), "grains", varied)

    yield remembers(own, LITTLE)
    if not whole:
        return
    for stiffness in sorted({default, own, *(find_surface(name).stiffness for name in GRAINS)}):
        # No damper: it gives back all that it took.
        spring = replace(trial, stiffness=stiffness, damping=0.0)
        varied = {"law": "spring-damper", "stiffness": stiffness, "rebound": 1.0}
        yield Variant(f"spring {stiffness:.4g} N per m", spring, "grains", varied)
        for rebound in (HALF, LITTLE):
            if (stiffness, rebound) != (own, LITTLE):
                yield remembers(stiffness, rebound)
    for name in OTHER_LAWS:
        ground = Ground(name=name, parameters={"rebound": LITTLE}, spikes_per_row=SPIKES_PER_ROW)
        varied = {"law": name, "stiffness": None, "rebound": LITTLE}
        yield Variant(name, replace(trial, ground=ground), "grains", varied)
