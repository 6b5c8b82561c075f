"""Finished runs of a spike as rows of a run folder, written and read back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coupling import Penetration

from .runfolder import RunFolder

__all__ = ["read_run", "write_run"]


def write_run(folder: RunFolder, name: str, series: Penetration) -> None:
    """Keep a run's rows in series/<name>.csv."""
    folder.write_series(
        name,
        {
            "t_s": series.time,
            "depth_m": series.depth,
            "velocity_m_s": series.velocity,
            "force_N": series.force,
            "phase": series.phase,
        },
    )


def read_run(folder: RunFolder, name: str, note: Mapping[str, Any]) -> Penetration:
    """A finished run, from its rows and from what was noted of it, to the bit."""
    columns = folder.read_series(name)
    return Penetration(
        kind=note["kind"],
        time=columns["t_s"],
        depth=columns["depth_m"],
        velocity=columns["velocity_m_s"],
        force=columns["force_N"],
        phase=columns["phase"],
        macro_step=note["macro_step"],
        ended=note["ended"],
        settings=dict(note["settings"]),
    )
