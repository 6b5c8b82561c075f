"""From the finished runs of a folder to the result of penetrate: the fit, the same runs on the law, what departs."""

from dataclasses import asdict
from pathlib import Path

from coupling import Penetration
from dem.grains.materials import caveat
from experiments.grains.softening import Softening
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result
from experiments.runs.types import Json

from . import beds
from .amended_runs import kept_law, run_beside
from .findings import BedFacts, Findings, bed_entry, bed_quantities
from .reference import compare_with, read_reference
from .remarks import departures_in_words, overlap_warning, warnings_of
from .settings import PenetrateSettings
from .units import Unit, make_spike

__all__ = ["SHIPPED_RESULT", "conclude"]

SHIPPED_RESULT = Path(__file__).parents[2] / "docs" / "results" / "penetrate" / "result.json"
"""The result of the case that ships, in a checkout."""


def conclude(
    settings: PenetrateSettings, units: list[Unit], softening: Softening, folder: RunFolder, progress: Progress
) -> Result:
    """Fit, make the same runs on the law, compare; write the law's series; return the result."""
    progress.stage("spring-damper", total=1.0)
    notes = {unit.id: folder.done_data(unit.id) for unit in units}
    runs = {name: Penetration.from_columns(folder.read_series(name), note) for name, note in notes.items()}
    facts = [BedFacts(**folder.done_data(f"bed-{seed}")) for seed in settings.seeds]
    material = beds.find_material(settings)
    findings = Findings(settings, units, runs, facts[0].time_step)
    for name, series in findings.models.items():
        folder.write_series(f"{name}.model", series.columns())
    overlap = max((note["max_overlap"] for note in notes.values() if note.get("max_overlap") is not None), default=None)
    quantities = findings.quantities() | bed_quantities(facts, overlap)
    codes = ({note.get("code") for note in notes.values()} | {folder.code}) - {None, ""}
    doubts = {
        "fewer than three seeds: the spread between beds is not known well": len(settings.seeds) < 3,
        "parts of this run were computed by different versions of the code: it may not repeat to the bit":
            len(codes) > 1,
    }  # fmt: skip
    found = [
        overlap_warning(overlap, settings, softening),
        caveat(material),
        *(text for text in doubts if doubts[text]),
    ]
    warnings = [*warnings_of(findings), *filter(None, found)]
    departures = departures_in_words(findings)
    entries = findings.run_entries(notes)
    law = kept_law(settings, folder.path)
    if law is not None:
        beside = run_beside(law, units, runs, findings.models, folder)
        quantities |= beside.quantities
        warnings += law.warnings()
        departures["sentences"] = [*departures["sentences"], *beside.sentences]
        entries = beside.entries(entries)
    result: Json = {
        "code": codes.pop() if len(codes) == 1 else beds.fingerprint(),
        "title": f"A {1e3 * settings.tip_diameter:g} mm spike in {material.name}",
        "status": "done",
        "quantities": quantities,
        "runs": entries,
        "fits": findings.fit_entries(),
        "departures": departures,
        "bed": bed_entry(facts, settings, softening) | {"material": material.name},
        "spike": asdict(make_spike(settings)) | {"load": settings.weight},
        "warnings": warnings,
    }
    if law is not None:
        result["model"] = {"file": settings.model, "effects": list(law.effects)}
    _compare(settings, result)
    return Result.make("penetrate", **result)


def _compare(settings: PenetrateSettings, result: Json) -> None:
    """Add the entry "reference" to the result, and what it says, where there is something to compare with."""
    reference, warnings, departures = settings.reference, result["warnings"], result["departures"]
    if reference is None:
        return
    if reference == "shipped" and not SHIPPED_RESULT.exists():
        warnings.append("the result of the shipped case is not here (docs/results of a checkout): nothing compared")
        return
    try:
        entry, said = compare_with(read_reference(SHIPPED_RESULT if reference == "shipped" else reference), result)
    except ValueError as error:  # it was there before the first run
        warnings.append(f"{error}; nothing compared")
        return
    result["reference"] = {"file": reference, **entry}
    departures["sentences"] = [*departures["sentences"], *(f"Against the reference, {text}" for text in said)]
    if not entry["moved"]:
        warnings.append(f"reference = {reference!r} has no run of a kind and speed made here too")
