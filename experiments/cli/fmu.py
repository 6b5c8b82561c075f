"""``hedgebed fmu FILE``: write platform, rig and ground as an FMU for another simulation program."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from experiments.cli.options import as_typed, option_of, with_parameters
from experiments.fmu.settings import OUTPUTS, FmuSettings
from experiments.runs.reading import Layer, settings_from
from experiments.runs.streams import refusing, say, stdout_to_stderr

__all__ = ["VARIABLES", "fmu_command"]

VARIABLES = "\n\n".join([
    "Inputs: torque of the motor on the platform [N m], clockwise; brake [N m], its largest torque, 0 or more.",
    "Outputs:",
    *(f"{name} [{unit.replace('.', ' ')}]: {text}." for name, (unit, text) in OUTPUTS.items()),
    "normal_force[1] and so on [N]: Normal force on each row of spikes, likewise.",
])  # fmt: skip
"""The variables of the FMU that are no options, for ``hedgebed fmu --help``."""


def fmu_command() -> Callable[..., int]:
    """The function behind ``hedgebed fmu``, with one parameter for each setting."""
    fields = FmuSettings.model_fields

    def command(file: Path, **given: Any) -> int:
        with refusing():
            settings = settings_from(FmuSettings, [Layer(None, as_typed(given, fields))])
            with stdout_to_stderr():
                from experiments.fmu.build import build_fmu, check_fmu

                _, warnings = check_fmu(file, settings)
                for warning in warnings:
                    say(f"warning: {warning}")
                build_fmu(file, settings)
        print(f"fmu: {file}")
        return 0

    command.__name__ = "fmu"
    about = Annotated[Path, Parameter(help="The file to write, such as hedgehog.fmu; must be new.", negative="")]
    first = inspect.Parameter("file", inspect.Parameter.POSITIONAL_ONLY, annotation=about)
    return with_parameters(command, [first, *(option_of(name, field) for name, field in fields.items())])
