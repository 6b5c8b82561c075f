"""The search for grains on which motors leave upwards and brakes downwards, as the paper's Figure 8 has them.

`HEDGEBED_THREADS=1 python docs/results/paper-signs/search.py [LEVER ...] [--seeds 1 2]` from the root of a checkout
does what runs.jsonl beside it lacks: a motor of 0.22 N m and a brake of 6 N m at 0.0085 g for every lever and seed,
grains all awake, each run until the centre is 10 mm away. See README.md beside it.
"""

import argparse
import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from coupling import CoupledTumble
from dem import SAND, Bed, material
from dem.prepare.prepare import prepare_as
from experiments.grains.on_bed import STANDARD_GRAVITY
from experiments.grains.recipes import recipe_of
from experiments.tumble.on_grains import PlanarOnBed
from experiments.tumble.settings import TumbleSettings

RUNS = Path(__file__).with_name("runs.jsonl")
FAR = 0.0105  # The centre is followed until it is so far from its start [m]
POWDER = material("jsc-1a-loose-heights")
CALIBRATED = 0.356  # Rolling friction at which sheared samples have sand's friction angle (docs/materials.md)


def sand(rolling: float, friction: float = 0.5) -> dict[str, Any]:
    """Grains of sand with other frictions."""
    return {
        "material": replace(SAND, name=f"sand-{rolling:g}-{friction:g}", rolling_friction=rolling, friction=friction)
    }


def powder(share: float) -> dict[str, Any]:
    """Grains of JSC-1A with a share of their surface energy, poured dry."""
    stuff = replace(POWDER, name=f"jsc1a-{share:g}", surface_energy=share * POWDER.surface_energy)
    return {"material": stuff, "stages": ("rain:dry", "stick", "level")}


RISES = {"motor": ("torque-rise.rise=0.25",), "brake": ()}  # A brake's torque lasts 0.06 s
SURFACE = {"start": "surface", "actuators": ("brake",)}  # The brake let go before the platform has settled
JSC = material("jsc-1a-loose-cut")
JSC1A: dict[str, Any] = {  # Right cohesion and density, on the bed of jsc-packed-0.22 in ../tumble-sand
    "material": JSC, "stages": recipe_of(JSC).stages, "grain": 0.004, "size": (0.38, 0.036, 0.056), "young": 3e7,
}  # fmt: skip
MIDDLE = sand(0.1) | {"spike": 0.016, "grain": 0.0052}
WIDE = sand(0.1) | {"spike": 0.024, "grain": 0.0075, "depth": 0.06}  # In the region that ../paper-region finds
LEVERS: dict[str, dict[str, Any]] = {
    "weak sand": sand(0.1),
    "calibrated sand": sand(CALIBRATED),
    "rough sand": sand(1.2),
    "torque rise 0.25 s": sand(CALIBRATED) | {"effects": RISES, "actuators": ("motor",)},
    "tip 20 mm": sand(CALIBRATED) | {"spike": 0.02, "grain": 0.0064},
    "tip 30 mm": sand(CALIBRATED) | {"spike": 0.03, "grain": 0.0075, "depth": 0.06},
    "from the surface": sand(CALIBRATED) | SURFACE,
    "set down under twice the weight": sand(CALIBRATED) | {"start": 2.0},
    "dense": sand(CALIBRATED) | {"stages": ("rain:0.05", "stick", "level")},
    "powder, 1/8 of its adhesion": powder(0.125),
    "powder, 1/4": powder(0.25),
    "powder, 1/2": powder(0.5),
    "powder": powder(1.0),
    "powder, 1/4, torque rise 0.25 s": powder(0.25) | {"effects": RISES, "actuators": ("motor",)},
    "rough sand, torque rise 0.25 s": sand(1.2) | {"effects": RISES, "actuators": ("motor",)},
    "rough sand, from the surface": sand(1.2) | SURFACE,
    "rough sand, motor from the surface": sand(1.2) | SURFACE | {"actuators": ("motor",)},
    "powder, 1/4, from the surface": powder(0.25) | SURFACE,
    "powder, from the surface": powder(1.0) | SURFACE,
    "jsc1a": JSC1A,
    "jsc1a, torque rise 0.25 s": JSC1A | {"effects": RISES, "actuators": ("motor",)},
    "jsc1a, from the surface": JSC1A | SURFACE,
    "jsc1a, motor from the surface": JSC1A | SURFACE | {"actuators": ("motor",)},
    "weak sand, tip 24 mm": WIDE,
    "weak sand, tip 24 mm, from the surface": WIDE | SURFACE,
    "weak sand, tip 24 mm, torque rise 0.25 s": WIDE | {"effects": RISES, "actuators": ("motor",)},
    "weak sand, tip 16 mm": MIDDLE,
    "weak sand, tip 16 mm, from the surface": MIDDLE | SURFACE,
    "weak sand, tip 16 mm, torque rise 0.25 s": MIDDLE | {"effects": RISES, "actuators": ("motor",)},
}


class OnBed(PlanarOnBed):
    """`tumble --ground bed` with grains and stages of one's own."""

    def __init__(self, lever: dict[str, Any], actuator: str, seed: int) -> None:
        spike, grain = lever.get("spike", 0.012), lever.get("grain", 0.0048)
        turn: dict[str, Any] = {"torque": 0.22, "duration": 1.2, "actuator": "motor"}
        if actuator == "brake":
            turn = {"torque": 6.0, "duration": 1.0, "actuator": "brake", "wheel_speed_0": 300.0}
        super().__init__(
            TumbleSettings(
                surface="sand", ground="bed", rig=0.0085, grain=grain, spike_diameter=spike, seed=seed,
                young=lever.get("young", 1e7), max_overlap=0.1, threads=1, frame_count=0,
                bed_size=lever.get("size", (0.3, round(3 * spike, 6), lever.get("depth", 0.046))),
                effects=lever.get("effects", {}).get(actuator, ()), **turn,
            )
        )  # fmt: skip
        self.lever, self.__dict__["material"] = lever, lever["material"]

    def made(self, kept: Path | None) -> Bed:
        """The bed, rained in and levelled, or by the lever's stages; or `kept`, a bed file."""
        if kept is not None:
            return self.laid_out(Bed.load(kept, threads=1))
        s, stuff, stages = self.settings, self.material, self.lever.get("stages")
        options: dict[str, Any] = {
            "size": s.bed_size, "grain": s.grain, "spread": s.spread, "gravity": STANDARD_GRAVITY, "seed": s.seed,
            "young": s.young, "max_overlap": s.max_overlap, "threads": 1, "cache": True,
        }  # fmt: skip
        if stages is None:
            return self.laid_out(Bed.prepare(stuff, **options))
        prepared = prepare_as(stuff, make=Bed, stages=stages, arch="cpu", **options)
        assert prepared.bed is not None
        return self.laid_out(prepared.bed)

    def run_on(self, ground: Any) -> CoupledTumble:
        """Placed as always, under more weight, or let go where the tips are just clear of the surface."""
        start = self.lever.get("start")
        options = dict(self.stepping())
        tip = 0.5 * self.spikes.diameter
        if start == "surface":  # just clear of the grains
            options["lowering_speed"] = None
        run = CoupledTumble(self.trial, ground, tip_radius=tip, max_wheel_speed=self.plan.max_wheel_speed, **options)
        if isinstance(start, float):
            run.body.trial = replace(self.trial, gravity_sim=start * self.trial.gravity_sim)
        return run


def measured(lever: dict[str, Any], actuator: str, seed: int, kept: Path | None) -> dict[str, Any]:
    """What came of one run."""
    on_bed, began = OnBed(lever, actuator, seed), time.process_time()
    bed = on_bed.made(kept)
    prepared = time.process_time() - began
    run = on_bed.stepper(bed)
    start = None
    while not run.done:
        run.advance()
        if not run.placed:
            continue
        if run.body.trial is not on_bed.trial:
            run.body.trial = on_bed.trial
        if start is None:
            start = run.body.place[:2].copy()
        if math.hypot(*(run.body.place[:2] - start)) > FAR:
            break
    rows, feet = run.columns, run.feet
    path = np.column_stack([rows["x"] - rows["x"][0], rows["y"] - rows["y"][0]])
    far = np.hypot(*path.T)

    def reached(way: float) -> int | None:
        beyond = np.flatnonzero(far >= way)
        return int(beyond[0]) if len(beyond) else None

    found: dict[str, Any] = {
        "grains": bed.grain_count, "packing": round(bed.packing_fraction, 4), "time_step": bed.time_step,
        "set_down_mm": round(1e3 * float(feet[0, 3][[0, -1]].mean()), 3),
        "deepest_mm": round(1e3 * float(feet[:, 3].max()), 2), "largest_overlap": round(bed.max_overlap, 4),
        "energy_residual": float(f"{run.energy_residual:.2e}"),
    }  # fmt: skip
    for way in (0.005, 0.01):
        k = reached(way)
        name = f"at_{1e3 * way:.0f}mm"
        found[name] = None if k is None else {
            "angle": round(math.degrees(math.atan2(path[k, 1], path[k, 0])), 2),
            "time": round(float(rows["time"][k]), 4), "theta": round(math.degrees(float(rows["theta"][k])), 2),
        }  # fmt: skip
    return found | {"bed_s": round(prepared, 1), "run_s": round(time.process_time() - began - prepared, 1)}


def main(chosen: list[str], seeds: list[int], kept: Path | None) -> None:
    """Every lever that is chosen, or all, seed by seed; what is there already is not done again."""
    done = [json.loads(line) for line in RUNS.read_text().splitlines()] if RUNS.exists() else []
    have = {(entry["lever"], entry["actuator"], entry["seed"]) for entry in done}
    for seed in seeds:
        for name in chosen or LEVERS:
            for actuator in LEVERS[name].get("actuators", ("motor", "brake")):
                if (name, actuator, seed) in have:
                    continue
                entry = {"lever": name, "actuator": actuator, "seed": seed}
                entry |= measured(LEVERS[name], actuator, seed, kept)
                with RUNS.open("a") as file:
                    file.write(json.dumps(entry) + "\n")
                print(json.dumps(entry), flush=True)


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("levers", nargs="*")
    asked.add_argument("--seeds", type=int, nargs="*", default=[1, 2, 3])
    asked.add_argument("--bed", type=Path, help="bed file in place of a bed that is prepared; with one lever and seed")
    given = asked.parse_args()
    main(given.levers, given.seeds, given.bed)
