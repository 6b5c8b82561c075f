"""Settings of `hedgebed diagnose` and `hedgebed campaign check`."""

from pydantic import Field

from experiments.runs.strict import StrictSettings

__all__ = ["CheckSettings", "DiagnoseSettings"]


class DiagnoseSettings(StrictSettings):
    """What is diagnosed, and how much time that may take."""

    campaign: str = Field(
        min_length=1, description="Folder of trials with campaign.toml, or the name of one that ships."
    )
    thorough: bool = False
    """Calibrate the test for a missing effect with full refits of simulated campaigns (slow; kept for campaigns of the
    same design)."""
    effect_file: tuple[str, ...] = Field((), json_schema_extra={"option_alias": "--effects-from"})
    """Python files with effects of your own, added to the candidates (docs/diagnose.md)."""
    frame_stiffness: float | None = Field(None, gt=0, allow_inf_nan=False)
    """Stiffness of drive and frame, in series with the ground [N/m]: force over it is subtracted from the depth of
    pushes (default: the depth as read)."""
    seed: int = Field(
        0, ge=0, description="Seed of the simulated campaigns that calibrate the test for a missing effect."
    )


class CheckSettings(StrictSettings):
    """What is checked."""

    campaign: str = Field(
        min_length=1, description="Folder of trials with campaign.toml, or the name of one that ships."
    )
    keep_digests: bool = False
    """Write digests.json into the folder of the campaign: later, a file that has changed is refused by name."""
