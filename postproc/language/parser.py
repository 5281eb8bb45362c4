"""The one place where lark is used: grammars in, statements of a line out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import count
from pathlib import Path

import lark

from postproc.language import pdl2 as ast
from postproc.language.build import RULES, Rule
from postproc.language.entered import VALUE_RULES, Entered
from postproc.language.parts import Mark

_PACKAGE = Path(__file__).resolve().parent.parent
_NUMBERED_NAME = re.compile(
    r"'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\""
    r"|(?<![\w$])(?P<name>[A-Za-z_]\w*\d\w*)(?!\w)(?!\s*::)"
)
_NAME_MARK = "\x01"
_FAILED = object()


def grammar(name: str) -> str:
    """Return the text of a grammar, from the package or from beside it.

    A wheel carries the grammars inside of the package; an editable install reads them
    where they are kept.
    """
    for folder in (_PACKAGE / "grammars", _PACKAGE.parent / "grammars"):
        path = folder / f"{name}.lark"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise FileNotFoundError(f"grammar {name}.lark is not installed")


@cache
def line_parser(name: str, start: str) -> lark.Lark:
    """Return the LALR parser of a grammar."""
    return lark.Lark(
        grammar(name),
        parser="lalr",
        lexer="contextual",
        start=start,
        maybe_placeholders=False,
    )


def parse_line(mask: str) -> ast.Statement:
    """Parse the mask of one logical line of PDL2.

    Programs name points ``p1`` to ``p3000``: names with digits are masked too, so that
    lark sees each form of line once.

    Returns:
        Its statement, or `Unknown` where the grammar knows none.
    """
    found = _parse("pdl2", mask, RULES)
    if found is _FAILED:
        return ast.Unknown(mask)
    return found if isinstance(found, ast.Statement) else ast.Statement()


def parse_value_line(mask: str) -> Entered | None:
    """Parse the mask of one line of a variable file, None where it is none."""
    found = _parse("lsv", mask, VALUE_RULES)
    return found if isinstance(found, Entered) else None


def _parse(name: str, mask: str, rules: Mapping[str, Rule]) -> object:
    """Parse a mask and build what it says, _FAILED where the grammar has no rule."""
    names: list[str] = []

    def mark(found: re.Match[str]) -> str:
        if found["name"] is None:
            return found.group()
        names.append(found["name"])
        return _NAME_MARK

    if _NAME_MARK in mask:
        return _FAILED
    tree = _tree(name, _NUMBERED_NAME.sub(mark, mask))
    if tree is None:
        return _FAILED
    try:
        return _build(tree, names, rules)
    except RecursionError:  # hundreds of nested parentheses: no program has them
        return _FAILED


@lru_cache(maxsize=8192)
def _tree(name: str, form: str) -> lark.Tree[lark.Token] | None:
    try:
        return line_parser(name, "line").parse(form)
    except lark.exceptions.LarkError:
        return None


def _build(
    tree: lark.Tree[lark.Token], names: list[str], rules: Mapping[str, Rule]
) -> object:
    """Build what a tree says, stamping names and counting numbers."""
    waiting = iter(names)
    slots = count()

    def walk(node: lark.Tree[lark.Token] | lark.Token) -> object:
        if isinstance(node, lark.Token):
            if node.type == "NUMBER":
                return ast.Number(next(slots))
            text = next(waiting) if node == _NAME_MARK else str(node)
            return Mark(text, node.type)
        return rules[str(node.data)]([walk(child) for child in node.children])

    return walk(tree)
