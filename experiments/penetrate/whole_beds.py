"""The result of a run that was stopped, or whose process was killed: of the beds all whose runs are finished."""

from experiments.grains.kept_material import MATERIAL_COPY
from experiments.runs.folder import RunFolder
from experiments.runs.progress import Progress
from experiments.runs.result import Result

from . import beds
from .rest import made_units
from .result import conclude
from .settings import PenetrateSettings
from .units import plan_units

__all__ = ["keep_whole_beds", "missing_beds", "missing_name", "result_of_whole_beds"]


def missing_name(seed: int) -> str:
    """The name under which a folder keeps why the bed of a seed could not be prepared."""
    return f"missing-{seed}"


def missing_beds(settings: PenetrateSettings, folder: RunFolder) -> dict[int, str]:
    """Seed -> why its bed could not be prepared, of those so far."""
    notes = {seed: folder.noted(missing_name(seed), None) for seed in settings.seeds}
    return {seed: str(note) for seed, note in notes.items() if note is not None}


def keep_whole_beds(settings: PenetrateSettings, folder: RunFolder, progress: Progress) -> Result | None:
    """Write the result of the whole beds, with the status "stopped" and how many they are; None where none is whole.

    What a resumed run goes on from stays as it is. Its own result replaces this one.
    """
    units = made_units(settings, plan_units(settings))
    missing = missing_beds(settings, folder)
    begun = [seed for seed in settings.seeds if seed not in missing and folder.is_done(f"bed-{seed}")]
    whole = [seed for seed in begun if all(folder.is_done(unit.id) for unit in units if unit.seed == seed)]
    if not whole:
        return None
    part = settings.model_copy(update={"seeds": tuple(seed for seed in settings.seeds if seed in {*whole, *missing})})
    kept = [unit for unit in units if unit.seed in whole]
    softening = beds.choose_softness(settings)
    result = conclude(part, kept, softening, folder, progress, missing=missing, stopped_of=len(settings.seeds))
    folder.write_result(result)
    return result


def result_of_whole_beds(folder: RunFolder, progress: Progress) -> Result | None:
    """As `keep_whole_beds`, of a folder whose run has ended before its end; None where it is not on beds of grains."""
    copy = folder.path / MATERIAL_COPY
    own = {"material": str(copy)} if copy.is_file() else {}
    settings = PenetrateSettings(**(folder.settings | own))
    return keep_whole_beds(settings, folder, progress) if settings.on_grains else None
