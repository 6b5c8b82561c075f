"""`report.html` of a run folder: one file that opens from disk, without a network, scripts or fonts of its own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from vis.page.folder import RunFolder, from_python, read_folder
from vis.page.page import Block, figure, write_template
from vis.page.report import Progress
from vis.penetrate.amended import is_amended
from vis.penetrate.plots import make_plots
from vis.penetrate.summary import summarise
from vis.pictures.pictures import Picture, Pictures, make_pictures

__all__ = ["write_report"]

#: Plot -> the kind of run it is of.
_NEEDS = {"Drag against depth": "driven", "Work in and out": "driven", "Set down under its load": "set_down"}
_NEEDS |= {"Drops": "drop", "Peaks of the drops": "drop"}
#: Experiment -> module and function of its own report.
_OTHERS = {
    "tumble": ("vis.tumble.report", "write_tumble_report"),
    "tumble spatial": ("vis.spatial.report", "write_spatial_report"),
    "hop": ("vis.paper.hop", "write_hop_report"),
    "paper": ("vis.paper.report", "write_paper_report"),
    "campaign": ("vis.diagnose.campaign", "write_campaign_report"),
    "campaign check": ("vis.diagnose.inspection", "write_inspection_report"),
    "diagnose": ("vis.diagnose.report", "write_diagnosis_report"),
    "bed make": ("vis.bed.report", "write_bed_report"),
    "bed refine": ("vis.bed.report", "write_bed_report"),
    "bed test shear": ("vis.bed.tests", "write_shear_report"),
    "bed test repose": ("vis.bed.tests", "write_test_report"),
    "bed test cone": ("vis.bed.tests", "write_test_report"),
    "bed test cut": ("vis.bed.tests", "write_test_report"),
    "bed calibrate": ("vis.bed.calibrate", "write_calibration_report"),
    "compare": ("vis.compare.report", "write_compare_report"),
    "validate": ("vis.bed.validation", "write_validation_report"),
}


def write_report(folder: str | Path, *, pictures: bool = True, progress: Progress | None = None) -> Path:
    """Make every plot and picture of a run folder, and its `report.html`.

    Parts that are missing (a run that was stopped, no frames, no OpenGL) are said in the report.

    ``folder``: The run folder; `figures/`, `animation.gif` and `report.html` are written into it. ``pictures``: Whether
    to draw pictures and the animation; otherwise the report says that they were not asked for. ``progress``: Called
    with the share that is done, 0 to 1. Returns the report. Raises FileNotFoundError: there is no such folder. OSError:
    the folder cannot be written.
    """
    tell = progress if progress is not None else lambda done: None
    run = read_folder(folder)
    home, name = _OTHERS.get(str(run.result.get("experiment")), ("", ""))
    if run.result.get("ground") == "spring-damper" and is_amended(run):
        home, name = "vis.penetrate.amended", "write_amended_report"
    if home:
        return getattr(import_module(home), name)(folder, progress=progress)
    plots, undrawn = make_plots(run)
    tell(0.1)
    drawn = Pictures(notes=["Pictures were not asked for."])
    if pictures:
        try:
            drawn = make_pictures(run.path, progress=lambda done: tell(0.1 + 0.85 * done))
        except (ValueError, KeyError, IndexError, OSError) as error:
            drawn = Pictures(notes=[f"Pictures could not be drawn ({type(error).__name__}: {error})."])
    context = summarise(run)
    context["missing"] = [*context["missing"], *(text for text in undrawn if _asked_for(run, text))]
    context["plots"] = {plot.name: figure(path, title=plot.title, caption=plot.caption) for plot, path in plots}
    context["pictures"] = [_picture(picture) for picture in drawn.stills if picture.file.exists()]
    context["animation"] = _picture(drawn.animation) if drawn.animation and drawn.animation.file.exists() else None
    context |= {"method": drawn.method, "picture_notes": drawn.notes}
    report = write_template(run.path / "report.html", "report.html", **context)
    tell(1.0)
    return report


def _asked_for(run: RunFolder, undrawn: str) -> bool:
    """Whether what could not be drawn for want of data was part of this run at all."""
    what, _, why = undrawn.partition(": ")
    if why != "no data." or not run.runs:
        return True
    return not from_python(run) and (what not in _NEEDS or bool(run.of_kind(_NEEDS[what])))


def _picture(picture: Picture) -> Block:
    """The picture for the page, small; stills stay in the folder as PNG."""
    return figure(picture.file, title=picture.title, caption=picture.caption, show_file=True, small=True)
