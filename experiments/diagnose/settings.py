"""Settings of `hedgebed diagnose` and `hedgebed campaign check`."""

from pydantic import Field

from experiments.runs.strict import StrictSettings

__all__ = ["CheckSettings", "DiagnoseSettings"]


class DiagnoseSettings(StrictSettings):
    """What is diagnosed, and how much time that may take."""

    campaign: str = Field(min_length=1, description="Folder of the measured trials, with campaign.toml.")
    thorough: bool = False
    """Calibrate the gate by full refits to made-up data; kept for campaigns of the same design."""
    effect_file: tuple[str, ...] = Field((), json_schema_extra={"option_alias": "--effects-from"})
    """Python file with an effect of one's own, to stand among the candidates; several may be given."""
    seed: int = Field(0, ge=0, description="Seed of the made-up data by which the gate is calibrated.")


class CheckSettings(StrictSettings):
    """What is checked."""

    campaign: str = Field(min_length=1, description="Folder of the trials, with campaign.toml.")
