"""The one place where lark is used: grammars in, statements of a line out."""

from __future__ import annotations

import re
from functools import cache, lru_cache
from pathlib import Path

import lark

from postproc.language import pdl2 as ast
from postproc.language.build import RULES, Mark

_PACKAGE = Path(__file__).resolve().parent.parent
_NUMBERED_NAME = re.compile(
    r"'(?:\\.|[^'\\])*'|'[^']*'|\"[^\"]*\""
    r"|(?<![\w$])(?P<name>[A-Za-z_]\w*\d\w*)(?!\w)(?!\s*::)"
)
_NAME_MARK = "\x01"


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
    names: list[str] = []

    def mark(found: re.Match[str]) -> str:
        if found["name"] is None:
            return found.group()
        names.append(found["name"])
        return _NAME_MARK

    tree = None
    if _NAME_MARK not in mask:
        tree = _tree(_NUMBERED_NAME.sub(mark, mask))
    if tree is None:
        return ast.Unknown(mask)
    try:
        return _build(tree, names)
    except RecursionError:  # hundreds of nested parentheses: no program has them
        return ast.Unknown(mask)


@lru_cache(maxsize=8192)
def _tree(form: str) -> lark.Tree[lark.Token] | None:
    try:
        return line_parser("pdl2", "line").parse(form)
    except lark.exceptions.LarkError:
        return None


def _build(tree: lark.Tree[lark.Token], names: list[str]) -> ast.Statement:
    """Build the statement of a tree, stamping names and counting numbers."""
    waiting = iter(names)
    slots = iter(range(len(names) + _count_numbers(tree)))

    def walk(node: lark.Tree[lark.Token] | lark.Token) -> object:
        if isinstance(node, lark.Token):
            if node.type == "NUMBER":
                return ast.Number(next(slots))
            text = next(waiting) if node == _NAME_MARK else str(node)
            return Mark(text, node.type)
        return RULES[str(node.data)]([walk(child) for child in node.children])

    statement = walk(tree)
    return statement if isinstance(statement, ast.Statement) else ast.Statement()


def _count_numbers(tree: lark.Tree[lark.Token]) -> int:
    return sum(1 for _ in tree.scan_values(lambda token: token.type == "NUMBER"))
