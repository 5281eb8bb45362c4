"""Hold names, help, messages and pages to the words of the field.

    python docs/tools/words.py             fail where words.txt here allows fewer
    python docs/tools/words.py --list      every place that counts, file:line
    python docs/tools/words.py --update    lower what is allowed to what there is
    python docs/tools/words.py --reset     allow what there is

Five kinds are counted, file by file, and a count may only fall: forbidden words in
*names* of modules, classes and functions, in *help*, in *messages* and on *pages*;
functions, properties aside, that are named by a *participle*; and sentences of help and
README that are too *long*.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from counts import FORBIDDEN, is_participle
from counts import WORDS as PROSE

ROOT = Path(__file__).parents[2]
ALLOWED = Path(__file__).with_suffix(".txt")
NAME = re.compile(
    rf"(?:^|_)({'|'.join(w.replace(' ', '_') for w in FORBIDDEN)})(?=_|$)"
)
MOST = 25  # words of a sentence

Found = tuple[str, str, int, str]
"""Kind, file, line and what stands there."""


def words_of(name: str) -> str:
    """Write a name in lower case with its words apart, as functions are named."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def names(file: str, tree: ast.Module) -> Iterator[Found]:
    """Find names of modules, classes and functions that forbidden words make."""
    if NAME.search(Path(file).stem):
        yield "names", file, 1, Path(file).stem
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            if NAME.search(words_of(node.name)):
                yield "names", file, node.lineno, node.name
        if isinstance(node, ast.FunctionDef) and is_participle(node.name):
            if not any("property" in ast.unparse(d) for d in node.decorator_list):
                yield "participle", file, node.lineno, node.name


def docstrings(tree: ast.Module) -> dict[int, ast.AST]:
    """Return the constants that are docstrings, and what they describe, by id."""
    found = {}
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            for part in body:
                if isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant):
                    found[id(part.value)] = node
    return found


def texts(file: str, tree: ast.Module) -> Iterator[tuple[str, int, str]]:
    """Yield the texts for users: kind ("help" or "messages"), line and text."""
    described = docstrings(tree)
    helps = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg in {"help", "epilog"}
        for part in ast.walk(node.value)
    }
    commands = file.startswith("postproc/cli/")
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            owner = described.get(id(node))
            command = isinstance(owner, ast.FunctionDef) and owner.decorator_list
            if id(node) in helps or (owner is not None and command and commands):
                yield "help", node.lineno, node.value
            elif owner is None and " " in node.value.strip():
                yield "messages", node.lineno, node.value


def assets(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a template or script of the HTML pages: line and text."""
    for number, line in enumerate(path.read_text("utf-8").split("\n"), 1):
        quoted = re.findall(r"\"[^\"]*\"|`[^`]*`", line)
        shown = [re.sub(r"\${[^}]*}", " ", text) for text in quoted if " " in text]
        if path.suffix == ".j2":
            shown.append(re.sub(r"<[^>]*>|{%.*?%}|{{.*?}}|\"[^\"]*\"", " ", line))
        yield from ((number, text) for text in shown)


def page(file: str) -> Iterator[tuple[int, str]]:
    """Yield line number and prose of a page: no code, neither blocks nor words."""
    fence = False
    for number, line in enumerate((ROOT / file).read_text("utf-8").split("\n"), 1):
        if line.lstrip().startswith(("```", "~~~")):
            fence = not fence
        elif not fence and not line.startswith("    "):
            yield number, re.sub(r"`[^`]*`|\]\([^)]*\)|https?:\S+", "`", line)


def long_sentences(text: str) -> list[str]:
    """Return the sentences of a text that have too many words."""
    prose = " ".join(text.split())
    return [s for s in re.split(r"(?<=[.?!:])\s+", prose) if len(s.split()) > MOST]


def paragraphs(file: str) -> Iterator[tuple[int, str]]:
    """Yield the paragraphs of a page that are prose, with their first lines."""
    first, held = 0, ""
    for number, line in [*page(file), (0, "")]:
        if not line.strip() or line.startswith(("#", "|", "-", "<", "![")):
            if held:
                yield first, held
            first, held = number, line[1:] if line.startswith("-") else ""
        else:
            first, held = (first if held else number), f"{held} {line}"


def pages() -> list[str]:
    """List the pages, from README on; what is history stays as it was written."""
    found = [
        *ROOT.glob("*.md"),
        *ROOT.glob("docs/*.md"),
        *ROOT.glob("docs/reference/*.md"),
        *ROOT.glob("docs/studies/*.md"),
    ]
    files = sorted(str(p.relative_to(ROOT)) for p in found)
    return [file for file in files if file != "CHANGELOG.md"]


def places() -> Iterator[Found]:
    """Find all that counts."""
    for path in sorted((ROOT / "postproc").rglob("*.py")):
        file = str(path.relative_to(ROOT))
        tree = ast.parse(path.read_text(encoding="utf-8"))
        yield from names(file, tree)
        for kind, line, text in texts(file, tree):
            for word in PROSE.findall(text):
                yield kind, file, line, word
            if kind == "help":
                for sentence in long_sentences(text):
                    yield "long", file, line, sentence
    html = ROOT / "postproc" / "report" / "html"
    for path in sorted([*html.rglob("*.j2"), *html.rglob("*.js")]):
        for line, text in assets(path):
            for word in PROSE.findall(text):
                yield "messages", str(path.relative_to(ROOT)), line, word
    for file in pages():
        for line, text in page(file):
            for word in PROSE.findall(text):
                yield "pages", file, line, word
    for line, text in paragraphs("README.md"):
        for sentence in long_sentences(text):
            yield "long", "README.md", line, sentence


def allowed() -> Counter[tuple[str, str]]:
    """Read how many of a kind a file may have."""
    rows = (line.split() for line in ALLOWED.read_text("utf-8").splitlines())
    return Counter({(kind, file): int(count) for count, kind, file in rows})


def write(counts: Counter[tuple[str, str]]) -> None:
    """Write how many of a kind a file may have."""
    rows = [f"{n} {kind} {file}\n" for (kind, file), n in sorted(counts.items()) if n]
    ALLOWED.write_text("".join(rows), encoding="utf-8")


def problems() -> list[str]:
    """Return where there is more of a kind than is allowed."""
    found, limit = list(places()), allowed()
    counts = Counter((kind, file) for kind, file, *_ in found)
    over = {key for key, count in counts.items() if count > limit[key]}
    return [
        f"{file}:{line}: {kind}: {what} (this file may have {limit[kind, file]})"
        for kind, file, line, what in found
        if (kind, file) in over
    ]


def main() -> None:
    """Check, list, or write what is allowed."""
    found = list(places())
    counts = Counter((kind, file) for kind, file, *_ in found)
    if "--list" in sys.argv:
        for kind, file, line, what in found:
            print(f"{file}:{line}: {kind}: {what}")
    elif "--reset" in sys.argv:
        write(counts)
    elif "--update" in sys.argv:
        write(counts & allowed())
    elif wrong := problems():
        sys.exit("\n".join(wrong))
    totals = Counter(kind for kind, *_ in found)
    print(", ".join(f"{kind}: {n}" for kind, n in sorted(totals.items())))


if __name__ == "__main__":
    main()
