"""The energy balance of a run: what body, exchange and ground gained, lost and kept, and what is not accounted for.

docs/coupling.md explains the terms.
"""

from typing import Any

import numpy as np

from rigid.ground.reaction import State

from .bed_ground import BedGround
from .ground import Ground
from .master import Master
from .poses import Vector

__all__ = ["EnergyBalance"]


class EnergyBalance:
    """The rows of a run, samples of the ground's energies beside them, and their balance.

    A run has `time`, `kinetic_energy`, `potential_energy`, `torque_work`, `given` and `taken` among its columns. It
    calls `_start_balance` where time begins, `_record_moment` after every macro step, `_sample` now and then.
    """

    COLUMNS: tuple[str, ...]  # Of a row
    ground: Ground
    master: Master
    body: Any
    _pull: Vector  # Weight as a force on the body [N], shape (3,)
    _free: tuple[int, ...] = (0, 1, 2)  # Along which axes the body can move
    _turns: tuple[int, ...] = (0, 1, 2)  # About which axes it can turn

    def __init__(self) -> None:
        super().__init__()
        self._rows: list[list[float]] = []  # One a macro step
        self._samples: list[list[float]] = []
        self.energy_names: tuple[str, ...] = ()  # What the ground's energies are, in the order of `samples`
        self.work_names: tuple[str, ...] = ()  # Likewise of what a bed's contacts took (`Bed.contact_work`)
        self._momentum, self._angular_momentum = np.zeros(3), np.zeros(3)
        self._moment = np.zeros(3)  # Angular impulse from elsewhere than the ground since the balance began [N m s]

    @property
    def columns(self) -> dict[str, Vector]:
        """The rows so far, by COLUMNS."""
        return dict(zip(self.COLUMNS, self._row_table.T, strict=True))

    @property
    def _row_table(self) -> Vector:
        return np.array(self._rows, dtype=float).reshape(-1, len(self.COLUMNS))

    @property
    def energy_scale(self) -> float:
        """What residuals are relative to [J]."""
        raise NotImplementedError

    @property
    def _turning(self) -> Vector:
        """Angular momentum of the body about (0, 0, 0), less what a torque gave that is not of its wheels [N m s]."""
        raise NotImplementedError

    def _start_balance(self) -> None:
        """Start the energy balance at the present time."""
        self.master.start_balance()
        self._samples.clear()
        self._momentum, self._angular_momentum = self.body.momentum.copy(), self._turning.copy()
        self._moment = np.zeros(3)
        if isinstance(self.ground, BedGround):
            self.ground.bed.track_contact_work()
            self._momentum = self._momentum + self.ground.momentum()
            self._angular_momentum = self._angular_momentum + self.ground.angular_momentum()

    def _record_moment(self, before: Vector) -> None:
        """A macro step from the position `before` [m]: the moments of the weight about (0, 0, 0), and of the rig.

        In a rig the momentum is not along the velocity v, since it is heavier upwards, and v x P is the moment of the
        wires. By the middle of the step, half the ground's lag later as momentum is: of second order in it.
        """
        dt, after = self.master.macro_step, self.body.pose.position
        velocity = (after - before) / dt
        middle = 0.5 * (before + after + self.ground.lag * velocity)
        moment = np.cross(middle, self._pull) + np.cross(velocity, self.body.masses * velocity)
        self._moment = self._moment + dt * moment

    def _sample(self) -> None:
        """What the ground holds, by how much the momenta of all are off, and the grains computed."""
        found = self.ground.energies()
        self.energy_names = tuple(found)
        off, turned, computed, taken = 0.0, 0.0, 0, dict[str, float]()
        if isinstance(self.ground, BedGround):
            computed, taken = self.ground.grain_steps, self.ground.work_taken()
            moving = self.body.momentum - self._pull * self.body.time
            gained = self.ground.momentum() + moving - self._momentum
            off = float(np.linalg.norm(gained[list(self._free)]))
            about = self.ground.angular_momentum() + self._turning - self._moment - self._angular_momentum
            turned = float(np.linalg.norm(about[list(self._turns)]))
        self.work_names = tuple(f"{name}_work" for name in taken)
        self._samples.append([self.body.time, off, turned, computed, *found.values(), *taken.values()])

    @property
    def samples(self) -> dict[str, Vector]:
        """Of the ground, by time: `time` [s], `momentum_error` [N s], `angular_momentum_error` [N m s], `grain_steps`
        of a bed so far, energies [J], work that its contacts took [J]."""
        own = ("time", "momentum_error", "angular_momentum_error", "grain_steps")
        return dict(zip((*own, *self.energy_names, *self.work_names), self._sample_table.T, strict=True))

    @property
    def _sample_table(self) -> Vector:
        count = 4 + len(self.energy_names) + len(self.work_names)
        return np.array(self._samples, dtype=float).reshape(-1, count)

    @property
    def balance(self) -> Vector:
        """Energy of the body gained, less the torque's work, plus what the ground took [J]: 0 but for the coupling."""
        rows = self.columns
        energy = rows["kinetic_energy"] + rows["potential_energy"]
        return energy - energy[0] - rows["torque_work"] + rows["taken"] - rows["taken"][0]

    @property
    def _stored(self) -> Vector:
        """What the ground holds [J], at each time of `samples`."""
        samples = self.samples
        return np.asarray(np.sum([samples[name] for name in self.energy_names], axis=0))

    @property
    def stored_by_row(self) -> Vector:
        """What the ground holds at every row [J], between two samples in proportion."""
        return np.interp(self.columns["time"], self.samples["time"], self._stored)

    @property
    def dissipated_by_row(self) -> Vector:
        """What the ground took less what it holds more than at the start [J], at every row."""
        taken, stored = self.columns["taken"], self.stored_by_row
        return np.asarray(taken - taken[0] - (stored - stored[0]))

    @property
    def dissipated(self) -> Vector:
        """What the ground took less what it holds more than at the start [J], at each time of `samples`."""
        rows, samples, held = self.columns, self.samples, self._stored
        taken = rows["taken"][np.searchsorted(rows["time"], samples["time"])]
        return np.asarray(taken - taken[0] - (held - held[0]))

    @property
    def dissipation_reversal(self) -> float:
        """Largest fall of `dissipated` below what it was before, over `energy_scale` [1]: energy that the ground made.

        What it makes while it dissipates more elsewhere does not show.
        """
        lost = self.dissipated
        return float((np.maximum.accumulate(lost) - lost).max()) / self.energy_scale

    @property
    def losses(self) -> dict[str, Vector]:
        """What a bed lost by measurement [J], at each time of `samples`: to normal dashpots, to friction (with the
        tangential dashpot), to rolling and twisting. Empty on a law."""
        if not self.work_names:
            return {}
        samples = self.samples

        def less_springs(part: str) -> Vector:
            return np.asarray(samples[f"{part}_work"] - (samples[part] - samples[part][0]))

        friction, rolling = less_springs("tangential"), less_springs("turning")
        return {"damping": samples["damping_work"], "friction": friction, "rolling": rolling}

    @property
    def balance_gap(self) -> Vector:
        """What a bed lost by measurement less `dissipated` [J], at each time of `samples`; empty on a law.

        Here nothing cancels: it is the energy that the grains' integrator made (above 0) or lost, and what `energies`
        or the losses have wrong.
        """
        lost = list(self.losses.values())
        return np.asarray(np.sum(lost, axis=0) - self.dissipated) if lost else np.zeros(0)

    @property
    def unaccounted(self) -> float:
        """Largest energy that is not accounted for [J]: above 0 the run created it, below 0 it lost it.

        Of the body and the exchange (`balance`) and, on a bed, with what the grains hold and lost, each measured.
        """
        balance, gap = self.balance, self.balance_gap
        if gap.size:
            at = np.searchsorted(self.columns["time"], self.samples["time"])
            balance = np.concatenate([balance, balance[at] + gap])
        return float(balance[np.abs(balance).argmax()])

    @property
    def energy_residual(self) -> float:
        """Size of `unaccounted` over `energy_scale` [1]."""
        return abs(self.unaccounted) / self.energy_scale

    @property
    def balance_numbers(self) -> dict[str, tuple[float, str]]:
        """Numbers of the balance that a result quotes, each the largest: name -> value and unit.

        The first two are the residuals of body and exchange, and of the exchange alone, over `energy_scale`. The others
        are the energy that the ground made, the errors of the momenta of all, and what a bed lost by the end.
        """
        gap, errors = self.columns["given"] - self.columns["taken"], self.samples
        return {
            "coupling_residual": (float(np.abs(self.balance).max()) / self.energy_scale, "1"),
            "exchange_residual": (float(np.abs(gap - gap[0]).max()) / self.energy_scale, "1"),
            "dissipation_reversal": (self.dissipation_reversal, "1"),
            "momentum_residual": (float(errors["momentum_error"].max()), "N s"),
            "angular_momentum_residual": (float(errors["angular_momentum_error"].max()), "N m s"),
            **{f"dissipated_{name}": (float(lost[-1]), "J") for name, lost in self.losses.items()},
        }

    def _balance_state(self) -> State:
        return {
            "samples": self._sample_table,
            "energies": np.array(self.energy_names, dtype=str),
            "works": np.array(self.work_names, dtype=str),
            "momentum": np.concatenate([self._momentum, self._angular_momentum, self._moment]),
        }

    def _restore_balance(self, own: State) -> None:
        self._samples = np.asarray(own["samples"]).tolist()
        self.energy_names, self.work_names = (tuple(map(str, np.asarray(own[name]))) for name in ("energies", "works"))
        numbers = np.array(own["momentum"], dtype=float)
        self._momentum, self._angular_momentum, self._moment = (part.copy() for part in np.split(numbers, 3))
