"""Hooks of MkDocs: the generated pages, and links that leave `docs/`.

- One page for each command of ``hedgebed``, made from the parser, under reference/commands/.
- One page for each package in PACKAGES with its public names, made from the docstrings, under reference/python/.
- A page links to files and folders of the repository that are not under docs/, as it does on a code host. Such a file
  is copied to repository/ of the site, and a folder gets a page that lists its files.
"""

import os
import re
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("dem", "rigid", "coupling", "coupling.robot", "experiments.robot.own_loop", "vis")
"""What scripts import: packages, and a module."""
OPTIONS_OF = {"dem": {
    "Options of Bed.prepare": "dem.prepare.prepare.prepare_bed",
    "Options of Bed.prepare_as": "dem.prepare.prepare.prepare_as",
}}  # fmt: skip
"""Functions that describe the options of a public method, by package and title."""
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
ELSEWHERE = "repository"
"""Folder of the site with the files of the repository that are not under docs/."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the generated pages into the groups of the navigation that are empty in mkdocs.yml."""
    filled = {
        "Commands": [f"reference/commands/{name}.md" for name in command_pages()],
        "Python": [{name: f"reference/python/{name}.md"} for name in PACKAGES],
        "Notes": [f"notes/{path.name}" for path in sorted((ROOT / "docs/notes").glob("*.md"))],
    }

    def fill(items: list[Any]) -> None:
        for item in items:
            for title, below in item.items() if isinstance(item, dict) else ():
                if below == []:
                    below.extend(filled[title])
                elif isinstance(below, list):
                    fill(below)

    fill(config.nav or [])
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and what pages link to: files outside docs/, folders, single results."""
    for file in list(files):
        if file.src_uri.startswith("results/") and file.src_uri != "results/README.md":
            files.remove(file)  # thousands of files; those that a page names come back below
    for name, text in {**command_pages(), **package_pages()}.items():
        kind = "python" if name in PACKAGES else "commands"
        files.append(File.generated(config, f"reference/{kind}/{name}.md", content=text))
    pages = [ROOT / "docs" / file.src_uri for file in files.documentation_pages() if not file.generated_by]
    waiting = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "examples/README.md"]
    waiting += [target for page in pages for target in targets(page)]
    while waiting:
        path = waiting.pop()
        source = site_path(path)
        if source in files.src_uris or not path.exists():
            continue
        if path.is_dir():
            waiting += [file for file in path.iterdir() if file.is_file()]
            if not (path / "README.md").is_file():
                files.append(File.generated(config, source, content=listing(path)))
        else:
            files.append(File.generated(config, source, abs_src_path=str(path)))
            waiting += targets(path) if path.suffix == ".md" else []
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn each relative link of a page from its place in the repository into its place on the site."""
    here = repository_path(page.file.src_uri)
    if here is None:
        return markdown

    def on_site(match: re.Match[str]) -> str:
        path, mark, anchor = match[2].partition("#")
        if not path or re.match(r"[a-z]+:", path) or "{" in path:
            return match[0]
        target = Path(os.path.normpath(here.parent / path))
        relative = os.path.relpath(site_path(target), Path(page.file.src_uri).parent)
        return f"{match[1]}{relative}{mark}{anchor}{match[3]}"

    def changed(text: str) -> str:
        # A list that follows a sentence at once is a list on a code host; Markdown's first definition wants a gap.
        return re.sub(r"^([^\n|>#-].*:)\n(?=- )", r"\1\n\n", LINK.sub(on_site, text), flags=re.MULTILINE)

    return outside_code(markdown, changed)


def outside_code(markdown: str, change: Callable[[str], str]) -> str:
    """Apply `change` to the text that is in no block of code."""
    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if part.startswith("```") else change(part) for part in parts)


def targets(page: Path) -> list[Path]:
    """Files and folders of the repository that a page links to."""
    found = []
    for match in LINK.finditer(page.read_text(encoding="utf-8")):
        path = match[2].partition("#")[0]
        if path and not re.match(r"[a-z]+:", path):
            target = Path(os.path.normpath(page.parent / path))
            if target.is_relative_to(ROOT):
                found.append(target)
    return found


def site_path(path: Path) -> str:
    """Where a file or folder of the repository is on the site, as MkDocs names its source.

    A folder is its README.md, or else the page that lists its files.
    """
    inside = path.is_relative_to(ROOT / "docs")
    relative = path.relative_to(ROOT / "docs" if inside else ROOT).as_posix()
    source = relative if inside else f"{ELSEWHERE}/{relative}"
    if not path.is_dir():
        return source
    return f"{source}/{'README.md' if (path / 'README.md').is_file() else 'files-of-this-folder.md'}"


def repository_path(source: str) -> Path | None:
    """Where a page of the site is in the repository, or None if it is generated."""
    path = ROOT / source.removeprefix(f"{ELSEWHERE}/") if source.startswith(f"{ELSEWHERE}/") else ROOT / "docs" / source
    return path if path.is_file() else None


def listing(folder: Path) -> str:
    """A page with the files of a folder."""
    lines = [f"# {folder.relative_to(ROOT).as_posix()}", "", "| file | kB |", "|---|---|"]
    lines += [
        f"| [{file.name}]({file.name}) | {file.stat().st_size / 1e3:.1f} |"
        for file in sorted(folder.iterdir())
        if file.is_file()
    ]
    return "\n".join(lines) + "\n"


@cache
def command_pages() -> dict[str, str]:
    """Markdown of each command, with its subcommands, from the parser, by name."""
    from experiments.cli.main import build_app

    app = build_app()
    return {
        name: app[name].generate_docs(usage_name=f"hedgebed {name}", max_heading_level=3)
        for name in sorted(app)
        if not name.startswith("-")
    }


def package_pages() -> dict[str, str]:
    """Markdown that makes mkdocstrings describe the public names of each package, by name of the package."""
    pages = {}
    for name in PACKAGES:
        package = import_module(name)
        lines = [f"# {name}", "", (package.__doc__ or "").strip(), ""]
        examples = Path(__file__).with_name(f"{name}-examples.md")
        lines += [examples.read_text(encoding="utf-8"), ""] if examples.is_file() else []
        for public in sorted(package.__all__, key=str.lower):
            lines += [f"## {name}.{public}", "", described(getattr(package, public)), ""]
        for title, function in OPTIONS_OF.get(name, {}).items():
            lines += [f"## {title}", "", f"::: {function}", ""]
        pages[name] = "\n".join(lines)
    return pages


def described(value: Any) -> str:
    """Markdown on a public class or function, which mkdocstrings fills, or on a value."""
    if callable(value):
        return f"::: {value.__module__}.{value.__qualname__}"
    kind = f"`{type(value).__name__}`"
    if isinstance(value, dict | tuple):
        return f"{kind} of " + ", ".join(f"`{name}`" for name in value) + "."
    return f"{kind}: `{value!r}`." if isinstance(value, int | float | str) else f"An instance of {kind}."
