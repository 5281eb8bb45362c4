"""Build the documentation: run its commands, check its links, write HTML.

    python docs/tools/build.py [PAGE.md ..]     run, check, write build/docs
    python docs/tools/build.py --update         put what is printed now into the pages

A page says in its first line what it works in: ``<!-- works in: programs -->`` a copy
of the sample programs, ``<!-- works in: tutorial.md -->`` what that page leaves.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from links import broken_links
from sessions import run_page

DOCS = Path(__file__).parents[1]
PROGRAMS = DOCS.parent / "programs"
BASE = re.compile(r"\A<!-- works in: (\S+) -->")


def main(arguments: Sequence[str]) -> int:
    """Build; return 0 when every output is as the pages say and every link leads."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="*", help="default: all")
    parser.add_argument("--update", action="store_true", help="rewrite the outputs")
    parser.add_argument("--no-html", action="store_true", help="only run and check")
    options = parser.parse_args(arguments)
    pages = sorted(DOCS.glob("*.md"))
    chosen = [DOCS / name for name in options.pages] or pages
    problems = [text for page in pages for text in broken_links(page)]
    with tempfile.TemporaryDirectory() as place:
        wrong = run_all(chosen, Path(place), options.update)
    if not options.update:
        problems += wrong
    for problem in problems:
        print(problem, file=sys.stderr)
    if not options.no_html:
        from render import write_html

        out = write_html(pages, DOCS.parent / "build" / "docs")
        print(f"{len(pages)} pages in {out}")
    print(f"{len(chosen)} pages run, {len(problems)} problems")
    return 1 if problems else 0


def run_all(pages: Sequence[Path], place: Path, update: bool) -> list[str]:
    """Run the commands of pages, those that others work in first.

    Returns:
        What differs, in words.
    """
    wrong: list[str] = []
    done: set[Path] = set()

    def run(page: Path) -> None:
        text = page.read_text(encoding="utf-8")
        base = BASE.match(text)
        if page in done or base is None:
            return
        done.add(page)
        start = PROGRAMS
        if base.group(1) != PROGRAMS.name:
            run(DOCS / base.group(1))
            start = place / Path(base.group(1)).stem
        folder = place / page.stem
        shutil.copytree(start, folder)
        print(f"running {page.name}", flush=True)
        new, found = run_page(text, folder)
        if update and found:
            page.write_text(new, encoding="utf-8")
            print(f"  {len(found)} outputs rewritten")
        wrong.extend(f"{page}: {text}" for text in found)

    for page in pages:
        run(page)
    return wrong


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
