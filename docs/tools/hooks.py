"""Hooks of MkDocs: what pages link to outside of docs/ becomes part of the site.

Links stand in the pages as code hosts follow them, relative to the file. Markdown
files at the top of the repository are pages of the site too; any other file that a
page links to is shown on a page of its own.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)#\s]+)")
LANGUAGES = {".py": "python", ".sh": "bash", ".toml": "toml", ".example": "make"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the top of the repository and the files that pages show."""
    for name, uri in PAGES.items():
        if (ROOT / name).exists():
            files.append(File.generated(config, uri, abs_src_path=str(ROOT / name)))
    shown = {path for page in files.documentation_pages() for path in _outside(page)}
    for path in sorted(shown):
        files.append(
            File.generated(
                config,
                _uri(path),
                content=_listing(path),
                inclusion=InclusionLevel.NOT_IN_NAV,
            )
        )
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Lead links that leave docs/ to where the site has what they name."""
    here = Path(page.file.src_uri).parent
    source = _source(page.file)

    def led(found: re.Match[str]) -> str:
        path = (source.parent / found.group()).resolve()
        inside = path.is_file() and path.is_relative_to(ROOT)
        return os.path.relpath(_uri(path), here) if inside else found.group()

    return LINK.sub(led, markdown)


def _source(file: File) -> Path:
    """Return the file in the repository that a page is made from."""
    names = {uri: name for name, uri in PAGES.items()}
    return ROOT / names.get(file.src_uri, f"docs/{file.src_uri}")


def _outside(file: File) -> Iterator[Path]:
    """List the files outside of docs/ that a page links to, pages excepted."""
    source = _source(file)
    for target in LINK.findall(source.read_text(encoding="utf-8")):
        path = (source.parent / target).resolve()
        if path.is_file() and _uri(path).startswith("files/"):
            yield path


def _uri(path: Path) -> str:
    """Name the source of a file's page in the site."""
    name = path.relative_to(ROOT).as_posix()
    if name.startswith("docs/"):
        return name.removeprefix("docs/")
    return PAGES.get(name, f"files/{name}.md")


def _listing(path: Path) -> str:
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
