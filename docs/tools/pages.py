"""Hold the length of pages, and draw sentences of them to be judged.

    python docs/tools/pages.py                      fail where a page is too long
    python docs/tools/pages.py --list               the words of every page
    python docs/tools/pages.py --draw 60 --seed 1   sentences, drawn by a seed
    python docs/tools/pages.py --suspects           sentences that break a rule

Words of headings, paragraphs, lists and tables count, words of inline code, too. Blocks
of code, outputs of commands, targets of links and comments do not. ``nav`` of
mkdocs.yml says which part a page belongs to. At most 1,500 words stand on a page of
tutorials, how-to and explanation. Reference and studies have no limit.

Some rules of English can be seen by a program: 25 words a sentence, one clause with
where, which or that, no pronoun at the beginning, no semicolon, no forbidden word.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from counts import WORDS as FORBIDDEN

ROOT = Path(__file__).parents[2]
MOST = 1500  # words of a page
LONGEST = 25  # words of a sentence
ALLOWED = 8  # sentences of all pages that may break a rule; the number may only fall
LIMITED = ("Home", "Tutorials", "How-to", "Explanation")
DRAWN = (*LIMITED, "Reference")
NO_PAGE_OF_OURS = ("reference/", "findings.md", "files.md", "history/", "changelog.md")
"""What a program writes, and what is history: no sentence is drawn there."""
PART = re.compile(r"^  - ([\w-]+):(?: (\S+\.md))?$")
ENTRY = re.compile(r"^ {6,}- .*?(\S+\.md)$")
CODE = re.compile(r"(?ms)^ *(`{3,}|~{3,}).*?^ *\1 *$|^ {4,}\S[^\n]*$|<!--.*?-->")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
SENTENCE_END = re.compile(r"(?<=[A-Za-z0-9)`\"*%][.?!])\s+(?=[A-Z0-9`*\"(\[])")
PRONOUN = re.compile(
    r"^(?:It|They|This|These|That|Those|Both|Such|There it)\b(?! page)"
)
CLAUSE = re.compile(r"\b(where|which|that)\b", re.I)


@dataclass(frozen=True)
class Page:
    """A page of the site: the part of the navigation, and its file."""

    part: str
    name: str

    @property
    def path(self) -> Path:
        """Return the file."""
        top = {"contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
        inside = ROOT / "docs" / self.name
        return ROOT / top[self.name] if self.name in top else inside


def pages() -> Iterator[Page]:
    """Yield the pages of the navigation, and the README as one more home page."""
    yield Page("Home", "../README.md")
    part = ""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    for line in text.splitlines():
        if begun := PART.match(line):
            part = begun.group(1)
            if begun.group(2):
                yield Page(part, begun.group(2))
        elif entry := ENTRY.match(line):
            yield Page(part, entry.group(1))


def prose(text: str) -> str:
    """Return a page without blocks of code, comments and targets of links."""
    return LINK.sub(r"\1", CODE.sub("", text))


def words(text: str) -> int:
    r"""Count the words of a page.

    >>> words("# One\n\ntwo `--three` [four](five.md)\n\n```console\n$ six\n```")
    4
    """
    return sum(bool(re.search(r"\w", word)) for word in prose(text).split())


def sentences(text: str) -> Iterator[str]:
    r"""Yield the sentences of paragraphs, lists and tables of a page.

    >>> list(sentences("# A\n\nOne two three four. Five six\nseven eight.\n"))
    ['One two three four.', 'Five six seven eight.']
    """
    for block in blocks(prose(text)):
        for sentence in SENTENCE_END.split(block):
            if len(sentence.split()) >= 4 and sentence.strip()[-1] in ".?!:":
                yield sentence.strip()


def blocks(text: str) -> Iterator[str]:
    """Yield paragraphs, entries of lists and cells of tables, each in one line."""
    held: list[str] = []
    for line in [*text.split("\n"), ""]:
        bare = line.strip()
        if not bare or bare.startswith(("#", "|", "- ", "* ")) or is_numbered(bare):
            yield from [" ".join(held)] if held else []
            held = []
        if bare.startswith("|"):
            yield from (cell.strip() for cell in bare.strip("|").split("|"))
        elif bare and not bare.startswith("#"):
            held.append(re.sub(r"^(?:[-*]|\d+\.) +", "", bare))


def is_numbered(line: str) -> bool:
    """Return True if a line begins an entry of a numbered list."""
    return re.match(r"\d+\. ", line) is not None


def faults(sentence: str) -> list[str]:
    """Name the rules that a sentence breaks, as far as a program can see it."""
    bare = re.sub(r"`[^`]*`", "x", sentence)
    found = []
    if len(bare.split()) > LONGEST:
        found.append(f"{len(bare.split())} words")
    if PRONOUN.match(bare):
        found.append("pronoun")
    if len(CLAUSE.findall(bare)) > 1:
        found.append("clauses")
    if ";" in bare:
        found.append("semicolon")
    if FORBIDDEN.search(bare):
        found.append("word")
    return found


def all_sentences(part: str | None = None) -> list[tuple[str, str]]:
    """Return page and text of every sentence that may be drawn."""
    return [
        (page.name, sentence)
        for page in pages()
        if page.part in ((part,) if part else DRAWN)
        and not page.name.startswith(NO_PAGE_OF_OURS)
        for sentence in sentences(page.path.read_text(encoding="utf-8"))
    ]


def suspects(part: str | None = None) -> list[tuple[str, str, list[str]]]:
    """Return page, text and faults of every sentence that breaks a rule."""
    return [(n, s, found) for n, s in all_sentences(part) if (found := faults(s))]


def too_long() -> list[str]:
    """Return the pages above the limit, in words."""
    counted = [(p, words(p.path.read_text(encoding="utf-8"))) for p in pages()]
    return [
        f"{page.name}: {count} words, {MOST} are allowed in {page.part}"
        for page, count in counted
        if page.part in LIMITED and count > MOST
    ]


def main() -> None:
    """Check, list, or draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--list", action="store_true", help="words of every page")
    parser.add_argument("--draw", type=int, default=0, help="how many sentences")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--part", help="of the navigation; default: all but studies")
    parser.add_argument("--suspects", action="store_true", help="what breaks a rule")
    options = parser.parse_args()
    if options.list:
        for page in pages():
            print(f"{words(page.path.read_text('utf-8')):6d} {page.part} {page.name}")
    elif options.draw:
        every = all_sentences(options.part)
        chosen = random.Random(options.seed).sample(every, options.draw)
        for number, (name, sentence) in enumerate(chosen, 1):
            print(f"{number}. [{name}] {sentence}")
    elif options.suspects:
        found = suspects(options.part)
        for name, sentence, broken in found:
            print(f"{name}: {', '.join(broken)}: {sentence}")
        print(f"{len(found)} of {len(all_sentences(options.part))} sentences")
    else:
        broken = [f"{name}: {', '.join(why)}: {text}" for name, text, why in suspects()]
        wrong = [*too_long(), *(broken if len(broken) > ALLOWED else [])]
        if wrong:
            sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
