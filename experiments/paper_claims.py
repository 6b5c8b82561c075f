"""What the text of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) states, beside our numbers.

A claim is a dict: what is stated, its value, ours with its band over friction, the difference, what it is judged by,
and whether it is met (None where nothing can be compared). The paper prints no table, so that a stated number is a
round one; an angle is judged by the five degrees within which the paper calls model and measurement in agreement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rigid.trial import Trial

from .paper_settings import PaperSettings
from .paper_transitions import HARD, TRANSITIONS, hop_words, is_brief, measured_angles, transition_angle

__all__ = ["AGREEMENT", "claims", "first_lasting", "friction_of_a_rigid_pivot", "sliding_angle"]

AGREEMENT = 5.0
"""Degrees within which the paper calls transition angles in agreement."""
LASTING = 0.1
"""A state that is over before this [s] is not the one in which a platform moves, but the torque setting in."""


def claims(settings: PaperSettings, cases: Sequence[dict[str, Any]], jobs: Sequence[Any]) -> list[dict[str, Any]]:
    """Every statement that the settings have trials for."""
    table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in cases}
    trials = {(j.surface, j.rig, j.torque): j.trial for j in jobs if j.variant == "nominal"}
    low = min(settings.motor_torques)
    found: list[dict[str, Any]] = []
    if "brick" in settings.surfaces:
        found += [_angle(table, "brick", rig, low, 22.5, "starts at about 22.5 degrees") for rig in settings.rigs]
    for surface in HARD:
        if surface in settings.surfaces:
            found += [_grows(settings, table, surface, rig) for rig in settings.rigs]
            for torque in settings.brake_torques:
                at_most = _angle(table, surface, settings.rigs[0], torque, 60.0, "the angle grows to about 60 degrees")
                at_most["note"] += _of_sliding(table, trials, surface, settings.rigs[0], torque, 60.0)
                found.append(at_most)
    for torque in settings.brake_torques:
        found += [_slips_at_once(settings, table, rig, torque) for rig in settings.rigs]
    hops = _hops(settings, table)
    found += [hops] if hops else []
    if "steel" in settings.surfaces:
        found.append(_pivots_first(table, trials, settings.rigs[0], low))
    for surface in ("sand", "jsc1a"):
        if surface in settings.surfaces:
            for torque in settings.brake_torques:
                found += [_negative(table, surface, rig, torque) for rig in settings.rigs]
    transitions = _transitions(settings, table)
    found += [transitions] if transitions else []
    return found


def friction_of_a_rigid_pivot(trial: Trial) -> float:
    """Friction coefficient [1] that a pivot on a rigid ground asks for as the torque sets in.

    About the front tip at gamma = pi / n: (J + m l^2 cos^2 + M_y l^2 sin^2) alpha = tau - W l sin, the tip's forces
    m l cos alpha along and W + M_y l sin alpha upwards, M_y = m + m_b.
    """
    gamma, length = math.pi / trial.spike_count, trial.spike_length
    sine, cosine = length * math.sin(gamma), length * math.cos(gamma)
    heavy = trial.mass + trial.counterweight
    alpha = (trial.torque - trial.weight * sine) / (trial.inertia + trial.mass * cosine**2 + heavy * sine**2)
    return trial.mass * cosine * alpha / (trial.weight + heavy * sine * alpha)


def sliding_angle(trial: Trial) -> float:
    """Launch angle [rad] of a platform that slides throughout under a strong torque: tan = m / (M_y mu_d).

    Friction mu_d N speeds up m along the surface, N lifts M_y = m + m_b (the weight is small beside N). pi / 2 without
    friction.
    """
    return math.atan2(trial.mass, (trial.mass + trial.counterweight) * trial.sliding_friction)


def _claim(
    statement: str, stated: str, ours: str, *, met: bool | None, judged: str, difference: str = "", note: str = ""
) -> dict[str, Any]:
    return {
        "statement": statement,
        "stated": stated,
        "ours": ours,
        "difference": difference,
        "judged_by": judged,
        "met": met,
        "note": note,
    }


def _where(surface: str, rig: float, torque: float) -> str:
    return f"{surface}, {rig:g} g, {torque:g} N m"


def _degrees(value: float | None) -> float | None:
    return None if value is None else math.degrees(value)


def _band(table: dict[Any, Any], surface: str, rig: float, torque: float, key: str) -> list[float]:
    """A number in degrees at low, nominal and high friction, where there is one."""
    values = [_degrees(table[surface, rig, torque, variant][key]) for variant in ("low", "nominal", "high")]
    return [value for value in values if value is not None]


def _angle(table: dict[Any, Any], surface: str, rig: float, torque: float, stated: float, words: str) -> dict[str, Any]:
    ours = _degrees(table[surface, rig, torque, "nominal"]["trajectory_angle"])
    band = _band(table, surface, rig, torque, "trajectory_angle")
    statement = f"{words} ({_where(surface, rig, torque)})"
    judged = f"within {AGREEMENT:g} degrees"
    if ours is None:
        return _claim(statement, f"{stated:g} degrees", "never 10 mm away", met=False, judged=judged)
    inside = min(band) <= stated <= max(band)
    note = f"friction band {min(band):.1f} to {max(band):.1f}: the stated number is {'in' if inside else 'out'}side it"
    if abs(stated - 22.5) < 1e-9:
        note += "; the chord of the first 10 mm of a pure pivot that starts at 22.5 is 21.1"
    return _claim(
        statement,
        f"{stated:g} degrees",
        f"{ours:.1f} degrees",
        met=abs(ours - stated) <= AGREEMENT,
        judged=judged,
        difference=f"{ours - stated:+.1f} degrees",
        note=note,
    )


def _varied(table: dict[Any, Any], surface: str, rig: float, torque: float, kind: str) -> list[dict[str, Any]]:
    """The cases of one gravity, torque and surface in which something was varied."""
    found = [case for (*where, _), case in table.items() if where == [surface, rig, torque]]
    return [case for case in found if case["kind"] == kind]


def _of_sliding(
    table: dict[Any, Any], trials: dict[Any, Any], surface: str, rig: float, torque: float, stated: float
) -> str:
    """What sliding friction has to do with a launch angle."""
    trial = trials[surface, rig, torque]
    heavy = (trial.mass + trial.counterweight) * math.tan(math.radians(stated))
    note = (
        f"; sliding all the way leaves at tan = m / (M_y mu_d), {math.degrees(sliding_angle(trial)):.1f} degrees for "
        f"mu_d = {trial.sliding_friction:g}, and the paper gives no mu_d: {stated:g} degrees would ask for "
        f"{trial.mass / heavy:.3f}, mu_s being {trial.mu_s:g}"
    )
    others = _varied(table, surface, rig, torque, "sliding")
    known = [(case["varied"]["ratio"], _degrees(case["trajectory_angle"])) for case in others]
    told = [f"{angle:.1f} at {ratio:g}" for ratio, angle in known if angle is not None]
    return note + (f"; with mu_d / mu_s varied {', '.join(told)}" if told else "")


def _grows(settings: PaperSettings, table: dict[Any, Any], surface: str, rig: float) -> dict[str, Any]:
    torques = sorted((*settings.motor_torques, *settings.brake_torques))
    angles = [_degrees(table[surface, rig, torque, "nominal"]["trajectory_angle"]) for torque in torques]
    known = [angle for angle in angles if angle is not None]
    return _claim(
        f"the angle grows with torque ({surface}, {rig:g} g)",
        "rising",
        ", ".join("none" if angle is None else f"{angle:.1f}" for angle in angles) + " degrees",
        met=len(known) == len(angles) and known == sorted(known),
        judged="each torque above the one before",
    )


def _slips_at_once(settings: PaperSettings, table: dict[Any, Any], rig: float, torque: float) -> dict[str, Any]:
    first = {}
    for surface in settings.surfaces:
        transitions = table[surface, rig, torque, "nominal"]["transitions"]
        first[surface] = next((_degrees(theta) for _, state, theta in transitions if state == "slip"), None)
    late = [name for name, theta in first.items() if theta is None or theta > AGREEMENT]
    worst = max((theta for theta in first.values() if theta is not None), default=math.inf)
    return _claim(
        f"at {torque:g} N m the platform slips almost at once ({rig:g} g, every surface)",
        "0 degrees",
        f"{worst:.1f} degrees at most" + (f", never on {', '.join(late)}" if math.isinf(worst) else ""),
        met=not late,
        judged=f"theta at the first slip within {AGREEMENT:g} degrees",
        difference=f"{worst:+.1f} degrees",
    )


def _hops(settings: PaperSettings, table: dict[Any, Any]) -> dict[str, Any] | None:
    """Hops of the motor trials, which end tumbles; a brake throws the platform, and its hop is none that is brief."""
    surfaces = [name for name in HARD if name in settings.surfaces]
    if not surfaces:
        return None
    rig = settings.rigs[0]
    torques = (*settings.motor_torques, *settings.brake_torques)
    cases = [table[name, rig, torque, "nominal"] for name in surfaces for torque in torques]
    motor = [case for case in cases if case["actuator"] == "motor"]
    brief = sum(is_brief(case) for case in motor)
    hop = sum(case["transition_angle_hop"] is not None for case in cases)
    return _claim(
        f"even a short tumble ends in a brief hop ({rig:g} g, {' and '.join(surfaces)})",
        "5 of 6 cases",
        f"{brief} of {len(motor)} motor trials",
        met=brief / len(motor) >= 5 / 6 - 1e-9,
        judged="at least that share of the motor trials has a hop shorter than the contact before it",
        note=f"the text says no time; with the brakes {hop} of {len(cases)} hop, briefly {brief}: "
        + "; ".join(hop_words(case) for case in cases),
    )


def _pivots_first(table: dict[Any, Any], trials: dict[Any, Any], rig: float, torque: float) -> dict[str, Any]:
    lasting = first_lasting(table["steel", rig, torque, "nominal"])
    rises = [case for (*_, variant), case in table.items() if variant.startswith("torque rise")]
    risen = "".join(f"; with a {case['variant']} it would {first_lasting(case)} first" for case in rises)
    trial = trials["steel", rig, torque]
    asked = friction_of_a_rigid_pivot(trial)
    others = _varied(table, "steel", rig, torque, "sliding")
    told = [f"{first_lasting(case)} at {case['varied']['ratio']:g}" for case in others]
    slid = f"; with mu_d / mu_s varied, first {', '.join(told)}" if told else ""
    return _claim(
        f"the platform pivots first (steel, {rig:g} g, {torque:g} N m)",
        "pivot",
        lasting,
        met=lasting == "pivot",
        judged=f"the first state that lasts {LASTING:g} s",
        note=f"on rigid ground a pivot would ask for a friction coefficient of {asked:.3f}, of the {trial.mu_s:g} "
        f"there is; on springs the front spike takes the weight over only in time, and a slip that has begun has "
        f"mu_d = {trial.sliding_friction:g}, ours, to hold it{slid}{risen}",
    )


def first_lasting(case: dict[str, Any]) -> str:
    """The first state in which the platform moves for `LASTING` or longer; stand if there is none."""
    transitions = case["transitions"]
    ends = [time for time, _, _ in transitions[1:]] + [math.inf]
    for (begin, state, _), end in zip(transitions, ends, strict=True):
        if state != "stand" and end - begin >= LASTING:
            return str(state)
    return "stand"


def _negative(table: dict[Any, Any], surface: str, rig: float, torque: float) -> dict[str, Any]:
    angle = _degrees(table[surface, rig, torque, "nominal"]["trajectory_angle"])
    return _claim(
        f"on grains a brake trial sinks and leaves at a negative angle ({_where(surface, rig, torque)})",
        "below 0 degrees",
        "never 10 mm away" if angle is None else f"{angle:.1f} degrees",
        met=angle is not None and angle < 0,
        judged="sign of the trajectory angle",
        note=_of_grounds(_varied(table, surface, rig, torque, "grains")),
    )


def _of_grounds(others: Sequence[dict[str, Any]]) -> str:
    """What other grounds do to a brake trial on grains; the first of them has the surface's own stiffness."""
    known = [(case["varied"], _degrees(case["trajectory_angle"])) for case in others]
    told = [(varied, angle) for varied, angle in known if angle is not None]
    note = "on the spring-damper, which gives back what it took, and too stiff a one for the platform to sink in far"
    if not told:
        return note

    own, leaves = told[0]
    note += (
        f"; {own['law']} as stiff as the surface ({own['stiffness']:.4g} N/m a row), rebound {own['rebound']:g}: "
        f"{leaves:+.1f} degrees"
    )
    if len(told) == 1:
        return note
    by_stiffness: dict[str, list[str]] = {}
    for varied, angle in sorted(told, key=lambda pair: (pair[0]["stiffness"] or math.inf, -pair[0]["rebound"])):
        stiff = varied["law"] if varied["stiffness"] is None else f"{varied['stiffness']:.4g} N/m"
        by_stiffness.setdefault(stiff, []).append(f"{angle:+.1f} at {varied['rebound']:g}")
    listed = "; ".join(f"{stiff} {', '.join(angles)}" for stiff, angles in by_stiffness.items())
    below = sum(angle < 0 for _, angle in told)
    return f"{note}; {below} of {len(told)} grounds leave below 0, by stiffness of a row and rebound: {listed}"


def _transitions(settings: PaperSettings, table: dict[Any, Any]) -> dict[str, Any] | None:
    """Ours with their bands over friction, and how far they are from those that were read off Figure 6, if any were."""
    surfaces = [name for name in HARD if name in settings.surfaces]
    if not surfaces:
        return None
    rig, torques = settings.rigs[0], (*settings.motor_torques, *settings.brake_torques)
    measured = measured_angles(settings.measured_angles, surfaces=surfaces, torques=torques)
    told, moved, near = [], [], []
    for place in ((surface, torque, state) for surface in surfaces for torque in torques for state in TRANSITIONS):
        surface, torque, state = place
        low, ours, high = (transition_angle(table[surface, rig, torque, v], state) for v in ("low", "nominal", "high"))
        known = [angle for angle in (low, ours, high) if angle is not None]
        words = f"{surface} {torque:g} N m {state} " + ("none" if ours is None else f"{ours:.1f}")
        if len(known) > 1:
            moved.append(max(known) - min(known))
            words += f" ({min(known):.1f} to {max(known):.1f})"
        if place in measured:
            near.append(ours is not None and abs(ours - measured[place]) <= AGREEMENT)
            words += f", measured {measured[place]:g}"
        told.append(words)
    share = f"{sum(near)} of {len(near)} within {AGREEMENT:g} degrees"
    none = "Figure 6 prints the measured ones as bars without numbers; measured_angles takes what is read off it"
    return _claim(
        f"most transition angles agree with the measured ones within {AGREEMENT:g} degrees ({rig:g} g)",
        f"{AGREEMENT:g} degrees",
        share if near else f"friction moves an angle by up to {max(moved, default=0.0):.1f} degrees",
        met=2 * sum(near) > len(near) if near else None,
        judged="more than half of those that were given" if near else none,
        note="theta in degrees, with friction's band, where the slip that ends in a hop begins and where the first hop "
        "does: " + "; ".join(told),
    )
