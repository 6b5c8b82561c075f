"""A platform in space on the spring-damper, as the coupling's master steps it: by itself, or beside a run on grains."""

from dataclasses import replace

import numpy as np

from coupling import LawGround, SpatialRun
from experiments.runs.types import Json
from experiments.tumble.coupled import STEP
from rigid.platform.platform import Platform
from rigid.spatial.quaternions import from_turn, to_matrix

from .settings import SpatialSettings
from .trial import SpatialPlan

__all__ = ["feet_count", "run_on_law", "start_of"]

LAW_LOWERING, LAW_REST = 0.05, 0.11
"""Of the placement on a law, where it is not set: its least speed [m/s], and the longest time constant with which a
platform comes to rest, W / (K speed) on all tips that it stands on [s]; on one of four it still rests within 3 s."""


def run_on_law(settings: SpatialSettings, plan: SpatialPlan) -> SpatialRun:
    """The trial on the spring-damper, ready to be stepped; beside a bed explicitly, ten steps at a time."""
    ground = LawGround.of_spatial(plan.trial)
    ground.grounds = [replace(ground, time_step=STEP) for ground in ground.grounds]
    beside = settings.ground == "bed"
    return SpatialRun(
        plan.trial, ground, lowering_speed=(settings.lowering_speed or _lowering(plan)) if settings.placed else None,
        energy_interval=1e-3, duration=settings.duration, substeps=10 if beside else settings.substeps,
        body_steps=1 if beside else settings.body_steps, extrapolation=0 if beside else settings.extrapolation,
        iterations=1 if beside else settings.iterations, **start_of(settings, plan.trial.platform),
    )  # fmt: skip


def start_of(settings: SpatialSettings, platform: Platform) -> Json:
    """Where it starts and how it moves there, as `SpatialRun` takes it."""
    turn = from_turn(settings.turn)
    start: Json = {
        "quaternion": tuple(turn), "velocity": settings.velocity, "angular_velocity": settings.angular_velocity,
    }  # fmt: skip
    if settings.height is not None:
        lowest = float(((platform.tips - platform.centre_of_mass) @ to_matrix(turn)[2]).min())
        start["position"] = (0.0, 0.0, settings.height - lowest)
    return start


def feet_count(plan: SpatialPlan) -> int:
    """Spikes that the platform stands on."""
    stance = plan.trial.platform.stance()
    return len(stance.row) + len(stance.rear)


def _lowering(plan: SpatialPlan) -> float:
    """Speed of the placement, where it is not set [m/s]: heavier on softer ground is faster."""
    carried = feet_count(plan) * plan.numbers["stiffness"].value
    return max(LAW_LOWERING, float(np.linalg.norm(plan.trial.weight)) / (carried * LAW_REST))
