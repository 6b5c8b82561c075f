"""What happens at an event of a batched trial: touching, sticking, sliding, and what ends."""

# Taichi reads the annotations and the source of kernels: no `from __future__ import annotations` here.
from types import SimpleNamespace
from typing import Any

__all__ = ["make_switch"]


def make_switch(parts: SimpleNamespace) -> Any:
    """The Taichi function `switch`, which changes the modes at an event; what it changes are templates."""
    import taichi as ti

    MEMORY, SHEDS, HOLDS, BETA, HALF = parts.MEMORY, parts.SHEDS, parts.HOLDS, parts.BETA, parts.HALF
    count = parts.count

    @ti.func
    def switch(
        kind, which, lowest, touch: ti.template(), stick: ti.template(), backwards: ti.template(), fresh: ti.template(),
        slide_v: ti.template(), slide_r: ti.template(), over: ti.template(), wheel: ti.template(), s: ti.template(),
        top: ti.template(), held: ti.template(), theta, vx, omega, radius, h_kept, hold, hold_v, hold_r,
    ):  # fmt: skip
        bit = 1 << which
        newcomers = fresh & stick
        fresh = 0
        if kind == 1:
            touch |= bit
            if ti.static(HOLDS):
                held[which] = 0.0
            slip = vx - omega * ((s.length - radius) * ti.cos(theta + HALF + which * BETA) + radius)
            stick &= ~bit
            if slip > 0.0:
                backwards &= ~bit
            else:
                backwards |= bit
        elif kind == 2:
            touch &= ~bit
            stick &= ~bit
            if ti.static(MEMORY and not SHEDS):
                top[which] = 0.0
        elif kind == 3:
            stick |= bit
            fresh = bit
        elif kind == 4:
            leaving = stick
            if newcomers != 0 and newcomers != stick:
                leaving = newcomers
            stick &= ~leaving
            for j in ti.static(range(3)):
                n = (lowest + j - 1 + count) % count
                one = 1 << n
                if (leaving & one) != 0:
                    sign = -hold
                    slip = vx - omega * h_kept[j]  # what the constraint leaves: not its excess before
                    if ti.abs(slip) > 1e-12:
                        sign = slip
                    if sign > 0.0:
                        backwards &= ~one
                    else:
                        backwards |= one
        elif kind == 5:
            wheel = 0.0
            over = True
        elif kind == 6:
            slide_v = 0
        elif kind == 7:
            slide_r = 0
        elif kind == 8:
            slide_v = 1
            if hold_v > 0.0:
                slide_v = -1
        elif kind == 9:
            slide_r = 1
            if hold_r > 0.0:
                slide_r = -1
        elif kind == 10:
            s.inner_mode = 1.0 - s.inner_mode

    return switch
