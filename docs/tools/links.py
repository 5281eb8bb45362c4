"""Links between pages: every file and every heading that is named must be there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"(?ms)^( *)```.*?^\1```$")
HEADING = re.compile(r"(?m)^#+ (.+)$")


def anchor(heading: str) -> str:
    """Name the anchor of a heading as code hosts do.

    >>> anchor("What `diff` shows, line by line")
    'what-diff-shows-line-by-line'
    """
    kept = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return kept.replace(" ", "-")


def broken_links(page: Path) -> Iterator[str]:
    """List the links of a page that lead nowhere."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in LINK.findall(text):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, part = target.partition("#")
        place = (page.parent / name) if name else page
        if not place.exists():
            yield f"{page}: {target}: there is no such file"
        elif part and part not in anchors(place):
            yield f"{page}: {target}: there is no such heading"


def anchors(page: Path) -> set[str]:
    """List the anchors of a page."""
    if page.suffix != ".md":
        return set()
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    return {anchor(heading) for heading in HEADING.findall(text)}
