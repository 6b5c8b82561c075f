"""A robot on any ground, followed with its energy balance: `RobotRun`, a stepper as `coupling.SpatialRun` is one."""

from typing import Any, Unpack

import numpy as np

from coupling.balance import EnergyBalance
from coupling.ground import part_of, prefixed
from coupling.master import Master
from coupling.poses import Vector
from coupling.stepper import Reporting, Stepper
from rigid.checks import check_above_zero
from rigid.ground.reaction import Reaction, State

from .bed_feet import BedFeet
from .body import MujocoRobot
from .fixed import Buried, FixedGeoms
from .law_feet import LawFeet
from .stability import ITERATED, ExchangeLoad, check_exchange

__all__ = ["RobotRun"]

COLUMNS = (
    "time", "x", "y", "z", "kinetic_energy", "potential_energy", "torque_work", "actuator_work", "given", "taken",
    "fx", "fy", "fz", "touching", "sinkage",
)  # fmt: skip
"""Of a row: centre of mass [m], energies [J] (potential: gravity and springs), work of the robot's other parts and of
its actuators alone [J]; work on the ground by robot and ground [J]; force of the ground on all feet [N]; number of
touching feet; the deepest depth [m]."""
BELOW = 1e-3  # What is no foot may start as deep as that [m]
FOOT = 14
"""Numbers of a foot in a row: position, quaternion, force [N], torque [N m], depth of its lowest point [m]."""


class RobotRun(EnergyBalance, Stepper):
    """`robot` on `ground`, followed for `duration` [s].

    Parameters
    ----------
    robot : where it starts, its velocity that of its data.
    ground : a `LawFeet` or a `BedFeet` made of the robot's feet.
    energy_interval : between measurements of what the ground holds [s].
    checked : whether a start in the ground, and an exchange that would be unstable (`check_exchange`), are refused.
    options : those of `Master`: substeps, iterations, extrapolation, tolerance.

    Raises ValueError for a robot that another run has. It also raises it, naming the foot or geom, for a start in the
    ground and for an unstable exchange. On the way `load` may go above `most_load`: that is for the caller to say.
    """

    COLUMNS = COLUMNS
    placed, placement_is_long, placing_steps = True, False, 0  # As of other runs: a robot is not set down

    def __init__(
        self,
        robot: MujocoRobot,
        ground: LawFeet | BedFeet,
        *,
        duration: float,
        energy_interval: float = 0.02,
        checked: bool = True,
        **options: Any,
    ) -> None:
        super().__init__()
        check_above_zero("in s", duration=duration, energy_interval=energy_interval)
        if robot.step:
            raise ValueError(
                f"robot: another run has it, and has come to {robot.time:g} s: make a new MujocoRobot for this one"
            )
        self.body, self.ground, self.duration = robot, ground, float(duration)
        robot.start()
        if checked:
            ground.place(robot.pose)
            _refuse_below(robot)
        self.master = Master(robot, ground, **options)
        self.macro_step = self.master.macro_step
        self._pull = np.array([0.0, 0.0, -robot.mass * robot.gravity])
        self._free, self._turns = ((0, 1, 2), (0, 1, 2)) if robot.floats else ((), ())
        iterations = self.master.iterations
        self.load = 0.0  # Largest when sampled, over what the explicit exchange bears [1]
        self.most_load = 1.0 if iterations == 1 else ITERATED  # Up to which the exchange is stable, or settles [1]
        if checked:
            check_exchange(robot, ground, substeps=int(options.get("substeps", 10)), iterations=iterations)
        self._load = ExchangeLoad(robot, ground)
        self._every = max(1, round(energy_interval / self.macro_step))
        self.energy_interval = self._every * self.macro_step
        self.lowest_other = (np.inf, "")  # Lowest height of what is no foot, when sampled [m], and its geom
        self._fixed = FixedGeoms(robot.model, robot.feet, robot.other_geoms)
        self.buried = Buried(0.0)  # The deepest geom that is fixed to a foot and is none, when sampled
        self._feet: list[Vector] = []
        self._joints: list[Vector] = []
        robot.begin(self.macro_step, ground.lag)
        self._start_balance()
        self._keep(None)
        self._sample()

    def __repr__(self) -> str:
        return f"RobotRun({self.body!r} on {self.ground!r}, {self.time:.4g} of {self.duration:g} s)"

    @property
    def robot(self) -> MujocoRobot:
        """The robot."""
        return self.body  # type: ignore[no-any-return]

    @property
    def time(self) -> float:
        """Now [s]."""
        return float(self.body.time)

    @property
    def done(self) -> bool:
        """Whether it has come to its end."""
        return bool(self.body.time >= self.duration - 0.5 * self.macro_step)

    @property
    def fraction(self) -> float:
        """How far it is along, 0 to 1."""
        return float(min(1.0, self.body.time / self.duration))

    @property
    def _elapsed(self) -> float:
        return float(self.body.time)

    def run(self, **reporting: Unpack[Reporting]) -> dict[str, Vector]:
        """Go on to the end, with the reports of `Stepper.follow`; `columns`."""
        self.follow(**reporting)
        return self.columns

    def advance(self) -> None:
        """One macro step; nothing once it is done."""
        if self.done:
            return
        before = self.body.centre
        reaction = self.master.step()
        x, y, _ = 0.5 * (before + self.body.centre)
        self._moment = self._moment + self.macro_step * self._pull[2] * np.array([y, -x, 0.0])
        self._keep(reaction)
        if self.master.count % self._every == 0 or self.done:
            self._sample()

    def _keep(self, reaction: Reaction | None) -> None:
        robot, data = self.body, self.body.data
        lag, count = self.ground.lag, len(robot.feet)
        wrench = self.master.wrench if reaction is not None else None
        forces = wrench.force.reshape(-1, 3) if wrench is not None else np.zeros((count, 3))
        torques = wrench.torque.reshape(-1, 3) if wrench is not None else np.zeros((count, 3))
        depths, touched = np.zeros(count), set[int]()
        if reaction is not None:
            owners = range(count) if self.ground.gives_friction else robot.owners
            for member, depth in reaction.sinkage.items():
                depths[owners[member]] = max(depths[owners[member]], depth)
            touched = {int(owners[contact.member]) for contact in reaction.contacts}
        self._rows.append([
            robot.time, *robot.centre, robot.kinetic_energy(lag), robot.potential_energy, robot.torque_work,
            robot.actuator_work, *self.master.exchanged(), *forces.sum(axis=0), len(touched), float(depths.max()),
        ])  # fmt: skip
        pose = robot.pose
        parts = (pose.position.reshape(-1, 3), pose.turn.reshape(-1, 4), forces, torques, depths[:, None])
        self._feet.append(np.hstack(parts).ravel())
        self._joints.append(np.concatenate([data.qpos, robot.rates, data.ctrl, data.actuator_force]))

    def _sample(self) -> None:
        super()._sample()
        self.lowest_other = min(self.lowest_other, self.robot.lowest_other())
        self.buried = max(self.buried, self._fixed.deepest(self.robot.data))
        self.load = max(self.load, self._load.now().at(self.macro_step))

    @property
    def feet_now(self) -> Vector:
        """The last row of `feet`, shape (foot, FOOT); `foot` has it by names."""
        return self._feet[-1].reshape(-1, FOOT)

    def foot(self, name: str) -> dict[str, Vector | float]:
        """The last row of one foot: ``position`` [m], ``turn`` (quaternion), ``force`` of the ground on it [N],
        ``torque`` [N m], ``depth`` of its lowest point [m]. Raises ValueError for a foot that there is not."""
        names = [foot.name for foot in self.body.feet]
        if name not in names:
            raise ValueError(f"foot {name!r}: the robot has {', '.join(names)}")
        row = self.feet_now[names.index(name)]
        parts = {"position": row[:3], "turn": row[3:7], "force": row[7:10], "torque": row[10:13]}
        return {**parts, "depth": float(row[13])}

    @property
    def _turning(self) -> Vector:
        return self.robot.angular_momentum

    @property
    def feet(self) -> Vector:
        """Every foot at every row, shape (row, foot, FOOT): position [m], quaternion, force [N], torque, depth [m]."""
        return np.array(self._feet).reshape(len(self._feet), len(self.body.feet), FOOT)

    @property
    def joints(self) -> dict[str, Vector]:
        """`qpos`, `qvel`, `ctrl` and `actuator_force` of MuJoCo at every row, shape (row, n) each."""
        model = self.body.model
        widths = {"qpos": model.nq, "qvel": model.nv, "ctrl": model.nu, "actuator_force": model.nu}
        parts = np.split(np.array(self._joints), np.cumsum(list(widths.values()))[:-1], axis=1)
        return dict(zip(widths, parts, strict=True))

    @property
    def energy_scale(self) -> float:
        """max(|work in the robot|, kinetic energy at the start, largest change of the potential energy) [J]."""
        rows = self.columns
        changed = float(np.ptp(rows["potential_energy"]))
        work = float(np.abs(rows["actuator_work"]).max())
        return max(work, changed, float(rows["kinetic_energy"].max()), 1e-300)

    def state(self) -> State:
        """All that the rest of the run depends on: a flat dict of numpy arrays."""
        own: State = {
            "frames": np.array(self._frames), "rows": self._row_table, "feet": np.array(self._feet),
            "joints": np.array(self._joints), "lowest": np.array([str(part) for part in self.lowest_other]),
            "load": np.array(self.load), "buried": np.array([str(self.buried.depth), self.buried.name]),
        }  # fmt: skip
        return prefixed("run", own) | prefixed("balance", self._balance_state()) | self.master.state()

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        own = part_of(state, "run")
        self._frames = int(own["frames"])
        self._rows = np.asarray(own["rows"]).tolist()
        self._feet, self._joints = (list(np.array(own[name], dtype=float)) for name in ("feet", "joints"))
        lowest, name = (str(part) for part in np.asarray(own["lowest"]))
        self.lowest_other = (float(lowest), name)
        if "buried" in own:  # not in that of an earlier version
            depth, name = (str(part) for part in np.asarray(own["buried"]))
            self.buried = Buried(float(depth), name)
        self.load = float(own.get("load", self.load))  # an earlier version has it of the start alone
        self._restore_balance(part_of(state, "balance"))
        self.master.restore(state)


def _refuse_below(robot: MujocoRobot) -> None:
    """Raise ValueError, naming the geom, where what is no foot starts below the surface."""
    height, name = robot.lowest_other()
    if height < -BELOW:
        raise ValueError(
            f"{name!r}, which is no foot, starts {-height:.3g} m below the surface, where no ground would hold it: "
            f"name it under feet, or raise the robot (height)"
        )
