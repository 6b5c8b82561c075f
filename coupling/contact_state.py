"""Pivot, slip or hop, read off the forces of grains by stated rules, so that it compares with the planar model's.

Over a window of 5 ms the means of each row's normal force N, of its horizontal force F and of the horizontal speed u of
its lowest material point are taken. A row

- *touches* while the force on it, N and F together, is above 1 % of the weight on the surface: sand pushes a spike that
  is in it sideways where nothing bears it any more;
- *slides* while |F| is at least mu_d N, F is against u and |u| is above 2 mm/s; what touches and does not slide sticks.
  mu_d is the surface's, as the spring-damper has it.

Then as in the planar model: hop (none touches), slip (all that touch slide), pivot (one sticks), stand (more do).
A grain's knocks are shorter than the window and a torque's changes longer. Changes come late by half the window.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CREEP", "TOUCH_SHARE", "WINDOW", "ContactReader", "state_of"]

WINDOW = 5e-3
"""Over which forces and speeds are averaged [s]."""
TOUCH_SHARE = 0.01
"""Force on a row that touches, over the weight [1]."""
CREEP = 2e-3
"""Horizontal speed up to which a row counts as held [m/s]."""

Array = NDArray[np.float64]


def state_of(touching: NDArray[np.bool_], sliding: NDArray[np.bool_]) -> str:
    """The planar model's state of these rows."""
    if not touching.any():
        return "hop"
    sticking = int((touching & ~sliding).sum())
    return "slip" if sticking == 0 else "pivot" if sticking == 1 else "stand"


class ContactReader:
    """Follows the rows' forces in steps of `macro_step` [s]; `weight` [N] on the surface, `mu_d` [1]."""

    def __init__(self, rows: int, *, weight: float, mu_d: float, macro_step: float) -> None:
        self.weight, self.mu_d = weight, mu_d
        self._ring = np.zeros((max(1, round(WINDOW / macro_step)), 3, rows))
        self._filled = 0

    def see(self, normal: Array, along: Array, slip: Array) -> str:
        """The state after one more step of normal and horizontal forces [N] and slip speeds [m/s] of the rows."""
        self._ring = np.roll(self._ring, 1, axis=0)
        self._ring[0] = normal, along, slip
        self._filled = min(self._filled + 1, len(self._ring))
        n, f, u = self._ring[: self._filled].mean(axis=0)
        touching = np.hypot(n, f) > TOUCH_SHARE * self.weight
        sliding = (abs(f) >= self.mu_d * n) & (f * u < 0) & (abs(u) > CREEP)
        return state_of(touching, sliding)

    def state(self) -> dict[str, Any]:
        """What the next answers depend on."""
        return {"ring": self._ring.copy(), "filled": np.array(self._filled)}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        self._ring, self._filled = np.array(state["ring"], dtype=float), int(state["filled"])
