"""Write the list of kept results: python docs/results/index.py

README.md beside this file gets a line for each folder: its command, its date, and what it shows. These come from the
folder's README.md (its heading, and the lines `Command:` and `Date:`), or else from run.toml and result.json of a run.
"""

import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
HEAD = """\
# Kept runs

Settings and numbers of long runs, so that nobody must compute them again.

- `COMMAND docs/results/FOLDER/run.toml` repeats a run, with COMMAND from its line below, and draws its pictures.
- [Notes](../notes/results.md) state what each run is for, which code computed it, and which page uses it.
- `cost.json` has the digests of the files of a run.
- After adding a folder, run `python docs/results/digests.py` and `python docs/results/index.py`, which makes this page.
- "±" is `std` of result.json, whose `note` states what it covers; in `converge` it is `total`.
- If run.toml states `hedgebed-run/1`, its `sand` is today's `sand-weak`, and its `sand-calibrated` today's `sand`
  ([materials](../materials.md)). hedgebed reads them so.

| folder | command | date | what it shows |
|---|---|---|---|
"""


def index_of(root: Path) -> str:
    """The list of the folders of kept results below `root`, in Markdown.

    Raises ValueError, naming the file, where a folder has neither a README.md with a heading, a command and a date,
    nor a run.toml and a result.json that can be read.
    """
    folders = [path for path in sorted(root.iterdir()) if path.is_dir() and not path.name.startswith((".", "_"))]
    return HEAD + "".join(f"| {' | '.join(_line(folder))} |\n" for folder in folders)


def _line(folder: Path) -> tuple[str, str, str, str]:
    """Folder, command, date and what it shows, of one folder."""
    if (folder / "README.md").is_file():
        return f"[{folder.name}]({folder.name}/README.md)", *_of_page(folder / "README.md")
    return f"[{folder.name}]({folder.name})", *_of_run(folder)


def _of_page(page: Path) -> tuple[str, str, str]:
    """Command, date and heading that a README.md states."""
    text = page.read_text(encoding="utf-8")
    parts = {
        "a heading": re.search(r"^# (.+)$", text, re.MULTILINE),
        "a line `Command: ...`": re.search(r"^Command: (.+)$", text, re.MULTILINE),
        "a line `Date: YYYY-MM-DD`": re.search(r"^Date: (\d{4}-\d\d-\d\d)", text, re.MULTILINE),
    }
    if missing := [part for part, match in parts.items() if match is None]:
        raise ValueError(f"{page}: a line is missing, expected {' and '.join(missing)}")
    heading, command, date = (match[1] for match in parts.values() if match)
    return command.replace("|", r"\|"), date, heading


def _of_run(folder: Path) -> tuple[str, str, str]:
    """Command, date and title, with the first number that was computed, of a run's folder."""
    path = folder / "run.toml"
    try:
        settings = tomllib.loads(path.read_text(encoding="utf-8"))
        command, date = settings["command"], settings["created"][:10]
        path = folder / "result.json"
        result = json.loads(path.read_text(encoding="utf-8"))
        title, quantities = result["title"], result["quantities"]
    except KeyError as error:
        raise ValueError(f"{path}: the key {error} was not found, expected the file of a finished run") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read, expected the file of a run, or a README.md: {error}") from None
    numbers = [_number(name, of) for name, of in quantities.items() if isinstance(of.get("value"), int | float)]
    return f"`hedgebed {command}`", date, "; ".join([title, *numbers[:1]])


def _number(name: str, of: dict[str, Any]) -> str:
    """A quantity of result.json with its error and unit, in three digits."""
    error = of.get("total", of.get("std"))
    unit = "" if of["unit"] == "1" else f" {of['unit']}"
    return f"`{name}` {of['value']:.3g}{f' ± {error:.2g}' if error else ''}{unit}"


def main(root: Path) -> int:
    """Write README.md of `root`; the exit status."""
    try:
        text = index_of(root)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    (root / "README.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(FOLDER))
