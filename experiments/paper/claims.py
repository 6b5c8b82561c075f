"""What the text of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) states, in its own words, beside our numbers.

A claim is a dict: the words (`quote`), what is compared, what is stated, ours, the difference, what it is judged by,
and whether it is met. The last is None where nothing can be compared, or nothing is to be judged. It appears twice: for
the paper's torque, a step, and for one that rises (`risen`). The paper prints no table, so a stated number is a round
one. An angle is judged by the five degrees within which the paper calls model and measurement in agreement.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any

from experiments.runs.types import Json
from rigid.model.trial import Trial

from .grains import KeptAngle
from .settings import PaperSettings
from .transitions import HARD, TRANSITIONS, hop_words, measured_angles, say, transition_angle

__all__ = [
    "AGREEMENT", "GRANULAR", "STATED_ANGLE", "Trials", "claims", "first_lasting", "friction_of_a_rigid_pivot",
    "sliding_angle",
]  # fmt: skip

AGREEMENT = 5.0
"""Degrees within which the paper calls transition angles in agreement."""
ALONG = 0.5
"""Degrees below 0 up to which a platform counts as moving along the surface: no angle is read more finely."""
STATED_ANGLE = 22.5
"""The initial trajectory angle by which the paper knows its low-torque experiments [degrees]."""
LASTING = 0.1
"""A state that is over before this [s] is not the one in which a platform moves, but the torque setting in."""
GRANULAR = ("sand", "jsc1a")
"""The paper's granular simulants."""

Case = Mapping[str, Any]
"""Numbers of one integration, as result.json holds them."""
Place = tuple[str, float, float]
"""Surface, rig [9.80665 m/s2], torque [N m]."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A statement of the paper beside our number."""

    quote: str
    compared: str
    stated: str
    ours: str
    difference: str = ""
    judged_by: str
    met: bool | None  # None where nothing can be compared
    note: str = ""


@dataclass(frozen=True)
class Trials:
    """The integrations that claims look at: of a step of the torque, or of one that rises."""

    settings: PaperSettings
    table: Mapping[tuple[str, float, float, str], Case]
    trials: Mapping[Place, Trial]
    kept: Sequence[KeptAngle]
    rises: str = ""  # Variant in which the torque rises, of motors; "": a step
    brakes: tuple[float, ...] = field(default=(), init=False)

    @classmethod
    def of(cls, settings: PaperSettings, cases: Sequence[Json], jobs: Sequence[Any], kept: Sequence[KeptAngle]) -> Any:
        """From the results of the jobs."""
        table = {(c["surface"], c["rig"], c["torque"], c["variant"]): c for c in cases}
        trials = {(j.surface, j.rig, j.torque): j.trial for j in jobs if j.variant == "nominal"}
        return cls(settings, table, trials, kept)

    @property
    def rig(self) -> float:
        """That of Figures 5 and 6."""
        return self.settings.rigs[0]

    @property
    def torques(self) -> tuple[float, ...]:
        """All, motors first."""
        return (*self.settings.motor_torques, *self.settings.brake_torques)

    @cached_property
    def hard(self) -> list[str]:
        """Those of Figures 5 to 7 that there are."""
        return [name for name in HARD if name in self.settings.surfaces]

    @cached_property
    def places(self) -> list[Place]:
        """Of every experiment."""
        return list(product(self.settings.surfaces, self.settings.rigs, self.torques))

    def is_brake(self, place: Place) -> bool:
        """Whether the experiment is one with a brake."""
        return place[2] in self.settings.brake_torques

    def case(self, place: Place) -> Case:
        """The numbers of an experiment."""
        variant = self.rises if self.rises and not self.is_brake(place) else "nominal"
        return self.table[(*place, variant)]

    def angle(self, place: Place) -> float | None:
        """Its trajectory angle [degrees]; None where it never gets 10 mm away."""
        return _degrees(self.case(place)["trajectory_angle"])

    def band(self, place: Place, of: str) -> list[float]:
        """Of a transition ("slip", "hop") or the "trajectory_angle" with friction varied [degrees], where known."""
        variants = ("nominal",) if self.rises and not self.is_brake(place) else ("low", "nominal", "high")
        cases = [self.case(place) if name == "nominal" else self.table[(*place, name)] for name in variants]
        found = [
            _degrees(case[of]) if of == "trajectory_angle" else transition_angle(case, of) for case in cases
        ]  # fmt: skip
        return [angle for angle in found if angle is not None]

    def varied(self, place: Place, kind: str) -> list[Case]:
        """The cases of an experiment in which something was varied."""
        return [case for (*where, _), case in self.table.items() if tuple(where) == place and case["kind"] == kind]


@dataclass(frozen=True)
class Group:
    """Twelve of the paper's experiments, counted together: those on hard ground, or on grains as springs or grains."""

    name: str
    angles: Mapping[Place, float | None]  # [degrees]
    whole: bool  # Whether all twelve are there

    @property
    def words(self) -> str:
        """What the ground is."""
        return say(f"groups_{self.name}")

    @property
    def brakes_above(self) -> int:
        """How many brakes exceed the angle in the paper: the four on grains are those with negative angles."""
        return 4 if self.name == "hard" else 0

    @property
    def judged(self) -> str:
        """The key of what a count is judged by."""
        return "hard" if self.name == "hard" else "granular"

    @property
    def lacks(self) -> str:
        """That not all are there, in words for the end of a note."""
        return "" if self.whole else f"; {say('not_all')}"


def _groups(trials: Trials) -> list[Group]:
    """Those that the settings have trials for."""
    default = PaperSettings()
    all_turns = all(
        set(getattr(trials.settings, key)) == set(getattr(default, key))
        for key in ("rigs", "motor_torques", "brake_torques")
    )
    kept = {(entry.surface, entry.rig, entry.torque): entry.angle for entry in trials.kept}
    found = []
    for name, surfaces in (("hard", HARD), ("springs", GRANULAR), ("grains", GRANULAR)):
        places = [place for place in trials.places if place[0] in surfaces]
        angles = {place: trials.angle(place) for place in places}
        if name == "grains":
            angles = {place: kept[place] for place in places if place in kept}
        whole = all_turns and set(surfaces) <= set(trials.settings.surfaces) and len(angles) == len(places)
        if places:
            found.append(Group(name, angles, whole))
    return found


def claims(trials: Trials) -> list[Json]:
    """Every statement that the settings have trials for; `risen` of each is it under a torque that rises, if any."""
    told = [asdict(claim) for claim in _claims(trials)]
    risen = [name for (*_, name), case in trials.table.items() if case["kind"] == "risen"]
    if risen:
        other = _claims(replace(trials, rises=risen[0]))
        for entry, claim in zip(told, other, strict=True):
            entry["risen"] = {"ours": claim.ours, "difference": claim.difference, "met": claim.met}
    return told


def _claims(trials: Trials) -> Iterator[Claim]:
    steel, brakes = "steel" in trials.settings.surfaces, trials.settings.brake_torques
    yield _mu_d(trials)
    if steel:
        for torque in brakes:
            yield _about_60(trials, ("steel", trials.rig, torque))
        yield _grows(trials)
    groups = _groups(trials)
    yield from (_most(trials, group) for group in groups)
    yield from (_exceeding(trials, group) for group in groups)
    yield from (_negative(trials, group) for group in groups if group.name != "hard")
    if trials.hard:
        yield from _hops(trials)
        for torque in brakes:
            yield _at_once(trials, torque)
    if steel:
        yield _pivots(trials)
    if trials.hard:
        yield _transitions(trials)


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


def _where(place: Place) -> str:
    surface, rig, torque = place
    return say("where", surface=surface, rig=rig, torque=torque)


def _angle_text(angle: float | None) -> str:
    return "none" if angle is None else f"{angle:.1f}"


def _mu_d(trials: Trials) -> Claim:
    """The rule for sliding friction that the trials take over."""
    ratios = {place[0]: trials.trials[place].sliding_friction / trials.trials[place].mu_s for place in trials.places}
    return Claim(
        quote=say("mu_d_quote"), compared=say("mu_d_compared"), stated="0.5",
        ours=", ".join(f"{name} {ratio:g}" for name, ratio in ratios.items()), met=None, judged_by=say("mu_d_judged"),
    )  # fmt: skip


def _about_60(trials: Trials, place: Place) -> Claim:
    """The largest angle of Figure 5, and what sliding friction has to do with it."""
    stated, trial, ours = 60.0, trials.trials[place], trials.angle(place)
    heavy = (trial.mass + trial.counterweight) * math.tan(math.radians(stated))
    note = say(
        "about_60_note", leaves=math.degrees(sliding_angle(trial)), mu_d=trial.sliding_friction, stated=stated,
        asked=trial.mass / heavy, mu_s=trial.mu_s,
    )  # fmt: skip
    others = [(case["varied"]["ratio"], _degrees(case["trajectory_angle"])) for case in trials.varied(place, "sliding")]
    listed = ", ".join(f"{angle:.1f} at {ratio:g}" for ratio, angle in others if angle is not None)
    note += say("about_60_varied", listed=listed) if listed else ""
    band = trials.band(place, "trajectory_angle")
    if len(band) > 1:
        note = say("band", low=min(band), high=max(band)) + "; " + note
    return Claim(
        quote=say("about_60_quote"), compared=say("about_60_compared", where=_where(place)),
        stated=f"{stated:g} degrees",
        ours=say("never_away") if ours is None else f"{ours:.1f} degrees",
        met=ours is not None and abs(ours - stated) <= AGREEMENT, judged_by=say("within", degrees=AGREEMENT),
        difference="" if ours is None else f"{ours - stated:+.1f} degrees", note=note,
    )  # fmt: skip


def _grows(trials: Trials) -> Claim:
    torques = sorted(trials.torques)
    angles = [trials.angle(("steel", trials.rig, torque)) for torque in torques]
    known = [angle for angle in angles if angle is not None]
    listed = ", ".join(f"{torque:g}" for torque in torques)
    return Claim(
        quote=say("grows_quote"), compared=say("grows_compared", torques=listed, rig=trials.rig), stated="rising",
        ours=", ".join(map(_angle_text, angles)) + " degrees",
        met=len(known) == len(angles) and known == sorted(known), judged_by=say("grows_judged"),
    )  # fmt: skip


def _most(trials: Trials, group: Group) -> Claim:
    """How many low-torque experiments start as the paper says that most do."""
    low = {place: angle for place, angle in group.angles.items() if not trials.is_brake(place)}
    near = [angle for angle in low.values() if angle is not None and abs(angle - STATED_ANGLE) <= AGREEMENT]
    listed = "; ".join(f"{_where(place)}: {_angle_text(angle)}" for place, angle in low.items())
    compared = say("most_compared", degrees=AGREEMENT, count=len(low), group=group.words)
    return Claim(
        quote=say("most_quote"), compared=compared, stated="most", ours=f"{len(near)} of {len(low)}",
        judged_by=say("most_judged"), met=2 * len(near) > len(low) if group.whole else None,
        note=say("most_note", listed=listed) + group.lacks,
    )  # fmt: skip


def _exceeding(trials: Trials, group: Group) -> Claim:
    """How many experiments exceed the angle, and what drove them."""
    above = [p for p, angle in group.angles.items() if angle is not None and angle > STATED_ANGLE + AGREEMENT]
    brakes = sum(trials.is_brake(place) for place in above)
    motors, wanted = len(above) - brakes, group.brakes_above
    return Claim(
        quote=say("five_quote"), compared=say("five_compared", degrees=AGREEMENT, group=group.words),
        stated=say("five_counted", brakes=wanted, motors="at most 1"),
        ours=say("five_counted", brakes=brakes, motors=motors),
        met=brakes == wanted and motors <= 1 if group.whole else None, judged_by=say(f"five_{group.judged}"),
        note="; ".join(f"{_where(place)}: {group.angles[place]:.1f}" for place in above) + group.lacks,
    )  # fmt: skip


def _negative(trials: Trials, group: Group) -> Claim:
    """Which experiments on granular ground leave downwards."""
    below = [place for place, angle in group.angles.items() if angle is not None and angle < -ALONG]
    brakes = sum(trials.is_brake(place) for place in below)
    note = say("negative_listed", listed="; ".join(f"{_where(p)}: {group.angles[p]:+.1f}" for p in below) or "none")
    wanted = [place for place in group.angles if trials.is_brake(place)]
    note += _of_grounds(trials, wanted) if group.name == "springs" else say("negative_sand")
    return Claim(
        quote=say("negative_quote"), compared=say("negative_compared", group=group.words),
        stated=say("five_counted", brakes=4, motors=0), judged_by=say("negative_judged", along=ALONG),
        ours=say("five_counted", brakes=brakes, motors=len(below) - brakes),
        met=set(below) == set(wanted) if group.whole else None, note=note + group.lacks,
    )  # fmt: skip


def _of_grounds(trials: Trials, places: Sequence[Place]) -> str:
    """What other grounds do to the brakes on grains; the first of each has the surface's own stiffness."""
    told, note = [], ""
    for place in places:
        known = [(case["varied"], _degrees(case["trajectory_angle"])) for case in trials.varied(place, "grains")]
        here = [(varied, angle) for varied, angle in known if angle is not None]
        if here:
            note += say("negative_as_stiff", own=here[0][0], angle=here[0][1], where=_where(place))
        told += here
    if len(told) <= len(places):
        return note
    return note + say("negative_grounds", below=sum(angle < -ALONG for _, angle in told), count=len(told))


def _hops(trials: Trials) -> Iterator[Claim]:
    """Hops in the cases of Figure 6; their lengths are listed, since the text gives none."""
    places = list(product(trials.hard, [trials.rig], trials.torques))
    cases = [trials.case(place) for place in places]
    count, surfaces = sum(case["transition_angle_hop"] is not None for case in cases), " and ".join(trials.hard)
    ours, note = f"{count} of {len(cases)}", say("hops_note", listed="; ".join(map(hop_words, cases)))
    yield Claim(
        quote=say("hops_quote"), compared=say("hops_compared", count=len(cases), surfaces=surfaces, rig=trials.rig),
        stated=say("hops_stated"), ours=ours, met=count == len(cases), judged_by=say("hops_judged"), note=note,
    )  # fmt: skip
    yield Claim(
        quote=say("filmed_quote"), compared=say("filmed_compared"), stated="5 of 6", ours=ours,
        met=count == 5 if len(cases) == 6 else None, judged_by=say("filmed_judged"), difference=f"{count - 5:+d}",
        note=say("filmed_note"),
    )  # fmt: skip


def _at_once(trials: Trials, torque: float) -> Claim:
    first = {}
    for surface in trials.hard:
        transitions = trials.case((surface, trials.rig, torque))["transitions"]
        first[surface] = next((_degrees(theta) for _, state, theta in transitions if state == "slip"), None)
    late = [name for name, theta in first.items() if theta is None]
    worst = max((theta for theta in first.values() if theta is not None), default=math.inf)
    return Claim(
        quote=say("at_once_quote"),
        compared=say("at_once_compared", surfaces=" and ".join(trials.hard), rig=trials.rig),
        stated=say("at_once_stated"), met=not late and worst <= AGREEMENT,
        ours=say("at_once_never", late=", ".join(late)) if late else f"{worst:.1f} degrees",
        judged_by=say("at_once_judged", degrees=AGREEMENT),
    )  # fmt: skip


def _pivots(trials: Trials) -> Claim:
    place = ("steel", trials.rig, min(trials.settings.motor_torques))
    lasting, trial = first_lasting(trials.case(place)), trials.trials[place]
    others = trials.varied(place, "sliding")
    listed = ", ".join(f"{first_lasting(case)} at {case['varied']['ratio']:g}" for case in others)
    note = say("pivots_note", asked=friction_of_a_rigid_pivot(trial), trial=trial)
    note += say("pivots_varied", listed=listed) if listed else ""
    return Claim(
        quote=say("pivots_quote"), compared=say("pivots_compared", time=LASTING, rig=place[1], torque=place[2]),
        stated="pivot", ours=lasting, met=lasting == "pivot", judged_by=say("pivots_judged"), note=note,
    )  # fmt: skip


def first_lasting(case: Case) -> str:
    """The first state in which the platform moves for `LASTING` or longer; stand if there is none."""
    spells = pairwise([*case["transitions"], (math.inf, "", 0.0)])
    lasting = (state for (begin, state, _), (end, *_) in spells if state != "stand" and end - begin >= LASTING)
    return str(next(lasting, "stand"))


def _transitions(trials: Trials) -> Claim:
    """Ours with their bands over friction, and how far they are from those that were read off Figure 6, if any were."""
    rig, surfaces = trials.rig, trials.hard
    measured = measured_angles(trials.settings.measured_angles, surfaces=surfaces, torques=trials.torques)
    told, moved, near = [], [], []
    for surface, torque, state in product(surfaces, trials.torques, TRANSITIONS):
        ours, known = (
            transition_angle(trials.case((surface, rig, torque)), state),
            trials.band((surface, rig, torque), state),
        )
        words = f"{surface} {torque:g} N m {state} {_angle_text(ours)}"
        if len(known) > 1:
            moved.append(max(known) - min(known))
            words += f" ({min(known):.1f} to {max(known):.1f})"
        stated = measured.get((surface, torque, state))
        if stated is not None:
            near.append(ours is not None and abs(ours - stated) <= AGREEMENT)
            words += f", measured {stated:g}"
        told.append(words)
    share = say("transitions_near", near=sum(near), count=len(near), degrees=AGREEMENT)
    return Claim(
        quote=say("transitions_quote"),
        compared=say("transitions_compared", surfaces=" and ".join(surfaces), rig=rig), stated=f"{AGREEMENT:g} degrees",
        ours=share if near else say("transitions_moved", most=max(moved, default=0.0)),
        met=2 * sum(near) > len(near) if near else None,
        judged_by=say("transitions_judged") if near else say("transitions_figure_6"),
        note=say("transitions_note", listed="; ".join(told)),
    )  # fmt: skip
