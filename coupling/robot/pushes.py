"""The push of a surface law on one foot, written as a Python function of its own: `write_push`.

The arms of the points, their depths and their velocities are linear in where the points are on the foot. So one product
serves all points with the same coordinate, and two points opposite each other. Of the forces of the points only sums,
and sums times coordinates, go into the wrench. So a point costs its depth, rate and slip and its law. All numbers of
foot and law stand in the source: an interpreter spends most of its time on reading numbers and calling functions.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupling.poses import Vector
from rigid.ground.specialised import Written

from .feet import Foot, Part

__all__ = ["Memory", "PartLaw", "write_push"]

SAME = 1e-14  # Relative difference of two coordinates of points that count as the same [1]
NEAR = 1e-12  # Margin of the box around points [1]
FEW = 2  # Points up to which their depths take no longer than the box around them


@dataclass(frozen=True, kw_only=True)
class PartLaw:
    """The law under a part of a foot."""

    law: Written
    first: int  # Number of its first point among those of all feet
    limit: float = math.inf  # Depth to which the law holds [m]
    fastest: float = math.inf  # Speed into the ground to which it was compared with grains [m/s]


@dataclass(frozen=True, kw_only=True)
class Memory:
    """How a law with memory springs back (`rigid.ground.laws`)."""

    rebound: float
    loss: float
    loss_speed: float


def write_push(
    foot: Foot,
    laws: Sequence[PartLaw],
    memory: Memory | None,
    *,
    mu_d: float,
    slip_speed: float,
    names: Mapping[str, Any],
) -> Callable[..., int]:
    """The function that adds the force of a law on `foot` to ``data.qfrc_passive``, and returns points evaluated.

    Its arguments begin with an MjData and the rows of the foot in its ``xipos``, ``xmat`` and ``cvel``. Then come the
    row of the robot in its ``subtree_com``, and its ``qfrc_passive``. Two lists follow: the deepest depth of each point
    of all feet before and now [m]; without `memory` they are not used. ``laws``: of each part. ``names``: what the
    function uses: the model as `model`, the functions `apply` (``mj_applyFT``), `warn` and `warn_fast`, and the arrays
    `force` and `torque`.
    """
    lines = [
        "across, along, height = place.tolist()",
        f"if height > {float(foot.reach)!r}: return 0",
        "m0, m1, m2, m3, m4, m5, m6, m7, m8 = turn.tolist()",
        "fx = fy = fz = tx = ty = tz = 0.0",
        "count, wx = 0, None",
    ]
    for part, law in zip(foot.parts, laws, strict=True):
        for chosen in _halves(part):
            lines += _Group(part, chosen, law, memory, mu_d, slip_speed).lines()
    lines += [
        "if fz > 0.0:",  # one by one: NumPy takes three times as long for a tuple
        "    force[0] = fx; force[1] = fy; force[2] = fz",
        "    torque[0] = tx; torque[1] = ty; torque[2] = tz",
        f"    apply(model, data, force, torque, place, {foot.body}, total)",
        "return count",
    ]
    source = "\n".join(["def push(data, place, turn, moving, middle, total, before, now):", *_indented(lines)])
    found: dict[str, Any] = {"sqrt": math.sqrt, **names}
    exec(compile(source, f"<push on {foot.name}>", "exec"), found)  # of our own text, floats and one quoted name
    push: Callable[..., int] = found["push"]
    return push


def _halves(part: Part) -> list[Any]:
    """Numbers of the points of a part in a lower and an upper half: mostly one of them is in the air."""
    low = part.centres[:, 2] < part.centres[:, 2].mean()
    return [some for some in (np.flatnonzero(low), np.flatnonzero(~low)) if len(some)]


class _Group:
    """Writes the lines for some points of a part; a part has points of one S (`coupling.robot.feet`)."""

    def __init__(self, part: Part, chosen: Any, law: PartLaw, memory: Memory | None, mu_d: float, slow: float) -> None:
        self.name, self.law, self.memory, self.mu_d, self.slow = part.name, law, memory, mu_d, slow
        self.places = [law.first + int(k) for k in chosen]
        self.spread = part.spreads[chosen[0]]
        sizes = np.linalg.norm(self.spread, axis=1)  # half the sides of a box around each ball or ellipsoid
        centres = part.centres[chosen]
        low, high = (centres - sizes).min(axis=0), (centres + sizes).max(axis=0)
        self.box = 0.5 * (low + high), 0.5 * (high - low) * (1 + NEAR)
        scale = float(np.abs(part.centres).max())
        self.middle = _snapped(centres.mean(axis=0), scale)
        self.at = _snapped(centres - self.middle, scale)
        self.axes = [j for j in range(3) if self.at[:, j].any()]
        self.count = len(centres)
        self.opposite = _opposite(self.at)

    def lines(self) -> list[str]:
        """Of the whole group: it is left out where the box around it is in the air."""
        inner = [f"count += {self.count}", *self._middle(), *self._points_of("d", "low", "-m", (6, 7, 8))]
        touch = " or ".join(f"d{k} > 0.0" for k in range(self.count))
        inner += [f"if {touch}:", *_indented(self._touching())]
        if self.count <= FEW:
            return inner
        middle, half = self.box
        top = _sum([(value, f"abs(m{6 + j})") for j, value in enumerate(half)])
        return [f"if height + {_sum(_named('m', 6, middle))} <= {top}:", *_indented(inner)]

    def _middle(self) -> list[str]:
        """The arm of the middle of the points, world axes, and its depth."""
        radius = float(self.spread[0, 0])
        if np.array_equal(self.spread, radius * np.eye(3)):
            arm = [_sum(_named("m", 3 * row, self.middle)) for row in range(3)]
            deep = f" - {radius!r}" if radius else ""
            return [f"ox, oy = {arm[0]}, {arm[1]}", f"oz = {arm[2]}{deep}", "low = -height - oz"]
        # The lowest point of an ellipsoid: c - S S z / |S z|
        found = [f"e{j} = {_sum(_named('m', 6, self.spread[j]))}" for j in range(3)]
        found += ["size = sqrt(e0 * e0 + e1 * e1 + e2 * e2)", "if size < 1e-300: size = 1.0"]
        steep = [_sum(_named("e", 0, self.spread[j])) for j in range(3)]
        found += [f"c{j} = {float(self.middle[j])!r} - ({steep[j]}) / size" for j in range(3)]
        arm = [f"m{3 * row} * c0 + m{3 * row + 1} * c1 + m{3 * row + 2} * c2" for row in range(3)]
        return [*found, f"ox = {arm[0]}", f"oy = {arm[1]}", f"oz = {arm[2]}", "low = -height - oz"]

    def _points_of(self, name: str, middle: str, column: str, numbers: Sequence[int]) -> list[str]:
        """Of each point: `name` and its number, linear in its coordinates, with products of several points once."""
        products, rows = self._linear(middle, column, numbers)
        return [*products, *(f"{name}{k} = {row}" for k, row in enumerate(rows))]

    def _linear(self, middle: str, column: str, numbers: Sequence[int]) -> tuple[list[str], list[str]]:
        """Lines for products that several points share, and the expression of each point."""
        stem, sign = column.lstrip("-"), -1.0 if column[0] == "-" else 1.0
        products, names = [], {}
        for j in self.axes:
            sizes = np.abs(self.at[:, j])
            for number, size in enumerate(np.unique(sizes[sizes > 0])):
                product = f"{stem}{numbers[j]} * {float(size)!r}"
                if np.count_nonzero(sizes == size) > 1:
                    names[j, float(size)] = f"{stem}{numbers[j]}_{number}"
                    products.append(f"{names[j, float(size)]} = {product}")
                else:
                    names[j, float(size)] = product
        rows = []
        for k, point in enumerate(sign * self.at):
            each = [(math.copysign(1.0, point[j]), names[j, abs(float(point[j]))]) for j in self.axes if point[j]]
            other = self.opposite.get(k)
            if other is not None and len(each) > 1:
                both = f"{stem}_{min(k, other)}"
                if k < other:
                    products.append(f"{both} = {_sum(each)}")
                each = [(1.0 if k < other else -1.0, both)]
            rows.append(middle + "".join(f" {'-' if own < 0 else '+'} {name}" for own, name in each))
        return products, rows

    def _touching(self) -> list[str]:
        """Of a group of which a point is in the ground."""
        found = [
            "if wx is None:",
            "    wx, wy, wz, vx, vy, vz = moving.tolist()",  # about the middle of the robot, as MuJoCo has it
            "    rx, ry, rz = middle.tolist()",
            "    rx, ry, rz = across - rx, along - ry, height - rz",
            "    vx, vy, vz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx",
            "ux = vx + wy * oz - wz * oy",
            "uy = vy + wz * ox - wx * oz",
            "sink = wy * ox - wx * oy - vz",
        ]
        for j in self.axes:
            found += [
                f"gx{j} = wy * m{6 + j} - wz * m{3 + j}",
                f"gy{j} = wz * m{j} - wx * m{6 + j}",
                f"gz{j} = wy * m{j} - wx * m{3 + j}",
            ]
        rows = {}
        for name, middle, column in (("rate", "sink", "gz"), ("x", "ux", "gx"), ("y", "uy", "gy")):
            products, rows[name] = self._linear(middle, column, (0, 1, 2))
            found += products
        if self.count > 1:
            found.append(" = ".join(f"{letter}{k}" for letter in "fs" for k in range(self.count)) + " = 0.0")
            for k, place in enumerate(self.places):
                own = self._point(place, f"d{k}", rows["rate"][k], rows["x"][k], rows["y"][k], k)
                found += [f"if d{k} > 0.0:", *_indented(own)]
        else:
            found += ["f0 = s0 = 0.0", *self._point(self.places[0], "d0", "sink", "ux", "uy", 0)]
        return found + self._wrench()

    def _point(self, place: int, depth: str, rate: str, x: str, y: str, k: int) -> list[str]:
        """Load f and load over slip s of a point in the ground."""
        law, memory, found = self.law.law, self.memory, [f"depth = {depth}"]
        loses = memory is not None and memory.loss != 0.0
        if loses or self.law.fastest < math.inf or law.rate_force != "0.0":
            found.append(f"rate = {rate}")
        if self.law.limit < math.inf:
            found.append(f"if depth > {self.law.limit!r}: warn(depth, {self.name!r}, {self.law.limit!r})")
        if self.law.fastest < math.inf:
            found.append(f"if rate > {self.law.fastest!r}: warn_fast(rate, {self.name!r}, {self.law.fastest!r})")
        load = f"({law.loading})"
        if memory is None:
            found.append("top = depth")
        else:
            found += [
                f"top = before[{place}]",
                "if depth < top:",
                f"    share = 1.0 - (top - depth) / ({memory.rebound!r} * top)",
                "    if share < 0.0: share = 0.0",
                "else:",
                "    top, share = depth, 1.0",
                f"now[{place}] = top",
            ]
            load += " * share"
        if memory is not None and loses:
            found += ["if rate < 0.0:", f"    share *= 1.0 - {memory.loss!r} * rate / (rate - {memory.loss_speed!r})"]
        moving = "" if law.rate_force == "0.0" else f" + ({law.rate_force})"
        found += [*law.loading_lines, *law.rate_lines, f"load = {load}{moving}"]
        return [
            *found, "if load > 0.0:", f"    x = {x}", f"    y = {y}", "    square = x * x + y * y",
            f"    f{k} = load",
            f"    s{k} = load / (sqrt(square) if square > {self.slow**2!r} else {self.slow!r})",
        ]  # fmt: skip

    def _wrench(self) -> list[str]:
        """Force and torque about the foot's origin from sums of f and s, and of f and s times coordinates."""
        axes, mu = self.axes, repr(self.mu_d)

        def moment(letter: str, *which: int) -> str:
            """Sum of f or s times coordinates; of two points opposite each other the sum or the difference counts."""
            sort, terms = "pm"[len(which) % 2], []
            for k, weight in enumerate(np.prod(self.at[:, list(which)], axis=1)):
                if (other := self.opposite.get(k, k)) >= k:
                    terms.append((float(weight), f"{letter}{k}" if other == k else f"{letter}{sort}{k}"))
            return _sum(terms)

        found = []
        for k, other in self.opposite.items():
            if k < other:
                found += [f"{c}p{k}, {c}m{k} = {c}{k} + {c}{other}, {c}{k} - {c}{other}" for c in "fs"]
        found.append(f"load, slip = {moment('f')}, {moment('s')}")
        for i in axes:
            found.append(f"l{i}, q{i} = {moment('f', i)}, {moment('s', i)}")
            found += [f"q{i}{j} = {moment('s', i, j)}" for j in axes if j >= i]
        for c in "xy":
            found.append(f"p{c} = " + " + ".join([f"u{c} * slip", *(f"g{c}{j} * q{j}" for j in axes)]))
            for i in axes:
                second = [f"g{c}{j} * q{min(i, j)}{max(i, j)}" for j in axes]
                found.append(f"h{c}{i} = " + " + ".join([f"u{c} * q{i}", *second]))
        down = {c: " + ".join([f"oz * p{c}", *(f"m{6 + i} * h{c}{i}" for i in axes)]) for c in "xy"}
        turned = "".join(f" + m{i} * hy{i} - m{3 + i} * hx{i}" for i in axes)
        return [
            *found,
            f"fx -= {mu} * px; fy -= {mu} * py; fz += load",
            f"tx += oy * load{''.join(f' + m{3 + i} * l{i}' for i in axes)} + {mu} * ({down['y']})",
            f"ty -= ox * load{''.join(f' + m{i} * l{i}' for i in axes)} + {mu} * ({down['x']})",
            f"tz -= {mu} * (ox * py - oy * px{turned})",
        ]


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _named(stem: str, first: int, values: Any) -> list[tuple[float, str]]:
    """Each value with the name of its factor: `stem` and a number from `first` on."""
    return [(float(value), f"{stem}{first + j}") for j, value in enumerate(values)]


def _sum(terms: Sequence[tuple[float, str]]) -> str:
    """Sum of factors times names, with names of the same factor together; "0.0" of none."""
    alike: dict[float, str] = {}
    for factor, name in terms:
        if factor:
            size = float(abs(factor))
            inner = alike.get(size)
            alike[size] = f"{'-' if factor < 0 else ''}{name}" if inner is None else inner + (
                f" {'-' if factor < 0 else '+'} {name}"
            )  # fmt: skip
    each = [inner if size == 1.0 else f"{size!r} * ({inner})" for size, inner in alike.items()]
    return " + ".join(each) if each else "0.0"


def _snapped(values: Vector, scale: float) -> Vector:
    """`values` with those that differ by less than rounding made equal in size, and those near 0 made 0."""
    sizes = np.abs(values).ravel()
    order = np.argsort(sizes)
    kept = 0.0
    for number in order:
        if sizes[number] - kept <= SAME * scale:
            sizes[number] = kept
        else:
            kept = float(sizes[number])
    return np.copysign(sizes.reshape(values.shape), values)


def _opposite(at: Vector) -> dict[int, int]:
    """Number of a point -> number of the one that is opposite to it, for those that have one; shape (n, 3)."""
    where = {tuple(point): k for k, point in enumerate((at + 0.0).tolist())}
    pairs = {k: where.get(tuple(point)) for k, point in enumerate((0.0 - at).tolist())}
    return {k: other for k, other in pairs.items() if other is not None and other != k and pairs.get(other) == k}
