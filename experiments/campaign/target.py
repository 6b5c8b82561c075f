"""The folder that a campaign is written into: refused where it is in use, kept where the campaign is there already."""

from pathlib import Path

import numpy as np

from .files import Campaign, read_campaign, write_campaign

__all__ = ["check_target", "place_campaign"]


def check_target(target: str | Path, *, keep_out: Path | None = None) -> Path:
    """The folder to write a campaign into. Raises ValueError where it is in use, or is, or lies around, `keep_out`."""
    path = Path(target)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise ValueError(f"campaign = {str(path)!r} is in use: a folder that is empty or does not exist yet would do")
    if keep_out is not None and keep_out.resolve().is_relative_to(path.resolve()):
        raise ValueError(
            f"campaign = {str(path)!r} holds the run's own folder {str(keep_out)!r}, where the truth is kept: another "
            f"folder would do"
        )
    return path


def place_campaign(target: str | Path, campaign: Campaign, *, keep_out: Path | None = None) -> Path:
    """Write `campaign` to `target`, unless just that is there already (of a run that is resumed); return the folder.

    Raises ValueError as `check_target` does, where something else is there.
    """
    path = Path(target)
    try:
        there: Campaign | None = read_campaign(path)
    except ValueError:
        there = None
    if there is None or not _same(there, campaign):
        write_campaign(check_target(path, keep_out=keep_out), campaign)
    return path


def _same(one: Campaign, other: Campaign) -> bool:
    alike = one.tables == other.tables and one.recordings.keys() == other.recordings.keys()
    return alike and all(
        np.array_equal(one.recordings[key][name], recording[name], equal_nan=True)
        for key, recording in other.recordings.items()
        for name in recording.columns
    )
