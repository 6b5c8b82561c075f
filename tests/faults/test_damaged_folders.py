"""One file of a folder that a command reads is damaged: the same numbers, or a sentence that names the file.

As `test_damage`, of whole folders: members of `calibrate`, `sweep` and `converge`, marks and series of finished work,
frames, copies of what a run was given, beds on the shelf and in the cache, kept results. `make torture` damages as many
files of each as HEDGEBED_DAMAGES says; the suite does a few.
"""

import os
import random
import shutil
from pathlib import Path

import pytest
from faults.damaged_folders import KINDS, patched

from experiments.cli.main import main
from experiments.runs import folder as runs_folder

DAMAGES = int(os.environ.get("HEDGEBED_DAMAGES", "2"))
TEXTS = (".csv", ".json", ".toml")
NOT_NUMBERS = ("lock", "report.html", "log")
MARKED = [
    pytest.param(name, marks=[getattr(pytest.mark, kind.tier)] if kind.tier else []) for name, kind in KINDS.items()
]


def damaged(path, chance):
    """Cut the file off somewhere, change one bit of it, or one digit of a text: the number is as good as another."""
    content = bytearray(path.read_bytes())
    place, how = chance.randrange(len(content)), chance.choice(["cut", "bit", "digit", "digit"])
    digits = [at for at, byte in enumerate(content) if byte in b"0123456789"] if path.suffix in TEXTS else []
    if how == "cut":
        content = content[:place]
    elif how == "digit" and digits:
        at = chance.choice(digits)
        content[at] = chance.choice([byte for byte in b"0123456789" if byte != content[at]])
    else:
        content[place] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def files_of(patterns):
    """The files that the patterns name in the present folder, in the order of their names."""
    found = {path for pattern in patterns for path in Path().glob(pattern) if path.is_file()}
    return sorted(path for path in found if path.name not in NOT_NUMBERS and path.stat().st_size)


def answered(kind, home, capsys):
    """The commands of a kind in a folder, until one refuses: its status, stderr, and the numbers if none did."""
    said, shown = "", []
    for words in kind.read:
        capsys.readouterr()
        status = main(words.split() if "--json" in words or "--no-open" in words else [*words.split(), "--quiet"])
        out, err = capsys.readouterr()
        said += err
        shown.append(out)
        if status:
            return status, said, {}
    numbers = {str(path): path.read_bytes().replace(str(home).encode(), b"HOME") for path in files_of(kind.answers)}
    return 0, said, numbers | {"stdout": [text.replace(str(home), "HOME") for text in shown]}


@pytest.fixture(scope="module")
def wholes(tmp_path_factory):
    """Folders that no test writes to, by kind, and what is read from a copy of each."""
    made = {}

    def whole(name, capsys):
        if name not in made:
            kind, home = KINDS[name], tmp_path_factory.mktemp("whole") / "home"
            home.mkdir()
            with pytest.MonkeyPatch.context() as patch:
                patch.chdir(home)
                patched(kind, patch)
                kind.make()
                again = shutil.copytree(home, home.parent / "again")
                patch.chdir(again)
                status, said, numbers = answered(kind, again, capsys)
                assert status == 0 and (len(numbers) > 1 or not kind.answers), said
            made[name] = home, numbers
        return made[name]

    return whole


@pytest.mark.parametrize("seed", range(DAMAGES))
@pytest.mark.parametrize("name", MARKED)
def test_a_damaged_file_of_a_folder_is_named_or_changes_no_number(
    name, seed, wholes, tmp_path, monkeypatch, capsys, record_property
):
    kind, (whole, numbers), chance = KINDS[name], wholes(name, capsys), random.Random(f"{name} {seed}")
    home = shutil.copytree(whole, tmp_path / "home")
    monkeypatch.chdir(home)
    patched(kind, monkeypatch)
    monkeypatch.setattr(runs_folder, "_TOLD", set())
    file = chance.choice(files_of(kind.damaged))
    damaged(file, chance)
    status, said, found = answered(kind, home, capsys)
    record_property("damaged", f"{file}: {status}")
    assert "Traceback (most" not in said, (file, said)
    if status:
        named = file.relative_to(file.parts[0]) if len(file.parts) > 1 else file  # the run may be named by a whole path
        assert status in (1, 2) and str(named) in said, (file, said)
    else:
        assert found == numbers, (file, said)
