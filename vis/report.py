"""`report.html` of a run folder: one file that opens from disk, without a network or fonts of its own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from vis.page.folder import read_folder
from vis.page.report import Progress
from vis.penetrate.report import write_penetration_report

__all__ = ["write_report"]

#: Experiment -> module and function of its report; `penetrate`'s is that of all others.
_REPORTS = {
    "tumble": ("vis.tumble.report", "write_tumble_report"),
    "tumble spatial": ("vis.spatial.report", "write_spatial_report"),
    "mujoco": ("vis.robot.report", "write_robot_report"),
    "hop": ("vis.paper.hop", "write_hop_report"),
    "paper": ("vis.paper.report", "write_paper_report"),
    "campaign": ("vis.diagnose.campaign", "write_campaign_report"),
    "campaign check": ("vis.diagnose.campaign", "write_inspection_report"),
    "diagnose": ("vis.diagnose.report", "write_diagnosis_report"),
    "bed make": ("vis.bed.report", "write_bed_report"),
    "bed refine": ("vis.bed.report", "write_bed_report"),
    "bed test shear": ("vis.bed.tests", "write_shear_report"),
    "bed test repose": ("vis.bed.tests", "write_test_report"),
    "bed test cone": ("vis.bed.tests", "write_test_report"),
    "bed test plates": ("vis.bed.tests", "write_test_report"),
    "bed test cut": ("vis.bed.tests", "write_test_report"),
    "bed calibrate": ("vis.bed.calibrate", "write_calibration_report"),
    "ground": ("vis.penetrate.groundmap", "write_ground_report"),
    "calibrate": ("vis.penetrate.lawfit", "write_lawfit_report"),
    "converge": ("vis.penetrate.converge", "write_converge_report"),
    "sweep": ("vis.sweep.report", "write_sweep_report"),
    "compare": ("vis.compare.report", "write_compare_report"),
    "validate": ("vis.bed.validation", "write_validation_report"),
}


def write_report(folder: str | Path, *, pictures: bool = True, progress: Progress | None = None) -> Path:
    """Make every plot and picture of a run folder, and its `report.html`.

    Parts that are missing (a run that was stopped, no frames, no OpenGL) are listed in the report.

    ``folder``: The run folder; `figures/`, `animation.gif` and `report.html` are written into it. ``pictures``: Whether
    to draw pictures and the animation; otherwise the report says that they were not asked for. ``progress``: Called
    with the share that is done, 0 to 1. Returns the report. Raises FileNotFoundError: there is no such folder. OSError:
    the folder cannot be written.
    """
    home, name = _REPORTS.get(str(read_folder(folder).result.get("experiment")), ("", ""))
    if home:
        return getattr(import_module(home), name)(folder, progress=progress)
    return write_penetration_report(folder, pictures=pictures, progress=progress)
