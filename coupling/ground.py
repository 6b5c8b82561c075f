"""The contract between a body and whatever pushes on it.

A body does not know what it stands on. It states its pose and how it moves, and the ground answers with the mean
reaction over the step: the contact of each of the body's members. A platform has many members, a single spike is the
case of one. A ground may have a memory (a bed of grains does), so it can be saved and restored, to the bit.
"""

from typing import Any, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from rigid.ground.reaction import Contact, Facts, Reaction, State, Turned

__all__ = ["Contact", "Described", "Ground", "Reaction", "State", "part_of", "prefixed"]

_BEFORE = {"balance": "books", "ground": "footing"}  # Names in checkpoints of earlier versions


@runtime_checkable
class Ground(Protocol):
    """Whatever can push on a body."""

    @property
    def name(self) -> str:
        """What a report calls it."""

    @property
    def time_step(self) -> float:
        """The step it is to be driven at [s]; where it is the ground's own, dt of `step` is a whole multiple."""

    @property
    def surface(self) -> float:
        """Height of the undisturbed surface [m]: depth is counted down from here."""

    @property
    def centre(self) -> tuple[float, float]:
        """Where a body is put by default, (x, y) [m]."""

    @property
    def clearance(self) -> float:
        """How far above `surface` a spike that it was made for touches nothing yet [m]; grains stick out of a bed."""

    @property
    def depth_limit(self) -> float:
        """How deep a spike that it was made for may go [m]; infinite where there is no floor."""

    @property
    def gives_friction(self) -> bool:
        """Whether its contacts state the horizontal force; otherwise a Coulomb bound, which the body resolves."""

    @property
    def lag(self) -> float:
        """By how much its forces stand for a time later than the mean of the step's [s], twice over.

        0 where the mean is exact. A bed's impulse over a step is that of the forces at the *ends* of its own steps dt.
        So it belongs to a time dt / 2 later: its lag is dt.
        """

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """Advance by `dt` [s] under a body at `position` [m] (at the start) that moves at constant `velocity` [m/s].

        Both have shape (3,), world axes, z up. `turn` is the body's at the start, a unit quaternion, scalar first, and
        `spin` its constant angular velocity [rad/s]; None: not turned, and not turning. Returns the mean over the step:
        force * dt is the exact impulse.
        """

    def energies(self) -> dict[str, float]:
        """What it stores now [J]: name -> energy."""

    def checkpoint(self) -> Any:
        """What `rollback` brings back, of a step that may be repeated: only the last checkpoint is kept."""

    def rollback(self, kept: Any) -> None:
        """Go back to the last `checkpoint`."""

    def state(self) -> State:
        """Everything that the next steps depend on: a flat dict of numpy arrays."""

    def restore(self, state: State) -> None:
        """Go back to what `state` gave; the steps that follow repeat to the bit."""


@runtime_checkable
class Described(Protocol):
    """A ground that describes itself in run.toml."""

    def describe(self) -> Facts:
        """What it is, in plain numbers."""


def prefixed(name: str, state: State) -> State:
    """A part of a whole state: its keys after ``name.``."""
    return {f"{name}.{key}": value for key, value in state.items()}


def part_of(state: State, name: str) -> State:
    """What `prefixed` was given, out of a whole state; of an earlier version, too."""
    prefixes = tuple(f"{each}." for each in (name, _BEFORE.get(name, name)))
    return {key.partition(".")[2]: value for key, value in state.items() if key.startswith(prefixes)}
