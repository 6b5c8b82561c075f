"""The master: steps a body and its ground together, and records the work that passes between them.

Over one macro step H the body's twist is held and the ground answers with its mean wrench. The twist is that of the
step's middle, under a wrench extrapolated from the steps before. With `iterations` above 1 the step is repeated from
the ground's checkpoint until the wrench that comes out is the one that went in: the implicit midpoint rule, stable at
any K H^2 / m, K the contacts' stiffness; the explicit step is stable up to K H^2 / m = 4. What goes in is found by
interface quasi-Newton with an inverse Jacobian from least squares (Degroote et al. 2009, Comput. Struct. 87:793).

Either side may take several steps within H: the ground `substeps`, the body `body_steps`. The wrench is exchanged once
all the same: the body goes through its steps with the guess, then again along the same twists with what was answered.

The ground's work is its wrench times the held twist. The body's work is this wrench times the mean of its rates before
and after. Their difference is the error of the exchange, of second order in H (Sadjina et al. 2016, Eng. Comput.
33:607: the residual of a power bond). docs/coupling.md has the equations and the energy balance.
"""

from collections import deque
from dataclasses import astuple, dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np

from hedgebed_renamed import renamed, renamed_keywords
from rigid.ground.reaction import Contact, Reaction, State

from .ground import Ground, part_of, prefixed
from .poses import Pose, Twist, Vector, Wrench

__all__ = ["Body", "Exchange", "Master"]

_WEIGHTS = ((1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))  # Of the last wrenches, the newest first, by order of extrapolation
_MOST_PAIRS = 6  # Repeats of a step that the next one is computed from: as many as a wrench has components


@runtime_checkable
class Body(Protocol):
    """Whatever a ground can push: `coupling.PlanarBody`, `coupling.SpatialBody`."""

    @property
    def pose(self) -> Pose:
        """Where it is."""

    @property
    def twist(self) -> Twist:
        """How it moves, half a lag after the time of its pose."""

    def twist_now(self, lag: float) -> Twist:
        """How it moves at the time of its pose."""

    def predict(self, dt: float, guess: Wrench, lag: float) -> Twist:
        """The twist to hold over the next `dt` [s], under the guess at the ground's wrench."""

    def resolve(self, dt: float, twist: Twist, reaction: Reaction) -> Wrench:
        """The whole wrench of the ground: `reaction` with the friction that its Coulomb bounds leave open."""

    def advance(self, dt: float, twist: Twist, wrench: Wrench) -> None:
        """Take the step: along `twist`, with the impulse of `wrench`."""

    def state(self) -> State:
        """All that its next steps depend on: a flat dict of numpy arrays."""

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""


@dataclass(slots=True)
class Exchange:
    """What passed between body and ground since the energy balance began [J]."""

    given: float = 0.0  # Work on the ground as the body sees it: by the mean of its rates before and after a step
    taken: float = 0.0  # The same as the ground sees it: by the twist that was held
    worst_guess: float = 0.0  # Largest |force guessed - force found| [N]
    largest_force: float = 0.0  # Largest force of one step [N]
    repeats: int = 0  # Steps of the ground beyond one a macro step
    unsettled: int = 0  # Macro steps that were repeated as often as allowed and did not settle


@dataclass(slots=True)
class _Piece:
    """One of the body's steps in a macro step."""

    held: Twist
    reaction: Reaction
    wrench: Wrench = field(default_factory=Wrench.none)
    before: Twist = field(default_factory=lambda: Twist(np.zeros(3), np.zeros(3)))  # Of the body, before the step and
    after: Twist = field(default_factory=lambda: Twist(np.zeros(3), np.zeros(3)))


class Master:
    """`body` and `ground`, in macro steps of `substeps` of the ground's own steps.

    Parameters
    ----------
    substeps : of the ground in a macro step [1].
    body_steps : of the body in a macro step [1]; `substeps` is a whole multiple of it.
    extrapolation : order of the guess at the next wrench, 0 to 2.
    iterations : how often a macro step is computed at most; 1: explicit.
    tolerance : change of the force between two iterations that ends them, over the largest force so far [1].
    first_guess : the wrench before the first step; none if not given.

    Raises ValueError, naming the key, for what cannot be.
    """

    @renamed_keywords(footing="ground")
    def __init__(
        self,
        body: Body,
        ground: Ground,
        *,
        substeps: int = 10,
        body_steps: int = 1,
        extrapolation: int = 0,
        iterations: int = 1,
        tolerance: float = 1e-9,
        first_guess: Wrench | None = None,
    ) -> None:
        for key, value in {"substeps": substeps, "body_steps": body_steps, "iterations": iterations}.items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"{key} is {value!r}: it must be a whole number of 1 or more")
        if substeps % body_steps:
            raise ValueError(
                f"body_steps is {body_steps}: it must divide substeps = {substeps}, to hold whole steps of the ground"
            )
        if extrapolation not in (0, 1, 2):
            raise ValueError(f"extrapolation is {extrapolation!r}: it must be 0, 1 or 2")
        if not tolerance > 0:
            raise ValueError(f"tolerance is {tolerance!r}: it must be above 0")
        self.body, self.ground = body, ground
        self.macro_step = substeps * ground.time_step
        self.body_steps = body_steps
        self.extrapolation, self.iterations, self.tolerance = extrapolation, iterations, tolerance
        self.count = 0  # Macro steps done
        self._wrenches: deque[Wrench] = deque([first_guess] if first_guess is not None else [], maxlen=3)
        self._held: Twist | None = None
        self._changes: list[tuple[Vector, Vector]] = []  # Of the wrench in and out, when a step was last repeated
        self.exchange = Exchange()
        self.last: Reaction | None = None  # The ground's answer in the last step
        self.wrench = Wrench.none()  # The whole wrench of the body's last step, friction included

    books, footing = renamed("books", "exchange"), renamed("footing", "ground")

    def __repr__(self) -> str:
        return f"Master({self.body!r} on {self.ground!r}, macro step {self.macro_step:.3g} s, {self.count} done)"

    def start_balance(self) -> None:
        """Start the energy balance at the present time: `exchange` is set to 0."""
        self.exchange = Exchange()
        self._held = None

    def guess(self) -> Wrench:
        """The wrench expected in the step to come."""
        if not self._wrenches:
            return Wrench.none(self.body.pose.position.size)
        weights = _WEIGHTS[min(self.extrapolation, len(self._wrenches) - 1)]
        rows = (w * _row(past) for w, past in zip(weights, self._wrenches, strict=False))
        return _unpack(np.asarray(sum(rows)))

    def step(self) -> Reaction:
        """One macro step; the ground's answer, its mean over the step."""
        ground, passed = self.ground, self.exchange
        expected = self.guess()
        before = self.body.state() if self.iterations > 1 or self.body_steps > 1 else {}
        kept = ground.checkpoint() if self.iterations > 1 else None
        trial = expected
        tried: list[tuple[Vector, Vector]] = []
        for turn in range(self.iterations):
            if turn:
                ground.rollback(kept)
                self.body.restore(before)
                passed.repeats += 1
            pieces = self._answered(trial, before)
            self._take(pieces, trial)
            wrench = _mean_wrench([piece.wrench for piece in pieces])
            passed.largest_force = max(passed.largest_force, float(np.linalg.norm(wrench.force)))
            if _apart(wrench, trial) <= self.tolerance * passed.largest_force:
                break
            if self.iterations > 1:
                tried.append((_row(trial), _row(wrench)))
                trial = _unpack(_unchanged(tried[-1], _differences(tried) or self._changes))
        else:
            passed.unsettled += self.iterations > 1
        if len(tried) > 1:
            self._changes = _differences(tried)
        for piece in pieces:
            self._record(piece)
        passed.worst_guess = max(passed.worst_guess, _apart(wrench, expected))
        self._wrenches.appendleft(wrench)
        self.last = _joined([piece.reaction for piece in pieces])
        self.count += 1
        return self.last

    def _answered(self, guess: Wrench, before: State) -> list[_Piece]:
        """The body's steps under the guess, and the ground's answers to them; the body is back where it was."""
        body, ground, dt = self.body, self.ground, self.macro_step / self.body_steps
        pieces: list[_Piece] = []
        for _ in range(self.body_steps):
            if pieces:
                body.resolve(dt, pieces[-1].held, pieces[-1].reaction)
                body.advance(dt, pieces[-1].held, guess)
            held = body.predict(dt, guess, ground.lag)
            pieces.append(_Piece(held, ground.step(body.pose.position, held.velocity, dt, body.pose.turn, held.spin)))
        if len(pieces) > 1:
            body.restore(before)
        return pieces

    def _take(self, pieces: list[_Piece], guess: Wrench) -> None:
        """The body goes along the twists held, with what was answered to each."""
        body, dt = self.body, self.macro_step / self.body_steps
        for piece in pieces:
            if len(pieces) > 1:
                body.predict(dt, guess, self.ground.lag)  # for the torque of this step alone
            piece.wrench = body.resolve(dt, piece.held, piece.reaction)
            piece.before = body.twist
            body.advance(dt, piece.held, piece.wrench)
            piece.after = body.twist

    def _record(self, piece: _Piece) -> None:
        dt, lag, wrench = self.macro_step / self.body_steps, self.ground.lag, piece.wrench
        self.exchange.given -= dt * wrench.power(_mean(piece.before, piece.after))
        self.exchange.taken -= dt * wrench.power(piece.held)
        if lag and self._held is not None:
            # The last force of the step before was met by grains half with its twist, half with the one now held.
            change = Twist(piece.held.velocity - self._held.velocity, piece.held.spin - self._held.spin)
            self.exchange.taken -= 0.5 * lag * self.wrench.power(change)
        self._held, self.wrench = piece.held, wrench

    def exchanged(self) -> tuple[float, float]:
        """Work on the ground up to the time of the pose [J], as the body sees it and as the ground sees it.

        A bed's last force acts half before that time and half after it; `exchange` has all of it.
        """
        lag, passed = self.ground.lag, self.exchange
        if not lag or self._held is None:
            return passed.given, passed.taken
        return (
            passed.given + 0.5 * lag * self.wrench.power(_mean(self.body.twist, self.body.twist_now(lag))),
            passed.taken + 0.5 * lag * self.wrench.power(self._held),
        )

    def state(self) -> State:
        """All that the next steps depend on, body and ground included: a flat dict of numpy arrays."""
        past = [_row(wrench) for wrench in self._wrenches]
        held, width = self._held, len(_row(self.wrench))
        own: State = {
            "count": np.array(self.count),
            "wrenches": np.array(past).reshape(-1, width),
            "wrench": _row(self.wrench),
            "held": np.concatenate([held.velocity, held.spin]) if held is not None else np.zeros(0),
            "exchange": np.array(astuple(self.exchange), dtype=float),
            "learnt": np.array(self._changes, dtype=float).reshape(-1, 2, width),
        }
        return prefixed("master", own) | prefixed("body", self.body.state()) | prefixed("ground", self.ground.state())

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        own = part_of(state, "master")
        self.count = int(own["count"])
        self._wrenches.clear()
        self._wrenches.extend(_unpack(row) for row in np.asarray(own["wrenches"], dtype=float))
        self.wrench = _unpack(np.asarray(own["wrench"], dtype=float))
        held = np.asarray(own["held"], dtype=float)
        half = held.size // 2
        self._held = Twist(held[:half].copy(), held[half:].copy()) if half else None
        learnt = np.asarray(own.get("learnt", ()), dtype=float).reshape(-1, 2, np.size(own["wrench"]))
        self._changes = [(into.copy(), out.copy()) for into, out in learnt]
        exchange = own["exchange"] if "exchange" in own else own["books"]  # as an earlier version has it
        given, taken, worst, largest, *counts = (float(number) for number in exchange)
        self.exchange = Exchange(given, taken, worst, largest, *(int(count) for count in counts))
        self.body.restore(part_of(state, "body"))
        self.ground.restore(part_of(state, "ground"))


def _differences(tried: list[tuple[Vector, Vector]]) -> list[tuple[Vector, Vector]]:
    """Of the pairs (in, out) before the last, as many as say something, to it."""
    into, out = tried[-1]
    return [(before[0] - into, before[1] - out) for before in tried[-1 - _MOST_PAIRS : -1]]


def _unchanged(last: tuple[Vector, Vector], known: list[tuple[Vector, Vector]]) -> Vector:
    """The wrench that would come out as it went in, by the last pair (in, out) and differences of pairs [N, N m]."""
    into, out = last
    if not known:
        return out
    # Torques over the arm that they have, so that they weigh as forces do.
    wrenches, half = np.abs([out, *(change for _, change in known)]), len(out) // 2
    force, torque = wrenches[:, :half].max(), wrenches[:, half:].max()
    scale = np.repeat([1.0, force / torque if force > 0 and torque > 0 else 1.0], half)
    change = np.array([scale * (of_out - of_in) for of_in, of_out in known]).T
    share = np.linalg.lstsq(change, scale * (into - out), rcond=1e-10)[0]
    return np.asarray(out + sum(c * of_out for c, (_, of_out) in zip(share, known, strict=True)))


def _row(wrench: Wrench) -> Vector:
    return np.concatenate([wrench.force, wrench.torque])


def _unpack(row: np.ndarray) -> Wrench:
    half = len(row) // 2  # of several bodies in one, forces come first
    return Wrench(row[:half].copy(), row[half:].copy())


def _mean_wrench(wrenches: list[Wrench]) -> Wrench:
    if len(wrenches) == 1:
        return wrenches[0]
    return _unpack(np.mean([_row(wrench) for wrench in wrenches], axis=0))


def _joined(reactions: list[Reaction]) -> Reaction:
    """The answers to the body's steps as one: mean forces, each row where it touched last, sinkage at the end."""
    if len(reactions) == 1:
        return reactions[0]
    share = 1 / len(reactions)
    contacts: dict[int, Contact] = {}
    for reaction in reactions:
        for row, contact in reaction.by_member.items():
            kept = contacts.get(row)
            along = None if contact.tangential_force is None else share * contact.tangential_force
            if kept is not None and along is not None and kept.tangential_force is not None:
                along = along + kept.tangential_force
            load = share * contact.normal_force + (kept.normal_force if kept is not None else 0.0)
            contacts[row] = replace(contact, normal_force=load, tangential_force=along)
    mean = _mean_wrench([Wrench.of(reaction) for reaction in reactions])
    return Reaction(mean.force, mean.torque, tuple(contacts.values()), reactions[-1].sinkage)


def _mean(one: Twist, other: Twist) -> Twist:
    return Twist(0.5 * (one.velocity + other.velocity), 0.5 * (one.spin + other.spin))


def _apart(one: Wrench, other: Wrench) -> float:
    return float(np.linalg.norm(one.force - other.force))
