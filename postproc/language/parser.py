"""The one place where lark is used: grammars in, statements of a line out."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache, lru_cache
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import cast

import lark

from postproc.language import pdl2 as ast
from postproc.language.build import RULES, Rule
from postproc.language.entered import VALUE_RULES, Entered
from postproc.language.forms import filled, open_name
from postproc.language.kept_tables import keep, kept, key_of
from postproc.language.numbered import NAME_MARK, UNREADABLE, form_of
from postproc.language.parts import Mark

_PACKAGE = Path(__file__).resolve().parent.parent
_FAILED = object()
_OPTIONS = {"parser": "lalr", "lexer": "contextual", "maybe_placeholders": False}


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
    """Return the LALR parser of a grammar, its tables from an earlier run if kept."""
    text = grammar(name)
    key = key_of(text, start, repr(_OPTIONS), lark.__version__, sys.version)
    data = kept(key)
    if data is not None:
        with suppress(Exception):  # whatever is wrong with it, it can be made
            return lark.Lark.load(BytesIO(data))
    made = lark.Lark(text, start=start, **_OPTIONS)
    tables = BytesIO()
    made.save(tables)
    keep(key, tables.getvalue())
    return made


@lru_cache(maxsize=8192)
def parse_form(form: str) -> ast.Statement:
    """Parse the form of a logical line of PDL2, `Unknown` where the grammar cannot."""
    found = _parse("pdl2", form, RULES)
    if found is _FAILED:
        numbered = count()
        text = re.sub(NAME_MARK, lambda _: open_name(next(numbered)), form)
        return ast.Unknown(text if form[:2] != UNREADABLE else form[2:])
    return found if isinstance(found, ast.Statement) else ast.Statement()


@lru_cache(maxsize=8192)
def parse_value_form(form: str) -> Entered | None:
    """Parse the form of a line of a variable file, None where the grammar cannot."""
    found = _parse("lsv", form, VALUE_RULES)
    return found if isinstance(found, Entered) else None


def parse_line(mask: str) -> ast.Statement:
    """Parse the mask of one logical line of PDL2.

    Returns:
        Its statement, or `Unknown` where the grammar knows none.
    """
    form, names = form_of(mask)
    said = parse_form(form)
    return cast(ast.Statement, filled(said, names)) if names else said


def _parse(name: str, form: str, rules: Mapping[str, Rule]) -> object:
    """Parse a form and build what it says, _FAILED where the grammar has no rule."""
    if form.startswith(UNREADABLE):
        return _FAILED
    try:
        return _build(line_parser(name, "line").parse(form), rules)
    except lark.exceptions.LarkError:
        return _FAILED
    except RecursionError:  # hundreds of nested parentheses: no program has them
        return _FAILED


def _build(tree: lark.Tree[lark.Token], rules: Mapping[str, Rule]) -> object:
    """Build what a tree says, counting its names and its numbers."""
    names, slots = count(), count()

    def walk(node: lark.Tree[lark.Token] | lark.Token) -> object:
        if isinstance(node, lark.Token):
            if node.type == "NUMBER":
                return ast.Number(next(slots))
            text = open_name(next(names)) if node == NAME_MARK else str(node)
            return Mark(text, node.type)
        return rules[str(node.data)]([walk(child) for child in node.children])

    return walk(tree)
