"""Draw pictures of docs/images again: python docs/results/pictures.py [NAME ...] [--list] [--out FOLDER]

pictures.toml beside this file says how each is made. Without names all that kept results or a few seconds suffice for;
those of a command only by their names. ``--list`` prints how each is made, ``--out`` writes them elsewhere.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from vis.pictures.publish import publish
from vis.report import write_report

HERE = Path(__file__).resolve().parent
IMAGES = HERE.parent / "images"
WAYS = ("kept", "program", "command", "left")
"""Keys of an entry, one of which says how its pictures are made."""
Entry = dict[str, Any]


def entries() -> list[Entry]:
    """How the pictures are made. Raises ValueError for an entry with no way, or more than one."""
    found = tomllib.loads((HERE / "pictures.toml").read_text(encoding="utf-8"))["picture"]
    for entry in found:
        if sum(way in entry for way in WAYS) != 1:
            raise ValueError(f"pictures.toml: {entry['names'][0]} must have one of {', '.join(WAYS)}")
    return list(found)


def draw(entry: Entry, out: Path) -> list[Path]:
    """Draw the pictures of an entry, and return them. Raises RuntimeError where its command fails."""
    targets = [out / f"{name}.png" for name in entry["names"]]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        if "program" in entry:
            run([sys.executable, *entry["program"], *([str(HERE.parent)] if entry.get("folder") else [])])
            if out != IMAGES:
                raise ValueError(f"{entry['program'][-1]} writes into {IMAGES}; leave out --out")
            return targets
        if "kept" in entry:
            for kept in entry["kept"]:  # what a later folder has takes the place of the same file of an earlier one
                shutil.copytree(HERE / kept, folder, dirs_exist_ok=True)
            for file in entry.get("series", []):
                (folder / "series").mkdir(exist_ok=True)
                shutil.copy(folder / file, folder / "series" / file)
            write_report(folder)
        else:
            run([sys.executable, "-m", "hedgebed", *entry["command"], "--out", str(folder)])
        for target, figure in zip(targets, entry["figures"], strict=True):
            publish(folder / "figures" / f"{figure}.png", target, width=entry.get("width", 2000))
    return targets


def run(command: list[str]) -> None:
    """Run a command from the root of the checkout. Raises RuntimeError where it fails."""
    if code := subprocess.run(command, cwd=HERE.parents[1], check=False).returncode:
        raise RuntimeError(f"{' '.join(command)} ended with exit status {code}")


def how(entry: Entry) -> str:
    """How an entry is made, in a line."""
    if "kept" in entry:
        return f"from {', '.join(entry['kept'])}"
    words = {"program": "python", "command": "hedgebed"}
    return next(
        (f"{said} {' '.join(entry[way])}" for way, said in words.items() if way in entry), entry.get("left", "")
    )


def main(arguments: list[str] | None = None) -> int:
    """Draw, or list; exit status 2 for a name that is not known or has no way."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="pictures, without .png")
    parser.add_argument("--list", action="store_true", help="print how each is made")
    parser.add_argument("--out", type=Path, default=IMAGES, help="folder that they go to")
    given, table = parser.parse_args(arguments), entries()
    if given.list:
        print("\n".join(f"{', '.join(entry['names'])}: {how(entry)}" for entry in table))
        return 0
    known = {name: entry for entry in table for name in entry["names"]}
    if wrong := [name for name in given.names if name not in known or "left" in known[name]]:
        parser.error(f"{wrong[0]}: {known[wrong[0]]['left'] if wrong[0] in known else 'no such picture'}")
    every = [entry for entry in table if "kept" in entry or ("program" in entry and given.out == IMAGES)]
    chosen = [entry for entry in table if set(entry["names"]) & set(given.names)] if given.names else every
    given.out.mkdir(parents=True, exist_ok=True)
    for entry in chosen:
        print("\n".join(str(path) for path in draw(entry, given.out.resolve())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
