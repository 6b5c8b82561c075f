"""How much harder grains push a flat foot than laws and a ball tip: measured factors.

The tip of 12 mm goes down in `sand` at 0.1 m/s and 1 g. The one bed has grains of 1.5 mm, eight across the tip
(docs/results/mujoco-laws/flat-foot.json). Five grains across push harder, finer grains less: for real sand these are
upper bounds.
"""

__all__ = ["DEPTHS", "OVER_BALL", "OVER_LAW"]

DEPTHS = (0.05, 0.3)
"""Depths of the factors below, over the diameter of the foot [1]."""
OVER_LAW = {"rft": (4.0, 1.3), "spring-damper": (9.9, 4.8)}
"""Law with its defaults, or with K and C of sand -> force of grains on the flat tip over that of the law [1]."""
OVER_BALL = (11.4, 3.4)
"""Force of grains on the flat tip over that on a ball tip of its diameter [1]."""
