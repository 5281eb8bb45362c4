"""Write the pages as a site, with Zensical: docs/tools/site_pages.py.

Links stand in the pages as code hosts follow them, relative to the file. Zensical
has no hooks, so this module first copies the pages to build/pages, and changes links
that lead out of docs/. Markdown files at the top of the repository are pages of the
site, too. Any other file that a page links to is shown on a page of its own.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
FOLDERS = ("", "reference", "history", "studies")
"""Folders of docs/ whose Markdown files are pages."""
ASSETS = (".css", ".js", ".png", ".svg")
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)#\s]+)")
LANGUAGES = {".py": "python", ".sh": "bash", ".toml": "toml", ".example": "make"}


def stage(target: Path) -> None:
    """Copy the pages, the pictures and the files that pages show to a folder."""
    shutil.rmtree(target, ignore_errors=True)
    for path in sorted((ROOT / "docs").rglob("*")):
        if path.suffix in ASSETS and "tools" not in path.parts:
            _write(target / path.relative_to(ROOT / "docs"), path.read_bytes())
    pages = list(sources())
    for source in pages:
        text = with_links(source)
        _write(target / uri(source), text.encode("utf-8"))
    for path in sorted({path for page in pages for path in linked(page)}):
        if uri(path).startswith("files/"):
            _write(target / uri(path), listing(path).encode("utf-8"))


def sources() -> Iterator[Path]:
    """List the Markdown files that are pages of the site."""
    for folder in FOLDERS:
        yield from sorted((ROOT / "docs" / folder).glob("*.md"))
    yield from (ROOT / name for name in PAGES if (ROOT / name).exists())


def with_links(source: Path) -> str:
    """Return the text of a page with links as the site needs them."""
    here = Path(uri(source)).parent

    def led(found: re.Match[str]) -> str:
        path = (source.parent / found.group()).resolve()
        inside = path.is_file() and path.is_relative_to(ROOT)
        return os.path.relpath(uri(path), here) if inside else found.group()

    return LINK.sub(led, source.read_text(encoding="utf-8"))


def linked(source: Path) -> Iterator[Path]:
    """List the files of the repository that a page links to."""
    for target in LINK.findall(source.read_text(encoding="utf-8")):
        path = (source.parent / target).resolve()
        if path.is_file() and path.is_relative_to(ROOT):
            yield path


def uri(path: Path) -> str:
    """Return where the site has a file, relative to its top."""
    name = path.relative_to(ROOT).as_posix()
    inside = name.removeprefix("docs/")
    folder = inside.rpartition("/")[0]
    if name.startswith("docs/") and (
        path.suffix in ASSETS or (path.suffix == ".md" and folder in FOLDERS)
    ):
        return inside
    return PAGES.get(name, f"files/{name}.md")


def dead_links(pages: Iterable[Path]) -> Iterator[str]:
    """Find links to files that do not exist; Zensical looks at pages only."""
    for page in pages:
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            if not (page.parent / target).exists():
                yield f"{page}: there is no file {target}"


def listing(path: Path) -> str:
    """Write a page that shows a file."""
    language = LANGUAGES.get(path.suffix, "text")
    title = path.relative_to(ROOT).as_posix()
    data = path.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:  # programs of controllers
        text = data.decode("latin-1")
    text = "\n".join(text.splitlines()) + "\n"
    head = f"---\nsearch:\n  exclude: true\n---\n\n# {title}\n\n"
    return f"{head}```` {language}\n{text}````\n"


def build() -> int:
    """Write build/docs; return 0 when no link and no heading is missing."""
    stage(ROOT / "build" / "pages")
    dead = list(dead_links(sources()))
    for text in dead:
        print(text, file=sys.stderr)
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    return subprocess.run(command, cwd=ROOT, check=False).returncode or len(dead)


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


if __name__ == "__main__":
    sys.exit(build())
