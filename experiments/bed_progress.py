"""How the preparation of a bed shows in the experiment that wants it."""

from __future__ import annotations

from collections.abc import Callable

from .progress import Progress

__all__ = ["BedProgress"]


class BedProgress:
    """Shows the stages of a preparation as one stage of the experiment; stops it where it can be gone on with."""

    PARTS = ("rain", "settle", "tap")

    def __init__(self, progress: Progress, name: str, asked_to_stop: Callable[[], bool]) -> None:
        self.progress, self.asked_to_stop, self.part = progress, asked_to_stop, 0
        progress.stage(name, total=2.0)

    def stage(self, name: str, total: float | None = None) -> None:
        """The next part begins; what is no part of its own, as loosening, counts with the one under way."""
        self.part = min(self.PARTS.index(name), 1) if name in self.PARTS else self.part
        self.progress.update(self.part)

    def update(self, done: float) -> None:
        """`done` of this part, 0 to 1. Raises KeyboardInterrupt if asked to stop."""
        self.progress.update(self.part + min(1.0, max(0.0, done)))
        if self.asked_to_stop():
            raise KeyboardInterrupt
