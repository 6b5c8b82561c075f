"""Settings of `hedgebed validate`."""

from pydantic import Field

from experiments.runs.strict import Scheduler, StrictSettings, Workers

__all__ = ["ValidateSettings"]


class ValidateSettings(StrictSettings):
    """Which cases of the verification suite are run, and where the table goes."""

    only: tuple[str, ...] = Field((), description="Names of the cases to run; all if not given.")
    quick: bool = Field(False, description="Skip the slow cases.")
    measured: bool = Field(False, description="Run only the cases that compare the bed with measured experiments.")
    keep: bool = False
    """In a checkout: replace these cases in docs/validation.md and docs/results/validate/result.json, and keep the
    others."""
    document: str | None = None
    """Markdown file for the table. If not given and all cases are run in a checkout: docs/validation.md. The folder of
    the run always has a copy."""
    workers: Workers = None
    scheduler: Scheduler = None
