"""Maximum a posteriori fits of a tumble model to a campaign, many at once.

Residuals are whitened: divided by the std of the sensor, and the camera's zero, one constant a trial and channel, is
taken out exactly by marginalising it (its covariance s^2 1 1' is part of the noise's). What is left to fit are the
shared numbers with their priors, the parameters of effects, and each trial's error of gravity.

Method: Levenberg-Marquardt on all of it together, Jacobians by finite differences, every step tried at several lengths
at once. Contact makes the likelihood jump where a trial changes its branch (sticks or slips, touches or misses), so a
fit also scans each trial's gravity over its prior, for the branch that was measured, and goes on from there. A fit is a
generator that asks for residuals at a list of points; all fits that are under way are answered by one call of the
batched model.
"""

import itertools
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from experiments.diagnose.fit.fitting import SCAN
from experiments.diagnose.fit.problem import Array, Form, Parameter
from experiments.diagnose.fit.together import each

from .forms import physical_at
from .forward import OWN_TO_A_TRIAL, SHARED, Forward
from .steps import (
    EASY,
    SETTLED,
    Answers,
    Linearised,
    Point,
    Space,
    Start,
    Way,
    is_flat,
    normal_equations,
    steps_to_try,
    whiten,
)

__all__ = ["Fit", "Fitter"]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Where a fit ended."""

    forms: tuple[Form, ...]
    values: dict[str, float]  # shared numbers and effects' parameters
    gravity: Array  # each trial's over its stated one
    cost: float  # sum of squared whitened residuals and of squared prior deviations
    residuals: list[Array] = field(repr=False)  # whitened, one array a trial
    names: tuple[str, ...]  # of the rows of `normal`: the shared ones, then gravity of each trial
    normal: Array = field(repr=False)
    """Normal matrix (half the Hessian of the cost) in units of `scale`, priors included."""
    scale: Array = field(repr=False)
    steps: int = 0

    @property
    def chi_square(self) -> float:
        """Sum of squared whitened residuals."""
        return float(sum(r @ r for r in self.residuals))

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation of every fitted number, from the normal matrix."""
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(self.normal)), 0.0)) * self.scale
        return dict(zip(self.names, spread.tolist(), strict=True))


class Fitter:
    """Fits to one campaign's trials. `trials`: indices of those that take part, all by default."""

    def __init__(self, forward: Forward, *, trials: Sequence[int] | None = None) -> None:
        self.forward = forward
        self.trials = list(range(len(forward.data.trials)) if trials is None else trials)
        told = forward.data.tables.uncertainty
        self.sigma = {name: getattr(told, name) for name in SHARED}
        self.sigma_gravity = told.gravity_sim
        self._places = {trial.id: k for k, trial in enumerate(forward.data.trials)}

    def residuals(self, points: list[Point], forms: Sequence[Form]) -> Answers:
        """Whitened residuals at points of (values, gravity): one array [point_count, sample_count] a trial."""
        return self._answer([(tuple(forms), points, 1.0)])[0]

    def signatures(self, asked: Sequence[tuple[Sequence[Form], Mapping[str, float], Array]]) -> list[Answers]:
        """Whitened residuals, one array a trial, at points with forms of their own: (forms, values, gravity)."""
        answers = self._answer([(tuple(forms), [(values, gravity)], 1.0) for forms, values, gravity in asked])
        return [[rows[0] for rows in answer] for answer in answers]

    def linearised(self, start: Start) -> Linearised:
        """The model about a start."""
        space = self._space(start)
        way = self._way(space, start)
        u = way.begin()
        residuals = [r[0] for r in self._answer([(start.forms, [way.point(u)], 1.0)])[0]]
        walk = self._jacobian(u, residuals, way, 1.0)
        points, horizon = next(walk)
        try:
            walk.send(self._answer([(start.forms, points, horizon)])[0])
        except StopIteration as end:
            jacobian = end.value
        normal, slope = normal_equations(jacobian, residuals, u, space)
        return Linearised(residuals, jacobian, normal, slope, space)

    def fit(self, starts: Sequence[Start], *, steps: int = 25) -> list[Fit]:
        """Carry out all fits together."""
        running = {k: self._descend(start, steps) for k, start in enumerate(starts)}
        done: dict[int, Fit] = {}
        asked = {k: next(generator) for k, generator in running.items()}
        while asked:
            keys = list(asked)
            answers = self._answer([(starts[k].forms, *asked[k]) for k in keys])
            asked = {}
            for k, answer in zip(keys, answers, strict=True):
                try:
                    asked[k] = running[k].send(answer)
                except StopIteration as end:
                    done[k] = end.value
        return [done[k] for k in range(len(starts))]

    def _answer(self, asked: list[tuple[tuple[Form, ...], list[Point], float]]) -> list[Answers]:
        """Residuals for several lists of points, by one call of the model for each horizon."""
        answers: dict[int, Answers] = {}
        for horizon in dict.fromkeys(horizon for _, _, horizon in asked):
            mine = [k for k, (_, _, own) in enumerate(asked) if own == horizon]
            for k, answer in zip(mine, self._together([asked[k][:2] for k in mine], horizon), strict=True):
                answers[k] = answer
        return [answers[k] for k in range(len(asked))]

    def _together(self, asked: list[tuple[tuple[Form, ...], list[Point]]], horizon: float) -> list[Answers]:
        """The same for one horizon."""
        total = sum(len(points) for _, points in asked)
        columns = {name: np.full(total, value) for name, value in self.forward.nominal.items()}
        gravity = np.ones((total, len(self.forward.data.trials)))
        apart = {kind: np.ones_like(gravity) for kind in OWN_TO_A_TRIAL[1:]}
        at = 0
        for forms, points in asked:
            rows = slice(at, at + len(points))
            for name in SHARED:
                columns[name][rows] = [values.get(name, self.forward.nominal[name]) for values, _ in points]
            gravity[rows] = [relative for _, relative in points]
            for name in (name for name in points[0][0] if name.endswith("]")):
                kind, _, id = name[:-1].partition("[")
                if kind in apart:
                    apart[kind][rows, self._places[id]] = [1 + values[name] for values, _ in points]
            for form in forms:
                for name, array in physical_at(form, [values for values, _ in points]).items():
                    columns.setdefault(name, np.full(total, self.forward.neutral(name)))[rows] = array
            at += len(points)
        predictions = self.forward.predict(
            columns | apart | {"gravity": gravity}, trials=self.trials, states=False, horizon=horizon
        )

        edges = np.cumsum([0, *(len(points) for _, points in asked)]).tolist()

        def whitened(place: int) -> list[Array]:
            data = self.forward.data.trials[self.trials[place]]
            rows = whiten(data, predictions[place].value, until=np.inf if horizon >= 1 else horizon * data.end)
            return [rows[low:high].copy() for low, high in itertools.pairwise(edges)]  # a fit keeps no other's

        residuals = each(whitened, range(len(self.trials)), threads=self.forward.threads)
        return [list(own) for own in zip(*residuals, strict=True)]

    def _way(self, space: Space, start: Start) -> Way:
        return Way(space, start, self.trials, len(self.forward.data.trials), self.sigma_gravity)

    def _space(self, start: Start) -> Space:
        def stated(name: str, value: float, sigma: float) -> tuple[str, float, float, float, float, float, float]:
            return name, value, sigma * value, 1.0, max(-6.0, -0.95 / sigma), 6.0, 0.02

        def fitted(p: Parameter) -> tuple[str, float, float, float, float, float, float]:
            low, high = (p.lowest - p.value) / p.scale, (p.highest - p.value) / p.scale
            return p.name, p.value, p.scale, p.std / p.scale, low, high, (p.step or 1e-2) / p.scale

        shared = [(name, self.forward.nominal[name], self.sigma[name]) for name in SHARED if name not in start.frozen]
        rows = [stated(name, value, sigma) for name, value, sigma in shared if sigma > 0 and value > 0]
        rows += [fitted(p) for form in start.forms for p in form.parameters if p.name not in start.frozen]
        gravities = len(self.trials) if self.sigma_gravity > 0 else 0
        ids = [self.forward.data.trials[trial].id for trial in self.trials]
        rows += [stated(f"gravity_sim[{id}]", 1.0, self.sigma_gravity) for id in ids[:gravities]]
        kinds = list(dict.fromkeys(p.kind for p in start.apart))
        own = {(p.kind, p.trial): p for p in start.apart}
        rows += [fitted(own[kind, id]) for kind in kinds for id in ids]
        table = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 6)
        names = tuple(row[0] for row in rows)
        value, scale, std, low, high, step = table.T
        return Space(names, value, scale, std, low, high, step, gravities, len(self.trials), len(kinds))

    def _descend(self, start: Start, steps: int) -> Generator[tuple[list[Point], float], Answers, Fit]:
        space = self._space(start)
        way = self._way(space, start)
        u = way.begin()
        taken, normal = 0, np.eye(len(u))
        residuals: list[Array] = []
        for number, horizon in enumerate(start.horizons):
            answer = yield [way.point(u)], horizon
            residuals, cost = [r[0] for r in answer], way.price(answer, 0, u)
            if space.blocks() and (number or start.scan):
                u, residuals, cost = yield from self._scan(u, residuals, cost, way, horizon)
            damping, scanned = 0.0, False
            for _ in range(steps if horizon >= 1 else max(4, steps // 3)):
                taken += 1
                jacobian = yield from self._jacobian(u, residuals, way, horizon)
                normal, slope = normal_equations(jacobian, residuals, u, space)
                tried = steps_to_try(normal, slope, u, space, damping)
                answer = yield [way.point(v) for v in tried], horizon
                prices = [way.price(answer, row, v) for row, v in enumerate(tried)]
                best = int(np.argmin(prices))
                gain = cost - prices[best]
                if gain > 0:
                    u, cost, residuals = tried[best], prices[best], [r[best] for r in answer]
                    damping = 0.0 if best < EASY else 1.0
                if gain > (SETTLED if horizon >= 1 else 1e-3 * cost):
                    continue
                if gain <= 0 and damping < 1e3 and not is_flat(normal, slope):
                    damping = max(1e3, 10 * damping)
                    continue
                seen = sum(int(np.count_nonzero(r)) for r in residuals)
                if space.blocks() and not scanned and horizon >= 1 and cost > 1.1 * seen:
                    scanned, before = True, cost
                    u, residuals, cost = yield from self._scan(u, residuals, cost, way, horizon)
                    if before - cost > 1.0:
                        damping = 0.0
                        continue
                break
        values, gravity = way.point(u)
        return Fit(
            forms=start.forms, values=dict(self.forward.nominal) | dict(values), gravity=gravity, cost=cost,
            residuals=residuals, names=space.names, normal=normal, scale=space.scale, steps=taken,
        )  # fmt: skip

    def _scan(
        self, u: Array, residuals: list[Array], cost: float, way: Way, horizon: float
    ) -> Generator[tuple[list[Point], float], Answers, tuple[Array, list[Array], float]]:
        """The best gravity of each trial on a grid over its prior, then the best of what else is its own."""
        u, residuals = u.copy(), list(residuals)
        for block in way.space.blocks():
            std = way.space.std[block.start]
            points = []
            for z in SCAN:
                v = u.copy()
                v[block] = np.clip(z * std, way.space.low[block], way.space.high[block])
                points.append(way.point(v))
            answer = yield points, horizon
            for k, rows in enumerate(answer):
                here = block.start + k
                tried = np.clip(SCAN * std, way.space.low[here], way.space.high[here])
                now = float(residuals[k] @ residuals[k]) + (u[here] / std) ** 2
                prices = np.einsum("ij,ij->i", rows, rows) + (tried / std) ** 2
                best = int(np.argmin(prices))
                if prices[best] < now:
                    cost -= now - float(prices[best])
                    u[here], residuals[k] = tried[best], rows[best]
        return u, residuals, cost

    def _jacobian(
        self, u: Array, residuals: list[Array], way: Way, horizon: float
    ) -> Generator[tuple[list[Point], float], Answers, list[Array]]:
        """d residual / d u, one array [shared + own, sample_count] a trial: the shared ones, then what is its own."""
        space, shared = way.space, way.space.shared
        steps, points = [], []
        for k in range(shared):
            step = space.step[k] if u[k] + space.step[k] <= space.high[k] else -space.step[k]
            v = u.copy()
            v[k] += step
            steps.append(step)
            points.append(way.point(v))
        for block in space.blocks():
            v = u.copy()
            v[block] += space.step[block]
            steps.append(float(space.step[block.start]))
            points.append(way.point(v))
        answer = yield points, horizon
        inverse = 1 / np.array(steps)
        return [(rows - now) * inverse[:, None] for rows, now in zip(answer, residuals, strict=True)]
