"""Other forms that the trials of a model do not exclude: what each predicts, and the range over all of them.

`hedgebed diagnose` writes such models beside model.toml and notes their files in it (`OTHERS_NOTE`). The difference
between their predictions is an error of the form, which no standard error of a fit contains.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from coupling import Penetration
from experiments.campaign import PenetrationModel
from experiments.campaign.files import keep_model
from experiments.campaign.tables import OTHERS_NOTE
from experiments.runs.types import Json

from .peak import Law, peak_error, peak_of, say

__all__ = ["OtherForms", "kept_others"]


class FileLaw(Law, Protocol):
    """A law that was read from a model.toml."""

    @property
    def model(self) -> PenetrationModel:
        """The tables of its file."""

    @property
    def effects(self) -> tuple[str, ...]:
        """The names of what was added, each once."""


@dataclass(frozen=True)
class OtherForms:
    """Laws of the forms that the trials do not exclude, by their files, and warnings of those that are absent."""

    laws: Mapping[str, FileLaw]
    warnings: tuple[str, ...] = ()

    def peaks(self, pushes: Mapping[str, Penetration]) -> list[Json]:
        """Each form's peak force [N] along the paths of `pushes`: name of the quantity -> the push on another law."""
        found = []
        for file, law in self.laws.items():
            own: dict[str, Json] = {}
            for name, like in pushes.items():
                error = peak_error(law, like)
                own[name] = {"value": peak_of(law, like), "std": error.whole, "unit": "N", "freedom": error.freedom}
            found.append({"file": file, "effects": list(law.effects), "peaks": own})
        return found


def kept_others(law: FileLaw, source: Path, folder: Path, read: Callable[[Path], FileLaw]) -> OtherForms:
    """The laws that a model names as not excluded, from copies in the run's `folder`, which are made once.

    ``source``: The folder of the model; files that are absent there and in `folder` are warned of. ``read``: Makes a
    law of a file. Raises ValueError for a file that is no model of penetration, or whose copy is damaged.
    """
    laws, absent = {}, []
    for file in _named(law.model):
        if (folder / file).exists() or (source / file).is_file():
            keep_model(source / file, folder, file)
            laws[file] = read(folder / file)
        else:
            absent.append(file)
    return OtherForms(laws, (say("other_form_absent", files=" and ".join(absent)),) if absent else ())


def _named(model: PenetrationModel) -> tuple[str, ...]:
    """The files of other forms that a model names; what is no plain name of a TOML file is left out."""
    note = model.notes.get(OTHERS_NOTE)
    files = note.get("files", ()) if isinstance(note, Mapping) else ()
    texts = [file for file in files if isinstance(file, str)] if isinstance(files, Sequence) else []
    return tuple(file for file in texts if Path(file).name == file and file.endswith(".toml"))
