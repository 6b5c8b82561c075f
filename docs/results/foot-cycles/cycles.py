"""A foot unloaded and loaded again in its own crater, in beds of grains: what a cycle loses, what a fall returns.

    python docs/results/foot-cycles/cycles.py OUT.jsonl cycles,falls flat,ball SEED,SEED... [YOUNG]

YOUNG: modulus of the grains [Pa]. A line for each run; `fit.py` beside this file reads them.

- cycles: the tip goes down at 0.1 m/s to 4 mm, then three times up to 20 % of the force and down to the same force.
- falls: the tip with a mass on it lands, comes to rest, is lifted by 1.5 mm and released downwards, several times.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from coupling import BedGround
from dem import SAND, Bed
from rigid.platform.spike import Spike

SIZE, GRAIN, WIDTH = (0.045, 0.045, 0.03), 0.003, 0.015  # [m]
YOUNG, EARTH = 13866606.818084942, 9.81
DEPTH, APPROACH, LEAST, COUNT = 0.004, 0.1, 0.2, 3
SPEEDS = (0.1, 0.3, 0.02)  # of cycles and of falls, at 1 g [m/s]
MASS, LIFT, SMOOTH = 0.12, 0.0015, 2e-4  # [kg], [m], and the time over which a force is averaged at 1 g [s]


class Pushed:
    """A tip in a ground: its depth [m], the force [N] and a row for each step."""

    def __init__(self, ground: Any, step: float, smooth: float) -> None:
        self.ground, self.step, self.share = ground, step, min(1.0, step / smooth)
        self.depth, self.force, self.time = -ground.clearance, 0.0, 0.0
        self.rows: list[tuple[float, float, float, float]] = []

    def move(self, speed: float) -> float:
        """One step at this speed downwards; the mean force over it."""
        on = self.ground
        at = (on.centre[0], on.centre[1], on.surface - self.depth)
        force = float(on.step(at, (0.0, 0.0, -speed), self.step).force[2])
        self.rows.append((self.time, self.depth + 0.5 * speed * self.step, speed, force))
        self.depth, self.time = self.depth + speed * self.step, self.time + self.step
        self.force += self.share * (force - self.force)
        return force

    def cut(self) -> np.ndarray:
        """The rows since the last cut: time, depth, speed, force, shape [row, 4]."""
        rows, self.rows = np.array(self.rows), []
        return rows


def work(rows: np.ndarray, step: float) -> float:
    """Work of the tip on the ground [J]."""
    return float((rows[:, 2] * rows[:, 3]).sum() * step)


def cycles(tip: Pushed, speed: float) -> dict[str, Any]:
    """Load, then unload and reload three times at `speed`: works [J], depths [m] and forces [N] of each half."""
    while tip.depth < DEPTH:
        tip.move(APPROACH)
    load, halves = tip.cut(), []
    peak = float(load[load[:, 1] > 0.95 * DEPTH, 3].mean())
    tip.force = peak
    for _ in range(COUNT):
        high = tip.depth
        while tip.force > LEAST * peak and tip.depth > 0.5 * DEPTH:
            tip.move(-speed)
        up, low = tip.cut(), tip.depth
        while tip.force < peak and tip.depth < 1.5 * DEPTH:
            tip.move(speed)
        down = tip.cut()
        same = down[down[:, 1] < high]
        halves.append({
            "high": high, "low": low, "end": tip.depth, "returned": -work(up, tip.step),
            "taken_to_high": work(same, tip.step), "taken": work(down, tip.step),
        })  # fmt: skip
    return {"speed": speed, "force": peak, "load_work": work(load, tip.step), "cycles": halves}


def falls(tip: Pushed, gravity: float) -> list[dict[str, Any]]:
    """Land at 0.3 m/s, then fall into the crater at each speed in turn: depths [m] and speeds of every bounce [m/s]."""
    found = []
    for number, speed in enumerate((0.3, *SPEEDS)):
        if number:
            top = tip.depth - LIFT
            while tip.depth > top:
                tip.move(-APPROACH)
            tip.cut()
        before, v, rested, begun = tip.depth, speed, 0.0, tip.time
        while tip.time - begun < 0.25 and rested < 0.01:
            v += tip.step * (gravity - tip.move(v) / MASS)
            rested = rested + tip.step if abs(v) < 0.002 and tip.force > 0.5 * MASS * gravity else 0.0
        rows = tip.cut()
        touch = int(np.argmax(rows[:, 3] > 0.5 * MASS * gravity))
        after = rows[touch:]
        ends = np.flatnonzero(np.diff(np.sign(after[:, 2]))) + 1
        pieces = [piece for piece in np.split(after, ends) if len(piece)]
        found.append({
            "speed": speed, "arriving": float(rows[touch, 2]), "from": before, "touch": float(rows[touch, 1]),
            "deepest": float(rows[:, 1].max()), "end": tip.depth, "largest": float(rows[:, 3].max()),
            "speeds": [round(float(p[np.argmax(np.abs(p[:, 2])), 2]), 5) for p in pieces[:9]],
            "turns": [round(float(p[-1, 1]), 7) for p in pieces[:9]],
            "works": [work(p, tip.step) for p in pieces[:9]],
            "free": float((after[:, 3] <= 0).sum() * tip.step), "time": len(rows) * tip.step,
        })  # fmt: skip
    return found


def made(seed: int, young: float, gravity: float) -> Any:
    """The bed, from the cache where it is there."""
    bed = Bed.prepare(
        SAND, size=SIZE, grain=GRAIN, spread=0.15, gravity=gravity, seed=seed, young=young, max_overlap=0.05, threads=1
    )
    bed.overlap_limit = 0.12
    return bed


def main(out: Path, kinds: list[str], tips: list[Any], seeds: list[int], young: float = YOUNG) -> None:
    """Add the lines of these beds to a file."""
    for seed in seeds:
        for shape in tips:
            spike = Spike(tip="sphere" if shape == "ball" else "flat", diameter=WIDTH, length=0.06)
            bed = made(seed, young, EARTH)
            ground = BedGround(bed, spike)
            start = ground.state()
            for kind in kinds:
                for speed in SPEEDS if kind == "cycles" else SPEEDS[:1]:
                    ground.restore(start)
                    tip = Pushed(ground, 2 * ground.time_step, SMOOTH)
                    line: dict[str, Any] = {"kind": kind, "tip": shape, "seed": seed, "young": young, "gravity": EARTH}
                    line |= {"grains": bed.grain_count, "packing": bed.packing_fraction, "step": ground.time_step}
                    line |= cycles(tip, speed) if kind == "cycles" else {"falls": falls(tip, EARTH)}
                    line["steps"], line["processor"] = 2 * round(tip.time / tip.step), round(time.process_time(), 1)
                    with out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main(
        Path(sys.argv[1]), sys.argv[2].split(","), sys.argv[3].split(","), [int(s) for s in sys.argv[4].split(",")],
        *map(float, sys.argv[5:]),
    )  # fmt: skip
