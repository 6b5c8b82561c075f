"""Give kept results the digests of their files: python docs/results/digests.py [FOLDER]

FOLDER is by default the one of this file. Each run folder below it (run.toml and result.json) gets the SHA-256 of its
files of settings and numbers into `digests` of its cost.json. By these every command refuses a file that was changed
later (rigid/digests.py). A digest that is there stays: a file that differs from it is named, and the exit status is 1.
To accept such a file, delete its line in cost.json and run this again.
"""

import json
import sys
from pathlib import Path

from experiments.runs.folder import write_json
from rigid.digests import digest_of, kept_digests

NUMBERS = (".csv", ".json", ".jsonl", ".nc", ".toml")
KEEPER = "cost.json"


def add_digests(folder: Path) -> list[str]:
    """Write the digests that cost.json of a kept result does not have; return the paths of files that were changed.

    Raises ValueError, naming the file, where cost.json is damaged: a new one would accept every change.
    """
    keeper = folder / KEEPER
    try:
        kept = json.loads(keeper.read_text(encoding="utf-8")) if keeper.exists() else {}
        digests = dict(kept.get("digests", {}))
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{keeper}: cannot be read, expected a JSON table with the table `digests`: {error}") from None
    files = [path for path in sorted(folder.iterdir()) if path.suffix in NUMBERS and path.name != KEEPER]
    now = {path.name: digest_of(path) for path in files}
    known = {name: digest for name, (digest, _) in kept_digests(folder).items()}
    if added := {name: digest for name, digest in now.items() if name not in known}:
        write_json(keeper, kept | {"digests": digests | added})
    return [str(folder / name) for name, digest in now.items() if known.get(name, digest) != digest]


def main(root: Path) -> int:
    """Add the digests of all kept results below `root`; the exit status."""
    try:
        folders = [path.parent for path in sorted(root.rglob("run.toml")) if (path.parent / "result.json").is_file()]
        changed = [path for folder in folders for path in add_digests(folder)]
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for path in changed:
        print(f"{path}: differs from its digest in {KEEPER}", file=sys.stderr)
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent))
