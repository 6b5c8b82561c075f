"""A stand-in for dem.Bed in tests above it: the same interface, a force law known in closed form.

Going in beyond where the tip has been, F = hardness z^power + rate v; behind it, an elastic line of slope `unload` down
to zero. The deepest point is its memory.
"""

import numpy as np

from dem.engine.values import Grains

__all__ = ["FakeBed", "lay_closed_form"]


class FakeBed:
    """See the module. `size` [m], `surface` [m], `grain` diameter [m]."""

    material, recipe = None, {}

    def __init__(self, *, size=(0.06, 0.06, 0.05), surface=0.045, grain=0.002, time_step=2e-5, seed=1,
                 hardness=100.0, power=1.0, rate=0.0, unload=5000.0, gravity=9.80665, proud=0.0):  # fmt: skip
        self.size, self.surface, self.grain, self.time_step, self.seed = size, surface, grain, time_step, seed
        self.hardness, self.power, self.rate, self.unload, self.gravity = hardness, power, rate, unload, gravity
        self.proud = proud  # how far above the surface the bed is felt [m]
        self.time, self.max_overlap = 0.0, 0.0
        self.grain_count, self.packing_fraction, self.coordination_number = 200, 0.6, 5.0
        self.awake_count = self.grain_count
        self.kinetic_energy, self.floor_force = 0.0, 1.0
        self.young, self.poisson, self.precision, self.arch = 1e7, 0.25, "float64", "cpu"
        rng = np.random.default_rng(seed)
        self._grains = rng.uniform((0, 0, 0), (*size[:2], surface - grain), (200, 3))
        self._pose, self._rate, self._deepest, self._force = np.zeros(3), np.zeros(3), 0.0, 0.0
        self.bodies = self.grain_steps = 0

    def add_body(self, shapes, *, position, friction=0.5, restitution=0.5):
        self._pose, self.bodies = np.array(position, dtype=float), self.bodies + 1
        return 0

    def move_body(self, body, *, position=None, velocity=None):
        if position is not None:
            self._pose = np.array(position, dtype=float)
        if velocity is not None:
            self._rate = np.array(velocity, dtype=float)

    def move_bodies(self, bodies, *, positions, velocities, turns, spins):
        for body, position, velocity in zip(bodies, positions, velocities, strict=True):
            self.move_body(body, position=position, velocity=velocity)

    def law(self, depth, sinking):
        """Force [N] at `depth` [m], `sinking` [m/s], after all that was before."""
        depth += self.proud
        if depth <= 0:
            return 0.0
        if depth >= self._deepest:
            return self.hardness * depth**self.power + self.rate * max(sinking, 0.0)
        return max(0.0, self.hardness * self._deepest**self.power - self.unload * (self._deepest - depth))

    def advance(self, steps, *, drag_time=np.inf):
        total = 0.0
        for _ in range(steps):
            depth = self.surface - self._pose[2] - 0.5 * self._rate[2] * self.time_step
            total += self.law(depth, -self._rate[2])
            self._deepest = max(self._deepest, depth + self.proud)
            self._pose = self._pose + self._rate * self.time_step
            self.time += self.time_step
        self._force = total / steps

    def mark_origin(self):
        pass

    def reaction(self, body):
        return np.array([0.0, 0.0, self._force]), np.zeros(3)

    def reactions(self):
        return np.concatenate(self.reaction(0))[None]

    def body_position(self, body):
        return self._pose

    def grains(self):
        count = len(self._grains)
        return Grains(
            id=np.arange(count), position=self._grains.copy(), radius=np.full(count, 0.5 * self.grain),
            mass=np.full(count, 1e-5), velocity=np.zeros((count, 3)), spin=np.zeros((count, 3)),
            force=np.zeros((count, 3)), displacement=np.zeros((count, 3)), coordination=np.full(count, 5),
        )  # fmt: skip

    def state(self):
        return {"pose": self._pose.copy(), "rate": self._rate.copy(),
                "memory": np.array([self._deepest, self._force, self.time])}  # fmt: skip

    def restore(self, state):
        self._pose, self._rate = np.array(state["pose"]), np.array(state["rate"])
        self._deepest, self._force, self.time = (float(value) for value in state["memory"])


def lay_closed_form(monkeypatch, beds, material):
    """Have `experiments.penetrate.beds` lay beds of this material with K = 100 + 10 seed N/m and C = 0.5 N s/m."""

    def prepare(settings, seed, young, progress):
        return FakeBed(size=settings.bed_size, seed=seed, hardness=100.0 + 10.0 * seed, rate=0.5, unload=4000.0)

    monkeypatch.setattr(beds, "prepare_bed", prepare)
    monkeypatch.setattr(beds, "find_material", lambda name: material)
    monkeypatch.setattr(beds, "bed_step", lambda settings, young: 2e-5)
