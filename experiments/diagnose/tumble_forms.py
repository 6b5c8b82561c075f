"""The library of a tumble's effects: each in the forms that nature's may come close to, amplitudes from zero.

A form fits coordinates in which zero is the base model (1 / length of a pendulum, exponent - 1); `physical` turns them
into the parameters of the term (`rigid.terms`). A scale such as the reach of adhesion is fitted as a logarithm about a
typical value, with a prior of one factor of e: without one it would run away where the data do not tell it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .own import OwnEffect, own_parameters, own_starts
from .problem import Form, Parameter

__all__ = ["TumbleForm", "tumble_forms"]

Array = NDArray[np.float64]
Columns = dict[str, Array]


@dataclass(frozen=True, kw_only=True)
class TumbleForm(Form):
    """A form with what it means to the term."""

    physical: Callable[[Mapping[str, Array]], Columns]
    """Arrays of the form's parameters -> arrays of the term's, under their names "<effect>.<parameter>"."""
    form_std: float = 0.0
    """Of the amplitude, relative: how far nature's law lets it be another number than the form's."""


def _free(name: str, unit: str, scale: float, *, lowest: float = -math.inf, highest: float = math.inf) -> Parameter:
    return Parameter(name=name, unit=unit, value=0.0, scale=scale, step=0.02 * scale, lowest=lowest, highest=highest)


def _log(name: str) -> Parameter:
    """The logarithm of a scale over its typical value."""
    return Parameter(name=name, unit="1", value=0.0, std=1.0, scale=0.5, lowest=-4.0, highest=4.0, step=0.02)


def _same(*names: str) -> Callable[[Mapping[str, Array]], Columns]:
    return lambda values: {name: np.asarray(values[name], dtype=float) for name in names}


_DRY = 0.05
"""Bearings' friction depends on the speed too: by Stribeck's law more near rest, by their grease more when fast, each
by some tens of percent (Armstrong-Helouvry et al. 1994, Automatica 30:1083). What "the" friction is, is uncertain by
some hundredths: on the suite of hidden effects 3 to 4 %."""


def _plain(
    effect: str,
    form: str,
    *parameters: Parameter,
    starts: tuple[Mapping[str, float], ...] = (),
    form_std: float = 0.0,
    redefines: tuple[str, ...] = (),
) -> TumbleForm:
    """A form whose parameters are the term's own."""
    names = tuple(p.name for p in parameters)
    return TumbleForm(
        effect=effect, name=form, parameters=parameters, amplitude=names[0], starts=starts, physical=_same(*names),
        form_std=form_std, redefines=redefines,
    )  # fmt: skip


def _pendulum(values: Mapping[str, Array], *, arc: bool = False) -> Columns:
    curvature = np.asarray(values["pendulum.curvature"], dtype=float)
    with np.errstate(divide="ignore"):
        columns = {"pendulum.length": np.where(curvature > 0, 1 / np.maximum(curvature, 1e-12), math.inf)}
    if arc:
        columns["pendulum.arc"] = np.ones_like(curvature)
    if "pendulum.offset" in values:
        columns["pendulum.offset"] = np.asarray(values["pendulum.offset"], dtype=float)
    return columns


def _drag(values: Mapping[str, Array]) -> Columns:
    found = {name: np.asarray(values[name], dtype=float) for name in ("inertial-drag.normal", "inertial-drag.sideways")}
    return found | {"inertial-drag.power": 2.0 + np.asarray(values["inertial-drag.power_change"], dtype=float)}


def _gripping(values: Mapping[str, Array], *, reach: float) -> Columns:
    force = np.asarray(values["adhesion.force"], dtype=float)
    log_reach = np.asarray(values["adhesion.log_reach"], dtype=float)
    return {"adhesion.force": force, "adhesion.reach": reach * np.exp(log_reach), "adhesion.grip": np.ones_like(force)}


def _torn(values: Mapping[str, Array], *, reach: float, speed: float) -> Columns:
    log_reach, log_speed = (np.asarray(values[f"adhesion.log_{name}"], dtype=float) for name in ("reach", "speed"))
    return {
        "adhesion.force": np.asarray(values["adhesion.force"], dtype=float),
        "adhesion.reach": reach * np.exp(log_reach),
        "adhesion.speed": speed * np.exp(log_speed),
    }


def _hollow(values: Mapping[str, Array]) -> Columns:
    share = np.asarray(values["plastic-sinkage.share"], dtype=float)
    return {"plastic-sinkage.share": share, "plastic-sinkage.open": np.ones_like(share)}


def _scaled(
    amplitude: str, scale: str, typical: float, *, shift: float = 0.0, log: str
) -> Callable[[Mapping[str, Array]], Columns]:
    return lambda values: {
        amplitude: shift + np.asarray(values[_own(amplitude, shift)], dtype=float),
        scale: typical * np.exp(np.asarray(values[log], dtype=float)),
    }


def _own(amplitude: str, shift: float) -> str:
    return amplitude if shift == 0 else f"{amplitude}_change"


def tumble_forms(
    *, rig: bool, sinkage: float, weight: float, friction_speed: float = 0.05, wheel_speed: float = 100.0,
    lift_speed: float = 2e-3, own: Sequence[OwnEffect] = (),
) -> tuple[TumbleForm, ...]:  # fmt: skip
    """The library for one campaign.

    Args:
        rig: whether the campaign has the gravity-offloading rig; four effects need it.
        sinkage: depth of a row at rest [m]: the reference of hardening and the reach of adhesion are about this.
        weight: on the surface [N]: amplitudes of forces are about a hundredth of it.
        friction_speed: typical sliding speed [m/s].
        wheel_speed: typical speed of the wheel [rad/s].
        lift_speed: typical speed of a tip that goes out [m/s]: the depth at rest times the frequency of bouncing.
        own: effects from files.
    """
    force, moment = 0.02 * weight, 0.005 * weight
    pulls = tuple({"adhesion.force": a * force, "adhesion.log_reach": s} for a, s in ((3, 0.0), (10, 1.5), (10, -1.0)))
    forms = [
        TumbleForm(
            effect="wheel-vibration",
            name="saturating",
            amplitude="wheel-vibration.reduction",
            parameters=(
                _free("wheel-vibration.reduction", "1", 0.1, lowest=0.0, highest=0.95),
                _log("wheel-vibration.log_speed"),
            ),
            physical=_scaled(
                "wheel-vibration.reduction", "wheel-vibration.speed", wheel_speed, log="wheel-vibration.log_speed"
            ),
            starts=tuple({"wheel-vibration.reduction": 0.15, "wheel-vibration.log_speed": s} for s in (-1.5, 0.0, 1.2)),
        ),
        _plain(
            "com-offset",
            "both",
            _free("com-offset.x", "m", 2e-4, lowest=-0.03, highest=0.03),
            _free("com-offset.y", "m", 2e-4, lowest=-0.03, highest=0.03),
            starts=tuple(
                {"com-offset.x": x, "com-offset.y": y}
                for x, y in ((3e-4, 0.0), (-3e-4, 0.0), (0.0, 3e-4), (0.0, -3e-4))
            ),
        ),
        _plain(
            "slope",
            "plane",
            _free("slope.angle", "rad", 1e-3, lowest=-0.3, highest=0.3),
            starts=({"slope.angle": 2e-3}, {"slope.angle": -2e-3}),
        ),
        _plain(
            "tip-radius",
            "ball",
            _free("tip-radius.radius", "m", 1e-3, lowest=0.0, highest=0.05),
            starts=({"tip-radius.radius": 2e-3}, {"tip-radius.radius": 8e-3}),
        ),
        _plain(
            "torque-fade",
            "speed",
            _free("torque-fade.speed_loss", "s/rad", 1e-4, lowest=0.0, highest=0.02),
            starts=({"torque-fade.speed_loss": 1e-4}, {"torque-fade.speed_loss": 6e-4}),
        ),
        _plain(
            "torque-fade",
            "time",
            _free("torque-fade.time_loss", "1/s", 0.02, lowest=0.0, highest=5.0),
            starts=({"torque-fade.time_loss": 0.03}, {"torque-fade.time_loss": 0.2}),
        ),
        _plain(
            "inertial-drag",
            "normal",
            _free("inertial-drag.normal", "kg/m", 0.5, lowest=0.0, highest=1e4),
            starts=({"inertial-drag.normal": 1.0}, {"inertial-drag.normal": 20.0}),
        ),
        _plain(
            "inertial-drag",
            "both",
            _free("inertial-drag.normal", "kg/m", 0.5, lowest=0.0, highest=1e4),
            _free("inertial-drag.sideways", "kg/m", 0.2, lowest=0.0, highest=1e4),
            starts=(
                {"inertial-drag.normal": 1.0, "inertial-drag.sideways": 0.3},
                {"inertial-drag.normal": 10.0, "inertial-drag.sideways": 2.0},
            ),
        ),
        TumbleForm(
            effect="inertial-drag",
            name="any power",
            amplitude="inertial-drag.normal",
            parameters=(
                _free("inertial-drag.normal", "kg/m", 0.5, lowest=0.0, highest=1e4),
                _free("inertial-drag.sideways", "kg/m", 0.2, lowest=0.0, highest=1e4),
                Parameter(
                    name="inertial-drag.power_change",
                    unit="1",
                    value=0.0,
                    std=0.3,
                    scale=0.2,
                    lowest=-1.0,
                    highest=1.0,
                    step=0.01,
                ),
            ),
            physical=_drag,
            starts=tuple(
                {"inertial-drag.normal": b, "inertial-drag.sideways": 0.3 * b, "inertial-drag.power_change": 0.0}
                for b in (1.0, 10.0)
            ),
        ),
        _plain(
            "depth-hardening",
            "straight while shallow",
            _free("depth-hardening.bend", "1/m", 0.03 / max(sinkage, 1e-6), lowest=-1e6, highest=1e6),
            starts=tuple({"depth-hardening.bend": b / max(sinkage, 1e-6)} for b in (0.005, 0.05, 0.5, -0.03, -0.4)),
            redefines=("stiffness",),
        ),
        TumbleForm(
            effect="depth-hardening",
            name="power",
            amplitude="depth-hardening.exponent_change",
            redefines=("stiffness",),
            parameters=(
                _free("depth-hardening.exponent_change", "1", 0.1, lowest=-0.65, highest=2.5),
                _log("depth-hardening.log_reference"),
            ),
            physical=_scaled(
                "depth-hardening.exponent",
                "depth-hardening.reference",
                max(sinkage, 1e-6),
                shift=1.0,
                log="depth-hardening.log_reference",
            ),
            starts=tuple(
                {"depth-hardening.exponent_change": n, "depth-hardening.log_reference": s}
                for n, s in ((0.3, 0.7), (-0.2, 0.7), (0.3, 2.0))
            ),
        ),
        _plain(
            "plastic-sinkage",
            "share",
            _free("plastic-sinkage.share", "1", 0.1, lowest=0.0, highest=0.93),
            starts=tuple({"plastic-sinkage.share": f} for f in (0.15, 0.5, 0.85)),
        ),
        _plain(
            "plastic-sinkage",
            "bent way back",
            _free("plastic-sinkage.share", "1", 0.1, lowest=0.0, highest=0.93),
            Parameter(
                name="plastic-sinkage.bend", unit="1", value=0.0, std=1.0, scale=0.3, lowest=0.0, highest=4.0, step=0.01
            ),
            starts=tuple({"plastic-sinkage.share": f, "plastic-sinkage.bend": 0.3} for f in (0.05, 0.15, 0.5, 0.85)),
        ),
        TumbleForm(
            effect="plastic-sinkage",
            name="open crater",
            amplitude="plastic-sinkage.share",
            parameters=(_free("plastic-sinkage.share", "1", 0.1, lowest=0.0, highest=0.93),),
            physical=_hollow,
            starts=tuple({"plastic-sinkage.share": f} for f in (0.15, 0.5, 0.85)),
        ),
        TumbleForm(
            effect="adhesion",
            name="mobilised",
            amplitude="adhesion.force",
            parameters=(
                _free("adhesion.force", "N", force, lowest=0.0, highest=20 * weight),
                _log("adhesion.log_reach"),
            ),
            physical=_scaled("adhesion.force", "adhesion.reach", max(sinkage, 1e-6), log="adhesion.log_reach"),
            starts=pulls,
        ),
        TumbleForm(
            effect="adhesion",
            name="that friction does not lose",
            amplitude="adhesion.force",
            parameters=(
                _free("adhesion.force", "N", force, lowest=0.0, highest=20 * weight),
                _log("adhesion.log_reach"),
            ),
            physical=partial(_gripping, reach=max(sinkage, 1e-6)),
            starts=pulls,
        ),
        TumbleForm(
            effect="adhesion",
            name="on the way out",
            amplitude="adhesion.force",
            parameters=(
                _free("adhesion.force", "N", force, lowest=0.0, highest=20 * weight),
                _log("adhesion.log_reach"),
                replace(_log("adhesion.log_speed"), std=2.0, lowest=-1.5),
            ),
            physical=partial(_torn, reach=max(sinkage, 1e-6), speed=lift_speed),
            starts=tuple(
                {"adhesion.force": a * force, "adhesion.log_reach": d, "adhesion.log_speed": v}
                for a, d, v in ((3, -1.0, -1.0), (10, -1.5, 0.5), (10, 1.5, -1.0))
            ),
        ),
        TumbleForm(
            effect="rate-friction",
            name="saturating",
            amplitude="rate-friction.change",
            parameters=(
                _free("rate-friction.change", "1", 0.1, lowest=-0.9, highest=5.0),
                _log("rate-friction.log_speed"),
            ),
            physical=_scaled(
                "rate-friction.change", "rate-friction.speed", friction_speed, log="rate-friction.log_speed"
            ),
            starts=tuple(
                {"rate-friction.change": c, "rate-friction.log_speed": s}
                for c, s in ((0.3, 0.0), (-0.25, 0.0), (0.4, 1.5), (-0.35, 1.5))
            ),
        ),
        _plain(
            "umbilical",
            "spring",
            _free("umbilical.stiffness", "N m/rad", moment, lowest=0.0, highest=50 * weight),
            starts=({"umbilical.stiffness": 3 * moment},),
        ),
        _plain(
            "umbilical",
            "both",
            _free("umbilical.stiffness", "N m/rad", moment, lowest=0.0, highest=50 * weight),
            _free("umbilical.drag", "N m s/rad", moment, lowest=0.0, highest=50 * weight),
            starts=(
                {"umbilical.stiffness": 0.0, "umbilical.drag": 2 * moment},
                {"umbilical.stiffness": 2 * moment, "umbilical.drag": moment},
            ),
        ),
        _plain(
            "bearing-drag",
            "dry",
            _free("bearing-drag.torque", "N m", moment, lowest=0.0, highest=5 * weight),
            starts=({"bearing-drag.torque": moment}, {"bearing-drag.torque": 4 * moment}),
            form_std=_DRY,
        ),
        _plain(
            "clock-offset",
            "constant",
            _free("clock-offset.offset", "s", 1e-3, lowest=-0.5, highest=0.5),
            starts=(
                {"clock-offset.offset": 3e-3},
                {"clock-offset.offset": -3e-3},
                {"clock-offset.offset": 0.02},
                {"clock-offset.offset": -0.02},
            ),
        ),
        TumbleForm(
            effect="camera-scale",
            name="same in x and y",
            amplitude="camera-scale.scale_change",
            parameters=(_free("camera-scale.scale_change", "1", 2e-3, lowest=-0.3, highest=0.3),),
            physical=lambda values: {
                "camera-scale.scale": 1.0 + np.asarray(values["camera-scale.scale_change"], dtype=float)
            },
            starts=({"camera-scale.scale_change": 5e-3}, {"camera-scale.scale_change": -5e-3}),
        ),
    ]
    if rig:
        curvature = _free("pendulum.curvature", "1/m", 0.05, lowest=0.0, highest=20.0)
        forms += [
            TumbleForm(
                effect="pendulum",
                name="centred",
                parameters=(curvature,),
                amplitude="pendulum.curvature",
                physical=_pendulum,
                starts=({"pendulum.curvature": 0.1}, {"pendulum.curvature": 0.5}),
            ),
            TumbleForm(
                effect="pendulum",
                name="off centre",
                amplitude="pendulum.curvature",
                physical=_pendulum,
                parameters=(
                    curvature,
                    Parameter(
                        name="pendulum.offset",
                        unit="m",
                        value=0.0,
                        std=0.02,
                        scale=0.01,
                        lowest=-0.2,
                        highest=0.2,
                        step=2e-4,
                    ),
                ),
                starts=({"pendulum.curvature": 0.3, "pendulum.offset": 0.0},),
            ),
            TumbleForm(
                effect="pendulum",
                name="true arc",
                parameters=(curvature,),
                amplitude="pendulum.curvature",
                physical=partial(_pendulum, arc=True),
                starts=({"pendulum.curvature": 0.1}, {"pendulum.curvature": 0.5}),
            ),
            _plain(
                "rig-friction",
                "dry",
                _free("rig-friction.force", "N", force, lowest=0.0, highest=5 * weight),
                starts=({"rig-friction.force": force}, {"rig-friction.force": 5 * force}),
                form_std=_DRY,
            ),
            _plain(
                "pulley-inertia",
                "added mass",
                _free("pulley-inertia.mass", "kg", 0.05, lowest=0.0, highest=20.0),
                starts=({"pulley-inertia.mass": 0.1}, {"pulley-inertia.mass": 1.0}),
            ),
        ]
    return (*forms, *(_own_form(effect) for effect in own))


def _own_form(own: OwnEffect) -> TumbleForm:
    parameters = own_parameters(own)

    def physical(values: Mapping[str, Array]) -> Columns:
        return {
            name: np.asarray(values[name], dtype=float) + (own.off if name == parameters[0].name else 0.0)
            for name in (p.name for p in parameters)
        }

    return TumbleForm(
        effect=own.id, name="own", parameters=parameters, amplitude=parameters[0].name, physical=physical,
        starts=own_starts(own, parameters),
    )  # fmt: skip
