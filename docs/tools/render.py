"""Pages as HTML, with a list of all pages beside each."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from html import escape
from pathlib import Path

from links import anchor
from markdown_it import MarkdownIt

STYLE = """
body { margin: 0 auto; max-width: 76em; padding: 1em; display: flex; gap: 2em;
  font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #222; }
nav { flex: 0 0 12em; font-size: 14px; } nav a { display: block; padding: 2px 0; }
main { min-width: 0; flex: 1; } a { color: #00568a; } img { max-width: 100%; }
pre { background: #f4f4f2; padding: 8px 12px; overflow-x: auto; line-height: 1.35; }
code { font: 13px ui-monospace, "DejaVu Sans Mono", monospace; }
table { border-collapse: collapse; } th, td { padding: 3px 10px; text-align: left;
  border-bottom: 1px solid #ddd; vertical-align: top; }
@media (max-width: 800px) { body { display: block; } }
@media print { nav { display: none; } }
"""


def write_html(pages: Sequence[Path], out: Path) -> Path:
    """Write every page, its pictures, and ``index.html``."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    shutil.copytree(pages[0].parent / "pictures", out / "pictures")
    titles = {page: title_of(page) for page in pages}
    for page in pages:
        (out / html_name(page)).write_text(render(page, titles), encoding="utf-8")
    return out


def html_name(page: Path) -> str:
    """Name the HTML file of a page."""
    return "index.html" if page.stem == "README" else f"{page.stem}.html"


def title_of(page: Path) -> str:
    """Return the first heading of a page."""
    found = re.search(r"(?m)^# (.+)$", page.read_text(encoding="utf-8"))
    return found.group(1) if found else page.stem


def render(page: Path, titles: dict[Path, str]) -> str:
    """Write one page."""
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"\]\((?!\w+:)README\.md", "](index.html", text)
    text = re.sub(r"\]\((?!\w+:)([\w-]+)\.md", r"](\1.html", text)
    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(text)
    body = re.sub(r"<h(\d)>(.+?)</h\1>", _heading, body)
    links = "".join(
        f'<a href="{html_name(p)}">{escape(title)}</a>' for p, title in titles.items()
    )
    return (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f"<title>{escape(titles[page])} – postproc</title><style>{STYLE}</style></head>"
        f"<body><nav>{links}</nav><main>{body}</main></body></html>\n"
    )


def _heading(found: re.Match[str]) -> str:
    """Give a heading its anchor."""
    level, text = found.groups()
    name = anchor(re.sub(r"<[^>]+>", "", text))
    return f'<h{level} id="{name}">{text}</h{level}>'
