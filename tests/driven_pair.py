"""Grains moved as a test says, through the bed's own lists and force kernels: their springs, forces and work."""

import numpy as np

from dem import Ball, Bed, Material, Plane
from dem.engine.energy import bed_energies

RADIUS, YOUNG, POISSON, DENSITY = 0.0025, 1e8, 0.25, 2600.0
STEP = 1.0  # [s]: slow, for what rolling and twisting have of dashpots to be nothing
STILL = np.zeros((2, 3))


class DrivenPair:
    """Two grains without damping, in touch from the start. Each step is prescribed."""

    def __init__(self, overlap, *, tangential, friction=1e6, rolling=0.0, axis=(1.0, 0.0, 0.0), second=RADIUS):
        n = np.array(axis) / np.linalg.norm(axis)
        self.radii = np.array([RADIUS, second])
        self.x = 0.025 + np.outer([1.0, 0.0], (self.radii.sum() - overlap) * n)
        material = Material("driven", DENSITY, YOUNG, POISSON, friction, 1.0, rolling, tangential=tangential)
        self.bed = Bed.from_grains(
            material, positions=self.x, radii=self.radii, size=(0.05, 0.05, 0.05), height=0.08, gravity=0.0,
            floor=False, max_overlap=0.2, threads=1,
        )  # fmt: skip
        self.work, self.force, self.torque = 0.0, STILL, STILL
        self.step(STILL, STILL)

    @property
    def normal(self):
        """From the second grain to the first."""
        d = self.x[0] - self.x[1]
        return d / np.linalg.norm(d)

    def springs(self):
        """Stretch [m] and turn [rad] of the springs, as the first grain has them."""
        state = self.bed.state()
        sign = 1.0 if state["id"][np.repeat([0, 1], state["pair_count"])[0]] == 0 else -1.0
        return sign * state["slide"][0, :3], sign * state["roll"][0] if "roll" in state else STILL[0]

    def energies(self):
        """In the springs: normal, tangential, turning [J]."""
        found = bed_energies(self.bed, bodies={})
        return np.array([found[name] for name in ("normal", "tangential", "turning")])

    def step(self, v, w):
        """Move at velocities [m/s] and turn at spins [rad/s], shape [2, 3], for a step."""
        self.x = self.x + STEP * v
        put(self.bed, position=self.x, velocity=v, spin=w, force=STILL, torque=STILL)
        self.bed.compute_forces(STEP)
        row = np.argsort(self.bed.engine.read("id"))
        before, turning = self.force, self.torque
        self.force, self.torque = (self.bed.engine.read(name)[row] for name in ("force", "torque"))
        self.work -= 0.5 * STEP * float(((before + self.force) * v).sum() + ((turning + self.torque) * w).sum())

    def slip(self, way, steps=20):
        """Move the first grain about the second by ``way`` [m], shape [3], across the normal, without turning it."""
        length = np.linalg.norm(self.x[0] - self.x[1])
        for _ in range(steps):
            there = self.x[0] - self.x[1] + way / steps
            there *= length / np.linalg.norm(there)
            self.step(np.array([there - (self.x[0] - self.x[1]), STILL[0]]) / STEP, STILL)

    def close(self, way, steps=20):
        """Bring the first grain nearer by ``way`` [m], or away."""
        for _ in range(steps):
            self.step(np.array([-way / steps / STEP * self.normal, STILL[0]]), STILL)

    def turn(self, angle, steps=20):
        """Turn the first grain on the second by ``angle`` [rad], shape [3], half each, so that they do not slip."""
        for _ in range(steps):
            self.step(STILL, np.outer([0.5, -0.5], angle) / steps / STEP)


def put(bed, *, body=None, **fields):
    """Write first columns of grains' fields, by id, or of a body's."""
    row = np.argsort(bed.engine.read("id")) if body is None else [body]
    for name, values in fields.items():
        field = bed.engine.read(name)
        values = np.atleast_2d(values)
        field[row, : values.shape[1]] = values
        bed.engine.write(name, field)


class GrainOnBody:
    """A grain in touch with a plane or a ball, the springs of friction and turning stretched; both are moved."""

    def __init__(self, shape, *, tangential):
        material = Material("driven", DENSITY, YOUNG, POISSON, 1e6, 1.0, 1e6, tangential=tangential)
        self.x = np.full(3, 0.025)
        self.bed = Bed.from_grains(
            material, positions=[self.x], radii=[RADIUS], size=(0.05, 0.05, 0.05), height=0.08, gravity=0.0,
            floor=False, max_overlap=0.2, threads=1,
        )  # fmt: skip
        made = {"plane": Plane(), "ball": Ball((0.0, 0.0, -0.004), 0.004)}[shape]
        self.at = self.x - [0.0, 0.0, RADIUS + 1e-5]
        self.body = self.bed.add_body([made], position=tuple(self.at), rolling_friction=1e6)
        self.step(STILL[0], STILL[0], up=9e-5)
        self.step(np.array([5e-7, 2e-7, 0.0]), np.array([5e-5, -3e-5, 8e-5]))

    def springs(self):
        """Stretch [m] and turn [rad]."""
        state = self.bed.state()
        row = list(state["near_body"]).index(self.body)
        return state["near_slide"][row, :3], state["near_roll"][row]

    def step(self, v, w, *, up=0.0):
        """Move and turn the grain for a step, and the body by ``up`` [m]."""
        self.x = self.x + STEP * v
        self.at = self.at + [0.0, 0.0, up]
        self.set(v, w, np.array([0.0, 0.0, up / STEP]), STILL[0], np.array([1.0, 0.0, 0.0, 0.0]))

    def set(self, v, w, body_v, body_w, turn):
        """Both where they are, with the rates that brought them there."""
        put(self.bed, position=self.x, velocity=v, spin=w, force=STILL[0], torque=STILL[0])
        put(self.bed, body=self.body, body_position=self.at, body_velocity=body_v, body_spin=body_w, body_turn=turn)
        self.bed.compute_forces(STEP)
