"""Settings that only the computation shows to be impossible."""

__all__ = ["UnfitSettingsError", "failed_as"]


class UnfitSettingsError(RuntimeError):
    """With these settings the computation cannot reach its end, and no check before it sees this.

    The command line ends with exit status 2, as for other bad settings, and keeps what it has computed. A failure that
    no setting of the user explains is a plain RuntimeError: exit status 1.
    """


def failed_as(error: RuntimeError, text: str) -> RuntimeError:
    """An error that says `text`, an UnfitSettingsError where `error` is one."""
    return UnfitSettingsError(text) if isinstance(error, UnfitSettingsError) else RuntimeError(text)
