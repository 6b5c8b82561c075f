"""Makes maps.toml from kept results: `python -m experiments.groundmap.make` from the root of a checkout.

Of sand it reads docs/results/converge-flagship (numbers over grain size) and docs/results/ground-map (packing, and two
runs that check the scaling); of JSC-1A docs/results/penetrate-jsc-1a-push. docs/notes/results.md describes both.
"""

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigid.intervals import NORMAL, student
from rigid.platform.rig import STANDARD_GRAVITY
from rigid.result import write_text

from .maps import DATA, NAMES

__all__ = ["made_cohesive", "made_map", "main"]

RESULTS = Path(__file__).parents[2] / "docs" / "results"
PACKED = ("sand-rained", "sand-0.575", "sand-0.60")
RANGES = {
    "gravity": (9.80665e-6, 9.80665), "tip_diameter": (0.001, 0.1), "grain": (0.0, 0.2),
}  # fmt: skip
"""In m/s2, m, and of the tip's diameter: what scaling covers; the grains of the coarsest bed are a fifth of the tip."""
COHESIVE = "jsc-1a-loose-cut"
PUSHED = "penetrate-jsc-1a-push"
QUARTERS = (0.375, 0.625, 0.875)  # middles of the last three quarters of the drive's depth, of which forces are kept


def _result(name: str) -> Any:
    return json.loads((RESULTS / name / "result.json").read_text(encoding="utf-8"))


def made_map() -> Mapping[str, Any]:
    """The table of sand."""
    flagship = _result("converge-flagship")
    lines = {}
    for name in NAMES:
        found = flagship["convergence"][name]
        ratios, values, chance = zip(*found["line"], strict=True)
        lines[name] = {
            "ratios": list(ratios), "values": list(values), "chance": list(chance), "grain": found["grain"],
            "finest": min(size["x"] for size in found["sizes"]), "rest": found["rest"],
        }  # fmt: skip
    settings = tomllib.loads((RESULTS / "converge-flagship" / "run.toml").read_text(encoding="utf-8"))["settings"]
    exponents = _exponents(flagship["convergence"])
    results = [_result(f"ground-map/{name}") for name in PACKED]
    packed = [result["quantities"] for result in results]
    beds = [len({run["seed"] for run in result["runs"]}) for result in results]
    stiffness = [entry["stiffness"]["value"] for entry in packed]
    factors = [value / stiffness[0] for value in stiffness]
    scatter = [entry["stiffness"]["std"] / entry["stiffness"]["value"] for entry in packed]
    stds = [0.0, *(f * _ratio_std(scatter, beds, k) for k, f in enumerate(factors[1:], start=1))]
    fractions = [entry["packing_fraction"]["value"] for entry in packed]
    return {
        "source": "docs/results/converge-flagship over grain size, docs/results/ground-map over packing",
        "reference": {
            "diameter": settings["tip_diameter"], "gravity": settings["gravity"], "load": 0.219,
            "speed": max(settings["speeds"]), "grain": 0.0002, "exponent": float(np.mean(exponents)),
            "exponent_std": float(np.std(exponents, ddof=1)),
            "shallowest": (QUARTERS[0] - 0.125) * settings["depth"] / settings["tip_diameter"],
        },
        "range": {**RANGES, "packing": (math.floor(1e3 * fractions[0]) / 1e3, math.ceil(1e3 * fractions[-1]) / 1e3)},
        "packing": {
            "fractions": fractions, "factors": factors, "stds": stds, "stiffness": stiffness[0],
            "ratio": results[0]["bed"]["grain"] / results[0]["spike"]["diameter"],
        },
        **lines,
    }  # fmt: skip


def made_cohesive() -> Mapping[str, Any]:
    """The table of `jsc-1a-loose-cut`: numbers.json of its kept pushes, at 5/12 of a tip's diameter."""
    numbers = json.loads((RESULTS / PUSHED / "numbers.json").read_text(encoding="utf-8"))
    law, spike = numbers["map, 0 to 5 mm"], numbers["of a spike, 0 to 5 mm"]
    return {
        "source": f"docs/results/{PUSHED}",
        "packing": law["packing"],
        "deepest": 5 / 12,
        "reference": {
            "diameter": 0.012, "gravity": STANDARD_GRAVITY, "load": 0.219, "speed": law["fastest"], "grain": 0.0001,
            "shallowest": 1 / 12, "most": math.ceil(1e4 * law["heaviest"]) / 1e4,
        },
        "range": {
            **RANGES, "grain": (0.0, math.ceil(1e3 * law["coarsest"]) / 1e3),
            "packing": (law["packing"] - 0.005, law["packing"] + 0.005),
        },
        "cohesive": {
            **{key: law[key] for key in ("a", "b", "share", "finest")}, "off": max(law["off_case"], law["off_bed"]),
            **{key: spike[key] for key in ("stiffness", "within", "damping", "damping_std")}, "shape": numbers["shape"],
        },
    }  # fmt: skip


def _exponents(found: Mapping[str, Any]) -> list[float]:
    """Of force over depth, of each bed of every grain size, from the second to the last quarter of the drive."""
    return [
        math.log(deep / shallow) / math.log(QUARTERS[-1] / QUARTERS[0])
        for last, first in zip(found["force_4"]["sizes"], found["force_2"]["sizes"], strict=True)
        for deep, shallow in zip(last["values"], first["values"], strict=True)
    ]


def _ratio_std(scatter: Sequence[float], beds: Sequence[int], k: int) -> float:
    """Relative error of the mean of k over that of the first [1]: Student's half-width of 95 % over `NORMAL`.

    Beds of all packings are taken to scatter alike, relative to their mean, so that the degrees of freedom add up.
    """
    free = sum(count - 1 for count in beds)
    pooled = math.sqrt(sum((count - 1) * s**2 for s, count in zip(scatter, beds, strict=True)) / free)
    return student(free) / NORMAL * pooled * math.sqrt(1 / beds[0] + 1 / beds[k])


def _written(value: Any) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_written, value))}]"
    return json.dumps(value) if isinstance(value, str) else f"{value:.6g}"


def main() -> None:
    """Write maps.toml."""
    lines = ["# Made by `python -m experiments.groundmap.make` from kept results; half-widths are of 95 %."]
    for material, table in (("sand", made_map()), (COHESIVE, made_cohesive())):
        lines += ["", f"[{material}]"]
        lines += [f"{key} = {_written(value)}" for key, value in table.items() if not isinstance(value, dict)]
        for name, part in table.items():
            if isinstance(part, dict):
                lines += ["", f"[{material}.{name}]", *(f"{key} = {_written(value)}" for key, value in part.items())]
    write_text(DATA, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
