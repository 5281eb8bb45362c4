"""From the form of one statement to what a language makes of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import Any

import lark

from postproc.language.ir import NotUnderstood, Num, SourceStatement
from postproc.language.text.grammars import line_parser
from postproc.language.text.lexer import NAME_MARK
from postproc.language.text.templates import open_name

LONGEST = 1 << 18  # characters of a form; arrays of a thousand targets have 60,000
DEEPEST = 200  # operators or brackets within each other; followed by recursion
KEPT = 8192  # forms of which is known what they say
Children = Sequence[Any]
FAILED = object()
"""What stands for a form that a grammar cannot read."""


class Word(str):
    """A token: text with the name of its terminal."""

    kind: str

    def __new__(cls, text: str, kind: str) -> Word:
        """Remember the terminal beside the text."""
        word = super().__new__(cls, text)
        word.kind = kind
        return word


class UnreadableError(Exception):
    """Too many operators stand within each other, or a word where a name must."""


@dataclass(frozen=True, eq=False)
class FormParser:
    """Parses forms with a grammar, and builds what its rules say.

    Attributes:
        grammar: Its name.
        rules: What each rule makes of what its children gave.
        reserved: Words that name nothing.
        start: The start symbol of the grammar.
    """

    grammar: str
    rules: Mapping[str, Callable[[Children], Any]]
    reserved: Collection[str] = ()
    start: str = "statement"

    def parse(self, form: str) -> object:
        """Build what a form says, `FAILED` where the grammar cannot read it."""
        if len(form) > LONGEST:
            return FAILED
        try:
            return self._build(line_parser(self.grammar, self.start).parse(form))
        except (lark.exceptions.LarkError, UnreadableError):
            return FAILED

    @lru_cache(maxsize=16384)  # noqa: B019 - there is one for each grammar
    def parse_statement(self, form: str) -> SourceStatement:
        """Parse the form of a statement, `NotUnderstood` where the grammar cannot."""
        found = self.parse(form)
        if isinstance(found, SourceStatement):
            return found
        numbered = count()
        return NotUnderstood(
            re.sub(NAME_MARK, lambda _: open_name(next(numbered)), form)
        )

    @property
    def statements(self) -> Callable[[str], SourceStatement]:
        """What parses the forms of statements, each once."""
        return lru_cache(KEPT)(self.parse_statement)

    def _build(self, tree: lark.Tree[lark.Token]) -> object:
        """Build what a tree says, counting its names and its numbers."""
        names, slots = count(), count()

        def walk(node: lark.Tree[lark.Token] | lark.Token, depth: int = 0) -> object:
            if depth > DEEPEST:
                raise UnreadableError
            if isinstance(node, lark.Token):
                if node.type == "NUMBER":
                    return Num(next(slots))
                text = str(node)
                if node.type == "NAME" and text.lower() in self.reserved:
                    raise UnreadableError
                if NAME_MARK in text:
                    text = text.replace(NAME_MARK, open_name(next(names)))
                return Word(text, node.type)
            children = [walk(child, depth + 1) for child in node.children]
            return self.rules[str(node.data)](children)

        return walk(tree)
