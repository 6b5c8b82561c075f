"""`hedgebed render RUN`: the pictures of a finished run once more, off screen, from what its folder holds."""

import json as json_module
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from experiments.runs.folder import RunFolder, read_series
from experiments.runs.kept_results import drawn_from, require_files, require_whole
from experiments.runs.progress import make_progress
from experiments.runs.streams import refusing, say, stdout_to_stderr

__all__ = ["render"]


def render(
    run: Annotated[Path, Parameter(help="Folder of a finished run.")],
    /,
    *,
    colour: Annotated[
        Literal["displacement", "speed", "force", "coordination"],
        Parameter(help="Quantity that colours the grains of a tumble.", negative=""),
    ] = "displacement",
    film: Annotated[bool, Parameter(help="Draw the film of a tumble too.")] = True,
    json: Annotated[bool, Parameter(help="Print the files that were drawn as JSON on stdout.", negative="")] = False,
    quiet: Annotated[bool, Parameter(help="Show no progress.", negative="")] = False,
) -> int:
    """Draw pictures, film and report of a finished run again; of a stopped one of penetrate or mujoco what it has."""
    from vis.pictures.frames import check_frames

    with refusing():
        folder = RunFolder.open(run)
        if folder.command in _CONCLUDED and folder.status not in ("done", None):
            _CONCLUDED[folder.command](folder)
        if not (run / "result.json").exists():
            whole = _NOTHING.get(folder.command, "")
            raise ValueError(
                f"run = {str(run)!r} has no result yet{whole}: `hedgebed resume {run}` finishes it where it can be"
            )
        folder.read_result()
        check_frames(run)
        if folder.command in ("tumble", "tumble spatial"):
            require_files(folder, drawn_from(folder), key="run")
            for name in drawn_from(folder):
                read_series(run / name)
        else:
            require_whole(folder, key="run")
        with folder.lock():
            pass
    begun = _now(folder)
    with folder.lock(), stdout_to_stderr(), make_progress(quiet=quiet) as progress:
        progress.stage("pictures", total=1.0)
        if folder.command == "tumble":
            from vis.tumble.report import write_tumble_report

            report = write_tumble_report(run, pictures=True, colour=colour, film=film, progress=progress.update)
        elif folder.command == "tumble spatial":
            from vis.spatial.report import write_spatial_report

            report = write_spatial_report(run, colour=colour, film=film, progress=progress.update)
        else:
            if colour != "displacement" or not film:
                say(f"colour and film are for runs of tumble; this one is of {folder.command}")
            from vis.report import write_report

            report = write_report(run, progress=progress.update)
    drawn = sorted(path for path in [*run.glob("figures/*.png"), *run.glob("*.gif")] if path.stat().st_mtime >= begun)
    if json:
        print(json_module.dumps({"report": str(report), "pictures": [str(path) for path in drawn]}, indent=2))
    else:
        for path in drawn:
            print(path)
        print(f"report: {report}")
    return 0


def _conclude_stopped(folder: RunFolder) -> None:
    """Write the result of the beds that are whole, of a run of penetrate that was stopped, failed or killed."""
    from experiments.penetrate.settings import say as words
    from experiments.penetrate.whole_beds import result_of_whole_beds

    with folder.lock(), stdout_to_stderr(), make_progress(quiet=True) as progress:
        result = result_of_whole_beds(folder, progress)
    if result is not None:
        whole = len({entry["seed"] for entry in result["runs"]})
        say(f"warning: {words('whole_beds', count=whole, of=len(folder.settings['seeds']))}")


def _conclude_robot(folder: RunFolder) -> None:
    """Write the result of what a run of mujoco has computed that was stopped, failed or killed."""
    from experiments.robot.stopped import result_of_checkpoint

    if folder.status == "stopped" and (folder.path / "result.json").exists():
        return
    with folder.lock(), stdout_to_stderr(), make_progress(quiet=True) as progress:
        result = result_of_checkpoint(folder, progress)
    if result is not None:
        say(f"warning: {result.warnings[0]}")


_CONCLUDED = {"penetrate": _conclude_stopped, "mujoco": _conclude_robot}
_NOTHING = {"penetrate": " (no bed is whole)", "mujoco": " (it has no checkpoint)"}


def _now(folder: RunFolder) -> float:
    """The time [s] by the clock of the folder's file system: what is drawn from here on is not older."""
    lock = folder.path / "lock"
    lock.touch()
    return lock.stat().st_mtime
