"""`loss` and `loss_speed` of a springback from the swings of a mass in its crater: writes fit.json beside this file.

    python docs/results/foot-cycles/fit.py

Each swing after the first of a fall (cycles.jsonl, `falls`) goes down with the peak speed v and up with e v. A law
m dw/dt = k s (1 - loss u / (u + loss_speed)) - m g starts to retreat where an elastic swing of peak speed v turns; its
peak speed on the way up is predicted. k / m is the square of 2 v over the stroke downwards, the median of a fall. Both
numbers minimise the squared error of ln e over all swings; std: by leaving out one bed each. `FORMS` are compared, each
with its own numbers: the share of the springback's force that is left at the speed of retreat u.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

HERE = Path(__file__).parent
EARTH = 9.81
STEPS = 60  # of a quarter of a swing
Array = np.ndarray
FORMS: dict[str, tuple[list[float], Callable[[Array, Array], Array]]] = {
    "loss and loss_speed: 1 - a u / (u + b)": ([0.8, 0.05], lambda x, u: 1 - x[0] * u / (u + x[1])),
    "Hunt and Crossley: 1 - a u": ([2.0], lambda x, u: np.maximum(0.0, 1 - x[0] * u)),
    "a constant share: 1 - a": ([0.05], lambda x, u: np.where(u > 0, 1 - x[0], 1.0)),
}
"""Name -> first guesses, the share. The last is a loss in each cycle that does not depend on the rate."""


def swings(lines: list[dict[str, Any]], tip: str | None = None) -> Array:
    """Seed, peak speed down [m/s], restitution and angular frequency [rad/s] of each swing, shape [swing, 4]."""
    rows = []
    for line in lines:
        if line["kind"] != "falls" or (tip and line["tip"] != tip):
            continue
        for fall in line["falls"]:
            v, z = np.array(fall["speeds"]), np.array(fall["turns"])
            pairs = range(2, len(v) - 1, 2)
            rates = [2 * v[k] / (z[k] - z[k - 1]) for k in pairs if z[k] > z[k - 1]]
            rows += [(line["seed"], v[k], -v[k + 1] / v[k], float(np.median(rates))) for k in pairs if v[k] > 0]
    return np.array(rows)


def predicted(left: Callable[[Array], Array], down: Array, rate: Array) -> Array:
    """Peak speed up over peak speed down [1] of swings with a peak speed `down` [m/s]; `rate`: sqrt(k / m) [rad/s]."""
    rest = EARTH / rate**2
    s, u, most, dt = rest + down / rate, np.zeros_like(down), np.zeros_like(down), 0.5 * math.pi / rate / STEPS
    for _ in range(3 * STEPS):
        u = u + dt * (rate**2 * np.maximum(s, 0.0) * left(np.maximum(u, 0.0)) - EARTH)
        s = s - dt * u
        most = np.maximum(most, u)
    return most / down


def fitted(rows: Array, form: str = next(iter(FORMS))) -> tuple[Array, float]:
    """The numbers of a form, such as loss [1] and loss_speed [m/s], and the root mean square error of ln e."""
    guesses, left = FORMS[form]
    highest = [100.0] if "Hunt" in form else [1.0, 10.0][: len(guesses)]

    def off(x: Array) -> Array:
        swung = predicted(lambda u: left(x, u), rows[:, 1], rows[:, 3])
        return np.log(np.maximum(swung, 1e-3)) - np.log(rows[:, 2])

    found = least_squares(off, guesses, bounds=([1e-6] * len(guesses), highest), x_scale=guesses)
    return found.x, float(np.sqrt((found.fun**2).mean()))


def main() -> None:
    """Fit all swings, those of each tip, of stiffer grains, and those of all beds but one."""
    lines, stiff = (
        [json.loads(line) for line in (HERE / f"{name}.jsonl").read_text(encoding="utf-8").splitlines()]
        for name in ("cycles", "stiff")
    )
    sets = {"all": swings(lines), "flat": swings(lines, "flat"), "ball": swings(lines, "ball")}
    sets |= {
        "flat, grains 4 times as stiff": swings(stiff),
        "flat, the same bed": sets["flat"][sets["flat"][:, 0] == 1],
    }
    found: dict[str, Any] = {}
    for name, rows in sets.items():
        best, error = fitted(rows)
        seeds = np.unique(rows[:, 0])
        others = np.array([fitted(rows[rows[:, 0] != seed])[0] for seed in seeds]) if len(seeds) > 1 else best[None]
        spread = np.sqrt((len(seeds) - 1) / len(seeds) * ((others - best) ** 2).sum(axis=0))
        stds = np.round(spread, 4).tolist() if len(seeds) > 1 else [None, None]
        found[name] = {
            "loss": [round(float(best[0]), 4), stds[0]],
            "loss_speed": [round(float(best[1]), 4), stds[1]],
            "rms_ln_e": round(error, 4), "swings": len(rows), "beds": len(seeds),
            "speeds": [float(end(rows[:, 1])) for end in (np.min, np.max)],
            "forms": {form: [x.round(4).tolist(), round(off, 3)] for form in FORMS for x, off in [fitted(rows, form)]},
            "restitution": [[round(float(v), 4), round(float(e), 3)] for _, v, e, _ in rows],
        }  # fmt: skip
    (HERE / "fit.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    for name, one in found.items():
        print(name, {key: one[key] for key in ("loss", "loss_speed", "rms_ln_e", "swings", "beds", "forms")})


if __name__ == "__main__":
    main()
