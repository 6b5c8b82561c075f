"""Campaigns to begin one's own with: annotated tables and short recordings, copied as they ship."""

import shutil
from pathlib import Path
from typing import Literal

__all__ = ["KINDS", "TEMPLATES", "new_campaign"]

TEMPLATES = Path(__file__).resolve().parent.parent / "examples"
KINDS = ("tumble", "penetration")


def new_campaign(folder: str | Path, *, kind: Literal["tumble", "penetration"]) -> Path:
    """Write the template of a campaign of this kind into `folder`, and return it.

    Its recordings are made up from the base model, so that it can be checked and diagnosed as it is.
    Raises ValueError for an unknown kind, and where the folder holds something or cannot be written.
    """
    folder = Path(folder)
    if kind not in KINDS:
        raise ValueError(f"kind = {kind!r}: {' or '.join(map(repr, KINDS))} was expected")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ValueError(f"{str(folder)!r} is in use: a folder that is empty or does not exist yet was expected")
    try:
        shutil.copytree(TEMPLATES / f"template-{kind}", folder, dirs_exist_ok=True)
    except OSError as error:
        raise ValueError(f"{str(folder)!r} cannot be written ({error}): a folder that can be was expected") from error
    return folder
