"""Parts of a long case that are kept as they end: a case that was stopped goes on with those that lack.

They lie in the folder of the cache, under what they were computed from: the bed's code, ``drops.py`` and the settings.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dem.prepare.prepare import cache_folder, fingerprint

__all__ = ["part"]


def part(
    name: str, settings: Mapping[str, Any], compute: Callable[[], Mapping[str, ArrayLike]]
) -> dict[str, np.ndarray]:
    """What `compute` gives, arrays by name, or what it gave before for the same settings and code.

    `settings`: what JSON takes; everything that the result depends on beside the code.
    """
    own = hashlib.sha256(Path(__file__).with_name("drops.py").read_bytes()).hexdigest()
    told = json.dumps({"bed": fingerprint(), "own": own, **settings}, sort_keys=True)
    path = cache_folder() / "validate" / f"{name}-{hashlib.sha256(told.encode()).hexdigest()[:24]}.npz"
    if path.exists():
        try:
            with np.load(path) as kept:
                return {key: kept[key] for key in kept.files}
        except (OSError, ValueError):  # ended while it was written by other means; computed anew
            pass
    found = {key: np.asarray(value) for key, value in compute().items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part.npz")
    np.savez(unfinished, **found)  # type: ignore[arg-type]
    unfinished.replace(path)
    return found
