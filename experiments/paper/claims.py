"""What the text of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) states, beside our numbers.

A claim is a dict: what is stated, its value, ours with its band over friction, the difference, what it is judged by,
and whether it is met (None where nothing can be compared). The paper prints no table, so that a stated number is a
round one; an angle is judged by the five degrees within which the paper calls model and measurement in agreement.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

from experiments.runs.types import Json
from rigid.model.trial import Trial

from .settings import PaperSettings
from .transitions import HARD, TRANSITIONS, hop_words, is_brief, measured_angles, say, transition_angle

__all__ = ["AGREEMENT", "claims", "first_lasting", "friction_of_a_rigid_pivot", "sliding_angle"]

AGREEMENT = 5.0
"""Degrees within which the paper calls transition angles in agreement."""
LASTING = 0.1
"""A state that is over before this [s] is not the one in which a platform moves, but the torque setting in."""

Case = Mapping[str, Any]
"""Numbers of one integration, as result.json holds them."""
Cases = Mapping[tuple[str, float, float, str], Case]
"""By surface, rig [9.80665 m/s2], torque [N m] and variant."""
Trials = Mapping[tuple[str, float, float], Trial]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement of the paper beside our number."""

    statement: str
    stated: str
    ours: str
    difference: str = ""
    judged_by: str
    met: bool | None  # None where nothing can be compared
    note: str = ""


def claims(settings: PaperSettings, cases: Sequence[Json], jobs: Sequence[Any]) -> list[Json]:
    """Every statement that the settings have trials for."""
    table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in cases}
    trials = {(j.surface, j.rig, j.torque): j.trial for j in jobs if j.variant == "nominal"}
    low, rigs, brakes = min(settings.motor_torques), settings.rigs, settings.brake_torques
    found: list[Claim | None] = []
    if "brick" in settings.surfaces:
        for rig in rigs:
            statement = say("starts", where=say("where", surface="brick", rig=rig, torque=low))
            chord = say("chord") if table["brick", rig, low, "nominal"]["trajectory_angle"] is not None else ""
            found.append(_angle(table, statement, "brick", rig, low, 22.5, chord))
    for surface in (name for name in HARD if name in settings.surfaces):
        found += [_grows(settings, table, surface, rig) for rig in rigs]
        found += [_grows_to(table, trials, surface, rigs[0], torque) for torque in brakes]
    for torque in brakes:
        found += [_slips_at_once(settings, table, rig, torque) for rig in rigs]
    found.append(_hops(settings, table))
    if "steel" in settings.surfaces:
        found.append(_pivots_first(table, trials, rigs[0], low))
    for surface in (name for name in ("sand", "jsc1a") if name in settings.surfaces):
        found += [_negative(table, surface, rig, torque) for torque in brakes for rig in rigs]
    found.append(_transitions(settings, table))
    return [asdict(claim) for claim in found if claim is not None]


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


def _degrees(value: float | None) -> float | None:
    return None if value is None else math.degrees(value)


def _angle(table: Cases, statement: str, surface: str, rig: float, torque: float, stated: float, more: str) -> Claim:
    """Our trajectory angle beside the stated one [degrees], with its band over friction; `more` goes to the note."""
    low, ours, high = (
        _degrees(table[surface, rig, torque, variant]["trajectory_angle"]) for variant in ("low", "nominal", "high")
    )
    judged, printed = say("within", degrees=AGREEMENT), f"{stated:g} degrees"
    if ours is None:
        never = say("never_away")
        return Claim(statement=statement, stated=printed, ours=never, met=False, judged_by=judged, note=more)
    band = [angle for angle in (low, ours, high) if angle is not None]
    side = "in" if min(band) <= stated <= max(band) else "out"
    note = say("band", low=min(band), high=max(band), side=side)
    return Claim(
        statement=statement, stated=printed, ours=f"{ours:.1f} degrees", met=abs(ours - stated) <= AGREEMENT,
        judged_by=judged, difference=f"{ours - stated:+.1f} degrees", note=note + more,
    )  # fmt: skip


def _varied(table: Cases, surface: str, rig: float, torque: float, kind: str) -> list[Case]:
    """The cases of one gravity, torque and surface in which something was varied."""
    here = [surface, rig, torque]
    return [case for (*where, _), case in table.items() if where == here and case["kind"] == kind]


def _grows_to(table: Cases, trials: Trials, surface: str, rig: float, torque: float) -> Claim:
    """The angle under a brake, and what sliding friction has to do with it."""
    stated, trial = 60.0, trials[surface, rig, torque]
    heavy = (trial.mass + trial.counterweight) * math.tan(math.radians(stated))
    note = say(
        "of_sliding", leaves=math.degrees(sliding_angle(trial)), mu_d=trial.sliding_friction, stated=stated,
        asked=trial.mass / heavy, mu_s=trial.mu_s,
    )  # fmt: skip
    others = _varied(table, surface, rig, torque, "sliding")
    known = [(case["varied"]["ratio"], _degrees(case["trajectory_angle"])) for case in others]
    listed = ", ".join(f"{angle:.1f} at {ratio:g}" for ratio, angle in known if angle is not None)
    note += say("sliding_varied", listed=listed) if listed else ""
    statement = say("grows_to", where=say("where", surface=surface, rig=rig, torque=torque))
    return _angle(table, statement, surface, rig, torque, stated, note)


def _grows(settings: PaperSettings, table: Cases, surface: str, rig: float) -> Claim:
    torques = sorted((*settings.motor_torques, *settings.brake_torques))
    angles = [_degrees(table[surface, rig, torque, "nominal"]["trajectory_angle"]) for torque in torques]
    known = [angle for angle in angles if angle is not None]
    return Claim(
        statement=say("grows", surface=surface, rig=rig), stated="rising",
        ours=", ".join("none" if angle is None else f"{angle:.1f}" for angle in angles) + " degrees",
        met=len(known) == len(angles) and known == sorted(known), judged_by=say("each_above"),
    )  # fmt: skip


def _slips_at_once(settings: PaperSettings, table: Cases, rig: float, torque: float) -> Claim:
    first = {}
    for surface in settings.surfaces:
        transitions = table[surface, rig, torque, "nominal"]["transitions"]
        first[surface] = next((_degrees(theta) for _, state, theta in transitions if state == "slip"), None)
    late = [name for name, theta in first.items() if theta is None or theta > AGREEMENT]
    worst = max((theta for theta in first.values() if theta is not None), default=math.inf)
    ours = say("at_most", worst=worst) + (say("never_on", late=", ".join(late)) if math.isinf(worst) else "")
    return Claim(
        statement=say("slips_at_once", torque=torque, rig=rig), stated="0 degrees", ours=ours, met=not late,
        judged_by=say("first_slip", degrees=AGREEMENT), difference=f"{worst:+.1f} degrees",
    )  # fmt: skip


def _hops(settings: PaperSettings, table: Cases) -> Claim | None:
    """Hops of the motor trials, which end tumbles; a brake throws the platform, and its hop is none that is brief."""
    surfaces = [name for name in HARD if name in settings.surfaces]
    if not surfaces:
        return None
    rig = settings.rigs[0]
    torques = (*settings.motor_torques, *settings.brake_torques)
    cases = [table[name, rig, torque, "nominal"] for name in surfaces for torque in torques]
    motor = [case for case in cases if case["actuator"] == "motor"]
    brief = sum(is_brief(case) for case in motor)
    hop, listed = sum(case["transition_angle_hop"] is not None for case in cases), map(hop_words, cases)
    return Claim(
        statement=say("hops", rig=rig, surfaces=" and ".join(surfaces)), stated="5 of 6 cases",
        ours=say("brief_hops", brief=brief, count=len(motor)), met=brief / len(motor) >= 5 / 6 - 1e-9,
        judged_by=say("share_of_hops"),
        note=say("all_hops", hop=hop, count=len(cases), brief=brief, listed="; ".join(listed)),
    )  # fmt: skip


def _pivots_first(table: Cases, trials: Trials, rig: float, torque: float) -> Claim:
    lasting = first_lasting(table["steel", rig, torque, "nominal"])
    rises = [case for (*_, variant), case in table.items() if variant.startswith("torque rise")]
    trial = trials["steel", rig, torque]
    others = _varied(table, "steel", rig, torque, "sliding")
    listed = ", ".join(f"{first_lasting(case)} at {case['varied']['ratio']:g}" for case in others)
    note = say("rigid_pivot", asked=friction_of_a_rigid_pivot(trial), trial=trial)
    note += say("first_varied", listed=listed) if listed else ""
    note += "".join(say("risen", variant=case["variant"], state=first_lasting(case)) for case in rises)
    return Claim(
        statement=say("pivots", rig=rig, torque=torque), stated="pivot", ours=lasting, met=lasting == "pivot",
        judged_by=say("lasting", time=LASTING), note=note,
    )  # fmt: skip


def first_lasting(case: Case) -> str:
    """The first state in which the platform moves for `LASTING` or longer; stand if there is none."""
    spells = pairwise([*case["transitions"], (math.inf, "", 0.0)])
    lasting = (state for (begin, state, _), (end, *_) in spells if state != "stand" and end - begin >= LASTING)
    return str(next(lasting, "stand"))


def _negative(table: Cases, surface: str, rig: float, torque: float) -> Claim:
    angle = _degrees(table[surface, rig, torque, "nominal"]["trajectory_angle"])
    return Claim(
        statement=say("negative", where=say("where", surface=surface, rig=rig, torque=torque)),
        stated="below 0 degrees", ours=say("never_away") if angle is None else f"{angle:.1f} degrees",
        met=angle is not None and angle < 0, judged_by="sign of the trajectory angle",
        note=_of_grounds(_varied(table, surface, rig, torque, "grains")),
    )  # fmt: skip


def _of_grounds(others: Sequence[Case]) -> str:
    """What other grounds do to a brake trial on grains; the first of them has the surface's own stiffness."""
    known = [(case["varied"], _degrees(case["trajectory_angle"])) for case in others]
    told = [(varied, angle) for varied, angle in known if angle is not None]
    note = say("on_springs")
    if not told:
        return note
    note += say("as_stiff", own=told[0][0], angle=told[0][1])
    if len(told) == 1:
        return note
    by_stiffness: dict[str, list[str]] = {}
    for varied, angle in sorted(told, key=lambda pair: (pair[0]["stiffness"] or math.inf, -pair[0]["rebound"])):
        stiff = varied["law"] if varied["stiffness"] is None else f"{varied['stiffness']:.4g} N/m"
        by_stiffness.setdefault(stiff, []).append(f"{angle:+.1f} at {varied['rebound']:g}")
    listed = "; ".join(f"{stiff} {', '.join(angles)}" for stiff, angles in by_stiffness.items())
    return note + say("grounds", below=sum(angle < 0 for _, angle in told), count=len(told), listed=listed)


def _transitions(settings: PaperSettings, table: Cases) -> Claim | None:
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
    share = say("near", near=sum(near), count=len(near), degrees=AGREEMENT)
    return Claim(
        statement=say("transitions", degrees=AGREEMENT, rig=rig), stated=f"{AGREEMENT:g} degrees",
        ours=share if near else say("moved", most=max(moved, default=0.0)),
        met=2 * sum(near) > len(near) if near else None,
        judged_by="more than half of those that were given" if near else say("figure_6"),
        note=say("all_transitions", listed="; ".join(told)),
    )  # fmt: skip
