"""Build the documentation: run the commands of its pages, write it as a site.

    python docs/tools/build.py [PAGE.md ..]     run, compare, write build/docs
    python docs/tools/build.py --update         put what is printed now into the pages

A page says in its first line what it works in: ``<!-- works in: programs -->`` a copy
of the sample programs, ``<!-- works in: . -->`` of the sources, and
``<!-- works in: docs/tutorial.md -->`` what that page leaves.
Links that lead nowhere are found while the site is written, and fail.
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

import architecture
import site_pages as site
from sessions import PAGES, ROOT, run_page

NOT_COPIED = shutil.ignore_patterns(
    ".git", ".venv", ".*_cache", "__pycache__", ".hypothesis", "build", "target", "demo"
)
BASE = re.compile(r"\A<!-- works in: (\S+) -->")


def main(arguments: Sequence[str]) -> int:
    """Build; return 0 when every output is as the pages say and every link leads."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, help="default: all")
    parser.add_argument("--update", action="store_true", help="rewrite the outputs")
    parser.add_argument("--no-site", action="store_true", help="only run and compare")
    options = parser.parse_args(arguments)
    chosen = [page.resolve() for page in options.pages] or PAGES
    with tempfile.TemporaryDirectory() as place:
        wrong = run_all(chosen, Path(place), options.update)
    problems = [*([] if options.update else wrong), *architecture.problems()]
    for problem in problems:
        print(problem, file=sys.stderr)
    print(f"{len(chosen)} pages run, {len(problems)} problems")
    broken = 0 if options.no_site else site.build()
    return 1 if problems or broken else 0


def run_all(pages: Sequence[Path], place: Path, update: bool) -> list[str]:
    """Run the commands of pages, those that others work in first.

    Returns:
        What differs, in words.
    """
    wrong: list[str] = []
    folders: dict[Path, Path] = {}

    def run(page: Path) -> None:
        text = page.read_text(encoding="utf-8")
        base = BASE.match(text)
        if page in folders or base is None:
            return
        start = ROOT / base.group(1)
        if start.suffix == ".md":
            run(start)
            start = folders[start]
        folders[page] = folder = place / f"{len(folders)}-{page.stem}"
        shutil.copytree(start, folder, ignore=NOT_COPIED)
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
