"""A small run folder with plausible numbers, made without a simulation."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from vis.pictures.frames import FrameWriter
from vis.pictures.meshes import spike_mesh

K, C, MASS, DEPTH = 230.0, 4.2, 0.05, 0.020
SPEEDS, DROPS, SEEDS = (0.1, 0.2, 0.4), (0.1, 0.3), (1, 2, 3)
SIZE, GRAIN = (0.06, 0.06, 0.036), 0.0036


def bed_force(depth, velocity, seed):
    """Drag of the made-up sand [N]: steeper than linear on the way in, almost nothing on the way out."""
    scale = 1.0 + 0.05 * (seed - 2)
    depth = np.maximum(depth, 0.0)
    way_in = scale * (900.0 * depth**1.35 * (1.0 + 0.8 * np.maximum(velocity, 0.0)) + 12.0 * depth * velocity**2)
    return np.where(velocity >= 0.0, way_in, -0.02 * way_in)


def model_force(depth, velocity):
    """The spring-damper [N]: K z, and C v on the way in."""
    return np.where(depth > 0.0, K * depth + C * np.maximum(velocity, 0.0), 0.0)


def write_series(path, time, depth, velocity, force, phase):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        f"{float(t)!r},{float(z)!r},{float(v)!r},{float(f)!r},{p}"
        for t, z, v, f, p in zip(time, depth, velocity, force, phase, strict=True)
    ]
    path.write_text("\n".join(["t_s,depth_m,velocity_m_s,force_N,phase", *rows]) + "\n")


def driven(speed, seed, rng):
    way = (DEPTH + 0.002) / speed
    rest = 0.02
    time = np.linspace(0.0, 2 * way + rest, 400)
    velocity = np.where(time < way, speed, np.where(time < way + rest, 0.0, -speed))
    depth = np.where(
        time < way, speed * time, np.where(time < way + rest, speed * way, speed * (2 * way + rest - time))
    )
    depth = depth - 0.002
    phase = np.where(velocity > 0, "in", np.where(velocity < 0, "out", "rest"))
    phase = np.where((depth < 0) & (phase == "in"), "free", phase)
    bed = bed_force(depth, velocity, seed)
    bed = bed * (1.0 + 0.05 * rng.normal(size=len(bed))) * np.where(phase == "rest", 0.6, 1.0)
    return time, depth, velocity, bed, model_force(depth, velocity), phase


def fall(law, speed, load, start):
    """Motion [rows of t, depth, velocity, force] of a falling spike under `load` [N] until it is at rest."""
    dt, t, z, v = 5e-5, 0.0, start, speed
    rows, stopped = [], False
    for _ in range(8000):
        force = float(law(z, v)) if z > 0 else 0.0
        if stopped and law is not model_force:
            v, force = 0.0, load  # sand holds what rests in it
        rows.append((t, z, v, force))
        if not (stopped and law is not model_force):
            v += dt * (load - force) / MASS
            z += dt * v
            stopped = stopped or (z > 0 and v <= 0)
        t += dt
    return np.array(rows)[::20].T


def grains(rng):
    count = [math.ceil(length / (0.87 * GRAIN)) for length in SIZE]
    axes = [(np.arange(n) + 0.5) * length / n for n, length in zip(count, SIZE, strict=True)]
    position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    position = position + rng.normal(0.0, 0.12 * GRAIN, position.shape)
    return position, 0.5 * GRAIN * rng.uniform(0.85, 1.0, len(position))


def write_frames(folder, name, series, rng, frames):
    start, radius = grains(rng)
    points, triangles = spike_mesh("sphere", diameter=0.012, shaft_diameter=0.008, length=0.05)
    surface, centre = SIZE[2], np.array([SIZE[0] / 2, SIZE[1] / 2, 0.0])
    writer = FrameWriter(folder, name=name)
    deepest = 0.0
    for row in np.linspace(0, len(series[0]) - 1, frames).astype(int):
        time, depth, velocity, force = (float(column[row]) for column in series[:4])
        deepest = max(deepest, depth, 0.0)
        tip = centre + [0.0, 0.0, surface - deepest + 0.006]
        away = start - tip
        distance = np.linalg.norm(away, axis=1)
        reach = deepest * np.exp(-np.maximum(distance - 0.006, 0.0) / 0.006)
        displacement = away / distance[:, None] * reach[:, None] * [0.6, 0.6, 0.3]
        displacement[:, 2] -= 0.25 * reach
        position = start + displacement
        inside = np.hypot(position[:, 0] - tip[0], position[:, 1] - tip[1]) < 0.0078
        inside &= position[:, 2] > surface - deepest
        push = position[inside, :2] - tip[:2]
        position[inside, :2] = tip[:2] + 0.0078 * push / np.linalg.norm(push, axis=1)[:, None]
        speed = np.abs(velocity) * reach / max(deepest, 1e-9)
        fields = {
            "position": position,
            "radius": radius,
            "velocity": speed[:, None] * away / distance[:, None],
            "force": 1e-3 * rng.normal(size=position.shape),
            "coordination": rng.integers(3, 9, len(position)),
            "displacement": displacement,
            "id": np.arange(len(position)),
        }
        spike = (points + centre + [0.0, 0.0, surface - depth], triangles)
        writer.write(time, fields, {"spike": spike}, values={"depth": depth, "force": force})


def value(number, std=None, unit="1", **more):
    return {"value": number, "std": std, "unit": unit, **more}


def work(depth, force, phase, which):
    part = np.isin(phase, ("free", "in") if which == "in" else ("out",))
    return abs(float(np.trapezoid(force[part], depth[part])))


def synthetic_run(folder, frames=6):
    """Write a complete run folder of `penetrate`: settings, result, series and frames; returns its path."""
    folder = Path(folder)
    rng = np.random.default_rng(5)
    runs, table = [], []
    for seed in SEEDS:
        for speed in SPEEDS if seed == 1 else SPEEDS[:1]:
            name = f"driven-{speed:g}-seed{seed}"
            time, depth, velocity, bed, model, phase = driven(speed, seed, rng)
            write_series(folder / f"series/{name}.csv", time, depth, velocity, bed, phase)
            write_series(folder / f"series/{name}.model.csv", time, depth, velocity, model, phase)
            way_in = phase == "in"
            gap = math.sqrt(np.mean((bed - model)[way_in] ** 2) / np.mean(bed[way_in] ** 2))
            quantities = {
                "work_in": value(work(depth, bed, phase, "in"), None, "J"),
                "work_out": value(work(depth, bed, phase, "out"), None, "J"),
                "peak_force": value(float(bed.max()), None, "N"),
                "max_depth": value(float(depth.max()), None, "m"),
                "drag_gap": value(gap),
                "model_work_in": value(work(depth, model, phase, "in"), None, "J"),
                "model_work_out": value(work(depth, model, phase, "out"), None, "J"),
                "model_peak_force": value(float(model.max()), None, "N"),
            }
            runs.append(entry(name, "driven", seed, speed, quantities))
            if seed == 1:
                for low in np.arange(0.0, DEPTH, 0.004):
                    bin_ = way_in & (depth >= low) & (depth < low + 0.004)
                    pair = float(bed[bin_].mean()), float(model[bin_].mean())
                    table.append(
                        {
                            "speed": speed,
                            "depth_from": low,
                            "depth_to": low + 0.004,
                            "bed_force": pair[0],
                            "model_force": pair[1],
                            "gap": (pair[1] - pair[0]) / pair[0],
                        }
                    )
            if seed == 1 and frames:
                write_frames(folder, name, (time, depth, velocity, bed), rng, frames)
        for speed in DROPS if seed == 1 else DROPS[:1]:
            name = f"drop-{speed:g}-seed{seed}"
            runs.append(falling(folder, name, "drop", seed, speed, 0.49))
        runs.append(falling(folder, f"set_down-seed{seed}", "set_down", seed, 0.0, 0.49))
    resting = [run["quantities"]["sinkage"]["value"] for run in runs if run["kind"] == "set_down"]
    result = {
        "format": "hedgebed-result/1",
        "experiment": "penetrate",
        "version": "0.1.0",
        "title": "A 12 mm ball-tipped spike in fine sand",
        "status": "done",
        "quantities": {
            "stiffness": value(231.4, 11.8, "N/m"),
            "damping": value(4.21, 0.35, "N s/m"),
            "sinkage_dem": value(float(np.mean(resting)), float(np.std(resting, ddof=1)), "m"),
            "sinkage_spring_damper": value(0.49 / 231.4, 0.00011, "m"),
            "drag_gap": value(0.284, 0.021),
            "grain_count": value(len(grains(np.random.default_rng(0))[0]), 0.0),
            "packing_fraction": value(0.5934, 0.0011),
        },
        "runs": runs,
        "fits": [
            {"seed": seed, "stiffness": k, "damping": c, "stiffness_std": 4.0, "damping_std": 0.12}
            for seed, k, c in zip(SEEDS, (219.0, 230.5, 244.7), (3.9, 4.15, 4.58), strict=False)
        ],
        "departures": {
            "sentences": [
                "Below 8 mm the spring-damper pushes back harder than the sand; beyond 14 mm it is too soft, because "
                "the sand's drag grows faster than the depth.",
                "On the way out the sand lets go at once; the spring-damper returns 71 % of the work put in.",
            ],
            "table": table,
        },
        "bed": {
            "grain_diameter": value(GRAIN, 0.0, "m"),
            "spread": 0.15,
            "young_modulus": value(5.0e6, 0.0, "Pa"),
            "max_overlap": value(0.032),
            "seeds": list(SEEDS),
            "size": list(SIZE),
            "gravity": value(9.81, 0.0, "m/s2"),
            "time_step": value(1.2e-5, 0.0, "s"),
            "surface": SIZE[2],
        },
        "spike": {"tip": "sphere", "diameter": 0.012, "shaft_diameter": 0.008, "mass": MASS},
        "warnings": ["Grains are softened: the largest overlap was 3.2 % of a diameter."],
    }
    (folder / "result.json").write_text(json.dumps(result, indent=1))
    (folder / "status.json").write_text(json.dumps({"status": "done", "reason": ""}))
    (folder / "run.toml").write_text(
        "# hedgebed penetrate: every setting of this run, as given or by default.\n"
        'format = "hedgebed-run/1"\nversion = "0.1.0"\ncommand = "penetrate"\n\n[settings]\n'
        "# Mean diameter of the grains [m].\ngrain = 0.0036\n# Gravity of the grains [m/s2].\ngravity = 9.81\n"
        "# Speeds of the driven runs [m/s].\nspeeds = [0.1, 0.2, 0.4]\n# Packing fraction to reach [1].\n"
        "# packing is not set\n"
    )
    return folder


def entry(name, kind, seed, speed, quantities):
    series = f"series/{name}"
    return {
        "id": name,
        "kind": kind,
        "seed": seed,
        "speed": speed,
        "series": f"{series}.csv",
        "model_series": f"{series}.model.csv",
        "quantities": quantities,
    }


def falling(folder, name, kind, seed, speed, load):
    quantities = {}
    for prefix, suffix, law in (
        ("", "", lambda z, v: bed_force(np.float64(z), np.float64(max(v, 0.0)), seed)),
        ("model_", ".model", model_force),
    ):
        time, depth, velocity, force = fall(law, speed, load, -0.0005 if kind == "drop" else 0.0)
        phase = np.where(depth < 0, "free", np.where(velocity > 0, "in", np.where(velocity < 0, "out", "rest")))
        write_series(folder / f"series/{name}{suffix}.csv", time, depth, velocity, force, phase)
        if kind == "drop":
            quantities[f"{prefix}peak_force"] = value(float(force.max()), None, "N")
            quantities[f"{prefix}max_depth"] = value(float(depth.max()), None, "m")
            quantities[f"{prefix}stop_time"] = value(float(time[np.argmax(depth)]), None, "s")
        else:
            quantities[f"{prefix}sinkage"] = value(float(depth[-40:].mean()), None, "m")
    return entry(name, kind, seed, speed, quantities)


@pytest.fixture(scope="session")
def make_run(tmp_path_factory):
    """`synthetic_run(folder, frames=6)`: made once for each number of frames, and copied into the folder."""
    made = {}

    def copied(folder, frames=6):
        if frames not in made:
            made[frames] = synthetic_run(tmp_path_factory.mktemp("made"), frames)
        return Path(shutil.copytree(made[frames], folder, dirs_exist_ok=True))

    return copied


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """A run folder that tests only read."""
    return synthetic_run(tmp_path_factory.mktemp("run"))
