"""Count what makes the package hard to read: options, names, findings, words.

    python docs/tools/counts.py

A participle name is one whose first word ends in "ed" or is an irregular participle. A
private function has one caller if the package mentions it once, and calls it there: a
callback, a rule in a table or a property has no caller that could take its body in. It
is small with a body of five lines or less.
Words are those that FORBIDDEN lists, in pages, in the help of commands, and in texts
of the package that hold a blank and are no docstrings.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

ROOT = Path(__file__).parents[2]
PACKAGE, DOCS = ROOT / "postproc", ROOT / "docs"
SMALL = 5  # lines of a body
FORBIDDEN = (
    "told", "said", "came of", "left", "taken", "sure", "anew", "whatever", "at hand",
    "nobody knows",
)  # fmt: skip
# Where it is a side, left is not forbidden.
RIGHT = r"(?<!to the )(?<!on the )(?!left (?:and|or|to) right\b)"
WORDS = re.compile(rf"{RIGHT}\b({'|'.join(FORBIDDEN)})\b", re.I)
IRREGULAR = frozenset(
    "begun bent bound broken built chosen done drawn driven found given gone "
    "grown held hidden kept known laid led left lost made meant met paid said "
    "seen sent shown spun stood swept taken taught thought thrown "
    "told torn turned understood unsaid unsure woven worn written".split()
)
NO_PARTICIPLES = frozenset("need seed speed feed bed embed".split())
Command = Any  # click's, which typer brings along
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Defined:
    """A function of the package: its name, and the lines of its body."""

    name: str
    lines: int


def modules() -> Iterator[ast.Module]:
    """Yield the syntax trees of the package."""
    for path in sorted(PACKAGE.rglob("*.py")):
        yield ast.parse(path.read_text("utf-8"), str(path))


def functions(tree: ast.AST) -> Iterator[Defined]:
    """Yield the functions and methods of a module."""
    for node in ast.walk(tree):
        if isinstance(node, Function):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            size = body[-1].end_lineno - body[0].lineno + 1 if body else 0  # type: ignore[operator]
            yield Defined(node.name, size)


def names_of(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Yield the names that nodes mention, other than by defining them."""
    for node in nodes:
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


def calls(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield what a module calls."""
    return (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))


def is_participle(name: str) -> bool:
    """Return True if the first word of a name is a participle.

    >>> is_participle("_told_once"), is_participle("joined"), is_participle("speed")
    (True, True, False)
    """
    first = name.strip("_").partition("_")[0]
    regular = first.endswith("ed") and first not in NO_PARTICIPLES
    return regular or first in IRREGULAR


def is_private(name: str) -> bool:
    """Return True if a name begins with one underscore."""
    return name.startswith("_") and not name.startswith("__")


def texts(tree: ast.Module) -> Iterator[str]:
    """Yield texts with a blank that are no docstrings."""
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | Function)
        and ast.get_docstring(node, clean=False) is not None
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in docs:
            if isinstance(node.value, str) and " " in node.value:
                yield node.value


def commands() -> dict[str, Command]:
    """Return all commands by their names."""
    from postproc.cli.commands import app

    found: dict[str, Command] = {}

    def walk(command: Command, name: str) -> None:
        if below := getattr(command, "commands", None):
            for word, one in below.items():
                walk(one, f"{name} {word}".strip())
        else:
            found[name] = command

    walk(typer.main.get_command(app), "")
    return found


def options(command: Command) -> int:
    """Count the options of a command, --help not among them."""
    return sum(param.param_type_name == "option" for param in command.params)


def help_of(command: Command) -> str:
    """Return the help of a command as a screen shows it."""
    return str(command.get_help(typer.Context(command)))


def pages() -> Iterator[str]:
    """Yield the pages of the documentation, without its history and code in lines."""
    for path in (ROOT / "README.md", *sorted(DOCS.rglob("*.md"))):
        if "history" not in path.parts:
            yield re.sub(r"`[^`\n]+`", "`", path.read_text("utf-8"))


def documented() -> tuple[int, int]:
    """Return how many codes of findings are documented, of how many."""
    from postproc.diagnostics import Code

    text = (DOCS / "findings.md").read_text("utf-8")
    return sum(f"`{code}`" in text for code in Code), len(Code)


def words(found: Iterator[str]) -> int:
    """Count the words of `WORDS` in texts."""
    return sum(len(WORDS.findall(text)) for text in found)


def main() -> None:
    """Print the counts."""
    trees = list(modules())
    known = [f for tree in trees for f in functions(tree)]
    mentioned = Counter(name for tree in trees for name in names_of(ast.walk(tree)))
    called = {name for tree in trees for name in names_of(calls(tree))}
    once = {name for name, count in mentioned.items() if count == 1} & called
    private = [f for f in known if is_private(f.name) and f.name in once]
    every = commands()
    lines = sum(len(p.read_text("utf-8").splitlines()) for p in PACKAGE.rglob("*.py"))
    done, codes = documented()
    print(f"{sum(map(options, every.values())):6d} options of {len(every)} commands")
    for name, command in every.items():
        print(f"{options(command):6d}   {name}")
    print(
        f"{sum(is_participle(f.name) for f in known):6d} functions named by participles"
    )
    print(f"{len(private):6d} private functions with one caller")
    print(f"{sum(f.lines <= SMALL for f in private):6d}   of five lines or less")
    print(f"{done:6d} codes of findings documented, of {codes}")
    print(f"{lines:6d} lines of the package")
    print(f"{words(pages()):6d} words of the list in pages")
    print(f"{words(map(help_of, every.values())):6d} .. in the help of commands")
    inside = words(t for tree in trees for t in texts(tree))
    print(f"{inside:6d} .. in texts of the package")


if __name__ == "__main__":
    main()
