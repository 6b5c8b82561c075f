"""Whether a run folder still holds what its pictures and curves are made of: a kept result does not."""

from collections.abc import Iterable

from .folder import RunFolder

__all__ = ["PATH_AND_MOTION", "drawn_from", "require_files", "require_whole"]

PATH_AND_MOTION = ("trajectory.csv", "series/motion.csv")  # What every run of a platform has written


def drawn_from(folder: RunFolder) -> list[str]:
    """The files that the report of a finished run of a platform is drawn from, relative to its folder."""
    try:
        result = folder.read_result()
    except (OSError, ValueError):
        return list(PATH_AND_MOTION)
    grains, sweep = result.get("grains") or {}, result.get("sweep") or {}
    return [*dict.fromkeys([*PATH_AND_MOTION, *grains.get("series", {}).values(), *filter(None, [sweep.get("file")])])]


def require_files(folder: RunFolder, names: Iterable[str], *, key: str) -> None:
    """Raise ValueError, naming `key`, what is missing and what computes it again, unless the folder has them all."""
    missing = [name for name in names if not (folder.path / name).is_file()]
    if not missing:
        return
    there = [name for name in ("run.toml", "result.json", "trajectory.csv") if (folder.path / name).is_file()]
    kept = "" if (folder.path / "series").is_dir() else f"; a kept result holds {', '.join(there)} alone"
    raise ValueError(
        f"{key} = {str(folder.path)!r} has no {', '.join(missing)}{kept}: "
        f"`hedgebed {folder.command} {folder.path / 'run.toml'}` computes it again"
    )


def require_whole(folder: RunFolder, *, key: str) -> None:
    """Raise ValueError for a kept result: no status.json, and no series to draw; nothing is to be written into it."""
    if folder.status is None and not (folder.path / "series").is_dir():
        there = sorted(path.name for path in folder.path.iterdir() if path.is_file())
        raise ValueError(
            f"{key} = {str(folder.path)!r} is a kept result, {', '.join(there)} alone, of which there is nothing to "
            f"draw: `hedgebed {folder.command} {folder.path / 'run.toml'}` computes it again"
        )
