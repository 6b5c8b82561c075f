"""How an FMU is made: `build_fmu` writes the file, with the settings in it and the files that they name."""

import json
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.platform.ground_file import fitted_ground, naming_gravity
from experiments.runs.version import __version__

from . import say
from .driven import DrivenPlatform
from .settings import FmuSettings

__all__ = ["build_fmu", "check_fmu"]

ENTRY = Path(__file__).parent / "hedgebed_platform_fmu.py"


def check_fmu(file: str | Path, settings: FmuSettings) -> tuple[int, tuple[str, ...]]:
    """How many rows of spikes the platform has, and the warnings about its numbers.

    Raises ValueError, naming the file or the setting, for a file that cannot be written and a platform that cannot be
    simulated.
    """
    path = Path(file)
    if not re.fullmatch(r"[A-Za-z_]\w*\.fmu", path.name, flags=re.ASCII):
        raise ValueError(say("bad_name", file=str(file)))
    if not path.absolute().parent.is_dir():
        raise ValueError(say("no_folder", file=str(file), folder=str(path.parent)))
    if path.exists():
        raise ValueError(say("exists", file=str(file)))
    plan = _slave().plan_platform(settings)
    with naming_gravity(plan.fitted, plan.trial):
        DrivenPlatform(plan.trial, longest_step=settings.longest_step)
    return plan.trial.spike_count, plan.warnings


def build_fmu(file: str | Path, settings: FmuSettings) -> Path:
    """Write the FMU of `settings` to `file`, whose name ends in .fmu; the file appears when it is complete.

    Raises ValueError as `check_fmu` does, and where pythonfmu3 is not installed.
    """
    path = Path(file)
    rows, _ = check_fmu(path, settings)
    from pythonfmu3.builder import FmuBuilder

    with tempfile.TemporaryDirectory(dir=path.absolute().parent, prefix=f".{path.stem}-") as folder:
        given, files = _with_files(settings, Path(folder))
        made = Path(folder) / _slave().MADE_OF
        content = {"name": path.stem, "version": __version__, "rows": rows, "settings": given}
        made.write_text(json.dumps(content, indent=1), encoding="utf-8")
        options = {"canGetAndSetFMUState": True, "canSerializeFMUState": True}
        options["canHandleVariableCommunicationStepSize"] = True  # pythonfmu3 0.3.4 writes false if not told
        built = FmuBuilder.build_FMU(ENTRY, dest=Path(folder) / "built", project_files=[made, *files], **options)
        built.replace(path)
    return path


def _with_files(settings: FmuSettings, folder: Path) -> tuple[Mapping[str, Any], list[Path]]:
    """What was given, files by the names of their copies; the copies in `folder`."""
    given, files = settings.model_dump(exclude_unset=True), []
    named = {"platform": Path(settings.platform)}
    if fitted_ground(settings.ground) is not None:
        named["ground"] = Path(settings.ground)
    for key, source in named.items():
        if source.is_file():
            copy = folder / f"{key}.toml"
            shutil.copyfile(source, copy)
            given[key] = copy.name
            files.append(copy)
    return given, files


def _slave() -> Any:
    """The module of the FMU's side. Raises ValueError where pythonfmu3 is not installed."""
    try:
        from . import slave
    except ModuleNotFoundError as error:
        if error.name != "pythonfmu3":
            raise
        raise ValueError(say("no_library")) from None
    return slave
