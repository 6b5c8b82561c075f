"""The report of a run folder, whatever the experiment: `vis.write_report` knows each."""

from __future__ import annotations

from pathlib import Path

from .progress import Progress

__all__ = ["write_report"]


def write_report(folder: Path, progress: Progress) -> None:
    """Figures, pictures and report.html of a run folder."""
    from vis.report import write_report as write

    write(folder, progress=progress.update)
