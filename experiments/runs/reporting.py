"""The report of a run folder, whatever the experiment: `vis.write_report` knows each."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from .progress import Progress

__all__ = ["PictureCosts", "write_report"]

# What the report of `penetrate` takes with OpenGL in software on two cores [s], by the files' times of two runs, of
# 20,187 grains and 112 frames and of 51,850 grains and 190 frames.
_PLOTS, _WRITTEN = 2.0, 0.5
_STARTED, _READ = 3.5, 2.5e-6  # before the first picture; a grain of a frame that is looked through
_STILL, _STILL_GRAIN = 0.9, 5.4e-5
_FILM, _FILM_GRAIN = 0.06, 1.4e-5  # a frame of the animation
_MOST_FRAMES = 48  # of an animation (vis.pictures.pictures)
# Where `vis.report` tells that the plots and the pictures are done, and a still counts so many frames.
_TOLD_PLOTS, _TOLD_PICTURES, _TOLD_STILL = 0.1, 0.95, 4


@dataclass(frozen=True)
class PictureCosts:
    """What a report of `penetrate` costs: `frames` of each run that is shown (id -> how many), of so many `grains`."""

    frames: Mapping[str, int]
    grains: float

    @property
    def _stills(self) -> int:
        """Three of the first drive, one of each other run (vis.pictures.pictures)."""
        return sum(3 if "driven" in name else 1 for name in self.frames)

    @property
    def _animated(self) -> int:
        return min(_MOST_FRAMES, next(iter(self.frames.values()), 0))

    def _parts(self) -> list[tuple[float, float]]:
        """Parts of the work in their order: the share that the report tells at the end of each, and its time [s]."""
        if not self.frames:
            return [(_TOLD_PLOTS, _PLOTS), (1.0, _WRITTEN)]
        still, moving = _STILL + _STILL_GRAIN * self.grains, _FILM + _FILM_GRAIN * self.grains
        opened = _STARTED + _READ * self.grains * sum(self.frames.values())
        counted = (_TOLD_PICTURES - _TOLD_PLOTS) / (_TOLD_STILL * self._stills + self._animated)
        first, stills = (_TOLD_PLOTS + counted * _TOLD_STILL * count for count in (1, self._stills))
        return [
            (_TOLD_PLOTS, _PLOTS),
            (first, opened + still),
            (stills, still * (self._stills - 1)),
            (_TOLD_PICTURES, moving * self._animated),
            (1.0, _WRITTEN),
        ]

    @property
    def seconds(self) -> float:
        """About how long it takes [s]."""
        return sum(time for _, time in self._parts())

    def share(self, told: float) -> float:
        """Share of the time that is over when the report tells `told` [1]."""
        parts = self._parts()
        over = 0.0
        for (before, _), (after, time) in pairwise([(0.0, 0.0), *parts]):
            over += time * min(1.0, max(0.0, (told - before) / (after - before))) if after > before else 0.0
        return over / self.seconds


def write_report(folder: Path, progress: Progress, costs: PictureCosts | None = None) -> None:
    """Figures, pictures and report.html of a run folder; `costs` tell what share of the time each is."""
    from vis.report import write_report as write

    write(folder, progress=progress.update if costs is None else lambda told: progress.update(costs.share(told)))
