"""Settings of `hedgebed validate`."""

from pydantic import Field

from experiments.runs.strict import StrictSettings

__all__ = ["ValidateSettings"]


class ValidateSettings(StrictSettings):
    """Which cases of the verification suite are run, and where the table goes."""

    only: tuple[str, ...] = Field((), description="Cases to run, by their ids; all of them if none is given.")
    quick: bool = Field(False, description="Leave out the slow cases.")
    measured: bool = Field(False, description="Only the cases that hold the bed against measured experiments.")
    keep: bool = False
    """In a checkout, put the cases that are run into docs/validation.md, whose other rows stay as they are; what it is
    made of is in docs/results/validate/result.json."""
    document: str | None = None
    """Markdown file for the table; a checkout's docs/validation.md if not given and everything is run. The run folder
    has a copy in any case."""
